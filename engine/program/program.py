"""Programs: expressions as instructions over numbered slots, for the executors to run per hit."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

from .graph import Call, Graph, Value, needed
from .operations import Kind, Operation, Reference
from .operations_rays import ASKING
from .table import CODES, OPERATIONS

UNREAD = -1
"""Stands for the slot of an output that nothing reads."""


@dataclass(frozen=True)
class Program:
    """Instructions, run in order, over `slots` columns of float64.

    code: instructions one after the other, each an operation's code (its place in
    `table.OPERATIONS`), the first slot of each output (UNREAD where nothing reads it), where each
    argument is (a first slot, or ~k for the constant k), and the settings. A vector is three slots
    in a row, or three constants. An instruction never writes into a slot that it reads.
    constants: numbers; each use has its own, so that trees which differ in numbers alone give equal
    code. (Numbers that make two expressions equal merge them, and so do change it.)
    outputs: first slot of each output; they hold their values after the last instruction.
    attributes, textures, tables: what settings refer to: names, indices into `Scene.textures`,
    rows of numbers.
    """

    code: tuple[int, ...]
    constants: tuple[float, ...]
    slots: int
    outputs: tuple[int, ...]
    attributes: tuple[str, ...] = ()
    textures: tuple[int, ...] = ()
    tables: tuple[tuple[float, ...], ...] = ()

    def with_textures(self, numbers: dict[int, int]) -> Program:
        """The same with other indices of textures."""
        return replace(self, textures=tuple(numbers[k] for k in self.textures))

    @cached_property
    def most_asked(self) -> int:
        """How many rays an operation asks the scene for at a point and sample, at most; 0 where
        none does.
        """
        return max(map(_asked, instructions(self)), default=0)


class Instruction(NamedTuple):
    """One instruction taken apart; the fields as `Program.code` has them."""

    operation: Operation
    outputs: tuple[int, ...]
    arguments: tuple[int, ...]
    settings: tuple[int, ...]


def instructions(program: Program) -> Iterator[Instruction]:
    """The program's instructions. Raises ValueError where the code is cut off or unknown."""
    code, at = program.code, 0
    while at < len(code):
        if not 0 <= code[at] < len(OPERATIONS) or at + OPERATIONS[code[at]].words > len(code):
            raise ValueError(f"no operation has the code {code[at]}, or the code is cut off")
        operation = OPERATIONS[code[at]]
        outputs = at + 1 + len(operation.outputs)
        arguments = outputs + len(operation.arguments)
        end = arguments + len(operation.settings)
        yield Instruction(
            operation, code[at + 1 : outputs], code[outputs:arguments], code[arguments:end]
        )
        at = end


def without_the_rest(program: Program, numbers: Iterable[int]) -> Program:
    """The instructions that the outputs of these numbers need; the other outputs hold anything."""
    steps, kept = list(instructions(program)), []
    wide = {place: kind for step in steps for place, kind in _written(step)}
    places = (program.outputs[number] for number in numbers)
    live = {place + row for place in places for row in range(wide[place])}
    for step in reversed(steps):
        written = _rows(_written(step))
        if live.isdisjoint(written):
            continue
        kinds = (kind for _, kind in step.operation.arguments)
        live = (live - written) | _rows(zip(step.arguments, kinds, strict=True))
        kept.append(step)
    code = [
        word
        for step in reversed(kept)
        for word in (
            CODES[step.operation.name], *step.outputs, *step.arguments, *step.settings
        )
    ]  # fmt: skip
    return replace(program, code=tuple(code))


def _written(step: Instruction) -> Iterator[tuple[int, Kind]]:
    """Where each output stands, and what it is."""
    return zip(step.outputs, (kind for _, kind in step.operation.outputs), strict=True)


def _rows(places: Iterable[tuple[int, Kind]]) -> set[int]:
    """Slots of what stands in some: constants, and what nothing reads, do not."""
    return {place + row for place, kind in places if place >= 0 for row in range(kind)}


def _asked(step: Instruction) -> int:
    if step.operation.name not in ASKING:
        return 0
    names = (name for name, _ in step.operation.settings)
    return dict(zip(names, step.settings, strict=True)).get("samples", 1)


def compile_program(graph: Graph, outputs: Sequence[Value]) -> Program:
    """The program that computes the values, none of them a constant, and nothing else."""
    calls = needed(outputs)
    last_uses = _last_uses(calls, outputs)
    things, slots = _Things(graph), _Slots(last_uses)
    constants: list[float] = []
    code: list[int] = []
    joined = _joined(graph, calls, last_uses)
    for call in calls:
        together = joined.get(call.order)
        if together is not None:
            arguments = [_place(value, constants, slots) for value in call.arguments]
            taken, settings = slots.take(together), things.numbers(together)
            code += [CODES[call.operation.name], *taken, *arguments, *settings]
        slots.release_after(call)
    return Program(
        tuple(code),
        tuple(constants),
        slots.total,
        tuple(slots.of(value) for value in outputs),
        **things.tuples(),
    )


