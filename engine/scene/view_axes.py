"""A narrow view in the camera's own axes, for tracers that keep positions in single precision.

Positions relative to the camera are right to 2^-25 of their size in every direction: across the
view that is 2^-25 radians, and a pixel of a long lens or a far shift may be hardly larger. In the
camera's axes, coordinates across the view are small and keep their bits, and the rounding of the
depth moves a point along its own ray. The turn is made in float64. It is not made for every view:
in the world's axes boxes fit an upright world best, and the corners of an upright wall all round
alike, so that it stays flat and closed where it meets a floor. A parallel view may come as close as
it likes, and stays in the world's axes too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .model import Camera, Scene
from .model_geometry import Instances
from .model_lights import Light

Array = np.ndarray

NARROW = 2.0**-14
"""Radians of a pixel below which a view is narrow: 2^-25 is then more than a two-thousandth of a
pixel.
"""


@dataclass(frozen=True, eq=False)
class ViewAxes:
    """A frame: axes (3, 3) orthonormal, right-handed columns right, up and backward; eye (3,), both
    in the world.
    """

    axes: Array
    eye: Array

    def scene(self, scene: Scene) -> Scene:
        """The same scene told in this frame."""
        before_and_after = scene.neighbours
        if before_and_after is not None:
            before, after = before_and_after
            before_and_after = self.scene(before), self.scene(after)
        return replace(
            scene,
            camera=self._camera(scene.camera),
            instances=tuple(self._instances(block) for block in scene.instances),
            lights=tuple(self._light(light) for light in scene.lights),
            world=replace(scene.world, axes=self.axes.T @ scene.world.axes),
            neighbours=before_and_after,
        )

    def world_passes(self, passes: dict[str, Array]) -> dict[str, Array]:
        """Passes (h, w, c) of a picture in this frame as those of the world; a Position of zeros
        stands for no hit and stays.
        """
        result = dict(passes)
        if "Normal" in passes:
            result["Normal"] = (passes["Normal"] @ self.axes.T).astype(np.float32)
        if "Position" in passes:
            position = passes["Position"].astype(np.float64)
            hit = position.any(-1, keepdims=True)
            result["Position"] = np.where(hit, position @ self.axes.T + self.eye, 0.0).astype(
                np.float32
            )
        return result

    def _camera(self, camera: Camera) -> Camera:
        motion = None if camera.motion is None else self._told(camera.motion)
        eye = camera.eye
        if eye is not None:
            x, y, z = map(float, self.axes.T @ eye.up)
            eye = replace(eye, up=(x, y, z))
        return replace(
            camera, world_from_camera=self._told(camera.world_from_camera), motion=motion, eye=eye
        )

    def _instances(self, block: Instances) -> Instances:
        return replace(
            block,
            world_from_object=self._told(block.world_from_object),
            motion=None if block.motion is None else self._told(block.motion),
        )

    def _light(self, light: Light) -> Light:
        return replace(
            light,
            world_from_light=self._told(light.world_from_light),
            motion=None if light.motion is None else self._told(light.motion),
            openings=light.openings and light.openings.told(self.axes, self.eye),
        )

    def _told(self, matrices: Array) -> Array:
        """(…, 3, 4) matrices to this frame."""
        moved = np.array(matrices, np.float64)
        moved[..., 3] -= self.eye
        return self.axes.T @ moved


def narrow_view_axes(camera: Camera) -> ViewAxes | None:
    """The camera's frame where its view is narrow, else None."""
    matrix = np.asarray(camera.world_from_camera, np.float64)
    if camera.kind != "PERSPECTIVE" or matrix.shape != (3, 4) or not pixel_angle(camera) < NARROW:
        return None
    z: np.ndarray = matrix[:, 2] / np.linalg.norm(matrix[:, 2])
    x: np.ndarray = matrix[:, 0] / np.linalg.norm(matrix[:, 0])
    x = x - z * (z @ x)
    x = x / np.linalg.norm(x)
    axes = np.column_stack([x, np.cross(z, x), z])
    return ViewAxes(axes, matrix[:, 3]) if np.isfinite(axes).all() else None


def pixel_angle(camera: Camera) -> float:
    """The least angle between neighbouring pixels' rays of a perspective view, in radians."""
    left, right, bottom, top = camera.window
    width, height = (
        abs(right - left) / camera.resolution[0],
        abs(top - bottom) / camera.resolution[1],
    )
    # A step du across the plane at distance 1 turns a ray of length r by as little as du / r².
    return min(width, height) / (
        1 + max(left * left, right * right) + max(bottom * bottom, top * top)
    )
