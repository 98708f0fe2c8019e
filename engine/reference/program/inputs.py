"""Operations that read the shaded points; the first argument is `Points`."""

from __future__ import annotations

import numpy as np

from ..optics import fresnel as dielectric
from ..vectors import dot


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


def fresnel(points, ior: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The unpolarised reflectance of a dielectric."""
    index = np.fmax(ior, 1e-5)
    return _reflectance(points, normal, np.where(points.backfacing() > 0, 1 / index, index))


def layer_weight(points, blend: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Fresnel and Facing."""
    index = np.fmax(1 - blend, 1e-5)
    relative = np.where(points.backfacing() > 0, index, 1 / index)
    held = np.clip(blend, 0.0, 1 - 1e-5)
    exponent = np.where(held < 0.5, 2 * held, 0.5 / (1 - held))
    facing = 1 - np.abs(dot(points.incoming(), normal)) ** exponent
    return _reflectance(points, normal, relative), facing


def _reflectance(points, normal: np.ndarray, relative: np.ndarray) -> np.ndarray:
    return dielectric(np.abs(dot(points.incoming(), normal)), relative)


def light_path(points) -> tuple[np.ndarray, ...]:
    """Camera, shadow, bounced."""
    return points.light_path()


def image(points, vector: np.ndarray, *, texture: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour (3, n) and alpha (n,)."""
    rgba = points.image(texture, vector[0], vector[1])
    return rgba[:3], rgba[3]
