"""Displaced meshes by closed forms, and programs over vertices in both executors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import displacement
from glint.engine.displacement import Displacement, Place, displaced, normals_after
from glint.engine.native import programs
from glint.engine.program.execute.run import run as run_reference
from glint.engine.program.graph import Graph
from glint.engine.program.operations_input import Space, VectorType
from glint.engine.program.operations_math import MathOperation
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from glint.engine.scene import CORNER, FACE, POINT, Attribute, Mesh, Texture
from native_tools import needs_core

RANDOM = np.random.default_rng(11)


def net(count: int) -> Mesh:
    """A square from -1 to 1 of count × count vertices, with attributes on every domain."""
    across = np.linspace(-1, 1, count)
    x, y = np.meshgrid(across, across)
    vertices = np.stack([x, y, 0 * x], -1).reshape(-1, 3).astype(np.float32)
    at = np.arange(count * count).reshape(count, count)
    a, b, c, d = (p.ravel() for p in (at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]))
    triangles = np.stack([a, b, c, a, c, d], -1).reshape(-1, 3).astype(np.uint32)
    corners = np.arange(triangles.size, dtype=np.uint32).reshape(-1, 3)
    values = {
        POINT: RANDOM.random((len(vertices), 4)),
        CORNER: RANDOM.random((triangles.size, 2)),
        FACE: RANDOM.random((len(triangles), 4)),
    }
    attributes = (
        Attribute("map", CORNER, values[CORNER].astype(np.float32)),
        Attribute("point", POINT, values[POINT].astype(np.float32)),
        Attribute("face", FACE, values[FACE].astype(np.float32)),
    )
    up = Attribute("normal", POINT, np.tile(np.float32([0, 0, 1]), (len(vertices), 1)))
    return Mesh("net", vertices, triangles, corners, None, up, attributes)


class Tree:
    """Expressions, and the displacement that they are."""

    def __init__(self) -> None:
        self.graph = Graph()

    def do(self, name: str, *arguments, **settings):
        return self.graph.apply(BY_NAME[name], *arguments, **settings)

    def math(self, name: str, a, b=0.0, c=0.0):
        given = [x if hasattr(x, "call") else self.graph.constant(x) for x in (a, b, c)]
        return self.do("math", *given, operation=MathOperation[name], clamp=0)[0]

    def upward(self, height):
        zero = self.graph.constant(0.0)
        return self.do("combine_xyz", zero, zero, height)[0]

    def is_(self, value, textures=(), **named) -> Displacement:
        return Displacement(compile_program(self.graph, [value]), textures, **named)


def all_kinds() -> Displacement:
    """What reads vertices in every way, a table, an image behind a curve, noise and powers."""
    tree = Tree()
    do, constant = tree.do, tree.graph.constant
    texels = RANDOM.integers(0, 256, (8, 8, 4)).astype(np.uint8)
    texture = Texture("image", texels, "SRGB", "REPEAT", "LINEAR")
    color = do("image", do("uv", attribute="", shift=0)[0], texture=0)[0]
    for name in ("point", "face"):
        color = do("scaled_sum", do("attribute", attribute=name, shift=0)[0], constant(0.3), color)[
            0
        ]
    table = tuple(RANDOM.random(256 * 4))
    ramp = do("ramp", do("rgb_to_bw", color)[0], interpolates=1, table=table)[0]
    place = do("position", shift=0)[0]
    numbers = (0.3, 2.0, 3.0, 0.5, 2.0, 0.0, 1.0, 0.4)
    noise = do(
        "noise_texture", place, *map(constant, numbers), dimensions=1, noise_type=1, normalize=1
    )[0]  # fmt: skip
    height = tree.math("POWER", tree.math("ABSOLUTE", noise), 1.7)
    settings = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
    turned = do("transform_vector", ramp, vector_type=VectorType.VECTOR, **settings)[0]
    found = do("scaled_sum", do("normal")[0], height, turned)[0]
    return tree.is_(found, (texture,))


PLACE = Place(np.array([[1.0, 0.4, 0, 3], [0, -2.0, 0.1, 1], [0.2, 0, 0.7, -4]]))


@needs_core
def test_the_core_and_numpy_move_vertices_alike(monkeypatch):
    mesh, kinds = net(20), all_kinds()
    normals = mesh.normals.values
    found = displaced(mesh, (kinds,), normals, None, PLACE)
    monkeypatch.setattr(displacement, "load_error", lambda: "away")
    wanted = displaced(mesh, (kinds,), normals, None, PLACE)
    assert np.abs(wanted.offsets).max() > 0.1
    np.testing.assert_allclose(found.offsets, wanted.offsets, rtol=1e-12, atol=1e-12)


@needs_core
def test_the_bits_are_those_of_any_number_of_threads(monkeypatch):
    mesh, kinds = net(20), all_kinds()
    whole = displaced(mesh, (kinds,), mesh.normals.values, None, PLACE)
    monkeypatch.setattr(displacement, "_CHUNK", 7)
    parts = displaced(mesh, (kinds,), mesh.normals.values, None, PLACE)
    assert whole.offsets.tobytes() == parts.offsets.tobytes()
    assert whole.mesh.normals.values.tobytes() == parts.mesh.normals.values.tobytes()


@needs_core
def test_the_core_raises_to_powers_what_images_hold(monkeypatch):
    """Processors' libraries differ in that."""
    asked, own = [], programs.power
    np.testing.assert_allclose(own(np.array([0.2, 3.0]), 2.4), [0.2**2.4, 3**2.4], rtol=1e-14)

    def power(base, exponent):
        asked.append(exponent)
        return own(base, exponent)

    monkeypatch.setattr(programs, "power", power)
    displaced(net(5), (all_kinds(),), net(5).normals.values, None, PLACE)
    assert set(asked) == {2.4}


