"""SPECULAR lobes: Blinn-Phong's power, GGX, Beckmann's or Ashikhmin and Shirley's distribution,
masking and a Fresnel factor (semantics/lobes.md), and directions sampled from them. The
distributions with a width α (Walter, Marschner, Li, Torrance 2007) have the exponent p of a power
that is as wide, α² = 2 / (p + 2).
"""

from __future__ import annotations

import numpy as np

from ...linear.columns import basis_around, cross, dot, length, unit
from ...program.execute.inputs import fresnel_dielectric
from ..lights import LightPoint
from ..terminator import lowered
from . import stretching
from .term import Term, taken

Array = np.ndarray

LEAST_WIDTH = 2.0**-20
"""The least width α of a lobe of a distribution that has one."""


def evaluate(
    term: Term,
    chosen: Array | slice,
    n: Array,
    v: Array,
    l: Array,  # noqa: E741, the notes' letter
) -> Array:
    """(m,) a SPECULAR lobe's density of half vectors, over that of the normal, with all that it is
    times, at the places `chosen` (m,) of the term's points; 0 where n·l is not above 0. n: the
    points', where it has none of its own.
    """
    lobe = term.lobe
    n = n if term.normal is None else term.normal[:, chosen]
    none = np.zeros_like(n)
    power = half_vectors(term, n, none, v + l, taken(term.exponent, chosen)) * gloss(
        n,
        v,
        l,
        taken(term.masking, chosen),
        taken(term.ior, chosen),
        lobe.fresnel,
        lobe.schlick,
        lobe.edge,
        lobe.distribution,
    )
    if term.stretch is not None:
        t = term.stretch[:, chosen]
        alpha = taken(term.masking, chosen)
        factor = half_vectors(term, n, t, v + l, taken(term.exponent, chosen))
        factor = factor * stretching.masking(n, t, v, l, alpha, lobe.distribution)
        ior = taken(term.ior, chosen)
        factor = factor * gloss(n, v, l, 0.0, ior, lobe.fresnel, lobe.schlick, lobe.edge)
        power = np.where(t.any(0), factor, power)
    if term.lowering is not None:
        power = power * lowered(term.lowering[chosen], dot(n, l))
    return np.where(dot(n, l) > 0, power, 0.0)


def density(term: Term, n: Array, v: Array, l: Array) -> Array:  # noqa: E741, the notes' letter
    """(m,) how densely half vectors are drawn where l is, of 1 where they are most so; of GGX, seen
    straight from above.
    """
    h, p = v + l, term.exponent
    t = np.zeros_like(h) if term.stretch is None else term.stretch
    if not term.has_width:
        return np.where(t.any(0), stretching.power(n, t, h, p, 3), blinn_phong(n, v, l, p))
    found = half_vectors(term, n, t, h, p)
    if term.lobe.distribution == "GGX":
        return found * _visible_share(n, t, seen_from(n, v), h, p)
    size = length(h)
    return found * dot(n, h) / np.where(size > 0, size, 1.0)


def half_vectors(term: Term, n: Array, t: Array, h: Array, exponent: Array | float) -> Array:
    """(m,) the density of half vectors h, of any length, over that of the normal. t: what they are
    stretched along, 0 where they are not.
    """
    across = cross(n, h)
    c2, sine2 = np.square(dot(n, h)), dot(across, across)
    slopes2 = np.where(t.any(0), stretching.slopes2(n, t, h), sine2)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if term.lobe.distribution == "GGX":
            found = np.square((c2 + sine2) / (c2 + 0.5 * (exponent + 2) * slopes2))
        elif term.lobe.distribution == "BECKMANN":
            log = np.minimum(np.log1p(sine2 / c2), 70.0)
            found = np.exp(2 * log - 0.5 * (exponent + 2) * np.minimum(slopes2 / c2, 1e30))
        elif term.lobe.distribution == "ASHIKHMIN_SHIRLEY":
            stretched = np.log1p(slopes2 / c2)
            found = np.exp(-0.5 * ((exponent + 4) * stretched - 4 * np.log1p(sine2 / c2)))
        else:
            power = stretching.power(n, t, h, exponent, 4)
            return np.where(t.any(0), power, _power(n, h, exponent))
    return np.where(dot(n, h) > 0, found, 0.0)


