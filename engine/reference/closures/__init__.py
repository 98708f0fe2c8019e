"""What each kind of lobe gives back, a module a kind: evaluate, sample, pdf and albedo, where the
kind has them.
"""

from __future__ import annotations

import numpy as np

from . import fibre, microfacet, oren_nayar, sheen, toon
from .term import Term, taken

__all__ = ["Term", "albedo", "evaluate", "taken"]

Array = np.ndarray

_OF = {
    "SPECULAR": microfacet,
    "SHEEN": sheen,
    "TOON_DIFFUSE": toon,
    "TOON_SPECULAR": toon,
    "OREN_NAYAR": oren_nayar,
    "OREN_NAYAR_MULTIPLE": oren_nayar,
    "FIBRE_DIFFUSE": fibre,
    "FIBRE_SPECULAR": fibre,
    "FIBRE_TRANSMISSION": fibre,
}


def evaluate(term: Term, chosen: Array | slice, n: Array, v: Array, l: Array) -> Array:  # noqa: E741
    """(m,) what a lobe gives back of light along l, times pi, for k = 1, at the places `chosen`
    (m,) of the term's points. n: (3, m) theirs, where it has none of its own. v, l: (3, m) unit.
    """
    return _OF[term.lobe.kind].evaluate(term, chosen, n, v, l)


def albedo(term: Term) -> Array | float:
    """(m,) or one number: about what of k counts as the colour of the surface."""
    of = _OF.get(term.lobe.kind)
    return of.albedo(term) if of in (microfacet, oren_nayar) else 1.0
