"""Nodes of a light: how bright it is where it is seen. Such a point is on the light's shape, and
the ray that sees it comes from the lit point.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....engine.program.graph import Graph, Value
from ....engine.program.operations_math import MathOperation
from .reader import READERS, NodeInputs, Outputs, TreeReader

NOWHERE = {"attribute": ((0.0, 0.0, 0.0), 1.0), "uv": ((0.0, 0.0, 0.0),)}


@dataclass(frozen=True, eq=False)
class Lamp:
    """Where a light is. kind: as `engine.scene.Light` has it.

    object_from_light: (3, 3) takes the axes of that to the object's, with its scale.
    size: (2,) full extents of an AREA light in the light's axes, world units.
    """

    kind: str
    object_from_light: np.ndarray
    size: tuple[float, float] = (0.0, 0.0)

    @property
    def key(self) -> tuple:
        """Equal for lights whose trees mean the same."""
        return self.kind, np.round(self.object_from_light, 6).tobytes(), self.size


class LampReader(TreeReader):
    """Reads a light's tree. Attributes are zeros; UV of an AREA light runs from 0 to 1 over it."""

    def __init__(self, graph: Graph, images: Any, note: Callable[[str], None], lamp: Lamp) -> None:
        super().__init__(graph, images, note)
        self.lamp = lamp

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name == "object_position":
            found = super().apply(name, *arguments, **settings)[0]
            return (self._turned(self.lamp.object_from_light, found),)
        if name == "object_normal":
            found = self._turned(
                np.linalg.inv(self.lamp.object_from_light).T, super().apply(name)[0]
            )
            return super().apply("vector_normalized", found)
        if name == "uv" and self.lamp.kind == "AREA" and all(self.lamp.size):
            return (self._over_area(),)
        if name in NOWHERE:
            return tuple(map(self.graph.constant, NOWHERE[name]))
        if name in ("normal_map", "bump"):
            return super().apply("normal")
        if name == "light_path":  # Cycles calls no ray to a light a shadow ray here
            camera, _, bounced = super().apply(name)
            return camera, self.graph.constant(0.0), bounced
        return super().apply(name, *arguments, **settings)

    def generated(self) -> Value:
        return self.apply("object_position", shift=0)[0]

    def ray_length(self) -> Value | None:
        return self.apply("ray_length")[0]

    def _over_area(self) -> Value:
        place = super().apply("object_position", shift=0)[0]
        over = self.graph.constant((1 / self.lamp.size[0], 1 / self.lamp.size[1], 0.0))
        half = self.graph.constant((0.5, 0.5, 0.0))
        scaled = super().apply("product", place, over)[0]
        return super().apply("scaled_sum", scaled, self.graph.constant(1.0), half)[0]

    def _turned(self, matrix: np.ndarray, vector: Value) -> Value:
        """The matrix (3, 3) times a vector."""
        if np.allclose(matrix, np.eye(3), atol=1e-6):
            return vector
        total = self.graph.constant((0.0, 0.0, 0.0))
        for k, part in enumerate(super().apply("separate_xyz", vector)):
            column = self.graph.constant(tuple(float(x) for x in matrix[:, k]))
            total = super().apply("scaled_sum", column, part, total)[0]
        return total


def _light_falloff(view: NodeInputs) -> Outputs | None:
    """A SUN does not fall off: it is equally far from everywhere."""
    length = view.reader.ray_length()
    if length is None:
        return None
    strength, smooth = view.value("Strength"), view.value("Smooth")
    if view.reader.lamp.kind == "SUN":
        return dict.fromkeys(("Quadratic", "Linear", "Constant"), strength)
    squared = _math(view, "MULTIPLY", length, length)
    soft = _math(
        view, "ADD", _math(view, "MAXIMUM", smooth, view.reader.graph.constant(0.0)), squared
    )
    quadratic = strength
    if smooth.constant != (0.0,):
        quadratic = _math(view, "MULTIPLY", strength, _math(view, "DIVIDE", squared, soft))
    return {
        "Quadratic": quadratic,
        "Linear": _math(view, "MULTIPLY", quadratic, length),
        "Constant": _math(view, "MULTIPLY", quadratic, squared),
    }


def _math(view: NodeInputs, name: str, a: Value, b: Value) -> Value:
    zero = view.reader.graph.constant(0.0)
    return view.apply("math", a, b, zero, operation=MathOperation[name], clamp=0)[0]


READERS["ShaderNodeLightFalloff"] = _light_falloff
