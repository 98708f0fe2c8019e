"""What a `Camera` does to points and boxes: its chain of viewing matrices (notes, section 7), and
the pixels that a box may touch. Pixel coordinates are those of `engine.linear.viewing`.
"""

from __future__ import annotations

import numpy as np

from ..linear import (
    homogeneous,
    inverse,
    orthographic,
    perspective,
    transform_points,
    viewport,
)
from .model import Array, Camera

_EPSILON = np.finfo(np.float64).eps


def pixel_from_camera(camera: Camera) -> Array:
    """(4, 4) M_vp M_orth P of an `engine.scene.Camera` (M_vp M_orth for ORTHOGRAPHIC).

    The near and far planes are put at depths 1 and 2, since clip bounds may be 0 or infinite and x
    and y do not depend on them: the third coordinate grows with depth from -1 through 1 downwards
    and bears no other meaning.
    """
    projection = orthographic(*camera.window, -1.0, -2.0)
    if camera.kind == "PERSPECTIVE":
        projection = projection @ perspective(-1.0, -2.0)
    return viewport(*camera.resolution) @ projection


def pixel_from_world(camera: Camera) -> Array:
    """(4, 4) M_vp M_orth M_cam (section 7.5, with P for PERSPECTIVE); M_cam is a general inverse,
    so cameras may be mirrored or scaled.

    Raises ValueError for a camera whose matrix is singular.
    """
    return pixel_from_camera(camera) @ inverse(homogeneous(camera.world_from_camera))


def project_to_pixels(points_world: Array, camera: Camera) -> Array:
    """(k, 3) world points -> (k, 3) float64: pixel x, pixel y, depth along -w in camera units, as
    `Camera.clip_start` counts it.

    The point that the ray through the centre of pixel (i, j) meets gets x = i, y = j. Nothing is
    clipped: under PERSPECTIVE points behind the eye have depth < 0 and mirrored pixels, points in
    the eye's plane are not finite. Raises ValueError for a singular camera.
    """
    in_camera = _in_camera(points_world, camera, _axes_from_world(camera))
    pixels = transform_points(pixel_from_camera(camera), in_camera)
    return np.concatenate([pixels[:, :2], -in_camera[:, 2:]], 1)


def _axes_from_world(camera: Camera) -> Array:
    """(3, 3)."""
    return inverse(np.asarray(camera.world_from_camera, np.float64)[:, :3])


def _in_camera(points_world: Array, camera: Camera, axes_from_world: Array) -> Array:
    """World -> camera, (k, 3). The eye is taken off first: at 1e7 from the origin that keeps what
    the points' own rounding has left.
    """
    eye = np.asarray(camera.world_from_camera, np.float64)[:, 3]
    return (np.asarray(points_world, np.float64) - eye) @ axes_from_world.T


def pixel_bounds_of_box(
    low: Array,
    high: Array,
    camera: Camera,
    world_from_object: Array | None = None,
    margin: float = 0.5,
) -> tuple[int, int, int, int] | None:
    """The pixels that an axis-aligned box may touch: half-open (x0, y0, x1, y1) within the frame,
    as `Settings.region`, or None.

    low, high: (3,) corners in object space.  world_from_object: (3, 4), None for the identity.
    margin: how far a pixel reaches from its centre, in pixels: 0.5 is its own square; give
    `Settings.filter_width` for all its samples. Conservative: no pixel is missing, also when the
    box crosses the near plane or the eye's plane, and rounding is bounded from above. Non-finite
    corners give the whole frame. Raises ValueError for a singular camera.
    """
    corners, terms = _placed_corners(low, high, world_from_object)
    if not np.all(np.isfinite(corners)):
        return (0, 0, *camera.resolution)
    axes = _axes_from_world(camera)
    points = _in_camera(corners, camera, axes)
    slack = _rounding_bound(terms, corners, camera, axes)
    points = _clip_edges(
        points,
        max(camera.clip_start, 0.0) if camera.kind == "PERSPECTIVE" else camera.clip_start,
        slack[2],
    )
    if len(points) == 0 or np.min(-points[:, 2]) - slack[2] > camera.clip_end:
        return None
    return _covered_pixels(*_window_extent(points, slack, camera.kind), camera, margin)


