"""Blender's camera to frame, window and border, as Cycles frames it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...engine.scene import Camera, Lens
from ...engine.scene.panorama import Panorama, panorama_problems
from .panorama import Looker, eye_of, panorama_of
from .report import Report

Window = tuple[float, float, float, float]
Region = tuple[int, int, int, int]

_LEAST_STOP, _LEAST_FOCUS, _LEAST_RATIO = 1e-5, 1e-5, 1e-2


class ExportError(ValueError):
    """The scene cannot be rendered at all; the message says why and what to do."""


def resolution(render: Any, width: int | None = None, height: int | None = None) -> tuple[int, int]:
    """Pixels of the full frame: the scene's times its percentage, as Blender truncates it, unless
    given.
    """
    percentage = render.resolution_percentage
    return (
        max(1, width if width is not None else render.resolution_x * percentage // 100),
        max(1, height if height is not None else render.resolution_y * percentage // 100),
    )


def border(render: Any, size: tuple[int, int]) -> Region | None:
    """Blender's pixel rectangle of the render border, None without one. Float32 products, cut to
    integers as Blender does.
    """
    if not render.use_border:
        return None
    edges = (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)
    x0, y0, x1, y1 = (
        int(np.float32(edge) * np.float32(size[k % 2])) for k, edge in enumerate(edges)
    )
    if not (x0 < x1 and y0 < y1):
        raise ExportError("The render border holds no pixel: draw a larger border or turn it off")
    return x0, y0, x1, y1


def export_camera(
    camera: Any,
    render: Any,
    size: tuple[int, int],
    report: Report,
    looker: Looker | None = None,
) -> Camera:
    """The evaluated camera object (or any object, which then looks along its -z) for a frame of
    `size` pixels. looker: where a render's view looks from, None for the object's own place.

    Raises ExportError for one that is missing, not finite or flat, or sees nothing.
    """
    if camera is None:
        raise ExportError(
            "The scene has no camera: add one, or choose one in the scene's properties"
        )
    data = camera.data if camera.type == "CAMERA" else None
    matrix = np.array(camera.matrix_world, np.float64) if looker is None else looker.matrix
    frame = camera_frame(matrix, camera.name)
    if data is None:
        report.note(
            "{} is not a camera: the picture is taken through a 50 mm lens along its -z axis",
            camera.name,
        )
        lens = _light_lens(camera)
        return Camera(
            "PERSPECTIVE",
            frame,
            _window(size, _pixel_aspect(render), 18.0 / lens, "AUTO", (0.0, 0.0)),
            size,
            1e-5,
            1e5,
        )
    if data.type not in ("PERSP", "ORTHO", "PANO"):
        report.note(
            "Custom cameras are rendered as perspective ones ({}): choose another type",
            camera.name,
        )
    kind = _KINDS.get(data.type, "PERSPECTIVE")
    shift = (data.shift_x if looker is None else looker.shift_x, data.shift_y)
    window = _window_of(data, render, size, kind, shift)
    is_open = window[0] < window[1] and window[2] < window[3]
    if not (is_open and all(map(math.isfinite, window))):
        raise ExportError(
            f"Camera '{camera.name}' has a view of no width: set its orthographic scale or its "
            "lens, and its shift"
        )
    if not data.clip_start < data.clip_end:
        clip = f"its clip start {data.clip_start:g} is not below its clip end {data.clip_end:g}"
        raise ExportError(f"Camera '{camera.name}' shows nothing: {clip}; use a smaller clip start")
    return Camera(
        kind,
        frame,
        window,
        size,
        data.clip_start,
        data.clip_end,
        lens=_aperture(camera, data, frame, report) if data.dof.use_dof else None,
        panorama=_panorama(camera, render, size, report) if kind == "PANORAMA" else None,
        eye=eye_of(data.stereo, looker.side) if looker is not None and looker.side else None,
    )


_KINDS = {"ORTHO": "ORTHOGRAPHIC", "PANO": "PANORAMA"}


def flat_window(data: Any, render: Any, size: tuple[int, int]) -> Window:
    """(l, r, b, t) of the frame that Blender draws in a 3D view, which shows every camera but
    parallel ones as a perspective.
    """
    half = _sensor(data) / 2 / data.lens
    return _window(size, _pixel_aspect(render), half, data.sensor_fit, (data.shift_x, data.shift_y))


def _window_of(
    data: Any, render: Any, size: tuple[int, int], kind: str, shift: tuple[float, float]
) -> Window:
    if kind == "PANORAMA":
        return shift[0], 1 + shift[0], shift[1], 1 + shift[1]
    half = data.ortho_scale / 2 if kind == "ORTHOGRAPHIC" else _sensor(data) / 2 / data.lens
    return _window(size, _pixel_aspect(render), half, data.sensor_fit, shift)


def _panorama(camera: Any, render: Any, size: tuple[int, int], report: Report) -> Panorama:
    aspect = _pixel_aspect(render)
    panorama = panorama_of(camera.data, (size[0] * aspect[0], size[1] * aspect[1]), report)
    for problem in panorama_problems(panorama):
        raise ExportError(f"Camera '{camera.name}': {problem}")
    return panorama


def camera_frame(matrix: np.ndarray, name: str) -> np.ndarray:
    """(3, 4): the columns of an object's matrix without their scale. Mirrored and sheared ones stay
    so, as in Cycles.
    """
    if not np.isfinite(matrix).all():
        raise ExportError(
            f"Camera '{name}' stands at a place that is not finite: clear its transform or its "
            "constraints"
        )
    axes = matrix[:3, :3]
    lengths = np.linalg.norm(axes, axis=0)
    if (
        not (lengths > 0).all()
        or np.linalg.matrix_rank(axes / np.where(lengths > 0, lengths, 1)) < 3
    ):
        raise ExportError(f"Camera '{name}' is scaled to nothing: clear its scale")
    return np.concatenate([axes / lengths, matrix[:3, 3:]], 1)


def inverse_axes(axes: np.ndarray) -> np.ndarray:
    """(3, 3) of rank 3: its inverse, by cross products.

    NumPy's own wakes a thread of the linear algebra library, which then spins beside the tracer for
    30 to 80 ms.
    """
    x, y, z = axes.T
    rows = np.array([crossed(y, z), crossed(z, x), crossed(x, y)])
    return rows / (x @ rows[0])


def crossed(a: np.ndarray, b: np.ndarray) -> tuple[float, float, float]:
    """The cross product of two float64 vectors (3,), to the bits of NumPy's, which takes ten times
    as long for so few numbers.
    """
    (a0, a1, a2), (b0, b1, b2) = a.tolist(), b.tolist()
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


def _window(
    size: tuple[int, int],
    aspect: tuple[float, float],
    half: float,
    fit: str,
    shift: tuple[float, float],
) -> Window:
    """(l, r, b, t) of a window whose fitted side spans 2 `half`; lens shift is in shares of that
    side.
    """
    across, up = size[0] * aspect[0], size[1] * aspect[1]
    horizontal = across > up if fit == "AUTO" else fit == "HORIZONTAL"
    half_x, half_y = (half, half * up / across) if horizontal else (half * across / up, half)
    middle_x, middle_y = 2 * half * shift[0], 2 * half * shift[1]
    return middle_x - half_x, middle_x + half_x, middle_y - half_y, middle_y + half_y


def _sensor(data: Any) -> float:
    return data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width


def _aperture(camera: Any, data: Any, frame: np.ndarray, report: Report) -> Lens | None:
    """The lens of a camera with depth of field; None, with a note, where a number is not finite."""
    dof = data.dof
    focus = _focus_distance(dof, frame)
    # orthographic cameras have no focal length: Cycles gives them one of a metre
    length = 1.0 if data.type == "ORTHO" else data.lens * 1e-3
    radius = length / (2 * max(dof.aperture_fstop, _LEAST_STOP))
    numbers = radius, focus, dof.aperture_rotation, dof.aperture_ratio
    is_finite = all(map(math.isfinite, numbers)) and math.isfinite(dof.aperture_fstop)
    if not (is_finite and radius >= 0):
        report.note(
            "Camera {} has a focus distance, f-stop, aperture or lens that is not finite or "
            "negative: everything is in focus; set them anew, or the place of its focus object",
            camera.name,
        )
        return None
    if not focus >= _LEAST_FOCUS:
        report.note(
            "Camera {} is focused on its own place, so that nothing is sharp: set a focus "
            "distance, or move its focus object",
            camera.name,
        )
    return Lens(
        radius,
        max(focus, _LEAST_FOCUS),
        dof.aperture_blades if dof.aperture_blades >= 3 else 0,
        dof.aperture_rotation,
        max(dof.aperture_ratio, _LEAST_RATIO),
    )


def _focus_distance(dof: Any, frame: np.ndarray) -> float:
    """Along the view, of the focus object (or its bone) if there is one."""
    if dof.focus_object is None:
        return dof.focus_distance
    matrix = np.array(dof.focus_object.matrix_world, np.float64)
    bones = dof.focus_object.pose.bones if dof.focus_object.pose else {}
    if dof.focus_subtarget in bones:
        matrix = matrix @ np.array(bones[dof.focus_subtarget].matrix, np.float64)
    return float(abs(frame[:, 2] @ (frame[:, 3] - matrix[:3, 3])))


def _pixel_aspect(render: Any) -> tuple[float, float]:
    return render.pixel_aspect_x, render.pixel_aspect_y


def _light_lens(camera: Any) -> float:
    """Looking through a spot light takes in its cone; through anything else, 50 mm."""
    if camera.type == "LIGHT" and camera.data.type == "SPOT":
        return 16.0 / math.tan(camera.data.spot_size / 2)
    return 50.0
