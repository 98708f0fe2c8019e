"""Cameras whose picture is no plane: what of the directions round the eye it shows, and where an
eye of a pair stands (semantics/camera.md).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, inf, pi
from typing import Any

from .checks import Found, is_real, numbers, one_of

PROJECTIONS = (
    "EQUIRECTANGULAR",
    "FISHEYE_EQUIDISTANT",
    "FISHEYE_EQUISOLID",
    "FISHEYE_LENS_POLYNOMIAL",
    "MIRROR_BALL",
    "EQUIANGULAR_CUBEMAP_FACE",
    "CENTRAL_CYLINDRICAL",
)
"""As Cycles has them."""


@dataclass(frozen=True)
class Eye:
    """One eye of a pair that looks in every direction.

    offset: from the camera's place to the right of each direction, negative to its left.
    convergence: the distance at which both look at one point; infinite for parallel eyes.
    pole_merge: elevations, radians, between which the offset fades to nothing; None for no fading.
    up: (3,) unit, where elevations count to, in the world. A PANORAMA's up is its v instead. Units:
    the world's, of a PANORAMA the camera's.
    """

    offset: float
    convergence: float = inf
    pole_merge: tuple[float, float] | None = None
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Panorama:
    """How directions lie in the picture, which spans the unit square of (u, v).

    projection: one of PROJECTIONS; each reads what it needs of the rest. longitude, latitude: at
    the picture's left and right, bottom and top, radians; 0 is ahead, right and up are positive
    (EQUIRECTANGULAR; longitude also CENTRAL_CYLINDRICAL). heights: at the bottom and the top of a
    cylinder of radius 1. fov: angle of a fisheye's whole cone, radians. lens, sensor: focal length,
    width and height, one unit (EQUISOLID; sensor also of LENS_POLYNOMIAL). polynomial: minus the
    angle off the view, radians, as k0 + k1 r + … + k4 r⁴ of the distance r from the sensor's
    middle.
    """

    projection: str
    longitude: tuple[float, float] = (-pi, pi)
    latitude: tuple[float, float] = (-pi / 2, pi / 2)
    heights: tuple[float, float] = (-1.0, 1.0)
    fov: float = pi
    lens: float = 10.5
    sensor: tuple[float, float] = (36.0, 36.0)
    polynomial: tuple[float, float, float, float, float] = (0.0, -0.02, 0.0, 0.0, 0.0)


def panorama_problems(panorama: Any) -> Found:
    """What makes one unfit to look through, a sentence each."""
    if not isinstance(panorama, Panorama):
        yield f"panorama is a {type(panorama).__name__}: give a camera of that kind a Panorama"
        return
    yield from one_of("panorama's projection", panorama.projection, PROJECTIONS)
    for name in ("longitude", "latitude", "heights"):
        ends = getattr(panorama, name)
        found = [*numbers(f"panorama's {name}", ends, 2)]
        yield from found
        if not found and not 0 < abs(ends[1] - ends[0]) < inf:
            yield f"panorama's {name} {ends} spans nothing: use two different numbers"
    for name in ("fov", "lens"):
        yield from _above_zero(f"panorama's {name}", getattr(panorama, name))
    found = [*numbers("panorama's sensor", panorama.sensor, 2)]
    yield from found
    if not found and not min(panorama.sensor) > 0:
        yield f"panorama's sensor is {panorama.sensor}: use a width and a height above 0"
    yield from numbers("panorama's polynomial", panorama.polynomial, 5)


def eye_problems(eye: Any) -> Found:
    """What makes one unfit to look with, a sentence each."""
    if not isinstance(eye, Eye):
        yield f"eye is a {type(eye).__name__}: use an Eye or None"
        return
    yield from numbers("the eye's offset", (eye.offset,), 1)
    found = [*numbers("the eye's up", eye.up, 3)]
    yield from found
    if not found and not abs(hypot(*eye.up) - 1) < 1e-6:
        yield f"the eye's up {eye.up} is not of length 1: use a unit vector"
    if not (is_real(eye.convergence) and eye.convergence > 0):
        yield f"the eye's convergence is {eye.convergence!r}: use a distance above 0"
    if eye.pole_merge is None:
        return
    found = [*numbers("the eye's pole_merge", eye.pole_merge, 2)]
    yield from found
    if not found and not eye.pole_merge[0] < eye.pole_merge[1] > 0:
        yield f"the eye's pole_merge {eye.pole_merge} does not rise: use a larger second elevation"


def _above_zero(name: str, value: Any) -> Found:
    if not (is_real(value) and 0 < value < inf):
        yield f"{name} is {value!r}: use a finite number above 0"
