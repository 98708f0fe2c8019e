"""Highlights, mirrors and refraction (notes, sections 4.13 and 4.17). d unit direction of the ray,
n unit normal on its side.
"""

from __future__ import annotations

import numpy as np

from .vectors import cross, dot, unit

Array = np.ndarray


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
        return fresnel(vh, np.broadcast_to(ior, vh.shape))
    if edge:
        return 7**7 / 6**6 * vh * (1 - vh) ** 6
    return (1 - vh) ** 5 if schlick else 1.0


def sheen(n: Array, v: Array, l: Array, width: Array | float, lean: Array | float) -> Array:  # noqa: E741
    """(m,) a cosine lobe, seen from above, that is stretched to 1 / width across n and leans to the
    viewer's side, times pi: n·l width² / ((width l_x - lean n·l)² + width² l_y² + (n·l)²)², l_x
    along v. For points with n·l > 0 (Zeltner, Burley, Chiang 2022, Practical multiple-scattering
    sheen using linearly transformed cosines).
    """
    nl, nv = dot(n, l), np.minimum(dot(n, v), 1.0)
    sine2 = 1 - nv * nv
    safe = np.where(sine2 > 0, sine2, 1.0)
    along = np.where(sine2 > 0, (dot(l, v) - nl * nv) / np.sqrt(safe), 0.0)
    across2 = 1 - nl * nl - along * along
    square = (width * along - lean * nl) ** 2 + width * width * across2 + nl * nl
    with np.errstate(divide="ignore", invalid="ignore"):
        return nl * width * width / (square * square)


def toon(cosine: Array, size: Array | float, smooth: Array | float) -> Array:
    """(m,) even light within an angle of that cosine, less over its smooth edge, times pi. size,
    smooth: of the two, as shares of a right angle.
    """
    whole, edge, end = _toon_angles(size, smooth)
    angle = np.arccos(np.clip(cosine, 0.0, 1.0))
    beside = np.where(edge > 0, 1 - (angle - whole) / np.where(edge > 0, edge, 1.0), 0.0)
    return np.where(angle < end, np.where(angle < whole, 1.0, beside) / _versine(end), 0.0)


def toon_albedo(size: Array | float, smooth: Array | float) -> Array:
    """What of the light of a uniform world it gives back to all sides: 1 without a smooth edge."""
    whole, edge, end = _toon_angles(size, smooth)
    over = np.where(edge > 0, edge, 1.0)
    lost = (1 - (end - whole) / over) * np.cos(end) + (np.sin(end) - np.sin(whole)) / over
    return np.where(edge > 0, 2 * (1 - lost) / _versine(end), 1.0)


def _toon_angles(size: Array | float, smooth: Array | float) -> tuple[Array, Array, Array]:
    """Up to where it is whole, over which angle it falls off, and where it ends."""
    whole, edge = np.pi / 2 * np.clip(size, 1e-5, 1.0), np.pi / 2 * np.asarray(smooth)
    return whole, edge, np.minimum(whole + edge, np.pi / 2)


def _versine(end: Array) -> Array:
    return 4 * np.sin(end / 2) ** 2


