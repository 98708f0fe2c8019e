"""Reflectance of smooth dielectrics and metals: what Principled's specular settings mean, and how
much light dielectrics leave for what lies below.
"""

from __future__ import annotations

import math


def fresnel(cosine: float, ior: float) -> float:
    """Unpolarised Fresnel reflectance of a dielectric of relative index `ior` > 0 (entering), 0 to
    1; 1 at total reflection.

    cosine: of the angle of incidence, 0 to 1.
    """
    squared = ior * ior - 1 + cosine * cosine
    if not squared > 0:
        return 1.0
    g = math.sqrt(squared)
    parallel, along = (
        (g - cosine) / (g + cosine),
        (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1),
    )
    return 0.5 * parallel * parallel * (1 + along * along)


def normal_reflectance(ior: float) -> float:
    """F0, the reflectance at normal incidence: ((ior - 1) / (ior + 1))²."""
    return ((ior - 1) / (ior + 1)) ** 2


def ior_from_reflectance(reflectance: float) -> float:
    """The index of refraction, at least 1, whose F0 is `reflectance` (clamped below 1)."""
    root = math.sqrt(min(max(reflectance, 0.0), 0.99))
    return (1 + root) / (1 - root)


def dielectric_albedo(ior: float) -> float:
    """What share of light a dielectric layer reflects before it reaches the diffuse layer: the
    reflectance at 45°.

    A constant has to stand for something that grows from F0 when looked at straight to 1 at grazing
    view; most of a picture is seen between 0° and 60°, where 45° is the median by projected area (∫
    2 cos θ sin θ up to 45° is one half).
    """
    return fresnel(math.sqrt(0.5), max(ior, 1e-3))


EDGE_COSINE = 1 / 7
"""Of the angle of 82 degrees at which metals are tinted (Kutz, Hašan, Edmondson 2021)."""
EDGE_WEIGHT = 7**7 / 6**6
"""Times c (1 - c)^6, the weight of such a tint at the cosine c, which is 1 there."""
EDGE_MEAN = EDGE_WEIGHT / 126
"""Mean over an even world of that weight."""


def schlick(f0: float, cosine: float) -> float:
    """Of a metal without a tint."""
    return f0 + (1 - f0) * (1 - cosine) ** 5


def conductor_reflectance(cosine: float, ior: float, extinction: float) -> float:
    """Unpolarised reflectance of a metal, as Cycles has it: exact where both numbers squared are
    much above 1.
    """
    size, twice = ior * ior + extinction * extinction, 2 * ior * cosine
    along = size * cosine * cosine
    parallel = (along - twice + 1) / (along + twice + 1)
    across = (size - twice + cosine * cosine) / (size + twice + cosine * cosine)
    return 0.5 * (parallel + across)
