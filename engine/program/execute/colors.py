"""Operations on colours (3, n), float64, as Cycles defines them (util/color.h, kernel/svm)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..operations_color import BlendType, ColorMode, RangeType

Array = np.ndarray


def rgb_to_bw(color: Array) -> Array:
    """Rec. 709 luminance, as Cycles has it for its default working space."""
    return 0.2126 * color[0] + 0.7152 * color[1] + 0.0722 * color[2]


def mix_vector(factor: Array, a: Array, b: Array) -> Array:
    return (1 - factor) * a + factor * b


mix_number = mix_vector


def _divide(t: Array, a: Array, b: Array) -> Array:
    return np.where(b != 0, (1 - t) * a + t * a / np.where(b != 0, b, 1.0), a)


def _overlay(t: Array, a: Array, b: Array) -> Array:
    low, high = a * (1 - t + 2 * t * b), 1 - (1 - t + 2 * t * (1 - b)) * (1 - a)
    return np.where(a < 0.5, low, high)


def _dodge(t: Array, a: Array, b: Array) -> Array:
    down = 1 - t * b
    lit = np.where(down <= 0, 1.0, np.fmin(a / np.where(down <= 0, 1.0, down), 1.0))
    return np.where(a != 0, lit, 0.0)


def _burn(t: Array, a: Array, b: Array) -> Array:
    down = 1 - t + t * b
    found = 1 - (1 - a) / np.where(down <= 0, 1.0, down)
    return np.where(down <= 0, 0.0, np.fmin(np.fmax(found, 0.0), 1.0))


def _soft(t: Array, a: Array, b: Array) -> Array:
    screen = 1 - (1 - b) * (1 - a)
    return (1 - t) * a + t * ((1 - a) * b * a + a * screen)


def _hue(t: Array, a: Array, b: Array) -> Array:
    other, own = rgb_to_hsv(b), rgb_to_hsv(a)
    turned = hsv_to_rgb(np.stack([other[0], own[1], own[2]]))
    return np.where(other[1] != 0, mix_vector(t, a, turned), a)


def _saturation(t: Array, a: Array, b: Array) -> Array:
    own, other = rgb_to_hsv(a), rgb_to_hsv(b)
    found = hsv_to_rgb(np.stack([own[0], (1 - t) * own[1] + t * other[1], own[2]]))
    return np.where(own[1] != 0, found, a)


def _value(t: Array, a: Array, b: Array) -> Array:
    own, other = rgb_to_hsv(a), rgb_to_hsv(b)
    return hsv_to_rgb(np.stack([own[0], own[1], (1 - t) * own[2] + t * other[2]]))


def _color(t: Array, a: Array, b: Array) -> Array:
    other, own = rgb_to_hsv(b), rgb_to_hsv(a)
    found = hsv_to_rgb(np.stack([other[0], other[1], own[2]]))
    return np.where(other[1] != 0, mix_vector(t, a, found), a)


_BLENDS: dict[BlendType, Callable[[Array, Array, Array], Array]] = {
    BlendType.MIX: mix_vector,
    BlendType.DARKEN: lambda t, a, b: mix_vector(t, a, np.minimum(a, b)),
    BlendType.MULTIPLY: lambda t, a, b: mix_vector(t, a, a * b),
    BlendType.BURN: _burn,
    BlendType.LIGHTEN: lambda t, a, b: mix_vector(t, a, np.maximum(a, b)),
    BlendType.SCREEN: lambda t, a, b: 1 - (1 - t + t * (1 - b)) * (1 - a),
    BlendType.DODGE: _dodge,
    BlendType.ADD: lambda t, a, b: mix_vector(t, a, a + b),
    BlendType.OVERLAY: _overlay,
    BlendType.SOFT_LIGHT: _soft,
    BlendType.LINEAR_LIGHT: lambda t, a, b: a + t * (2 * b - 1),
    BlendType.DIFFERENCE: lambda t, a, b: mix_vector(t, a, np.abs(a - b)),
    BlendType.EXCLUSION: lambda t, a, b: np.maximum(mix_vector(t, a, a + b - 2 * a * b), 0),
    BlendType.SUBTRACT: lambda t, a, b: mix_vector(t, a, a - b),
    BlendType.DIVIDE: _divide,
    BlendType.HUE: _hue,
    BlendType.SATURATION: _saturation,
    BlendType.COLOR: _color,
    BlendType.VALUE: _value,
}


def mix_color(factor: Array, a: Array, b: Array, *, blend_type: int) -> Array:
    return _BLENDS[BlendType(blend_type)](factor, a, b)


def gamma(color: Array, gamma: Array) -> Array:
    positive = color > 0
    power = np.where(positive, np.where(positive, color, 1.0) ** gamma, color)
    return np.where(gamma == 0, 1.0, power)


def bright_contrast(color: Array, bright: Array, contrast: Array) -> Array:
    return np.maximum((1 + contrast) * color + (bright - contrast * 0.5), 0.0)


def invert(factor: Array, color: Array) -> Array:
    return factor * (1 - color) + (1 - factor) * color


def hue_saturation(
    hue: Array, saturation: Array, value: Array, factor: Array, color: Array
) -> Array:
    h, s, v = rgb_to_hsv(color)
    turned = h + hue + 0.5
    held = np.clip(s * saturation, 0.0, 1.0)
    found = hsv_to_rgb(np.stack([turned - np.floor(turned), held, v * value]))
    return np.maximum(factor * found + (1 - factor) * color, 0.0)


def separate_color(color: Array, *, mode: int) -> tuple[Array, ...]:
    return tuple(_APART[ColorMode(mode)](color))


def combine_color(first: Array, second: Array, third: Array, *, mode: int) -> Array:
    return _TOGETHER[ColorMode(mode)](np.stack(np.broadcast_arrays(first, second, third)))


def rgb_to_hsv(color: Array) -> Array:
    """(3, n) hue, saturation and value (Smith 1978)."""
    high, low = color.max(0), color.min(0)
    span = high - low
    s = np.where(high != 0, span / np.where(high != 0, high, 1.0), 0.0)
    h = np.where(s != 0, _sector(color, high, span) / 6, 0.0)
    return np.stack([np.where(h < 0, h + 1, h), s, high])


def _sector(color: Array, high: Array, span: Array) -> Array:
    """Hue in sixths, from -1 to 5."""
    r, g, b = (high - color) / np.where(span != 0, span, 1.0)
    at_red, at_green = color[0] == high, color[1] == high
    return np.where(at_red, b - g, np.where(at_green, 2 + r - b, 4 + g - r))


def hsv_to_rgb(hsv: Array) -> Array:
    h, s, v = hsv
    h = np.where(h == 1, 0.0, h) * 6
    i = np.floor(h)
    f = h - i
    p, q, t = v * (1 - s), v * (1 - s * f), v * (1 - s * (1 - f))
    sectors = [(v, t, p), (q, v, p), (p, v, t), (p, q, v), (t, p, v)]
    found = np.stack([v, p, q])
    for number, sector in enumerate(sectors):
        found = np.where(i == number, np.stack(sector), found)
    return np.where(s != 0, found, v)


def _rgb_to_hsl(color: Array) -> Array:
    high, low = color.max(0), color.min(0)
    span, total = high - low, high + low
    light = np.minimum(1.0, total / 2)
    down = np.where(light > 0.5, 2 - high - low, total)
    grey = span == 0
    s = np.where(grey, 0.0, span / np.where(grey, 1.0, down))
    h = _sector(color, high, span)
    h = np.where((color[0] == high) & (color[1] < color[2]), h + 6, h) / 6
    return np.stack([np.where(grey, 0.0, h), s, light])


def _hsl_to_rgb(hsl: Array) -> Array:
    h, s, light = hsl
    parts = np.stack([np.abs(h * 6 - 3) - 1, 2 - np.abs(h * 6 - 2), 2 - np.abs(h * 6 - 4)])
    chroma = (1 - np.abs(2 * light - 1)) * s
    return (np.clip(parts, 0.0, 1.0) - 0.5) * chroma + light


_APART = {
    ColorMode.RGB: lambda color: color,
    ColorMode.HSV: rgb_to_hsv,
    ColorMode.HSL: _rgb_to_hsl,
}
_TOGETHER = {
    ColorMode.RGB: lambda color: color,
    ColorMode.HSV: hsv_to_rgb,
    ColorMode.HSL: _hsl_to_rgb,
}


def map_range(
    value: Array,
    from_min: Array,
    from_max: Array,
    to_min: Array,
    to_max: Array,
    steps: Array,
    *,
    interpolation: int,
) -> Array:
    span = from_max - from_min
    factor = (value - from_min) / np.where(span != 0, span, 1.0)
    if interpolation == RangeType.STEPPED:
        stepped = np.floor(factor * (steps + 1)) / np.where(steps > 0, steps, 1.0)
        factor = np.where(steps > 0, stepped, 0.0)
    elif interpolation != RangeType.LINEAR:
        t = np.clip(factor, 0.0, 1.0)
        smoother = interpolation == RangeType.SMOOTHERSTEP
        factor = t * t * t * (t * (t * 6 - 15) + 10) if smoother else t * t * (3 - 2 * t)
    return np.where(span != 0, to_min + factor * (to_max - to_min), 0.0)


def ramp(factor: Array, *, interpolates: int, table: Sequence[float]) -> tuple[Array, Array]:
    """Colour (3, n) and alpha (n,)."""
    rows = np.asarray(table, float).reshape(-1, 4).T
    found = _looked_up(rows, np.fmin(np.fmax(factor, 0.0), 1.0), bool(interpolates))
    return found[:3], found[3]


def lookup(factor: Array, *, last: int, table: Sequence[float]) -> tuple[Array, ...]:
    """Four (n,)."""
    rows = np.asarray(table, float).reshape(-1, last + 1).T
    found = _looked_up(rows, np.fmin(np.fmax(factor, 0.0), 1.0), True)
    return tuple(found) + (np.zeros_like(found[0]),) * (3 - last)


def curves(factor: Array, color: Array, *, extends: int, table: Sequence[float]) -> Array:
    low, high, *rest = table
    rows = np.asarray(rest, float).reshape(-1, 3).T
    place = (color - low) / (high - low)
    held = np.fmin(np.fmax(place, 0.0), 1.0)
    found = np.stack([_looked_up(rows[k : k + 1], held[k], True)[0] for k in range(3)])
    if extends:
        size = rows.shape[1] - 1
        before = (rows[:, 1] - rows[:, 0])[:, None] * size
        after = (rows[:, -1] - rows[:, -2])[:, None] * size
        found = found + np.where(place < 0, before * place, 0.0)
        found = found + np.where(place > 1, after * (place - 1), 0.0)
    return (1 - factor) * color + factor * found


def piecewise(x: Array, *, table: Sequence[float]) -> Array:
    rows = np.asarray(table, float).reshape(-1, 16)
    row = rows[(x[:, None] >= rows[1:, 0]).sum(1)][:, 1:].reshape(-1, 3, 5)
    a, b, c, d, e = row.transpose(2, 1, 0)
    over = np.where(x != 0, 1 / np.where(x != 0, x, 1.0), 0.0)
    return a * over + (((e * x + d) * x + c) * x + b)


def _looked_up(rows: Array, place: Array, interpolates: bool) -> Array:
    """Columns of rows (c, k) at places from 0 to 1; NaN counts as 0."""
    last = rows.shape[1] - 1
    at = np.where(np.isfinite(place), place, 0.0) * last
    first = np.floor(at).astype(np.intp)
    if not interpolates:
        return rows[:, first]
    t = at - first
    return (1 - t) * rows[:, first] + t * rows[:, np.minimum(first + 1, last)]
