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
from ....engine.scene import Lobe
from ..shader_nodes.reader import FIBRE, HAIR
from .closures import Closure, LobeKey, add_closures
from .evaluator import CLOSURE_NODES, NodeView
from .fresnel import mean_across_fibre
from .terms import RGB, Sum, add, complement, constant, constant_value, is_constant, multiply, scale
from .varying import Roughness

_EUMELANIN, _PHEOMELANIN = (0.506, 0.841, 1.653), (0.343, 0.733, 1.924)
"""What melanin absorbs, a fibre's radius (Donner and Jensen 2006)."""
_SMOOTHEST = 0.02
"""Of highlights along a strand."""
_ACROSS = 1.85
"""Radii that light goes within a fibre of an index of about 1.5, on average over its width."""
_STEEPEST = 0.3
"""Radians that scales lean at most: lobes lean up to twice as far."""
_TAIL = 3.0
"""Exponent of light that leaves a strand behind in all directions."""


class _Model(NamedTuple):
    """What one strand of a model of Principled Hair makes of light, as Cycles' direct light shows
    it (docs/decisions/0047-hair-lobes.md).
    """

    before: float  # of what Fresnel reflects, what leaves the strand before it
    within: float  # the same after a way within
    straight: float  # of what passes, what goes on straight
    wide: float  # the variance of that, of the reflection's
    fan: float  # and how far it fans out (Lobe.masking)
    behind: float  # what passes and leaves in all directions
    matt: float  # what comes back in all directions
    # How far reflections, what goes straight on and what is reflected within lean along a strand
    # whose scales tilt by 1.
    leans: tuple[float, float, float]


_MODELS = {
    "CHIANG": _Model(
        0.72,
        1.65,
        0.98,
        0.42,
        0.16,
        0.03,
        0.0,
        (1.0, -0.5, -2.0),
    ),
    "HUANG": _Model(
        0.58,
        0.0,
        0.745,
        1.0,
        0.09,
        0.123,
        0.056,
        (0.5, 0.0, 0.0),
    ),
}
_WITHIN_FAN = 0.25
_FORWARD = 0.3
"""Of what Fresnel reflects, what grazes the strand and goes on before the light."""
_GIVEN = (
    (0.0, 0.222),
    (1.0, 0.369),
    (3.0, 0.522),
    (10.0, 0.734),
    (30.0, 0.886),
    (100.0, 0.96),
    (1e4, 1.0),
)
"""Of even light, what a lobe of an exponent gives back of what it is meant to, seen from across."""
_USUAL_ENTERS, _USUAL_ROUGHNESS = 0.856, 0.3
"""Of an index of 1.55, for which lobes are."""
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

_USUAL_ASPECT = 0.85
_FLAT = (
    (0.2, 0.33, 0.72),
    (0.4, 0.41, 0.78),
    (0.6, 0.65, 0.87),
    (_USUAL_ASPECT, 1.0, 1.0),
    (1.0, 1.22, 1.09),
)
"""Ratios of the axes of Huang's elliptic strands; of light that was within them, what comes back
and what goes on, of what does with the usual one, over all turns of the ellipse: Cycles' means of
few strands in direct light, the latter from behind.
"""


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
    """The tangent, as long as the strand is thick."""
    expressions = view.evaluator.expressions
    along, thickness = expressions.graph.apply(BY_NAME["attribute"], attribute=FIBRE, shift=0)[:2]
    along = expressions.apply("scaled_sum", along, thickness, expressions.constant((0.0, 0.0, 0.0)))
    spaces = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
    told = expressions.apply("transform_vector", along, vector_type=VectorType.VECTOR, **spaces)
    return expressions.output(told)


