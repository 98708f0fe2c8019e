"""The one table of operations: compilers, both executors, checks, documents and the core's header
are made from it or tested against it.
"""

from __future__ import annotations

from collections.abc import Mapping

from .operations import Operation
from .operations_color import COLORS
from .operations_input import INPUTS
from .operations_math import MATH
from .operations_noise import NOISES
from .operations_pattern import PATTERNS
from .operations_rays import RAYS
from .operations_vector import VECTORS
from .operations_voronoi import VORONOIS

OPERATIONS: tuple[Operation, ...] = (
    *INPUTS,
    *MATH,
    *VECTORS,
    *COLORS,
    *PATTERNS,
    *NOISES,
    *VORONOIS,
    *RAYS,
)
"""An operation's code is its place here."""

CODES: Mapping[str, int] = {operation.name: code for code, operation in enumerate(OPERATIONS)}
BY_NAME: Mapping[str, Operation] = {operation.name: operation for operation in OPERATIONS}
