"""Counts wrong pixels of Glint and of Cycles on one Blender scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import cycles_reference as cycles
from glint_picture import render_glint

OFF = 0.01
"""A pixel is wrong when it is off by more than this share of the truth."""

DARK = 1e-6
"""What counts as black, as a share of the picture's brightest value."""

DIM = 1e-3
"""Pixels darker than this share of the brightest have no relative error of note: their cosine is
all but 0.
"""


@dataclass(frozen=True)
class Row:
    """One line of the table. extreme: its id in the acceptance list.  case: in words.  pixels: how
    many were judged.

    cycles, glint: wrong pixels.  cycles_error, glint_error: largest relative error of a pixel that
    is lit and not wrong.
    """

    extreme: str
    case: str
    pixels: int
    cycles: int
    glint: int
    cycles_error: float
    glint_error: float


def line_of(row: Row) -> str:
    return (
        f"{row.extreme:4s} {row.case:58s} Cycles {row.cycles:6d}   Glint {row.glint:6d}   of "
        f"{row.pixels:6d}"
        f"   largest error of the others {row.cycles_error:8.1e} {row.glint_error:8.1e}"
    )


def measure(
    rows: list,
    extreme: str,
    case: str,
    scene,
    truth: np.ndarray,
    judged: np.ndarray | None = None,
    **options,
) -> Row:
    """Renders `scene` by both engines, compares with `truth` (h, w, 4) where `judged` (h, w), and
    appends a row.

    options: of `render_glint`. Only pixels that the truth or one of the pictures shows as more than
    empty sky count.
    """
    pictures = (
        cycles.render_cycles(scene)["Combined"],
        render_glint(scene, "NATIVE", **options).combined,
    )
    return compare(rows, extreme, case, pictures, truth, judged)


def compare(
    rows: list,
    extreme: str,
    case: str,
    pictures: tuple,
    truth: np.ndarray,
    judged: np.ndarray | None = None,
) -> Row:
    """The row of (Cycles' picture, Glint's picture)."""
    judged = np.ones(truth.shape[:2], bool) if judged is None else judged
    wrong = [wrong_pixels(picture, truth) & judged for picture in pictures]
    errors = [
        largest_error(picture, truth, judged & ~bad)
        for picture, bad in zip(pictures, wrong, strict=True)
    ]
    row = Row(extreme, case, int(judged.sum()), *(int(bad.sum()) for bad in wrong), *errors)
    rows.append(row)
    return row


def wrong_pixels(picture: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(h, w) bool: not finite, hit where the truth misses or the other way round, or a colour that
    is off by more than OFF.
    """
    picture, truth = picture.astype(float), truth.astype(float)
    color, wanted = picture[..., :3], truth[..., :3]
    allowed = OFF * np.abs(wanted) + DARK * np.abs(wanted).max()
    with np.errstate(invalid="ignore"):
        right = (np.abs(color - wanted) <= allowed).all(-1) & (
            np.abs(picture[..., 3] - truth[..., 3]) <= 0.5
        )
    return ~right


def largest_error(picture: np.ndarray, truth: np.ndarray, where: np.ndarray) -> float:
    """Over the lit pixels of `where`: max |picture − truth| / truth."""
    color, wanted = picture[..., :3].astype(float), truth[..., :3].astype(float)
    lit = where[..., None] & (np.abs(wanted) > DIM * np.abs(wanted).max())
    return float(np.max(np.abs(color - wanted)[lit] / np.abs(wanted)[lit], initial=0.0))
