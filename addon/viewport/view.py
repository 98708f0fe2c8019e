"""What a 3D view looks at: Blender's matrices to `engine.scene.Camera`.

Rays come from `region_data.window_matrix`, which holds every projection, zoom, offset and shift.
Through the scene's camera, where the view shows the render's pixels one to one, the render's own
camera takes over, so that the picture can equal the render's.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...engine.scene import Camera
from ..export import ExportError
from ..export.camera import border, export_camera, flat_window, inverse_axes, resolution
from ..export.culling import Culling, culls
from ..export.report import Report

Rectangle = tuple[int, int, int, int]
Window = tuple[float, float, float, float]

_SAME_PIXEL = 0.02
"""Pixels by which float32 matrices may misplace a frame that lies on whole pixels."""
_PIXEL_SIZES = {"1": 1, "2": 2, "4": 4, "8": 8}


@dataclass(frozen=True)
class Frame:
    """The render's frame inside a view that shows it one to one. camera: the render's.  x, y: of
    its lower left corner in the view.
    """

    camera: Camera
    x: int
    y: int


@dataclass(frozen=True)
class View:
    """camera: of the whole region, a pixel of which spans `pixel_size` of the screen.

    border: (x0, y0, x1, y1) of these pixels to which the picture is restricted, or None.
    size: of the region on the screen.  frame: where the render's pixels are, if they coincide.
    key: equal for views with the same picture.
    """

    camera: Camera
    border: Rectangle | None
    size: tuple[int, int]
    pixel_size: int
    frame: Frame | None
    key: tuple

    @property
    def place(self) -> np.ndarray:
        """(16,) numbers that tell how far one view is from another: eye, axes and window."""
        return np.concatenate([np.ravel(self.camera.world_from_camera), self.camera.window])

    @property
    def shown(self) -> Rectangle:
        """The pixels that are traced."""
        return self.border or (0, 0, *self.camera.resolution)


def read_view(depsgraph: Any, region: Any, space: Any, region_data: Any) -> View:
    """The view of a region. Raises ExportError for a camera that cannot be looked through."""
    size = (max(1, region.width), max(1, region.height))
    pixel_size = _pixel_size(depsgraph.scene_eval.render)
    pixels = tuple(math.ceil(extent / pixel_size) for extent in size)
    projection = np.array(region_data.window_matrix, np.float64)
    view_from_world = np.array(region_data.view_matrix, np.float64)
    axes = inverse_axes(view_from_world[:3, :3])
    world_from_view = np.concatenate([axes, -axes @ view_from_world[:3, 3:]], 1)
    camera = view_camera(projection, world_from_view, pixels, size, pixel_size)
    frame = None
    scene_camera = _camera_object(space, region_data, depsgraph)
    if scene_camera is not None:
        camera, frame = _through_camera(camera, scene_camera, depsgraph.scene_eval.render)
    planes = () if camera.kind == "PANORAMA" else clip_planes(region_data, camera)
    if planes:
        camera, frame = replace(camera, clip_planes=planes), None
    part = _border(space, region_data, depsgraph.scene_eval.render, camera, frame, scene_camera)
    key = (
        projection.tobytes(),
        camera.world_from_camera.tobytes(),
        camera.window,
        camera.lens,
        camera.panorama,
        planes,
        size,
        pixel_size,
        part,
        _key(frame),
    )
    return View(camera, part, size, pixel_size, frame if pixel_size == 1 else None, key)


def view_camera(
    projection: np.ndarray,
    world_from_view: np.ndarray,
    pixels: tuple[int, int],
    size: tuple[int, int],
    pixel_size: int,
) -> Camera:
    """The camera of a (4, 4) window matrix and the (3, 4) inverse of a view matrix.

    pixels: of the picture.  size: of the region; the last row and column of pixels may reach beyond
    it.
    """
    perspective = projection[3, 2] != 0
    left, right, bottom, top = window_of(projection)
    right = left + (right - left) * pixels[0] * pixel_size / size[0]
    top = bottom + (top - bottom) * pixels[1] * pixel_size / size[1]
    start, end = clip_of(projection)
    world_from_camera = world_from_view.copy()
    if not perspective:
        # The view's plane may lie behind what it shows: the eye steps back to where the picture
        # begins.
        world_from_camera[:, 3] -= start * world_from_camera[:, 2]
        start, end = 0.0, end - start
    kind = "PERSPECTIVE" if perspective else "ORTHOGRAPHIC"
    return Camera(kind, world_from_camera, (left, right, bottom, top), pixels, max(start, 0.0), end)


def clip_planes(region_data: Any, camera: Camera) -> tuple[tuple[float, ...], ...]:
    """The clipping region of a 3D view as `engine.scene.Camera` has it; () without one. Blender's
    planes are of the world, positive inside, and 0 where there is none.
    """
    if not region_data.use_clip_planes:
        return ()
    used = np.array(region_data.clip_planes, np.float64)[: 4 if region_data.use_box_clip else 6]
    u, v, w, e = camera.world_from_camera.T
    normals = used[:, :3]
    rows = np.stack([normals @ u, normals @ v, -(normals @ w), normals @ e + used[:, 3]], 1)
    return tuple(tuple(float(x) for x in row) for row in rows[normals.any(1)])


def window_of(projection: np.ndarray) -> Window:
    """(l, r, b, t) as `engine.scene.Camera` has them, of a (4, 4) window matrix."""
    edges = []
    for axis in (0, 1):
        row = projection[axis]
        # At depth 1: ndc = row[axis] x - row[2] where the view converges, row[axis] x + row[3]
        # where it is parallel.
        shift = row[2] if projection[3, 2] != 0 else -row[3]
        edges += [(-1 + shift) / row[axis], (1 + shift) / row[axis]]
    return tuple(float(edge) for edge in edges)


def clip_of(projection: np.ndarray) -> tuple[float, float]:
    """Depths along the view at which a (4, 4) window matrix begins and ends to see."""
    scale, shift = projection[2, 2], projection[2, 3]
    if projection[3, 2] != 0:
        end = shift / (scale + 1)
        return shift / (scale - 1), end if end > 0 else math.inf
    return (shift + 1) / scale, (shift - 1) / scale


def frame_of(window: Window, pixels: tuple[int, int], camera: Camera) -> tuple[int, int] | None:
    """Where the lower left pixel of a render's camera lies in a view with this window, or None
    unless pixels lie on pixels.
    """
    corner = []
    for axis in (0, 1):
        low, high = window[2 * axis : 2 * axis + 2]
        start, end = camera.window[2 * axis : 2 * axis + 2]
        size = (high - low) / pixels[axis]
        here = (start - low) / size
        there = (end - low) / size
        wrong = (
            abs(here - round(here)),
            abs(there - round(there)),
            abs(round(there) - round(here) - camera.resolution[axis]),
        )
        if max(wrong) > _SAME_PIXEL:
            return None
        corner.append(round(here))
    return corner[0], corner[1]


def camera_notes(looks: Any, scene: Any) -> tuple[str, ...]:
    """What of the scene's camera is not shown as it is, where a 3D view looks through it.

    looks: the view's `RegionView3D`.
    """
    if looks.view_perspective != "CAMERA" or scene.camera is None:
        return ()
    report = Report()
    with suppress(ExportError):  # drawing says so
        seen = export_camera(scene.camera, scene.render, resolution(scene.render), report)
        if seen.kind == "PANORAMA" and looks.use_clip_planes:
            report.note("The clipping region of the view does not cut panoramas: turn it off")
    return report.notes()


def culling_of(space: Any, region_data: Any, depsgraph: Any) -> Culling | None:
    """What Simplify leaves out of a view: of one through a camera what it leaves out of the render.
    Other views show all; Cycles' leave out what was not in view when something was edited last.
    """
    scene = depsgraph.scene_eval
    if not culls(scene):
        return None
    through = _camera_object(space, region_data, depsgraph)
    if through is None:
        return None
    with suppress(ExportError):  # drawing says so
        render = scene.render
        return Culling.of(scene, export_camera(through, render, resolution(render), Report()))
    return None


def _through_camera(camera: Camera, scene_camera: Any, render: Any) -> tuple[Camera, Frame | None]:
    """The view's camera with the place, direction, lens and clip distances of the render's; the
    render's frame if it lies on whole pixels.
    """
    size = resolution(render)
    rendered = export_camera(scene_camera, render, size, Report())
    if rendered.kind == "PANORAMA":
        flat = flat_window(scene_camera.data, render, size)
        window = _window_in(rendered.window, flat, camera.window)
        camera = replace(camera, kind="PANORAMA", window=window)
    moved = Camera(
        rendered.kind,
        rendered.world_from_camera,
        camera.window,
        camera.resolution,
        rendered.clip_start,
        rendered.clip_end,
        lens=rendered.lens,
        panorama=rendered.panorama,
    )
    corner = (
        frame_of(camera.window, camera.resolution, rendered)
        if rendered.kind == camera.kind
        else None
    )
    if rendered.kind != camera.kind:
        return camera, None
    return moved, Frame(rendered, *corner) if corner else None


def _window_in(whole: Window, frame: Window, view: Window) -> Window:
    """The part of a picture's window that a view shows, which shows all of it in a frame."""
    edges = []
    for k, edge in enumerate(view):
        low, high = frame[k - k % 2 : k - k % 2 + 2]
        start, end = whole[k - k % 2 : k - k % 2 + 2]
        edges.append(start + (edge - low) / (high - low) * (end - start))
    return tuple(edges)


