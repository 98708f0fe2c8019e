"""Checks of single values: a sentence for each problem, with the value's name and the remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import isfinite
from numbers import Integral, Real
from typing import Any, TypeGuard

import numpy as np

Found = Iterator[str]

_REAL = (float, int, Real)
"""For isinstance, the plain ones first: asking an abstract class takes ten times as long."""


def is_real(value: Any) -> TypeGuard[float]:
    """Whether it is a real number, NumPy's too, finite or not."""
    return isinstance(value, _REAL)


def is_whole(value: Any) -> TypeGuard[int]:
    """Whether it is a whole number, NumPy's too."""
    return isinstance(value, (int, Integral))


def holds(name: str, things: Any, kinds: tuple[type, ...]) -> Found:
    """A tuple or list of nothing but `kinds`."""
    wanted = " or ".join(kind.__name__ for kind in kinds)
    if not isinstance(things, (tuple, list)):
        yield f"{name} is a {type(things).__name__}: use a tuple of {wanted}"
        return
    strange = [thing for thing in things if not isinstance(thing, kinds)]
    if strange:
        yield f"{name} holds a {type(strange[0]).__name__}: use {wanted}"


def array(
    name: str, array: Any, dtypes: type | tuple[type, ...], shape: Sequence[int | None]
) -> Found:
    """The dtype and shape that `array` should have; None in `shape` is any size."""
    dtypes = dtypes if isinstance(dtypes, tuple) else (dtypes,)
    if not isinstance(array, np.ndarray):
        yield f"{name} is a {type(array).__name__}: use a NumPy array"
        return
    if array.dtype.type not in dtypes or not array.dtype.isnative:
        yield f"{name} has dtype {array.dtype}: use {' or '.join(np.dtype(t).name for t in dtypes)}"
    if array.ndim != len(shape) or any(
        want is not None and want != got for want, got in zip(shape, array.shape, strict=True)
    ):
        wanted = ", ".join("any" if size is None else str(size) for size in shape)
        yield f"{name} has shape {array.shape}: use ({wanted})"


def below(name: str, indices: np.ndarray, count: int, rows_of: str) -> Found:
    """Unsigned indices against the number of rows they point into."""
    if indices.size and (top := int(indices.max())) >= count:
        yield f"{name} holds {top} but {rows_of} has {count} rows: keep indices below that"


def finite_array(name: str, array: np.ndarray) -> Found:
    # The extremes carry any NaN or infinity, and take no copy as isfinite would.
    if array.size and not (np.isfinite(array.max()) and np.isfinite(array.min())):
        yield f"{name} has a value that is not finite: replace it by a number"


def finite(name: str, value: Any) -> Found:
    if not (is_real(value) and np.isfinite(value)):
        yield f"{name} is {value!r}: use a finite number"


def at_least(name: str, value: Any, low: float, high: float = np.inf) -> Found:
    """A finite number within [low, high]."""
    if not (is_real(value) and low <= value <= high and value != np.inf):
        span = f"{low:g} or more" if np.isinf(high) else f"{low:g} to {high:g}"
        yield f"{name} is {value!r}: use a finite number, {span}"


def one_of(name: str, value: Any, names: tuple[str, ...]) -> Found:
    if value not in names:
        yield f"{name} is {value!r}: use one of {', '.join(names)}"


def numbers(name: str, values: Any, count: int) -> Found:
    """A tuple (or row) of finite numbers."""
    try:
        sound = len(values) == count and all(is_real(v) and isfinite(v) for v in values)
    except (TypeError, OverflowError):
        sound = False
    if not sound:
        yield f"{name} is {values!r}: use {count} finite numbers"


def handle(name: str, handle: Any, count: int, things: str, none: bool = False) -> Found:
    low = -1 if none else 0
    if not (is_whole(handle) and low <= handle < count):
        remedy = f"use {low} to {count - 1}" if count else f"add one of the {things}"
        yield f"{name} is {handle!r} but the scene has {count} {things}: {remedy}"


def whole(name: str, value: Any) -> Found:
    if not (is_whole(value) and -(2**31) <= value < 2**31):
        yield f"{name} is {value!r}: use a whole number of 32 bits"


def key_values(name: str, keys: Any, dtype: type, shape: tuple[int, ...]) -> Found:
    """Two or more values of one shape while the shutter is open; float64 ones are finite."""
    found = [*array(name, keys, dtype, (None, *shape))]
    if not found and len(keys) < 2:
        found = [f"{name} has {len(keys)} keys: use two or more, or None"]
    if not found and dtype is np.float64:
        found = [*finite_array(name, keys)]
    yield from found


def placement(name: str, matrix: Any, further: Callable[[str, np.ndarray], Found]) -> Found:
    """One (3, 4) float64 matrix: shape, then finiteness, then what else its use asks for."""
    found = [*array(name, matrix, np.float64, (3, 4))]
    found = found or [*finite_array(name, matrix)] or [*further(name, matrix)]
    yield from found