def oren_nayar(n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) what a rough matt surface gives back besides Lambert's share, for a k of B, times pi:
    more where light comes from the viewer's side. For points with n·l > 0 (Fujii, A tiny
    improvement of Oren-Nayar reflectance model).
    """
    nl, nv = np.maximum(dot(n, l), 0.0), np.maximum(dot(n, v), 0.0)
    s = dot(l, v) - nl * nv
    most = np.maximum(nl, nv)
    return nl * np.where(s > 0, s / np.where(most > 0, most, 1.0), s)


NEVER_LOST = 0.5 - 2 / (3 * np.pi)
"""What A leaves of 1, over B: as much at normal incidence is lost to facets."""


def lost_once(cosine: Array) -> Array:
    """(m,) what of light, or of even light to a view, at an angle of that cosine a rough matt
    surface does not give back at once, over B: its facets meet it again.
    """
    c = np.clip(cosine, 0.0, 1.0)
    s = np.sqrt(1 - c * c)
    given = s * (np.arccos(c) - 2 / 3 - s * c) + 2 / 3 * s * c * (1 + s + s * s) / (1 + s)
    return NEVER_LOST - given / np.pi


def fibre_diffuse(t: Array, l: Array) -> Array:  # noqa: E741
    """(m,) Kajiya and Kay's sine of the angle to the tangent t of a fibre, of any length, times
    2 / pi: over the fibre's width, of which half sees a light from the side, all of a uniform world
    comes back.
    """
    return 2 / np.pi * sine(dot(unit(t), l))


def fibre_highlight(
    t: Array,
    v: Array,
    l: Array,  # noqa: E741
    exponent: Array | float,
    fan: Array | float = 0.0,
    behind: bool = False,
    tilt: Array | float = 0.0,
) -> Array:
    """(m,) what a fibre gives back of light along l, spread along its tangent t with the variance
    4 / exponent (SEMANTICS.md).  fan: how far light fans out round t from v's side, or from behind,
    0 to 1; 0 for as far as normals do.  tilt: the tangent of half of how far it leans along the
    fibre, against t.
    """
    at = FibreAngles(unit(t), tilt, v, l)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = 0.5 * (1 + (-1 if behind else 1) * np.clip(at.turned, -1.0, 1.0))
        q = 1 / np.where(np.greater(fan, 0), fan, 1.0)
        fanned = np.sqrt(np.pi * (2 * q + 0.5) / 8) * np.where(u > 0, u ** (q - 1), 0.0)
    fanned = np.where(np.greater(fan, 0), fanned, 1.0)
    return fanned * _spread_along(at, tilt, np.asarray(exponent, float))


def _spread_along(at: FibreAngles, tilt: Array | float, exponent: Array) -> Array:
    """(m,) of d'Eon and others (An energy-conserving hair reflectance model, 2011), for a variance
    of 4 / exponent: the integral over all l, times the cosine off the plane across t, is 1.
    """
    leans, v = 2 * np.arctan(tilt), exponent / 4
    to_v = at.to_v * np.cos(leans) + at.across_v * np.sin(leans)
    both = at.across_l * np.abs(at.across_v * np.cos(leans) - at.to_v * np.sin(leans))
    x = v * both
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        far = (1 + 1 / (8 * x) + 9 / (128 * x * x)) / np.sqrt(2 * np.pi * x)
        bessel = np.where(x < 500, np.i0(np.minimum(x, 500)) * np.exp(-np.minimum(x, 500)), far)
        whole = np.where(v > 0, v / -np.expm1(-2 * v), 0.5)
    return whole * bessel * np.exp(v * np.minimum(both - at.to_l * to_v - 1, 0.0))


class FibreAngles:
    """How l and v (3, m) lie to the unit tangents t (3, m) of fibres whose lobe leans by `tilt`.

    `tilt` is a tangent. (m,) each: to_l, to_v and across_l, across_v are sines and cosines of the
    angles off the plane across t; half of both angles together, leant, has the tangent along /
    across; turned is the cosine of the angle round t from v to l.
    """

    def __init__(self, t: Array, tilt: Array | float, v: Array, l: Array) -> None:  # noqa: E741
        self.to_l, self.to_v = dot(t, l), dot(t, v)
        self.across_l, self.across_v = sine(self.to_l), sine(self.to_v)
        along, across = self.to_l + self.to_v, self.across_l + self.across_v
        self.along, self.across = along + tilt * across, across - tilt * along
        both = self.across_l * self.across_v
        with np.errstate(divide="ignore", invalid="ignore"):
            turned = (dot(l, v) - self.to_l * self.to_v) / both
        self.turned = np.where(both > 0, turned, 0.0)


def sine(cosine: Array) -> Array:
    """(m,) at least 0, of the angles of these cosines (m,)."""
    return np.sqrt(np.maximum(1 - cosine * cosine, 0.0))


def reflected(d: Array, n: Array) -> Array:
    """d − 2(d·n)n."""
    return unit(d - 2 * dot(d, n) * n)


def fresnel(cosine: Array, index: Array) -> Array:
    """Unpolarised reflectance of a dielectric for the cosine of incidence; `index` is that beyond
    the surface over that before it.
    """
    sine2 = (1 - cosine * cosine) / (index * index)
    inner = np.sqrt(np.maximum(0.0, 1 - sine2))
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (cosine - index * inner) / (cosine + index * inner)
        along = (index * cosine - inner) / (index * cosine + inner)
    return np.where(sine2 >= 1, 1.0, (across * across + along * along) / 2)


def refracted(d: Array, n: Array, index: Array) -> tuple[Array, Array]:
    """Snell's direction, and (m,) bool where there is one (no total reflection)."""
    cosine = -dot(d, n)
    sine2 = (1 - cosine * cosine) / (index * index)
    inner = np.sqrt(np.maximum(0.0, 1 - sine2))
    return unit(d / index + (cosine / index - inner) * n), sine2 < 1
