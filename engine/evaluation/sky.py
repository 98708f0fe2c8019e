"""What rays see that hit nothing, where a world's program says it (semantics/environment.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..program.execute.run import run
from ..program.program import Program
from ..scene import Camera
from .points import camera_position, light_path, window
from .textures import Image

Array = np.ndarray
Images = Sequence[Image] | Mapping[int, Image]
"""By the number of the texture."""
Seen = tuple[Camera, Array]
"""The camera, and the points (3, n) relative to its eye where it looks for what rays see."""


class Sky:
    """What the program of a world reads where rays in the directions (3, n), unit, hit nothing."""

    def __init__(
        self, images: Images, along: Array, kind: str, seen: Seen | None, past: Array | None
    ) -> None:
        """kind: of the rays, "camera", "mirror" or "scattered". seen: None where no camera is
        known. past: (4, n) as `Paths.past` gives it; None for zeros.
        """
        self._images, self._along, self._kind, self._seen = images, along, kind, seen
        self._past = np.zeros((4, along.shape[1])) if past is None else past

    def incoming(self) -> Array:
        """(3, n) back along the rays."""
        return -self._along

    def backfacing(self) -> Array:
        """(n,) zeros."""
        return np.zeros(self._along.shape[1])

    def image(self, texture: int, u: Array, v: Array) -> Array:
        """(4, n) RGBA."""
        return self._images[texture].read(u, v)

    def camera_position(self, shift: int) -> Array:
        """(3, n) along right and up of the camera, and the depth, of the direction."""
        return camera_position(*self._seen) if self._seen else np.zeros_like(self._along)

    def window(self, shift: int) -> Array:
        """(2, n) of the picture."""
        return window(*self._seen) if self._seen else np.zeros_like(self._along[:2])

    def light_path(self) -> tuple[Array, ...]:
        """Four times (n,): see `points.light_path`."""
        return light_path(self._kind, self._along.shape[1])

    def ray_depth(self) -> tuple[Array, ...]:
        """Four times (n,): as of `SurfacePoints.ray_depth`."""
        return tuple(self._past)


def radiance(
    program: Program,
    images: Images,
    along: Array,
    kind: str,
    seen: Seen | None = None,
    past: Array | None = None,
) -> Array:
    """(3, n) what the program's output gives in the directions (3, n), unit; 0 where it is not
    finite. seen, past: as `Sky` has them.
    """
    (value,) = run(program, Sky(images, along, kind, seen, past), along.shape[1])[:1]
    return np.where(np.isfinite(value), value, 0.0)
