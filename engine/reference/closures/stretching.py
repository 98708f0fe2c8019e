"""Highlights that are wider along the surface one way than the other: slopes of half vectors are
stretched, as anisotropic GGX has them (semantics/lobes.md).

Letters: n shading normal, h half vector of any length, t what a lobe is stretched along: slopes
along it are times its length, those across it over that; 0 where it is not.
"""

from __future__ import annotations

import numpy as np

from ...linear.columns import cross, dot, length, unit

Array = np.ndarray

MOST = 128.0
"""What slopes are times at most, and one over that at least."""


def stretched(n: Array, along: Array) -> Array:
    """(3, m) the part across n of the directions `along`, (3, m) or (3, 1), as long as they are."""
    along = np.broadcast_to(np.where(np.isfinite(along), along, 0.0), n.shape)
    return np.clip(length(along), 1 / MOST, MOST) * unit(cross(unit(cross(n, along)), n))


def _size4(t: Array) -> Array:
    return np.where(t.any(0), dot(t, t), 1.0) ** 2


def slopes2(n: Array, t: Array, h: Array) -> Array:
    """(m,) the square of the part of h along the surface, stretched."""
    return dot(h, t) ** 2 + dot(h, cross(n, t)) ** 2 / _size4(t)


def widths2(n: Array, t: Array, v: Array) -> Array:
    """(m,) the same the other way, as GGX's α is."""
    return dot(v, t) ** 2 / _size4(t) + dot(v, cross(n, t)) ** 2


def power(n: Array, t: Array, h: Array, exponent: Array | float, q: int) -> Array:
    """(m,) max(0, cos)^p of stretched slopes: of the density of half vectors over theirs (q = 4),
    or of that of directions drawn from it (q = 3).
    """
    c = dot(n, h)
    with np.errstate(divide="ignore", invalid="ignore"):
        before = np.log1p(dot(cross(n, h), cross(n, h)) / (c * c))
        after = np.log1p(slopes2(n, t, h) / (c * c))
        found = np.exp(-0.5 * ((exponent + q) * after - q * before))
    return np.where(c > 0, found, 0.0)


def masking(
    n: Array,
    t: Array,
    v: Array,
    l: Array,  # noqa: E741
    alpha: Array | float,
    distribution: str = "BLINN_PHONG",
) -> Array:
    """(m,) what hides surfaces of the width alpha, stretched; 1 where that is 0."""
    if distribution == "ASHIKHMIN_SHIRLEY":
        return ashikhmin_shirleys(n, v, l, alpha)
    nl, nv, a2 = np.maximum(dot(n, l), 0.0), np.clip(dot(n, v), 0.0, 1.0), np.square(alpha)
    found = masked(nl, nv, a2 * widths2(n, t, v), a2 * widths2(n, t, l), distribution)
    return np.where(a2 > 0, found, 1.0)


def ashikhmin_shirleys(
    n: Array,
    v: Array,
    l: Array,  # noqa: E741
    alpha: Array | float,
) -> Array:
    """(m,) what takes the place of masking in the model of Ashikhmin and Shirley (2000)."""
    nl, nv = np.maximum(dot(n, l), 0.0), np.clip(dot(n, v), 0.0, 1.0)
    down = np.sqrt(np.maximum(0.5 * (1 + dot(l, v)), 0.0)) * np.maximum(nv, nl)
    share = (1 - 0.5 * np.square(alpha)) * nl
    return np.where(down > 0, share / np.where(down > 0, down, 1.0), 0.0)


def masked(nl: Array, nv: Array, v2: Array, l2: Array, distribution: str) -> Array:
    """(m,) shadowing and masking over n·v: Smith's of GGX (Heitz 2014), of BECKMANN his (Walter,
    Marschner, Li, Torrance 2007, equation 27). v2, l2: (m,) of each direction α² times the square
    of its part along the surface.
    """
    if distribution == "BECKMANN":
        with np.errstate(invalid="ignore"):
            down = nv * (1 + _beckmanns_lambda(nv, v2) + _beckmanns_lambda(nl, l2))
        return np.where(down > 0, 1 / np.where(down > 0, down, 1.0), 0.0)
    down = nl * np.sqrt(nv * nv + v2) + nv * np.sqrt(nl * nl + l2)
    return 2 * nl / np.where(down > 0, down, 1.0)


def _beckmanns_lambda(cosine: Array, along2: Array) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        a = cosine / np.sqrt(along2)
        return np.where(a < 1.6, (1 + a * (-1.259 + 0.396 * a)) / (a * (3.535 + 2.181 * a)), 0.0)