def _camera_object(space: Any, region_data: Any, depsgraph: Any) -> Any:
    """The evaluated object through which this view looks, or None."""
    if region_data.view_perspective != "CAMERA":
        return None
    chosen = space.camera if space.use_local_camera else depsgraph.scene_eval.camera
    return chosen.evaluated_get(depsgraph) if chosen is not None else None


def _pixel_size(render: Any) -> int:
    """Screen pixels to a side of a traced one: `preview_pixel_size`, or the interface's own for
    AUTO.
    """
    import bpy

    return _PIXEL_SIZES.get(render.preview_pixel_size) or max(
        1, round(bpy.context.preferences.system.pixel_size)
    )


def _border(
    space: Any,
    region_data: Any,
    render: Any,
    camera: Camera,
    frame: Frame | None,
    scene_camera: Any,
) -> Rectangle | None:
    """The render border in pixels of the view: the camera's where one looks through it, else the
    view's own.
    """
    width, height = camera.resolution
    if region_data.view_perspective != "CAMERA":
        if not space.use_render_border:
            return None
        edges = (
            space.render_border_min_x,
            space.render_border_min_y,
            space.render_border_max_x,
            space.render_border_max_y,
        )
        return _inside(
            tuple(edge * (width, height)[k % 2] for k, edge in enumerate(edges)), width, height
        )
    if not render.use_border or scene_camera is None:
        return None
    if frame is not None:
        try:
            x0, y0, x1, y1 = border(render, frame.camera.resolution)
        except ExportError:
            return 0, 0, 1, 1
        return _inside((x0 + frame.x, y0 + frame.y, x1 + frame.x, y1 + frame.y), width, height)
    rendered = export_camera(scene_camera, render, resolution(render), Report())
    edges = (render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y)
    return _inside(
        tuple(_pixel(edge, k % 2, rendered, camera) for k, edge in enumerate(edges)), width, height
    )


def _pixel(share: float, axis: int, rendered: Camera, camera: Camera) -> float:
    """The view's pixel coordinate of a share of the render's frame."""
    start, end = rendered.window[2 * axis : 2 * axis + 2]
    low, high = camera.window[2 * axis : 2 * axis + 2]
    return (start + share * (end - start) - low) / (high - low) * camera.resolution[axis]


def _inside(edges: tuple[float, ...], width: int, height: int) -> Rectangle:
    """Whole pixels inside the view, at least one."""
    x0, y0, x1, y1 = (int(edge) for edge in edges)
    x0, y0 = min(max(x0, 0), width - 1), min(max(y0, 0), height - 1)
    return x0, y0, max(min(x1, width), x0 + 1), max(min(y1, height), y0 + 1)


def _key(frame: Frame | None) -> tuple | None:
    if frame is None:
        return None
    camera = frame.camera
    return (
        frame.x,
        frame.y,
        camera.world_from_camera.tobytes(),
        camera.window,
        camera.resolution,
        camera.clip_start,
        camera.clip_end,
        camera.lens,
        camera.panorama,
    )
