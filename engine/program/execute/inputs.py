"""Operations that read the shaded points, beyond asking them; the first argument is `Points`."""

from __future__ import annotations

import numpy as np

from ...linear.columns import cross, dot, unit
from ..operations_input import NormalSpace, Shift, Space, VectorType


def fresnel_dielectric(cosine: np.ndarray, index: np.ndarray) -> np.ndarray:
    """(n,) unpolarised reflectance of a dielectric for the cosine of incidence (n,); `index` is
    that beyond the surface over that before it.
    """
    sine2 = (1 - cosine * cosine) / (index * index)
    inner = np.sqrt(np.maximum(0.0, 1 - sine2))
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (cosine - index * inner) / (cosine + index * inner)
        along = (index * cosine - inner) / (index * cosine + inner)
    return np.where(sine2 >= 1, 1.0, (across * across + along * along) / 2)


def attribute(points, *, attribute: str, shift: int) -> tuple[np.ndarray, np.ndarray]:
    """Channels (3, n) and alpha (n,)."""
    channels = points.attribute(attribute, shift)
    return channels[:3], channels[3]


def uv(points, *, attribute: str, shift: int) -> np.ndarray:
    """(u, v, 0)."""
    u, v = points.uv(attribute, shift)
    return np.stack([u, v, np.zeros_like(u)])


def normal_to_world(points, vector: np.ndarray) -> np.ndarray:
    return points.normal_to_world(vector)


def transform_vector(
    points, vector: np.ndarray, *, vector_type: int, convert_from: int, convert_to: int
) -> np.ndarray:
    """In another space, through the world's."""
    is_normal, is_point = vector_type == VectorType.NORMAL, vector_type == VectorType.POINT
    if convert_from != convert_to:
        if convert_from == Space.CAMERA:
            vector = points.from_camera(vector, is_point)
        elif convert_from == Space.OBJECT:
            own = points.normal_to_world if is_normal else points.from_object
            vector = own(vector) if is_normal else own(vector, is_point)
        if convert_to == Space.CAMERA:
            vector = points.to_camera(vector, is_point)
        elif convert_to == Space.OBJECT:
            own = points.normal_to_object if is_normal else points.to_object
            vector = own(vector) if is_normal else own(vector, is_point)
    return unit(vector) if is_normal else vector


def instance_value(points, *, attribute: str) -> tuple[np.ndarray, np.ndarray]:
    """Vector (3, n) and alpha (n,)."""
    found = points.instance_value(attribute)
    return found[:3], found[3]


def window(points, *, shift: int) -> np.ndarray:
    """(x, y, 0)."""
    x, y = points.window(shift)
    return np.stack([x, y, np.zeros_like(x)])


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
    return fresnel_dielectric(np.abs(dot(points.incoming(), normal)), relative)


def normal_map(
    points, color: np.ndarray, strength: np.ndarray, *, space: int, attribute: str
) -> np.ndarray:
    """The bent shading normal, unit, in the world."""
    mapped, strength = 2 * color - 1, np.fmax(strength, 0.0)
    if space in (NormalSpace.BLENDER_OBJECT, NormalSpace.BLENDER_WORLD):
        mapped = mapped * np.array([[1.0], [-1.0], [-1.0]])
    side = 1 - 2 * points.backfacing()
    if space == NormalSpace.TANGENT:
        normal, tangent = points.object_normal() * side, points.attribute(attribute, 0)
        across = tangent[3] * cross(normal, tangent[:3])
        up = 1 + np.clip(strength, 0.0, 1.0) * (mapped[2] - 1)
        bent = strength * (mapped[0] * tangent[:3] + mapped[1] * across) + up * normal
        bent = points.normal_to_world(unit(bent)) * side
        return np.where(tangent[:3].any(0) & bent.any(0), bent, points.normal())
    if space in (NormalSpace.OBJECT, NormalSpace.BLENDER_OBJECT):
        bent = points.normal_to_world(unit(mapped))
    else:
        bent = unit(mapped)
    bent, own = bent * side, points.normal()
    mixed = unit(own + (bent - own) * strength)
    return np.where(mixed.any(0), mixed, own)


def bump(
    points,
    height: np.ndarray,
    first: np.ndarray,
    second: np.ndarray,
    strength: np.ndarray,
    distance: np.ndarray,
    normal: np.ndarray,
    *,
    width: int,
) -> np.ndarray:
    """Mikkelsen, "Surface gradient-based bump mapping framework" (2020): n minus the gradient of
    the height along the surface.
    """
    one, two = (points.shift(axis.by(width)) for axis in (Shift.FIRST, Shift.SECOND))
    across, along = cross(two, normal), cross(normal, one)
    size = dot(one, across)
    gradient = (first - height) * across + (second - height) * along
    bent = unit(np.abs(size) * normal - distance * np.copysign(1.0, size) * gradient)
    held = np.fmax(strength, 0.0)
    mixed = unit(held * bent + (1 - held) * normal)
    return np.where(mixed.any(0), mixed, normal)


def image(points, vector: np.ndarray, *, texture: int) -> tuple[np.ndarray, np.ndarray]:
    """Colour (3, n) and alpha (n,)."""
    rgba = points.image(texture, vector[0], vector[1])
    return rgba[:3], rgba[3]
