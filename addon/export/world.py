"""Blender's world: what rays see that hit nothing, and the light from all around."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...engine.dome import cell_shares, radiance_map, within_range
from ...engine.program.graph import Value
from ...engine.program.program import compile_program
from ...engine.scene import Light, World
from .evaluator import Evaluator, LobeKey
from .expressions import Expressions
from .graph import Place, images_behind, node_tree, socket_named
from .images import Images
from .report import Report
from .shader_nodes.sky import SkyReader

BLACK = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Sky:
    """A world as the engine has it. light: None where it is black, or lights nothing."""

    world: World
    light: Light | None

    def lights_with(self, lamps: list[Light]) -> tuple[Light, ...]:
        """The lamps, then the world's light."""
        return (*lamps, self.light) if self.light is not None else tuple(lamps)


@dataclass(frozen=True)
class _Visibility:
    """Which rays see the world, or are lit by it."""

    camera: bool = True
    bounced: bool = True
    lights: bool = True


def export_world(world: Any, transparent: bool, images: Images, report: Report) -> Sky:
    """The evaluated world (or None: black). images: only this world's."""
    if world is None:
        return Sky(World(transparent=transparent), None)
    visibility = _visibility(world, report)
    expressions, radiance = _radiance(world, images, report)
    if radiance.constant is not None:
        values = within_range(np.array(radiance.constant).reshape(1, 1, 3))
    else:
        program = compile_program(expressions.graph, [radiance])
        values = radiance_map(program, images.textures)
    seen = _as_seen(expressions, radiance, visibility)
    mean = tuple(float(x) for x in (values * cell_shares(*values.shape[:2])).sum((0, 1)))
    own = (
        {"background": seen.constant}
        if seen.constant is not None
        else {
            "background": mean,
            "program": compile_program(expressions.graph, [seen]),
            "textures": tuple(images.textures),
        }
    )
    shines = visibility.lights and values.any()
    return Sky(
        World(mean if shines else BLACK, transparent=transparent, **own),
        Light(world.name, "DOME", np.eye(3, 4), radiance=values) if shines else None,
    )


def _radiance(world: Any, images: Images, report: Report) -> tuple[Expressions, Value]:
    """What the world gives, as a vector over directions."""
    evaluator = Evaluator(world.name, images, report, reader=SkyReader)
    expressions, tree = evaluator.expressions, node_tree(world)
    if tree is None:
        return expressions, expressions.constant(tuple(float(x) for x in world.color))
    output = tree.get_output_node("ALL") or tree.get_output_node("CYCLES")
    if output is None:
        return expressions, expressions.constant(BLACK)
    if socket_named(output.inputs, "Volume").is_linked:
        report.note("Volumes are not rendered: {}", world.name)
    surface = Place(socket_named(output.inputs, "Surface"))
    images.expect(images_behind(surface))
    closure = evaluator.closure(surface)
    return expressions, expressions.value_of(closure.get(LobeKey("EMISSION"), ()))


def _visibility(world: Any, report: Report) -> _Visibility:
    """Cycles' own switches, where they are."""
    flags = getattr(world, "cycles_visibility", None)
    if flags is None:
        return _Visibility()
    bounced, lights = flags.glossy or flags.transmission, flags.diffuse or flags.glossy
    if flags.glossy != flags.transmission or flags.diffuse != flags.glossy:
        report.note(
            "The world {} is seen by reflections and refractions alike, and lights what either "
            "diffuse or glossy rays see",
            world.name,
        )
    return _Visibility(flags.camera, bounced, lights)


def _as_seen(expressions: Expressions, radiance: Value, visibility: _Visibility) -> Value:
    """The radiance for the rays that see the world."""
    if visibility.camera and visibility.bounced:
        return radiance
    if not (visibility.camera or visibility.bounced):
        return expressions.constant(BLACK)
    camera = expressions.vector(expressions.apply("light_path"))
    share = (
        camera
        if visibility.camera
        else expressions.apply(
            "scaled_sum", camera, expressions.constant(-1.0), expressions.constant((1.0,) * 3)
        )
    )
    return expressions.apply("product", radiance, share)
