"""Programs in pictures: whatever a material computes, both tracers draw the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations import Operation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME, OPERATIONS
from glint.engine.reference.program import apply
from native_tools import needs_core

pytestmark = needs_core

POINT_READERS = [o for o in OPERATIONS if o.reads_point and not o.arguments]
SIZE = 24


def look_down(kind: str) -> s.Camera:
    """From above and aside, the axes scaled, so that no part of a formula can go missing."""
    right, up = np.array([1.0, 0.2, 0.0]), np.array([-0.2, 1.0, 0.3])
    right, up = right / np.linalg.norm(right), up / np.linalg.norm(up)
    back = np.cross(right, up)
    matrix = np.stack([2 * right, up, back, np.array([0.3, -0.5, 6.0])], 1)
    half = 0.35 if kind == "PERSPECTIVE" else 1.8
    return s.Camera(kind, matrix, (-half / 2, half / 2, -half, half), (SIZE, SIZE))


def bowl() -> s.Mesh:
    """A smooth, bent grid with a UV map and a colour."""
    line = np.linspace(-1, 1, 9, dtype=np.float32)
    x, y = np.meshgrid(line, line)
    vertices = np.stack([x, y, 0.4 * (x * x - y)], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    quads = np.stack([corner, corner + 1, corner + 10, corner + 9], 1)
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]).astype(np.uint32)
    normals = np.stack([-0.8 * x, 0.4 + 0 * x, 1 + 0 * x], -1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    color = np.stack([x, y, x * y, 0.5 + x / 4], -1).reshape(-1, 4).astype(np.float32)
    uv = np.stack([x * 2, y - x], -1).reshape(-1, 2).astype(np.float32)
    return s.Mesh(
        "bowl",
        vertices,
        triangles,
        normals=s.Attribute("normals", s.POINT, normals.astype(np.float32)),
        attributes=(s.Attribute("map", s.POINT, uv), s.Attribute("color", s.POINT, color)),
    )


def things() -> tuple[tuple, tuple]:
    """A smooth mesh, mirrored and sheared, a sphere seen from within as well, and a polygon."""
    ball = s.Spheres("ball", np.array([[0.5, 0.2, 0.1]], np.float32), np.array([0.5], np.float32))
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    face = s.Polygons("face", square, np.array([0, 4], np.uint32), np.arange(4, dtype=np.uint32))
    matrices = np.zeros((3, 3, 4))
    matrices[0] = [[-1.2, 0.3, 0, -0.6], [0, 1, 0.2, 0], [0, 0.1, 1, 0.1]]
    matrices[1] = [[1, 0, 0, 0.2], [0, 1.5, 0, -0.4], [0.2, 0, 0.8, 0.9]]
    matrices[2] = [[0.9, 0.1, 0, -0.2], [0, 1, 0, -1.6], [0, 0.5, 1, 0.3]]
    instances = tuple(s.Instances(str(k), k, matrices[k : k + 1], (0,)) for k in range(3))
    return (bowl(), ball, face), instances


def new_graph() -> Graph:
    return Graph(lambda operation, arguments, settings: apply(operation, arguments, settings))


def scene_of(material: s.Material, kind: str = "PERSPECTIVE", **more) -> s.Scene:
    geometries, instances = things()
    random = np.random.default_rng(3)
    texture = s.Texture("noise", random.random((8, 16, 4)).astype(np.float32))
    return s.Scene(look_down(kind), geometries, instances, (material,), (texture,), **more)


def shown(graph: Graph, value: Value, lobe: str = "EMISSION") -> s.Material:
    """A material with one lobe of this colour."""
    program = compile_program(graph, [value])
    return s.Material("shown", (s.Lobe(lobe, (s.Input(output=0),)),), program=program)


def as_color(graph: Graph, value: Value) -> Value:
    if value.width == 3:
        return value
    return graph.apply(BY_NAME["combine_xyz"], value, value, value)[0]


def both(scene: s.Scene, passes=("Combined",), **settings) -> list[dict[str, np.ndarray]]:
    chosen = engine.Settings(samples=1, passes=frozenset(passes), **settings)
    assert not scene.problems()
    return [
        engine.render(scene, replace(chosen, backend=backend)).passes
        for backend in ("NATIVE", "NUMPY")
    ]


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("operation", POINT_READERS, ids=lambda o: o.name)
def test_what_is_read_of_a_point(operation: Operation, kind: str):
    graph = new_graph()
    settings = {
        name: {"attribute": "color", "uv": ""}[operation.name] for name, _ in operation.settings
    }
    for value in graph.apply(operation, **settings):
        core, reference = both(scene_of(shown(graph, as_color(graph, value)), kind))
        assert core["Combined"].any() or operation.name == "backfacing"
        np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=1e-5, atol=1e-5)
