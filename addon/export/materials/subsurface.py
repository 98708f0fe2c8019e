"""How far light goes below a surface, as Cycles has it for each of its methods, and the lobes of
shaders whose light does.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .closures import Closure, add_closures
from .evaluator import NodeView
from .terms import ONE, Sum, complement, constant, constant_value, is_constant, multiply

_ALBEDOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.994, 1.0)
_WALK = (
    (0.016, 0.0194, 0.0245, 0.0301, 0.0363, 0.0439, 0.0531, 0.065, 0.0814, 0.1001)
    + (0.1034, 0.1034, 0.1034, 0.1034),
    (0.8925, 0.903, 0.914, 0.9255, 0.936, 0.9475, 0.9595, 0.9715, 0.9835, 0.988)
    + (0.9705, 0.956, 0.95, 0.947),
)
_SKIN = (
    (0.36, 0.2845, 0.2406, 0.2021, 0.1696, 0.1436, 0.1203, 0.099, 0.0724, 0.0335)
    + (0.0345, 0.0345, 0.0345, 0.0022),
    (0.95, 0.955, 0.96, 0.9635, 0.9705, 0.9745, 0.981, 0.989, 0.994, 0.998)
    + (0.9795, 0.9645, 0.96, 0.955),
)
_BURLEY = ((0.25 / np.pi / 1.04,) * len(_ALBEDOS), (1.0,) * len(_ALBEDOS))
_METHODS = {"RANDOM_WALK": _WALK, "RANDOM_WALK_SKIN": _SKIN}
"""Of each the d of Christensen and Burley's profile, for a radius of 1, and the share of the albedo
that comes back, by the albedo. Walks: measured, in Blender 5.0, beside an edge of light on a thick
slab with the node's own IOR of 1.4, by how much light is beyond it; the share half way to 1, for
what oblique views see (docs/decisions/0056).
"""
WALKS_IOR = 1.4
_ROWS = 256
"""Of tables for programs, linear in between."""


def subsurface(
    view: NodeView,
    closure: Closure,
    weight: Sum,
    names: tuple[str, str],
    color: Sum,
    method: str,
) -> Closure:
    """The closure with so much of its diffuse light coming out of the surface elsewhere. names: of
    the inputs with the radius and its scale. color: what the surface gives back of light. method: a
    node's choice.
    """
    if not weight:
        return closure
    distances, gains = _METHODS.get(method, _BURLEY)
    scaled = multiply(view.reflectance(names[0]), view.amount(names[1]))
    radius = _radius(view, multiply(scaled, _by_albedo(view, color, distances)))
    if not radius:
        return closure
    below, rest = multiply(weight, _by_albedo(view, color, gains)), complement(weight)
    parts = []
    for key, terms in closure.items():
        if key.kind != "DIFFUSE" or key.follows:
            parts.append({key: terms})
            continue
        parts.append({replace(key, **radius): multiply(terms, below)})
        parts.append({key: multiply(terms, rest)})
    return add_closures(*parts)


def note_constants(view: NodeView, expected: dict[str, float]) -> None:
    """A note for each input that is not as it is taken to be."""
    if view.node.bl_idname == "ShaderNodeSubsurfaceScattering" and view.node.falloff == "BURLEY":
        return  # which has them not
    for name, value in expected.items():
        if not view.input(name):
            continue
        terms = view.number(name)
        if not is_constant(terms) or abs(constant_value(terms)[0] - value) > 1e-3:
            kind = view.node.bl_label
            view.note(f"The {name} of {kind} is not rendered: {{}} go as with {value}")


def _by_albedo(view: NodeView, color: Sum, column: tuple[float, ...]) -> Sum:
    """A column of a table, channel by channel."""
    if min(column) == max(column):
        return constant(column[0]) if column[0] != 1.0 else ONE
    if is_constant(color):
        return constant(tuple(map(float, np.interp(constant_value(color), _ALBEDOS, column))))
    expressions = view.evaluator.expressions
    table = tuple(map(float, np.interp(np.linspace(0, 1, _ROWS), _ALBEDOS, column)))
    parts = expressions.parts(expressions.value_of(color))
    found = [expressions.looked_up(part, table) for part in parts]
    return expressions.sum_of(expressions.apply("combine_xyz", *found))


def _radius(view: NodeView, size: Sum) -> dict[str, Any]:
    """Of a lobe, as `LobeKey` takes it; nothing where light goes nowhere."""
    if is_constant(size):
        found = tuple(max(x, 0.0) for x in constant_value(size))
        return {"radius": found} if any(found) else {}
    expressions = view.evaluator.expressions
    value = expressions.value_of(size)
    return {"radius_output": expressions.output(value)} if value.constant is None else {}
