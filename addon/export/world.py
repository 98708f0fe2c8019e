"""Blender's world: what rays see that hit nothing, and the light from all around."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...engine.lights.dome import (
    cell_shares,
    directions,
    radiance_along,
    radiance_map,
    within_range,
)
from ...engine.program.graph import Value
from ...engine.program.program import compile_program, instructions
from ...engine.program.table import BY_NAME
from ...engine.scene import Camera, Light, Medium, Mist, World
from .images.images import Images
from .lights import Lights
from .materials.closures import LobeKey
from .materials.evaluator import Evaluator
from .materials.expressions import Expressions
from .materials.graph import end_of, images_behind, read_tree
from .materials.nodes_volume import medium_of
from .report import Report
from .shader_nodes.sky import SkyReader, Sun
from .shader_nodes.volume import VolumeReader
from .unsupported import note_world

_FARTHEST = 1e30
"""That Ambient Occlusion looks."""

BLACK = (0.0, 0.0, 0.0)
_ANY_CAMERA = Camera("PERSPECTIVE", np.eye(3, 4), (-0.3, 0.4, -0.3, 0.4), (1, 1))


@dataclass(frozen=True, eq=False)
class Sky:
    """A world as the engine has it. light: None where it is black, or lights nothing. suns: what
    shines in it but is too small for a map of directions.
    """

    world: World
    light: Light | None
    suns: tuple[Light, ...] = ()

    def lights_with(self, lights: Lights) -> tuple[Light, ...]:
        """The lamps, then the world's light, which comes in by portals."""
        own, found = self.light, lights.openings
        own = replace(own, openings=found) if own is not None and found is not None else own
        return (*lights.lights, *self.suns, *((own,) if own is not None else ()))


@dataclass(frozen=True)
class _Visibility:
    """Which rays see the world, or are lit by it."""

    camera: bool = True
    matt: bool = True
    gloss: bool = True
    glass: bool = True
    media: bool = True

    @property
    def lights(self) -> bool:
        return self.matt or self.gloss or self.media

    def of_light(self, light: Light) -> Light:
        return replace(
            light, lights_matt=self.matt, lights_gloss=self.gloss, lights_media=self.media
        )


def export_world(world: Any, transparent: bool, images: Images, report: Report) -> Sky:
    """The evaluated world (or None: black). images: only this world's."""
    if world is None:
        return Sky(World(transparent=transparent), None)
    visibility = _visibility(world)
    note_world(world, report)
    discs: list[Sun] = []
    expressions, radiance = _radiance(world, images, report, discs)
    without = _radiance(world, images, Report(), None) if discs else (expressions, radiance)
    values = _map(*without, images)
    _note_light(world.name, expressions, radiance, images, visibility.gloss, report)
    seen = _as_seen(expressions, radiance, visibility)
    mean = tuple(float(x) for x in (values * cell_shares(*values.shape[:2])).sum((0, 1)))
    medium = _medium(world, images, report)
    varies = medium is not None and medium.program is not None
    own = {"textures": tuple(images.textures)} if varies or seen.constant is None else {}
    own |= (
        {"background": seen.constant}
        if seen.constant is not None
        else {"background": mean, "program": compile_program(expressions.graph, [seen])}
    )
    shines = visibility.lights and values.any()
    return Sky(
        World(
            mean if shines and visibility.matt else BLACK,
            transparent=transparent,
            medium=medium,
            **own,
        ),
        visibility.of_light(Light(world.name, "DOME", np.eye(3, 4), radiance=values))
        if shines
        else None,
        tuple(
            visibility.of_light(sun)
            for sun in _suns(world.name, discs, (expressions, radiance), without, images)
        )
        if visibility.lights
        else (),
    )


def with_light_group(sky: Sky, group: int) -> Sky:
    """With all of its light in a light group."""
    if group < 0:
        return sky
    light = sky.light and replace(sky.light, light_group=group)
    suns = tuple(replace(sun, light_group=group) for sun in sky.suns)
    return replace(sky, world=replace(sky.world, light_group=group), light=light, suns=suns)


def with_pass_settings(sky: Sky, world: Any, report: Report) -> Sky:
    """With what passes read of the scene's own world, which it keeps where a layer leaves the sky
    out.
    """
    if world is None:
        return sky
    given, distance = world.mist_settings, min(world.light_settings.distance, _FARTHEST)
    mist = Mist(given.start, given.depth, given.falloff)
    if not np.isfinite([mist.start, mist.depth, distance]).all():
        report.note(
            "Mist Pass or Ambient Occlusion of the world {} have a distance that is no number: 0 "
            "is used; set it anew",
            world.name,
        )
        start, depth, distance = np.nan_to_num([mist.start, mist.depth, distance])
        mist, distance = replace(mist, start=float(start), depth=float(depth)), float(distance)
    if mist == sky.world.mist and distance == sky.world.occlusion_distance:
        return sky
    return replace(sky, world=replace(sky.world, mist=mist, occlusion_distance=distance))


def _map(expressions: Expressions, radiance: Value, images: Images) -> np.ndarray:
    """Radiance by direction, as `engine.lights.dome` has it."""
    if radiance.constant is not None:
        return within_range(np.array(radiance.constant).reshape(1, 1, 3))
    return radiance_map(compile_program(expressions.graph, [radiance]), images.textures)


