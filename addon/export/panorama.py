"""Blender's panoramic cameras, and the eyes of stereoscopic pairs, as Cycles has them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...engine.scene.panorama import PROJECTIONS, Eye, Panorama
from .report import Report

_OTHER_NAMES = {"MIRRORBALL": "MIRROR_BALL"}


@dataclass(frozen=True, eq=False)
class Looker:
    """Where a render's view looks from, as Blender's own functions of its render engine tell.

    camera: the evaluated object. matrix: (4, 4) float64, the place of the view's eye. shift_x: of
    its lens. side: -1 for the left and 1 for the right eye of a pair that looks in every direction,
    which the matrix does not tell apart; else 0.
    """

    camera: Any
    matrix: np.ndarray
    shift_x: float
    side: int = 0


def panorama_of(data: Any, aspect: tuple[float, float], report: Report) -> Panorama:
    """Of a panoramic camera's data for a frame with sides like `aspect`."""
    kind = _setting(data, "panorama_type", "FISHEYE_EQUISOLID")
    kind = _OTHER_NAMES.get(kind, kind)
    if kind not in PROJECTIONS:
        report.note(
            "The panorama type {} is unknown: an equirectangular one takes its place; choose "
            "another type",
            kind,
        )
        kind = "EQUIRECTANGULAR"
    cylindrical = kind == "CENTRAL_CYLINDRICAL"
    around = "central_cylindrical_range_u" if cylindrical else "longitude"
    radius = _setting(data, "central_cylindrical_radius", 1.0) if cylindrical else 1.0
    heights = _range(data, "central_cylindrical_range_v", 1.0)
    return Panorama(
        kind,
        longitude=_range(data, around, math.pi),
        latitude=_range(data, "latitude", math.pi / 2),
        heights=(heights[0] / radius, heights[1] / radius),
        fov=_setting(data, "fisheye_fov", math.pi),
        lens=_setting(data, "fisheye_lens", 10.5),
        sensor=_sensor(data, aspect),
        polynomial=tuple(_setting(data, f"fisheye_polynomial_k{k}", 0.0) for k in range(5)),
    )


def _setting(data: Any, name: str, default: Any) -> Any:
    """Blender 5 keeps them at the camera, those before it among Cycles' own, where Cycles is on."""
    here = data if hasattr(data, name) else getattr(data, "cycles", None)
    return getattr(here, name, default)


def _range(data: Any, name: str, half: float) -> tuple[float, float]:
    return _setting(data, f"{name}_min", -half), _setting(data, f"{name}_max", half)


def _sensor(data: Any, aspect: tuple[float, float]) -> tuple[float, float]:
    """Width and height: the side that is fitted is the sensor's, the other follows the frame."""
    across, up = aspect
    fit = data.sensor_fit
    horizontal = across > up if fit == "AUTO" else fit == "HORIZONTAL"
    size = data.sensor_height if fit == "VERTICAL" else data.sensor_width
    return (size, size * up / across) if horizontal else (size * across / up, size)


def eye_of(stereo: Any, side: int) -> Eye:
    """Of a camera's stereoscopy. side: as of `Looker`, not 0."""
    parallel = stereo.convergence_mode == "PARALLEL"
    start, end = stereo.pole_merge_angle_from, stereo.pole_merge_angle_to
    merges = stereo.use_pole_merge and end > 0
    return Eye(
        side * stereo.interocular_distance / 2,
        math.inf if parallel else stereo.convergence_distance,
        (min(start, math.nextafter(end, 0.0)), end) if merges else None,  # at once if they cross
    )
