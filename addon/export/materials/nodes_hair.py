"""The shaders of hair as FIBRE lobes (SEMANTICS.md): Kajiya and Kay's sines round a strand's
tangent. What is no strand has no tangent and shows them as matt, under a highlight.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_input import Space, VectorType
from ....engine.program.table import BY_NAME
from ..shader_nodes.reader import FIBRE
from .evaluator import CLOSURE_NODES, PASSED, Closure, LobeKey, NodeView, add_closures
from .fresnel import mean_across_fibre
from .terms import RGB, Sum, add, complement, constant, constant_value, is_constant, multiply, scale

_EUMELANIN, _PHEOMELANIN = (0.506, 0.841, 1.653), (0.343, 0.733, 1.924)
"""What melanin absorbs, a fibre's radius (Donner and Jensen 2006)."""
_SMOOTHEST = 0.02
"""Of highlights along a strand."""
_ACROSS = 1.85
"""Radii that light goes within a fibre of an index of about 1.5, on average over its width."""
_FAN = 0.25
"""How far light fans out that passes through a fibre, and that is reflected within
(Lobe.masking).
"""
_TAIL = 3.0
"""Exponent of light that leaves a strand behind in all directions."""
_BEFORE, _FORWARD = 0.7, 0.3
"""Of what a fibre reflects the share before it, and the share that grazes it."""


class _Mass(NamedTuple):
    """What a mass of hair makes of light that goes from strand to strand. Of Cycles' light with 8
    bounces on a ball of fur, from blond to black, seen from four sides.
    """

    within: float  # of what a fibre reflects, what leaves it before it after a way within
    missing: float  # of what passes the clearest fibre, what does not go on straight
    matt: float  # of clear hair, that which comes back out of it, and
    broad: float  # which leaves it on the other side
    onward: float  # what lights strands behind it


_MASSES = {
    "CHIANG": _Mass(2.0, 0.61, 0.17, 0.6, 1.0),
    "HUANG": _Mass(1.2, 0.46, 0.03, 0.48, 0.82),
}
_MISSING_POWER, _MATT_POWER, _BROAD_POWER = 0.5, 0.7, 0.53
"""Of the colour of a mass of hair: light that met fewer strands is less coloured."""
_THROUGH = 0.5
"""The same of what Hair BSDF lets through."""
_ONWARD_ACROSS = 1.4 * _ACROSS
_USUAL_ENTERS = 0.856
"""Of an index of 1.55, for which the masses are."""
_CAUCHY = np.array(
    [
        [0.02, 1637.0, 31.1, 0.22],
        [0.05, 345.0, 12.4, 0.29],
        [0.1, 122.0, 7.8, 0.39],
        [0.2, 49.0, 5.1, 0.55],
        [0.3, 35.0, 4.5, 0.71],
        [0.5, 20.0, 4.4, 1.0],
        [1.0, 20.0, 2.6, 1.0],
    ]
)
"""A row each: half the width of Cauchy's distribution, cut off at a quarter of a circle, and the
exponents of two powers of a cosine and the share of the second that are nearest to it, in the
root mean square of the square roots: within 15 % below 0.05, 9 % above.
"""

_UNUSED = {
    "Coat": 0.0,
    "Offset": 2 * math.pi / 180,
    "Aspect Ratio": 0.85,
    "Random": 0.0,
    "Random Color": 0.0,
    "Random Roughness": 0.0,
}
"""Inputs of Principled Hair that have no effect, and what they are where nobody set them."""


def _note_unused(view: NodeView, usual: dict[str, float]) -> None:
    for name, value in usual.items():
        if not view.input(name):
            continue
        found = view.number(name)
        if not is_constant(found) or abs(constant_value(found)[0] - value) > 1e-4:
            view.note(f"'{name}' of {view.node.bl_label} is not rendered: {{}} go without it")


def _fibre(view: NodeView, kind: str, color: Sum, even: float = 1.0, **exponent) -> Closure:
    """A FIBRE lobe, and what of even light it gives back; even: what its shape does."""
    key = LobeKey(f"FIBRE_{kind}", fibre_output=_tangent_output(view), **exponent)
    return {key: color, LobeKey("AMBIENT"): scale(color, even)}


