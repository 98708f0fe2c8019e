"""Operations that ask the scene for rays; the first argument is `Points`. Where these know no
scene, or rays to lights meet them, nothing is there.
"""

from __future__ import annotations

import numpy as np

from ..vectors import across_normals, unit


def ambient_occlusion(
    points,
    distance: np.ndarray,
    normal: np.ndarray,
    *,
    samples: int,
    inside: int,
    only_local: int,
    of_world: int,
) -> np.ndarray:
    """(n,) the share of the directions in which nothing is near."""
    queries = getattr(points, "queries", None)
    if queries is None:
        return np.ones(normal.shape[1])
    n = unit(np.where(np.isfinite(normal), normal, 0.0)) * (-1.0 if inside else 1.0)
    reach = np.full(n.shape[1], queries.reach) if of_world else distance
    reach = np.where(n.any(0) & (reach > 0), reach, 0.0)
    across, upward = across_normals(n)
    hidden = np.zeros(n.shape[1])
    for x, y in queries.disc_points(samples):
        height = np.sqrt(max(0.0, 1 - x * x - y * y))
        hidden += points.blocked(x * across + y * upward + height * n, reach, bool(only_local))
    return 1 - hidden / samples
