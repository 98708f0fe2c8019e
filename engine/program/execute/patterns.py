"""Checker, gradient, wave, magic and brick textures, as Cycles (kernel/svm/).

Numbers are (n,), vectors and colours (3, n), float64. Settings are integers as in Cycles.
"""

from __future__ import annotations

import numpy as np

from ..operations_pattern import GradientType, WaveDirection, WaveProfile, WaveType
from .gabor import gabor_texture as gabor_texture
from .noise import fbm

# Cycles wraps by 2 π rounded to float32: far out its phase differs from that by 2 π.
MAGIC_PERIOD = float(np.float32(2.0 * np.pi))


def _off_whole_numbers(p: np.ndarray) -> np.ndarray:
    """Moves points a little, so that rounding does not decide about those at whole numbers."""
    return (p + 0.000001) * 0.999999


def checker_texture(vector, color1, color2, scale) -> tuple[np.ndarray, np.ndarray]:
    """Color (3, n) and Factor (n,), 1 where `color1` is."""
    x, y, z = np.mod(np.floor(_off_whole_numbers(vector * scale)), 2.0)
    first = (x == y) == (z != 0.0)
    return np.where(first, color1, color2), first.astype(np.float64)


def gradient_texture(vector, *, gradient_type: int) -> tuple[np.ndarray, np.ndarray]:
    """Color (3, n) and Factor (n,) in [0, 1]."""
    x, y, _ = vector
    kind = GradientType(gradient_type)
    if kind == GradientType.LINEAR:
        factor = x
    elif kind == GradientType.QUADRATIC:
        factor = np.maximum(x, 0.0) ** 2
    elif kind == GradientType.EASING:
        r = np.clip(x, 0.0, 1.0)
        factor = r * r * (3.0 - 2.0 * r)
    elif kind == GradientType.DIAGONAL:
        factor = (x + y) * 0.5
    elif kind == GradientType.RADIAL:
        factor = np.arctan2(y, x) / (2.0 * np.pi) + 0.5
    else:
        # A little less than 1, so that unit vectors give exactly 0.
        factor = np.maximum(0.999999 - np.sqrt((vector * vector).sum(axis=0)), 0.0)
        if kind == GradientType.QUADRATIC_SPHERE:
            factor = factor**2
    factor = np.clip(factor, 0.0, 1.0)
    return np.stack([factor] * 3), factor


