"""Ray queries against closed forms, brute force and the float64 reference."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine_scenes import SCENES
from glint import engine
from glint.engine import scene as s
from glint.engine.accelerator import KINDS
from native_tools import needs_core
from ray_scenes import DOWN, HALVES, SQUARE, at, both, random_rays
from ray_tools import box_grid, brute_force, bumpy, icosphere

ULP = 2.0**-52


def fields(hits: engine.Hits) -> tuple[np.ndarray, ...]:
    return hits.t, hits.instance, hits.primitive, hits.u, hits.v


# --- truth
# --------------------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_square_in_closed_form(backend: str, dtype: type) -> None:
    """Parallel rays onto two triangles: distance, barycentric weights, number of the triangle."""
    line = (np.arange(10) - 4.75) / 4
    x, y = (a.ravel() for a in np.meshgrid(line, line))
    origins = np.stack([x, y, np.full_like(x, 3.0)], 1).astype(dtype)
    with engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend) as tree:
        hits = tree.closest(origins, 0.5 * DOWN.astype(dtype))
        blocked = tree.occluded(origins, 0.5 * DOWN.astype(dtype))
    inside = (np.abs(x) < 1) & (np.abs(y) < 1)
    assert hits.t.dtype == dtype and len(hits) == len(x)
    assert np.array_equal(hits.t, np.where(inside, 6, np.inf))
    assert np.array_equal(hits.instance, np.where(inside, 0, -1))
    assert np.array_equal(blocked, inside)
    first = inside & (y < x)
    second = inside & (y > x)
    assert (
        (hits.primitive[first] == 0).all()
        and (hits.primitive[second] == 1).all()
        and (hits.primitive[~inside] == -1).all()
    )
    a, b = (x + 1) / 2, (y + 1) / 2
    for where, u, v in ((first, a - b, b), (second, a, b - a)):
        assert (
            np.abs(hits.u - u)[where].max() <= 2.0**-23
            and np.abs(hits.v - v)[where].max() <= 2.0**-23
        )
    assert not hits.u[~inside].any() and not hits.v[~inside].any()


@both
def test_ball_in_closed_form(backend: str) -> None:
    """A true sphere under a similarity; t of the nearer root."""
    ball = s.Spheres("ball", np.array([[0.25, 0, 0]], np.float32), np.array([0.5], np.float32))
    group = s.Instances("ball", 0, at(10, -4, 2, linear=2.0), ())
    center, radius = np.array([10.5, -4, 2]), 1.0
    rng = np.random.default_rng(3)
    o, d = random_rays(rng, 2000)
    o = o + center
    b, c = -((o - center) * d).sum(1), ((o - center) ** 2).sum(1) - radius**2
    root = b**2 - (d**2).sum(1) * c
    with engine.Accelerator((ball,), (group,), backend=backend) as tree:
        hits = tree.closest(o, d)
    with np.errstate(invalid="ignore"):
        near, far = (b - np.sqrt(root)) / (d**2).sum(1), (b + np.sqrt(root)) / (d**2).sum(1)
    truth = np.where(root < 0, np.inf, np.where(near > 0, near, np.where(far > 0, far, np.inf)))
    clear = np.abs(root) > 1e-9 * b**2
    assert np.array_equal(np.isinf(hits.t)[clear], np.isinf(truth)[clear])
    hit = clear & np.isfinite(truth)
    assert hit.sum() > 500
    # The square root loses digits near the rim; its argument is clear of 0 by 1e-9 of b².
    assert (np.abs(hits.t[hit] - truth[hit]) <= 1e-10 * (np.abs(near) + np.abs(far))[hit]).all()


@both
@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 40),
    rows=st.integers(1, 4),
    exponent=st.integers(-12, 12),
)
def test_against_brute_force(backend: str, seed: int, count: int, rows: int, exponent: int) -> None:
    rng = np.random.default_rng(seed)
    scale = 10.0**exponent
    vertices = (rng.normal(size=(3 * count, 3)) * scale).astype(np.float32)
    triangles = rng.integers(0, 3 * count, (count, 3)).astype(np.uint32)
    matrices = np.concatenate(
        [rng.normal(size=(rows, 3, 3)), rng.normal(size=(rows, 3, 1)) * scale], 2
    )
    corners = vertices.astype(float)[triangles]
    world = (
        np.einsum("rij,tcj->rtci", matrices[:, :, :3], corners) + matrices[:, None, None, :, 3]
    ).reshape(-1, 3, 3)
    o, d = rng.normal(size=(200, 3)) * 3 * scale, rng.normal(size=(200, 3)) * scale
    t_min, t_max = np.zeros(200), np.where(rng.random(200) < 0.5, np.inf, rng.uniform(0, 4, 200))
    mesh = s.Mesh("soup", vertices, triangles)
    with engine.Accelerator(
        (mesh,), (s.Instances("soup", 0, matrices, ()),), backend=backend
    ) as tree:
        check(
            tree, world, (o, d, t_min, t_max), rounding=2.0**-22 * np.abs(world).max(), stride=count
        )


def check(
    tree: engine.Accelerator,
    corners: np.ndarray,
    rays: tuple[np.ndarray, ...],
    rounding: float,
    stride: int,
) -> int:
    """Compares with brute force wherever moving everything by `rounding`, the error of the
    coordinates in the tree, changes no answer. `stride`: triangles of a placement. Returns how many
    hits were compared.
    """
    t, clear, cosine = brute_force(corners, *rays)
    hits, blocked = tree.closest(*rays), tree.occluded(*rays)
    assert np.array_equal(hits.instance >= 0, blocked)
    sure = clear.min(1) > 4 * rounding
    nearest = np.where(np.isnan(t), np.inf, t).min(1)
    assert np.array_equal(np.isfinite(nearest)[sure], blocked[sure])
    hit = np.flatnonzero(sure & blocked)
    which = hits.instance[hit].astype(np.intp) * stride + hits.primitive[hit]
    met, length = t[hit, which], np.linalg.norm(rays[1][hit], axis=1)
    # Within the triangle its plane is off by at most `rounding`, so that t is off by that over the
    # cosine.
    error = 2 * rounding / (cosine[hit, which] * length)
    assert (np.abs(hits.t[hit] - met) <= error).all()  # that it is met at all, too: NaN otherwise
    best = np.where(
        np.isnan(t[hit]), np.inf, t[hit] - 2 * rounding / (cosine[hit] * length[:, None])
    ).min(1)
    assert (hits.t[hit] >= best - error).all()  # that nothing is nearer
    return len(hit)


@needs_core
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("kind", [*KINDS, None])
def test_core_against_reference(name: str, kind: str | None) -> None:
    """Meshes, spheres, polygons, instances and visibility of the engine's own scenes."""
    scene = SCENES[name]()
    o, d = random_rays(np.random.default_rng(5), 3000)
    found = []
    for backend in ("NATIVE", "NUMPY"):
        with engine.Accelerator(scene.geometries, scene.instances, backend=backend) as tree:
            found.append(tree.closest(o, d, visibility=kind))
            assert np.array_equal(tree.occluded(o, d, visibility=kind), found[-1].instance >= 0)
    core, truth = found
    # A ray may pass an outline on the other side by the rounding of one to float32; of 3000 random
    # ones none should.
    same = (core.instance == truth.instance) & (core.primitive == truth.primitive)
    found = (core.instance >= 0) & (truth.instance >= 0)
    assert np.array_equal(core.instance >= 0, truth.instance >= 0)
    tied = np.zeros(len(o), bool)
    tied[found] = np.abs(core.t[found] - truth.t[found]) <= 1e-6 * truth.t[found]
    assert (same | tied).all()
    hit = same & found
    assert hit.sum() > 100 or not found.any()
    assert (np.abs(core.t[hit] - truth.t[hit]) <= 2.0**-20 * np.maximum(truth.t[hit], 1)).all()


