"""LDR-FLIP: how different two pictures look when one flips between them (Andersson, Nilsson,
Akenine-Möller, Oskarsson, Åström, Fairchild: "FLIP: A Difference Evaluator for Alternating Images",
HPG 2020). Section and equation numbers are that paper's.
"""

from __future__ import annotations

import numpy as np

from ..raster import srgb_from_linear

Array = np.ndarray

PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * np.pi / 180
"""The paper's viewer: 0.7 m from a screen 0.7 m and 3840 pixels wide."""

_XYZ_FROM_LINEAR = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
"""sRGB's primaries and D65 white as exact ratios; the rows sum to the white point."""
_WHITE = _XYZ_FROM_LINEAR.sum(1)
_CONTRAST = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
"""(a, b) of the Gaussians that filter luminance, red-green and blue-yellow (table 1)."""
_Q_COLOR, _Q_FEATURE, _KNEE, _KNEE_VALUE, _FEATURE_WIDTH = 0.7, 0.5, 0.4, 0.95, 0.082


def displayed(picture: Array) -> Array:
    """(h, w, >= 3) linear -> (h, w, 3) float64 in 0 to 1: the sRGB curve over clipped colour; what
    is not finite counts as its limit.
    """
    colors = np.nan_to_num(np.asarray(picture, np.float64)[..., :3], nan=0.0)
    return srgb_from_linear(np.clip(colors, 0.0, 1.0))


def flip(picture: Array, reference: Array, pixels_per_degree: float = PIXELS_PER_DEGREE) -> Array:
    """(h, w, >= 3) linear each -> (h, w) float64 in 0 to 1, 0 where no difference is seen. Raises
    ValueError for different shapes.

    Colours are clipped to what a screen shows (LDR-FLIP, no exposure, no view transform); edges
    repeat outwards.
    """
    if np.shape(picture) != np.shape(reference):
        raise ValueError(
            f"the picture is {np.shape(picture)} and the reference {np.shape(reference)}: compare "
            "equal shapes"
        )
    true, seen = (_opponent_from_linear(_clipped(image)) for image in (reference, picture))
    color = _color_difference(true, seen, pixels_per_degree)
    feature = _feature_difference(true, seen, pixels_per_degree)
    return color ** (1 - feature)


def _clipped(image: Array) -> Array:
    return np.clip(np.nan_to_num(np.asarray(image, np.float64)[..., :3], nan=0.0), 0.0, 1.0)


def _opponent_from_linear(linear: Array) -> Array:
    """Linear RGB to YCxCz (section 4.1)."""
    x, y, z = np.moveaxis(linear @ _XYZ_FROM_LINEAR.T / _WHITE, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], -1)


def _linear_from_opponent(opponent: Array) -> Array:
    y = (opponent[..., 0] + 16) / 116
    xyz = np.stack([y + opponent[..., 1] / 500, y, y - opponent[..., 2] / 200], -1) * _WHITE
    return xyz @ np.linalg.inv(_XYZ_FROM_LINEAR).T


def _hunt_from_linear(linear: Array) -> Array:
    """Linear RGB to CIELAB whose colourfulness grows with lightness (Hunt's effect, equation 4)."""
    ratio = linear @ _XYZ_FROM_LINEAR.T / _WHITE
    edge = 6 / 29
    x, y, z = np.moveaxis(
        np.where(ratio > edge**3, np.cbrt(ratio), ratio / (3 * edge**2) + 4 / 29), -1, 0
    )
    lightness = 116 * y - 16
    return np.stack(
        [lightness, 0.01 * lightness * 500 * (x - y), 0.01 * lightness * 200 * (y - z)], -1
    )


# --- colour (section 4.1)


