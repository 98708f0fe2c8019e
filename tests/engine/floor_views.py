"""Viewing rays of the tests' camera and where they meet the floor."""

from __future__ import annotations

import numpy as np

from glint.engine import scene as s
from test_reference_support import (
    VIEW,
)


def viewing_rays(camera: s.Camera) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (h, w, 3) by the formulas of section 4.6."""
    (nx, ny), (left, right, bottom, top) = camera.resolution, camera.window
    u = (left + (np.arange(nx) + 0.5) * (right - left) / nx)[None, :, None]
    v = (bottom + (np.arange(ny) + 0.5) * (top - bottom) / ny)[:, None, None]
    x, y, w, e = camera.world_from_camera.T
    across = u * x + v * y
    if camera.kind == "PERSPECTIVE":
        return np.broadcast_to(e, across.shape), across - w
    return e + across, np.broadcast_to(-w, across.shape)


def floor_points(camera: s.Camera = VIEW) -> np.ndarray:
    """(h, w, 3) where the viewing rays meet z = 0."""
    o, d = viewing_rays(camera)
    return o - d * (o[..., 2:] / d[..., 2:])


def unit(a: np.ndarray) -> np.ndarray:
    return a / np.linalg.norm(a, axis=-1, keepdims=True)
