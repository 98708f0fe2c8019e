"""Graphs and programs: random expressions give the same values folded, compiled and run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glint.engine.program.graph import Graph, Value
from glint.engine.program.program import COLUMNS, NO_SLOT, Program, compile_program

HITS = 5


class Width(IntEnum):
    NUMBER = 1
    VECTOR = 3


@dataclass(frozen=True)
class Row:
    """An operation of the small table that these tests compute with."""

    name: str
    code: int
    arguments: tuple[tuple[str, Width], ...]
    outputs: tuple[tuple[str, Width], ...]
    settings: tuple[str, ...]
    run: Callable


def _row(code: int, name: str, widths: str, outputs: str, run: Callable, *settings: str) -> Row:
    sockets = [tuple((str(i), Width(int(w))) for i, w in enumerate(s)) for s in (widths, outputs)]
    return Row(name, code, sockets[0], sockets[1], settings, run)


LOAD_NUMBER = _row(0, "load_number", "", "1", lambda loads, which: (loads[which],), "which")
LOAD_VECTOR = _row(
    1, "load_vector", "", "3", lambda loads, which: (loads[which : which + 3],), "which"
)
SUBTRACT = _row(2, "subtract", "11", "1", lambda a, b: (a - b,))
SCALE = _row(3, "scale", "31", "3", lambda v, s: (v * s,))
COMBINE = _row(4, "combine", "111", "3", lambda x, y, z: (np.stack([x, y, z]),))
SEPARATE = _row(5, "separate", "3", "111", lambda v: (v[0], v[1], v[2]))
CROSS = _row(6, "cross", "33", "3", lambda a, b: (np.cross(a, b, axis=0),))
SPLIT = _row(7, "split", "3", "13", lambda v: (np.abs(v).max(axis=0), np.roll(v, 1, axis=0)))
POWER = _row(8, "power", "1", "1", lambda x, k: (x * 2.0**k,), "k")
TABLE = (LOAD_NUMBER, LOAD_VECTOR, SUBTRACT, SCALE, COMBINE, SEPARATE, CROSS, SPLIT, POWER)
PURE = TABLE[2:]


def fold(
    row: Row, arguments: Sequence[np.ndarray], settings: Sequence[int]
) -> Sequence[np.ndarray]:
    return row.run(*arguments, *settings)


def no_fold(*_: object) -> None:
    return None


def run(program: Program, loads: np.ndarray) -> np.ndarray:
    """Slots after the program, (slots, hits). Slots start as NaN, so reading an empty one shows."""
    slots = np.full((program.slots, loads.shape[1]), np.nan)
    slots[: len(program.constants)] = program.constants[:, None]
    for code, destination, *rest in program.instructions:
        row = TABLE[code]
        given = [_read(slots, at, kind) for at, (_, kind) in zip(rest, row.arguments, strict=False)]
        given = [loads] * (not row.arguments) + given
        for output in row.run(*given, *rest[6 : 6 + len(row.settings)]):
            column = np.atleast_2d(output)
            slots[destination : destination + len(column)] = column
            destination += len(column)
    return slots


def _read(slots: np.ndarray, at: int, kind: Width) -> np.ndarray:
    return slots[at].copy() if kind == Width.NUMBER else slots[at : at + 3].copy()


def problems(program: Program) -> list[str]:
    """What is wrong with a program: slots out of range, written while read, dead instructions."""
    found = []
    fixed = len(program.constants)
    wanted: set[int] = set()
    ends = [
        range(at, at + width) for at, width in zip(program.outputs, program.widths, strict=True)
    ]
    wanted = {slot for end in ends for slot in end}
    for code, destination, *rest in reversed(program.instructions.tolist()):
        row = TABLE[code]
        written = set(range(destination, destination + sum(k for _, k in row.outputs)))
        pairs = zip(rest, row.arguments, strict=False)
        read = {slot for at, (_, kind) in pairs for slot in range(at, at + kind)}
        found += ["reads what it writes"] * bool(written & read)
        found += ["dead"] * (not written & wanted)
        found += ["overwrites a constant"] * (min(written) < fixed)
        found += ["out of range"] * (
            max(written | read) >= program.slots or min(read | written) < 0
        )
        wanted = (wanted - written) | read
    return found + ["reads an empty slot"] * any(slot >= fixed for slot in wanted)


def compiled(values: Sequence[Value]) -> SimpleNamespace:
    program = compile_program(values)
    return SimpleNamespace(**vars(program), widths=[value.width for value in values])


Recipe = list[tuple[int, list[int], int]]
NUMBERS = st.floats(-4.0, 4.0) | st.sampled_from([0.0, -0.0, 1.0, float("nan"), float("inf")])
RECIPES = st.lists(
    st.tuples(
        st.integers(0, len(PURE) - 1),
        st.lists(st.integers(0, 40), min_size=3, max_size=3),
        st.integers(-2, 2),
    ),
    max_size=30,
)


def leaves(graph: Graph, numbers: Sequence[float]) -> list[Value]:
    """Constants and loads, both widths."""
    found = [graph.constant(x) for x in numbers] + [graph.constant(numbers[:3])]
    found += graph.apply(LOAD_NUMBER, which=0) + graph.apply(LOAD_NUMBER, which=1)
    return [*found, *graph.apply(LOAD_VECTOR, which=2), *graph.apply(LOAD_VECTOR, which=5)]


def grown(graph: Graph, values: list[Value], recipe: Recipe) -> list[Value]:
    """Leaves, and what a recipe makes of them: operations with choices of earlier values."""
    values = list(values)
    for which, choices, k in recipe:
        row = PURE[which]
        arguments = []
        for choice, (_, kind) in zip(choices, row.arguments, strict=False):
            fitting = [value for value in values if value.width == kind]
            arguments.append(fitting[choice % len(fitting)])
        values += graph.apply(row, *arguments, **dict.fromkeys(row.settings, k))
    return values


def results(program: SimpleNamespace, loads: np.ndarray) -> list[np.ndarray]:
    slots = run(program, loads)
    pairs = zip(program.outputs, program.widths, strict=True)
    return [slots[at : at + width] for at, width in pairs]


@given(
    RECIPES,
    st.lists(NUMBERS, min_size=4, max_size=4),
    st.lists(st.integers(0, 99), min_size=1, max_size=4),
)
def test_folded_and_unfolded_programs_give_the_direct_values(recipe, numbers, picks):
    loads = np.random.default_rng(1).normal(size=(8, HITS))

    with np.errstate(all="ignore"):
        direct = _direct(recipe, numbers, loads)
        for folding in (fold, no_fold):
            graph = Graph(folding)
            values = grown(graph, leaves(graph, numbers), recipe)
            chosen = [pick % len(values) for pick in picks]
            program = compiled([values[pick] for pick in chosen])

            assert problems(program) == []
            for pick, result in zip(chosen, results(program, loads), strict=True):
                np.testing.assert_array_equal(result, np.broadcast_to(direct[pick], result.shape))


def _direct(recipe: Recipe, numbers: Sequence[float], loads: np.ndarray) -> list[np.ndarray]:
    """The recipe's values by NumPy alone."""
    constants = [np.full(HITS, x) for x in numbers] + [
        np.repeat(np.array(numbers[:3])[:, None], HITS, 1)
    ]
    values = [*constants, loads[0], loads[1], loads[2:5], loads[5:8]]
    for which, choices, k in recipe:
        row = PURE[which]
        arguments = []
        for choice, (_, kind) in zip(choices, row.arguments, strict=False):
            fitting = [value for value in values if value.ndim == (1 if kind == 1 else 2)]
            arguments.append(fitting[choice % len(fitting)])
        values += row.run(*arguments, *[k] * len(row.settings))
    return values


