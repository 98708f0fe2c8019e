"""Cycles' microfacets, as its `roughness` has them: GGX of the width α = roughness²
(semantics/lobes.md).

What of a uniform world a surface reflects is F0 · A + (1 - F0) · B, with A and B nearly a0 + a1 (1
- n·v)^q and b0 + b1 (1 - n·v)^q; tests/cycles/fit_roughness.py makes the tables, and says what is
minimised.
"""

from __future__ import annotations

import functools
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .fresnel import fresnel, normal_reflectance

ROUGHNESS = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
"""Of the tables below."""

WORLD = {
    "METAL": np.array([
        [5.0, 1.0000, -0.0009, 0.0000, 0.9992],
        [5.0, 1.0009, -0.0111, 0.0002, 0.9879],
        [4.5, 1.0071, -0.1148, 0.0000, 0.7854],
        [3.8, 0.9873, -0.1681, 0.0000, 0.5082],
        [3.4, 0.9440, -0.1173, 0.0000, 0.3165],
        [2.9, 0.8801, -0.0321, 0.0000, 0.1837],
        [3.3, 0.7961, 0.0819, 0.0008, 0.1351],
        [3.1, 0.6861, 0.2265, 0.0004, 0.0851],
        [3.2, 0.5661, 0.3939, 0.0003, 0.0591],
        [2.9, 0.4405, 0.5367, 0.0000, 0.0400],
        [2.7, 0.3284, 0.6431, 0.0000, 0.0279],
    ]).T,
    "DIELECTRIC": np.array([
        [4.1, 1.0000, -0.0008, 0.0026, 0.8050],
        [4.0, 1.0011, -0.0100, 0.0022, 0.7693],
        [3.6, 1.0098, -0.1046, 0.0016, 0.6212],
        [3.1, 0.9937, -0.1587, 0.0010, 0.4331],
        [2.6, 0.9477, -0.1079, 0.0008, 0.2674],
        [2.3, 0.8811, -0.0301, 0.0004, 0.1738],
        [2.5, 0.7933, 0.0747, 0.0018, 0.1273],
        [2.4, 0.6793, 0.2076, 0.0015, 0.0837],
        [2.5, 0.5585, 0.3443, 0.0012, 0.0606],
        [2.6, 0.4362, 0.5118, 0.0008, 0.0454],
        [2.4, 0.3240, 0.6036, 0.0000, 0.0331],
    ]).T,
    "LAYER": np.array([
        [4.6, 1.0001, -0.0009, 0.0077, 0.8694],
        [4.5, 1.0010, -0.0105, 0.0064, 0.8470],
        [3.9, 1.0085, -0.1068, 0.0037, 0.6691],
        [3.0, 0.9942, -0.1558, -0.0017, 0.4276],
        [2.7, 0.9487, -0.1113, 0.0012, 0.2766],
        [2.5, 0.8824, -0.0320, 0.0016, 0.1812],
        [2.5, 0.7935, 0.0776, 0.0020, 0.1231],
        [2.6, 0.6800, 0.2180, 0.0020, 0.0868],
        [2.8, 0.5631, 0.3622, 0.0018, 0.0640],
        [3.0, 0.4453, 0.5174, 0.0013, 0.0486],
        [2.9, 0.3376, 0.6153, 0.0000, 0.0376],
    ]).T,
    "LAYER_ONCE": np.array([
        [4.6, 1.0000, 0.0000, 0.0076, 0.8699],
        [4.6, 1.0000, 0.0000, 0.0078, 0.8655],
        [4.1, 1.0000, 0.0000, 0.0046, 0.7278],
        [3.3, 1.0000, 0.0000, 0.0010, 0.4974],
        [2.7, 1.0000, 0.0000, 0.0007, 0.3152],
        [2.4, 1.0000, 0.0000, 0.0018, 0.2040],
        [2.2, 1.0000, 0.0000, 0.0016, 0.1387],
        [2.1, 1.0000, 0.0000, 0.0018, 0.0974],
        [2.1, 1.0000, 0.0000, 0.0021, 0.0723],
        [2.1, 1.0000, 0.0000, 0.0021, 0.0555],
        [2.1, 1.0000, 0.0000, 0.0020, 0.0442],
    ]).T,
}  # fmt: skip
"""q, a0, a1, b0, b1, a row for each roughness, from 6° to 90°: of what a METAL reflects, B for
Schlick's weight, and a DIELECTRIC of IOR 1.5, within 7 % of the integral; of what such a dielectric
keeps from what lies below it, within 0.008. Where it scatters once that is LAYER_ONCE, which Cycles
takes from all of the light, A = 1, and not only from what is sent out.
"""

ALBEDO = np.array(
    [1.0, 0.9995, 0.9941, 0.9767, 0.9406, 0.8824, 0.8030, 0.7075, 0.6043, 0.5025, 0.4093]
)
"""Share of a uniform world that GGX reflects at F = 1, averaged over the view with the cosine; 1
where it scatters until it is out.
"""

