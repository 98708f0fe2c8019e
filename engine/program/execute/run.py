"""Programs over given points, by NumPy, in float64."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..operations import Kind, Reference
from ..program import UNREAD, Instruction, Program, instructions
from .operations import apply

Array = NDArray[np.float64]


class Points(Protocol):
    """n shaded points, as the operations that read them see them."""

    def attribute(self, name: str, shift: int) -> Array:
        """(4, n): channels of an attribute, missing colours 0, missing alpha 1, all 0 where the
        mesh lacks it.
        """

    def uv(self, name: str, shift: int) -> Array:
        """(2, n) of a UV map, the active one for ""."""

    def image(self, texture: int, u: Array, v: Array) -> Array:
        """(4, n) RGBA of a texture of the scene."""

    def position(self, shift: int) -> Array:
        """(3, n); this and what follows as `evaluation.points.SurfacePoints` has them."""


def run(program: Program, points: Points, count: int) -> list[Array]:
    """The program's outputs at `count` points, each (3, count): a number is the first row."""
    columns = np.zeros((program.slots + 2, count))
    for instruction in instructions(program):
        step(columns, instruction, program, points)
    return [columns[slot : slot + 3] for slot in program.outputs]


def step(columns: Array, instruction: Instruction, program: Program, points: Points) -> None:
    """Run one instruction on the program's slots (slots + 2, n)."""
    operation = instruction.operation
    arguments: list[Any] = [points] if operation.reads_point else []
    for place, (_, kind) in zip(instruction.arguments, operation.arguments, strict=True):
        arguments.append(_argument(columns, place, kind, program))
    values = apply(operation, arguments, _meant(instruction, program))
    for slot, value, (_, kind) in zip(instruction.outputs, values, operation.outputs, strict=True):
        if slot != UNREAD:
            columns[slot : slot + kind] = value


def _argument(columns: Array, place: int, kind: Kind, program: Program) -> Array:
    if place < 0:
        constant = np.array(program.constants[~place : ~place + kind])
        value = np.repeat(constant[:, None], columns.shape[1], axis=1)
    else:
        value = columns[place : place + kind]
    return value[0] if kind == Kind.NUMBER else value


def _meant(step: Instruction, program: Program) -> dict[str, Any]:
    """Settings by name, references as what they refer to."""
    given = zip(step.operation.settings, step.settings, strict=True)
    return {
        name: getattr(program, choices.value)[setting]
        if isinstance(choices, Reference)
        else setting
        for (name, choices), setting in given
    }
