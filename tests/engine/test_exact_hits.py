"""What a ray hits, against rational numbers: edge functions of corners sheared in float64, with
exact signs (core/src/bvh/traverse/kernel_ray.h). Needles that single precision cannot see are hit.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from glint import engine
from native_tools import needs_core

pytestmark = needs_core

Array = np.ndarray
TIE = Fraction(1, 2**39)
"""Hits whose distances agree to this share of them may be told apart by their numbers."""


def exact_hits(corners: Array, o: Array, d: Array) -> dict[int, Fraction]:
    """Triangle → distance of all triangles (n, 3, 3) that the ray hits in front of it."""
    longest = int(np.abs(d).argmax())
    x, y = (longest + 1) % 3, (longest + 2) % 3
    inverse = 1 / d[longest]
    z = corners[..., longest] - o[longest]
    sheared = [corners[..., a] - o[a] - d[a] * inverse * z for a in (x, y)]
    found = {}
    for k in range(len(corners)):
        px, py = ([Fraction(p) for p in across[k]] for across in sheared)
        edges = [px[i] * py[j] - py[i] * px[j] for i, j in ((2, 1), (0, 2), (1, 0))]
        if not any(edges) or (min(edges) < 0 < max(edges)):
            continue
        depth = sum(e * Fraction(at) for e, at in zip(edges, z[k], strict=True)) / sum(edges)
        t = depth / Fraction(d[longest])
        if t > 0:
            found[k] = t
    return found


def soup(rng: np.random.Generator, scale: float, thin: float, away: float) -> Array:
    """(40, 3, 3) float32 triangles of a size and place; `thin` of them across to along."""
    a = rng.uniform(-1, 1, (40, 1, 3))
    along = rng.normal(size=(40, 1, 3)) * np.array([0, 1, rng.random()])[:, None]
    across = thin * rng.normal(size=(40, 1, 3)) * np.array([0, 0, 1])[:, None]
    return (scale * (a + along + across) + away).astype(np.float32)


def walls(rng: np.random.Generator) -> Array:
    """Triangles in one plane or a few roundings of float32 from it."""
    corners = rng.uniform(-1, 1, (40, 3, 3))
    corners[..., 2] = 0.5 + rng.integers(0, 4, (40, 1)) * 2.0**-24
    return corners.astype(np.float32)


SCENES = {
    "any": (lambda rng: soup(rng, 1.0, 1.0, 0.0), 1.0, 0.0),
    "slivers": (lambda rng: soup(rng, 1.0, 1e-6, 0.0), 1.0, 0.0),
    "needles": (lambda rng: soup(rng, 1.0, 1e-9, 0.0), 1.0, 0.0),
    "coplanar": (walls, 1.0, 0.0),
    "tiny": (lambda rng: soup(rng, 1e-12, 1.0, 0.0), 1e-12, 0.0),
    "huge": (lambda rng: soup(rng, 1e9, 1.0, 0.0), 1e9, 0.0),
    "far": (lambda rng: soup(rng, 1.0, 0.1, 1000.0), 1.0, 1000.0),
}


def aimed_rays(
    rng: np.random.Generator, corners: Array, scale: float, away: float, count: int
) -> tuple[Array, Array]:
    """A third at corners, a third at edges, a third anywhere; some from far away."""
    kind = rng.integers(3, size=count)[:, None]
    weight = rng.dirichlet((1, 1, 1), count)
    weight = np.where(kind == 0, np.eye(3)[rng.integers(3, size=count)], weight)
    weight[:, 2] = np.where(kind[:, 0] == 1, 0, weight[:, 2])
    weight /= weight.sum(1, keepdims=True)
    target = np.einsum("kj,kja->ka", weight, corners[rng.integers(len(corners), size=count)])
    distance = np.where(rng.random((count, 1)) < 0.2, 50, 2)
    o = away + scale * distance * rng.uniform(-1, 1, (count, 3))
    o[::4] = o[::4].astype(np.float32)
    return o, target - o


@pytest.mark.parametrize("name", SCENES)
def test_against_rational_numbers(name: str) -> None:
    make, scale, away = SCENES[name]
    rng, wrong, met = np.random.default_rng(sorted(SCENES).index(name)), [], 0
    corners = make(rng)
    o, d = aimed_rays(rng, corners.astype(float), scale, away, 300)
    order = np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)
    with engine.Accelerator.from_triangles(corners.reshape(-1, 3), order) as tree:
        hits, blocked = tree.closest(o, d), tree.occluded(o, d)
    for k in range(len(o)):
        truth = exact_hits(corners.astype(float), o[k], d[k])
        if not truth:
            right = np.isinf(hits.t[k]) and not blocked[k]
        else:
            mine, nearest = truth.get(int(hits.primitive[k])), min(truth.values())
            right = blocked[k] and mine is not None and mine <= nearest * (1 + TIE)
        met += bool(truth)
        wrong += [] if right else [k]
    assert not wrong and met > len(o) / 3


def test_needles_thinner_than_single_precision() -> None:
    """A needle as wide as a thousandth of what slopes in float32 are apart is hit by every ray at
    its inside, and by none beside it.
    """
    width = 1e-10
    needle = np.array([[0, -1, 1], [width, -1, 1], [0, 1, 1]], np.float32)
    far = np.array([[-9, -9, 3], [9, -9, 3], [0, 9, 3]], np.float32)
    rng = np.random.default_rng(0)
    y = rng.uniform(-0.9, 0.8, 2000)
    inside = 0.5 * width * (1 - y) / 2
    o = rng.uniform(-0.4, 0.4, (2000, 3)) * (1, 1, 0.3)
    with engine.Accelerator.from_triangles(
        np.concatenate([needle, far]), np.array([[0, 1, 2], [3, 4, 5]], np.uint32)
    ) as tree:
        at = np.stack([inside, y, np.ones_like(y)], 1)
        assert (tree.closest(o, at - o).primitive == 0).all()
        assert (tree.closest(o, at + (2 * width, 0, 0) - o).primitive == 1).all()
