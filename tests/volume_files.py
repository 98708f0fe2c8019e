"""OpenVDB files of made-up grids, as Volume objects show them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from glint.addon.export.geometry.volumes import openvdb

NEEDED = "this Blender brings no OpenVDB module"


def write_grids(path: Path, voxel: float, start, **grids: np.ndarray) -> str:
    """Writes (x, y, z) or (x, y, z, 3) values at the middles of voxels, the first at start."""
    vdb, written = openvdb(), []
    for name, values in grids.items():
        grid = vdb.FloatGrid() if values.ndim == 3 else vdb.Vec3SGrid()
        grid.copyFromArray(np.ascontiguousarray(values, np.float32))
        grid.name = name
        grid.transform = vdb.createLinearTransform(voxelSize=voxel)
        grid.transform.postTranslate(tuple(map(float, start)))
        written.append(grid)
    vdb.write(str(path), written)
    return str(path)


def fog_box(count: int = 20, value: float = 1.0) -> np.ndarray:
    """Even fog, a border of empty voxels round it."""
    return np.pad(np.full((count,) * 3, value, np.float32), 1)


def two_blobs(count: int = 32) -> np.ndarray:
    """Two balls that thin out, over the box from -1 to 1."""
    x = (np.arange(count) + 0.5) / count * 2 - 1
    x, y, z = np.meshgrid(x, x, x, indexing="ij")
    one = np.sqrt((x + 0.3) ** 2 + y**2 + (z + 0.1) ** 2) / 0.5
    other = np.sqrt((x - 0.35) ** 2 + (y - 0.2) ** 2 + (z - 0.2) ** 2) / 0.4
    return np.maximum(1 - one, 0) + 2 * np.maximum(1 - other, 0)
