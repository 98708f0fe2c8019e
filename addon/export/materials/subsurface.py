"""How far light goes below a surface, as Cycles has it for each of its methods, and the lobes of
shaders whose light does.
"""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Any

from .closures import Closure, add_closures
from .evaluator import NodeView
from .terms import RGB, Sum, complement, constant, constant_value, is_constant, multiply

_ROWS = 256
"""Of a table over albedos, linear in between."""
_HALVINGS = 50


def subsurface(
    view: NodeView, closure: Closure, weight: Sum, names: tuple[str, str], color: Sum, method: str, ior: float
) -> Closure:
    """The closure with so much of its diffuse light coming out of the surface elsewhere. names: of
    the inputs with the radius and its scale. color: what the surface gives back of light. method,
    ior: as `distance` takes them.
    """
    if not weight:
        return closure
    how = _radius(view, names, color, method, ior)
    if not how:
        return closure
    rest, parts = complement(weight), []
    for key, terms in closure.items():
        if key.kind != "DIFFUSE" or key.follows:
            parts.append({key: terms})
            continue
        parts.append({replace(key, **how): multiply(terms, weight)})
        parts.append({key: multiply(terms, rest)})
    return add_closures(*parts)


def _radius(
    view: NodeView, names: tuple[str, str], color: Sum, method: str, ior: float
) -> dict[str, Any]:
    """Of a lobe, as `LobeKey` takes it; nothing where light goes nowhere."""
    scaled = multiply(view.reflectance(names[0]), view.amount(names[1]))
    if is_constant(scaled) and is_constant(color):
        each = zip(constant_value(scaled), constant_value(color), strict=True)
        found: RGB = tuple(size * distance(albedo, method, ior) for size, albedo in each)
        return {"radius": found} if any(found) else {}
    expressions = view.evaluator.expressions
    table = [0.0] * (4 * _ROWS)
    table[3::4] = [distance(k / (_ROWS - 1), method, ior) for k in range(_ROWS)]
    parts = expressions.parts(expressions.value_of(color))
    times = [expressions.looked_up(part, tuple(table)) for part in parts]
    value = expressions.apply(
        "product", expressions.value_of(scaled), expressions.apply("combine_xyz", *times)
    )
    return {"radius_output": expressions.output(value)} if value.constant is None else {}


@functools.lru_cache(maxsize=4096)
def distance(albedo: float, method: str, ior: float) -> float:
    """The d of Christensen and Burley's profile over the radius of a shader in Cycles, with their
    fit for light that enters from all sides (2015, section 4). The radius is a mean free path over
    4 π; with RANDOM_WALK what a dipole has of that albedo at the radius as its reach (Jensen et al.
    2001, A Practical Model for Subsurface Light Transport).
    """
    albedo = min(max(albedo, 0.0), 1.0)
    steepness = 1.9 - albedo + 3.5 * (albedo - 0.8) ** 2
    if method != "RANDOM_WALK":
        return 0.25 / math.pi / steepness
    return math.sqrt(3 * (1 - _reduced_albedo(albedo, ior))) / steepness


def _reduced_albedo(albedo: float, ior: float) -> float:
    """The share of light that is scattered, not absorbed, with which a dipole gives back so much."""
    inside = -1.440 / ior**2 + 0.710 / ior + 0.668 + 0.0636 * ior
    a = 4 / 3 * (1 + inside) / (1 - inside)
    if albedo < 1e-4:
        return 0.0
    if albedo >= 0.995:
        return 0.999999
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        root = math.sqrt(3 * (1 - share))
        given = share / 2 * (1 + math.exp(-a * root)) * math.exp(-root)
        low, high = (share, high) if given < albedo else (low, share)
    return (low + high) / 2
