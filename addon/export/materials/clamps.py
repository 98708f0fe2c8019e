"""What varies over a surface, kept within bounds: as a factor with bounds where a sum comes to one,
untouched where it cannot leave them.

Bounds are worked out after images are filtered and attributes are interpolated, as in Blender.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from ....engine.scene import Input
from ..images.images import Images
from .terms import RGB, Sum, Term, constant, constant_value, is_constant, times

_UNKNOWN = 1e30
"""Stands for the unknown bounds of attributes: finite, so that nothing times it is nothing."""
_MOST_READS = 6
"""Different images and attributes in a sum whose bounds are worked out."""
_WHITE: RGB = (1.0, 1.0, 1.0)


def clamped(terms: Sum, low: float, high: float, images: Images) -> Sum | None:
    """The sum with each channel kept between low and high; None where no factors can say it."""
    if is_constant(terms):
        return constant(tuple(min(max(x, low), high) for x in constant_value(terms)))
    if _within(terms, low, high, images):
        return terms
    by_factor = _factor_by_factor(terms, images) if (low, high) == (0.0, np.inf) else None
    return by_factor or _as_one_input(terms, low, high)


def _within(terms: Sum, low: float, high: float, images: Images) -> bool:
    """Whether no channel of the sum can leave the bounds by more than rounding."""
    found = _bounds(terms, images)
    return found is not None and found[0] >= low - 1e-6 and found[1] <= high + 1e-6


def _bounds(terms: Sum, images: Images) -> tuple[float, float] | None:
    """Bounds of all channels of a sum; None with too many reads.

    A sum of products is linear in each thing that it reads: its extremes lie where all of them are
    at theirs. What is read twice in one product counts as two things, which widens the bounds.
    """
    numbers: dict[tuple, int] = {}
    ranges, rows = [], []
    for term in terms:
        seen: dict[Input, int] = {}
        row = []
        for factor in term.factors:
            read, slope, offset = _affine(factor)
            seen[read] = seen.get(read, -1) + 1
            key = (read, seen[read])
            if key not in numbers:
                numbers[key] = len(ranges)
                ranges.append(_range(read, images))
            row.append((numbers[key], np.array(slope), np.array(offset)))
        rows.append((np.array(term.value), row))
    if len(ranges) > _MOST_READS:
        return None
    sums = [
        sum(_at_corner(value, row, corner) for value, row in rows) for corner in product(*ranges)
    ]
    return float(np.min(sums)), float(np.max(sums))


def _at_corner(value: np.ndarray, row: list, corner: tuple[float, ...]) -> np.ndarray:
    for number, slope, offset in row:
        value = value * (slope * corner[number] + offset)
    return value


def _range(read: Input, images: Images) -> tuple[float, float]:
    """Between what a factor as `_affine` gives it can lie."""
    low, high = (-_UNKNOWN, _UNKNOWN) if read.attribute else images.range(read)
    if read.is_plain:
        return low, high
    ends = [
        value * x + offset
        for value, offset in zip(read.value, read.offset, strict=True)
        for x in (low, high)
    ]
    return max(read.low, min(ends), -_UNKNOWN), min(read.high, max(ends), _UNKNOWN)


def _affine(factor: Input) -> tuple[Input, RGB, RGB]:
    """A factor as slope × another + offset, where the other has no complement, nor, if it has no
    bounds, a value.
    """
    read, slope, offset = replace(factor, complement=False), _WHITE, (0.0, 0.0, 0.0)
    if factor.is_plain:
        read, slope = replace(read, value=_WHITE), factor.value
    return (read, times(slope, (-1.0,) * 3), _WHITE) if factor.complement else (read, slope, offset)


def _as_one_input(terms: Sum, low: float, high: float) -> Sum | None:
    """The clamped sum as one factor with bounds, where it is slope × one product of reads +
    offset.
    """
    read, slope, offset = None, np.zeros(3), np.zeros(3)
    for term in terms:
        if not term.factors:
            offset = offset + term.value
            continue
        found = _affine_product(term.factors)
        if found is None or read not in (None, found[0]):
            return None
        read, slope, offset = (
            found[0],
            slope + np.multiply(term.value, found[1]),
            offset + np.multiply(term.value, found[2]),
        )
    if read.is_plain:
        return _one(replace(read, value=_rgb(slope), offset=_rgb(offset), low=low, high=high))
    if np.ptp(slope) or np.ptp(offset):
        return None
    ends = sorted(min(max(slope[0] * x + offset[0], low), high) for x in (read.low, read.high))
    outer = np.array(read.offset) * slope + offset
    return _one(
        replace(
            read,
            value=_rgb(np.multiply(read.value, slope)),
            offset=_rgb(outer),
            low=float(ends[0]),
            high=float(ends[1]),
        )
    )


def _affine_product(factors: tuple[Input, ...]) -> tuple[Input, RGB, RGB] | None:
    """`_affine` of a product: one factor, or an image and an attribute without complements."""
    if len(factors) == 1:
        return _affine(factors[0])
    whole = [factor for factor in factors if factor.is_plain and not factor.complement]
    image = next((factor for factor in whole if factor.texture >= 0 and not factor.attribute), None)
    attribute = next((factor for factor in whole if factor.texture < 0 and factor.attribute), None)
    if len(factors) != 2 or image is None or attribute is None:
        return None
    both = replace(
        image,
        value=_WHITE,
        attribute=attribute.attribute,
        attribute_channel=attribute.attribute_channel,
    )
    return both, times(image.value, attribute.value), (0.0, 0.0, 0.0)


def _factor_by_factor(terms: Sum, images: Images) -> Sum | None:
    """A product kept above 0 by its factors, where but one may be below: max(0, a b) = a max(0, b)
    for a ≥ 0.
    """
    if len(terms) != 1 or min(terms[0].value) < 0:
        return None
    value, factors = terms[0].value, list(terms[0].factors)
    loose = [
        k for k, factor in enumerate(factors) if not _within(_one(factor), 0.0, np.inf, images)
    ]
    kept = _as_one_input(_one(factors[loose[0]]), 0.0, np.inf) if len(loose) == 1 else None
    if kept is None:
        return None
    factors[loose[0]] = kept[0].factors[0]
    return (Term(value, tuple(sorted(factors, key=repr))),)


def _one(factor: Input) -> Sum:
    return (Term(_WHITE, (factor,)),)


def _rgb(values: np.ndarray) -> RGB:
    return tuple(float(x) for x in values)
