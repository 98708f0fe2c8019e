"""FIBRE lobes: what strands give back, and directions sampled from it (semantics/lobes.md)."""

from __future__ import annotations

import numpy as np

from ...evaluation.surface import Surface
from ...linear.columns import basis_around, cross, dot, pick, unit
from .term import Term, taken

Array = np.ndarray


def evaluate(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) at the places `chosen` (m,) of the term's points."""
    assert term.fibre is not None
    cosine, t = dot(n, l), term.fibre[:, chosen]
    if term.lobe.kind == "FIBRE_DIFFUSE":
        return np.where(cosine > 0, fibre_diffuse(t, l), 0.0)
    behind = term.lobe.kind == "FIBRE_TRANSMISSION"
    given = fibre_highlight(t, v, l, behind=behind, **term.numbers_at(chosen))
    return np.where((cosine < 0) if behind else (cosine > 0), given, 0.0)


class Sampler:
    """Directions sampled from a FIBRE_SPECULAR or FIBRE_TRANSMISSION lobe at m points of its own:
    along the strand the tangent of half the angle to the mirrored cone is Student's of two degrees
    of freedom, round it that of half the angle to the viewer, or to behind, Cauchy's. Both have
    closed inverses, and tails above any power of a cosine, so that no weight is without bound
    (docs/decisions/0068-strands-by-paths.md).
    """

    def __init__(self, surface: Surface, term: Term, own: Array) -> None:
        """own: (m,) which of the term's points."""
        assert term.fibre is not None
        self._t, self._v = unit(pick(term.fibre, own)), pick(surface.v, term.index[own])
        self._tilt = term.numbers["tilt"]
        self._way = -1.0 if term.lobe.kind == "FIBRE_TRANSMISSION" else 1.0
        fan = np.asarray(taken(term.numbers["fan"], own), float)
        self._along2 = 1 / (np.asarray(taken(term.exponent, own)) + 1)
        self._round2 = 1 / (2 / np.where(fan > 0, fan, 1.0) + 1)

    def sample(self, disc: Array) -> Array:
        """(3, m) unit, at points (2, m) of the unit disc; 0 where that leads beyond the strand's
        end.
        """
        x, y = disc
        tilt, to_v = self._tilt, dot(self._t, self._v)
        across_v = sine(to_v)
        u = np.clip(x * x + y * y, 2.0**-40, 1 - 2.0**-40)
        tan = np.sqrt(self._along2 / (2 * u * (1 - u))) * (2 * u - 1)
        size = 1 / ((1 + tan * tan) * (1 + tilt * tilt))
        up = size * (2 * tan * (1 - tilt * tilt) - 2 * tilt * (1 - tan * tan))
        out = size * ((1 - tan * tan) * (1 - tilt * tilt) + 4 * tan * tilt)
        to_l, across_l = up * across_v - out * to_v, out * across_v + up * to_v
        aside = np.where(np.abs(y) > 2.0**-40, y, 2.0**-40)
        turn = np.sqrt(self._round2) * (np.sqrt(u) + x) / aside
        seen = across_v > 2.0**-20
        towards = (self._v - to_v * self._t) / np.where(seen, across_v, 1.0)
        first = np.where(seen, towards, basis_around(self._t)[0])
        part = self._way * across_l / (1 + turn * turn)
        beside = (1 - turn * turn) * first + 2 * turn * cross(self._t, first)
        return np.where(across_l > 0, to_l * self._t + part * beside, 0.0)

    def pdf(self, direction: Array) -> Array:
        """(m,) a steradian, of unit directions (3, m)."""
        along2, round2 = self._along2, self._round2
        at = FibreAngles(self._t, self._tilt, self._v, direction)
        a2, c2 = at.along * at.along, at.across * at.across
        far = 2 * along2 * c2 + a2
        c = self._way * np.clip(at.turned, -1.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            around = np.sqrt(round2) / (np.pi * (round2 * (1 + c) + (1 - c)))
            pdf = around * along2 * at.across * (c2 + a2) / (2 * far * np.sqrt(far) * at.across_l)
        return np.where((at.across > 0) & (at.across_l > 0), pdf, 0.0)


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
    4 / exponent (semantics/lobes.md).  fan: how far light fans out round t from v's side, or from
    behind, 0 to 1; 0 for as far as normals do.  tilt: the tangent of half of how far it leans along
    the fibre, against t.
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