def _principled_hair(view: NodeView) -> Closure:
    """Reflection R, transmission TT and the light TRT that is reflected within (Marschner et al.
    2003), each as wide as Chiang et al. (2016) have it, and what leaves a strand in all directions.
    """
    _note_limits(view)
    model = _MODELS.get(view.node.model, _MODELS["CHIANG"])
    roughness = _roughness(view)
    coat = view.constant("Coat", 0.0) if view.node.model == "CHIANG" else 0.0
    smoother = 1 - min(max(coat, 0.0), 1.0)
    returns, goes_on = _of_ellipse(view)
    tilt = min(max(view.constant("Offset", 2 * math.pi / 180), -_STEEPEST), _STEEPEST)
    edge = mean_across_fibre(max(view.constant("IOR", 1.55), 1.0))
    enters = (1 - edge) ** 2
    usual = min(enters / _USUAL_ENTERS, 1.0)
    hair = _Hair(view)
    r, tt, trt = (
        view.factor(name, 1.0) if view.input(name) and view.node.model == "HUANG" else constant(1.0)
        for name in ("R lobe", "TT lobe", "TRT lobe")
    )

    def lobe(
        kind: str, weight: Sum, times: float, leans: float, coat: float = 1.0, **more
    ) -> Closure:
        """times: its variance, of the reflection's.  leans: as far as scales, so many times.
        coat: of the roughness, what one leaves.
        """
        more |= {"ior": Lobe.leaning(math.tan(leans * tilt))}

        def exponent(x: float) -> float:
            return 4 / (times * _variance(coat * x))

        usually = _given(exponent(_USUAL_ROUGHNESS))
        lost = roughness.number(lambda x: usually / _given(exponent(x)))
        return _fibre(view, kind, multiply(weight, lost), **roughness.exponent(exponent), **more)

    passes, within = (hair.dimmed(radii) for radii in (_ACROSS, 2 * _ACROSS))
    passes = multiply(tt, scale(passes, enters))
    straight = add(scale(passes, goes_on * model.straight), scale(r, _FORWARD * edge))
    reflected = multiply(trt, scale(within, returns * model.within * edge * usual))
    return add_closures(
        lobe("SPECULAR", scale(r, model.before * edge), 1.0, model.leans[0], smoother),
        lobe("TRANSMISSION", straight, model.wide, model.leans[1], masking=model.fan),
        lobe("SPECULAR", reflected, 4.0, model.leans[2], even=0.77, masking=_WITHIN_FAN),
        _fibre(view, "DIFFUSE", multiply(trt, scale(within, returns * model.matt))),
        _fibre(view, "TRANSMISSION", scale(passes, model.behind), even=0.53, exponent=_TAIL),
    )


def _note_limits(view: NodeView) -> None:
    """Inputs without effect."""
    how = view.node.parametrization
    unused = {"Radial Roughness": 0.3} if how == "COLOR" else {}
    if how in ("COLOR", "ABSORPTION"):  # that tell all of it
        unused |= {"Random": 0.0, "Random Color": 0.0}
    _note_unused(view, unused)


def _of_ellipse(view: NodeView) -> tuple[float, float]:
    """Of light that was within elliptic strands what comes back and what goes on, of what does with
    the usual axes.
    """
    if view.node.model != "HUANG" or not view.input("Aspect Ratio"):
        return 1.0, 1.0
    ratio = view.constant("Aspect Ratio", _USUAL_ASPECT)
    if abs(ratio - _USUAL_ASPECT) > 1e-4:
        view.note(
            "'Aspect Ratio' of Principled Hair: {} has the light of all turns of its strands' "
            "ellipses, whichever way these lie"
        )
    ratios, returns, goes_on = zip(*_FLAT, strict=True)
    return float(np.interp(ratio, ratios, returns)), float(np.interp(ratio, ratios, goes_on))


def _given(exponent: float) -> float:
    """Of `_GIVEN`, between its rows."""
    exponents, shares = zip(*_GIVEN, strict=True)
    return float(np.interp(math.log1p(exponent), np.log1p(exponents), shares))


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
        kind, power = "SPECULAR", 1 + 1 / (2 * across**2)
        # as bright in front
        color = scale(color, min(math.sqrt(8 * math.pi / (2 * power + 0.5)) / (4 * across), 1.0))
    fan = {"masking": 1 / power, "ior": Lobe.leaning(math.tan(tilt))}
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
