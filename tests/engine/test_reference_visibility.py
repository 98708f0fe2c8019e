"""The reference's hits: its two searches against brute force, closed meshes without leaks, ties,
boxes in floats.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_scenes import at, ball_mesh, box_mesh, grid_mesh
from glint.engine import scene as s
from glint.engine.evaluation.geometry import Geometry
from glint.engine.linear.columns import transform, unit
from glint.engine.reference import raster
from glint.engine.reference import tree as tree_module
from glint.engine.reference.cancellation import Cancellation
from glint.engine.reference.raster import sorted_strips
from glint.engine.reference.rays import CoherentRays, Frame, IncoherentRays, hit_triangles
from glint.engine.reference.shadows import cube_frame, parallel_frame
from glint.engine.reference.tree import NONE, build
from glint.engine.reference.visibility import NOTHING, Passed, Visibility
from test_reference_support import geometry_of

QUIET = Cancellation(lambda: False)
SEEDS = st.integers(0, 2**32 - 1)


def visibility_of(geometry: Geometry) -> Visibility:
    return Visibility(geometry, np.ones(geometry.count, bool), QUIET)


def triangle_soup(generator: np.random.Generator, count: int) -> s.Mesh:
    """Triangles of all sizes, from slivers to ones that span everything."""
    size = 10.0 ** generator.uniform(-3, 0.5, (count, 1, 1))
    corners = generator.normal(size=(count, 1, 3)) + size * generator.normal(size=(count, 3, 3))
    return s.Mesh(
        "soup",
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(3 * count, dtype=np.uint32).reshape(-1, 3),
    )


def lines(generator: np.random.Generator, count: int) -> IncoherentRays:
    origin = 3 * generator.normal(size=(3, count))
    return IncoherentRays.of(
        origin,
        unit(generator.normal(size=(3, count)) - origin),
        np.zeros(count),
        np.full(count, np.inf),
    )


def rays_through(
    geometry: Geometry, point: np.ndarray, targets: np.ndarray, face: int
) -> CoherentRays:
    """Rays from `point` towards those targets (3, n) that lie on one side of a cube round it."""
    matrix = cube_frame(face)
    x, y, z = transform(matrix, targets - point[:, None])
    chosen = np.flatnonzero((z > 0) & (np.abs(x) <= z) & (np.abs(y) <= z))
    x, y, z = x[chosen], y[chosen], z[chosen]
    return CoherentRays(
        Frame.of(geometry, matrix, point, True),
        x / z,
        y / z,
        np.zeros(len(z)),
        np.full(len(z), np.inf),
    )


def rays_along(geometry: Geometry, direction: np.ndarray, targets: np.ndarray) -> CoherentRays:
    matrix = parallel_frame(direction)
    u, v, _ = transform(matrix, targets)
    return CoherentRays(
        Frame.of(geometry, matrix, np.zeros(3), False),
        u,
        v,
        np.full(len(u), -np.inf),
        np.full(len(u), np.inf),
    )


def brute_force(geometry: Geometry, rays) -> tuple[np.ndarray, np.ndarray]:
    """Lowest closest triangle and its depth, every ray against every triangle by the same exact
    test.
    """
    t, n = geometry.triangle_count, len(rays)
    ray, triangle = np.repeat(np.arange(n), t), np.tile(np.arange(t), n)
    which, depth = hit_triangles(rays, geometry, ray, triangle, np.full(n, np.inf))
    table = np.full((n, t), np.inf)
    table[ray[which], triangle[which]] = depth
    return np.where(np.isfinite(table.min(1)), table.argmin(1), NOTHING), table.min(1)


def moller_trumbore(geometry: Geometry, o: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(n,) nearest t by Cramer's rule (notes, section 4.8): another formula, for rays that stay
    clear of edges.
    """
    a, b, c = (geometry.points[:, corner].T for corner in geometry.triangles)
    e, f = (b - a)[None], (c - a)[None]
    o, d = o.T[:, None], d.T[:, None]
    p = np.cross(d, f)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / (e * p).sum(-1)
        beta = ((o - a) * p).sum(-1) * inverse
        q = np.cross(o - a, e)
        gamma, t = (d * q).sum(-1) * inverse, (f * q).sum(-1) * inverse
    inside = (beta >= 0) & (gamma >= 0) & (beta + gamma <= 1) & (t > 0)
    return np.where(inside, t, np.inf).min(1)


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_tree_finds_what_brute_force_finds(seed: int) -> None:
    generator = np.random.default_rng(seed)
    geometry = geometry_of(triangle_soup(generator, int(generator.integers(1, 400))))
    rays = lines(generator, 100)
    hits = visibility_of(geometry).closest(rays, "camera")
    primitive, depth = brute_force(geometry, rays)
    assert np.array_equal(hits.primitive, primitive)
    assert np.array_equal(hits.depth, depth)
    assert np.allclose(
        hits.depth, moller_trumbore(geometry, rays.origin, rays.direction), rtol=1e-6
    )


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_raster_finds_what_brute_force_finds(seed: int) -> None:
    generator = np.random.default_rng(seed)
    geometry = geometry_of(triangle_soup(generator, int(generator.integers(1, 400))))
    targets = generator.normal(size=(3, 150)) * 10.0 ** generator.uniform(-3, 1)
    point = generator.normal(size=3)
    for rays in (
        rays_through(geometry, point, targets, int(generator.integers(6))),
        rays_along(geometry, point, targets),
    ):
        hits = visibility_of(geometry).closest(rays, "camera")
        primitive, depth = brute_force(geometry, rays)
        assert np.array_equal(hits.primitive, primitive)
        assert np.array_equal(hits.depth, depth)