def _suns(
    name: str,
    discs: list[Sun],
    whole: tuple[Expressions, Value],
    without: tuple[Expressions, Value],
    images: Images,
) -> tuple[Light, ...]:
    """A light for each disc, as bright as it makes what is seen there brighter."""
    lights = []
    for sun in dict.fromkeys(discs):
        axes = _axes(np.array(sun.direction))
        points = axes @ _disc_points(sun.size)
        gain = _along(*whole, images, points) - _along(*without, images, points)
        power = gain.mean(1) * 2 * np.pi * (1 - np.cos(sun.size / 2))
        strength = float(np.abs(power).max())
        if strength > 0 and np.isfinite(strength):
            color = tuple(float(x) for x in power / strength)
            frame = np.column_stack([axes, np.zeros(3)])
            lights.append(Light(name, "SUN", frame, color, strength, angle=sun.size))
    return tuple(lights)


def _along(
    expressions: Expressions, radiance: Value, images: Images, points: np.ndarray
) -> np.ndarray:
    """(3, n) radiance from directions (3, n)."""
    if radiance.constant is not None:
        return np.repeat(np.array(radiance.constant)[:, None], points.shape[1], 1)
    program = compile_program(expressions.graph, [radiance])
    return radiance_along(program, images.textures, points)


def _note_light(
    name: str,
    expressions: Expressions,
    radiance: Value,
    images: Images,
    gloss: bool,
    report: Report,
) -> None:
    """Tells where the world's light is another than what rays see. gloss: whether it has some."""
    if radiance.constant is not None:
        return
    program, along = compile_program(expressions.graph, [radiance]), directions(8, 16)
    used = {step.operation.name for step in instructions(program)}

    def differs(**how: Any) -> bool:
        given, other = (radiance_along(program, images.textures, along, **k) for k in ({}, how))
        return not np.allclose(given, other, rtol=1e-3, atol=1e-6)

    if gloss and "light_path" in used and differs(kind="mirror"):
        report.note(
            "The world {} is to rough reflections as to matt surfaces, where its Light Path tells "
            "them apart: use mirrors (a roughness up to 0.05)",
            name,
        )
    if not used.isdisjoint(("camera_position", "window")) and differs(seen=(_ANY_CAMERA, along)):
        report.note(
            "The light of the world {} has camera and window coordinates of 0, which are seen "
            "right: use Generated for it, with a Mix Shader by Is Camera Ray",
            name,
        )


def _axes(up: np.ndarray) -> np.ndarray:
    """(3, 3) orthonormal columns, the last of them up."""
    side = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    side /= np.sqrt((side * side).sum())
    return np.column_stack([side, np.cross(up, side), up])


def _disc_points(size: float, count: int = 256) -> np.ndarray:
    """(3, count) unit, spread evenly over a disc of that angular diameter round +z."""
    k = np.arange(count) + 0.5
    cosine = 1 - k / count * (1 - np.cos(size / 2))
    sine, turn = np.sqrt(1 - cosine * cosine), np.pi * (1 + 5**0.5) * k
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine])


def _radiance(
    world: Any, images: Images, report: Report, suns: list[Sun] | None
) -> tuple[Expressions, Value]:
    """What the world gives, as a vector over directions. suns: as SkyReader has it."""
    evaluator = Evaluator(world.name, images, report, partial(SkyReader, suns=suns))
    read = read_tree(world)
    expressions, tree = evaluator.expressions, read.tree
    if tree is None:
        return expressions, expressions.constant(tuple(float(x) for x in world.color))
    surface = end_of(tree, "Surface")
    if surface is None:
        evaluator.note("Worlds without an output node are black: {}; add a World Output")
        return expressions, expressions.constant(BLACK)
    images.expect(images_behind(surface))
    closure = evaluator.closure(surface)
    return expressions, expressions.value_of(closure.get(LobeKey("EMISSION"), ()))


def _medium(world: Any, images: Images, report: Report) -> Medium | None:
    """What is everywhere."""
    read = read_tree(world)
    place = end_of(read.tree, "Volume")
    if place is None or not place.socket.is_linked:
        return None
    images.expect(images_behind(place))
    evaluator = Evaluator(world.name, images, report, partial(VolumeReader, is_world=True))
    step = getattr(getattr(world, "cycles", None), "volume_step_size", 1.0)
    return medium_of(place, evaluator, max(step, 1e-3))


def _visibility(world: Any) -> _Visibility:
    """Cycles' own switches, where they are."""
    flags = getattr(world, "cycles_visibility", None)
    if flags is None:
        return _Visibility()
    return _Visibility(flags.camera, flags.diffuse, flags.glossy, flags.transmission, flags.scatter)


def _as_seen(expressions: Expressions, radiance: Value, visibility: _Visibility) -> Value:
    """The radiance for the rays that see the world."""
    camera, gloss, glass = map(float, (visibility.camera, visibility.gloss, visibility.glass))
    if camera == gloss == glass:
        return radiance if camera else expressions.constant(BLACK)
    share = expressions.constant((gloss,) * 3)
    for operation, output, more in (
        ("light_path", 0, camera - gloss),
        ("ray_depth", 3, glass - gloss),  # the last bounce was a refraction
    ):
        if more:
            kind = expressions.vector(expressions.graph.apply(BY_NAME[operation])[output])
            share = expressions.apply("scaled_sum", kind, expressions.constant(more), share)
    return expressions.apply("product", radiance, share)