@both
@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_far_from_the_origin(backend: str, shift: float, size: float) -> None:
    """float64 vertices: only the rounding of the coordinates themselves grows with the distance."""
    vertices, triangles = icosphere(2)
    place = shift * np.array([1.0, -0.7, 0.4])
    vertices = vertices * size + place
    o, d = random_rays(np.random.default_rng(7), 1000)
    bounds = np.zeros(1000), np.full(1000, np.inf)
    with engine.Accelerator.from_triangles(vertices, triangles, backend=backend) as tree:
        rounding = 2.0**-23 * size + 8 * ULP * shift
        assert np.abs(tree.bounds - np.array([vertices.min(0), vertices.max(0)])).max() <= rounding
        assert (
            check(
                tree, vertices[triangles], (o * size + place, d, *bounds), rounding, len(triangles)
            )
            > 300
        )


@both
@pytest.mark.parametrize("exponent", [-30, -12, 12, 30])
def test_any_scale(backend: str, exponent: int) -> None:
    vertices, triangles = icosphere(2)
    o, d = random_rays(np.random.default_rng(8), 2000)
    scale = 2.0 ** (exponent * 3)
    for shortened in (1.0, 1e-100, 1e100):
        with engine.Accelerator.from_triangles(
            vertices.astype(np.float32) * np.float32(scale), triangles, backend=backend
        ) as tree:
            scaled = tree.closest(o * scale, d * shortened)
        with engine.Accelerator.from_triangles(
            vertices.astype(np.float32), triangles, backend=backend
        ) as tree:
            plain = tree.closest(o, d)
        assert np.array_equal(scaled.primitive, plain.primitive)
        hit = plain.primitive >= 0
        assert hit.sum() > 500
        assert (np.abs(scaled.t[hit] / (scale / shortened) / plain.t[hit] - 1) <= 64 * ULP).all()


