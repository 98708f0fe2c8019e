"""The shaders of hair as FIBRE lobes (semantics/lobes.md) round a strand's tangent. What is no
strand has no tangent and shows them as matt, under a highlight.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_input import Space, VectorType
from ....engine.program.operations_vector import VectorMeasure, VectorOperation
from ....engine.program.table import BY_NAME
from ..shader_nodes.reader import FIBRE, HAIR
from .closures import Closure, LobeKey, add_closures
from .evaluator import CLOSURE_NODES, NodeView
from .fibre_optics import Way, slanted, ways
from .terms import RGB, Sum, complement, constant, constant_value, is_constant, multiply, scale
from .varying import Roughness

_EUMELANIN, _PHEOMELANIN = (0.506, 0.841, 1.653), (0.343, 0.733, 1.924)
"""What melanin absorbs, a fibre's radius (Donner and Jensen 2006)."""
_SMOOTHEST = 0.02
"""Of highlights along a strand."""
_NARROWEST = 0.01
"""Radians, of the standard deviation along a strand."""
_USUAL_ASPECT = 0.85
_STEEPEST = 0.3
"""Radians that scales lean at most: lobes lean up to twice as far."""
_VARIANCES = (1.0, 0.25, 4.0)
"""Along a strand, of R, TT and TRT in Chiang's model, of `_variance`."""
_LEANS = {"CHIANG": (1.0, -0.5, -2.0), "HUANG": (0.5, 0.0, 0.0)}
"""How far R, TT and TRT lean along a strand whose scales tilt by 1."""
_HUANG = np.array(
    [
        [0.0, 1.0, 1.0, 1.0, -0.07, -0.86, 0.97, 0.0, 0.0, 0.0],
        [0.05, 0.93, 0.984, 0.996, 0.001, -0.873, 0.831, 0.105, 0.074, 0.242],
        [0.1, 0.942, 0.939, 0.913, -0.01, -0.887, 0.805, 0.2, 0.13, 0.35],
        [0.2, 0.847, 0.872, 1.074, 0.069, -0.904, 0.63, 0.328, 0.203, 0.438],
        [0.3, 0.75, 0.838, 1.313, 0.147, -0.915, 0.469, 0.404, 0.25, 0.49],
        [0.45, 0.627, 0.82, 1.688, 0.23, -0.928, 0.313, 0.49, 0.289, 0.556],
        [0.6, 0.527, 0.832, 1.999, 0.287, -0.936, 0.21, 0.556, 0.308, 0.613],
        [0.8, 0.423, 0.865, 2.189, 0.34, -0.94, 0.114, 0.632, 0.323, 0.664],
        [1.0, 0.345, 0.904, 2.254, 0.376, -0.939, 0.035, 0.719, 0.328, 0.696],
    ]
)
"""Roughness of Huang's model (Huang, Hullin, Hanika 2022), and of R, TT and TRT how much there is,
of what a smooth strand has, the mean cosine round the strand, and the standard deviation along it,
in radians: measured on Cycles' pictures of one round strand (tests/bench/strand.py).
"""
_FLAT = np.array(
    [
        [0.2, 0.691, 0.614, 1.574, -0.024, -0.04, -0.636],
        [0.4, 0.694, 0.613, 2.3, 0.042, -0.029, -0.614],
        [0.6, 0.761, 0.721, 1.773, 0.053, -0.017, -0.251],
        [0.85, 0.89, 0.913, 1.035, 0.033, -0.004, -0.008],
        [1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
    ]
)
"""Ratios of the axes of Huang's elliptic strands, and of R, TT and TRT how much there is, of what a
round one has, and what is added to the mean cosine: the same, over all turns of the ellipse.
"""
_CAUCHY = np.array(
    [
        [0.02, 1886.0, 45.7, 0.25],
        [0.05, 388.0, 17.7, 0.3],
        [0.1, 136.0, 11.8, 0.4],
        [0.2, 56.1, 7.8, 0.55],
        [0.3, 29.5, 2.0, 0.55],
        [0.5, 31.6, 1.2, 0.85],
        [1.0, 0.3, 0.3, 1.0],
    ]
)
"""A row each: half the width of Cauchy's distribution of half angles, cut off at a quarter of a
circle, and the exponents of two lobes and the share of the second that are nearest to it, seen from
across, over the root of the cosine off the plane across the strand, in the root mean square of the
square roots (tests/bench/strand.py).
"""


def _note_unused(view: NodeView, usual: dict[str, float]) -> None:
    for name, value in usual.items():
        if not view.input(name):
            continue
        found = view.number(name)
        if not is_constant(found) or abs(constant_value(found)[0] - value) > 1e-4:
            view.note(f"'{name}' of {view.node.bl_label} is not rendered: {{}} go without it")


def _fibre(view: NodeView, kind: str, color: Sum, **exponent) -> Closure:
    """A FIBRE lobe, and what of even light it gives back."""
    key = LobeKey(f"FIBRE_{kind}", fibre_output=_tangent_output(view), **exponent)
    return {key: color, LobeKey("AMBIENT"): color}


def _tangent_output(view: NodeView) -> int:
    """The tangent, as long as the strand is thick."""
    return view.evaluator.expressions.output(_tangent(view))


def _tangent(view: NodeView) -> Value:
    expressions = view.evaluator.expressions
    along, thickness = expressions.graph.apply(BY_NAME["attribute"], attribute=FIBRE, shift=0)[:2]
    along = expressions.apply("scaled_sum", along, thickness, expressions.constant((0.0, 0.0, 0.0)))
    spaces = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
    return expressions.apply("transform_vector", along, vector_type=VectorType.VECTOR, **spaces)


def _principled_hair(view: NodeView) -> Closure:
    """Reflection R, transmission TT and the light TRT that is reflected within (Marschner et al.
    2003), each in lobes that aim where it goes round the strand, as wide as it is along it.
    """
    if view.node.parametrization in ("COLOR", "ABSORPTION"):  # that tell all of it
        _note_unused(view, {"Random": 0.0, "Random Color": 0.0})
    roughness, hair = _roughness(view), _Hair(view)
    tilt = min(max(view.constant("Offset", 2 * math.pi / 180), -_STEEPEST), _STEEPEST)
    leans = _LEANS.get(view.node.model, _LEANS["CHIANG"])
    of = _of_huang if view.node.model == "HUANG" else _of_chiang
    lobes, slant, ior = [], _slant(view), max(view.constant("IOR", 1.55), 1.0)
    for number, (way, weight, variance) in enumerate(of(view, roughness, ior)):
        lean = leans[number]
        aside = slant.number(lambda sine, k=number: slanted(ior, sine)[k])
        color = multiply(multiply(weight, aside), scale(hair.dimmed(way.radii), way.amount))
        more = roughness.exponent(lambda x, variance=variance: 4 / variance(x))
        more["tilt"] = math.tan(lean * tilt)
        lobes += [
            _fibre(
                view,
                "TRANSMISSION" if behind else "SPECULAR",
                scale(color, share),
                fan=fan,
                **more,
            )
            for behind, share, fan in way.shares()
        ]
    return add_closures(*lobes)


def _slant(view: NodeView) -> Roughness:
    """The sine of the angle by which the view leaves the plane across the strand."""
    expressions = view.evaluator.expressions
    zero, normalize = expressions.constant((0.0, 0.0, 0.0)), VectorOperation.NORMALIZE
    one = expressions.constant(1.0)
    way = expressions.apply("vector_math", _tangent(view), zero, zero, one, operation=normalize)
    along = expressions.apply(
        "vector_measure", way, expressions.apply("incoming"), measure=VectorMeasure.DOT_PRODUCT
    )
    return Roughness(expressions.math("ABSOLUTE", along), expressions)


_Told = list[tuple[Way, Sum, Callable[[float], float]]]
"""Of R, TT and TRT: what the amount is times, and the variance along a strand by its roughness."""


def _of_chiang(view: NodeView, roughness: Roughness, ior: float) -> _Told:
    smoother = 1 - min(max(view.constant("Coat", 0.0), 0.0), 1.0)
    found = ways(ior, view.constant("Radial Roughness", 0.3))
    return [
        (way, constant(1.0), lambda x, coat=coat, times=times: times * _variance(coat * x))
        for way, coat, times in zip(found, (smoother, 1.0, 1.0), _VARIANCES, strict=True)
    ]


def _of_huang(view: NodeView, roughness: Roughness, ior: float) -> _Told:
    ratio = view.constant("Aspect Ratio", _USUAL_ASPECT)
    usual = view.evaluator.mean(view.number("Roughness", 0.3))[0]  # where lobes aim does not vary
    if abs(ratio - _USUAL_ASPECT) > 1e-4:
        view.note(
            "'Aspect Ratio' of Principled Hair: {} has the light of all turns of its strands' "
            "ellipses, whichever way these lie"
        )
    told = []
    for number, way in enumerate(ways(ior, 0.0)):
        amount, aim, width = (
            functools.partial(_between, _HUANG, column=column + number) for column in (1, 4, 7)
        )
        aims = aim(usual) + _between(_FLAT, ratio, 4 + number)
        way = Way(way.amount * _between(_FLAT, ratio, 1 + number), way.radii, aims)
        name = ("R lobe", "TT lobe", "TRT lobe")[number]
        tint = view.factor(name, 1.0) if view.input(name) else constant(1.0)
        told.append(
            (way, multiply(tint, roughness.number(amount)), functools.partial(_square, width))
        )
    return told


def _between(table: np.ndarray, x: float, column: int) -> float:
    return float(np.interp(x, table[:, 0], table[:, column]))


def _square(of: Callable[[float], float], x: float) -> float:
    return max(of(x), _NARROWEST) ** 2


def _variance(roughness: float) -> float:
    """Of the sum of both angles off the plane across the tangent (Chiang et al., equation 7)."""
    beta = min(max(roughness, _SMOOTHEST), 1.0)
    return (0.726 * beta + 0.812 * beta**2 + 3.7 * beta**20) ** 2


def _roughness(view: NodeView) -> Roughness:
    """Another one for each strand where Random Roughness says so."""
    found, apart = view.roughness("Roughness", 0.3), view.constant("Random Roughness", 0.0)
    if apart == 0 or not view.input("Random Roughness"):
        return found
    expressions = view.evaluator.expressions
    off = expressions.math("MULTIPLY_ADD", _random(view), 2 * apart, 1 - apart)
    return Roughness(expressions.math("MULTIPLY", off, found.value), expressions)


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
        self._melanin: tuple[Value, RGB, RGB] | None = None  # how much, of what, and the dye
        how = view.node.parametrization
        if how == "ABSORPTION":
            self._absorbed = _constant_vector(view, "Absorption Coefficient", 0.0)
        elif how != "COLOR":
            tint = _constant_vector(view, "Tint", 1.0)
            dye = tuple((math.log(min(max(x, 1e-5), 1.0)) / self._spread) ** 2 for x in tint)
            amount, pigment = _melanin(view), _pigment(view)
            if isinstance(amount, Value):
                self._melanin = amount, pigment, dye
            else:
                told = zip(pigment, dye, strict=True)
                self._absorbed = tuple(amount * each + dyed for each, dyed in told)

    def dimmed(self, radii: float) -> Sum:
        """What of light is left after a way within."""
        if self._absorbed is not None:
            return constant(tuple(math.exp(-radii * max(x, 0.0)) for x in self._absorbed))
        if self._melanin is not None:
            return self._dimmed_by_melanin(radii, *self._melanin)
        spread = self._spread

        def varying(do: Callable[..., Value], x: Value) -> Value:
            told = do("DIVIDE", do("LOGARITHM", x, math.e), spread)
            return do("EXPONENT", do("MULTIPLY", do("MULTIPLY", told, told), -radii))

        return self._of_color(lambda x: math.exp(-radii * (math.log(x) / spread) ** 2), varying)

    def _dimmed_by_melanin(self, radii: float, amount: Value, pigment: RGB, dye: RGB) -> Sum:
        expressions = self._view.evaluator.expressions
        do = expressions.math
        parts = [
            do("EXPONENT", do("MULTIPLY_ADD", amount, -radii * each, -radii * dyed))
            for each, dyed in zip(pigment, dye, strict=True)
        ]
        return expressions.sum_of(expressions.apply("combine_xyz", *parts))

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


def _pigment(view: NodeView) -> RGB:
    """What as much melanin as 1 absorbs."""
    redness = min(max(view.constant("Melanin Redness", 1.0), 0.0), 1.0)
    return tuple(
        (1 - redness) * eu + redness * pheo
        for eu, pheo in zip(_EUMELANIN, _PHEOMELANIN, strict=True)
    )


def _melanin(view: NodeView) -> float | Value:
    """How much there is, at least 0. Where it varies, or from strand to strand by Random Color, a
    program's number.
    """
    given, apart = view.number("Melanin", 0.8), view.constant("Random Color", 0.0)
    if is_constant(given) and apart == 0:
        share = min(max(constant_value(given)[0], 0.0), 1.0)
        return -math.log(max(1.0 - share, 1e-4))
    expressions = view.evaluator.expressions
    do = expressions.math
    share = expressions.parts(expressions.value_of(given))[0]
    if apart != 0:
        off = do("MULTIPLY_ADD", _random(view), 2 * apart, 1 - apart)
        share = do("MULTIPLY", share, off)
    left = do("MAXIMUM", do("SUBTRACT", 1.0, share), 1e-4)
    return do("MAXIMUM", do("MULTIPLY", do("LOGARITHM", left, math.e), -1.0), 0.0)


def _random(view: NodeView) -> Value:
    """A number from 0 to 1: what Random gets, or the strand's own."""
    expressions, place = view.evaluator.expressions, view.input("Random")
    if place is not None and place.socket.is_linked:
        return expressions.parts(expressions.value_of(view.number("Random")))[0]
    told = expressions.graph.apply(BY_NAME["attribute"], attribute=HAIR, shift=0)[0]
    return expressions.parts(told)[2]


def _hair(view: NodeView) -> Closure:
    """Cycles' light falls off along the strand as Cauchy's distribution does; round it a reflection
    does as a cosine, what passes through as Cauchy's again.
    """
    tilt = min(max(view.constant("Offset", 0.0), -2 * _STEEPEST), 2 * _STEEPEST)
    color, along = view.reflectance("Color"), view.roughness("RoughnessU", 0.1)
    across = min(max(view.constant("RoughnessV", 1.0), 0.05), 1.0)
    if view.node.component == "Transmission":
        kind, power = "TRANSMISSION", 1 + (0.26 + across / 4) * 4 / across**2
    else:
        kind, power = "SPECULAR", 1.5 + 1 / (2 * across**2)  # it ends at a quarter turn
        # as bright in front
        color = scale(color, min(math.sqrt(8 * math.pi / (2 * power + 0.5)) / (4 * across), 1.0))
    fan = {"fan": 1 / power, "tilt": math.tan(tilt)}
    share = along.number(lambda r: _cauchy(r, 3))
    return add_closures(
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