def drawn_size(term: Term) -> Array | float:
    """(m,) one over the integral, over 2π, of what half vectors are drawn by."""
    return term.exponent + (2 if term.has_width else 1)


def seen_from(n: Array, v: Array) -> Array:
    """(3, m) where a rough lobe is seen from: v, or the nearest direction that is not behind n."""
    cosine = dot(n, v)
    return np.where(cosine < 0, unit(v - cosine * n), v)


def _visible_share(n: Array, t: Array, v: Array, h: Array, exponent: Array | float) -> Array:
    """(m,) how densely `_visible_normal` draws half vectors h (of any length), over their density
    and times π α² / (4 v·h). v: as `seen_from` has it.
    """
    nv = np.clip(dot(n, v), 0.0, 1.0)
    rest2 = np.where(t.any(0), stretching.widths2(n, t, v), 1 - nv * nv)
    size = length(h)
    of_half = np.maximum(dot(v, h), 0.0) / np.where(size > 0, size, 1.0)
    return 2 * of_half / (nv + np.sqrt(nv * nv + 2 / (exponent + 2) * rest2))


def sample(
    n: Array,
    v: Array,
    point: LightPoint,
    share: Array | float,
    exponent: Array | float,
    stretch: Array | None = None,
    distribution: Array | str = "BLINN_PHONG",
) -> Array:
    """(3, m) half vectors of a lobe round n that is seen from v, in the direction of a disc's
    point, with `share` of the lobe nearer to n; where it is stretched as that half vector before.
    """
    x, y = point.disc
    radius = np.hypot(x, y)
    across, along = (x / radius, y / radius) if radius > 0 else (1.0, 0.0)
    first, second = basis_around(n)
    longer: Array | float = 1.0
    if stretch is not None and stretch.any():
        some = stretch.any(0)
        longer = np.where(some, length(stretch), 1.0)
        first = np.where(some, stretch / longer, first)
        second = np.where(some, cross(n, first), second)
    distribution = np.asarray(distribution)
    log, width2 = np.log1p(-share), 2 / (exponent + 2)
    drawn = exponent + np.where(distribution == "BLINN_PHONG", 1, 2)
    cosine, sine = np.exp(log / drawn), np.sqrt(-np.expm1(2 * log / drawn))
    is_beckmann = distribution == "BECKMANN"
    if is_beckmann.any():
        cosine = np.where(is_beckmann, np.sqrt(1 / (1 - width2 * log)), cosine)
        sine = np.where(is_beckmann, np.sqrt(-width2 * log / (1 - width2 * log)), sine)
    aside = across / longer * first + along * longer * second
    h = cosine * n + sine * aside
    h = np.where(np.asarray(longer) != 1, unit(h), h)
    is_ggx = distribution == "GGX"
    if not is_ggx.any():
        return h
    alpha, r = np.sqrt(width2), np.sqrt(share)
    widths, place = (alpha / longer, alpha * longer), (r * across, r * along)
    return np.where(is_ggx, _visible_normal((first, second, n), widths, seen_from(n, v), place), h)


def _visible_normal(
    axes: tuple[Array, Array, Array],
    widths: tuple[Array | float, Array | float],
    v: Array,
    place: tuple[Array | float, Array | float],
) -> Array:
    """(3, m) half vectors at a place of the unit disc as densely as they are seen from v in GGX of
    these widths along the first two axes, round the third (Heitz 2018, Sampling the GGX
    Distribution of Visible Normals). v: as `seen_from` has it.
    """
    (t1, t2, n), (a1, a2), (x, y) = axes, widths, place
    s = unit(np.stack([a1 * dot(v, t1), a2 * dot(v, t2), np.maximum(dot(v, n), 0.0)]))
    s = np.where(s.any(0), s, np.array([[0.0], [0.0], [1.0]]))
    across = np.hypot(s[0], s[1])
    slants, size = across > 0, np.where(across > 0, across, 1.0)
    cosine, sine = np.where(slants, -s[1] / size, 1.0), np.where(slants, s[0] / size, 0.0)
    first = np.stack([cosine, sine, np.zeros_like(sine)])
    bent = 0.5 * (1 + s[2])  # the disc's lower part is foreshortened as the hemisphere is seen
    up = (1 - bent) * np.sqrt(np.maximum(1 - x * x, 0.0)) + bent * y
    h = x * first + up * cross(s, first) + np.sqrt(np.maximum(1 - x * x - up * up, 0.0)) * s
    return unit(np.maximum(h[2], 0.0) * n + a1 * h[0] * t1 + a2 * h[1] * t2)


