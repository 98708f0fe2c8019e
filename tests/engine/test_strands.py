"""Strands in closed form: where rays enter the hull of two spheres, in both tracers at any size."""

from __future__ import annotations

import numpy as np
import pytest

from engine_scenes import at
from glint import engine
from glint.engine import scene as s
from glint.engine.scene.problems import scene_problems

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


def combed(size: float, lean, away: float = 0.0) -> s.Strands:
    """1500 thin strands of one, two or five segments that all lean about as much: their boxes lie
    along them.
    """
    rng = np.random.default_rng(8)
    lean = np.asarray(lean) / np.linalg.norm(lean)
    vertices, radii, starts, count = [], [], [], 0
    for strand in range(1500):
        keys = (2, 3, 6)[strand % 3]
        root = np.append(rng.uniform(-1, 1, 2), 0.0)
        tip = root + 0.7 * lean + rng.normal(0, 0.03, 3)
        share = np.linspace(0, 1, keys)[:, None]
        vertices.append(root + share * (tip - root) + rng.normal(0, 1e-3, (keys, 3)))
        radii.append(np.linspace(3e-3, 1e-3, keys))
        starts.append(count + np.arange(keys - 1))
        count += keys
    places = size * (np.concatenate(vertices) + away * np.array([1.0, -2.0, 0.5]))
    return strands(places, size * np.concatenate(radii), np.concatenate(starts))


def rays_at(hair: s.Strands, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """To the edges of its segments, from all sides, along their axes and from far away."""
    rng = np.random.default_rng(seed)
    first = rng.choice(hair.starts, count).astype(np.int64)
    a, b = (hair.vertices[first + k].astype(float) for k in (0, 1))
    size = np.ptp(hair.vertices.astype(float), axis=0).max()
    d = rng.normal(0, 1, (count, 3))
    d[::5] = (b - a)[::5] + 1e-3 * size * d[::5]
    d[1::5, rng.integers(0, 3)] = 0.0
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    edge = np.cross(d, b - a)
    edge /= np.linalg.norm(edge, axis=1, keepdims=True)
    reach = hair.radii[first][:, None] * rng.choice([0.0, 0.9, 0.999, 1.001], (count, 1))
    target = a + rng.random((count, 1)) * (b - a) + reach * edge
    return target - size * rng.choice([0.01, 1.0, 1e4], (count, 1)) * d, d


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("away", [0.0, 30.0])
@pytest.mark.parametrize("lean", [(1, 1, 1), (-1, 0.2, 0.7), (0, 0, 1)])
def test_rays_meet_what_the_reference_does_where_hair_is_combed(lean, away, size):
    hair = combed(size, lean, away)
    o, d = rays_at(hair, 3000, 9)
    found = []
    for backend in ("NATIVE", "NUMPY"):
        with accelerator(hair, backend) as tree:
            found.append((tree.closest(o, d), tree.occluded(o, d)))
    (ours, blocked), (theirs, shaded) = found
    np.testing.assert_array_equal(blocked, ours.instance >= 0)
    other = ours.primitive != theirs.primitive
    assert other.mean() < 0.002 and (ours.instance >= 0).mean() > 0.6
    np.testing.assert_allclose(ours.t[~other], theirs.t[~other], rtol=1e-6)
    assert (blocked != shaded).mean() < 0.002


@pytest.mark.parametrize("away", [0.0, 1000.0])
@pytest.mark.parametrize("lean", [(1, 1, 1), (0.3, -1, 0.7)])
def test_rays_that_graze_boxes_along_parallel_hair_meet_it(lean, away):
    """Across their sides as the core chooses them: at any other axis there is room."""
    rng = np.random.default_rng(6)
    lean = np.asarray(lean) / np.linalg.norm(lean)
    root = np.column_stack([rng.uniform(-1, 1, (2000, 2)), np.zeros(2000)]) + away
    both_ends = np.stack([root, root + 0.5 * lean], 1).astype(np.float32)
    hair = strands(both_ends.reshape(-1, 3), np.full(4000, 1e-3), 2 * np.arange(2000))
    a, b = both_ends[:, 0].astype(float), both_ends[:, 1].astype(float)
    side = np.cross([1.0, 0, 0] if abs(lean[0]) < 0.5 else [0, 1.0, 0], lean)
    side /= np.linalg.norm(side)
    edges = [(side, np.cross(lean, side)), (np.cross(lean, side), side)]
    with accelerator(hair, "NATIVE") as tree:
        for sign in (-0.9999, 0.9999):
            for across, along in edges:
                middle = (a + b) / 2 + sign * float(hair.radii[0]) * across
                assert tree.occluded(middle - 0.01 * along, np.tile(along, (2000, 1))).all()


def test_packets_of_rays_meet_what_single_ones_do_where_hair_is_combed():
    hair = combed(1.0, (1, 1, 1))
    x, z = np.meshgrid(np.linspace(-0.5, 0.9, 160), np.linspace(0, 0.5, 80))
    target = np.stack([x, np.full_like(x, 0.3), z], -1).reshape(-1, 3)
    eye = np.array([0.4, -5.0, 1.5])
    with accelerator(hair, "NATIVE") as tree:
        whole = tree.closest(eye, target - eye)
        order = np.random.default_rng(1).permutation(len(target))
        mixed = tree.closest(eye, (target - eye)[order])
    assert (whole.instance >= 0).mean() > 0.2
    for name in ("t", "primitive", "u"):
        np.testing.assert_array_equal(getattr(whole, name)[order], getattr(mixed, name))


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
        return scene_problems(s.Scene(camera, (geometry,)))

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
