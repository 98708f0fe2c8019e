"""Metals, Principled's and of a node of their own, with their colours at grazing angles."""

from __future__ import annotations

from ....engine.program.operations_vector import VectorMeasure
from .anisotropy import Brush
from .closures import Closure
from .evaluator import CLOSURE_NODES, NodeView
from .fresnel import EDGE_COSINE, conductor_reflectance, schlick
from .multiscatter import GRAZING, share_at, share_of
from .nodes_shader import (
    Edge,
    bend,
    distributed,
    glossy_closure,
    is_multiscatter,
)
from .terms import (
    ONE,
    ZERO,
    Sum,
    add,
    complement,
    constant,
    constant_value,
    is_constant,
    multiply,
    scale,
)
from .thin_film import Metal, film_on_metal
from .varying import Roughness


def metal_closure(
    view: NodeView,
    color: Sum,
    roughness: Roughness,
    edge_tint: Sum = ONE,
    conductor: Metal | None = None,
) -> Closure:
    """A metal of a node with microfacets, whose colour some 8 degrees off the surface is as much
    of what Schlick's weight gives there as its tint says; colours above 1 count as 1, as in Cycles.
    conductor: what it is by its index, where that is known.
    """
    color, edge_tint = (view.evaluator.clamped(x, 0.0, 1.0) for x in (color, edge_tint))
    film = film_on_metal(view, conductor or _metal(color, edge_tint))
    if film is not None:
        again = share_of(film.mean, roughness) if is_multiscatter(view) else ZERO
        return glossy_closure(film.reflected, again, roughness, edge=None)
    lack = complement(edge_tint)
    if not lack:
        edge = Edge()
    else:
        at_edge = add(
            scale(color, 1 - schlick(0.0, EDGE_COSINE)), constant(schlick(0.0, EDGE_COSINE))
        )
        lack = multiply(lack, at_edge)
        edge = Edge(lack, _mirrored(view, color, lack, roughness))
    again = share_at(view, color, roughness, GRAZING, lack) if is_multiscatter(view) else ZERO
    return glossy_closure(color, again, roughness, edge)


def _metal(color: Sum, tint: Sum) -> Metal | None:
    """What a film lies on; None where that varies."""
    if not (is_constant(color) and is_constant(tint)):
        return None
    f0 = constant_value(color)
    pairs = zip(f0, constant_value(tint), strict=True)
    return Metal.of(f0, tuple(schlick(x, EDGE_COSINE) * share for x, share in pairs))


def _mirrored(view: NodeView, color: Sum, lack: Sum, roughness: Roughness) -> Sum:
    """What an ideal mirror of such a metal reflects; rough ones need none."""
    if not (roughness.varies or roughness.is_mirror()):
        return color
    expressions = view.evaluator.expressions
    do, math = expressions.apply, expressions.math
    normal = view.evaluator.normal_at(view.input("Normal"))
    cosine = do("vector_measure", do("incoming"), normal, measure=VectorMeasure.DOT_PRODUCT)
    cosine = math("MINIMUM", math("MAXIMUM", cosine, 0.0), 1.0)
    rest = math("SUBTRACT", 1.0, cosine)
    grazing = math("POWER", rest, 5.0)
    below = math("MULTIPLY", math("MULTIPLY", cosine, rest), grazing)
    gained = multiply(complement(color), expressions.sum_of(grazing))
    lost = multiply(lack, expressions.sum_of(math("MULTIPLY", below, 7.0**7 / 6.0**6)))
    return add(color, gained, scale(lost, -1.0))


def _metallic(view: NodeView) -> Closure:
    bend(view)
    brush = Brush(view, view.roughness())
    color, tint = view.reflectance("Base Color"), view.reflectance("Edge Tint", 1.0)
    metal = None
    if view.node.fresnel_type != "F82":
        color, tint, metal = _conductor(view) or (color, ONE, None)
    closure = metal_closure(view, color, brush.roughness, tint, metal)
    return distributed(view, brush.on(closure))


def _conductor(view: NodeView) -> tuple[Sum, Sum, Metal] | None:
    """The colours of a metal by its index of refraction and extinction, seen straight and some 8
    degrees off the surface, and these; None where one of them varies.
    """
    numbers = [view.color(name) for name in ("IOR", "Extinction")]
    if not all(is_constant(terms) for terms in numbers):
        view.note(
            "The Metallic shader's physical conductor is rendered by its base colour in {}, where "
            "IOR or Extinction vary: choose F82 Tint"
        )
        return None
    n, k = (constant_value(terms) for terms in numbers)
    straight, aslant = (
        [conductor_reflectance(x, max(a, 0.0), max(b, 0.0)) for a, b in zip(n, k, strict=True)]
        for x in (1.0, EDGE_COSINE)
    )
    tint = [b / schlick(a, EDGE_COSINE) for a, b in zip(straight, aslant, strict=True)]
    metal = Metal(tuple(max(x, 0.0) for x in n), tuple(max(x, 0.0) for x in k))
    return constant(tuple(straight)), constant(tuple(tint)), metal


CLOSURE_NODES["ShaderNodeBsdfMetallic"] = _metallic
