"""What instances say of light that grazes them (semantics/shadows.md).

Letters: x point, g n geometric and shading normal, l direction to the light.
"""

from __future__ import annotations

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import dot, pick

Array = np.ndarray


def start_towards(surface: Surface, seen: Array, direction: Array) -> Array:
    """(3, m) where the shadow rays along these directions (3, m) leave the points `seen` (m,): x
    where light stands high over the surface, the lifted point where it comes from behind the face.
    """
    x, start = pick(surface.x, seen), pick(surface.start, seen)
    n, g, low = pick(surface.n, seen), pick(surface.g, seen), surface.grazing[seen]
    with np.errstate(divide="ignore", invalid="ignore"):
        over_n, over_g = dot(n, direction) / low, dot(g, direction) / low
        share = np.where(over_n < 1, 2 - (over_g + over_n), 1 - over_g)
    return x + np.where(low > 0, np.clip(share, 0.0, 1.0), 0.0) * (start - x)


def lowered(lowering: Array, cosine: Array) -> Array:
    """(m,) what light is times that the surface sees lower: the cosine of so many times its angle
    over its own. lowering: (m,) at least 1.
    """
    angle = lowering * np.arccos(np.clip(cosine, 0.0, 1.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where((cosine > 0) & (angle < np.pi / 2), np.cos(angle) / cosine, 0.0)
    return np.where(lowering > 1, share, 1.0)


def mean_lowered(lowering: Array) -> Array:
    """(m,) its mean over the light of an even sky."""
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = 2 * (lowering * np.sin(np.pi / 2 / lowering) - 1) / (lowering**2 - 1)
    return np.where(lowering > 1, mean, 1.0)


def mean_lowered_gloss(lowering: Array, cosine: Array, masking: Array | float) -> Array:
    """(m,) its mean over the light of an even sky that gloss of GGX's width `masking` shows at the
    cosines (m,) to the viewer: of all of it between two cosines, whose squares have the mean and
    about the spread of those of the lobe.
    """
    square = np.clip(cosine, 0.0, 1.0) ** 2
    a2 = np.square(masking)
    middle = np.clip(square + (0.48 - square) * a2 / (a2 + 0.04), 1e-3, 1 - 1e-3)
    half = np.minimum(0.7 * masking / (masking + 0.15), np.minimum(middle, 1 - middle))
    half = np.maximum(half, 1e-3)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (
            np.minimum(np.arccos(np.sqrt(end)), np.pi / 2 / lowering)
            for end in (middle - half, middle + half)
        )
        wide, narrow = (
            (np.cos(t) * np.cos(lowering * t) + lowering * np.sin(t) * np.sin(lowering * t))
            / (lowering**2 - 1)
            for t in ends
        )
    return np.where(lowering > 1, (wide - narrow) / half, 1.0)
