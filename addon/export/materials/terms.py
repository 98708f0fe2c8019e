"""Colours that vary over a surface: sums of products of `engine.scene.Input`. What shader sockets
evaluate to, and their algebra.

A sum of no terms is black. Every function gives sums whose terms differ in their factors, so adding
a thing to itself adds no term.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import chain

from ....engine.scene import Input
from ..images.colorspace import LUMA, luma

RGB = tuple[float, float, float]

GREY = "(grey) "
"""Prefix of attribute names whose mean channel is wanted."""


@dataclass(frozen=True)
class Term:
    """value times the product of factors; the factors' own values are 1 unless they are complements
    or have bounds.
    """

    value: RGB
    factors: tuple[Input, ...] = ()


Sum = tuple[Term, ...]
ZERO: Sum = ()
ONE: Sum = (Term((1.0, 1.0, 1.0)),)


def times(a: RGB, b: RGB) -> RGB:
    """Channel by channel."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


def luminance(rgb: RGB) -> float:
    return sum(times(luma(), rgb))


def constant(value: float | RGB) -> Sum:
    """A colour, or a number as grey; channels that are not finite count as 0."""
    rgb = (value,) * 3 if isinstance(value, (int, float)) else tuple(value)[:3]
    finite = tuple(float(x) if math.isfinite(x) else 0.0 for x in rgb)
    return (Term(finite),) if any(finite) else ZERO


def from_input(source: Input) -> Sum:
    """One factor."""
    return (Term((1.0, 1.0, 1.0), (source,)),)


def is_constant(terms: Sum) -> bool:
    return all(not term.factors for term in terms)


def constant_value(terms: Sum) -> RGB:
    """The colour of a sum for which `is_constant` holds."""
    return (
        tuple(sum(term.value[k] for term in terms) for k in range(3)) if terms else (0.0, 0.0, 0.0)
    )


def add(*sums: Sum) -> Sum:
    """The sum of sums, terms with equal factors merged and black ones left out."""
    filled = [terms for terms in sums if terms]
    if len(filled) < 2:  # mostly: and hashing factors takes long
        return tuple(term for terms in filled for term in terms if any(term.value))
    merged: dict[tuple[Input, ...], RGB] = {}
    for term in chain.from_iterable(filled):
        before = merged.get(term.factors, (0.0, 0.0, 0.0))
        merged[term.factors] = (
            before[0] + term.value[0],
            before[1] + term.value[1],
            before[2] + term.value[2],
        )
    return tuple(Term(value, factors) for factors, value in merged.items() if any(value))


def multiply(*sums: Sum) -> Sum:
    """The product of sums, multiplied out."""
    product = ONE
    for terms in sums:
        if terms == ONE or product == ONE:
            product = product if terms == ONE else terms
            continue
        product = add(*((_times(left, right),) for left in product for right in terms))
    return product


def _times(left: Term, right: Term) -> Term:
    factors = left.factors + right.factors
    return Term(
        times(left.value, right.value),
        tuple(sorted(factors, key=repr)) if len(factors) > 1 else factors,
    )


def scale(terms: Sum, factor: float) -> Sum:
    return multiply(terms, constant(factor))


def complement(terms: Sum) -> Sum:
    """1 - terms. One factor becomes its complement (one term); anything else 1 plus the negative
    terms.
    """
    if len(terms) == 1 and len(terms[0].factors) == 1:
        value, factor = terms[0].value, terms[0].factors[0]
        if factor.is_plain and not factor.complement:
            return from_input(replace(factor, value=value, complement=True))
        if factor.is_plain and value == (1.0, 1.0, 1.0):
            return (
                (Term(factor.value, (replace(factor, value=(1.0, 1.0, 1.0), complement=False),))),
            )
        if value == (1.0, 1.0, 1.0):
            return from_input(replace(factor, complement=not factor.complement))
    return add(ONE, scale(terms, -1.0))


def mix(factor: Sum, a: Sum, b: Sum) -> Sum:
    """(1 - factor) a + factor b."""
    return add(multiply(complement(factor), a), multiply(factor, b))


def grey(terms: Sum) -> Sum | None:
    """The sum as a number on all three channels, its luminance; None where that is no sum: of
    products of colours, of colours within bounds, of what programs compute, and of what varies
    where the working space is not Rec. 709.
    """
    greys = [_grey(term) for term in terms]
    return None if None in greys else add(*((term,) for term in greys))


def _grey(term: Term) -> Term | None:
    colored = [factor for factor in term.factors if not _is_grey_input(factor)]
    if not colored:
        return Term((luminance(term.value),) * 3, term.factors)
    is_one = len(colored) == 1 and luma() is LUMA
    if not (is_one and _is_grey(term.value) and _has_luminance(colored[0])):
        return None
    return Term(term.value, tuple(map(_grey_input, term.factors)))


def _is_grey(rgb: RGB) -> bool:
    return rgb[0] == rgb[1] == rgb[2]


def _is_grey_input(source: Input) -> bool:
    """Whether its three channels are the same everywhere."""
    return (
        _is_grey(source.value)
        and _is_grey(source.offset)
        and not _colored(source)
        and source.output < 0
    )


def _has_luminance(source: Input) -> bool:
    """Whether the luminance of an input that is not grey is another input."""
    return (
        source.is_plain
        and _is_grey(source.value)
        and len(_colored(source)) == 1
        and source.output < 0
    )


def _colored(source: Input) -> dict[str, str]:
    """Channels that are colours, with what stands for their luminance."""
    found = {}
    if source.texture >= 0 and source.channel == "COLOR":
        found["channel"] = "LUMINANCE"
    is_colour = source.attribute and not source.attribute.startswith(GREY)
    if is_colour and source.attribute_channel == "COLOR":
        found["attribute_channel"] = "LUMINANCE"
    return found


def _grey_input(source: Input) -> Input:
    """A colour becomes its luminance."""
    return replace(source, **_colored(source))


def factors_of(term: Term) -> tuple[Input, ...]:
    """A term as the factors of a lobe: its value goes into the first factor that can carry it."""
    for k, factor in enumerate(term.factors):
        if factor.is_plain and not factor.complement:
            carrier = replace(factor, value=times(factor.value, term.value))
            return (carrier, *term.factors[:k], *term.factors[k + 1 :])
    if term.value == (1.0, 1.0, 1.0) and term.factors:
        return term.factors
    return (Input(value=term.value), *term.factors)