# --- arguments
# --------------------------------------------------------------------------------------------------


@both
def test_shapes_that_go_together(backend: str) -> None:
    o, d = random_rays(np.random.default_rng(9), 50)
    with engine.Accelerator.from_triangles(*bumpy(8), backend=backend) as tree:
        shared = tree.closest(o[0], d)
        spelled = tree.closest(np.repeat(o[:1], 50, 0), d, np.zeros(50), np.full(50, np.inf))
        assert all(
            np.array_equal(a, b) for a, b in zip(fields(shared), fields(spelled), strict=True)
        )
        assert len(tree.closest(o, d[0])) == 50
        assert len(tree.closest(o[0], d[0])) == 1
        assert len(tree.closest(o[0], d[0], np.zeros(7))) == 7
        assert (
            len(tree.closest(np.zeros((0, 3)), d[0])) == 0
            and len(tree.occluded(np.zeros((0, 3)), np.zeros((0, 3)))) == 0
        )
        backwards = tree.closest(o[::-1], d[::-1])  # not contiguous
        assert np.array_equal(backwards.t[::-1], tree.closest(o, d).t)
        assert np.array_equal(tree.closest(o.tolist(), d.tolist()).t, tree.closest(o, d).t)
        assert tree.closest(o.astype(np.float32), d).t.dtype == np.float64
        assert tree.closest(o.astype(">f8"), d.astype(">f4")).t.dtype == np.float64


