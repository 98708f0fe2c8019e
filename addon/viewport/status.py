"""The line of text in the corner of a 3D view."""

from __future__ import annotations

import numpy as np

from ... import engine
from ...engine.film import FIRST_ESTIMATE

PYTHON = "Python tracer"
"""Said while the slow one draws."""
_SHARE = 0.99
"""Of the pixels, whose estimated error the text states."""


def error_of(film: engine.Film) -> float | None:
    """8-bit levels below which the estimated error of 99 of 100 pixels lies; None where it was not
    estimated.
    """
    if "Error" not in film.passes or film.samples < FIRST_ESTIMATE:
        return None
    levels = film.passes["Error"].reshape(-1)
    return float(
        np.partition(levels, int(_SHARE * (levels.size - 1)))[int(_SHARE * (levels.size - 1))]
    )


def error_text(error: float) -> str:
    """Of 8-bit levels."""
    return (
        "under 0.01" if error < 0.01 else f"{error:.2g}" if error < 100 else f"{error:.0f}"
    ) + "/255"


def error_clause(error: float | None) -> str:
    """What follows in a sentence, where the error is known."""
    return "" if error is None else f", error {error_text(error)}"


def warned(count: int) -> str:
    """That there are warnings, and where they stand."""
    return (
        ""
        if count == 0
        else f", {count} warning{'s' if count > 1 else ''}: Render Properties, Statistics"
    )


def progress(wave: engine.Wave | None, most: int, busy: bool, error: float | None) -> str:
    """How far a picture of `most` samples is, and how wrong."""
    if wave is None:
        return "Glint: reading the scene"
    if busy:
        return f"Glint: {wave.film.samples} of {most} samples{error_clause(error)}"
    count = "1 sample" if wave.film.samples == 1 else f"{wave.film.samples} samples"
    return f"Glint: {count}{error_clause(error)}, {wave.seconds:.2f} s"
