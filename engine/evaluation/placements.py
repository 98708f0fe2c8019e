"""Instances spelled out: one row per placed geometry, with its matrix relative to the camera and
the matrix for its normals.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..scene import Instances, Mesh, Polygons, Scene, Spheres, Strands

Array = np.ndarray

FLAT = 1e-14
"""Singular values below this share of the largest count as 0: float64 cannot tell them from 0 after
a product of matrices.
"""


@dataclass(frozen=True, eq=False)
class Placements:
    """r rows in the order of `Scene.instances`, then of their matrices.

    block: (r,) index into `Scene.instances`.  geometry: (r,) index into `Scene.geometries`.
    world_from_object: (r, 3, 4) float64, the world's origin moved to the camera.
    normals: (r, 3, 3) cofactor matrices, scaled to about 1 (notes, section 6.2: they are (M⁻¹)ᵀ
    times det M, and exist for every M). mirror: (r,) sign of the determinant, 0 counts as +1. rank:
    (r,) of the linear part; rows of rank 0 and 1 show nothing. first: (r + 1,) number of the row's
    first primitive among all primitives of the scene. instances: the scene's.
    """

    block: Array
    geometry: Array
    world_from_object: Array
    normals: Array
    mirror: Array
    rank: Array
    first: Array
    instances: tuple[Instances, ...] = ()

    def value(self, name: str) -> Array:
        """(4, r) of `Instances.values`, zeros where there is none of this name."""
        rows = [
            block.values.get(name, np.zeros((len(block.world_from_object), 4)))
            for block in self.instances
        ]
        return np.concatenate([np.zeros((0, 4)), *rows]).T

    @cached_property
    def offsets(self) -> Array:
        """(2, blocks) `Instances.geometry_offset` and `shading_offset`."""
        offsets = [(block.geometry_offset, block.shading_offset) for block in self.instances]
        return np.array(offsets).reshape(-1, 2).T

    def row_of(self, primitive: Array) -> Array:
        """The row that holds the primitive of this number in the scene."""
        return np.searchsorted(self.first, primitive, "right") - 1


def primitive_count(geometry: Mesh | Spheres | Polygons | Strands) -> int:
    """How many triangles, spheres, polygons or segments."""
    if isinstance(geometry, Mesh):
        return len(geometry.triangles)
    if isinstance(geometry, Strands):
        return len(geometry.starts)
    return len(geometry.radii) if isinstance(geometry, Spheres) else len(geometry.offsets) - 1


def place(scene: Scene, eye: Array) -> Placements:
    """All rows of the scene relative to the point `eye` (3,)."""
    counts = [len(block.world_from_object) for block in scene.instances]
    block = np.repeat(np.arange(len(counts)), counts)
    matrices = np.concatenate(
        [np.zeros((0, 3, 4)), *(b.world_from_object for b in scene.instances)]
    )
    matrices[:, :, 3] -= eye
    geometry = np.array([b.geometry for b in scene.instances], np.intp)[block]
    sizes = np.array([primitive_count(g) for g in scene.geometries], np.intp)
    first = np.concatenate([[0], np.cumsum(sizes[geometry])]).astype(np.intp)
    unit = _scaled(matrices[:, :, :3])
    values = np.linalg.svd(unit, compute_uv=False)
    rank = (values > FLAT * np.maximum(values[:, :1], 1e-300)).sum(1)
    normals = _cofactors(unit)
    determinant = (unit[:, :, 0] * normals[:, :, 0]).sum(1)
    return Placements(
        block,
        geometry,
        matrices,
        normals,
        np.where((determinant < 0) & (rank == 3), -1.0, 1.0),
        rank,
        first,
        tuple(scene.instances),
    )


def _scaled(linear: Array) -> Array:
    """Divided by the largest entry, so that products neither overflow nor vanish."""
    largest = np.abs(linear).max((1, 2), initial=0.0)
    return linear / np.where(largest > 0, largest, 1.0)[:, None, None]


def _cofactors(m: Array) -> Array:
    """(r, 3, 3): column k is the cross product of the two other columns of m."""
    a, b, c = m[:, :, 0], m[:, :, 1], m[:, :, 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 2)