@settings(max_examples=25, deadline=None)
@given(SEEDS)
def test_raster_finds_triangles_that_reach_behind_its_point(seed: int) -> None:
    """Large triangles round the point, seen through a narrow window off the axis."""
    generator = np.random.default_rng(seed)
    corners = 5 * generator.normal(size=(100, 3, 3))
    mesh = s.Mesh(
        "m",
        corners.reshape(-1, 3).astype(np.float32),
        np.arange(300, dtype=np.uint32).reshape(-1, 3),
    )
    geometry, point = geometry_of(mesh), generator.normal(size=3)
    targets = (
        point[:, None]
        + generator.uniform(0.1, 1, 3)[:, None]
        + 0.05 * generator.normal(size=(3, 60))
    )
    for face in (0, 2, 4):
        rays = rays_through(geometry, point, targets, face)
        if len(rays):
            assert np.array_equal(
                visibility_of(geometry).closest(rays, "camera").primitive,
                brute_force(geometry, rays)[0],
            )


@settings(max_examples=10, deadline=None)
@given(SEEDS)
def test_raster_and_tree_agree_on_spheres_and_polygons(seed: int) -> None:
    generator = np.random.default_rng(seed)
    spheres = s.Spheres(
        "s",
        generator.normal(size=(20, 3)).astype(np.float32),
        generator.uniform(0.05, 0.5, 20).astype(np.float32),
    )
    angle = np.sort(generator.uniform(0, 2 * np.pi, 7))
    flat = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1) * generator.uniform(
        0.2, 2, (7, 1)
    )
    polygon = s.Polygons(
        "p", flat.astype(np.float32), np.array([0, 7], np.uint32), np.arange(7, dtype=np.uint32)
    )
    matrix = at(generator.normal(size=3), generator.normal(size=(3, 3)))
    geometry = geometry_of(triangle_soup(generator, 30), spheres, polygon, matrix=matrix)
    point = 2 * generator.normal(size=3)
    rays = rays_through(
        geometry, point, 2 * generator.normal(size=(3, 300)), int(generator.integers(6))
    )
    o, d = rays.lines(np.arange(len(rays)))
    size = np.sqrt((d * d).sum(0))
    straight = IncoherentRays.of(o, d / size, np.zeros(len(rays)), np.full(len(rays), np.inf))
    by_raster, by_tree = (visibility_of(geometry).closest(r, "camera") for r in (rays, straight))
    # a ray that grazes an outline may round differently
    assert (by_raster.primitive != by_tree.primitive).sum() <= 1
    same = by_raster.primitive == by_tree.primitive
    assert np.allclose(by_raster.depth[same] * size[same], by_tree.depth[same], rtol=1e-9)


def points_on_edges(geometry: Geometry, generator: np.random.Generator, count: int) -> np.ndarray:
    """(3, n) vertices, middles of edges and other points of edges."""
    triangle = generator.integers(0, geometry.triangle_count, count)
    a, b = (geometry.points[:, geometry.triangles[k, triangle]] for k in range(2))
    w = generator.choice([0.0, 0.5, 1.0, 0.3, generator.random()], count)
    return (1 - w) * a + w * b


