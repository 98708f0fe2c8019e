"""Closures: a material's lobes, each with its weight, as sums of inputs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ....engine.closures import CLOSURES
from ....engine.program.graph import Value
from ....engine.scene import Lobe
from .terms import ZERO, Sum, add, multiply

MATT = frozenset(kind for kind, row in CLOSURES.items() if row.normal == "POINT")
"""Kinds of lobes that have the material's shading normal."""
TURNED = frozenset(kind for kind, row in CLOSURES.items() if row.normal)
"""Those and others to which the shading normal matters, which may have their own."""


@dataclass(frozen=True)
class LobeKey(Lobe):
    """What two lobes must share to be added: all but the factors, what volumes have of
    `engine.scene.Medium`, and where the normal is from.
    """

    factors: tuple = field(default=(), init=False, compare=False)
    anisotropy: float = 0.0
    anisotropy_output: int = -1
    normal: Value | None = None  # of the shader that it comes from
    follows: bool = False  # a small matt part of what shines, for which any normal does


Closure = dict[LobeKey, Sum]


def add_closures(*closures: Closure) -> Closure:
    """The lobes of all, equal ones merged."""
    total: Closure = {}
    for closure in closures:
        for key, weight in closure.items():
            total[key] = add(total.get(key, ZERO), weight)
    return {key: weight for key, weight in total.items() if weight}


def without_normals(closure: Closure) -> Closure:
    """The lobes with the material's normal, equal ones merged."""
    return add_closures(
        *({replace(key, normal=None, follows=False): terms} for key, terms in closure.items())
    )


def with_normal(key: LobeKey, normal: Value) -> LobeKey:
    """The lobe with the normal of the shader that made it, unless it has one."""
    if key.normal is not None or key.kind not in TURNED or key.follows:
        return key
    return replace(key, normal=normal)


def scale_closure(closure: Closure, weight: Sum) -> Closure:
    """Every lobe times a weight; lobes of weight 0 are gone."""
    scaled = {key: multiply(terms, weight) for key, terms in closure.items()}
    return {key: terms for key, terms in scaled.items() if terms}