def _color_difference(reference: Array, picture: Array, pixels_per_degree: float) -> Array:
    """(h, w) in 0 to 1: HyAB distance of the filtered pictures, small ones spread over most of the
    range (equation 6).
    """
    seen = [
        _hunt_from_linear(_clipped(_linear_from_opponent(_as_eye(image, pixels_per_degree))))
        for image in (reference, picture)
    ]
    distance = _hyab(*seen) ** _Q_COLOR
    green, blue = _hunt_from_linear(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    largest = _hyab(green, blue) ** _Q_COLOR
    knee = _KNEE * largest
    above = _KNEE_VALUE + (distance - knee) / (largest - knee) * (1 - _KNEE_VALUE)
    return np.clip(np.where(distance < knee, _KNEE_VALUE / knee * distance, above), 0.0, 1.0)


def _hyab(a: Array, b: Array) -> Array:
    """City block in lightness, Euclid in chroma (equation 5)."""
    difference = a - b
    return np.abs(difference[..., 0]) + np.hypot(difference[..., 1], difference[..., 2])


def _as_eye(opponent: Array, pixels_per_degree: float) -> Array:
    """The opponent channels after the eye's contrast sensitivity (equations 2, 3)."""
    widest = max(b for gaussians in _CONTRAST for _, b in gaussians)
    radius = int(np.ceil(3 * np.sqrt(widest / (2 * np.pi**2)) * pixels_per_degree))
    squares = (np.arange(-radius, radius + 1) / pixels_per_degree) ** 2
    channels = []
    for channel, gaussians in zip(np.moveaxis(opponent, -1, 0), _CONTRAST, strict=True):
        rows = [(a * np.sqrt(np.pi / b), np.exp(-(np.pi**2) * squares / b)) for a, b in gaussians]
        total = sum(weight * row.sum() ** 2 for weight, row in rows)
        channels.append(sum(weight / total * _convolved(channel, row, row) for weight, row in rows))
    return np.stack(channels, -1)


# --- features (section 4.2)


def _feature_difference(reference: Array, picture: Array, pixels_per_degree: float) -> Array:
    """(h, w) in 0 to 1: the larger difference of edge and point strength in luminance
    (equation 8).
    """
    luminances = [(image[..., 0] + 16) / 116 for image in (reference, picture)]
    kernels = _feature_kernels(pixels_per_degree)
    differences = []
    for across in kernels[1:]:
        strengths = [
            np.hypot(_convolved(y, across, kernels[0]), _convolved(y, kernels[0], across))
            for y in luminances
        ]
        differences.append(np.abs(strengths[0] - strengths[1]))
    return np.clip(np.maximum(*differences) / np.sqrt(2), 0.0, 1.0) ** _Q_FEATURE


def _feature_kernels(pixels_per_degree: float) -> tuple[Array, Array, Array]:
    """One-dimensional kernels: a Gaussian of sum 1, its first and second derivative, whose weights
    of each sign sum to ±1.
    """
    deviation = 0.5 * _FEATURE_WIDTH * pixels_per_degree
    radius = int(np.ceil(3 * deviation))
    x = np.arange(-radius, radius + 1, dtype=np.float64)
    gaussian = np.exp(-(x**2) / (2 * deviation**2))
    return (
        gaussian / gaussian.sum(),
        _balanced(-x * gaussian),
        _balanced((x**2 / deviation**2 - 1) * gaussian),
    )


def _balanced(kernel: Array) -> Array:
    return np.where(
        kernel > 0, kernel / kernel[kernel > 0].sum(), kernel / -kernel[kernel < 0].sum()
    )


def _convolved(image: Array, across: Array, down: Array) -> Array:
    """(h, w) correlated with down[:, None] * across[None, :]; edges repeat."""
    return _along(_along(image, across, 1), down, 0)


def _along(image: Array, kernel: Array, axis: int) -> Array:
    radius = len(kernel) // 2
    padded = np.pad(image, [(radius, radius) if a == axis else (0, 0) for a in (0, 1)], mode="edge")
    return np.lib.stride_tricks.sliding_window_view(padded, len(kernel), axis) @ kernel
