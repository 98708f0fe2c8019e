"""Bodies without holes that glow: which they are, and the light of their outer and inner sides."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine.lights.closed_bodies import closed_bodies
from glint.engine.lights.mesh_lights import INWARD, mesh_lights, mesh_table
from glint.engine.scene import Mesh
from test_mesh_light import BACKENDS, drawn, rectangle_form_factor, scene

FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
TRIANGLES = np.array([(f[0], f[k], f[k + 1]) for f in FACES for k in (1, 2)], np.uint32)


def box(half: float = 1.0, z: float = 0.0, turned: bool = False) -> Mesh:
    """turned: clockwise from outside."""
    sides = (-half, half)
    corners = [(x, y, z + w) for w in sides for y in sides for x in sides]
    triangles = TRIANGLES[:, ::-1] if turned else TRIANGLES
    return Mesh("box", np.array(corners, np.float32), triangles)


def corners_of(mesh: Mesh) -> np.ndarray:
    return mesh.vertices[mesh.triangles].astype(np.float64)


def test_which_bodies_have_no_holes():
    here, there, far = (corners_of(box(1.0, z, turned)) for z, turned in ((0, 0), (4, 1), (8, 0)))
    sign, thickness = closed_bodies(np.concatenate([here, there, far[1:]]))
    assert (sign[:12] == 1).all()
    assert (sign[12:24] == -1).all()
    assert (sign[24:] == 0).all()
    assert (thickness[:24] == 2).all()


def test_triangles_that_do_not_go_round_alike_bound_nothing():
    turned = corners_of(box())
    turned[3] = turned[3, ::-1]
    assert (closed_bodies(turned)[0] == 0).all()


def test_an_edge_of_four_triangles_bounds_nothing():
    shared = corners_of(box()) + np.array([2.0, 2.0, 0.0])
    assert (closed_bodies(np.concatenate([corners_of(box()), shared]))[0] == 0).all()


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_box_lights_by_its_outside(backend, turned):
    found = drawn(scene(box(0.5, 1.5, turned)), backend, samples=64)
    np.testing.assert_allclose(found, rectangle_form_factor(0.5, 0.5, 1.0), rtol=0.02)


@pytest.mark.parametrize("turned", [False, True])
def test_few_points_are_on_inner_sides(turned):
    (light,) = mesh_lights(scene(box(0.5, 1.5, turned)))
    table = mesh_table(light, 64, 8)
    outer, inner = (table.back, table.front) if turned else (table.front, table.back)
    assert not (outer.any(1) & inner.any(1)).any()
    assert inner.any(1).mean() == pytest.approx(INWARD / (1 + INWARD), abs=0.01)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("backend", BACKENDS)
def test_what_is_in_a_box_is_lit_by_its_inside(backend, turned):
    found = drawn(scene(box(150.0, 0.0, turned)), backend, samples=256, light_samples=16)
    np.testing.assert_allclose(found, 1.0, rtol=0.02)


def test_few_points_lie_all_round_a_tube():
    """The light below it, without shadows, beside that of many."""
    angle = np.arange(32) * np.pi / 16
    y, z = 0.05 * np.cos(angle), 0.05 * np.sin(angle)
    ends = [np.stack([np.full(32, x), y, z], 1) for x in (-1.5, 1.5)]
    faces = [(0, k, k + 1) for k in range(1, 31)] + [(32, 33 + k, 32 + k) for k in range(1, 31)]
    for k, after in enumerate(np.roll(np.arange(32), -1)):
        faces += [(k, k + 32, after), (after, k + 32, after + 32)]
    points = np.concatenate(ends).astype(np.float32)
    tube = Mesh("tube", points, np.array(faces, np.uint32)[:, ::-1])
    (light,) = mesh_lights(scene(tube))
    x = np.random.default_rng(1).uniform((-2, -2, -1.5), (2, 2, -1.5), (400, 3))

    def lit(count: int) -> np.ndarray:
        table = mesh_table(light, count // 8, 8)
        to = table.point + light.world_from_light[:, 3] - x[:, None]
        d2 = (to * to).sum(2)
        z = -(to * table.normal).sum(2)
        return (table.front[:, 0] * np.maximum(z, 0) * to[..., 2] / d2**2 * table.spread).mean(1)

    assert np.sqrt(((lit(128) / lit(1 << 13) - 1) ** 2).mean()) < 0.035
