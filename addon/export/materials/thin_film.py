"""Films so thin that what their two sides reflect interferes: soap, oil, coated lenses.

The reflectance of a film on a dielectric is Airy's sum, integrated over the visible spectrum for
the working space (Belcour, Barla 2017), here at n·v. Letters: c1 cosine in air, c2 in the film, c3
below it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_vector import VectorMeasure
from ....engine.program.table import BY_NAME
from ..images.colorspace import rgb_from_xyz, working_space
from ..shader_nodes.spectra import WAVELENGTHS, matching
from .evaluator import NodeView
from .expressions import Expressions
from .fresnel import EDGE_COSINE, EDGE_WEIGHT, schlick
from .terms import RGB, Sum, complement, constant_value, is_constant, multiply, scale
from .varying import Ior

Array = np.ndarray
LEAST = 0.1 + 1e-7
"""Nanometres of a thickness, as in Cycles."""
THICKEST = 2e4
"""Nanometres, from which on colours are those without interference."""
ROWS, LONGEST, ORDERS = 1024, 12000.0, 3
"""Of tables; the path through a film and back, in nanometres, beyond which nothing interferes; and
how often light goes to and fro.
"""


def _weights() -> Array:
    """(3, m) of wavelengths in red, green and blue, whose sums are 1."""
    return _weights_of(working_space())


@lru_cache(maxsize=2)
def _weights_of(space: str) -> Array:
    rgb = rgb_from_xyz() @ matching().T
    return rgb / rgb.sum(1, keepdims=True)


def interference(path: Array) -> Array:
    """(n, 3) the mean of cos(2π path / wavelength) over each channel's light, for paths (n,)."""
    return np.cos(2 * np.pi * np.asarray(path)[:, None] / WAVELENGTHS) @ _weights().T


def reflectance(cosine: Array, thickness: float, film: float, ior: float) -> Array:
    """(n, 3) of light in air at cosines (n,), by a film of that index on what has the index ior;
    1 where it is reflected totally. thickness: nanometres, infinite for no interference.
    """
    thickness = thickness if thickness < THICKEST else np.inf
    c1 = np.asarray(cosine, np.float64)
    c2, c3 = (np.sqrt(np.maximum(1 - (1 - c1 * c1) / n**2, 0.0)) for n in (film, ior))
    total = np.zeros((len(c1), len(WAVELENGTHS)))
    phase = 0.0 if np.isinf(thickness) else 4 * np.pi * film * thickness
    wave = np.cos(phase * c2[:, None] / WAVELENGTHS)
    for r12, r23 in _amplitudes(c1, c2, c3, film, ior):
        a, b = r12[:, None], r23[:, None]
        if np.isinf(thickness):
            total += a * a + (1 - a * a) ** 2 * b * b / (1 - a * a * b * b + 1e-300)
            continue
        below = 1 + a * a * b * b + 2 * a * b * wave
        total += (a * a + b * b + 2 * a * b * wave) / np.where(below > 0, below, 1.0)
    found = np.clip(total / 2 @ _weights().T, 0.0, 1.0)
    return np.where(((c2 > 0) & (c3 > 0))[:, None], found, 1.0)


@dataclass(frozen=True)
class Metal:
    """Index and extinction in red, green and blue, and the reflectance at 82 degrees of metals that
    have F82's model.
    """

    index: RGB
    extinction: RGB
    edge: RGB | None = None

    @staticmethod
    def of(f0: RGB, edge: RGB) -> Metal:
        """As Cycles guesses it of a colour (Gulbrandsen 2014, Artist friendly metallic Fresnel)."""
        r, g = np.minimum(f0, 0.999), np.asarray(edge)
        root = np.sqrt(r)
        n = (1 - g) * (1 + root) / (1 - root) + g * (1 - r) / (1 + r)
        k = np.sqrt(np.maximum((r * (n + 1) ** 2 - (n - 1) ** 2) / (1 - r), 0.0))
        return Metal(tuple(n), tuple(k), edge)


def metal_reflectance(cosine: Array, thickness: float, film: float, metal: Metal) -> Array:
    """`reflectance` of a film on a metal."""
    c1 = np.asarray(cosine, np.float64)
    c2 = np.sqrt(np.maximum(1 - (1 - c1 * c1) / film**2, 0.0))
    wave = np.exp(4j * np.pi * film * min(thickness, THICKEST) * c2[:, None] / WAVELENGTHS)
    found = []
    for channel, weights in enumerate(_weights()):
        n = complex(metal.index[channel], metal.extinction[channel])
        c3 = np.sqrt(1 - (film / n) ** 2 * (1 - c2 * c2))
        total = np.zeros((len(c1), len(WAVELENGTHS)))
        for r12, r23 in _amplitudes(c1, c2, c3, film, n):
            if metal.edge is not None:
                f0 = abs((n / film - 1) / (n / film + 1)) ** 2
                r23 = np.sqrt(_f82(c2, f0, metal.edge[channel])) * np.exp(1j * np.angle(r23))
            a, b = r12[:, None], r23[:, None] * wave
            total += np.abs((a + b) / (1 + a * b + 1e-12)) ** 2
        found.append(total / 2 @ weights)
    return np.clip(np.stack(found, 1), 0.0, 1.0)


