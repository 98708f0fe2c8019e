"""How deep a scene is along a view."""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np

from ...engine.scene import Camera, Geometry, Scene, Spheres, Strands

_boxes: weakref.WeakKeyDictionary[Geometry, np.ndarray] = weakref.WeakKeyDictionary()


def stepped_up(camera: Camera, scene: Scene) -> Camera:
    """A parallel camera moved along its view to just before the scene: Blender's stands a thousand
    metres away, where float32 is coarse. One with a lens stays: its focus counts from the eye.
    """
    if camera.kind != "ORTHOGRAPHIC" or camera.lens is not None:
        return camera
    step = np.floor(_nearest(scene, camera)) - 1 - camera.clip_start
    if not (np.isfinite(step) and 0 < step < camera.clip_end - camera.clip_start):
        return camera
    backward = camera.world_from_camera[:, 2]
    moved = camera.world_from_camera.copy()
    moved[:, 3] -= step * backward
    planes = tuple((a, b, c, d + c * step) for a, b, c, d in camera.clip_planes)
    return replace(
        camera, world_from_camera=moved, clip_end=camera.clip_end - step, clip_planes=planes
    )


def _nearest(scene: Scene, camera: Camera) -> float:
    """The smallest depth along -w, camera units, of the boxes round all placements; infinite
    without any.
    """
    if not scene.instances:
        return np.inf
    boxes = np.stack([_box(scene.geometries[group.geometry]) for group in scene.instances])
    middle, half = np.repeat(
        boxes, [len(group.world_from_object) for group in scene.instances], axis=0
    ).transpose(1, 0, 2)
    matrices = np.concatenate([group.world_from_object for group in scene.instances])
    backward = camera.world_from_camera[:, 2]
    backward = backward / (backward @ backward)
    along = np.einsum("i,kij->kj", backward, matrices[:, :, :3])
    center = (along * middle).sum(1) + (
        matrices[:, :, 3] - camera.world_from_camera[:, 3]
    ) @ backward
    return float((-center - (np.abs(along) * half).sum(1)).min(initial=np.inf))


def _box(geometry: Geometry) -> np.ndarray:
    """(2, 3): middle and half extent in object space; zeros without points."""
    if geometry not in _boxes:
        points = geometry.centers if isinstance(geometry, Spheres) else geometry.vertices
        points = points[np.isfinite(points).all(1)]
        round_ = isinstance(geometry, Spheres | Strands)
        reach = float(geometry.radii.max(initial=0.0)) if round_ else 0.0
        low, high = (points.min(0), points.max(0)) if len(points) else (np.zeros(3), np.zeros(3))
        _boxes[geometry] = np.array([(low + high) / 2.0, (high - low) / 2.0 + reach], np.float64)
    return _boxes[geometry]