def _tangent_output(view: NodeView) -> int:
    expressions = view.evaluator.expressions
    along = expressions.graph.apply(BY_NAME["attribute"], attribute=FIBRE, shift=0)[0]
    spaces = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
    told = expressions.apply("transform_vector", along, vector_type=VectorType.VECTOR, **spaces)
    return expressions.output(told)


def _on_strands(view: NodeView, color: Sum) -> Sum:
    """Nothing of what is no strand, which has no thickness."""
    expressions = view.evaluator.expressions
    thickness = expressions.graph.apply(BY_NAME["attribute"], attribute=FIBRE, shift=0)[1]
    is_strand = expressions.math("GREATER_THAN", thickness, 0.0)
    return multiply(color, expressions.sum_of(is_strand))


def _principled_hair(view: NodeView) -> Closure:
    """Reflection R, transmission TT and the light TRT that is reflected within (Marschner et al.
    2003), each as wide as Chiang et al. (2016) have it; and for light from strand to strand what
    goes on straight to strands behind (Zinke et al. 2008), what comes back, and what leaves the
    strand behind in all directions.
    """
    unused = {"Radial Roughness": 0.3} if view.node.parametrization == "COLOR" else {}
    _note_unused(view, _UNUSED | unused)
    view.note(
        "Light from strand to strand is not traced: in {} it goes straight on through strands, and "
        "a matt share stands for the rest"
    )
    model = view.node.model
    mass = _MASSES.get(model, _MASSES["CHIANG"])
    roughness = view.roughness("Roughness", 0.3)
    edge = mean_across_fibre(max(view.constant("IOR", 1.55), 1.0))
    enters = (1 - edge) ** 2
    usual = min(enters / _USUAL_ENTERS, 1.0)
    hair = _Hair(view)
    r, tt, trt = (
        view.factor(name, 1.0) if view.input(name) and model == "HUANG" else constant(1.0)
        for name in ("R lobe", "TT lobe", "TRT lobe")
    )

    def lobe(kind: str, weight: Sum, times: float, **more) -> Closure:
        wide = roughness.exponent(lambda x: 4 / (times * _variance(x)))
        return _fibre(view, kind, weight, **wide, **more)

    straight = complement(scale(hair.colored(_MISSING_POWER), mass.missing))
    passed = add(
        multiply(tt, scale(hair.dimmed(_ACROSS), enters), straight), scale(r, _FORWARD * edge)
    )
    within = multiply(trt, scale(hair.dimmed(2 * _ACROSS), mass.within * edge * usual))
    back, through = (
        scale(hair.colored(power), share * usual**2)
        for power, share in ((_MATT_POWER, mass.matt), (_BROAD_POWER, mass.broad))
    )
    onward = multiply(tt, scale(hair.dimmed(_ONWARD_ACROSS), mass.onward * enters))
    return add_closures(
        lobe("SPECULAR", scale(r, _BEFORE * edge), 1.0),
        lobe("TRANSMISSION", passed, 0.25, masking=_FAN),
        lobe("SPECULAR", within, 4.0, even=0.77, masking=_FAN),
        _fibre(view, "DIFFUSE", back),
        _fibre(view, "TRANSMISSION", through, even=0.53, exponent=_TAIL),
        {LobeKey(PASSED): _on_strands(view, onward)},
    )


def _variance(roughness: float) -> float:
    """Of the sum of both angles off the plane across the tangent (Chiang et al., equation 7)."""
    beta = min(max(roughness, _SMOOTHEST), 1.0)
    return (0.726 * beta + 0.812 * beta**2 + 3.7 * beta**20) ** 2


def _spread(view: NodeView) -> float:
    """By what colour and absorption of a mass of hair differ (Chiang et al., equation 9)."""
    beta = min(max(view.constant("Radial Roughness", 0.3), 0.0), 1.0)
    return (
        5.969 - 0.215 * beta + 2.532 * beta**2 - 10.73 * beta**3 + 5.574 * beta**4 + 0.245 * beta**5
    )