def facets_shown(
    n: Array,
    v: Array,
    h: Array,
    l: Array,  # noqa: E741
    side: float,
    term: Term,
) -> Array:
    """(m,) what rays of rough glass weigh that leave on `side` (1 or -1) of n along l, by half
    vectors h that are drawn as they are seen: less for what other facets hide (Smith; Walter and
    others 2007).
    """
    distribution, p = term.lobe.distribution, np.asarray(term.exponent, np.float64)
    if distribution == "BLINN_PHONG":
        return np.ones(n.shape[1])
    v, width2 = seen_from(n, v), 2 / (p + 2)
    nv, nl = np.clip(dot(n, v), 0.0, 1.0), np.clip(side * dot(n, l), 0.0, 1.0)
    v2, l2 = width2 * (1 - nv * nv), width2 * (1 - nl * nl)
    shown = stretching.masked(nl, nv, v2, l2, distribution)
    if distribution == "GGX":
        return 0.5 * (nv + np.sqrt(nv * nv + v2)) * shown
    nh, vh = dot(n, h), dot(v, h)
    twice = 2 * nv * nh < vh  # the groove's other facet stands for this one too
    return np.where(nh > 0, shown * vh / np.where(nh > 0, nh * np.where(twice, 2.0, 1.0), 1.0), 0.0)


def albedo(term: Term) -> Array | float:
    """(m,) or one number: about what of even light it gives back, for k = 1."""
    return 8 / (term.exponent + 2)


def directional_albedo(term: Term, seen: Array) -> Array:
    """(m,) about what a highlight of GGX's masking gives back of even light for k = 1, seen at the
    cosines (m,).
    """
    p, a2 = np.asarray(term.exponent), np.asarray(term.masking) ** 2
    seen = np.clip(seen, 0.0, 1.0)
    cosine = np.sqrt(seen**2 + 2 * (1 - seen**2) / (p + 8))
    if term.lobe.distribution == "GGX":
        width2 = 2 / (p + 2)
        above = 1 / (1 + width2 * (1.2 + 1.05 * np.sqrt(width2)))  # within 13 % of the integral
        factor = 4 * width2 * (above + (1 - above) * 0.7 * (1 - seen) ** 2)
    elif term.lobe.distribution == "ASHIKHMIN_SHIRLEY":
        width2 = 2 / (p + 2)
        factor = 4 * width2 * (1 - 0.79 * np.sqrt(width2))  # on average within 7 %
    else:
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
    return _power(n, v + l, exponent)


def _power(n: Array, h: Array, exponent: Array | float) -> Array:
    if np.ndim(exponent) == 0 and exponent == 0:
        return np.ones(n.shape[1])
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
    distribution: str = "BLINN_PHONG",
) -> Array:
    """(m,) what a highlight is times beside its half vectors: masking by surfaces of the width
    `masking`, and a Fresnel factor between v and h.
    """
    factor = np.ones(n.shape[1])
    if np.any(masking > 0):
        nl, nv, a2 = np.maximum(dot(n, l), 0.0), np.clip(dot(n, v), 0.0, 1.0), masking * masking
        rest_v, rest_l = 1 - nv * nv, 1 - nl * nl
        if distribution == "ASHIKHMIN_SHIRLEY":
            factor = stretching.ashikhmin_shirleys(n, v, l, masking)
        else:
            factor = stretching.masked(nl, nv, a2 * rest_v, a2 * rest_l, distribution)
        factor = np.where(masking > 0, factor, 1.0)
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