COUNT = 2000


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("offset", [0.0, 1e3, 1e6])
def test_no_leaks_at_edges_and_vertices_of_closed_meshes(offset: float, radius: float) -> None:
    generator = np.random.default_rng(5)
    geometry = geometry_of(ball_mesh(14), matrix=at((offset, offset, -offset), radius))
    center = np.array([offset, offset, -offset])
    targets = points_on_edges(geometry, generator, COUNT)
    visibility = visibility_of(geometry)
    inside = center[:, None] + 0.3 * radius * generator.uniform(-1, 1, targets.shape)
    scaled = IncoherentRays.of(
        inside, unit(targets - inside), np.zeros(COUNT), np.full(COUNT, np.inf)
    )
    assert (visibility.closest(scaled, "camera").primitive == NOTHING).sum() == 0
    for face in range(6):
        rays = rays_through(geometry, center + 0.1 * radius, targets, face)
        assert (visibility.closest(rays, "camera").primitive == NOTHING).sum() == 0
    direction = np.array([0.3, -0.5, 0.8])
    off = targets - center[:, None]
    across = off - direction[:, None] * (direction @ off) / (direction @ direction)
    # not on the silhouette, where a miss is right
    inner = targets[:, (across**2).sum(0) < (0.9 * radius) ** 2]
    assert (
        visibility.closest(rays_along(geometry, direction, inner), "camera").primitive == NOTHING
    ).sum() == 0


def test_rays_at_the_vertices_of_a_grid_hit_it() -> None:
    geometry = geometry_of(grid_mesh(64, extent=1.0))
    inner = geometry.points[:, np.abs(geometry.points[:2]).max(0) < 1]
    eye = np.array([0.123, -2.345, 0.789])
    far = np.full(inner.shape[1], np.inf)
    rays = IncoherentRays.of(
        np.repeat(eye[:, None], len(far), 1), unit(inner - eye[:, None]), 0 * far.clip(0, 0), far
    )
    assert (visibility_of(geometry).closest(rays, "camera").primitive == NOTHING).sum() == 0


def test_ties_go_to_the_lower_instance_and_primitive() -> None:
    """Coincident faces of meshes cut along different diagonals."""
    quad = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    cuts = [
        np.array(t, np.uint32)
        for t in ([[0, 1, 2], [0, 2, 3]], [[1, 2, 3], [1, 3, 0]], [[2, 3, 0], [0, 1, 2]])
    ]
    geometry = geometry_of(*(s.Mesh(str(k), quad, cut) for k, cut in enumerate(cuts)))
    generator = np.random.default_rng(3)
    targets = np.concatenate([generator.uniform(-1, 1, (2, 500)), np.zeros((1, 500))])
    eye = np.array([0.31, 0.2, 1.7])
    rays = rays_through(geometry, eye, targets, 5)
    scaled = IncoherentRays.of(
        np.repeat(eye[:, None], 500, 1),
        unit(targets - eye[:, None]),
        np.zeros(500),
        np.full(500, np.inf),
    )
    for some in (rays, scaled):
        primitive = visibility_of(geometry).closest(some, "camera").primitive
        assert set(primitive) == {0, 1}
    down = np.repeat(np.array([[0.0], [0.0], [-1.0]]), 500, 1)
    targets[1] = targets[0]  # on the diagonal
    straight = IncoherentRays.of(targets - down, down, np.zeros(500), np.full(500, np.inf))
    assert (visibility_of(geometry).closest(straight, "camera").primitive == 0).all()


def test_a_ray_edge_on_passes() -> None:
    geometry = geometry_of(grid_mesh(1, extent=1.0))
    rays = IncoherentRays.of(
        np.array([[-2.0], [0.1], [0.0]]),
        np.array([[1.0], [0.0], [0.0]]),
        np.zeros(1),
        np.full(1, np.inf),
    )
    assert visibility_of(geometry).closest(rays, "camera").primitive[0] == NOTHING


def test_every_primitive_is_in_one_leaf_within_all_boxes_above() -> None:
    generator = np.random.default_rng(11)
    for count in (1, 4, 5, 33, 1000):
        geometry = geometry_of(triangle_soup(generator, count))
        tree = build(geometry, QUIET)
        kept = tree.leaves[tree.leaves != NONE]
        assert np.array_equal(np.sort(kept), np.arange(count))
        leaf = np.repeat(np.arange(len(tree.leaves)), tree.leaves.shape[1])[
            tree.leaves.ravel() != NONE
        ]
        corners = geometry.points[:, geometry.triangles[:, kept]]
        for level in reversed(tree.levels):
            node, child = leaf // 8, leaf % 8
            assert (corners.min(1).T >= level[:3, child, node].T).all()
            assert (corners.max(1).T <= level[3:, child, node].T).all()
            leaf = node


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.integers(1, 3000))
def test_strips_hold_every_ray_and_find_it_again(seed: int, count: int) -> None:
    generator = np.random.default_rng(seed)
    u, v = generator.normal(size=(2, count)) * 10.0 ** generator.uniform(-6, 6, (2, count))
    order, strips = sorted_strips(u, v)
    assert np.array_equal(np.sort(order), np.arange(count))
    strip = np.repeat(np.arange(len(strips.lower)), np.diff(strips.start))
    assert ((strips.lower[strip] <= v[order]) & (v[order] <= strips.upper[strip])).all()
    start, stop = strips.run(strip, u[order], u[order])
    assert ((start <= np.arange(count)) & (np.arange(count) < stop)).all()


