"""Viewing rays (notes, sections 4.4-4.6): the rays of a camera are coherent in its own frame, where
they are (u, v, 1) or parallel to z; those of a panorama are incoherent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..evaluation.geometry import ULPS, Geometry
from ..evaluation.panorama import from_eye, looks, through_lens
from ..linear.columns import length, transform, transform_each, unit
from ..sampling import places_in_blocks
from ..sampling.lens import BLOCK, lens_points
from ..sampling.motion import camera_frames, sample_times
from ..scene import Camera, Scene
from ..scene.panorama import Eye, Panorama
from .raster import Strips, pixel_strips
from .rays import CoherentRays, Frame, IncoherentRays, Rays

Array = np.ndarray

_RIGHT, _UP = np.eye(3)[:, :1], np.eye(3)[:, 1:2]


@dataclass(frozen=True, eq=False)
class Spread:
    """Where the pixels of a block look from in one sample. lens: (BLOCK², 2) points of it, None for
    a pinhole.  frames: (BLOCK², 3, 4) world_from_camera, None for a camera that stands still.
    """

    lens: Array | None
    frames: Array | None

    @classmethod
    def samples(cls, scene: Scene, count: int) -> list[Spread]:
        """Of all samples of a picture."""
        camera = scene.camera
        lens = lens_points(camera.lens, count) if camera.lens else None
        frames = (
            camera_frames(camera, sample_times(scene, count)) if camera.motion is not None else None
        )
        return [
            cls(
                None if lens is None else lens[:, k],
                None if frames is None else frames[:, k],
            )
            for k in range(count)
        ]


@dataclass(frozen=True, eq=False)
class CameraRays:
    """The rays of one camera. unit: length of −w, world units per unit of depth.  corner, pixel:
    window's corner and size of a pixel.

    near, far: the clip range with a margin for the rounding of depths, so that hits at its very
    ends count.  clip_planes: (k, 4).  focus: depth of a lens's sharp plane.  eye: (3,) world.
    panorama: None for none; its depths are distances.  aside: of a pair, None where `eye` is the
    eye.
    """

    frame: Frame
    corner: tuple[float, float]
    pixel: tuple[float, float]
    near: float
    far: float
    unit: float
    clip_planes: Array
    focus: float
    eye: Array
    clip_start: float
    panorama: Panorama | None = None
    aside: Eye | None = None

    @classmethod
    def of(cls, camera: Camera, geometry: Geometry) -> CameraRays:
        axes = np.asarray(camera.world_from_camera, np.float64)[:, :3] * (1.0, 1.0, -1.0)
        perspective = camera.kind != "ORTHOGRAPHIC"
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
            camera.lens.focus if camera.lens else np.inf,
            np.asarray(camera.world_from_camera, np.float64)[:, 3],
            camera.clip_start,
            camera.panorama if camera.kind == "PANORAMA" else None,
            camera.eye,
        )

    def weights(self, rays: Rays) -> Array:
        """(n,) of camera rays: 1, and 0 beyond the picture of a panorama's lens."""
        return np.ones(len(rays)) if self.panorama is None else np.where(rays.far >= 0, 1.0, 0.0)

    def pixels(
        self, x: tuple[int, int], y: tuple[int, int], offset: Array
    ) -> tuple[CoherentRays, Strips | None]:
        """Rays through the pixels x[0] <= i < x[1], y[0] <= j < y[1], row by row, at `offset` from
        their centres.
        """
        u, v = self._window(x, y, offset)
        window = np.stack([np.tile(u, len(v)), np.repeat(v, len(u))])
        still = np.zeros_like(window)
        near, far = self._clipped(*((still, window) if self.frame.perspective else (window, still)))
        coherent = CoherentRays(self.frame, window[0], window[1], near, far)
        ascending = self.pixel[0] > 0 and self.pixel[1] > 0
        return coherent, pixel_strips(u, v) if ascending else None

    def rays(
        self, x: tuple[int, int], y: tuple[int, int], offset: Array, spread: Spread
    ) -> tuple[Rays, Strips | None]:
        """The same, each from where its pixel looks."""
        if self.panorama is not None:
            return self._panoramic(x, y, offset, spread), None
        if spread.lens is None and spread.frames is None and self.aside is None:
            return self.pixels(x, y, offset)
        return self._spread(x, y, offset, spread), None

    def _spread(
        self, x: tuple[int, int], y: tuple[int, int], offset: Array, spread: Spread
    ) -> IncoherentRays:
        """Rays whose parameter is the depth, as that of coherent ones."""
        coherent, _ = self.pixels(x, y, offset)
        place = places_in_blocks(x, y, BLOCK)
        window = np.stack([coherent.u, coherent.v])
        lens = np.zeros_like(window) if spread.lens is None else spread.lens[place].T
        bend = -lens / self.focus
        start, slope = (lens, window + bend) if self.frame.perspective else (window + lens, bend)
        one = np.ones((1, len(coherent)))
        origin, along = np.concatenate([start, 0 * one]), np.concatenate([slope, one])
        if spread.frames is None:
            world = np.linalg.inv(self.frame.matrix)
            origin, along = transform(world, origin), transform(world, along)
            right = world[:, :1]
        else:
            world = spread.frames[place] * (1.0, 1.0, -1.0, 1.0)
            moved = world[:, :, 3].T - self.eye[:, None]
            origin, along = transform_each(world, origin) + moved, transform_each(world, along)
            right = world[:, :, 0].T
        if self.aside is not None:
            size, up = length(along), np.array(self.aside.up)[:, None]
            origin, d = from_eye(self.aside, up, right, origin, along / size)
            along = size * d
        return IncoherentRays.of(origin, along, *self._clipped(start, slope))

    def _window(self, x: tuple[int, int], y: tuple[int, int], offset: Array) -> tuple[Array, Array]:
        """Where the columns and the rows of these pixels are in the window."""
        return (
            self.corner[0] + (np.arange(*x) + 0.5 + offset[0]) * self.pixel[0],
            self.corner[1] + (np.arange(*y) + 0.5 + offset[1]) * self.pixel[1],
        )

    def _panoramic(
        self, x: tuple[int, int], y: tuple[int, int], offset: Array, spread: Spread
    ) -> IncoherentRays:
        """Rays whose parameter is the distance; those that see nothing end before they begin."""
        place, (u, v) = places_in_blocks(x, y, BLOCK), self._window(x, y, offset)
        assert self.panorama is not None
        d, seen = looks(self.panorama, np.tile(u, len(v)), np.repeat(v, len(u)))
        o = np.zeros_like(d)
        if spread.lens is not None:
            o, d = through_lens(d, spread.lens[place].T, self.focus)
        if self.aside is not None:
            o, d = from_eye(self.aside, _UP, _RIGHT, o, d)
        if spread.frames is None:
            world = np.linalg.inv(self.frame.matrix) * (1.0, 1.0, -1.0)
            o, d = transform(world, o), transform(world, d)
        else:
            world = spread.frames[place]
            o = transform_each(world, o) + (world[:, :, 3].T - self.eye[:, None])
            d = transform_each(world, d)
        size = length(d)
        far = np.where(seen, self.far * size, -1.0)
        return IncoherentRays.of(o, d / size, self.near * size, far)

    def depth(self, points: Array) -> Array:
        """Of points (3, n) relative to the eye, along the view of the camera that stands still; of
        a panorama the distance.
        """
        if self.panorama is not None:
            return length(points) / self.unit
        return transform(self.frame.matrix, points)[2]

    def hit_depth(self, points: Array, parameter: Array) -> Array:
        """World units of depth of hits (3, n) relative to the eye, which rays of the camera that
        stands still have at `parameter`, (n,).
        """
        if self.panorama is None and self.aside is None:
            return parameter * self.unit
        return self.depth(points) * self.unit

    def distance(self, points: Array) -> Array:
        """World units from the eye to points (3, n) relative to it; along the view where rays are
        parallel.
        """
        if self.frame.perspective:
            return length(points)
        return np.abs(self.depth(points)) * self.unit

    def distance_seen(self, points: Array) -> Array:
        """The same from where their rays begin, at the near end of what is seen."""
        return self.distance(points) * (1 - self.clip_start / self.depth(points))

    def along_axes(self, directions: Array) -> Array:
        """(3, n) right, up, forward of directions (3, n)."""
        axes = np.linalg.inv(self.frame.matrix)
        return unit(axes).T @ directions

    def _clipped(self, start: Array, slope: Array) -> tuple[Array, Array]:
        """The depths (n,) between which rays start + z slope (2, n) are inside the clip range and
        planes.
        """
        count = start.shape[1]
        near, far = np.full(count, self.near), np.full(count, self.far)
        for a, b, c, d in self.clip_planes:
            rise = c + (a * slope[0] + b * slope[1])
            constant = d + (a * start[0] + b * start[1])
            with np.errstate(divide="ignore", invalid="ignore"):
                depth = -constant / rise
            near = np.where(rise > 0, np.maximum(near, depth), near)
            far = np.where(
                rise < 0,
                np.minimum(far, depth),
                np.where((rise == 0) & ~(constant >= 0), -np.inf, far),
            )
        return near, far
