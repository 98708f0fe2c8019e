"""Operations on arrays of NumPy, in float64: one function each, by its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..operations import Operation
from ..operations_color import COLORS
from ..operations_input import INPUTS
from ..operations_math import MATH
from ..operations_noise import NOISES
from ..operations_pattern import PATTERNS
from ..operations_rays import RAYS
from ..operations_vector import VECTORS
from ..operations_voronoi import VORONOIS
from . import arithmetic, colors, inputs, noise, patterns, rays, vectors, voronoi

Array = NDArray[np.float64]

_FAMILIES: tuple[tuple[tuple[Operation, ...], ModuleType], ...] = (
    (INPUTS, inputs),
    (MATH, arithmetic),
    (VECTORS, vectors),
    (COLORS, colors),
    (PATTERNS, patterns),
    (NOISES, noise),
    (VORONOIS, voronoi),
    (RAYS, rays),
)


def _function(name: str, module: ModuleType) -> Callable:
    """Of its module, or of inputs what the points answer themselves."""
    if module is not inputs or hasattr(module, name):
        return getattr(module, name)
    return lambda points, **settings: getattr(points, name)(**settings)


_FUNCTIONS: Mapping[str, Callable] = {
    operation.name: _function(operation.name, module)
    for family, module in _FAMILIES
    for operation in family
}


def apply(
    operation: Operation, arguments: Sequence[Array], settings: Mapping[str, Any]
) -> tuple[Array, ...]:
    """One array per output: (n,) of a NUMBER, (3, n) of a VECTOR; arguments likewise.

    settings: references as what they refer to. An operation that reads the shaded point takes it
    as its first argument.
    """
    with np.errstate(all="ignore"):
        result = _FUNCTIONS[operation.name](*arguments, **settings)
    return result if isinstance(result, tuple) else (result,)