@both
def test_the_interval_is_open(backend: str) -> None:
    """t_min < t < t_max, per ray; t_min below 0 counts as 0; empty intervals hold nothing."""
    bounds = np.array(
        [
            [0, 3],
            [0, 3.5],
            [3, 9],
            [2.5, 9],
            [-9, 9],
            [-9, -1],
            [4, 2],
            [0, 0],
            [3.5, np.inf],
            [-np.inf, np.inf],
        ]
    )
    with engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend) as tree:
        for dtype in (np.float32, np.float64):
            o, d = np.array([0.25, 0.5, 3], dtype), DOWN.astype(dtype)
            blocked = tree.occluded(o, d, bounds[:, 0], bounds[:, 1])
            assert blocked.tolist() == [
                False,
                True,
                False,
                True,
                True,
                False,
                False,
                False,
                False,
                True,
            ]
            assert np.array_equal(
                tree.closest(o, d, bounds[:, 0], bounds[:, 1]).t, np.where(blocked, 3, np.inf)
            )
        assert not tree.occluded([0.25, 0.5, -3], DOWN, -9, 9)[0]


@both
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_that_miss_by_definition(backend: str, dtype: type) -> None:
    good = np.array([[0.25, 0.5, 3, 0, 0, -1, 0, np.inf]])
    rays = np.repeat(good, 8 * 3 + 3, 0)
    for column in range(8):
        for k, bad in enumerate((np.nan, np.inf, -np.inf)):
            rays[3 * column + k, column] = bad
    rays[24, 3:6] = 0
    if dtype == np.float64:
        rays[25, 5], rays[26, 5] = -1e-200, -1e200
    expected = np.zeros(len(rays), bool)
    expected[[6 * 3 + 2, 7 * 3 + 1]] = True  # t_min -inf, t_max inf
    expected[25:] = dtype == np.float32
    rays = rays.astype(dtype)
    with engine.Accelerator.from_triangles(SQUARE, HALVES, backend=backend) as tree:
        arguments = (rays[:, :3], rays[:, 3:6], rays[:, 6], rays[:, 7])
        hits = tree.closest(*arguments)
        assert np.array_equal(tree.occluded(*arguments), expected)
    assert np.array_equal(hits.instance, np.where(expected, 0, -1)) and np.array_equal(
        hits.t, np.where(expected, 3, np.inf)
    )
    assert (
        (hits.primitive[~expected] == -1).all()
        and not hits.u[~expected].any()
        and not hits.v[~expected].any()
    )


@both
def test_visibility(backend: str) -> None:
    mesh = s.Mesh("square", SQUARE, HALVES)
    hidden = {f"visible_{kind}": False for kind in KINDS}
    shown = ("visible_camera", "visible_mirror", "visible_transmission", "visible_diffuse")
    groups = [
        s.Instances(flag, 0, at(0, 0, -k), (), **{**hidden, flag: True})
        for k, flag in enumerate(shown)
    ]
    groups.append(s.Instances("hidden", 0, at(0, 0, 1), (), **hidden))
    with engine.Accelerator((mesh,), groups, backend=backend) as tree:
        seen = {
            kind: tree.closest([0.2, 0.1, 3.0], DOWN, visibility=kind).instance[0]
            for kind in (*KINDS, None)
        }
    expected = {"camera": 0, "mirror": 1, "shadow": -1, "transmission": 2, "diffuse": 3, None: 0}
    assert seen == expected


@both
def test_instances_are_numbered_by_group_and_row(backend: str) -> None:
    mesh = s.Mesh("square", SQUARE, HALVES)
    rows = [
        np.concatenate([np.zeros((0, 3, 4)), *(at(10 * k, 0, 0) for k in group)])
        for group in ((0, 1, 2), (), (3,), (4, 5))
    ]
    groups = [s.Instances(f"group {k}", 0, matrices, (99,)) for k, matrices in enumerate(rows)]
    with engine.Accelerator((mesh,), groups, backend=backend) as tree:
        hits = tree.closest([[10 * k + 0.5, 0.25, 1] for k in range(6)], DOWN)
        assert tree.stats["instances"] == 6
    assert hits.instance.tolist() == [0, 1, 2, 3, 4, 5]