def _f82(cosine: Array, f0: float, edge: float) -> Array:
    lack = schlick(f0, EDGE_COSINE) - edge
    weight = EDGE_WEIGHT * cosine * (1 - cosine) ** 6
    return np.clip(f0 + (1 - f0) * (1 - cosine) ** 5 - lack * weight, 0.0, 1.0)


def _amplitudes(c1: Array, c2: Array, c3: Array, film: float, ior: complex) -> tuple:
    """Fresnel's, above and below the film, of light across the plane of incidence and in it."""
    pairs = ((c1, film * c2), (film * c2, ior * c3)), ((film * c1, c2), (ior * c2, film * c3))
    return tuple(
        tuple((x - y) / np.where(x + y != 0, x + y, 1.0) for x, y in pair) for pair in pairs
    )


@dataclass(frozen=True, eq=False)
class Film:
    """The film of a node, as values of its program. reflected: of white light, by the view, as a
    sum. is_glass: it is seen from below too, where it is thinner by the index, as in Cycles.
    """

    view: NodeView
    thickness: float | Value
    film: float
    ior: float
    is_glass: bool

    @property
    def varies(self) -> bool:
        return isinstance(self.thickness, Value)

    @cached_property
    def reflected(self) -> Sum:
        expressions = self.view.evaluator.expressions
        do, apply = expressions.math, expressions.apply
        shadow = expressions.graph.apply(BY_NAME["light_path"])[1]
        below = do("MULTIPLY", apply("backfacing"), do("SUBTRACT", 1.0, shadow))
        below = below if self.is_glass else expressions.constant(0.0)
        cosine = self._cosine(expressions, below)
        make = self._varied if self.varies else self._ramps
        return expressions.sum_of(make(expressions, cosine, below))

    @cached_property
    def mean(self) -> RGB:
        """Over even light; without interference where the thickness varies."""
        c = (np.arange(512) + 0.5) / 512
        thickness = np.inf if self.varies else self.thickness
        found = (2 * c[:, None] * self.colors(c, thickness)).mean(0)
        return tuple(float(x) for x in found)

    def colors(self, cosine: Array, thickness: float) -> Array:
        """(n, 3) at cosines in air."""
        return reflectance(cosine, thickness, self.film, self.ior)

    def tinted(self, tint: Sum) -> Sum:
        """With a tint of what it reflects at F0, as Cycles has it: of less the nearer to 1."""
        f0 = ((self.ior - 1) / (self.ior + 1)) ** 2
        lack = complement(tint)
        if not lack or f0 < 1e-5:
            return self.reflected
        share = self.view.evaluator.clamped(
            scale(complement(self.reflected), 1 / (1 - f0)), 0.0, 1.0
        )
        return multiply(self.reflected, complement(multiply(lack, share)))

    def largest(self, color: Sum) -> Sum:
        """The largest channel, by which what lies below is dimmed."""
        expressions = self.view.evaluator.expressions
        do = expressions.math
        red, green, blue = expressions.parts(expressions.value_of(color))
        return expressions.sum_of(do("MAXIMUM", do("MAXIMUM", red, green), blue))

    def _cosine(self, expressions: Expressions, below: Value) -> Value:
        """In air. below: 1 of views from there; rays to lights pass straight."""
        do, apply = expressions.math, expressions.apply
        normal = self.view.evaluator.normal_at(self.view.input("Normal"))
        seen = apply("vector_measure", apply("incoming"), normal, measure=VectorMeasure.DOT_PRODUCT)
        sine2 = do("MAXIMUM", do("SUBTRACT", 1.0, do("MULTIPLY", seen, seen)), 0.0)
        wider = do("MULTIPLY_ADD", below, self.ior**2 - 1, 1.0)
        rest = do("SUBTRACT", 1.0, do("MULTIPLY", sine2, wider))
        return do("SQRT", do("MAXIMUM", rest, 0.0))

    def _ramps(self, expressions: Expressions, cosine: Value, below: Value) -> Value:
        do, places = expressions.apply, np.linspace(0, 1, ROWS)

        def seen(thickness: float) -> Value:
            table = self.colors(places, thickness)
            return do("ramp", cosine, interpolates=1, table=_rows(table))

        above = seen(self.thickness)
        if not self.is_glass:
            return above
        share, black = expressions.math("SUBTRACT", 1.0, below), expressions.constant((0.0,) * 3)
        inner = do("scaled_sum", seen(self.thickness / self.ior), below, black)
        return do("scaled_sum", above, share, inner)

    def _varied(self, expressions: Expressions, c1: Value, below: Value) -> Value:
        """Airy's sum, some terms of it."""
        do, film, ior = expressions.math, self.film, self.ior
        thickness = do("MULTIPLY", self.thickness, do("MULTIPLY_ADD", below, 1 / self.ior - 1, 1.0))
        sine2 = do("SUBTRACT", 1.0, do("MULTIPLY", c1, c1))

        def inside(n: float) -> Value:
            rest = do("SUBTRACT", 1.0, do("DIVIDE", sine2, n * n))
            return do("SQRT", do("MAXIMUM", rest, 0.0))

        def amplitude(x: Value, y: Value) -> Value:
            return do("DIVIDE", do("SUBTRACT", x, y), do("ADD", x, y))

        c2, c3 = inside(film), inside(ior)
        outer, inner, both = (do("MULTIPLY", a, b) for a, b in ((c2, film), (c3, ior), (c1, film)))
        pairs = (
            (amplitude(c1, outer), amplitude(outer, inner)),
            (amplitude(both, c2), amplitude(do("MULTIPLY", c2, ior), do("MULTIPLY", c3, film))),
        )
        always: Value | float = 0.0
        orders: list[Value | float] = [0.0] * ORDERS
        for r12, r23 in pairs:
            once, inner2 = do("MULTIPLY", r12, r12), do("MULTIPLY", r23, r23)
            through = do("SUBTRACT", 1.0, once)
            rest = do("SUBTRACT", 1.0, do("MULTIPLY", once, inner2))
            again = do("DIVIDE", do("MULTIPLY", do("MULTIPLY", through, through), inner2), rest)
            always = do("ADD", always, do("ADD", once, again))
            turned = do("MULTIPLY", do("MULTIPLY", r12, -1.0), r23)
            power = do("SUBTRACT", again, through)
            for k in range(ORDERS):
                power = do("MULTIPLY", power, turned)
                orders[k] = do("ADD", orders[k], power)
        path = do("MULTIPLY", do("MULTIPLY", c2, thickness), 2 * film / LONGEST)
        color = expressions.vector(do("MULTIPLY", always, 0.5))
        table = _rows(interference(np.linspace(0, LONGEST, 2 * ROWS)))
        for k, size in enumerate(orders):
            place = do("MINIMUM", do("MULTIPLY", path, k + 1.0), 1.0)
            seen = expressions.apply("ramp", place, interpolates=1, table=table)
            color = expressions.apply("scaled_sum", seen, size, color)
        # beyond the angle of total reflection all comes back
        grazing = do("LESS_THAN", do("MINIMUM", c2, c3), 1e-9)
        white = expressions.constant((1.0, 1.0, 1.0))
        color = expressions.apply("scaled_sum", white, grazing, color)
        return expressions.bounded(color, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class MetalFilm(Film):
    """The same on a metal: of one thickness."""

    metal: Metal

    def colors(self, cosine: Array, thickness: float) -> Array:
        return metal_reflectance(cosine, thickness, self.film, self.metal)


def _rows(table: Array) -> tuple[float, ...]:
    """What a ramp reads."""
    return tuple(x for row in table for x in (*map(float, row), 1.0))


def film_of(view: NodeView, ior: Ior, is_glass: bool = False) -> Film | None:
    """The film of a node on something of an index; None where it has none."""
    found = _numbers(view)
    if found is None:
        return None
    thickness, film = found
    if is_constant(thickness):
        return Film(view, constant_value(thickness)[0], film, ior.number, is_glass)
    expressions = view.evaluator.expressions
    value = expressions.parts(expressions.value_of(thickness))[0]
    return Film(view, value, film, ior.number, is_glass)


def film_on_metal(view: NodeView, metal: Metal | None) -> MetalFilm | None:
    """The same on a metal. None, and a note, too where that varies."""
    found = _numbers(view)
    if found is None:
        return None
    if metal is None:
        view.note(
            f"The thin film of {view.node.bl_label} is not rendered on metals whose colour varies: "
            "{} go without it"
        )
        return None
    return MetalFilm(view, view.constant("Thin Film Thickness"), found[1], 1.0, False, metal)


def _numbers(view: NodeView) -> tuple[Sum, float] | None:
    """Thickness and index of a node's film; None where it has none."""
    if not view.input("Thin Film Thickness"):
        return None
    thickness = view.amount("Thin Film Thickness")
    if is_constant(thickness) and constant_value(thickness)[0] <= LEAST:
        return None
    return thickness, max(view.constant("Thin Film IOR", 1.33), 1.0)
