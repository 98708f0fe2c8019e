"""Objects that Simplify leaves out of a render: beside the camera's widened frame, or far away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...engine.scene import Camera
from .camera import inverse_axes

Array = np.ndarray


class Bounds(NamedTuple):
    """Of an object that may be culled. corners: (8, 3) of its box. by_camera, by_distance: at least
    one of them; where both are, it is left out where both say so.
    """

    corners: Array
    by_camera: bool
    by_distance: bool


@dataclass(frozen=True, eq=False)
class Culling:
    """As Cycles decides; equal for what leaves out the same things. frame_margin: shares of the
    frame on each side; None where the frame culls nothing. distance: None where that culls nothing.
    """

    camera: Camera
    frame_margin: float | None
    distance: float | None

    @staticmethod
    def of(scene: Any, camera: Camera) -> Culling | None:
        """None where an evaluated scene culls nothing: several views see other things, and
        panoramas all round.
        """
        if not culls(scene) or camera.kind == "PANORAMA":
            return None
        settings = scene.cycles
        margin = settings.camera_cull_margin if settings.use_camera_cull else None
        distance = settings.distance_cull_margin if settings.use_distance_cull else None
        return Culling(camera, margin, distance or None)

    @property
    def _key(self) -> tuple:
        camera = self.camera
        return (
            camera.kind,
            camera.world_from_camera.tobytes(),
            camera.window,
            camera.clip_start,
            camera.clip_end,
            self.frame_margin,
            self.distance,
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Culling) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def bounds(self, thing: Any) -> Bounds | None:
        """Of an evaluated object; None for what stays wherever it is, as lamps do."""
        settings = getattr(thing, "cycles", None)
        if settings is None or thing.type == "LIGHT":
            return None
        by_camera = self.frame_margin is not None and settings.use_camera_cull
        by_distance = self.distance is not None and settings.use_distance_cull
        if not (by_camera or by_distance):
            return None
        return Bounds(np.array(thing.bound_box, np.float64), by_camera, by_distance)

    def left_out(self, bounds: Bounds, matrices: Array) -> Array:
        """(n,) bool: which of the placements (n, 3, 4) of an object are not there."""
        corners = bounds.corners @ matrices[:, :, :3].transpose(0, 2, 1) + matrices[:, None, :, 3]
        culled = np.ones(len(matrices), bool)
        if bounds.by_camera:
            culled &= self._beside(corners)
        if bounds.by_distance:
            culled &= self._is_far(corners)
        return culled

    def _beside(self, corners: Array) -> Array:
        """(n,) of (n, 8, 3): in the frame from 0 to 1 the box of the corners, mirrored where these
        are nearer than the near clip, is beside it, or all of them are behind that.
        """
        camera, margin = self.camera, self.frame_margin
        assert margin is not None
        to = corners - camera.world_from_camera[:, 3]
        x, y, z = np.moveaxis(to @ inverse_axes(camera.world_from_camera[:, :3]).T, -1, 0)
        near, far = camera.clip_start, camera.clip_end
        depth = (-z - near) / (far - near)
        left, right, bottom, top = camera.window
        with np.errstate(divide="ignore", invalid="ignore"):
            if camera.kind == "PERSPECTIVE":
                depth, x, y = far * depth, x / -z, y / -z
            u, v = (x - left) / (right - left), (y - bottom) / (top - bottom)
        u, v = (np.where(depth < 0, 1 - place, place) for place in (u, v))
        over = (u.min(1) >= 1 + margin) | (v.min(1) >= 1 + margin)
        under = (u.max(1) <= -margin) | (v.max(1) <= -margin)
        return over | under | (depth < -margin).all(1)

    def _is_far(self, corners: Array) -> Array:
        """(n,) of (n, 8, 3): whether the box along the world's axes is farther than that."""
        assert self.distance is not None
        eye = self.camera.world_from_camera[:, 3]
        nearest = np.clip(eye, corners.min(1), corners.max(1))
        return ((eye - nearest) ** 2).sum(1) > self.distance**2


class Culled:
    """What of a walk is culled: things by their numbers. culling: None for nothing."""

    def __init__(self, culling: Culling | None) -> None:
        self._culling = culling
        self._bounds: dict[int, Bounds] = {}  # of instances that may be culled

    def meet(self, number: int, instance: Any) -> bool:
        """Whether a thing that stands by itself is left out; instances are so one by one."""
        box = self._culling.bounds(instance.object) if self._culling is not None else None
        if box is None or self._culling is None:
            return False
        if instance.is_instance:
            self._bounds[number] = box
            return False
        matrix = np.array(instance.matrix_world, np.float64)
        return bool(self._culling.left_out(box, matrix[None, :3])[0])

    def as_well(self, number: int, other: int) -> int:
        """That other thing, which is left out where the first is."""
        if number in self._bounds:
            self._bounds[other] = self._bounds[number]
        return other

    def kept(self, rows: Array, matrices: Array) -> Array | slice:
        """Which of the placements are left. rows: the numbers of their things."""
        if self._culling is None or not self._bounds:
            return slice(None)
        kept = np.ones(len(rows), bool)
        for number, box in self._bounds.items():
            here = np.flatnonzero(rows == number)
            kept[here] = ~self._culling.left_out(box, matrices[here])
        return kept


def culls(scene: Any) -> bool:
    """Whether Simplify of an evaluated scene may leave objects out of renders: of what several
    views or a panorama see it does not.
    """
    settings, camera = getattr(scene, "cycles", None), scene.camera
    return (
        settings is not None
        and scene.render.use_simplify
        and (settings.use_camera_cull or settings.use_distance_cull)
        and not scene.render.use_multiview
        and not (camera is not None and camera.type == "CAMERA" and camera.data.type == "PANO")
    )
