"""The shaders of hair as Blinn-Phong on the fibre's own round surface. Over a fibre's width its
normals are all those across the tangent: what Kajiya and Kay (1989) write as sines of the angles to
the tangent is the mean of n·l and of (n·h)^p over them.
"""

from __future__ import annotations

import math

from .evaluator import CLOSURE_NODES, Closure, NodeView, add_closures
from .nodes_shader import below_coat, coat_closure, glossy_closure
from .terms import ONE, RGB, Sum, constant, constant_value, is_constant
from .varying import Ior, Roughness

_EUMELANIN, _PHEOMELANIN = (0.506, 0.841, 1.653), (0.343, 0.733, 1.924)
"""What melanin absorbs, a fibre's radius (Donner and Jensen 2006)."""
_SMOOTHEST = 0.1
"""Of highlights: light reflected by hair is not traced on."""


_UNUSED = {
    "Coat": 0.0,
    "Offset": 2 * math.pi / 180,
    "Aspect Ratio": 0.85,
    "Random": 0.0,
    "Random Color": 0.0,
    "Random Roughness": 0.0,
    "Reflection": 1.0,
    "Transmission": 1.0,
    "Secondary Reflection": 1.0,
}
"""Inputs of Principled Hair that have no effect, and what they are where nobody set them."""


def _note_unused(view: NodeView, usual: dict[str, float]) -> None:
    for name, value in usual.items():
        if not view.input(name):
            continue
        found = view.number(name)
        if not is_constant(found) or abs(constant_value(found)[0] - value) > 1e-4:
            view.note(f"'{name}' of {view.node.bl_label} is not rendered: {{}} go without it")


def _principled_hair(view: NodeView) -> Closure:
    unused = {"Radial Roughness": 0.3} if view.node.parametrization == "COLOR" else {}
    _note_unused(view, _UNUSED | unused)
    roughness = Roughness(min(max(view.constant("Roughness", 0.3), _SMOOTHEST), 1.0))
    ior = Ior(max(view.constant("IOR", 1.55), 1.0))
    view.note(
        "Hair shaders are Blinn-Phong on the round fibre here: {} show no light that passes through"
    )
    below = below_coat(_color(view), ONE, roughness, ior, False)
    return add_closures(below, coat_closure(ONE, roughness, ior, False))


def _color(view: NodeView) -> Sum:
    """The colour of a mass of such hair (Chiang et al. 2016, equation 9)."""
    how = view.node.parametrization
    if how == "COLOR":
        return view.reflectance("Color")
    beta = min(max(view.constant("Radial Roughness", 0.3), 0.0), 1.0)
    spread = (
        5.969 - 0.215 * beta + 2.532 * beta**2 - 10.73 * beta**3 + 5.574 * beta**4 + 0.245 * beta**5
    )
    if how == "ABSORPTION":
        absorbed = _constant_vector(view, "Absorption Coefficient", 0.0)
    else:
        tint = _constant_vector(view, "Tint", 1.0)
        dyed = ((math.log(min(max(x, 1e-5), 1.0)) / spread) ** 2 for x in tint)
        absorbed = tuple(map(sum, zip(_melanin(view), dyed, strict=True)))
    return constant(tuple(math.exp(-math.sqrt(max(x, 0.0)) * spread) for x in absorbed))


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
    _note_unused(view, {"Offset": 0.0, "RoughnessV": 1.0})
    if view.node.component == "Transmission":
        view.note("Light that passes through hair is not rendered: {} are black where it counts")
        return {}
    along = Roughness(min(max(view.constant("RoughnessU", 0.1), _SMOOTHEST**2), 1.0) ** 0.5)
    return glossy_closure(view.reflectance("Color"), (0.0, 0.0, 0.0), along, False, edge=False)


CLOSURE_NODES.update(
    {"ShaderNodeBsdfHairPrincipled": _principled_hair, "ShaderNodeBsdfHair": _hair}
)
