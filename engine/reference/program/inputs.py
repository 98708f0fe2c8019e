"""Operations that read the shaded points; the first argument is `Points`."""

from __future__ import annotations

import numpy as np


def attribute(points, *, attribute: str) -> tuple[np.ndarray, np.ndarray]:
    """Channels (3, n) and alpha (n,)."""
    channels = points.attribute(attribute)
    return channels[:3], channels[3]


def uv(points, *, attribute: str) -> np.ndarray:
    """(u, v, 0)."""
    u, v = points.uv(attribute)
    return np.stack([u, v, np.zeros_like(u)])


def image(points, vector: np.ndarray, *, texture: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour (3, n) and alpha (n,)."""
    rgba = points.image(texture, vector[0], vector[1])
    return rgba[:3], rgba[3]
