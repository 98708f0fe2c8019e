"""Mirrors and refraction (notes, section 4.17). d unit direction of the ray, n unit normal on its
side.
"""

from __future__ import annotations

import numpy as np

from ..linear.columns import dot, unit

Array = np.ndarray


def reflected(d: Array, n: Array) -> Array:
    """d − 2(d·n)n."""
    return unit(d - 2 * dot(d, n) * n)


def refracted(d: Array, n: Array, index: Array) -> tuple[Array, Array]:
    """Snell's direction, and (m,) bool where there is one (no total reflection)."""
    cosine = -dot(d, n)
    sine2 = (1 - cosine * cosine) / (index * index)
    inner = np.sqrt(np.maximum(0.0, 1 - sine2))
    return unit(d / index + (cosine / index - inner) * n), sine2 < 1
