"""Node programs over given points, without a picture."""

from __future__ import annotations

from collections.abc import Iterator
from ctypes import POINTER, c_double
from itertools import groupby

import numpy as np

from ..program.execute.run import Points, step
from ..program.operations import Reference
from ..program.program import Instruction, Program, instructions
from ..program.table import CODES
from . import binding

Array = np.ndarray


def run(program: Program, points: Points, count: int) -> list[Array]:
    """The program's outputs at `count` points, each (3, count), as `program.execute.run.run` gives
    them: what reads the points by NumPy, where that adds, multiplies, divides and takes roots
    alone, all else by the core, so that the bits are the same on every machine.
    """
    columns = np.zeros((program.slots + 2, count))
    constants, tables = np.array(program.constants or (0.0,)), _tables(program)
    for reads_point, stretch in groupby(instructions(program), _reads_point):
        if reads_point:
            for instruction in stretch:
                step(columns, instruction, program, points)
            continue
        code = np.array([word for one in stretch for word in _words(one, program)], np.int32)
        failed = binding.library().glint_program_run(
            code.ctypes.data, len(code), constants.ctypes.data, len(program.constants),
            tables.ctypes.data, len(columns), columns.ctypes.data, count,
        )  # fmt: skip
        if failed:
            raise MemoryError("a program over the vertices of a mesh does not fit into memory")
    return [columns[slot : slot + 3] for slot in program.outputs]


def power(base: Array, exponent: float) -> Array:
    """base (...) to a power, by the core."""
    x = np.ascontiguousarray(base, np.float64)
    y, out = np.full_like(x, exponent), np.empty_like(x)
    pointers = (a.ctypes.data_as(POINTER(c_double)) for a in (x, y, out))
    binding.library().glint_function(b"pow", *pointers, x.size)
    return out


def _reads_point(instruction: Instruction) -> bool:
    return instruction.operation.reads_point


def _words(instruction: Instruction, program: Program) -> Iterator[int]:
    """The instruction with the places of its tables in `_tables`."""
    operation = instruction.operation
    yield from (CODES[operation.name], *instruction.outputs, *instruction.arguments)
    for (_, choices), setting in zip(operation.settings, instruction.settings, strict=True):
        is_table = choices is Reference.TABLE
        yield sum(1 + len(t) for t in program.tables[:setting]) if is_table else setting


def _tables(program: Program) -> Array:
    """Each table after how many numbers it has."""
    return np.array([x for table in program.tables for x in (len(table), *table)] or [0.0])
