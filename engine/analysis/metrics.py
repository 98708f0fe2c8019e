"""Error measures between a picture and a reference, both arrays of one shape. A non-finite value in
either is an infinite error.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

_DARK = 1e-3
"""Values below this share of the reference's median size are not judged relative to themselves."""


def absolute_error(picture: Array, reference: Array) -> Array:
    """|picture - reference| by value, float64; infinite where either is not finite. Raises
    ValueError for different shapes.
    """
    picture, reference = np.asarray(picture, np.float64), np.asarray(reference, np.float64)
    if picture.shape != reference.shape:
        raise ValueError(
            f"the picture is {picture.shape} and the reference {reference.shape}: compare equal "
            "shapes"
        )
    finite = np.isfinite(picture) & np.isfinite(reference)
    return np.where(
        finite, np.abs(np.where(finite, picture, 0.0) - np.where(finite, reference, 0.0)), np.inf
    )


def relative_error(picture: Array, reference: Array, floor: float | None = None) -> Array:
    """|picture - reference| / max(|reference|, floor) by value; 0 where both are equal.

    floor: the size below which a value counts as dark. None takes a thousandth of the median of the
    reference's finite non-zero sizes, so the measure does not change when both pictures are scaled.
    0 is strictly relative: a difference from 0 is then infinite.
    """
    error = absolute_error(picture, reference)
    size = np.abs(np.where(np.isfinite(reference), reference, 0.0)).astype(np.float64)
    size = np.maximum(size, _floor_of(size) if floor is None else floor)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(error == 0, 0.0, error / size)


def _floor_of(size: Array) -> float:
    lit = size[size > 0]
    return _DARK * float(np.median(lit)) if lit.size else 0.0


def rmse(picture: Array, reference: Array) -> float:
    """Root of the mean squared difference; 0 for empty pictures."""
    return root_mean_square(absolute_error(picture, reference))


def relative_rmse(picture: Array, reference: Array) -> float:
    """RMSE over the root mean square of the reference: |picture - reference| / |reference| as
    vectors. 0 / 0 is 0.
    """
    error = rmse(picture, reference)
    if error == 0.0 or not np.isfinite(error):
        return error
    size = root_mean_square(np.asarray(reference, np.float64))
    return error / size if size > 0 else float("inf")


def root_mean_square(values: Array, weights: Array | None = None) -> float:
    """Of an array. weights: (n,) of the rows of (n, c) values, for all alike if left out. Divides
    by the largest value first, so that no square overflows.
    """
    top = float(np.max(np.abs(values), initial=0.0))
    if top == 0.0 or not np.isfinite(top):
        return top
    squares = (values / top) ** 2
    return top * float(
        np.sqrt(
            np.mean(squares) if weights is None else np.average(squares.mean(-1), weights=weights)
        )
    )


def max_absolute_error(picture: Array, reference: Array) -> float:
    """The largest |picture - reference|."""
    return float(np.max(absolute_error(picture, reference), initial=0.0))


def max_relative_error(picture: Array, reference: Array, floor: float | None = None) -> float:
    """The largest `relative_error`."""
    return float(np.max(relative_error(picture, reference, floor), initial=0.0))


def psnr(picture: Array, reference: Array, peak: float = 1.0) -> float:
    """Peak signal-to-noise ratio 20 log10(peak / RMSE) in decibels; infinite for equal pictures,
    -infinite for non-finite ones.
    """
    error = rmse(picture, reference)
    if error == 0.0:
        return float("inf")
    return 20 * float(np.log10(peak / error)) if np.isfinite(error) else float("-inf")


def wrong_pixels(
    picture: Array, reference: Array, threshold: float = 0.01, floor: float | None = None
) -> Array:
    """(h, w, c) each -> (h, w) bool: some channel differs by more than `threshold` of the pixel's
    largest reference channel.

    floor: as for `relative_error`, of those largest channels. So a nearly black channel of a bright
    pixel does not condemn it.
    """
    error = absolute_error(picture, reference)
    brightest = np.max(np.abs(np.where(np.isfinite(reference), reference, 0.0)), -1).astype(
        np.float64
    )
    size = np.maximum(brightest, _floor_of(brightest) if floor is None else floor)
    return np.max(error, -1) > threshold * size


def wrong_fraction(
    picture: Array, reference: Array, threshold: float = 0.01, floor: float | None = None
) -> float:
    """The share of `wrong_pixels`, 0 to 1; 0 for empty pictures."""
    wrong = wrong_pixels(picture, reference, threshold, floor)
    return float(np.mean(wrong)) if wrong.size else 0.0


def weighted_quantile(values: Array, weights: Array, share: float) -> float:
    """The least of some values (n,) that at least this share of all weight (n,) lies at or
    below.
    """
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(reached, share * reached[-1])]])
