"""The line of text in the corner of a 3D view."""

from __future__ import annotations

import numpy as np

from ... import engine

_SHARE = 0.99
"""Of the pixels, whose estimated error the text states."""


def error_of(film: engine.Film) -> float | None:
    """8-bit levels below which the estimated error of 99 of 100 pixels lies; None where it was not estimated."""
    if "Error" not in film.passes or film.samples < 2:
        return None
    levels = film.passes["Error"].reshape(-1)
    return float(np.partition(levels, int(_SHARE * (levels.size - 1)))[int(_SHARE * (levels.size - 1))])


def progress(wave: engine.Wave | None, most: int, busy: bool, error: float | None) -> str:
    """How far a picture of `most` samples is, and how wrong."""
    if wave is None:
        return "Glint: reading the scene"
    wrong = f", error {error:.2g}/255" if error is not None else ""
    if busy:
        return f"Glint: {wave.film.samples} of {most} samples{wrong}"
    count = "1 sample" if wave.film.samples == 1 else f"{wave.film.samples} samples"
    return f"Glint: {count}{wrong}, {wave.seconds:.2f} s"
