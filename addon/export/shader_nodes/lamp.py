"""Nodes of a light: how bright it is where it is seen. Such a point is on the light's shape, and
the ray that sees it comes from the lit point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....engine.program.graph import Graph, Value
from ..camera import inverse_axes
from .bare import BareReader
from .reader import READERS, Arithmetic, NodeInputs, Outputs


@dataclass(frozen=True, eq=False)
class Lamp:
    """Where a light is. kind: as `engine.scene.Light` has it.

    object_from_light: (3, 3) takes the axes of that to the object's, with its scale.
    size: (2,) full extents of an AREA light in the light's axes, world units. spot_size: full angle
    of a SPOT's cone. light_from_world: (3, 3) of a SPOT, for where it throws its UV.
    normals_to_world: (3, 3) takes the object's normals to the world, up to their lengths.
    """

    kind: str
    object_from_light: np.ndarray
    size: tuple[float, float] = (0.0, 0.0)
    spot_size: float = 0.0
    light_from_world: np.ndarray | None = None
    normals_to_world: np.ndarray = field(default_factory=lambda: np.eye(3))

    @property
    def key(self) -> tuple:
        """Equal for lights whose trees mean the same where they take no normal to the world."""
        turns = self.light_from_world.tobytes() if self.light_from_world is not None else b""
        return (
            self.kind,
            np.round(self.object_from_light, 6).tobytes(),
            turns,
            self.size,
            self.spot_size,
        )


class LampReader(BareReader):
    """Reads a light's tree. UV without a map's name runs from 0 to 1 over an AREA light, round a
    POINT, and over the square round a SPOT's cone.
    """

    def __init__(self, graph: Graph, images: Any, note: Callable[[str], None], lamp: Lamp) -> None:
        super().__init__(graph, images, note)
        self.lamp, self._math = lamp, Arithmetic(graph, super().apply)
        self.is_turned = False
        """Whether a normal was taken from the object to the world."""

    def apply(self, name: str, /, *arguments: Value, **settings: int) -> tuple[Value, ...]:
        if name == "object_position":
            found = super().apply(name, *arguments, **settings)[0]
            return (self._turned(self.lamp.object_from_light, found),)
        if name == "object_normal":
            turn = inverse_axes(self.lamp.object_from_light).T
            found = self._turned(turn, super().apply(name)[0])
            return super().apply("vector_normalized", found)
        if name == "uv" and not settings["attribute"]:
            return (self._uv(),)
        if name == "barycentric" and self.lamp.kind == "AREA" and all(self.lamp.size):
            return (self._over_area(),)
        if name == "normal_to_world":
            return (self.object_to_world(*arguments),)
        if name == "transform_vector":
            self.note(f"Node '{self.reading}' turns nothing in {{}}: vectors stay as they are")
            return arguments
        if name == "light_path":  # Cycles calls no ray to a light a shadow ray here
            camera, _, bounced, scattered = super().apply(name)
            return camera, self.graph.constant(0.0), bounced, scattered
        return super().apply(name, *arguments, **settings)

    def object_to_world(self, vector: Value) -> Value:
        self.is_turned = True
        turned = self._turned(self.lamp.normals_to_world, vector)
        return super().apply("vector_normalized", turned)[0]

    def object_incoming(self) -> Value:
        """The normal of lights round a point is as good: it means the same wherever they stand."""
        if self.lamp.kind != "AREA":
            return super().object_incoming()
        self.is_turned = True
        turn = inverse_axes(self.lamp.normals_to_world)
        return self._turned(turn, super().apply("incoming")[0])

    def _uv(self) -> Value:
        if self.lamp.kind == "AREA" and all(self.lamp.size):
            return self._over_area()
        if self.lamp.kind == "POINT":
            return self._round()
        if self.lamp.light_from_world is not None:
            return self._in_cone()
        if self.lamp.kind == "SUN":
            self.note("UV coordinates are not known of the sun {}: 0 is used; use the normal")
        return self.graph.constant((0.0, 0.0, 0.0))

    def generated(self) -> Value:
        return self.apply("object_position", shift=0)[0]

    def ray_length(self) -> Value | None:
        return self.apply("ray_length")[0]

    def ray_depth(self) -> None:
        """Lights do not know how they are seen."""

    def _over_area(self) -> Value:
        place = super().apply("object_position", shift=0)[0]
        over = self.graph.constant((1 / self.lamp.size[0], 1 / self.lamp.size[1], 0.0))
        half = self.graph.constant((0.5, 0.5, 0.0))
        scaled = super().apply("product", place, over)[0]
        return super().apply("scaled_sum", scaled, self.graph.constant(1.0), half)[0]

    def _round(self) -> Value:
        """Azimuth and elevation of the normal."""
        x, y, z = super().apply("separate_xyz", self.apply("object_normal")[0])
        do = self._math
        u = do("MULTIPLY_ADD", do("ARCTAN2", x, y), -0.5 / math.pi, 0.5)
        v = do("MULTIPLY_ADD", do("ARCCOSINE", z), -1 / math.pi, 1.0)
        return do.plane(u, v)

    def _in_cone(self) -> Value:
        ray = self._turned(self.lamp.light_from_world, super().apply("incoming")[0])
        x, y, z = super().apply("separate_xyz", ray)
        do = self._math
        factor = do("DIVIDE", -0.5 / math.tan(self.lamp.spot_size / 2), z)
        return do.plane(*(do("MULTIPLY_ADD", part, factor, 0.5) for part in (x, y)))

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
    lamp = getattr(view.reader, "lamp", None)
    if lamp is not None and lamp.kind == "SUN":
        return dict.fromkeys(("Quadratic", "Linear", "Constant"), strength)
    do = view.math
    squared = do("MULTIPLY", length, length)
    quadratic = strength
    if smooth.constant != (0.0,):
        soft = do("ADD", do("MAXIMUM", smooth, 0.0), squared)
        quadratic = do("MULTIPLY", strength, do("DIVIDE", squared, soft))
    return {
        "Quadratic": quadratic,
        "Linear": do("MULTIPLY", quadratic, length),
        "Constant": do("MULTIPLY", quadratic, squared),
    }


READERS["ShaderNodeLightFalloff"] = _light_falloff
