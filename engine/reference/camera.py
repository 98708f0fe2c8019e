"""Viewing rays (notes, sections 4.4-4.6): the rays of a camera are a pencil in its own frame, where
they are (u, v, 1) or parallel to z.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..scene import Camera
from .geometry import Geometry
from .raster import Strips, pixel_strips
from .rays import ULPS, Frame, Pencil
from .vectors import length

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class CameraRays:
    """The rays of one camera. unit: length of −w, world units per unit of depth.  corner, pixel:
    window's corner and size of a pixel.

    near, far: the clip range with a margin for the rounding of depths, so that hits at its very
    ends count.  clip_planes: (k, 4).
    """

    frame: Frame
    corner: tuple[float, float]
    pixel: tuple[float, float]
    near: float
    far: float
    unit: float
    clip_planes: Array

    @classmethod
    def of(cls, camera: Camera, geometry: Geometry) -> CameraRays:
        axes = np.asarray(camera.world_from_camera, np.float64)[:, :3] * (1.0, 1.0, -1.0)
        perspective = camera.kind == "PERSPECTIVE"
        frame = Frame.of(geometry, np.linalg.inv(axes), np.zeros(3), perspective)
        left, right, bottom, top = camera.window
        pixel = (right - left) / camera.resolution[0], (top - bottom) / camera.resolution[1]
        near, far = (
            camera.clip_start - ULPS * abs(camera.clip_start),
            camera.clip_end + ULPS * abs(camera.clip_end),
        )
        if perspective:
            near = max(near, 0.0)
        elif near == 0:
            near = -ULPS * geometry.reach
        return cls(
            frame,
            (left, bottom),
            pixel,
            near,
            far,
            float(length(axes[:, 2])),
            np.reshape(camera.clip_planes, (-1, 4)),
        )

    def pixels(
        self, x: tuple[int, int], y: tuple[int, int], offset: Array
    ) -> tuple[Pencil, Strips | None]:
        """Rays through the pixels x[0] <= i < x[1], y[0] <= j < y[1], row by row, at `offset` from
        their centres.
        """
        u = self.corner[0] + (np.arange(*x) + 0.5 + offset[0]) * self.pixel[0]
        v = self.corner[1] + (np.arange(*y) + 0.5 + offset[1]) * self.pixel[1]
        count = len(u) * len(v)
        near, far = np.full(count, self.near), np.full(count, self.far)
        pencil = self._clipped(
            Pencil(self.frame, np.tile(u, len(v)), np.repeat(v, len(u)), near, far)
        )
        ascending = self.pixel[0] > 0 and self.pixel[1] > 0
        return pencil, pixel_strips(u, v) if ascending else None

    def _clipped(self, rays: Pencil) -> Pencil:
        """Cuts rays (u z, v z, z), or (u, v, z) where they are parallel, to where they are inside
        the clip planes.
        """
        near, far = rays.near, rays.far
        for a, b, c, d in self.clip_planes:
            across = a * rays.u + b * rays.v
            slope, constant = (
                (c + across, np.full(len(rays), d))
                if self.frame.perspective
                else (np.full(len(rays), c), d + across)
            )
            with np.errstate(divide="ignore", invalid="ignore"):
                depth = -constant / slope
            near = np.where(slope > 0, np.maximum(near, depth), near)
            far = np.where(
                slope < 0,
                np.minimum(far, depth),
                np.where((slope == 0) & ~(constant >= 0), -np.inf, far),
            )
        return replace(rays, near=near, far=far)