def wave(**named) -> Displacement:
    """z + sin(2 x) in object space."""
    tree = Tree()
    x = tree.do("separate_xyz", tree.do("object_position", shift=0)[0])[0]
    return tree.is_(tree.upward(tree.math("SINE", tree.math("MULTIPLY", x, 2.0))), **named)


def test_a_wave_and_its_normals():
    mesh = net(65)
    moved = displaced(mesh, (wave(is_placed=False),), mesh.normals.values, None, PLACE)
    x, y, z = moved.mesh.vertices.T
    np.testing.assert_allclose(z, np.sin(2 * x), atol=1e-6)
    assert np.array_equal(np.stack([x, y], -1), mesh.vertices[:, :2]) and moved.turned.all()
    slope = np.stack([-2 * np.cos(2 * x), 0 * x, 1 + 0 * x], -1)
    slope /= np.linalg.norm(slope, axis=1)[:, None]
    inside = (np.abs(x) < 1) & (np.abs(y) < 1)
    np.testing.assert_allclose(moved.mesh.normals.values[inside], slope[inside], atol=2e-3)


def test_offsets_of_the_world_are_taken_to_the_object():
    mesh = net(9)
    kept = wave(keeps_normals=True)
    moved = displaced(mesh, (kept,), mesh.normals.values, None, PLACE)
    in_world = moved.offsets @ PLACE.world_from_object[:, :3].T
    wanted = np.stack([np.zeros((81, 2)).T[0]] * 2 + [np.sin(2.0 * mesh.vertices[:, 0])], -1)
    np.testing.assert_allclose(in_world, wanted, atol=1e-12)
    assert moved.mesh.normals is mesh.normals and not moved.turned.any()
    flat = Place(np.diag([1.0, 1.0, 0.0, 0.0])[:3])
    assert not displaced(mesh, (kept,), mesh.normals.values, None, flat).offsets.any()


@pytest.mark.parametrize("height", [np.nan, np.inf, 1e25])
def test_vertices_stay_finite(height):
    mesh = net(3)
    odd = Displacement(None, constant=(0.0, 0.0, height))
    moved = displaced(mesh, (odd,), mesh.normals.values, None, Place())
    assert np.array_equal(moved.mesh.vertices, mesh.vertices) and moved.odd == 9


def test_a_vertex_goes_where_its_first_triangle_that_moves_takes_it():
    mesh = replace(net(2), material_slots=np.array([1, 0], np.uint16))
    up, down = (Displacement(None, constant=(0.0, 0.0, z)) for z in (1.0, -1.0))
    normals = mesh.normals.values
    both = displaced(mesh, (down, up), normals, None, Place()).mesh.vertices[:, 2]
    assert both.tolist() == [1.0, 1.0, -1.0, 1.0]  # only vertex 2 is of the second alone
    one = displaced(mesh, (down, None), normals, None, Place()).mesh.vertices[:, 2]
    assert one.tolist() == [-1.0, 0.0, -1.0, -1.0]


def test_normals_at_corners_turn_with_those_of_vertices():
    """A hard edge stays as hard; what is flat is the face's."""
    mesh = net(2)
    tilted = np.float64([0.6, 0, 0.8])
    corners = Attribute("normal", CORNER, np.tile(tilted.astype(np.float32), (6, 1)))
    mesh = replace(mesh, normals=corners)
    risen = mesh.vertices.copy()
    risen[:, 2] = risen[:, 0]  # all normals turn from z to (-1, 0, 1) / √2
    polygons, turned = np.array([7, -1]), np.array([True, True])
    found = normals_after(mesh, risen, corners, turned, polygons).values
    face = np.array([-1, 0, 1]) / np.sqrt(2)
    bent = tilted + face - (0, 0, 1)
    np.testing.assert_allclose(found[:3], [face] * 3, atol=1e-6)
    np.testing.assert_allclose(found[3:], [bent / np.linalg.norm(bent)] * 3, atol=1e-6)


@needs_core
def test_tables_are_found_in_every_stretch_of_a_program():
    """Two ramps with a read of the point between them."""
    tree = Tree()
    tables = [tuple(RANDOM.random(256 * 4)) for _ in range(2)]
    x = tree.do("separate_xyz", tree.do("object_position", shift=0)[0])[0]
    first = tree.do("ramp", x, interpolates=0, table=tables[0])[1]
    normal = tree.do("normal_to_world", tree.upward(first))[0]
    z = tree.do("separate_xyz", normal)[2]
    second = tree.do("ramp", tree.math("MULTIPLY", z, first), interpolates=1, table=tables[1])[0]
    program, mesh = compile_program(tree.graph, [second]), net(6)
    corners = np.arange(60)
    points = displacement.VertexPoints(
        mesh, mesh.normals.values, corners, displacement._Placed.of(PLACE), []
    )
    (found,), (wanted,) = (run(program, points, 60) for run in (programs.run, run_reference))
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
