"""Lights whose programs say how bright they are where they are seen (semantics/lights.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..evaluation.points import camera_position, clipped, light_path, window
from ..evaluation.textures import Image
from ..linear.columns import dot, length, unit
from ..program.execute.run import run
from ..scene import Camera

if TYPE_CHECKING:
    from .lights import Source

Array = np.ndarray

FARTHEST = float(np.finfo(np.float32).max)
"""How far a SUN is, as in Cycles."""


class EmissionPoints:
    """What the program of a light reads of n points of its shape.

    Space: the world's axes, relative to the eye (3, 1).
    """

    def __init__(
        self, around: Emission, source: Source, x: Array, n: Array, d: Array, far: Array, kind: str
    ) -> None:
        """x, n, d: (3, n) the points, their normals, unit directions of the rays that see them.

        far: (n,) lengths of those rays. kind: theirs, "camera", "mirror" or "shadow".
        """
        self._around, self._frame = around, np.asarray(source.light.world_from_light, np.float64)
        self._center, self._x, self._n, self._d = source.position, x, n, d
        self._far, self._kind = far, kind

    def image(self, texture: int, u: Array, v: Array) -> Array:
        """(4, n) RGBA."""
        return self._around.images[texture].read(u, v)

    def position(self, shift: int) -> Array:
        """(3, n) in the world."""
        return self._x + self._around.eye

    def object_position(self, shift: int) -> Array:
        """(3, n) along the light's axes, from its centre."""
        return self._frame[:, :3].T @ (self._x - self._center)

    def object_location(self) -> Array:
        """(3, n) of the light in the world."""
        return np.repeat(self._center + self._around.eye, self._x.shape[1], 1)

    def normal(self) -> Array:
        """(3, n) unit."""
        return self._n

    face_normal = normal

    def object_normal(self) -> Array:
        """(3, n) unit, along the light's axes."""
        return self._frame[:, :3].T @ self._n

    def incoming(self) -> Array:
        """(3, n) unit, back along the rays."""
        return -self._d

    def backfacing(self) -> Array:
        """(n,) zeros: lights are seen from outside."""
        return np.zeros(self._x.shape[1])

    def reflection(self) -> Array:
        """(3, n) unit: the rays mirrored at the normal."""
        return self._d - 2 * dot(self._n, self._d) * self._n

    def camera_position(self, shift: int) -> Array:
        """(3, n) along right and up of the camera, and the depth."""
        return camera_position(self._around.camera, self._x)

    def window(self, shift: int) -> Array:
        """(2, n) of the picture."""
        return window(self._around.camera, self._x)

    def light_path(self) -> tuple[Array, ...]:
        """Four times (n,): see `points.light_path`."""
        return light_path(self._kind, self._x.shape[1])

    def ray_depth(self) -> tuple[Array, ...]:
        """Four times (n,) zeros: lights do not know how they are seen."""
        return (np.zeros(self._x.shape[1]),) * 4

    def ray_length(self) -> Array:
        """(n,) in the world."""
        if self._kind != "camera":
            return self._far
        return self._far - clipped(self._around.camera, self._d, self._x, self._far)


@dataclass(frozen=True, eq=False)
class Emission:
    """What the program of a light has beside the points. images: of the light."""

    images: list[Image]
    camera: Camera

    @property
    def eye(self) -> Array:
        return np.asarray(self.camera.world_from_camera, np.float64)[:, 3:]

    def seen(self, source: Source, x: Array, d: Array, end: Array | None, kind: str) -> Array:
        """(3, n): what the light's colour is times where rays from x (3, n) along unit d (3, n)
        meet it at `end` (3, n) or (3, 1), None for an endless one; 0 where that is not finite.
        """
        if end is None:
            at, far = -d - self.eye, np.full(d.shape[1], FARTHEST)
        else:
            at = np.broadcast_to(end, d.shape)
            far = length(at - x)
        n = _normals(source, d, at)
        points = EmissionPoints(self, source, at, n, d, far, kind)
        value = run(source.light.program, points, d.shape[1])[0]
        return np.where(np.isfinite(value), value, 0.0)


def _normals(source: Source, d: Array, at: Array) -> Array:
    """Outward on a ball; to whoever looks where a point stands for it, or a disc that faces him."""
    light = source.light
    if light.kind == "AREA":
        return np.repeat(source.axis, d.shape[1], 1)
    if light.kind == "SUN" or light.soft_falloff:
        return -d
    out = at - source.position
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(out.any(0), unit(out), -d)
