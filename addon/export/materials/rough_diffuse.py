"""Rough matt surfaces: Oren and Nayar's model as Fujii has it, with what facets throw back more
than once, as Cycles has both.

At a roughness r Lambert's lobe has a share A = 1 / (1 + NEVER_LOST r), one of B = r A depends on
where light comes from, and of even light u = B MEAN_LOST is lost at once; of that comes back, for
an albedo c, c² (1 - u) / (u (1 - c u)) times what both directions lose.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ....engine.program.graph import Value
from .closures import Closure, LobeKey, add_closures
from .evaluator import NodeView
from .terms import Sum, add, constant, constant_value, is_constant, multiply, scale

NEVER_LOST = 0.5 - 2 / (3 * math.pi)
MEAN_GIVEN = (2 * math.pi - 5.6) / (3 * math.pi)
MEAN_LOST = NEVER_LOST - MEAN_GIVEN
"""Of light, over B: what is lost at once at normal incidence, and what is given back besides A and
lost of even light.
"""
LEAST = 1e-5
"""Of a roughness, as in Cycles."""
SEEN = 1.36
"""What is given back besides A goes nearly as (1 - n·v)^SEEN, within 0.007 B."""
_GRAZING = MEAN_GIVEN * (SEEN + 1) * (SEEN + 2) / 2


def roughened(view: NodeView, closure: Closure, name: str, color: Sum) -> Closure:
    """The closure with its matt lobes rough, but for light that goes below. name: of the input with
    the roughness. color: the albedo.
    """
    roughness = view.factor(name)
    if not roughness or (is_constant(roughness) and constant_value(roughness)[0] < LEAST):
        return closure
    shares = _shares(view, roughness, view.evaluator.clamped(color, 0.0, 1.0))
    return add_closures(*(_rough(key, terms, shares) for key, terms in closure.items()))


def _rough(key: LobeKey, terms: Sum, shares: tuple[Sum, Sum, Sum]) -> Closure:
    once, turned, again = (multiply(terms, share) for share in shares)
    if key.kind == "DIFFUSE" and not key.follows and not key.goes_below:
        return {
            key: once,
            replace(key, kind="OREN_NAYAR"): turned,
            replace(key, kind="OREN_NAYAR_MULTIPLE"): again,
        }
    if key.kind != "AMBIENT":
        return {key: terms}
    if key.exponent > 0:
        return {key: add(once, scale(turned, MEAN_GIVEN), scale(again, MEAN_LOST**2))}
    grazing = scale(add(turned, scale(again, -MEAN_LOST)), _GRAZING)
    return {
        key: add(once, scale(again, NEVER_LOST * MEAN_LOST)),
        replace(key, exponent=SEEN): grazing,
    }


def oren_nayar(roughness: float, albedo: float) -> tuple[float, float, float]:
    """A, B, and what is times what both directions lose at once."""
    once = 1 / (1 + NEVER_LOST * roughness)
    lost = roughness * once * MEAN_LOST
    again = albedo**2 * (1 - lost) * roughness * once / (MEAN_LOST * (1 - albedo * lost))
    return once, roughness * once, again


def _shares(view: NodeView, roughness: Sum, albedo: Sum) -> tuple[Sum, Sum, Sum]:
    """The same as sums."""
    if is_constant(roughness):
        once, turned, _ = oren_nayar(constant_value(roughness)[0], 0.0)
        if is_constant(albedo):
            channels = (
                oren_nayar(constant_value(roughness)[0], c)[2] for c in constant_value(albedo)
            )
            return constant(once), constant(turned), constant(tuple(channels))
        return constant(once), constant(turned), _again(view, turned, albedo)
    expressions = view.evaluator.expressions
    do, r = expressions.math, expressions.parts(expressions.value_of(roughness))[0]
    once = do("DIVIDE", 1.0, do("MULTIPLY_ADD", r, NEVER_LOST, 1.0))
    turned = do("MULTIPLY", r, once)
    return expressions.sum_of(once), expressions.sum_of(turned), _again(view, turned, albedo)


def _again(view: NodeView, turned: Value | float, albedo: Sum) -> Sum:
    expressions = view.evaluator.expressions
    do, lost = expressions.math, expressions.math("MULTIPLY", turned, MEAN_LOST)
    whole = do("DIVIDE", do("MULTIPLY", do("SUBTRACT", 1.0, lost), turned), MEAN_LOST)

    def channel(c: Value) -> Value:
        rest = do("SUBTRACT", 1.0, do("MULTIPLY", c, lost))
        return do("DIVIDE", do("MULTIPLY", do("MULTIPLY", c, c), whole), rest)

    parts = map(channel, expressions.parts(expressions.value_of(albedo)))
    return expressions.sum_of(expressions.apply("combine_xyz", *parts))
