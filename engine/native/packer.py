"""Arrays and rows on their way into the core's structures."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from ..errors import SceneError
from ..program.program import Program


@dataclass
class Packed:
    """A structure for the core with everything that it points at."""

    data: Any
    lent: list = field(default_factory=list)


@dataclass(frozen=True)
class Part:
    """Tables made from values of a scene, the `source`, and the arrays that they point at."""

    source: Any
    tables: dict[str, np.ndarray]
    lent: list


@dataclass
class Packer:
    """Arrays and tables on their way into one structure."""

    lent: list[np.ndarray] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)
    attributes: list[tuple] = field(default_factory=list)
    inputs: list[tuple] = field(default_factory=list)
    lobes: list[tuple] = field(default_factory=list)
    programs: list[tuple] = field(default_factory=list)
    words: list[int] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    tables: list[float] = field(default_factory=list)
    packed: dict[Program, int] = field(default_factory=dict)
    media: list[tuple] = field(default_factory=list)

    def lend(
        self, values: Any, dtype: type, shape: tuple[int | None, ...], what: str
    ) -> np.ndarray:
        """`values` as a C-contiguous array of that dtype and shape (None: any size), itself where
        possible.
        """
        array: np.ndarray = np.ascontiguousarray(values, dtype)
        if array.ndim != len(shape) or any(
            want not in (None, have) for want, have in zip(shape, array.shape, strict=True)
        ):
            wanted = ", ".join("any" if size is None else str(size) for size in shape)
            raise SceneError(f"{what} has the shape {array.shape}: ({wanted}) is needed")
        self.lent.append(array)
        return array

    def optional(self, values: Any, dtype: type, shape: tuple[int | None, ...], what: str) -> int:
        """The address of an array, 0 for None."""
        return 0 if values is None else address(self.lend(values, dtype, shape, what))

    def name(self, text: str) -> int:
        return self.names.setdefault(text, len(self.names))


def address(array: np.ndarray) -> int:
    """Where the first element lies; 0 for an empty array."""
    return array.__array_interface__["data"][0] if array.size else 0


def number(value: str, names: type[IntEnum], what: str) -> int:
    """The number of the constant called `value`. Raises SceneError where there is none."""
    if value not in names.__members__:
        raise SceneError(f"{what} {value!r} is not one of {', '.join(names.__members__)}")
    return names.__members__[value].value


def table_of(structure: type, rows: Sequence[tuple]) -> np.ndarray:
    """Rows as an array of the core's structure."""
    return np.array(rows, _dtype_of(structure)) if rows else np.empty(0, _dtype_of(structure))


@functools.cache
def _dtype_of(structure: type) -> np.dtype:
    """Of the core's structure."""
    return np.dtype(structure)
