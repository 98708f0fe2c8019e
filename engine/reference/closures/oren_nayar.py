"""OREN_NAYAR lobes: what rough matt surfaces give back besides Lambert's share."""

from __future__ import annotations

import numpy as np

from ...linear.columns import dot
from .term import Term

Array = np.ndarray

NEVER_LOST = 0.5 - 2 / (3 * np.pi)
"""What A leaves of 1, over B: as much at normal incidence is lost to facets."""


def evaluate(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) at the places `chosen` (m,) of the term's points."""
    nl = dot(n, l)
    if term.lobe.kind == "OREN_NAYAR":
        return np.where(nl > 0, oren_nayar(n, v, l), 0.0)
    return np.where(nl > 0, nl * lost_once(nl) * lost_once(dot(n, v)), 0.0)


def albedo(term: Term) -> float:
    """What of k counts as the colour of a surface: with its DIFFUSE lobe it is that of a smooth
    one.
    """
    return NEVER_LOST if term.lobe.kind == "OREN_NAYAR" else 0.0


def oren_nayar(n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) what a rough matt surface gives back besides Lambert's share, for a k of B, times pi:
    more where light comes from the viewer's side. For points with n·l > 0 (Fujii, A tiny
    improvement of Oren-Nayar reflectance model).
    """
    nl, nv = np.maximum(dot(n, l), 0.0), np.maximum(dot(n, v), 0.0)
    s = dot(l, v) - nl * nv
    most = np.maximum(nl, nv)
    return nl * np.where(s > 0, s / np.where(most > 0, most, 1.0), s)


def lost_once(cosine: Array) -> Array:
    """(m,) what of light, or of even light to a view, at an angle of that cosine a rough matt
    surface does not give back at once, over B: its facets meet it again.
    """
    c = np.clip(cosine, 0.0, 1.0)
    s = np.sqrt(1 - c * c)
    given = s * (np.arccos(c) - 2 / 3 - s * c) + 2 / 3 * s * c * (1 + s + s * s) / (1 + s)
    return NEVER_LOST - given / np.pi
