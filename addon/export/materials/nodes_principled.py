"""The Principled BSDF as a sum of lobes, layered as in Blender 4.0 and later: coat over emission,
metal, glass, dielectric over diffuse.
"""

from __future__ import annotations

import math

from .evaluator import CLOSURE_NODES, Closure, LobeKey, NodeView, add_closures, scale_closure
from .fresnel import ior_from_reflectance, normal_reflectance
from .nodes_shader import (
    LEFT_OUT,
    below_coat,
    below_sheen,
    bend,
    coat_closure,
    glass_closure,
    is_multiscatter,
    metal_closure,
    note_edge_tint,
    note_left_out,
    sheen_closure,
    sound_ior,
    under_alpha,
)
from .roughness import layer_loss, sheen_of
from .terms import ONE, Sum, complement, constant, constant_value, is_constant, mix, multiply, scale
from .varying import Roughness


def _principled(view: NodeView) -> Closure:
    _note_what_is_left_out(view)
    base, roughness = view.reflectance("Base Color"), view.roughness()
    metallic, transmission = view.factor("Metallic"), view.factor("Transmission Weight")
    insulator = complement(metallic)
    surface = add_closures(
        scale_closure(metal_closure(view, base, roughness), metallic) if metallic else {},
        scale_closure(
            _plastic(view, base, roughness), multiply(insulator, complement(transmission))
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
    base: Sum, tint: Sum, roughness: Roughness, ior: float, multiscatter: bool
) -> Closure:
    """A dielectric layer over a diffuse one, which gets what the layer lets through."""
    below = below_coat(base, _largest(tint), roughness, ior, multiscatter)
    return add_closures(below, coat_closure(ONE, roughness, ior, multiscatter, tint))


def _largest(color: Sum) -> Sum:
    """The largest channel, by which Cycles dims what lies below a tinted layer; each channel of
    what varies.
    """
    return constant(max(constant_value(color))) if is_constant(color) else color


def _plastic(view: NodeView, base: Sum, roughness: Roughness) -> Closure:
    """A specular level that varies scales F0 as the tint does."""
    tint, ior = view.reflectance("Specular Tint", 1.0), sound_ior(view)
    level = view.amount("Specular IOR Level", 0.5)
    if is_constant(level):
        ior = _specular_ior(view)
    else:
        tint = multiply(tint, scale(level, 2.0))
    return plastic_closure(base, tint, roughness, ior, is_multiscatter(view))


def _specular_ior(view: NodeView) -> float:
    """The index of refraction with the node's specular level in it: the level scales F0, one half
    leaves it as it is.
    """
    ior, level = sound_ior(view), view.constant("Specular IOR Level", 0.5)
    return (
        ior if level == 0.5 else ior_from_reflectance(normal_reflectance(ior) * 2 * max(level, 0.0))
    )


def _glass(view: NodeView, base: Sum, roughness: Roughness) -> Closure:
    """Refraction takes the root of the base colour, so that light which enters and leaves takes all
    of it.
    """
    ior = sound_ior(view)
    root = (
        constant(tuple(math.sqrt(max(x, 0.0)) for x in constant_value(base)))
        if is_constant(base)
        else base
    )
    return glass_closure(view, view.reflectance("Specular Tint", 1.0), root, roughness, ior)


def _coated(view: NodeView, surface: Closure) -> Closure:
    """A dielectric coat: its reflection, and what lies below dimmed by it and tinted."""
    weight = view.factor("Coat Weight")
    if not weight:
        return surface
    ior = max(view.constant("Coat IOR", 1.5), 1e-3)
    tint = view.reflectance("Coat Tint", 1.0)
    roughness = view.roughness("Coat Roughness", 0.03)
    lost = multiply(weight, roughness.number(lambda r: layer_loss(r, ior)))
    through = multiply(complement(lost), mix(weight, ONE, tint))
    coat = coat_closure(weight, roughness, ior)
    return add_closures(scale_closure(surface, through), coat)


def _sheened(view: NodeView, surface: Closure) -> Closure:
    """Fibres on top, and what lies below without what these reflect in their strongest channel."""
    weight = view.factor("Sheen Weight")
    if not weight:
        return surface
    tint = view.reflectance("Sheen Tint", 1.0)
    sheen = sheen_of(view.constant("Sheen Roughness", 0.5))
    return add_closures(
        below_sheen(surface, multiply(weight, _largest(tint)), sheen),
        sheen_closure(multiply(weight, tint), sheen),
    )


def _note_what_is_left_out(view: NodeView) -> None:
    bend(view)
    if view.is_linked("Coat Normal"):
        view.note("The coat of {} has the normal of what lies below it")
    note_left_out(view, LEFT_OUT)
    if view.number("Metallic"):
        note_edge_tint(view, "Specular Tint")
    if view.number("Subsurface Weight"):
        view.note("Subsurface scattering is rendered as diffuse in {}")


CLOSURE_NODES["ShaderNodeBsdfPrincipled"] = _principled
