"""Strands in closed form: where rays enter the hull of two spheres, in both tracers at any size."""

from __future__ import annotations

import numpy as np
import pytest

from engine_scenes import at
from glint import engine
from glint.engine import scene as s

both = pytest.mark.parametrize("backend", engine.available_backends())


def strands(vertices, radii, starts=None, **more) -> s.Strands:
    vertices = np.asarray(vertices, np.float32)
    starts = np.arange(len(vertices) - 1) if starts is None else starts
    radii = np.asarray(radii, np.float32)
    return s.Strands("hair", vertices, radii, np.asarray(starts, np.uint32), **more)


def accelerator(geometry, backend, matrix=None):
    group = s.Instances("hair", 0, at() if matrix is None else matrix, ())
    return engine.Accelerator((geometry,), (group,), backend=backend)


def depth_inside(p, a, b, ra, rb):
    """(n,) how deep the points (n, 3) lie in the hull: the most over the axis of radius less
    distance, which is concave, by ternary search.
    """
    low, high = np.zeros(len(p)), np.ones(len(p))

    def depth(k):
        return ra + k * (rb - ra) - np.linalg.norm(p - a - k[:, None] * (b - a), axis=1)

    for _ in range(80):  # to 8e-15 of it
        third = (high - low) / 3
        better = depth(low + third) < depth(high - third)
        low, high = np.where(better, low + third, low), np.where(better, high, high - third)
    ends = np.maximum(depth(np.zeros(len(p))), depth(np.ones(len(p))))
    return np.maximum(depth((low + high) / 2), ends)


@both
def test_a_capsule_in_closed_form(backend):
    """Seen from above: silhouette, depth and how far along."""
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-2, 2, (2, 20000)) * [[1], [0.5]]
    with accelerator(strands([[-1, 0, 0], [1, 0, 0]], [0.5, 0.5]), backend) as tree:
        hits = tree.closest(np.stack([x, y, np.full_like(x, 7)], 1), [0.0, 0.0, -1.0])
    rest = 0.25 - y**2 - np.maximum(np.abs(x) - 1, 0) ** 2
    clear = np.abs(rest) > 1e-12
    np.testing.assert_array_equal((hits.instance >= 0)[clear], (rest > 0)[clear])
    seen = clear & (rest > 0)
    np.testing.assert_allclose(hits.t[seen], 7 - np.sqrt(rest[seen]), rtol=1e-13)
    np.testing.assert_allclose(hits.u[seen], np.clip((x[seen] + 1) / 2, 0, 1), atol=1e-6)
    assert not hits.v.any()


@both
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    "radii",
    [(0.3, 0.3), (0.3, 0.1), (0.05, 0.4), (0.2, 0.0), (0.0, 0.01), (1.9, 0.2), (1e-4, 1e-5)],
)
def test_where_rays_enter_the_hull(backend, radii, size):
    """On the surface there, outside all the way to it; what misses is nowhere inside."""
    rng = np.random.default_rng(2)
    a, b = size * np.array([0.25, -0.5, 0.125]), size * np.array([0.75, 0.5, -0.25])
    geometry = strands([a, b], size * np.array(radii))
    ra, rb = geometry.radii.astype(float)
    a, b = geometry.vertices.astype(float)
    along = rng.uniform(-0.1, 1.1, (600, 1))
    width = max(radii[0], radii[1])
    target = a + along * (b - a) + size * width * rng.normal(0, 0.7, (600, 3))
    origin = size * rng.normal(0, 1, (600, 3))
    origin *= (5 * size + 0.1 * size * rng.random((600, 1))) / np.linalg.norm(
        origin, axis=1, keepdims=True
    )
    d = target - origin
    with accelerator(geometry, backend) as tree:
        hits = tree.closest(origin, d)
        blocked = tree.occluded(origin, d)
    hit = hits.instance >= 0
    np.testing.assert_array_equal(blocked, hit)
    assert 40 < hit.sum() < 580
    met = origin + hits.t[:, None] * d
    room = 1e-9 * size * max(radii) + 1e-14 * size
    assert np.abs(depth_inside(met[hit], a, b, ra, rb)).max() <= room
    for share in (0.3, 0.6, 0.9, 0.99):
        before = origin + (1 - (1 - share) * 0.1) * hits.t[:, None] * d
        assert (depth_inside(before[hit], a, b, ra, rb) <= room).all()
    for share in np.linspace(0.5, 1.5, 41):
        assert (depth_inside((origin + share * d)[~hit], a, b, ra, rb) <= room).all()


