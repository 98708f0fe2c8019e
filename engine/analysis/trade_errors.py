"""How far the squares of a picture are from the true ones."""

from __future__ import annotations

import math

import numpy as np

from . import metrics
from .flip import displayed, flip
from .trade_crops import Squares, area

Array = np.ndarray

VISIBLE = 0.999
"""The largest difference on screen that counts is the one that so many of the pixels stay within:
the very largest hangs on single pixels, of which squares of the frame tell nothing.
"""


_MISSED = 3.0
"""How many of the squares picked would be met on average by what all of them miss once in 20."""


def frame_errors(
    pictures: list[Array], truth: list[Array], squares: Squares, size: float
) -> dict[str, float]:
    """The error columns of a row, of the frame that the squares stand for. size: root mean square
    of its colours.
    """
    picture, reference = (
        np.concatenate([crop.reshape(-1, 3) for crop in crops]) for crops in (pictures, truth)
    )
    weights = squares.pixel_weights
    apart, apart_on_screen = (
        metrics.absolute_error(picture, reference),
        np.abs(displayed(picture) - displayed(reference)),
    )
    flips = np.concatenate([flip(*pair).ravel() for pair in zip(pictures, truth, strict=True)])
    error, shown = (
        metrics.root_mean_square(values, weights) for values in (apart, apart_on_screen)
    )
    return {
        "relative_rmse": 0.0 if error == 0 else error / size if size > 0 else math.inf,
        "max_error": float(apart.max()),
        "levels": 255 * metrics.weighted_quantile(apart_on_screen.max(-1), weights, VISIBLE),
        "psnr": -20 * math.log10(shown) if shown > 0 else math.inf,
        "flip_mean": float(np.average(flips, weights=weights)),
        "flip_p99": metrics.weighted_quantile(flips, weights, 0.99),
        "wrong": float(np.average(metrics.wrong_pixels(picture, reference), weights=weights)),
        **uncertainty(apart, squares, error / size if 0 < size < math.inf else 0.0),
    }


def uncertainty(apart: Array, squares: Squares, relative: float) -> dict[str, float]:
    """`Row.spread` and `Row.unseen`, 0 where the squares are the whole frame. apart: (n, 3) errors.
    relative: their root mean square, over the frame's own.

    Squares of which the picks meet three on average are missed by all of them with a chance of
    e⁻³, once in 20 (the rule of three: Hanley and Lippman-Hand 1983).
    """
    ends = np.cumsum([area([crop]) for crop in squares.crops])[:-1]
    sums = np.array([(part**2).sum() for part in np.split(apart, ends)]) * squares.weights
    total = sums.sum()
    if len(sums) == 1 or not 0 < total < math.inf:
        return {"spread": 0.0, "unseen": 0.0}
    unseen = relative * math.sqrt(_MISSED * sums.max() / total)
    return {"spread": _spread(sums, squares), "unseen": unseen}


def _spread(sums: Array, squares: Squares) -> float:
    """Two standard deviations of the root of the sums' mean, as a share of it, from how unlike the
    squares' (n,) are.
    """
    total, count = sums.sum(), len(sums)
    missing = np.maximum(1 - 1 / squares.weights, 0.0)
    variance = count / (count - 1) * (missing * (sums - total / count) ** 2).sum()
    return math.sqrt(variance) / total