@needs_core
def test_nodes_over_many_instances_are_well_filled() -> None:
    """Where a node's ranges were parted until it is full, those below it would have 3.4 children
    each.
    """
    rng = np.random.default_rng(3)
    matrices = np.concatenate([at(*position) for position in rng.uniform(-20, 20, (1000, 3))])
    with engine.Accelerator(
        [s.Mesh("square", SQUARE, HALVES)],
        [s.Instances("squares", 0, matrices, (0,))],
        backend="NATIVE",
    ) as tree:
        nodes = tree.stats["nodes"] - 1  # one is the square's
        assert (nodes - 1 + 1000) / nodes > 4.5


@both
def test_coincident_faces_give_the_lowest(backend: str) -> None:
    mesh = s.Mesh("twice", SQUARE, np.concatenate([HALVES, HALVES]))
    with engine.Accelerator(
        (mesh, mesh),
        [s.Instances(str(k), k % 2, at(0, 0, 0), ()) for k in range(4)],
        backend=backend,
    ) as tree:
        hits = tree.closest([[0.5, -0.5, 1], [-0.5, 0.5, 1]], DOWN)
    assert hits.instance.tolist() == [0, 0] and hits.primitive.tolist() == [0, 1]


@both
def test_bad_primitives_are_left_out_and_counted(backend: str) -> None:
    """NaN and infinite vertices, and a stray one at 3e38, leave the rest as it was."""
    vertices, triangles = icosphere(2)
    vertices = vertices.astype(np.float32)
    o, d = random_rays(np.random.default_rng(10), 2000)
    with engine.Accelerator.from_triangles(vertices, triangles, backend=backend) as tree:
        plain = tree.closest(o, d)
    stray = np.array(
        [
            [np.nan, 0, 0],
            [0, np.inf, 0],
            [3e38, 3e38, 3e38],
            [3e38, 3e38, -3e38],
            [3e38, -3e38, 3e38],
        ],
        np.float32,
    )
    n = len(vertices)
    worse = np.array([[0, 1, n], [n + 1, 2, 3], [n + 2, n + 3, n + 4]], np.uint32)
    with engine.Accelerator.from_triangles(
        np.concatenate([vertices, stray]), np.concatenate([triangles, worse]), backend=backend
    ) as tree:
        hits = tree.closest(o, d, 0, 1e6)
        assert tree.stats["dropped"] == 3
    assert all(np.array_equal(a, b) for a, b in zip(fields(plain), fields(hits), strict=True))


@both
@pytest.mark.parametrize("vertices", [np.zeros((0, 3)), np.zeros((5, 3))])
def test_nothing_to_hit(backend: str, vertices: np.ndarray) -> None:
    triangles = np.array([[0, 1, 2], [1, 1, 1]]) if len(vertices) else []
    o, d = random_rays(np.random.default_rng(11), 100)
    with engine.Accelerator.from_triangles(vertices, triangles, backend=backend) as tree:
        assert not tree.occluded(o, d).any() and np.isinf(tree.closest(o, d).t).all()
    with engine.Accelerator((), (), backend=backend) as tree:
        assert not tree.occluded(o, d).any()
        assert (tree.bounds[0] > tree.bounds[1]).all()


@needs_core
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_same_bits_from_any_number_of_threads_and_any_cut(dtype: type) -> None:
    vertices, triangles = box_grid(12)
    o, d = (a.astype(dtype) for a in random_rays(np.random.default_rng(13), 30_011))
    answers = []
    for threads in (1, 2, 8):
        with engine.Accelerator.from_triangles(vertices, triangles, threads=threads) as tree:
            answers.append(fields(tree.closest(o, d)))
            parts = [
                fields(tree.closest(o[k : k + 777], d[k : k + 777])) for k in range(0, len(o), 777)
            ]
            answers.append(tuple(np.concatenate(column) for column in zip(*parts, strict=True)))
            assert np.array_equal(tree.occluded(o, d), answers[0][1] >= 0)
    for other in answers[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(answers[0], other, strict=True))
