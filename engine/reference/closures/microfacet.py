"""SPECULAR lobes: Blinn-Phong's power, Smith's masking of GGX and a Fresnel factor
(semantics/lobes.md), and directions sampled from them.
"""

from __future__ import annotations

import numpy as np

from ...linear.columns import basis_around, cross, dot, unit
from ...program.execute.inputs import fresnel_dielectric
from ..lights import LightPoint
from ..terminator import lowered
from . import stretching
from .term import Term, taken

Array = np.ndarray


def evaluate(
    term: Term,
    chosen: Array | slice,
    n: Array,
    v: Array,
    l: Array,  # noqa: E741, the notes' letter
) -> Array:
    """(m,) max(0, n·h)^p of a SPECULAR lobe with all that it is times, at the places `chosen` (m,)
    of the term's points; 0 where n·l is not above 0. n: the points', where it has none of its own.
    """
    lobe = term.lobe
    n = n if term.normal is None else term.normal[:, chosen]
    power = blinn_phong(n, v, l, taken(term.exponent, chosen)) * gloss(
        n,
        v,
        l,
        taken(term.masking, chosen),
        taken(term.ior, chosen),
        lobe.fresnel,
        lobe.schlick,
        lobe.edge,
    )
    if term.stretch is not None:
        t = term.stretch[:, chosen]
        factor = stretching.power(n, t, v + l, taken(term.exponent, chosen), 4)
        factor = factor * stretching.masking(n, t, v, l, taken(term.masking, chosen))
        ior = taken(term.ior, chosen)
        factor = factor * gloss(n, v, l, 0.0, ior, lobe.fresnel, lobe.schlick, lobe.edge)
        power = np.where(t.any(0), factor, power)
    if term.lowering is not None:
        power = power * lowered(term.lowering[chosen], dot(n, l))
    return np.where(dot(n, l) > 0, power, 0.0)


def density(term: Term, n: Array, v: Array, l: Array) -> Array:  # noqa: E741, the notes' letter
    """(m,) how densely half vectors are drawn where l is, of 1 where they are most so."""
    power = blinn_phong(n, v, l, term.exponent)
    if term.stretch is None:
        return power
    t = term.stretch
    return np.where(t.any(0), stretching.power(n, t, v + l, term.exponent, 3), power)


def sample(
    n: Array,
    point: LightPoint,
    share: Array | float,
    exponent: Array | float,
    stretch: Array | None = None,
) -> Array:
    """(3, m) half vectors of a lobe round n, in the direction of a disc's point, with `share` of
    the lobe nearer to n; where it is stretched as that half vector before.
    """
    x, y = point.disc
    radius = np.hypot(x, y)
    across, along = (x / radius, y / radius) if radius > 0 else (1.0, 0.0)
    log = np.log1p(-share) * 2 / (exponent + 1)
    first, second = basis_around(n)
    up, aside = np.exp(log / 2) * n, np.sqrt(-np.expm1(log))
    h = up + aside * (across * first + along * second)
    if stretch is None or not stretch.any():
        return h
    some = stretch.any(0)
    size2 = np.where(some, dot(stretch, stretch), 1.0)
    turned = unit(up + aside * (across / size2 * stretch + along * cross(n, stretch)))
    return np.where(some, turned, h)


def albedo(term: Term) -> Array | float:
    """(m,) or one number: about what of even light it gives back, for k = 1."""
    return 8 / (term.exponent + 2)


def directional_albedo(term: Term, seen: Array) -> Array:
    """(m,) about what a highlight of GGX's masking gives back of even light for k = 1, seen at the
    cosines (m,).
    """
    p, a2 = np.asarray(term.exponent), np.asarray(term.masking) ** 2
    seen2 = np.clip(seen, 0.0, 1.0) ** 2
    cosine = np.sqrt(seen2 + 2 * (1 - seen2) / (p + 8))
    size = 8 / (p + 2 + 8 / (4 + p * p))
    shaped = cosine / np.sqrt(a2 + (1 - a2) * cosine * cosine)
    factor = np.where(a2 > 0, size * shaped, 0.0)
    lobe = term.lobe
    return factor * reflectance(cosine, term.ior, lobe.fresnel, lobe.schlick, lobe.edge)


def blinn_phong(n: Array, v: Array, l: Array, exponent: Array | float) -> Array:  # noqa: E741, the notes' letter
    """(m,) max(0, n·h)^p with h = (v + l)/|v + l|, for points with n·l > 0; 0^0 is 1.

    cos^p as exp(p/2 · log1p(−|n×h|²)), from h before it is normalised: pow of a rounded cosine is
    wrong for large p.
    """
    if np.ndim(exponent) == 0 and exponent == 0:
        return np.ones(n.shape[1])
    h = v + l
    across = cross(n, h)
    with np.errstate(divide="ignore", invalid="ignore"):
        sine2 = np.minimum(dot(across, across) / (dot(h, h) * dot(n, n)), 1.0)
        power = np.exp(exponent / 2 * np.log1p(-sine2))
    return np.where(exponent == 0, 1.0, np.where(dot(n, h) > 0, power, 0.0))


def gloss(
    n: Array,
    v: Array,
    l: Array,  # noqa: E741
    masking: Array | float,
    ior: Array | float,
    dielectric: bool,
    schlick: bool,
    edge: bool = False,
) -> Array:
    """(m,) what a highlight is times beside its power: Smith's masking of GGX of width `masking`,
    and a Fresnel factor between v and h.
    """
    factor = np.ones(n.shape[1])
    if np.any(masking > 0):
        nl, nv, a2 = np.maximum(dot(n, l), 0.0), np.clip(dot(n, v), 0.0, 1.0), masking * masking
        down = nl * np.sqrt(a2 + (1 - a2) * nv * nv) + nv * np.sqrt(a2 + (1 - a2) * nl * nl)
        factor = np.where(masking > 0, 2 * nl / np.where(down > 0, down, 1.0), 1.0)
    if dielectric or schlick or edge:
        vh = np.sqrt(np.maximum(0.5 * (1 + dot(l, v)), 0.0))
        factor = factor * reflectance(vh, ior, dielectric, schlick, edge)
    return factor


def reflectance(
    vh: Array, ior: Array | float, dielectric: bool, schlick: bool, edge: bool
) -> Array | float:
    """(m,) a highlight's Fresnel factor at the cosines `vh` (m,)."""
    if dielectric:
        return fresnel_dielectric(vh, np.broadcast_to(ior, vh.shape))
    if edge:
        return 7**7 / 6**6 * vh * (1 - vh) ** 6
    return (1 - vh) ** 5 if schlick else 1.0
