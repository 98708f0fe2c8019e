"""Graphs and programs: random expressions give the same values folded, compiled and run, and
programs are well-formed.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glint.engine.program.execute.operations import apply
from glint.engine.program.execute.run import run
from glint.engine.program.graph import Graph, Value
from glint.engine.program.operations import Operation
from glint.engine.program.operations_math import MathOperation as M
from glint.engine.program.problems import program_problems
from glint.engine.program.program import (
    UNREAD,
    Program,
    compile_program,
    instructions,
    without_the_rest,
)
from glint.engine.program.table import BY_NAME

HITS = 5
MATH, ATTRIBUTE = BY_NAME["math"], BY_NAME["attribute"]
# What rounds the same for one number as for an array of them.
EXACT = (M.ADD, M.SUBTRACT, M.MULTIPLY, M.DIVIDE, M.MINIMUM, M.FLOOR, M.COMPARE, M.SMOOTH_MAX)
CHOICES: tuple[tuple[Operation, dict[str, int]], ...] = (
    *((MATH, {"operation": operation, "clamp": operation == M.DIVIDE}) for operation in EXACT),
    (BY_NAME["clamp"], {"clamp_type": 1}),
    *(
        (BY_NAME[name], {})
        for name in ("combine_xyz", "separate_xyz", "vector_average", "scaled_sum", "product")
    ),
)
NUMBERS = st.floats(-4.0, 4.0) | st.sampled_from([0.0, -0.0, 1.0, float("nan"), float("inf")])
Recipe = list[tuple[int, list[int]]]
RECIPES = st.lists(
    st.tuples(
        st.integers(0, len(CHOICES) - 1),
        st.lists(st.integers(0, 40), min_size=3, max_size=3),
    ),
    max_size=30,
)


class Points(SimpleNamespace):
    """Shaded points with attributes only: `channels` (4, n) by name."""

    def attribute(self, name: str, shift: int) -> np.ndarray:
        assert shift == 0
        return self.channels[name]


def problems(program: Program) -> list[str]:
    """What is wrong with a program: places out of range, written while read, dead outputs."""
    found = []
    wanted = set(program.outputs)
    for step in reversed(list(instructions(program))):
        written, read, constants = _places(step)
        used = [slot for slots in written for slot in slots]
        found += ["reads what it writes"] * bool(read & set(used))
        found += ["two outputs in one slot"] * (len(used) != len(set(used)))
        found += ["dead"] * any(not wanted & set(slots) for slots in written)
        found += ["dead"] * (not written)
        found += ["no such slot"] * any(not 0 <= s < program.slots for s in (*used, *read))
        found += ["no such constant"] * any(k >= len(program.constants) for k in constants)
        wanted = (wanted - set(used)) | read
    return found + ["reads an empty slot"] * bool(wanted)


def _places(step) -> tuple[list[range], set[int], set[int]]:
    """The slots of each output that is read, all slots and all constants of the arguments."""
    widths = [int(kind) for _, kind in step.operation.outputs]
    pairs = zip(step.outputs, widths, strict=True)
    written = [range(slot, slot + width) for slot, width in pairs if slot != UNREAD]
    read, constants = set(), set()
    for place, (_, kind) in zip(step.arguments, step.operation.arguments, strict=True):
        if place < 0:
            constants |= set(range(~place, ~place + kind))
        else:
            read |= set(range(place, place + kind))
    return written, read, constants


def read(graph: Graph, name: str) -> tuple[Value, Value]:
    """An attribute's vector and alpha."""
    return graph.apply(ATTRIBUTE, attribute=name, shift=0)


def leaves(graph: Graph, numbers: Sequence[float], are_constants: bool) -> list[Value]:
    """Numbers and a vector of them, constants or read as attributes; then two true attributes."""
    if are_constants:
        found = [graph.constant(x) for x in numbers] + [graph.constant(numbers[:3])]
    else:
        found = [read(graph, f"number {i}")[1] for i in range(len(numbers))]
        found += read(graph, "number 0")[:1]
    return found + [v for name in "ab" for v in read(graph, name)]


def attributes(numbers: Sequence[float]) -> dict[str, np.ndarray]:
    """What the attributes of `leaves` hold."""
    random = np.random.default_rng(1)
    channels = {name: random.normal(size=(4, HITS)) for name in "ab"}
    for i, number in enumerate(numbers):
        rows = np.array([*numbers[:3], number])
        channels[f"number {i}"] = np.repeat(rows[:, None], HITS, 1)
    return channels


