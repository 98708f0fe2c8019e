"""Materials whose nodes ask for rays, and pictures of what they tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import scene as s
from glint.engine.program.graph import Graph, Value
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene.problems import scene_problems
from native_tools import draw, needs_core
from test_occlusion_pass import floor_and

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
AO = {"samples": 16, "inside": 0, "only_local": 0, "of_world": 0}
FEW = {"samples": 4}


def occlusion(
    distance: float | None = 2.0, lobe: str = "EMISSION", normal=None, **settings
) -> s.Material:
    """A lobe in the grey that the operation gives; a distance of None is the world's."""
    graph = Graph()
    if normal is None:
        normal = graph.apply(BY_NAME["normal"])[0]
    elif not isinstance(normal, Value):
        normal = graph.constant(normal)
    chosen = {**AO, **settings, "of_world": distance is None}
    reach = graph.constant(distance or 0.0)
    (value,) = graph.apply(BY_NAME["ambient_occlusion"], reach, normal, **chosen)
    return shown(graph, value, lobe)


def shown(graph: Graph, value: Value, lobe: str = "EMISSION") -> s.Material:
    color = (
        graph.apply(BY_NAME["combine_xyz"], value, value, value)[0] if value.width == 1 else value
    )
    program = compile_program(graph, [color])
    return s.Material("asks", (s.Lobe(lobe, (s.Input(output=0),)),), program=program)


def floor_of(material: s.Material, *others, **more) -> s.Scene:
    scene = floor_and(*others, **more)
    return replace(scene, materials=(material, *scene.materials[1:]))


def seen(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(h, w) of 64 samples at the pixels' centres: 1024 directions."""
    assert scene_problems(scene) == []
    plan = {"samples": 64, "filter_width": 0.0, **settings}
    picture = draw(scene, backend=backend, **plan).combined
    assert np.isfinite(picture).all()
    np.testing.assert_array_equal(picture[..., 0], picture[..., 2])
    return picture[..., 0].astype(float)


# --- bevels


def bevelled(radius: float = 0.4, samples: int = 16) -> s.Material:
    graph = Graph()
    (normal,) = graph.apply(BY_NAME["bevel"], graph.constant(radius), samples=samples)
    return shown(graph, normal)


def normals_of(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    assert scene_problems(scene) == []
    plan = {"samples": 64, "filter_width": 0.0, **settings}
    picture = draw(scene, backend=backend, **plan).combined[..., :3].astype(float)
    assert np.isfinite(picture).all()
    return picture


# --- rays


def cast(
    output: int,
    direction=(0.0, 0.0, 1.0),
    length: float = 5.0,
    position=None,
    name: str = "raycast",
    **settings,
) -> s.Material:
    graph = Graph()
    place = graph.apply(BY_NAME["position"], shift=0)[0]
    chosen = {"only_local": 0, "from_point": position is None, **settings}
    if position is not None:
        place = graph.apply(
            BY_NAME["scaled_sum"], place, graph.constant(1.0), graph.constant(position)
        )[0]
    found = graph.apply(
        BY_NAME[name], place, graph.constant(direction), graph.constant(length), **chosen
    )
    return shown(graph, found[output])


HIT, OWN, DISTANCE, POSITION, NORMAL = range(5)


def _coloured(thing: s.Mesh | s.Strands, channels: int) -> s.Mesh | s.Strands:
    """With an attribute that is (x, y, 2, 0.25) at its vertices, as far as it has channels."""
    rows = np.concatenate([thing.vertices[:, :2], np.full((len(thing.vertices), 2), (2, 0.25))], 1)
    told = s.Attribute("told", s.POINT, rows[:, :channels].astype(np.float32))
    return replace(thing, attributes=(*thing.attributes, told))