def _joined(
    graph: Graph, calls: Sequence[Call], read: Container[tuple[int, int]]
) -> dict[int, list[Call]]:
    """The calls of each instruction, by the order of the first: one, or some that look up a column
    each, of as many rows, at the same place. read: outputs that something reads.
    """
    found: dict[int, list[Call]] = {}
    alike: dict[tuple[int, int], list[Call]] = {}
    for call in calls:
        if _has_one_column(call) and not any((call.order, k) in read for k in (1, 2, 3)):
            key = id(call.arguments[0]), len(graph.thing(Reference.TABLE, call.settings[1]))
            others = alike.get(key, ())
            if 0 < len(others) < len(call.operation.outputs):
                others.append(call)
                continue
            found[call.order] = alike[key] = [call]
        else:
            found[call.order] = [call]
    return found


def _has_one_column(call: Call) -> bool:
    return call.operation.name == "lookup" and call.settings[0] == 0


def _last_uses(calls: list[Call], outputs: Sequence[Value]) -> dict[tuple[int, int], int]:
    """Order of the last call that reads a value, by the value's call and output.

    Outputs of the program are read after the last call.
    """
    last = {}
    for call in calls:
        for value in call.arguments:
            if value.call is not None:
                last[value.call.order, value.output] = call.order
    end = calls[-1].order + 1 if calls else 0
    last.update({(v.call.order, v.output): end for v in outputs if v.call is not None})
    return last


def _place(value: Value, constants: list[float], slots: _Slots) -> int:
    """Where an argument is: its slot, or the complement of its constant's number."""
    if value.constant is None:
        return slots.of(value)
    constants += value.constant
    return ~(len(constants) - value.width)


class _Slots:
    """Deals slots to calls, the lowest that are free, and takes them back after the last use."""

    def __init__(self, last_uses: dict[tuple[int, int], int]) -> None:
        self.total = 0
        self._last_uses = last_uses
        self._free = bytearray()
        self._of_values: dict[tuple[int, int], int] = {}
        self._ending: dict[int, list[tuple[int, int]]] = {}

    def of(self, value: Value) -> int:
        assert value.call is not None  # a constant has no slot
        return self._of_values[value.call.order, value.output]

    def take(self, together: Sequence[Call]) -> list[int]:
        """The first slot of each output of an instruction."""
        widths = together[0].operation.output_widths
        outputs = [(together[0].order, output) for output in range(len(widths))]
        outputs[: len(together)] = [(call.order, 0) for call in together]
        return [self._taken_for(key, width) for key, width in zip(outputs, widths, strict=True)]

    def release_after(self, call: Call) -> None:
        """Take back the slots of every value that nothing after the call reads."""
        for slot, width in self._ending.pop(call.order, ()):
            self._free[slot : slot + width] = b"\1" * width

    def _taken_for(self, key: tuple[int, int], width: int) -> int:
        if key not in self._last_uses:
            return UNREAD
        slot = self._of_values[key] = self._taken(width)
        self._ending.setdefault(self._last_uses[key], []).append((slot, width))
        return slot

    def _taken(self, width: int) -> int:
        start = self._free.find(b"\1" * width)
        if start < 0:
            start = len(self._free.rstrip(b"\1"))
        self._free[start : start + width] = bytes(width)
        self.total = max(self.total, len(self._free))
        return start


class _Things:
    """Numbers what settings refer to anew: in the order in which a program uses it."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._used: dict[Reference, dict[Any, int]] = {kind: {} for kind in Reference}

    def numbers(self, together: Sequence[Call]) -> list[int]:
        """The settings of an instruction."""
        if len(together) > 1:
            return [len(together) - 1, self._number_of_columns(together)]
        (call,) = together
        given = zip(call.operation.settings, call.settings, strict=True)
        return [self._number(choices, setting) for (_, choices), setting in given]

    def tuples(self) -> dict[str, tuple]:
        """All that is used, by the name of `Program`'s field."""
        return {kind.value: tuple(used) for kind, used in self._used.items()}

    def _number(self, choices: Any, setting: int) -> int:
        if not isinstance(choices, Reference):
            return setting
        used = self._used[choices]
        return used.setdefault(self._graph.thing(choices, setting), len(used))

    def _number_of_columns(self, together: Sequence[Call]) -> int:
        """Of the table that has a column of each of these."""
        columns = [self._graph.thing(Reference.TABLE, call.settings[1]) for call in together]
        used = self._used[Reference.TABLE]
        return used.setdefault(tuple(chain.from_iterable(zip(*columns, strict=True))), len(used))
