"""TOON lobes: even within an angle, and nothing beyond its smooth edge (semantics/lobes.md)."""

from __future__ import annotations

import numpy as np

from ...linear.columns import dot
from ..terminator import lowered
from .term import Term

Array = np.ndarray


def evaluate(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) at the places `chosen` (m,) of the term's points: round n, or the mirrored ray."""
    nl, nv = dot(n, l), dot(n, v)
    if term.lobe.kind == "TOON_DIFFUSE":
        return np.where(nl > 0, toon(nl, **term.numbers_at(chosen)), 0.0)
    power = toon(2 * nv * nl - dot(v, l), **term.numbers_at(chosen))
    if term.lowering is not None:
        power = power * lowered(term.lowering[chosen], nl)
    return np.where((nl > 0) & (nv > 0), power, 0.0)


def directional_albedo(term: Term) -> Array:
    """(m,) or () what of the light of a uniform world it gives back, for k = 1."""
    return toon_albedo(**term.numbers)


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