def grown(values: Sequence, recipe: Recipe, width_of, apply_to) -> list:
    """Leaves, and what a recipe makes of them: operations with choices of earlier values."""
    values = list(values)
    for which, picks in recipe:
        operation, settings = CHOICES[which]
        arguments = []
        for pick, (_, kind) in zip(picks, operation.arguments, strict=False):
            fitting = [value for value in values if width_of(value) == kind]
            arguments.append(fitting[pick % len(fitting)])
        values += apply_to(operation, arguments, settings)
    return values


def expressions(graph: Graph, first: list[Value], recipe: Recipe) -> list[Value]:
    return grown(
        first,
        recipe,
        lambda value: value.width,
        lambda operation, arguments, settings: graph.apply(operation, *arguments, **settings),
    )


def arrays(channels: dict[str, np.ndarray], count: int, recipe: Recipe) -> list[np.ndarray]:
    """The recipe's values by the operations' functions alone, without graph or program."""
    first = [channels[f"number {i}"][3] for i in range(count)] + [channels["number 0"][:3]]
    first += [part for name in "ab" for part in (channels[name][:3], channels[name][3])]
    return grown(first, recipe, lambda value: 1 if value.ndim == 1 else 3, apply)


@pytest.mark.parametrize("are_constants", [True, False])
@given(RECIPES, st.lists(NUMBERS, min_size=4, max_size=4), st.lists(st.integers(0, 99), max_size=4))
def test_programs_give_the_direct_values(are_constants, recipe, numbers, picks):
    """With constants what depends on them alone is folded; read as attributes nothing is."""
    channels = attributes(numbers)
    direct = arrays(channels, len(numbers), recipe)
    graph = Graph(apply)
    values = expressions(graph, leaves(graph, numbers, are_constants), recipe)
    chosen = sorted({pick % len(values) for pick in picks} | {len(values) - 1})
    varying = [k for k in chosen if values[k].constant is None]

    program = compile_program(graph, [values[k] for k in varying])
    results = run(program, Points(channels=channels), HITS)

    assert problems(program) == []
    for k, result in zip(varying, results, strict=True):
        np.testing.assert_array_equal(_as_rows(direct[k]), result[: values[k].width])
        alone = without_the_rest(program, [varying.index(k)])
        again = run(alone, Points(channels=channels), HITS)[varying.index(k)]
        np.testing.assert_array_equal(result[: values[k].width], again[: values[k].width])
    for k in set(chosen) - set(varying):
        rows = np.array(values[k].constant)[:, None]
        np.testing.assert_array_equal(_as_rows(direct[k]), np.repeat(rows, HITS, 1))


def _as_rows(value: np.ndarray) -> np.ndarray:
    return np.atleast_2d(value).astype(np.float64)


def number(graph: Graph, name: str = "x") -> Value:
    return read(graph, name)[1]


def sum_of(graph: Graph, a: Value, b: Value) -> Value:
    return graph.apply(MATH, a, b, graph.constant(0.0), operation=M.ADD, clamp=0)[0]


def test_equal_expressions_are_one_object_and_nan_equals_itself():
    graph = Graph(apply)
    x, y = number(graph), number(graph, "y")

    assert graph.constant(float("nan")) is graph.constant(float("nan"))
    assert graph.constant(0.0) is not graph.constant(-0.0)
    assert number(graph) is x
    assert sum_of(graph, x, y) is sum_of(graph, x, y)
    assert sum_of(graph, x, y) is not sum_of(graph, y, x)


def test_constants_fold_and_an_expression_of_them_needs_no_instruction():
    graph = Graph(apply)
    five = sum_of(graph, graph.constant(2.0), graph.constant(3.0))

    program = compile_program(graph, [sum_of(graph, number(graph), five)])

    assert five.constant == (5.0,)
    assert [step.operation.name for step in instructions(program)] == ["attribute", "math"]
    assert program.constants == (5.0, 0.0)


@given(st.lists(NUMBERS, min_size=3, max_size=3))
def test_programs_that_differ_in_constants_only_have_equal_code(numbers):
    def program(*constants: float) -> Program:
        graph = Graph(apply)
        x = number(graph)
        for constant in constants:
            x = sum_of(graph, x, graph.constant(constant))
        return compile_program(graph, [x])

    changed, usual = program(*numbers), program(1.0, 1.0, 1.0)

    assert (changed.code, changed.outputs) == (usual.code, usual.outputs)
    np.testing.assert_array_equal(changed.constants[::2], numbers)


