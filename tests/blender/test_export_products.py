"""Sums as programs: the same values as term by term, in fewer steps."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from glint.addon.export.materials.expressions import Expressions
from glint.addon.export.materials.terms import Sum, Term, add, complement, multiply, scale
from glint.engine.program.execute.run import run
from glint.engine.program.program import compile_program, instructions
from glint.engine.program.table import BY_NAME
from glint.engine.scene import Input

HITS, ROWS = 7, 5
RANDOM = np.random.default_rng(8)
CHANNELS = {name: RANDOM.uniform(-0.3, 1.3, (4, HITS)) for name in ("color", "number", "roughness")}


class Points(SimpleNamespace):
    """Shaded points with attributes only."""

    def attribute(self, name: str, shift: int) -> np.ndarray:
        return CHANNELS[name]


class Factors:
    """Inputs that expressions work out, and what they hold: a colour, a number, two functions of
    roughness, a function of another number, an attribute and a constant.
    """

    def __init__(self) -> None:
        self.expressions = Expressions()
        color, _ = self._read("color")
        number, roughness = (self._read(name)[1] for name in ("number", "roughness"))
        self.held: dict[Input, np.ndarray] = {}
        self._add(color, CHANNELS["color"][:3])
        self._add(number, CHANNELS["number"][[3] * 3])
        for name, place, rows in (
            ("roughness", roughness, ROWS),
            ("roughness", roughness, ROWS),
            ("number", number, ROWS + 2),
        ):
            table = RANDOM.normal(0, 1, rows)
            value = self.expressions.looked_up(place, tuple(table.tolist()))
            at = np.interp(CHANNELS[name][3], np.linspace(0, 1, rows), table)
            self._add(value, np.tile(at, (3, 1)))
        self.held[Input(attribute="color")] = CHANNELS["color"][:3]
        self.held[Input()] = np.ones((3, HITS))

    def values(self, terms: Sum) -> np.ndarray:
        """(3, n): term by term."""
        total = np.zeros((3, HITS))
        for term in terms:
            product = np.tile(np.array(term.value)[:, None], HITS)
            for factor in term.factors:
                product = product * self._value(factor)
            total += product
        return total

    def computed(self, terms: Sum) -> tuple[np.ndarray, Counter]:
        """(3, n) by the program, and how many operations it has by name."""
        value = self.expressions.value_of(terms)
        if value.constant is not None:
            return np.tile(np.array(value.constant)[:, None], HITS), Counter()
        program = compile_program(self.expressions.graph, [value])
        names = Counter(step.operation.name for step in instructions(program))
        return run(program, Points(), HITS)[0], names

    def _value(self, factor: Input) -> np.ndarray:
        plain = replace(
            factor,
            value=(1.0,) * 3,
            offset=(0.0,) * 3,
            low=-np.inf,
            high=np.inf,
            complement=False,
        )
        value = np.array(factor.value)[:, None] * self.held[plain]
        value = np.clip(value + np.array(factor.offset)[:, None], factor.low, factor.high)
        return 1 - value if factor.complement else value

    def _read(self, name: str) -> tuple:
        return self.expressions.graph.apply(BY_NAME["attribute"], attribute=name, shift=0)

    def _add(self, value, held: np.ndarray) -> None:
        ((term,),) = [self.expressions.sum_of(value)]
        self.held[term.factors[0]] = held


def altered(factor: Input) -> Input:
    """It as it is, or complemented, or with a colour, an offset and bounds."""
    kind = RANDOM.integers(0, 5)
    if kind == 0:
        return replace(factor, complement=True)
    if kind == 1:
        return replace(factor, value=tuple(RANDOM.uniform(0, 1, 3).tolist()), complement=True)
    if kind == 2:
        offset = float(RANDOM.normal())
        return replace(factor, offset=(offset,) * 3, low=-0.5, high=0.7)
    if kind == 3:
        offset = tuple(RANDOM.normal(0, 1, 3).tolist())
        return replace(factor, offset=offset, low=0.0, complement=bool(RANDOM.integers(0, 2)))
    return factor


def random_sum(factors: Factors) -> Sum:
    terms = []
    for _ in range(RANDOM.integers(1, 6)):
        chosen = RANDOM.choice(len(factors.held), RANDOM.integers(0, 5))
        shares = RANDOM.normal(0, 1, 3 if RANDOM.integers(0, 2) else 1)
        value = tuple(np.broadcast_to(shares, 3).tolist())
        terms.append(Term(value, tuple(altered(list(factors.held)[k]) for k in chosen)))
    return tuple(terms)


@pytest.mark.parametrize("trial", range(100))
def test_sums_have_the_values_of_their_terms(trial):
    factors = Factors()
    terms = random_sum(factors)
    found, names = factors.computed(terms)
    # a product of tables is straight where one of what is straight in each is not
    bends = names["lookup"] > 0
    expected = factors.values(terms)
    if not bends:
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert np.isfinite(found).all()


@pytest.mark.parametrize("place", range(ROWS))
def test_tables_are_right_at_their_rows(place, monkeypatch):
    """Whatever is joined to one."""
    monkeypatch.setitem(CHANNELS, "roughness", np.full((4, HITS), place / (ROWS - 1)))
    monkeypatch.setitem(CHANNELS, "number", np.full((4, HITS), RANDOM.integers(0, 2)))
    for _ in range(40):
        factors = Factors()
        terms = random_sum(factors)
        found, _ = factors.computed(terms)
        np.testing.assert_allclose(found, factors.values(terms), rtol=1e-11, atol=1e-11)


def test_what_follows_from_one_number_is_one_table(monkeypatch):
    """2 (1 - f) g colour - 3 f colour, of two functions of roughness: one table times the
    colour.
    """
    rows = np.arange(HITS) % ROWS
    monkeypatch.setitem(CHANNELS, "roughness", np.tile(rows / (ROWS - 1), (4, 1)))
    factors = Factors()
    color, _, f, g, *_ = ((Term((1.0, 1.0, 1.0), (factor,)),) for factor in factors.held)
    first = scale(multiply(complement(f), g, color), 2.0)
    terms = add(first, scale(multiply(f, color), -3.0))
    found, names = factors.computed(terms)
    assert names == {"attribute": 2, "lookup": 1, "scaled_sum": 1}
    np.testing.assert_allclose(found, factors.values(terms), rtol=1e-12, atol=1e-12)


def test_greys_are_worked_out_once():
    """A number's products are numbers, and not three times the same."""
    factors = Factors()
    _, number, *_, other, _, _ = ((Term((1.0, 1.0, 1.0), (factor,)),) for factor in factors.held)
    _, names = factors.computed(add(multiply(number, other), complement(multiply(number, number))))
    assert names.keys() == {"attribute", "lookup", "math", "combine_xyz"}
