"""Programs in pictures: whatever a material computes, both tracers draw the same."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from glint.engine.program.execute.operations import apply
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations import Operation
from glint.engine.program.operations_input import NormalSpace, Shift, Space, VectorType
from glint.engine.program.operations_math import MathOperation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME, OPERATIONS
from glint.engine.scene.problems import scene_problems
from native_tools import NO_WORLD, needs_core, placed, square, view_from_above

pytestmark = needs_core

POINT_READERS = [o for o in OPERATIONS if o.reads_point and not o.arguments]
READS = [
    pytest.param(o, shift, id=f"{o.name}-{shift}")
    for o in POINT_READERS
    for shift in (range(3) if "shift" in dict(o.settings) else (0,))
]
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
    value = np.array([[0.2, 0.7, 0.4, 0.9]], np.float32)
    instances = tuple(
        s.Instances(str(k), k, matrices[k : k + 1], (0,), values={"color": (k + 1) * value})
        for k in range(3)
    )
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
    assert not scene_problems(scene)
    return [
        engine.render(scene, replace(chosen, backend=backend)).passes
        for backend in ("NATIVE", "NUMPY")
    ]


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
@pytest.mark.parametrize(("operation", "shift"), READS)
def test_what_is_read_of_a_point(operation: Operation, shift: int, kind: str):
    graph = new_graph()
    names = [name for name, _ in operation.settings]
    settings = {"attribute": "" if operation.name == "uv" else "color", "shift": shift, "axis": 1}
    settings = {name: settings[name] for name in names}
    for value in graph.apply(operation, **settings):
        core, reference = both(scene_of(shown(graph, as_color(graph, value)), kind))
        assert core["Combined"].any() or operation.name == "backfacing"
        np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=1e-5, atol=1e-5)


def point_value(graph: Graph, name: str, **settings) -> Value:
    return graph.apply(BY_NAME[name], **settings)[0]


@pytest.mark.parametrize("space", NormalSpace)
def test_normal_maps(space: NormalSpace):
    graph = new_graph()
    color = point_value(graph, "attribute", attribute="color", shift=0)
    bent = graph.apply(
        BY_NAME["normal_map"], color, graph.constant(0.7), space=space, attribute="color"
    )[0]
    core, reference = both(scene_of(shown(graph, bent)))
    np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("kind", VectorType)
@pytest.mark.parametrize(("before", "after"), [*permutations(Space, 2)])
def test_vectors_in_other_spaces(kind: VectorType, before: Space, after: Space):
    """Back again they are what they were, up to their length where they are normals."""
    graph = new_graph()
    position = point_value(graph, "position", shift=0)

    def turned(value: Value, start: Space, end: Space) -> Value:
        settings = {"convert_from": start, "convert_to": end}
        return graph.apply(BY_NAME["transform_vector"], value, vector_type=kind, **settings)[0]

    there = turned(position, before, after)
    core, reference = both(scene_of(shown(graph, there)))
    np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=1e-5, atol=1e-5)
    back = turned(there, after, before)
    expected = position
    if kind == VectorType.NORMAL:
        expected = graph.apply(BY_NAME["vector_normalized"], position)[0]
    plan = engine.Settings(samples=1)
    found, wanted = (
        engine.render(scene_of(shown(graph, value)), plan).passes for value in (back, expected)
    )
    np.testing.assert_allclose(found["Combined"], wanted["Combined"], rtol=1e-4, atol=1e-4)


def bumpy(graph: Graph, width: int = 0, place: str = "object_position") -> Value:
    """Hills of a texture and of the place in the object, or in its map, on the shading normal."""
    settings = {"attribute": ""} if place == "uv" else {}
    where = point_value(graph, place, shift=0, **settings)
    texture, _ = graph.apply(BY_NAME["image"], where, texture=0)
    height = graph.apply(BY_NAME["rgb_to_bw"], texture)[0]
    beside = (graph.shifted(height, axis.by(width)) for axis in (Shift.FIRST, Shift.SECOND))
    rest = (graph.constant(0.8), graph.constant(0.3), point_value(graph, "normal"))
    return graph.apply(BY_NAME["bump"], height, *beside, *rest, width=width)[0]


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("width", [0, 30, 1000])
@pytest.mark.parametrize("place", ["object_position", "uv"])
def test_bumps(kind: str, width: int, place: str):
    graph = new_graph()
    core, reference = both(scene_of(shown(graph, bumpy(graph, width, place)), kind))
    np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("inner", [False, True])
@pytest.mark.parametrize("place", ["object_position", "uv"])
def test_steps_of_bumps_are_parts_of_a_pixel(place: str, inner: bool):
    """Of a height that is one up to x = 0 and zero beyond, only pixels whose step reaches over the
    edge are bumped: at a width of four pixels as many times more than at one. Of what meshes store
    the step goes the other way on the inner side.
    """
    found = []
    for width in (1000, 4000):
        graph = new_graph()
        settings = {"attribute": ""} if place == "uv" else {}
        where = point_value(graph, place, shift=0, **settings)
        x = graph.apply(BY_NAME["separate_xyz"], where)[0]
        settings = {"operation": MathOperation.GREATER_THAN, "clamp": 0}
        edge = graph.constant(0.5 if place == "uv" else 0.0)
        height = graph.apply(BY_NAME["math"], x, edge, graph.constant(0.0), **settings)[0]
        beside = (graph.shifted(height, axis.by(width)) for axis in (Shift.FIRST, Shift.SECOND))
        one = graph.constant(1.0)
        rest = (one, one, point_value(graph, "normal"))
        bent = graph.apply(BY_NAME["bump"], height, *beside, *rest, width=width)[0]
        turned = np.diag([1.0, -1.0, -1.0]) if inner else np.eye(3)
        at = s.Instances("one", 0, np.c_[turned, np.zeros(3)][None], (0,))
        scene = s.Scene(
            view_from_above(), (square(),), (at,), (shown(graph, bent),), world=NO_WORLD
        )
        pictures = [picture["Combined"][..., :2] for picture in both(scene)]
        np.testing.assert_allclose(*pictures, atol=1e-6)
        columns = np.abs(pictures[0]).max((0, 2)) > 1e-3
        found.append(np.flatnonzero(columns))
    assert 3 <= len(found[1]) / max(len(found[0]), 1) <= 5
    before = found[1] < (len(columns) - 1) / 2
    assert before.all() or not before.any()


def test_a_bumps_slope_is_that_of_the_height():
    """A height of x / 2 over a plane turns its normal by the arctangent of one half."""
    graph = new_graph()
    x = graph.apply(BY_NAME["separate_xyz"], point_value(graph, "position", shift=0))[0]
    height = graph.apply(
        BY_NAME["vector_average"],
        graph.apply(BY_NAME["combine_xyz"], x, graph.constant(0.0), graph.constant(0.0))[0],
    )[0]
    one = graph.constant(1.0)
    bent = graph.apply(
        BY_NAME["bump"],
        height,
        graph.shifted(height, 1),
        graph.shifted(height, 2),
        one,
        graph.constant(1.5),
        point_value(graph, "normal"),
        width=0,
    )[0]
    scene = s.Scene(
        view_from_above(), (square(),), (placed(),), (shown(graph, bent),), world=NO_WORLD
    )
    for picture in both(scene):
        expected = np.array([-0.5, 0, 1]) / np.sqrt(1.25)
        np.testing.assert_allclose(picture["Combined"][8, 8, :3], expected, atol=1e-6)


LIGHT = s.Light("sun", "SUN", np.array([[1, 0, 0, 0], [0, 0.8, 0.6, 0], [0, -0.6, 0.8, 5.0]]))


def test_bent_normals_shade():
    """Lobes, mirrors and the Normal pass see the program's normal, and nothing else moves."""
    graph = new_graph()
    program = compile_program(graph, [bumpy(graph)])
    lobes = (
        s.Lobe("DIFFUSE"),
        s.Lobe("SPECULAR", exponent=20.0, masking=0.3),
        s.Lobe("MIRROR", (s.Input((0.3,) * 3),)),
    )
    material = s.Material("bumpy", lobes, program=program, normal_output=0)
    scene = scene_of(material, lights=(LIGHT,), world=s.World(background=(0.2, 0.3, 0.4)))
    core, reference = both(scene, ("Combined", "Normal", "Position", "Mirror"), max_bounces=2)
    plain = both(replace(scene, materials=(replace(material, normal_output=-1),)), ("Normal",))[0]
    assert np.abs(core["Normal"] - plain["Normal"]).max() > 0.1
    for name in core:
        off = np.abs(core[name] - reference[name]).reshape(SIZE * SIZE, -1).max(1)
        assert np.mean(off > 1e-3) <= 0.01, name