class _Hair:
    """What fibres of a Principled Hair node absorb, by its colour or by itself."""

    def __init__(self, view: NodeView) -> None:
        self._view, self._spread = view, _spread(view)
        self._absorbed = None  # a radius, where it is not the colour that tells
        how = view.node.parametrization
        if how == "ABSORPTION":
            self._absorbed = _constant_vector(view, "Absorption Coefficient", 0.0)
        elif how != "COLOR":
            tint = _constant_vector(view, "Tint", 1.0)
            dyed = ((math.log(min(max(x, 1e-5), 1.0)) / self._spread) ** 2 for x in tint)
            self._absorbed = tuple(map(sum, zip(_melanin(view), dyed, strict=True)))

    def colored(self, power: float) -> Sum:
        """A power of the colour of a mass of such hair."""
        if self._absorbed is not None:
            spread = power * self._spread
            return constant(
                tuple(math.exp(-math.sqrt(max(x, 0.0)) * spread) for x in self._absorbed)
            )
        return self._of_color(lambda x: x**power, lambda do, x: do("POWER", x, power))

    def dimmed(self, radii: float) -> Sum:
        """What of light is left after a way within."""
        if self._absorbed is not None:
            return constant(tuple(math.exp(-radii * max(x, 0.0)) for x in self._absorbed))
        spread = self._spread

        def varying(do: Callable[..., Value], x: Value) -> Value:
            told = do("DIVIDE", do("LOGARITHM", x, math.e), spread)
            return do("EXPONENT", do("MULTIPLY", do("MULTIPLY", told, told), -radii))

        return self._of_color(lambda x: math.exp(-radii * (math.log(x) / spread) ** 2), varying)

    def _of_color(
        self,
        of: Callable[[float], float],
        varying: Callable[[Callable[..., Value], Value], Value],
    ) -> Sum:
        """A function of each channel of the colour, kept from 1e-5 to 1; of: of one number.
        varying: the same of a program's value, of `Expressions.math`.
        """
        color = self._view.color("Color")
        if is_constant(color):
            return constant(tuple(of(min(max(x, 1e-5), 1.0)) for x in constant_value(color)))
        expressions = self._view.evaluator.expressions
        do = expressions.math
        parts = expressions.parts(expressions.bounded(expressions.value_of(color), 1e-5, 1.0))
        parts = [varying(do, x) for x in parts]
        return expressions.sum_of(expressions.apply("combine_xyz", *parts))


def _constant_vector(view: NodeView, name: str, otherwise: float) -> RGB:
    found = view.vector(name) if view.input(name) else None
    if found is None:
        view.note(f"'{name}' of hair varies in {{}}: it counts as {otherwise:g}")
    return found or (otherwise,) * 3


def _melanin(view: NodeView) -> RGB:
    """What it absorbs."""
    amount = min(max(view.constant("Melanin", 0.8), 0.0), 1.0)
    redness = min(max(view.constant("Melanin Redness", 1.0), 0.0), 1.0)
    amount = -math.log(max(1.0 - amount, 1e-4))
    return tuple(
        amount * ((1 - redness) * eu + redness * pheo)
        for eu, pheo in zip(_EUMELANIN, _PHEOMELANIN, strict=True)
    )


def _hair(view: NodeView) -> Closure:
    """Cycles' light falls off along the strand as Cauchy's distribution does; round it a reflection
    does as a cosine, what passes through as Cauchy's again.
    """
    _note_unused(view, {"Offset": 0.0})
    color, along = view.reflectance("Color"), view.roughness("RoughnessU", 0.1)
    across = min(max(view.constant("RoughnessV", 1.0), 0.05), 1.0)
    if view.node.component == "Transmission":
        kind, power = "TRANSMISSION", 1 + (0.26 + across / 4) * 4 / across**2
    else:
        kind, power = "SPECULAR", 1 + 1 / (2 * across**2)
        # as bright in front
        color = scale(color, min(math.sqrt(8 * math.pi / (2 * power + 0.5)) / (4 * across), 1.0))
    fan = {"masking": 1 / power}
    share = along.number(lambda r: _cauchy(r, 3))
    passes = view.node.component == "Transmission"
    return add_closures(
        {LobeKey(PASSED): _on_strands(view, scale(color, _THROUGH))} if passes else {},
        *(
            _fibre(view, kind, part, **fan, **along.exponent(functools.partial(_cauchy, column=n)))
            for n, part in ((1, multiply(color, complement(share))), (2, multiply(color, share)))
        ),
    )


def _cauchy(width: float, column: int) -> float:
    """Of the table, between its rows."""
    return float(
        np.interp(math.log(max(width, _SMOOTHEST)), np.log(_CAUCHY[:, 0]), _CAUCHY[:, column])
    )


CLOSURE_NODES.update(
    {"ShaderNodeBsdfHairPrincipled": _principled_hair, "ShaderNodeBsdfHair": _hair}
)
