"""Two pictures side by side: the numbers of their difference, and a strip that shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import metrics, plot
from .flip import displayed, flip

Array = np.ndarray

GAIN = 4
"""A strip shows the difference so many times larger."""
_BACKGROUND, _WHITE, _LINE = (0.08, 0.08, 0.08), (0.9, 0.9, 0.9), 16
_VISIBLE = 0.01


@dataclass(frozen=True)
class Difference:
    """rmse, off: of what a screen shows, 0 to 1; off is the share of pixels of which some channel
    is more than 1 % off. relative_rmse: of linear colour.  flip_mean, flip_p99: LDR-FLIP.  mean,
    reference_mean: of linear colour.
    """

    rmse: float
    off: float
    relative_rmse: float
    flip_mean: float
    flip_p99: float
    mean: float
    reference_mean: float


def compare(picture: Array, reference: Array) -> Difference:
    """(h, w, >= 3) linear each. Raises ValueError for different shapes."""
    colors, truth = np.asarray(picture)[..., :3], np.asarray(reference)[..., :3]
    shown, shown_truth = displayed(colors), displayed(truth)
    flips = flip(colors, truth)
    return Difference(
        rmse=metrics.rmse(shown, shown_truth),
        off=float((metrics.absolute_error(shown, shown_truth).max(-1) > _VISIBLE).mean()),
        relative_rmse=metrics.relative_rmse(colors, truth),
        flip_mean=float(flips.mean()),
        flip_p99=float(np.percentile(flips, 99)),
        mean=float(colors.mean()),
        reference_mean=float(truth.mean()),
    )


def difference_picture(a: Array, b: Array) -> Array:
    """(h, w, 3): the difference of what a screen shows, `GAIN` times."""
    return np.clip(GAIN * np.abs(displayed(a) - displayed(b)), 0.0, 1.0)


def draw_strip(
    pictures: Sequence[Array | None],
    lines: Sequence[str],
    size: tuple[int, int],
    color: plot.Color = _WHITE,
    gap: int = 4,
) -> Array:
    """Pictures beside each other under lines of text, (h, w, 3), row 0 on top.

    pictures: of what a screen shows, row 0 at the bottom, no larger than `size` (width, height);
    None leaves the place empty.
    """
    width, height = size
    label = _LINE * len(lines) + 8
    image = plot.canvas(
        len(pictures) * width + (len(pictures) - 1) * gap, height + label, _BACKGROUND
    )
    for column, picture in enumerate(pictures):
        if picture is not None:
            top, left = (
                label + (height - picture.shape[0]) // 2,
                column * (width + gap) + (width - picture.shape[1]) // 2,
            )
            image[top : top + picture.shape[0], left : left + picture.shape[1]] = np.flipud(
                picture[..., :3]
            )
    for number, line in enumerate(lines):
        plot.draw_text(image, line, (6, 8 + _LINE * number), color)
    return image
