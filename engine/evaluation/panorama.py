"""Where the points of a panorama's picture look, and where directions are in it
(semantics/camera.md). Vectors (3, n) are along the camera's axes: right, up, backward.
"""

from __future__ import annotations

import numpy as np

from ..linear.columns import cross, dot, length, unit
from ..scene import Camera
from ..scene.panorama import Eye, Panorama

Array = np.ndarray

_FORWARD = np.array([[0.0], [0.0], [-1.0]])
_STEPS = 20


def looks(panorama: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    """Unit directions (3, n) of the points (u, v) of the picture, (n,) each, and whether anything
    is to be seen there; forward where not.
    """
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        d, seen = _LOOKS[panorama.projection](panorama, u, v)
        seen = seen & np.isfinite(d).all(0)
        return np.where(seen, unit(np.where(seen, d, _FORWARD)), _FORWARD), seen


def _everywhere(d: Array) -> tuple[Array, Array]:
    return d, np.ones(d.shape[1], bool)


def _equirectangular(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    longitude, latitude = _mixed(p.longitude, u), _mixed(p.latitude, v)
    level = np.cos(latitude)
    return _everywhere(
        np.stack([level * np.sin(longitude), np.sin(latitude), -level * np.cos(longitude)])
    )


def _central_cylindrical(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    longitude = _mixed(p.longitude, u)
    return _everywhere(np.stack([np.sin(longitude), _mixed(p.heights, v), -np.cos(longitude)]))


def _cubemap_face(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    x, y = (np.tan((a - 0.5) * (np.pi / 2)) for a in (u, v))
    return _everywhere(np.stack([x, y, -np.ones_like(x)]))


def _mirror_ball(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    """Of backward in unit normals that turn away from the camera."""
    x, y = 2 * u - 1, 2 * v - 1
    square = 1 - x * x - y * y
    h = np.sqrt(np.maximum(square, 0.0))
    return np.stack([2 * h * x, 2 * h * y, 1 - 2 * h * h]), square >= 0


def _equidistant(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    x, y = 2 * (u - 0.5), 2 * (v - 0.5)
    r = np.hypot(x, y)
    return _turned_off(r * p.fov / 2, x, y), np.sqrt(x * x + y * y) <= 1


def _equisolid(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    x, y = (u - 0.5) * p.sensor[0], (v - 0.5) * p.sensor[1]
    half = np.sqrt(x * x + y * y) / (2 * p.lens)
    seen = half <= np.sin(p.fov / 4)
    return _turned_off(2 * np.arcsin(np.where(seen, half, 0.0)), x, y), seen


def _lens_polynomial(p: Panorama, u: Array, v: Array) -> tuple[Array, Array]:
    x, y = (u - 0.5) * p.sensor[0], (v - 0.5) * p.sensor[1]
    angle = -np.polyval(p.polynomial[::-1], np.hypot(x, y))
    return _turned_off(angle, x, y), np.abs(angle) <= p.fov / 2


_LOOKS = {
    "EQUIRECTANGULAR": _equirectangular,
    "FISHEYE_EQUIDISTANT": _equidistant,
    "FISHEYE_EQUISOLID": _equisolid,
    "FISHEYE_LENS_POLYNOMIAL": _lens_polynomial,
    "MIRROR_BALL": _mirror_ball,
    "EQUIANGULAR_CUBEMAP_FACE": _cubemap_face,
    "CENTRAL_CYLINDRICAL": _central_cylindrical,
}


def _turned_off(angle: Array, x: Array, y: Array) -> Array:
    """(3, n) at angles off the view towards (x, y), upward where that is zero."""
    size = np.hypot(x, y)
    aside = size > 0
    across = np.where(aside, x, 0.0), np.where(aside, y, 1.0)
    s = np.sin(angle) / np.where(aside, size, 1.0)
    return np.stack([across[0] * s, across[1] * s, -np.cos(angle)])


def _mixed(ends: tuple[float, float], share: Array) -> Array:
    return ends[0] + (ends[1] - ends[0]) * share


def _share(ends: tuple[float, float], at: Array) -> Array:
    return (at - ends[0]) / (ends[1] - ends[0])


def through_lens(d: Array, lens: Array, focus: float) -> tuple[Array, Array]:
    """Origins and unit directions of rays through points (2, n) of a lens across the directions d,
    which are sharp at the distance `focus`.
    """
    across = _FORWARD - dot(_FORWARD, d) * d
    towards = unit(np.where(across.any(0), across, [[0.0], [1.0], [0.0]]))
    o = lens[0] * towards + lens[1] * unit(cross(d, towards))
    return o, unit(d - o / focus)


def from_eye(eye: Eye, up: Array, right: Array, o: Array, d: Array) -> tuple[Array, Array]:
    """Origins and unit directions of the rays o, d (3, n) as an eye of a pair sees them. up: (3, 1)
    unit. right: (3, 1) or (3, n), where the eye stands if a ray goes up or down.
    """
    side = cross(d, up + 0 * d)
    offset = np.full(d.shape[1], eye.offset)
    if eye.pole_merge is not None:
        start, end = eye.pole_merge
        elevation = np.abs(np.arcsin(np.clip(dot(up, d), -1.0, 1.0)))
        with np.errstate(over="ignore"):
            share = np.clip((elevation - start) / (end - start), 0.0, 1.0)
        offset = np.where(elevation > end, 0.0, offset * np.cos(np.pi / 2 * share))
    aside = offset * unit(np.where(side.any(0), side, right))
    with np.errstate(invalid="ignore", over="ignore"):
        return o + aside, unit(d - aside / eye.convergence)


def picture_points(panorama: Panorama, d: Array) -> tuple[Array, Array]:
    """(n,) u and v of the points of the picture that look along unit directions d."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        return _picture_points(panorama, d)


def _picture_points(p: Panorama, d: Array) -> tuple[Array, Array]:
    x, y, z = d
    level, longitude = np.hypot(x, z), np.arctan2(x, -z)
    match p.projection:
        case "EQUIRECTANGULAR":
            return _share(p.longitude, longitude), _share(p.latitude, np.arctan2(y, level))
        case "CENTRAL_CYLINDRICAL":
            return _share(p.longitude, longitude), _share(p.heights, y / level)
        case "EQUIANGULAR_CUBEMAP_FACE":
            return 0.5 + longitude * 2 / np.pi, 0.5 + np.arctan2(y, -z) * 2 / np.pi
        case "MIRROR_BALL":
            size = 2 * np.sqrt(np.maximum((1 - z) / 2, 0.0))
            x, y = (np.where(size > 0, a / np.where(size > 0, size, 1.0), 0.0) for a in (x, y))
            return 0.5 + x / 2, 0.5 + y / 2
    across = np.hypot(x, y)
    angle, safe = np.arctan2(across, -z), np.where(across > 0, across, 1.0)
    width, height = (1.0, 1.0) if p.projection == "FISHEYE_EQUIDISTANT" else p.sensor
    r = np.where(across > 0, _distance(p, angle), 0.0)
    return 0.5 + np.where(across > 0, r * x / safe, 0.0) / width, 0.5 + np.where(
        across > 0, r * y / safe, 0.0
    ) / height


def _distance(p: Panorama, angle: Array) -> Array:
    """From the middle of a fisheye's picture; of a polynomial by Newton's method from its linear
    part.
    """
    if p.projection == "FISHEYE_EQUIDISTANT":
        return angle / p.fov
    if p.projection == "FISHEYE_EQUISOLID":
        return 2 * p.lens * np.sin(angle / 2)
    k = np.array(p.polynomial[::-1])
    slope = np.polyder(k)
    r = (-angle - p.polynomial[0]) / p.polynomial[1]
    for _ in range(_STEPS):
        r = r + (-angle - np.polyval(k, r)) / np.polyval(slope, r)
    return r


def step_size(camera: Camera) -> float:
    """A tenth of a pixel in the middle of the picture, at the distance 1; where nothing is seen
    there, of a whole turn's.
    """
    left, right, bottom, top = camera.window
    middle, pixel = (left + right) / 2, (right - left) / camera.resolution[0]
    u = np.array([middle, middle + pixel])
    assert camera.panorama is not None
    d, seen = looks(camera.panorama, u, np.full(2, (bottom + top) / 2))
    step = float(length(d[:, 1:] - d[:, :1])[0])
    return 0.1 * (step if seen.all() and step > 0 else 2 * np.pi / camera.resolution[0])
