"""What makes cameras unfit to render."""

from __future__ import annotations

from numbers import Integral
from typing import Any

import numpy as np

from ..linear import determinant, length, pseudo_inverse
from .checks import Found, array, finite_array, numbers, one_of, placement
from .model import CAMERAS, Camera, Lens
from .panorama import eye_problems, panorama_problems

_DOUBTFUL_VOLUME = 1e-6
"""Of three unit axes: from it on the smallest singular value is at least 5e-7 of the largest, far
from rounding.
"""


def _not_a_frame(name: str, matrix: np.ndarray) -> Found:
    sizes = length(matrix[:, :3].T)
    if np.any(sizes == 0) or _is_flat(matrix[:, :3] / sizes):
        yield f"{name} is flattened: give the camera three independent axes"


def _is_flat(axes: np.ndarray) -> bool:
    """(3, 3) unit columns. The decomposition decides, where the volume of the axes leaves a
    doubt.
    """
    is_doubtful = not abs(determinant(axes)) >= _DOUBTFUL_VOLUME
    return is_doubtful and bool(pseudo_inverse(axes).rank < 3)


def camera_problems(camera: Camera) -> Found:
    yield from one_of("kind", camera.kind, CAMERAS)
    yield from placement("world_from_camera", camera.world_from_camera, _not_a_frame)
    yield from _window(camera)
    yield from _resolution(camera)
    yield from _clip(camera)
    if camera.kind == "PANORAMA":
        yield from panorama_problems(camera.panorama)
    if camera.eye is not None:
        yield from eye_problems(camera.eye)
        if camera.kind == "ORTHOGRAPHIC":
            yield "eye is for cameras that look from one place: use None"
    if camera.lens is not None:
        yield from _lens(camera.lens)
    if camera.motion is not None:
        yield from _motion(camera.motion)
    if camera.shutter is not None:
        yield from _shutter(camera.shutter)


def _window(camera: Camera) -> Found:
    problems = [*numbers("window", camera.window, 4)]
    yield from problems
    if not problems and (
        camera.window[0] == camera.window[1] or camera.window[2] == camera.window[3]
    ):
        yield f"window {camera.window} has no area: use l different from r and b from t"


def _resolution(camera: Camera) -> Found:
    try:
        nx, ny = camera.resolution
        sound = isinstance(nx, Integral) and isinstance(ny, Integral) and nx >= 1 and ny >= 1
    except (TypeError, ValueError):
        sound = False
    if not sound:
        yield f"resolution is {camera.resolution!r}: use two whole numbers, 1 or more"


def _clip(camera: Camera) -> Found:
    start, end = camera.clip_start, camera.clip_end
    # An orthographic view may start behind its plane, as Blender's viewport does; no ray of a
    # perspective goes there.
    if camera.kind != "ORTHOGRAPHIC" and not start >= 0:
        yield f"clip_start is {start!r}: use 0 or more"
    if not start < end:
        yield (
            f"clip_start {start!r} and clip_end {end!r} leave nothing between: use a smaller "
            "clip_start"
        )
    if len(camera.clip_planes) > 6:
        yield f"clip_planes has {len(camera.clip_planes)} rows: use 6 at most"
    if len(camera.clip_planes) and camera.kind == "PANORAMA":
        yield "clip_planes cut panoramas nowhere: use ()"
    elif len(camera.clip_planes) and camera.eye is not None:
        yield "clip_planes cut nothing for an eye of a pair: use ()"
    for plane in camera.clip_planes:
        yield from numbers("clip_planes", plane, 4)


def _shutter(opening: Any) -> Found:
    found = [*array("shutter", opening, np.float64, (None,))]
    found = found or [*finite_array("shutter", opening)]
    yield from found
    if not found and (len(opening) < 2 or opening.min() < 0 or not opening.any()):
        yield "shutter is never open: use two or more numbers of at least 0, not all 0, or None"


def _motion(keys: np.ndarray) -> Found:
    found = [*array("motion", keys, np.float64, (None, 3, 4))]
    found = found or [*finite_array("motion", keys)]
    yield from found
    if found:
        return
    if len(keys) < 2:
        yield f"motion has {len(keys)} keys: use two or more, or None"
    for key in keys:
        yield from _not_a_frame("motion", key[:, :3])


def _lens(lens: Lens) -> Found:
    values = lens.radius, lens.focus, lens.rotation, lens.ratio
    problems = [*numbers("lens", values, 4)]
    yield from problems
    if not problems and not (lens.radius >= 0 and lens.focus > 0 and lens.ratio > 0):
        yield (
            f"lens has radius {lens.radius!r}, focus {lens.focus!r} and ratio {lens.ratio!r}: use "
            "a radius of 0 or more, the others above 0"
        )
    if not (isinstance(lens.blades, Integral) and (lens.blades == 0 or lens.blades >= 3)):
        yield f"lens has {lens.blades!r} blades: use 0, or 3 and more"
