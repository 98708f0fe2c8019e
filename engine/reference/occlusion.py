"""How much of an even sky is open over what camera rays meet (semantics/passes.md)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import across_normals
from ..sampling import occlusion_points
from .stage import Stage

Array = np.ndarray


def openness(stage: Stage, surface: Surface, sample: int, on_rays: Callable[[], None]) -> Array:
    """(3, n) the share of the directions in which nothing is within reach, less what things on the
    way take of it. on_rays: called for each direction.
    """
    count, reach = len(surface), stage.scene.world.occlusion_distance
    if not reach > 0:
        return np.ones((3, count))
    each = stage.settings.occlusion_samples
    points = occlusion_points(stage.samples, each)
    first = sample % (len(points) // each) * each
    across, upward = across_normals(surface.n)
    total = np.zeros((3, count))
    for x, y in points[first : first + each]:
        height = np.sqrt(max(0.0, 1 - x * x - y * y))
        direction = x * across + y * upward + height * surface.n
        total += stage.shadows.near(surface, direction, reach)
        on_rays()
    return total / each
