"""Where samples look through a camera's lens (semantics/camera.md)."""

from __future__ import annotations

import numpy as np

from ..scene import Lens
from .patterns import concentric_disc, lens_square

Array = np.ndarray

BLOCK = 2
"""Side of the squares of pixels whose samples look through the lens at different points."""


def lens_points(lens: Lens, samples: int) -> Array:
    """(BLOCK², samples, 2) float64 points of the lens by pixel of a block, row by row: along u and
    v, camera units. Even over the area of the aperture.
    """
    square = lens_square(BLOCK, samples)
    disc = concentric_disc(square.reshape(-1, 2))
    inside = _polygon(disc, lens.blades, lens.rotation) if lens.blades else disc
    return (inside * (lens.radius / lens.ratio, lens.radius)).reshape(square.shape)


def _polygon(disc: Array, corners: int, rotation: float) -> Array:
    """(k, 2) points of the unit disc to the regular polygon in it, areas kept: a sector becomes the
    triangle between its ends, arcs lines. The first side's middle is at `rotation`.
    """
    turn = 2 * np.pi / corners
    sectors = np.arctan2(disc[:, 1], disc[:, 0]) / turn % corners
    first = np.minimum(np.floor(sectors), corners - 1)
    share, angle = (sectors - first)[:, None], rotation + (first - 0.5) * turn
    ends = [np.stack([np.cos(a), np.sin(a)], -1) for a in (angle, angle + turn)]
    radius = np.sqrt((disc * disc).sum(-1, keepdims=True))
    return radius * ((1 - share) * ends[0] + share * ends[1])
