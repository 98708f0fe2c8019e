"""How much of an even sky is open over what camera rays meet (SEMANTICS.md, "Passes")."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..sampling import occlusion_points
from .surface import Surface
from .vectors import cross, unit

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray

_AXIS = np.array([[1.0], [2.0], [3.0]])
"""Round it the directions of neighbours that face along it turn fast."""


def openness(stage: Stage, surface: Surface, sample: int, on_rays: Callable[[], None]) -> Array:
    """(3, n) the share of the directions in which nothing is within reach, less what things on the
    way take of it. on_rays: called for each direction.
    """
    count, reach = len(surface), stage.scene.world.occlusion_distance
    if not reach > 0:
        return np.ones((3, count))
    each = stage.settings.dome_samples
    points = occlusion_points(stage.settings.samples, each)
    first = sample % (len(points) // each) * each
    across, upward = _across(surface.n)
    total = np.zeros((3, count))
    for x, y in points[first : first + each]:
        height = np.sqrt(max(0.0, 1 - x * x - y * y))
        direction = x * across + y * upward + height * surface.n
        total += stage.shadows.near(surface, direction, reach)
        on_rays()
    return total / each


def _across(n: Array) -> tuple[Array, Array]:
    """Two unit vectors (3, n) each across the unit vectors n."""
    first = cross(_AXIS + 0 * n, n)
    other = cross(np.array([[1.0], [0.0], [0.0]]) + 0 * n, n)
    t = unit(np.where(first.any(0), first, other))
    return t, cross(n, t)