def test_flags_hide_instances_from_their_kind_of_ray_only() -> None:
    for flags, seen in (({"visible_camera": False}, (0, 1)), ({"visible_mirror": False}, (1, 0))):
        geometry = geometry_of(box_mesh(), **flags)
        rays = IncoherentRays.of(
            np.array([[0.1], [0.2], [5.0]]),
            np.array([[0.0], [0.0], [-1.0]]),
            np.zeros(1),
            np.full(1, np.inf),
        )
        found = [
            visibility_of(geometry).closest(rays, kind).primitive[0] != NOTHING
            for kind in ("camera", "mirror")
        ]
        assert tuple(map(int, found)) == seen


def test_blocked_counts_surfaces_once_and_only_within_the_segment() -> None:
    """Three half transparent sheets, two of them coincident; rays end before, between and
    beyond.
    """
    matrices = np.concatenate([at((0, 0, z)) for z in (1.0, 1.0, 2.0)])
    geometry = geometry_of(grid_mesh(1, 1.0), matrix=matrices)
    visibility = Visibility(geometry, np.zeros(geometry.count, bool), QUIET)
    far = np.array([0.5, 1.0, 1.5, 2.5])
    zero = np.zeros(4)
    rays = IncoherentRays.of(
        np.array([zero, zero, zero]), np.array([zero, zero, zero + 1]), zero, far
    )

    def half(rays, ray, primitive, depth):
        return Passed(np.full((len(ray), 4), 0.5), np.ones((len(ray), 3)))

    halves = visibility.blocked(rays, half)
    assert np.array_equal(halves.passed[:, 0], [1.0, 1.0, 0.5, 0.25])
    assert np.array_equal(halves.bent[:, 0], [0.0, 0.0, 1.0, 2.0])
    nothing = Passed(np.zeros((0, 4)), np.zeros((0, 3)))
    opaque = visibility_of(geometry).blocked(rays, lambda *_: nothing)
    assert np.array_equal(opaque.passed[:, 0], [1.0, 1.0, 0.0, 0.0])


def test_ties_are_measured_by_the_coordinates_not_by_the_distance() -> None:
    """Two planes an ulp of their coordinates apart, met a thousandth of them away: one hit, the
    lower instance's, whichever is nearer.
    """
    square = grid_mesh(1, 1.0)
    matrices = np.concatenate([at((0, 0, 3.0)), at((0, 0, np.nextafter(3.0, 4)))])
    geometry = geometry_of(square, matrix=matrices)
    for above, down in ((0.003, -1.0), (-0.003, 1.0)):
        rays = IncoherentRays.of(
            np.array([[0.1], [0.3], [3 + above]]),
            np.array([[0.0], [0.0], [down]]),
            np.zeros(1),
            np.full(1, np.inf),
        )
        assert visibility_of(geometry).closest(rays, "camera").primitive[0] in (0, 1)


def test_the_nearer_of_two_close_sheets_wins_whichever_comes_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Pair by pair, so that what a ray has met already is known when the next comes."""
    monkeypatch.setattr(raster, "PAIRS", 1)
    monkeypatch.setattr(tree_module, "PAIRS", 8)
    for first, second in ((1.0, 1.0 - 1e-6), (1.0 - 1e-6, 1.0)):
        geometry = geometry_of(
            grid_mesh(1, 1.0), matrix=np.concatenate([at((0, 0, first)), at((0, 0, second))])
        )
        targets = np.array([[0.1, 0.2], [0.3, -0.1], [1.0, 1.0]])
        up = np.repeat(np.array([[0.0], [0.0], [1.0]]), 2, 1)
        scaled = IncoherentRays.of(targets - 2 * up, up, np.zeros(2), np.full(2, np.inf))
        for rays in (
            rays_through(geometry, np.zeros(3), targets, 4),
            rays_along(geometry, np.array([0.0, 0.0, 1.0]), targets),
            scaled,
        ):
            row = geometry.row[visibility_of(geometry).closest(rays, "camera").primitive]
            assert (row == int(second < first)).all()
