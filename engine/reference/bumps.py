"""How light is hidden where a material bends the normal: as by the bumps that the bent one is of
(semantics/shadows.md; Conty Estevez, Lecocq and Stein 2019, A microfacet-based shadowing function
to solve the bump terminator problem; Chiang, Li and Burley 2019, Taming the shadow terminator).

Letters: n bent normal, m the one that it was bent from, l direction to the light.
"""

from __future__ import annotations

import numpy as np

from ..linear.columns import dot, unit

Array = np.ndarray


def bump_of(kind: str, mn: Array) -> Array:
    """(k,) what a point keeps of m·n, as `bump_shadow` takes it: GGX's α², at least 0, Chiang's
    -|m·n|, or 0 where matt lobes get no less than others. kind: of `BUMP_SHADOWING`.
    """
    if kind == "CHIANG":
        return -np.maximum(np.abs(mn), 2.0**-60)
    if kind != "GGX":
        return np.zeros_like(mn)
    with np.errstate(divide="ignore"):
        return np.clip(0.125 * (1 / (mn * mn) - 1), 0.0, 1.0)


def lifted(n: Array, g: Array, v: Array) -> Array:
    """(3, k) normals so far towards g that the directions v are mirrored at them to above the
    surface (Cycles' ensure_valid_specular_reflection).
    """
    vg, ng = dot(v, g), dot(n, g)
    t = np.minimum(0.9 * vg, 0.01)
    low = 2 * dot(n, v) * ng - vg < t
    across = unit(n - ng * g)
    x = np.where(across.any(0), across, n)
    vx = dot(v, x)
    a, c = vx * vx + vg * vg, (t + vg) ** 2
    b = 2 * (a + vg * t)
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))
    z2 = 0.25 * (b + np.where(vx < 0, root, -root)) / np.where(a > 0, a, 1.0)
    high = np.sqrt(np.maximum(1 - z2, 0.0)) * x + np.sqrt(np.maximum(z2, 0.0)) * g
    return np.where(low & (a > 0), high, n)


def bump_shadow(n: Array, m: Array, bump: Array, l: Array) -> tuple[Array, Array]:  # noqa: E741, the notes' letter
    """(k,) bool where light comes from behind m, and (k,) the share of it that matt lobes get.

    m: (3, k), 0 where nothing is hidden.
    """
    hidden, share = np.zeros(len(bump), bool), np.ones(len(bump))
    k = np.flatnonzero(m.any(0))
    if not len(k):
        return hidden, share
    n, m, l, bump = n[:, k], m[:, k], l[:, k], bump[k]  # noqa: E741
    ml = dot(m, l)
    hidden[k] = ml * dot(m, n) < 0
    cosine = np.minimum(np.abs(ml), 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):  # of the kind that is not taken
        ggx = 2 * cosine / (cosine + np.sqrt(cosine**2 + np.maximum(bump, 0) * (1 - cosine**2)))
        g = np.minimum(cosine / (-bump * np.abs(dot(n, l))), 1.0)
        share[k] = np.where(cosine > 0, np.where(bump < 0, g + g * g - g**3, ggx), 0.0)
    return hidden, share
