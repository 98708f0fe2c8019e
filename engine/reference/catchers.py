"""Catchers of shadows: what other things change of the light on a surface that is not seen itself
(semantics/environment.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.surface import Surface
from .coefficients import Coefficients
from .lights import Source
from .stage import Stage

Array = np.ndarray

MOST_RATIO = 1000.0


def lights(
    stage: Stage,
    surface: Surface,
    coefficients: Coefficients,
    weight: Array,
    sample: int,
    on_reach: Callable[[Source, Array, bool], None] = lambda source, seen, is_soft: None,
    on_cut: Callable[[Array], None] = lambda seen: None,
) -> tuple[Array, Array]:
    """(3, n) each: the light that catchers have straight from lights, times weight, and that which
    they had if there were nothing else; arguments as of `Lighting.direct`.
    """
    glow = stage.even_light(surface, coefficients) + coefficients.emission
    with_all, alone = (
        weight * (glow + light.diffuse + light.specular + light.shadow)
        for light in (
            lighting.direct(surface, coefficients, weight, sample, on_reach, on_cut)
            for lighting in (stage.lighting, stage.lighting_of_catchers)
        )
    )
    return with_all, alone


def ratio(with_all: Array, alone: Array) -> Array:
    """(3, n) of such light."""
    lit = alone > 0
    with np.errstate(over="ignore"):
        found = np.where(lit, with_all, 1.0) / np.where(lit, alone, 1.0)
    return np.clip(found, 0.0, MOST_RATIO)


def opacity(coefficients: Coefficients) -> Array:
    """(3, n) what does not go straight through."""
    return 1.0 - np.clip(coefficients.transparent, 0.0, 1.0)


def light_left(ratio: Array) -> Array:
    """(n,) what a shadow of such a ratio leaves of what is behind it."""
    return np.clip((ratio[0] + ratio[1] + ratio[2]) / 3, 0.0, 1.0)