def test_exponents_and_masking_of_a_program():
    graph = new_graph()
    color, alpha = graph.apply(BY_NAME["attribute"], attribute="color", shift=0)
    exponent = graph.apply(
        BY_NAME["math"],
        alpha,
        graph.constant(90.0),
        graph.constant(2.0),
        operation=MathOperation.MULTIPLY_ADD,
        clamp=0,
    )[0]
    program = compile_program(graph, [exponent, alpha, color])
    lobes = (
        s.Lobe("SPECULAR", (s.Input(),), 100.0, masking=1.0, exponent_output=0, masking_output=1),
        s.Lobe(
            "DIFFUSE", (s.Input((0.5,) * 3, output=2, low=0.0, high=1.0),), 5.0, exponent_output=0
        ),
    )
    lamp = replace(LIGHT, kind="POINT", radius=0.5, strength=500.0)
    scene = scene_of(s.Material("shiny", lobes, program=program), lights=(LIGHT, lamp))
    for light_samples in (1, 4):
        core, reference = both(scene, light_samples=light_samples)
        assert core["Combined"][..., :3].max() > 0.1
        np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=2e-4, atol=1e-4)


def test_light_that_programs_let_through():
    """Shadow rays and holdouts ask programs too, of meshes, spheres and polygons."""
    graph = new_graph()
    facing = graph.apply(
        BY_NAME["layer_weight"], graph.constant(0.4), point_value(graph, "normal")
    )[1]
    shadow = graph.apply(BY_NAME["light_path"])[1]
    position = point_value(graph, "position", shift=0)
    through = graph.apply(BY_NAME["scaled_sum"], position, shadow, as_color(graph, facing))[0]
    program = compile_program(graph, [through])
    lobes = (s.Lobe("TRANSPARENT", (s.Input(output=0, low=0.0, high=1.0),)), s.Lobe("DIFFUSE"))
    material = s.Material("veil", lobes, program=program)
    floor = s.Instances("floor", 3, np.array([[[3.0, 0, 0, 0], [0, 3, 0, 0], [0, 0, 1, -1]]]), (1,))
    scene = scene_of(material, lights=(LIGHT,))
    hole = replace(scene.instances[1], holdout=True)
    scene = replace(
        scene,
        geometries=(*scene.geometries, square(1.0)),
        instances=(scene.instances[0], hole, scene.instances[2], floor),
        materials=(material, s.Material("white", (s.Lobe("DIFFUSE"),))),
    )
    core, reference = both(scene, ("Combined", "Shadow", "Depth"))
    for name in core:
        off = np.abs(core[name] - reference[name]).reshape(SIZE * SIZE, -1).max(1)
        assert np.mean(off > 1e-4) <= 0.01, name


def test_values_of_placements():
    """Two rows of one group and a group that lacks the name, the first of them no surface: the core
    leaves it out and numbers the others anew.
    """
    graph = new_graph()
    _, (bowl_, ball, face) = things()
    flat = np.zeros((1, 3, 4))
    stacked = np.concatenate(
        [flat, ball.world_from_object, ball.world_from_object + [[0, 0, 0, 1]]]
    )
    rows = np.array([[9, 9, 9, 9], [0.1, 0.2, 0.3, 0.4], [0.5, 0.6, 0.7, 0.8]], np.float32)
    balls = replace(ball, world_from_object=stacked, values={"other": rows, "mine": rows})
    value, alpha = graph.apply(BY_NAME["instance_value"], attribute="mine")
    material = shown(graph, graph.apply(BY_NAME["scaled_sum"], value, alpha, value)[0])
    scene = replace(
        scene_of(material, "ORTHOGRAPHIC"), instances=(replace(bowl_, values={}), balls, face)
    )
    core, reference = both(scene)
    assert len(np.unique(core["Combined"][..., 0])) == 3  # nothing, and two balls
    np.testing.assert_allclose(core["Combined"], reference["Combined"], rtol=1e-6)
