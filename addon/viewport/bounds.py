"""What can be said of where things stand: how deep a scene is along a view, and whether two scenes
are alike, in it or altogether.
"""

from __future__ import annotations

import weakref
from dataclasses import fields, replace
from itertools import compress, starmap
from operator import attrgetter, is_not
from typing import Any

import numpy as np

from ...engine.scene import Camera, Geometry, Instances, Light, Scene, Spheres, Strands

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


def same_places(a: Scene, b: Scene) -> bool:
    """Whether the same geometries stand at the same places in two scenes, seen by the same rays."""
    if a.geometries != b.geometries or len(a.instances) != len(b.instances):
        return False
    others = map(is_not, a.instances, b.instances)
    return a.instances is b.instances or all(
        starmap(_same_group, compress(zip(a.instances, b.instances, strict=True), others))
    )


def same_content(a: Scene, b: Scene) -> bool:
    """Whether two scenes are the same but for their cameras. Meshes and images that were read anew
    count as others.
    """
    if a.world != b.world or (a.geometries, a.materials, a.textures) != (
        b.geometries,
        b.materials,
        b.textures,
    ):
        return False
    return _all_same(a.lights, b.lights, "world_from_light") and _all_same(
        a.instances, b.instances, "world_from_object"
    )


def _all_same(some: tuple[Any, ...], others: tuple[Any, ...], matrix: str) -> bool:
    """Of lights, or of instances, of which all but one field are no arrays."""
    if len(some) != len(others):
        return False
    plain, matrix_of = _PLAIN[matrix], attrgetter(matrix)
    anew = compress(zip(some, others, strict=True), map(is_not, some, others))
    return all(
        plain(a) == plain(b) and matrix_of(a).tobytes() == matrix_of(b).tobytes() for a, b in anew
    )


_PLAIN = {
    matrix: attrgetter(*(field.name for field in fields(kind) if field.name != matrix))
    for kind, matrix in ((Light, "world_from_light"), (Instances, "world_from_object"))
}
"""By the name of a kind's matrix: all its other fields."""


def _same_group(a: Instances, b: Instances) -> bool:
    flags = ("geometry", "visible_camera", "visible_mirror", "visible_shadow")
    same = all(getattr(a, name) == getattr(b, name) for name in flags)
    return same and np.array_equal(a.world_from_object, b.world_from_object)


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