def _placed_corners(
    low: Array, high: Array, world_from_object: Array | None
) -> tuple[Array, Array]:
    """(8, 3) corners in the world, bit a of the row number picks high on axis a; (3,) the largest
    sum of terms that went into them.
    """
    choice = (np.arange(8)[:, None] >> np.arange(3)) & 1
    corners = np.where(choice, np.asarray(high, np.float64), np.asarray(low, np.float64))
    if world_from_object is None:
        return corners, np.max(np.abs(corners), 0)
    placement = np.asarray(world_from_object, np.float64)
    return transform_points(placement, corners), np.max(
        transform_points(np.abs(placement), np.abs(corners)), 0
    )


def _rounding_bound(terms: Array, corners: Array, camera: Camera, axes_from_world: Array) -> Array:
    """(3,): how far the camera coordinates of the corners may be off, for a camera of rotation ×
    scale.

    Placing a corner and taking the eye off it round 5 times by half an ulp of the terms; the
    inverse, its product and the edge crossings fewer than 32 times by half an ulp of what is left.
    """
    eye = np.asarray(camera.world_from_camera, np.float64)[:, 3]
    error = 3 * (terms + np.abs(eye)) + 16 * np.max(np.abs(corners - eye), 0)
    return _EPSILON * (np.abs(axes_from_world) @ error)


def _clip_edges(points: Array, near: float, slack: float) -> Array:
    """(8, 3) corners in camera space -> (k, 3): the corners beyond the near depth and the points
    where edges cross it.
    """
    beyond = -points[:, 2] - near
    first, second = np.array(
        [(i, i | 1 << a) for i in range(8) for a in range(3) if not i >> a & 1]
    ).T
    crossing = (beyond[first] < 0) != (beyond[second] < 0)
    first, second = first[crossing], second[crossing]
    share = (beyond[first] / (beyond[first] - beyond[second]))[:, None]
    crossed = points[first] + share * (points[second] - points[first])
    crossed[:, 2] = -near
    return np.concatenate([points[beyond >= -slack], crossed])


def _window_extent(points: Array, slack: Array, kind: str) -> tuple[Array, Array]:
    """Lowest and highest window coordinates (2,), (2,) of points with depth >= 0; infinite where
    the eye's plane is reached.
    """
    low, high = points[:, :2] - slack[:2], points[:, :2] + slack[:2]
    if kind == "PERSPECTIVE":
        # A quotient is smallest over the greatest depth when positive, over the smallest when
        # negative.
        far, close = -points[:, 2:] + slack[2], np.maximum(-points[:, 2:] - slack[2], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = (
                np.where(low < 0, low / close, low / far),
                np.where(high > 0, high / close, high / far),
            )
    low, high = np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
    return np.min(low, 0), np.max(high, 0)


def _covered_pixels(
    low: Array, high: Array, camera: Camera, margin: float
) -> tuple[int, int, int, int] | None:
    """Window coordinates -> the half-open rectangle of pixels whose reach meets them."""
    left, right, bottom, top = camera.window
    start, side = np.array([left, bottom]), np.array([right - left, top - bottom])
    resolution = np.array(camera.resolution)
    ends = np.stack([low - start, high - start]) * resolution / side - 0.5
    rounding = 8 * _EPSILON * (np.abs(start / side) + 1) * resolution
    first = np.ceil(np.min(ends, 0) - margin - rounding)
    last = np.floor(np.max(ends, 0) + margin + rounding)
    x0, y0 = np.clip(first, 0, resolution).astype(int)
    x1, y1 = np.clip(last + 1, 0, resolution).astype(int)
    return (int(x0), int(y0), int(x1), int(y1)) if x0 < x1 and y0 < y1 else None
