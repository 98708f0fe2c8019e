"""Point clouds to true spheres."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...engine.scene import Spheres

DEFAULT_RADIUS = 0.01
"""Blender's radius of points without one, object units."""


def export_points(cloud: Any) -> Spheres | None:
    """An evaluated PointCloud data-block as spheres with material slot 0; None without points."""
    count = len(cloud.points)
    if count == 0:
        return None
    centers = np.empty((count, 3), np.float32)
    cloud.attributes["position"].data.foreach_get("vector", centers.reshape(-1))
    radii = np.full(count, DEFAULT_RADIUS, np.float32)
    radius = cloud.attributes.get("radius")
    if radius is not None:
        radius.data.foreach_get("value", radii)
    return Spheres(cloud.name, centers, radii)
