"""Every operation of programs, with each of its settings: the core against the reference."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from glint.engine.program.table import OPERATIONS
from native_tools import needs_core
from program_tools import arguments_of, by_core, by_reference, settings_of, untied

PURE = [operation for operation in OPERATIONS if not operation.reads_point]
CASES = [
    pytest.param(operation, settings, id=f"{operation.name}-{number}")
    for operation in PURE
    for number, settings in enumerate(settings_of(operation))
]
COUNT = 203
"""No multiple of any number of lanes, nor of a block."""


@needs_core
@pytest.mark.parametrize(("operation", "settings"), CASES)
def test_core_is_reference(operation, settings):
    arguments = arguments_of(operation, np.random.default_rng(7), COUNT)
    arguments = untied(operation, arguments, settings)
    expected = by_reference(operation, arguments, settings)
    for found, wanted in zip(by_core(operation, arguments, settings), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12, equal_nan=True)


def test_the_cores_list_is_that_of_the_table():
    root = Path(__file__).parents[2]
    sys.path.insert(0, str(root / "packaging"))
    try:
        from operations_header import TARGET, header
    finally:
        sys.path.pop(0)
    assert TARGET.read_text() == header(OPERATIONS), "run python packaging/operations_header.py"
