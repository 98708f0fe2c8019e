"""The Principled BSDF as a sum of lobes, layered as in Blender 4.0 and later: coat over emission,
metal, glass, dielectric over diffuse.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from ....engine.program.graph import Value
from ....engine.program.operations_vector import VectorMeasure
from .anisotropy import Brush
from .closures import Closure, LobeKey, add_closures, scale_closure
from .evaluator import CLOSURE_NODES, NodeView
from .multiscatter import share_of
from .nodes_metal import metal_closure
from .nodes_shader import (
    below_coat,
    bend,
    coat_closure,
    diffuse_closure,
    glass_of,
    glossy_closure,
    is_multiscatter,
    kept_by_layer,
    note_left_out,
    under_alpha,
)
from .nodes_sheen import Fibres
from .rough_diffuse import roughened
from .subsurface import WALKS_IOR, note_constants, subsurface
from .terms import (
    ONE,
    ZERO,
    Sum,
    add,
    complement,
    constant,
    constant_value,
    is_constant,
    mix,
    multiply,
)
from .thin_film import film_of
from .varying import Ior, Roughness


def _principled(view: NodeView) -> Closure:
    _note_what_is_left_out(view)
    base, roughness = view.reflectance("Base Color"), view.roughness()
    metallic, transmission = view.factor("Metallic"), view.factor("Transmission Weight")
    insulator, brush = complement(metallic), Brush(view, roughness)
    surface = add_closures(
        scale_closure(
            brush.on(
                metal_closure(view, base, brush.roughness, view.reflectance("Specular Tint", 1.0))
            ),
            metallic,
        )
        if metallic
        else {},
        scale_closure(
            brush.on(_plastic(view, base, brush.roughness)),
            multiply(insulator, complement(transmission)),
        ),
        scale_closure(_glass(view, base, roughness), multiply(insulator, transmission))
        if transmission
        else {},
        {
            LobeKey("EMISSION"): multiply(
                view.reflectance("Emission Color"), view.amount("Emission Strength")
            )
        },
    )
    return under_alpha(_sheened(view, _coated(view, surface)), view.factor("Alpha", 1.0))


def plastic_closure(
    base: Sum, tint: Sum, roughness: Roughness, ior: Ior, multiscatter: bool
) -> Closure:
    """A dielectric layer over a diffuse one, which gets what the layer lets through."""
    below = _below(base, tint, roughness, ior, multiscatter)
    return add_closures(below, coat_closure(ONE, roughness, ior, multiscatter, tint))


def _below(base: Sum, tint: Sum, roughness: Roughness, ior: Ior, multiscatter: bool) -> Closure:
    return below_coat(base, _largest(tint), roughness, ior, multiscatter)


def _largest(color: Sum) -> Sum:
    """The largest channel, by which Cycles dims what lies below a tinted layer; each channel of
    what varies.
    """
    return constant(max(constant_value(color))) if is_constant(color) else color


def _plastic(view: NodeView, base: Sum, roughness: Roughness) -> Closure:
    """The specular level scales F0, one half leaves it as it is."""
    ior = view.ior().with_level(view.amount("Specular IOR Level", 0.5))
    tint = view.reflectance("Specular Tint", 1.0)
    again, film = is_multiscatter(view), film_of(view, ior)
    if film is None:
        below = _below(base, tint, roughness, ior, again)
        coat = coat_closure(ONE, roughness, ior, again, tint)
    else:
        color = film.tinted(tint)
        below = diffuse_closure(multiply(base, complement(film.largest(color))))
        share = share_of(film.mean, roughness) if again else ZERO
        coat = glossy_closure(color, share, roughness, edge=None)
    weight, names = view.factor("Subsurface Weight"), ("Subsurface Radius", "Subsurface Scale")
    below = subsurface(view, below, weight, names, base, view.node.subsurface_method)
    below = roughened(view, below, "Diffuse Roughness", base)
    return add_closures(below, coat)


def _glass(view: NodeView, base: Sum, roughness: Roughness) -> Closure:
    """Refraction takes the root of the base colour, so that light which enters and leaves takes all
    of it.
    """
    root = _root(view, base)
    ior, tint = view.ior(), view.reflectance("Specular Tint", 1.0)
    return glass_of(view, tint, root, roughness, ior)


def _root(view: NodeView, color: Sum) -> Sum:
    if is_constant(color):
        return constant(tuple(math.sqrt(max(x, 0.0)) for x in constant_value(color)))
    expressions = view.evaluator.expressions
    value, half = expressions.value_of(color), expressions.constant(0.5)
    return expressions.sum_of(expressions.apply("gamma", value, half))


def _coated(view: NodeView, surface: Closure) -> Closure:
    """A dielectric coat: its reflection, and what lies below dimmed by it and tinted."""
    weight, rest = _layer(view, "Coat Weight")
    if not weight:
        return surface
    ior = view.ior("Coat IOR", least=1.0)
    tint = _absorbed(view, view.reflectance("Coat Tint", 1.0), ior)
    roughness = view.roughness("Coat Roughness", 0.03)
    lost = _kept_by_coat(view, weight, roughness, ior)
    through = multiply(rest(lost), mix(view.factor("Coat Weight"), ONE, tint))
    coat = _turned(view, coat_closure(weight, roughness, ior))
    return add_closures(scale_closure(surface, through), coat)


def _kept_by_coat(view: NodeView, weight: Sum, roughness: Roughness, ior: Ior) -> Sum:
    """What a coat keeps from what lies below, seen from where it is: one term, as all lobes below
    are times it.
    """
    if ior.number == 1.0:
        return ZERO
    expressions = view.evaluator.expressions
    do, math = expressions.apply, expressions.math
    always, grazing, q = kept_by_layer(roughness, ior)
    power, _, _ = expressions.parts(expressions.value_of(q))
    cosine = math("MAXIMUM", _seen_at(view), 0.0)
    aslant = do("combine_xyz", *[math("POWER", math("SUBTRACT", 1.0, cosine), power)] * 3)
    share = add(always, multiply(grazing, expressions.sum_of(aslant)))
    return expressions.sum_of(expressions.value_of(multiply(weight, share)))


def _seen_at(view: NodeView) -> Value:
    """The cosine between a coat's normal and the viewer. A bent one counts as if it mirrored him to
    the horizon of its face where it does not face him more, as Cycles turns it.
    """
    expressions = view.evaluator.expressions
    do, math = expressions.apply, expressions.math
    normal, incoming = view.evaluator.normal_at(view.input("Coat Normal")), do("incoming")

    def cosine(other: Value) -> Value:
        product = do("vector_measure", incoming, other, measure=VectorMeasure.DOT_PRODUCT)
        return math("MINIMUM", product, 1.0)

    if normal is do("normal"):
        return cosine(normal)
    face = cosine(do("face_normal"))
    aside = math("SQRT", math("SUBTRACT", 1.0, math("MULTIPLY", face, face)))
    least = math("SQRT", math("MULTIPLY", math("SUBTRACT", 1.0, aside), 0.5))
    return math("MAXIMUM", cosine(normal), least)


def _absorbed(view: NodeView, tint: Sum, ior: Ior) -> Sum:
    """The tint of a coat by the way of light from the viewer, which the coat bends; tint is that
    seen straight. As Cycles has it: to the power 1 / √(1 - sin² / ior²).
    """
    if tint == ONE:
        return ONE
    expressions = view.evaluator.expressions
    do, math = expressions.apply, expressions.math
    normal = view.evaluator.normal_at(view.input("Coat Normal"))
    cosine = do("vector_measure", do("incoming"), normal, measure=VectorMeasure.DOT_PRODUCT)
    square = math("MINIMUM", math("MULTIPLY", cosine, cosine), 1.0)
    bent = math("DIVIDE", math("SUBTRACT", 1.0, square), math("MULTIPLY", ior.value, ior.value))
    depth = math("INVERSE_SQRT", math("SUBTRACT", 1.0, bent))
    return expressions.sum_of(do("gamma", expressions.value_of(tint), depth))


def _turned(view: NodeView, coat: Closure) -> Closure:
    """A coat whose highlights and mirrors have its own normal."""
    below, own = (view.evaluator.normal_at(view.input(n)) for n in ("Normal", "Coat Normal"))
    if own is below:
        return coat
    output = view.evaluator.expressions.output(own)
    return {
        replace(key, normal_output=output) if key.kind in ("SPECULAR", "MIRROR") else key: terms
        for key, terms in coat.items()
    }


def _layer(view: NodeView, name: str) -> tuple[Sum, Callable[[Sum], Sum]]:
    """The weight of a layer, which is above 1 where what is linked says so, and what a share of it
    leaves to what lies below.
    """
    weight = view.amount(name)
    if weight == view.factor(name):
        return weight, complement
    return weight, lambda share: view.evaluator.clamped(complement(share), 0.0, math.inf)


def _sheened(view: NodeView, surface: Closure) -> Closure:
    """Fibres on top, and what lies below without what these reflect in their strongest channel."""
    weight, rest = _layer(view, "Sheen Weight")
    if not weight:
        return surface
    tint = view.reflectance("Sheen Tint", 1.0)
    fibres = Fibres(view, view.roughness("Sheen Roughness"))
    return add_closures(
        scale_closure(surface, rest(multiply(weight, _largest(tint), fibres.share))),
        fibres.closure(multiply(weight, tint)),
    )


def _note_what_is_left_out(view: NodeView) -> None:
    bend(view)
    if view.number("Subsurface Weight"):
        note_left_out(view, {"Subsurface Anisotropy": "subsurface anisotropy"})
        note_constants(view, {"Subsurface IOR": WALKS_IOR})


CLOSURE_NODES["ShaderNodeBsdfPrincipled"] = _principled