def wave_texture(
    vector,
    scale,
    distortion,
    detail,
    detail_scale,
    detail_roughness,
    phase,
    *,
    wave_type: int,
    direction: int,
    profile: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Color (3, n) and Factor (n,) in [0, 1]; `direction` is that of bands or of rings."""
    p = _off_whole_numbers(vector * scale)
    if wave_type == WaveType.BANDS:
        n = p.sum(axis=0) * 10.0 if direction == WaveDirection.ALL else p[direction] * 20.0
    else:
        across = [axis for axis in range(3) if axis != direction]
        n = np.sqrt((p[across] ** 2).sum(axis=0)) * 20.0
    # Beyond what the sockets take, where linked numbers may be, Cycles has one octave and the
    # fraction of the next down to a detail of -1, and divides by 0 from there on.
    detail = np.clip(np.where((detail < 0.0) & (detail > -1.0), detail + 1.0, detail), 0.0, 15.0)
    noise = fbm(p * detail_scale, detail, detail_roughness, 2.0, True)
    n = n + phase + np.where(distortion != 0.0, distortion * (2.0 * noise - 1.0), 0.0)
    if profile == WaveProfile.SIN:
        factor = 0.5 + 0.5 * np.sin(n - 0.5 * np.pi)
    else:
        n = n / (2.0 * np.pi)
        factor = (
            n - np.floor(n) if profile == WaveProfile.SAW else 2.0 * np.abs(n - np.floor(n + 0.5))
        )
    return np.stack([factor] * 3), factor


# What each depth from 2 on replaces: component, function, sign of it, signs of x, y, z.
_MAGIC_STEPS = (
    (0, np.cos, 1, (1, -1, -1)),
    (2, np.sin, 1, (-1, -1, -1)),
    (0, np.cos, -1, (-1, 1, -1)),
    (1, np.sin, -1, (-1, 1, 1)),
    (1, np.cos, -1, (-1, 1, 1)),
    (0, np.cos, 1, (1, 1, 1)),
    (2, np.sin, 1, (1, 1, -1)),
    (0, np.cos, -1, (-1, -1, 1)),
    (1, np.sin, -1, (1, -1, 1)),
)


def magic_texture(vector, scale, distortion, *, depth: int) -> tuple[np.ndarray, np.ndarray]:
    """Color (3, n) and Factor (n,), the mean of its channels; depth 0 to 10."""
    x, y, z = np.fmod(vector * scale, MAGIC_PERIOD)
    p = [np.sin((x + y + z) * 5.0), np.cos((-x + y - z) * 5.0), -np.cos((-x - y + z) * 5.0)]
    if depth > 0:
        p = [c * distortion for c in p]
        for axis, wave, sign, signs in ((1, np.cos, -1, (1, -1, 1)), *_MAGIC_STEPS)[:depth]:
            p[axis] = sign * wave(sum(s * c for s, c in zip(signs, p, strict=True))) * distortion
    twice = np.where(distortion != 0.0, 2.0 * distortion, 1.0)
    color = 0.5 - np.stack(p) / twice
    return color, color.mean(axis=0)


def _finite_or_zero(v: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(v), v, 0.0)


def _brick_noise(row: np.ndarray, brick: np.ndarray) -> np.ndarray:
    """A number in [0, 1] of each brick, from whole numbers modulo 2^32."""
    rows, bricks = ((v - 2.0**32 * np.floor(v / 2.0**32)).astype(np.uint32) for v in (row, brick))
    n = (rows << np.uint32(16)) + (bricks & np.uint32(0xFFFF))
    n = (n + np.uint32(1013)) & np.uint32(0x7FFFFFFF)
    n = (n >> np.uint32(13)) ^ n
    n = (n * (n * n * np.uint32(60493) + np.uint32(19990303)) + np.uint32(1376312589)) & np.uint32(
        0x7FFFFFFF
    )
    return 0.5 * (n.astype(np.float32).astype(np.float64) / 2.0**30)


def brick_texture(
    vector,
    color1,
    color2,
    mortar,
    scale,
    mortar_size,
    mortar_smooth,
    bias,
    brick_width,
    row_height,
    offset,
    squash,
    *,
    offset_frequency: int,
    squash_frequency: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Color (3, n) and Factor (n,), 1 in the mortar; `offset` and `squash` act on some rows."""
    px, py, _ = vector * scale
    # Bricks without width or height are all mortar.
    row = _finite_or_zero(np.floor(py / row_height))
    shift = np.zeros_like(px)
    if offset_frequency and squash_frequency:
        brick_width = brick_width * np.where(np.mod(row, squash_frequency) != 0, 1.0, squash)
        shift = np.where(np.mod(row, offset_frequency) != 0, 0.0, brick_width * offset)
    brick = _finite_or_zero(np.floor((px + shift) / brick_width))
    x, y = px + shift - brick_width * brick, py - row_height * row
    tint = np.clip(_brick_noise(row, brick) + bias, 0.0, 1.0)
    factor = _mortar(
        np.minimum(np.minimum(x, y), np.minimum(brick_width - x, row_height - y)),
        mortar_size,
        mortar_smooth,
    )
    # Full mortar hides the brick whatever its tint: only one product counts then.
    brick_color = np.where(factor != 1.0, (1.0 - tint) * color1 + tint * color2, color1)
    return brick_color * (1.0 - factor) + mortar * factor, factor


def _mortar(to_edge: np.ndarray, size: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    """Share of mortar (n,) by the way to the brick's nearest edge."""
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.clip((1.0 - to_edge / size) / smooth, 0.0, 1.0)
    inside = np.where(smooth == 0.0, 1.0, r * r * (3.0 - 2.0 * r))
    return np.where(to_edge >= size, 0.0, inside)
