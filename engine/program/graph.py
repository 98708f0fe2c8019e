"""Expression graphs: what a node tree computes, each distinct expression once.

Guaranteed:

* Equal expressions are one object. Constants are equal where their bits are: -0.0 is not 0.0, and
  a NaN equals itself.
* An operation whose arguments are all constants is run at once by `fold`, so a program never
  computes what is the same for every hit. Operations that read the shaded point never are.
* Arguments exist before what is made of them, so a graph has no cycles, and nothing here recurses.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .execute.operations import apply
from .operations import Operation, Reference, numbers_of

Fold = Callable[[Operation, Sequence[np.ndarray], Mapping[str, Any]], Sequence[np.ndarray]]
"""fold(operation, arguments, settings) gives the outputs' values. Arrays have the shape (1,) for a
number and (3, 1) for a vector, in float64; settings are those of `Graph.meant`."""


@dataclass(frozen=True, eq=False, slots=True)
class Call:
    """An operation on arguments. `order` counts the calls of a graph from 0 as they were made."""

    operation: Operation
    arguments: tuple[Value, ...]
    settings: tuple[int, ...]
    order: int


@dataclass(frozen=True, eq=False, slots=True)
class Value:
    """A number (width 1) or a vector (width 3): output `output` of `call`, or a constant.

    Of `call` and `constant` one is None.
    """

    width: int
    call: Call | None = None
    output: int = 0
    constant: tuple[float, ...] | None = None


class Graph:
    """Expressions over the operations of the table.

    fold: runs an operation on constants; that of the NumPy executor.
    """

    def __init__(self, fold: Fold = apply) -> None:
        self._fold = fold
        self._constants: dict[bytes, Value] = {}
        self._applied: dict[tuple, tuple[Value, ...]] = {}
        self._calls = 0
        self._things: dict[Reference, dict[Any, int]] = {kind: {} for kind in Reference}

    def constant(self, value: float | Iterable[float]) -> Value:
        """A number, or a vector of three."""
        numbers = tuple(value) if hasattr(value, "__iter__") else (value,)
        if len(numbers) not in (1, 3):
            raise ValueError(f"a constant has 1 or 3 numbers, not {len(numbers)}")
        bits = struct.pack("d" if len(numbers) == 1 else "3d", *numbers)
        found = self._constants.get(bits)
        if found is None:
            constant = tuple(map(float, numbers))
            found = self._constants[bits] = Value(len(numbers), constant=constant)
        return found

    def apply(
        self, operation: Operation, /, *arguments: Value, **settings: Any
    ) -> tuple[Value, ...]:
        """The outputs of an operation of the table, one value each.

        Settings that are references are given as what they refer to: an attribute's name, a
        texture's index, a tuple of numbers. ValueError where arguments or settings are not those
        that the table gives the operation.
        """
        chosen = self._checked(operation, arguments, settings)
        key = (operation.name, chosen, *map(id, arguments))
        if key not in self._applied:
            self._applied[key] = self._folded(operation, arguments, chosen) or self._called(
                operation, arguments, chosen
            )
        return self._applied[key]

    def shifted(
        self, value: Value, shift: int, stays: Callable[[str], bool] = lambda attribute: False
    ) -> Value:
        """The same expression read beside the point, as `operations_input.Shift` has it; but
        attributes of which `stays` is true at the point.
        """
        moved: dict[int, tuple[Value, ...]] = {}

        def at(v: Value) -> Value:
            return v if v.call is None else moved[v.call.order][v.output]

        for call in needed([value]):
            names = [name for name, _ in call.operation.settings]
            settings = self.meant(call.operation, call.settings)
            if "shift" in names and not stays(settings.get("attribute", "")):
                settings["shift"] = shift
            moved[call.order] = self.apply(
                call.operation, *(at(argument) for argument in call.arguments), **settings
            )
        return at(value)

    def meant(self, operation: Operation, settings: Sequence[int]) -> dict[str, Any]:
        """Settings by name, references as what they refer to."""
        named = zip(operation.settings, settings, strict=True)
        return {
            name: self.thing(choices, number) if isinstance(choices, Reference) else number
            for (name, choices), number in named
        }

    def thing(self, kind: Reference, number: int) -> Any:
        """The attribute's name, texture's index or table of that number."""
        return list(self._things[kind])[number]

    def _folded(
        self, operation: Operation, arguments: tuple[Value, ...], settings: tuple[int, ...]
    ) -> tuple[Value, ...] | None:
        if operation.reads_point or any(argument.constant is None for argument in arguments):
            return None
        columns = [_column(argument) for argument in arguments]
        outputs = self._fold(operation, columns, self.meant(operation, settings))
        return tuple(
            self.constant(np.broadcast_to(o, (w,) if w == 1 else (w, 1)).reshape(-1))
            for o, w in zip(outputs, operation.output_widths, strict=True)
        )

    def _called(
        self, operation: Operation, arguments: tuple[Value, ...], settings: tuple[int, ...]
    ) -> tuple[Value, ...]:
        call = Call(operation, arguments, settings, self._calls)
        self._calls += 1
        widths = operation.output_widths
        return tuple(Value(width, call, output) for output, width in enumerate(widths))

    def _checked(
        self, operation: Operation, arguments: tuple[Value, ...], settings: dict[str, Any]
    ) -> tuple[int, ...]:
        """The settings in the table's order, after a look at everything that is given."""
        expected, given = operation.argument_widths, tuple(a.width for a in arguments)
        if expected != given:
            raise ValueError(f"{operation.name} takes slots {expected}, not {given}")
        if operation.setting_names != settings.keys():
            names = tuple(name for name, _ in operation.settings)
            raise ValueError(f"{operation.name} has settings {names}, not {tuple(settings)}")
        return tuple(self._number(choices, settings[name]) for name, choices in operation.settings)

    def _number(self, choices: Any, given: Any) -> int:
        if isinstance(choices, Reference):
            return self._things[choices].setdefault(given, len(self._things[choices]))
        if int(given) not in numbers_of(choices):
            raise ValueError(f"{given!r} is not one of {choices}")
        return int(given)


def needed(values: Sequence[Value]) -> list[Call]:
    """Every call that the values depend on, arguments before what uses them."""
    waiting = [value.call for value in values if value.call is not None]
    found: dict[int, Call] = {}
    while waiting:
        call = waiting.pop()
        if call.order in found:
            continue
        found[call.order] = call
        waiting += [value.call for value in call.arguments if value.call is not None]
    return [found[order] for order in sorted(found)]


def _column(value: Value) -> np.ndarray:
    column = np.array(value.constant, np.float64)
    return column if value.width == 1 else column[:, None]
