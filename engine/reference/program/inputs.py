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


def position(points) -> np.ndarray:
    return points.position()


def normal(points) -> np.ndarray:
    return points.normal()


def face_normal(points) -> np.ndarray:
    return points.face_normal()


def incoming(points) -> np.ndarray:
    return points.incoming()


def backfacing(points) -> np.ndarray:
    return points.backfacing()


def object_position(points) -> np.ndarray:
    return points.object_position()


def object_normal(points) -> np.ndarray:
    return points.object_normal()


def object_location(points) -> np.ndarray:
    return points.object_location()


def camera_position(points) -> np.ndarray:
    return points.camera_position()


def window(points) -> np.ndarray:
    """(x, y, 0)."""
    x, y = points.window()
    return np.stack([x, y, np.zeros_like(x)])


def reflection(points) -> np.ndarray:
    return points.reflection()


def image(points, vector: np.ndarray, *, texture: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour (3, n) and alpha (n,)."""
    rgba = points.image(texture, vector[0], vector[1])
    return rgba[:3], rgba[3]