LIT_ALBEDO = np.array([1.0, 0.9999, 0.9977, 0.986, 0.9549, 0.8955, 0.8064, *ALBEDO[7:]])
"""The same averaged over half angles δ between light and view, which highlights are seen at, with
sin 2δ cos² δ; from 0.7 on, where ever less of what scatters again looks like them, `ALBEDO`.
"""

_ROUGHNESS, _ALBEDO, _LIT_ALBEDO = (row.tolist() for row in (ROUGHNESS, ALBEDO, LIT_ALBEDO))
_WORLD = {kind: rows.tolist() for kind, rows in WORLD.items()}
SMALLEST = 0.03
"""Below it a lobe is narrower than 0.05° and roughness no longer matters."""


@dataclass(frozen=True)
class World:
    """What of a uniform world GGX reflects: F0 · (a0 + a1 x) + (1 - F0) · (b0 + b1 x), x = (1 -
    n·v)^q.
    """

    q: float
    a0: float
    a1: float
    b0: float
    b1: float


def between(x: float, places: Sequence[float], values: Sequence[float]) -> float:
    """A function at x, linear between its values at rising places, and level beyond them: NumPy's
    `interp`, which takes ten times as long for one x.
    """
    k = bisect_right(places, x)
    if k == 0 or k == len(places) or places[k - 1] == x:
        return values[max(k - 1, 0)]
    slope = (values[k] - values[k - 1]) / (places[k] - places[k - 1])
    return slope * (x - places[k - 1]) + values[k - 1]


@functools.lru_cache(maxsize=1 << 14)
def world_of(roughness: float, kind: str) -> World:
    """kind: a key of `WORLD`."""
    x = _clamped(roughness)
    return World(*(between(x, _ROUGHNESS, row) for row in _WORLD[kind]))


@functools.lru_cache(maxsize=1 << 14)
def specular_albedo(roughness: float) -> float:
    """Share of a uniform white world that GGX reflects for F = 1 when it scatters once, averaged
    over the view.
    """
    return between(_clamped(roughness), _ROUGHNESS, _ALBEDO)


def width(roughness: float) -> float:
    """GGX's α."""
    return _clamped(roughness) ** 2


def scattered(reflectance: float, roughness: float) -> float:
    """What of the light that GGX does not send out at once comes back, later, of a surface that
    reflects `reflectance` at each bounce.
    """
    once = specular_albedo(roughness)
    return reflectance * once / (1 - min(reflectance, 1.0) * (1 - once))


@functools.lru_cache(maxsize=1 << 14)
def scattered_narrow(roughness: float) -> float:
    """Which share of that, beside what is sent out at once, looks like the highlight; the rest of
    it looks matt.
    """
    once = between(_clamped(roughness), _ROUGHNESS, _LIT_ALBEDO)
    return (1 - once) / once * _narrow(roughness)


def scattered_wide(roughness: float) -> float:
    """Which share of it looks matt."""
    return 1 - _narrow(roughness)


@functools.lru_cache(maxsize=1 << 14)
def _narrow(roughness: float) -> float:
    return between(_clamped(roughness), (0.6, 1.0), (1.0, 0.0))


@functools.lru_cache(maxsize=1 << 14)
def dielectric_world(roughness: float, ior: float, kind: str = "DIELECTRIC") -> World:
    """The same for a dielectric, or what its layer keeps: with B for its own index."""
    found, own = world_of(roughness, kind), _smooth_rise(ior) / _smooth_rise(1.5)
    return World(found.q, found.a0, found.a1, found.b0 * own, found.b1 * own)


@functools.lru_cache(maxsize=1024)
def _smooth_rise(ior: float) -> float:
    """Mean over an even world of (F - F0) / (1 - F0); 0 where F is below F0, as in Cycles."""
    cosines, f0 = (np.arange(32) + 0.5) / 32, normal_reflectance(ior)
    return float(
        np.mean([2 * c * max(fresnel(c, ior) - f0, 0.0) for c in cosines]) / max(1 - f0, 1e-6)
    )


LEAST_EXPONENT = 1e-3
"""Of rough glass: without one it is clear."""


def glass_exponent(roughness: float) -> float:
    """Of the half vectors that bend what is seen through glass: as wide as GGX's (Walter et al.
    2007, Microfacet Models for Refraction through Rough Surfaces, section 5.2: α² = 2 / (p + 2)).
    """
    return max(2 / _clamped(roughness) ** 4 - 2, LEAST_EXPONENT)


def _clamped(roughness: float) -> float:
    """NaN counts as Blender's default of 0.5."""
    return min(max(roughness, SMALLEST), 1.0) if roughness == roughness else 0.5