def test_a_chain_reuses_its_slots():
    graph = Graph(apply)
    value = number(graph)
    for _ in range(100):
        value = sum_of(graph, value, value)

    assert compile_program(graph, [value]).slots == 2


def test_five_thousand_nodes_that_read_values_from_far_back():
    graph = Graph(apply)
    kept = [number(graph)]
    for k in range(5000):
        kept.append(sum_of(graph, kept[k // 2], kept[-1]))

    program = compile_program(graph, kept[-1:])

    assert len(list(instructions(program))) == 5001
    assert problems(program) == []


def test_a_thousand_reads_beside_the_point_are_checked_at_once():
    """Bumps read each coordinate at three points, and each read's shift is one of 400 000."""
    graph, uv = Graph(apply), BY_NAME["uv"]
    reads = [graph.apply(uv, attribute="", shift=4 * k)[0] for k in range(1000)]
    program = compile_program(graph, reads)
    start = time.process_time()
    assert list(program_problems(program, 0)) == []
    assert time.process_time() - start < 1.0


def test_what_nothing_reads_is_left_out():
    graph = Graph(apply)
    vector, alpha = read(graph, "x")
    sum_of(graph, alpha, alpha)

    (step,) = instructions(compile_program(graph, [vector]))

    assert step.outputs == (0, UNREAD)


def test_what_is_looked_up_at_one_number_is_looked_up_together():
    """Up to four columns of as many rows an instruction, whichever of them is read when."""
    graph, columns = Graph(apply), np.random.default_rng(3).normal(0, 1, (6, 9))
    x, y = read(graph, "x")[1], read(graph, "y")[1]

    def looked_up(number: Value, column: np.ndarray) -> Value:
        return graph.apply(BY_NAME["lookup"], number, last=0, table=tuple(column))[0]

    values = [looked_up(x, column) for column in columns[:2]]
    between = sum_of(graph, *values)
    values += [looked_up(x, column) for column in columns[2:]]
    values += [looked_up(x, columns[0][:8]), looked_up(y, columns[0])]
    program = compile_program(graph, [between, *values])
    places = np.array([0.0, 0.3, 1.0, -2.0, 5.0])

    def table(last: int, place: np.ndarray, column: np.ndarray) -> np.ndarray:
        return np.interp(place, np.linspace(0, 1, last), column)

    channels = {name: np.tile(p, (4, 1)) for name, p in (("x", places), ("y", places[::-1]))}
    found = run(program, Points(channels=channels), HITS)
    expected = [table(9, places, column) for column in columns]
    expected += [table(8, places, columns[0][:8]), table(9, places[::-1], columns[0])]
    steps = [step for step in instructions(program) if step.operation.name == "lookup"]

    expected.insert(0, expected[0] + expected[1])
    np.testing.assert_allclose(np.array(found)[:, 0], expected, atol=1e-15)
    assert [step.settings[0] for step in steps] == [3, 1, 0, 0]
    assert problems(program) == []


def test_outputs_that_are_not_asked_for_cost_nothing():
    graph = Graph(apply)
    x, y = number(graph, "x"), number(graph, "y")
    program = compile_program(graph, [sum_of(graph, y, y), sum_of(graph, x, x)])

    alone = without_the_rest(program, [1])

    assert len(list(instructions(alone))) == 2 < len(list(instructions(program)))
    assert alone.outputs == program.outputs


def test_references_are_numbered_in_the_order_of_use():
    graph = Graph(apply)
    number(graph, "unused")
    y, x = number(graph, "y"), number(graph, "x")

    assert compile_program(graph, [sum_of(graph, x, y)]).attributes == ("y", "x")


def test_what_the_table_does_not_give_an_operation_is_refused():
    graph = Graph(apply)
    x = graph.constant(1.0)

    with pytest.raises(ValueError, match="takes slots"):
        graph.apply(BY_NAME["product"], x, x)
    with pytest.raises(ValueError, match="has settings"):
        graph.apply(MATH, x, x, x, operation=M.ADD)
    with pytest.raises(ValueError, match="is not one of"):
        graph.apply(MATH, x, x, x, operation=99, clamp=0)
    with pytest.raises(ValueError, match="1 or 3"):
        graph.constant((1.0, 2.0))


def test_code_that_is_cut_off_or_unknown_is_refused():
    graph = Graph(apply)
    code = compile_program(graph, [number(graph)]).code
    for broken in (code[:-1], (*code, -1), (*code, 10**6)):
        with pytest.raises(ValueError, match="cut off"):
            list(instructions(Program(broken, (), 4, (0,))))
