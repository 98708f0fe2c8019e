"""Where what pixels show was in the frame before, and will be in the one after
(semantics/passes.md).
"""

from __future__ import annotations

import numpy as np

from ..evaluation.panorama import picture_points
from ..evaluation.surface import Surface
from ..linear.columns import transform, transform_each, unit
from ..scene import Camera, Mesh, Scene, Spheres, Strands
from .stage import Stage

Array = np.ndarray

_ROUND = ("EQUIRECTANGULAR", "CENTRAL_CYLINDRICAL")
"""Panoramas whose two sides meet."""


def motion_vectors(stage: Stage, surface: Surface) -> Array:
    """(4, n) pixels: x and y of before less here, then of here less after, of the points of
    `surface`; 0 where nothing moves.
    """
    if stage.scene.neighbours is None:
        return np.zeros((4, len(surface)))
    points = _in_object(stage, surface)
    here = _pixels(stage.scene.camera, _in_world(stage.scene, surface, points))
    before, after = (
        _pixels(
            other.camera, _in_world(other, surface, _moved(stage.scene, other, surface, points))
        )
        for other in stage.scene.neighbours
    )
    steps = (_step(stage.scene.camera, *pair) for pair in ((before, here), (here, after)))
    return np.where(np.isfinite(points).all(0), np.concatenate([*steps]), 0.0)


def _in_object(stage: Stage, surface: Surface) -> Array:
    """(3, n) the points in object space: of triangles by their weights, of others back through
    their matrix, not finite where there is no way back.
    """
    rows = stage.geometry.placements.world_from_object[surface.row]
    linear = rows[:, :, :3]
    cofactors = np.stack([np.cross(linear[:, :, k - 2], linear[:, :, k - 1]) for k in range(3)], 1)
    volume = (linear[:, :, 0] * cofactors[:, 0]).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        points = transform_each(cofactors, surface.x - rows[:, :, 3].T) / volume
    return _on_triangles(stage.scene, surface, points)


def _on_triangles(scene: Scene, surface: Surface, points: Array) -> Array:
    """points, (3, n), with those of meshes from their vertices in a scene."""
    points = points.copy()
    for number in np.unique(surface.geometry):
        mesh = scene.geometries[number]
        if isinstance(mesh, Mesh):
            here = np.flatnonzero(surface.geometry == number)
            corners = mesh.vertices.astype(np.float64)[mesh.triangles[surface.local[here]]]
            points[:, here] = (corners * surface.weights[:, here].T[:, :, None]).sum(1).T
    return points


def _moved(scene: Scene, other: Scene, surface: Surface, points: Array) -> Array:
    """The same points of the object in another frame: those of spheres and segments go as their
    centres do.
    """
    if all(a is b for a, b in zip(scene.geometries, other.geometries, strict=True)):
        return points
    points = _on_triangles(other, surface, points)
    for number in np.unique(surface.geometry):
        here, there = scene.geometries[number], other.geometries[number]
        some = np.flatnonzero(surface.geometry == number)
        local = surface.local[some]
        if here is there:
            continue
        if isinstance(here, Spheres):
            way = there.centers.astype(np.float64) - here.centers
            points[:, some] += way[local].T
        elif isinstance(here, Strands):
            way = there.vertices.astype(np.float64) - here.vertices
            ends = here.starts[local].astype(np.intp)
            first, second = surface.weights[:2, some]
            points[:, some] += first * way[ends].T + second * way[ends + 1].T
    return points


def _in_world(scene: Scene, surface: Surface, points: Array) -> Array:
    matrices = np.concatenate([block.world_from_object for block in scene.instances])
    rows = matrices[surface.row]
    return transform_each(rows[:, :, :3], points) + rows[:, :, 3].T


def _pixels(camera: Camera, points: Array) -> tuple[Array, Array, Array]:
    """(n,) x and y of points (3, n) of the world in the picture, beyond its frame too, and whether
    they are there.
    """
    frame = np.asarray(camera.world_from_camera, np.float64)
    x, y, z = c = transform(np.linalg.inv(frame[:, :3]), points - frame[:, 3:])
    seen = np.ones(len(x), bool)
    if camera.panorama is not None:
        x, y = picture_points(camera.panorama, unit(c))
    elif camera.kind == "PERSPECTIVE":
        seen = z < 0
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = x / -z, y / -z
    left, right, bottom, top = camera.window
    width, height = camera.resolution
    return (x - left) / (right - left) * width, (y - bottom) / (top - bottom) * height, seen


def _step(camera: Camera, a: tuple[Array, Array, Array], b: tuple[Array, Array, Array]) -> Array:
    """(2, n) from b to a, the shorter way round; 0 where either is not there."""
    with np.errstate(invalid="ignore"):
        x, y = a[0] - b[0], a[1] - b[1]
        if camera.panorama is not None and camera.panorama.projection in _ROUND:
            first, last = camera.panorama.longitude
            left, right = camera.window[:2]
            turn = 2 * np.pi / (last - first) / (right - left) * camera.resolution[0]
            x = x - turn * np.floor(x / turn + 0.5)
    return np.where(a[2] & b[2], np.stack([x, y]), 0.0)
