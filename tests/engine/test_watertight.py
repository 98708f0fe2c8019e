"""No ray slips between two triangles, and no bit depends on the machine: rows N1, N2 and N15 of the
numerics' acceptance table.

The fast tests take a few thousand rays each, those marked slow the numbers of the table: 1e7 and
5e7.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, look_at
from glint import engine
from glint.engine import scene as s
from native_tools import assert_instruction_sets_agree, material, needs_core
from ray_tools import box_grid, bumpy, icosphere, oblique_grid

pytestmark = needs_core

CLOSED = {"icosphere": lambda: icosphere(3), "box": lambda: box_grid(24), "bumpy": bumpy}
RADII = (1e-3, 1.0, 1e4)
SHIFTS = (0.0, 1e3)
BLOCK = 1 << 18

CASES = [(name, radius, shift) for name in CLOSED for radius in RADII for shift in SHIFTS]


# --- N1: rays exactly at edges and vertices
# -----------------------------------------------------------------------------------------


def targets(
    vertices: np.ndarray, triangles: np.ndarray, rng: np.random.Generator, count: int
) -> np.ndarray:
    """(count, 3) float64 points where leaks would be: a third vertices, a third middles of edges, a
    third anywhere on edges.
    """
    triangle, side = rng.integers(len(triangles), size=count), rng.integers(3, size=count)
    a = vertices[triangles[triangle, side]].astype(float)
    b = vertices[triangles[triangle, (side + 1) % 3]].astype(float)
    along = np.choose(
        rng.integers(3, size=count), [np.zeros(count), np.full(count, 0.5), rng.random(count)]
    )
    return a + along[:, None] * (b - a)


def leaks_of_closed(
    vertices: np.ndarray,
    triangles: np.ndarray,
    center: np.ndarray,
    radius: float,
    rays: int,
    seed: int,
) -> int:
    """Rays from inside that see nothing. Half of them start at the middle; a quarter of the origins
    are float32 numbers, so that most of their differences to a vertex are exact.
    """
    rng, leaks = np.random.default_rng(seed), 0
    with engine.Accelerator.from_triangles(vertices, triangles) as tree:
        for begin in range(0, rays, BLOCK):
            count = min(BLOCK, rays - begin)
            o = (
                center
                + 0.3 * radius * rng.uniform(-1, 1, (count, 3)) * (np.arange(count) % 2)[:, None]
            )
            o[::4] = o[::4].astype(np.float32)
            d = targets(vertices, triangles, rng, count) - o
            for dtype in (np.float64, np.float32) if begin % (4 * BLOCK) == 0 else (np.float64,):
                start, along = o.astype(dtype), d.astype(dtype)
                missed = np.isinf(tree.closest(start, along).t)
                leaks += int((missed | ~tree.occluded(start, along)).sum())
    return leaks


def leaks_of_grid(
    vertices: np.ndarray,
    triangles: np.ndarray,
    center: np.ndarray,
    radius: float,
    rays: int,
    seed: int,
) -> int:
    """Rays from both sides at the inner edges and vertices of an open grid that do not stop
    there.
    """
    inner = (np.abs(vertices - center)[:, 0] < 0.95 * radius)[triangles].all(1)
    inner &= (
        np.abs(0.6 * (vertices - center)[:, 1] + 0.8 * (vertices - center)[:, 2])[triangles]
        < 0.9 * radius
    ).all(1)
    rng, leaks = np.random.default_rng(seed), 0
    normal = np.cross([1, -0.3, 0.2], [0, 0.6, 0.8])
    normal /= np.linalg.norm(normal)
    with engine.Accelerator.from_triangles(vertices, triangles) as tree:
        for begin in range(0, rays, BLOCK):
            count = min(BLOCK, rays - begin)
            at = targets(vertices, triangles[inner], rng, count)
            d = 2 * radius * rng.normal(size=(count, 3))
            # all but along it a float32 ray passes beside the open grid
            steep = np.abs(d @ normal) > 1e-2 * np.linalg.norm(d, axis=1)
            at, d = at[steep], d[steep]
            leaks += int((~(tree.closest(at - d, d).t < np.inf)).sum())
    return leaks


def placed_mesh(vertices: np.ndarray, radius: float, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """float32 vertices of that size at (shift, shift, shift), and the centre."""
    center = np.full(3, shift)
    return (vertices * radius + center).astype(np.float32), center


@pytest.mark.parametrize(("name", "radius", "shift"), CASES)
def test_n1_closed_meshes(name: str, radius: float, shift: float) -> None:
    vertices, triangles = CLOSED[name]()
    placed, center = placed_mesh(vertices, radius, shift)
    assert leaks_of_closed(placed, triangles, center, radius, 6000, seed=1) == 0


def test_n1_triangles_squeezed_to_lines() -> None:
    """float32 holds this mesh to 6 % of its radius and squeezes 38 of its triangles to lines
    between three different corners.
    """
    vertices, triangles = bumpy()
    placed, center = placed_mesh(vertices, 1e-3, 1e3)
    assert leaks_of_closed(placed, triangles, center, 1e-3, 200_000, seed=1) == 0


@pytest.mark.parametrize("radius", RADII)
def test_n1_oblique_grids(radius: float) -> None:
    vertices, triangles = oblique_grid()
    placed, center = placed_mesh(vertices, radius, 0.0)
    assert leaks_of_grid(placed, triangles, center, radius, 6000, seed=2) == 0


@pytest.mark.slow
def test_n1_ten_million_rays() -> None:
    """1e7 rays over all meshes, sizes and places."""
    rays = 10**7 // (len(CASES) + 2 * len(RADII)) + 1
    leaks = {}
    for seed, (name, radius, shift) in enumerate(CASES):
        vertices, triangles = CLOSED[name]()
        placed, center = placed_mesh(vertices, radius, shift)
        leaks[name, radius, shift] = leaks_of_closed(placed, triangles, center, radius, rays, seed)
    for radius in RADII:
        # at 1e3 float32 no longer holds an open grid of size 1e-3
        for shift in (0.0, 1.0) if radius < 1 else SHIFTS:
            vertices, triangles = oblique_grid()
            placed, center = placed_mesh(vertices, radius, shift)
            leaks["grid", radius, shift] = leaks_of_grid(
                placed, triangles, center, radius, rays, seed=99
            )
    assert not {case: count for case, count in leaks.items() if count}


# --- N2: closed black meshes in a white world
# ---------------------------------------------------------------------------------------


def lit_pixels(name: str, size: int, seed: int) -> int:
    """Of size² camera rays from a random place inside a closed black mesh those that see the white
    world.
    """
    rng = np.random.default_rng(seed)
    vertices, triangles = CLOSED[name]()
    mesh = s.Mesh(name, vertices.astype(np.float32), triangles)
    eye, kind = rng.uniform(-0.3, 0.3, 3), ("PERSPECTIVE", "ORTHOGRAPHIC")[seed % 2]
    view = look_at(eye, eye + rng.normal(size=3))
    if seed % 3 == 0:  # along an axis, through the vertices of the box exactly
        view, eye = look_at((0, 0, 0), (-1, 0, 0)), np.zeros(3)
    half = 0.3 if kind == "ORTHOGRAPHIC" else 1.0
    camera = s.Camera(kind, view, (-half, half, -half, half), (size, size))
    group = s.Instances(name, 0, np.eye(4)[None, :3], (0,))
    scene = s.Scene(
        camera, (mesh,), (group,), (material(),), world=s.World(background=(1.0, 1.0, 1.0))
    )
    film = engine.render(scene, engine.Settings(samples=1))
    assert film.combined.shape == (size, size, 4) and (film.combined[..., 3] == 1).all()
    return int((film.combined[..., :3] > 0).any(-1).sum())


@pytest.mark.parametrize("name", CLOSED)
def test_n2_closed_black_meshes(name: str) -> None:
    assert [lit_pixels(name, 96, seed) for seed in range(6)] == [0] * 6


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSED)
def test_n2_fifty_million_rays(name: str) -> None:
    """5e7 rays over the three meshes."""
    size = 1024
    pictures = 5 * 10**7 // (len(CLOSED) * size * size) + 1
    assert {seed: lit for seed in range(pictures) if (lit := lit_pixels(name, size, seed))} == {}


def test_n2_would_see_a_leak() -> None:
    """The box without one of its triangles lets light in."""
    vertices, triangles = CLOSED["box"]()
    CLOSED["open box"] = lambda: (vertices, triangles[:-40])
    try:
        assert sum(lit_pixels("open box", 96, seed) for seed in range(6)) > 0
    finally:
        del CLOSED["open box"]


# --- N15: the same bits
# --------------------------------------------------------------------------------------------------


def fingerprints(threads: int, cut: bool) -> dict[str, str]:
    """name -> hash of all passes of every scene, whole or put together from four regions, and of
    ray queries.
    """
    plan = engine.Settings(
        samples=2,
        light_samples=3,
        threads=threads,
        passes=frozenset(engine.PASSES) - {"Combined", "Fallbacks"},
    )
    return {name: _hash(_passes(make(), plan, cut)) for name, make in SCENES.items()} | {
        "queries": _hash(_queries(threads))
    }


def _passes(scene: s.Scene, plan: engine.Settings, cut: bool) -> list[np.ndarray]:
    if not cut:
        return [passed for _, passed in sorted(engine.render(scene, plan).passes.items())]
    (nx, ny), found = scene.camera.resolution, []
    for y0, y1 in ((0, 7), (7, ny)):
        row = [
            engine.render(scene, replace(plan, region=(x0, y0, x1, y1))).passes
            for x0, x1 in ((0, 33), (33, nx))
        ]
        found.append({name: np.concatenate([part[name] for part in row], 1) for name in row[0]})
    return [np.concatenate([part[name] for part in found], 0) for name in sorted(found[0])]


def _queries(threads: int) -> list[np.ndarray]:
    vertices, triangles = bumpy(16)
    rng = np.random.default_rng(4)
    o = rng.normal(size=(5000, 3))
    d = vertices[rng.integers(len(vertices), size=5000)] - o
    with engine.Accelerator.from_triangles(
        vertices.astype(np.float32), triangles, threads=threads
    ) as tree:
        hits = tree.closest(o, d)
        return [hits.t, hits.instance, hits.primitive, hits.u, hits.v, tree.occluded(o, d, 0, 1)]


def _hash(arrays: list[np.ndarray]) -> str:
    total = hashlib.sha256()
    for array in arrays:
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def test_n15_threads_and_regions() -> None:
    truth = fingerprints(1, cut=False)
    for threads, cut in ((8, False), (2, True)):
        assert fingerprints(threads, cut) == truth, (threads, cut)


def test_n15_instruction_sets() -> None:
    """Every instruction set that the library has and this machine runs."""
    drawn = assert_instruction_sets_agree(lambda: fingerprints(8, cut=True))
    assert drawn == fingerprints(2, cut=False)
