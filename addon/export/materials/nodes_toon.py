"""Toon shaders, diffuse and glossy, as closures."""

from __future__ import annotations

import math
from typing import Any

from .closures import Closure, LobeKey
from .evaluator import CLOSURE_NODES, NodeView
from .nodes_shader import bend
from .terms import constant, constant_value, is_constant, multiply


def _toon(view: NodeView) -> Closure:
    bend(view)
    color = view.reflectance("Color")
    given = {**_number(view, "Size"), **_number(view, "Smooth")}
    varies = len(given) > 2
    share = 1.0 if varies else toon_albedo(given["size"], given["smooth"])
    kind = "TOON_SPECULAR" if view.node.component == "GLOSSY" else "TOON_DIFFUSE"
    return {LobeKey(kind, **given): color, LobeKey("AMBIENT"): multiply(color, constant(share))}


def _number(view: NodeView, name: str) -> dict[str, Any]:
    """A number of the lobe from 0 to 1, or the output that gives it."""
    terms, of_lobe = view.factor(name), name.lower()
    if is_constant(terms):
        return {of_lobe: constant_value(terms)[0]}
    expressions = view.evaluator.expressions
    value = expressions.parts(expressions.value_of(terms))[0]
    return {of_lobe: 1.0, f"{of_lobe}_output": expressions.output(value)}


def toon_albedo(size: float, smooth: float) -> float:
    """What of a uniform world a toon lobe gives back: its edge is not made up for, as in Cycles."""
    whole, edge = math.pi / 2 * max(size, 1e-5), math.pi / 2 * smooth
    end = min(whole + edge, math.pi / 2)
    if edge == 0.0:
        return 1.0
    lost = (1 - (end - whole) / edge) * math.cos(end) + (math.sin(end) - math.sin(whole)) / edge
    return (1 - lost) / (1 - math.cos(end))


CLOSURE_NODES["ShaderNodeBsdfToon"] = _toon