@both
def test_a_segment_of_no_length_is_a_ball(backend):
    ball = s.Spheres("ball", np.array([[0.5, 0, 0]], np.float32), np.array([0.25], np.float32))
    rng = np.random.default_rng(3)
    o = rng.normal(0, 3, (2000, 3))
    d = rng.normal(0, 0.2, (2000, 3)) + [0.5, 0, 0] - o
    with accelerator(strands([[0.5, 0, 0]] * 2, [0.25, 0.1]), backend) as tree:
        hits = tree.closest(o, d)
    with accelerator(ball, backend) as tree:
        round_ = tree.closest(o, d)
    outside = np.linalg.norm(o - [0.5, 0, 0], axis=1) > 0.25
    np.testing.assert_allclose(hits.t[outside], round_.t[outside], rtol=1e-12)
    assert (hits.instance >= 0).sum() > 500


@both
def test_nothing_slips_through_a_bent_chain(backend):
    """Rays at the joints and along the axis of a chain, from all sides, all meet it."""
    rng = np.random.default_rng(4)
    points = np.cumsum(rng.normal(0, 1, (200, 3)), 0).astype(np.float32)
    with accelerator(strands(points, np.full(200, 1e-3)), backend) as tree:
        d = rng.normal(0, 1, (20000, 3))
        k = rng.integers(0, 199, 20000)
        share = np.where(rng.random(20000) < 0.5, 0.0, rng.random(20000))[:, None]
        target = points[k] * (1 - share) + points[k + 1] * share
        assert tree.occluded(target - 3 * d, d).all()


@both
def test_seen_from_inside_it_is_not_there(backend):
    with accelerator(strands([[0, 0, 0], [1, 0, 0]], [0.5, 0.5]), backend) as tree:
        assert not tree.occluded([[0.5, 0.1, 0.0]], [[0.0, 0.0, 1.0]]).any()


@both
def test_ties_go_to_the_lower_segment(backend):
    """Two that coincide, and the sphere at a joint."""
    double = strands([[0, 0, 0], [1, 0, 0]] * 2, [0.2] * 4, [2, 0])
    rays = np.array([[0.5, 0.0, 3.0], [1.05, 0.05, 3.0]]), np.array([0.0, 0.0, -1.0])
    with accelerator(double, backend) as tree:
        assert tree.closest(*rays).primitive.tolist() == [0, 0]
    bent = strands([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [0.2] * 3)
    with accelerator(bent, backend) as tree:
        hits = tree.closest(np.array([[1.05, -0.05, 3.0]]), rays[1])
    assert hits.primitive.tolist() == [0]


@both
def test_what_has_no_extent_is_left_out_and_counted(backend):
    bad = strands(
        [[0, 0, 0], [1, 0, 0], [np.nan, 0, 0], [0, 0, 5], [0, 1, 5], [3, 0, 0], [4, 0, 0]],
        [0.1, 0.1, 0.1, 0.0, 0.0, np.inf, 0.1],
    )
    with accelerator(bad, backend) as tree:
        assert tree.stats["dropped"] == 5
        hits = tree.closest([[0.5, 0, 3.0], [2.0, 0.9, 20.0]], [0.0, 0.0, -1.0])
    assert hits.primitive.tolist() == [0, -1]


def test_bad_arrays_are_refused_with_a_sentence():
    vertices, radii = np.zeros((3, 3), np.float32), np.ones(3, np.float32)

    def problems(**fields):
        values = {"vertices": vertices, "radii": radii, "starts": np.array([0, 1], np.uint32)}
        geometry = s.Strands("hair", **{**values, **fields})
        camera = s.Camera("PERSPECTIVE", at()[0], (-1.0, 1.0, -1.0, 1.0), (2, 2))
        return s.Scene(camera, (geometry,)).problems()

    assert problems() == []
    for fields, text in (
        ({"starts": np.array([2], np.uint32)}, "starts"),
        ({"radii": radii[:2]}, "radii"),
        ({"radii": -radii}, "negative"),
        ({"vertices": vertices.astype(np.float64)}, "vertices"),
        ({"material_slots": np.zeros(3, np.uint16)}, "segment"),
        ({"attributes": (s.Attribute("a", s.CORNER, np.zeros((2, 2), np.float32)),)}, "domain"),
        ({"attributes": (s.Attribute("a", s.POINT, np.zeros((2, 2), np.float32)),)}, "rows"),
    ):
        (found,) = problems(**fields)
        assert text in found and "'hair'" in found