def test_equal_expressions_are_one_object_and_nan_equals_itself():
    graph = Graph(fold)
    (x,) = graph.apply(LOAD_NUMBER, which=0)

    assert graph.constant(float("nan")) is graph.constant(float("nan"))
    assert graph.constant(0.0) is not graph.constant(-0.0)
    assert graph.apply(POWER, x, k=1)[0] is graph.apply(POWER, x, k=1)[0]
    assert graph.apply(POWER, x, k=1)[0] is not graph.apply(POWER, x, k=2)[0]


def test_constants_fold_to_one_constant_and_no_instruction():
    graph = Graph(fold)
    value = graph.apply(SUBTRACT, graph.constant(5.0), graph.constant(2.0))[0]

    program = compiled([value, graph.constant((1.0, 2.0, 3.0))])

    assert value.constant == (3.0,)
    assert program.instructions.shape == (0, COLUMNS)
    assert program.constants.tolist() == [3.0, 1.0, 2.0, 3.0]


@given(st.lists(NUMBERS, min_size=3, max_size=3, unique=True))
def test_programs_that_differ_in_constants_only_have_equal_instructions(numbers):
    def program(a: float, b: float, c: float) -> SimpleNamespace:
        graph = Graph(fold)
        (x,) = graph.apply(LOAD_NUMBER, which=0)
        for number in (a, b, c):
            (x,) = graph.apply(SUBTRACT, x, graph.constant(number))
        return compiled([x, graph.constant(a)])

    changed, usual = program(*numbers), program(1.0, 1.0, 1.0)

    assert changed.instructions.tolist() == usual.instructions.tolist()
    assert changed.outputs == usual.outputs
    np.testing.assert_array_equal(changed.constants, [*numbers, numbers[0]])


def test_a_chain_reuses_its_slots():
    graph = Graph(fold)
    (value,) = graph.apply(LOAD_NUMBER, which=0)
    for _ in range(100):
        (value,) = graph.apply(POWER, value, k=1)

    assert compiled([value]).slots == 2


def test_five_thousand_nodes_compile_in_half_a_second():
    graph = Graph(fold)
    (value,) = graph.apply(LOAD_NUMBER, which=0)
    kept = [value]
    began = time.process_time()
    for number in range(5000):
        (value,) = graph.apply(SUBTRACT, kept[number // 2], value)
        kept.append(value)
    program = compiled([value])
    took = time.process_time() - began

    assert len(program.instructions) == 5001
    assert problems(program) == []
    assert took < 0.5


def test_what_the_table_does_not_give_an_operation_is_refused():
    graph = Graph(fold)
    x = graph.constant(1.0)

    with pytest.raises(ValueError, match="takes slots"):
        graph.apply(SCALE, x, x)
    with pytest.raises(ValueError, match="has settings"):
        graph.apply(POWER, x)
    with pytest.raises(ValueError, match="1 or 3"):
        graph.constant((1.0, 2.0))


def test_unused_places_of_an_instruction_say_so():
    graph = Graph(no_fold)
    program = compiled(graph.apply(POWER, graph.constant(1.0), k=-2))

    assert program.instructions.tolist() == [[8, 1, 0, *[NO_SLOT] * 5, -2, 0, 0, 0]]
