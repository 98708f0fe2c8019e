"""SHEEN lobes: cosine lobes that are stretched and lean (semantics/lobes.md)."""

from __future__ import annotations

import numpy as np

from ...linear.columns import dot
from .term import Term

Array = np.ndarray


def evaluate(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) at the places `chosen` (m,) of the term's points."""
    return np.where(dot(n, l) > 0, sheen(n, v, l, **term.numbers_at(chosen)), 0.0)


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
