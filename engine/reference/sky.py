"""What rays see that hit nothing, where a world's program says it (SEMANTICS.md, Surroundings)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..program.program import Program
from .points import light_path
from .program import run
from .textures import Image

Array = np.ndarray
Images = Sequence[Image] | Mapping[int, Image]
"""By the number of the texture."""


class Sky:
    """What the program of a world reads where rays in the directions (3, n), unit, hit nothing."""

    def __init__(self, images: Images, along: Array, kind: str) -> None:
        """kind: of the rays, "camera", "mirror" or "scattered"."""
        self._images, self._along, self._kind = images, along, kind

    def incoming(self) -> Array:
        """(3, n) back along the rays."""
        return -self._along

    def backfacing(self) -> Array:
        """(n,) zeros."""
        return np.zeros(self._along.shape[1])

    def image(self, texture: int, u: Array, v: Array) -> Array:
        """(4, n) RGBA."""
        return self._images[texture].read(u, v)

    def light_path(self) -> tuple[Array, ...]:
        """Four times (n,): see `points.light_path`."""
        return light_path(self._kind, self._along.shape[1])


def radiance(program: Program, images: Images, along: Array, kind: str) -> Array:
    """(3, n) what the program's output gives in the directions (3, n); 0 where it is not finite."""
    (value,) = run(program, Sky(images, along, kind), along.shape[1])[:1]
    return np.where(np.isfinite(value), value, 0.0)
