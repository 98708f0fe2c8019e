"""Ray queries whose answer hangs on the last digits: intervals that end at what they hit, and
things at one distance.
"""

from __future__ import annotations

import numpy as np
import pytest

from engine_scenes import at, grid_mesh
from glint import engine
from glint.engine import scene as s
from native_tools import needs_core
from ray_tools import box_grid

SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
HALVES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)

both = pytest.mark.parametrize("backend", engine.available_backends())


def rays_to_walls(count: int, tilt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Origins in the cube of [-4, 4], 1e-6 to 3 from one of its walls and not representable in
    float32; directions all but straight to it; where each meets it.
    """
    rng = np.random.default_rng(21)
    origins, axis, side = (
        rng.uniform(-3.9, 3.9, (count, 3)),
        rng.integers(3, size=count),
        rng.choice([-1.0, 1.0], count),
    )
    rows = np.arange(count)
    origins[rows, axis] = side * (4 - 10 ** rng.uniform(-6, 0.5, count))
    directions = rng.normal(size=(count, 3)) * tilt
    directions[rows, axis] = side
    return origins, directions, side * (4 * side - origins[rows, axis])


@both
@pytest.mark.parametrize("tilt", [0.0, 1e-9, 1e-3])
@pytest.mark.parametrize("company", ["alone", "mixed", "sorted"])
def test_intervals_that_end_just_before_and_just_behind_a_wall(
    backend: str, company: str, tilt: float
) -> None:
    o, d, there = rays_to_walls(80 if company == "alone" else 2000, tilt)
    if company == "sorted":
        order = np.lexsort((o[:, 0], *d.T.round()))
        o, d, there = o[order], d[order], there[order]
    vertices, triangles = box_grid(8)
    with engine.Accelerator.from_triangles(
        (4 * vertices).astype(np.float32), triangles, backend=backend
    ) as tree:

        def hit(low: np.ndarray | float, high: np.ndarray | float) -> np.ndarray:
            bounds = [np.broadcast_to(bound, len(o)) for bound in (low, high)]
            parts = (
                [slice(k, k + 1) for k in range(len(o))] if company == "alone" else [slice(None)]
            )
            asked = [(o[k], d[k], *(bound[k] for bound in bounds)) for k in parts]
            closest = np.concatenate([tree.closest(*rays).instance >= 0 for rays in asked])
            assert np.array_equal(np.concatenate([tree.occluded(*rays) for rays in asked]), closest)
            return closest

        assert hit(0, there * (1 + 1e-9)).all() and hit(there * (1 - 1e-9), 9).all()
        assert hit(there * (1 - 1e-9), there * (1 + 1e-9)).all()
        assert (
            not hit(0, there * (1 - 1e-9)).any() and not hit(there * (1 + 1e-9), there + 1e-6).any()
        )


def fan(count: int) -> s.Mesh:
    """A disc of radius 1 whose triangles all begin at its middle."""
    angle = np.arange(count) * 2 * np.pi / count
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    k = np.arange(1, count + 1)
    vertices = np.concatenate([[[0, 0, 0]], rim]).astype(np.float32)
    return s.Mesh("fan", vertices, np.stack([0 * k, k, k % count + 1], 1).astype(np.uint32))


LONELY = {
    "triangle": s.Mesh("triangle", SQUARE, HALVES[:1]),
    "sphere": s.Spheres("sphere", np.zeros((1, 3), np.float32), np.ones(1, np.float32)),
    "polygon": s.Polygons(
        "polygon", SQUARE, np.array([0, 4], np.uint32), np.arange(4, dtype=np.uint32)
    ),
    "fan": fan(40),
}


def unit_sphere_depth(o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The smaller root of |o + t d| = 1."""
    a, b, c = (d * d).sum(-1), (d * o).sum(-1), (o * o).sum(-1) - 1
    return (-b - np.sqrt(b * b - a * c)) / a


@both
@pytest.mark.parametrize("name", LONELY)
def test_a_primitive_alone_of_any_size(backend: str, name: str) -> None:
    """Nothing but its own extent tells how large the scene is. The core has a sphere that stands
    alone in world space, with a radius of float32: half an ulp of that, seen at a slant.
    """
    rtol = 2.0**-24 / 3.8 if (name, backend) == ("sphere", "NATIVE") else 1e-14
    for exponent in range(-45, 46, 3):
        size = 10.0**exponent
        with engine.Accelerator(
            (LONELY[name],), (s.Instances(name, 0, at(linear=size), ()),), backend=backend
        ) as tree:
            o, d = np.array([0.3, 0.1, 5]), np.array([[0, 0, -1], [-0.01, -0.02, -1]])
            found = tree.closest(o * size, d * size).t
            expected = unit_sphere_depth(o, d) if name == "sphere" else 5
            np.testing.assert_allclose(found, expected, rtol=rtol)
            assert tree.occluded(o * size, d * size).all()


@both
@pytest.mark.parametrize("exponent", [5, 17, 30, 100, 300])
def test_a_ray_from_very_far_away(backend: str, exponent: int) -> None:
    """Along an axis nothing is rounded, however far away it begins."""
    with engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend) as tree:
        for far, ends in (
            (10.0**exponent, (0, np.inf)),
            (10.0**exponent, (0.9 * 10.0**exponent, 1.1 * 10.0**exponent)),
        ):
            assert tree.closest([0.25, 0.5, far], [0.0, 0.0, -1.0], *ends).t[0] == far
            assert tree.occluded([0.25, 0.5, far], [-0.0, 0.0, -1.0], *ends)[0]


@needs_core
def test_things_at_one_distance_in_any_order_of_rays() -> None:
    """Rays along a stepped terrain meet edges of two objects in one place and of others that touch
    them there.
    """
    rng = np.random.default_rng(7)
    terrain = grid_mesh(cells=30, extent=15, height=lambda x, y: rng.integers(0, 3, x.shape))
    places = np.concatenate([at(), at(), at((3, 0, 0), -1), at((-5, 0, 0), 2)])
    corners = terrain.vertices[terrain.triangles[rng.integers(len(terrain.triangles), size=20_000)]]
    weights = rng.choice([0, 0.25, 0.5, 1], size=(20_000, 3)) + [1e-9, 0, 0]
    o = (corners * (weights / weights.sum(1, keepdims=True))[..., None]).sum(1) - [4, 0, 0]
    order = rng.permutation(len(o))
    with engine.Accelerator((terrain,), (s.Instances("terrain", 0, places, ()),)) as tree:
        hits, others = tree.closest(o, [1.0, 0, 0]), tree.closest(o[order], [1.0, 0, 0])
    assert not (hits.instance == 1).any()  # where it is, there is instance 0
    for name in ("t", "instance", "primitive", "u", "v"):
        assert np.array_equal(getattr(hits, name)[order], getattr(others, name)), name
