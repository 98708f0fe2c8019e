"""Volume objects: the grids of their OpenVDB files as dense arrays, and the surface round the
blocks of voxels that hold anything, inside of which rays look at them.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....engine.scene import Mesh
from ..report import Report
from .meshes import MeshSource
from .volume_files import check_whole

BLOCK = 8
"""Voxels along a side of a block: what is empty all over one is passed in a step."""
MOST_VOXELS = 2**28
"""Of a grid with what is empty in the box round it."""
_SCALARS = ("float", "double", "int32", "int64")
_VECTORS = ("vec3s", "vec3d")
_UNREADABLE = (OSError, RuntimeError, LookupError, ValueError, TypeError, EOFError)
"""What the module raises; its own errors have no common base."""


@dataclass(frozen=True, eq=False)
class Grid:
    """values: (x, y, z) float32 at the middles of voxels, or (x, y, z, 3), with a layer of the
    grid's background round them. low: (3,) index of the first. object_from_index: (3, 4) float64.
    """

    values: np.ndarray
    low: np.ndarray
    object_from_index: np.ndarray


class Volume:
    """What an evaluated Volume data-block shows at the frame, grid by grid as they are asked for.

    key: all that its grids depend on. is_scaled: whether it gets thinner as its object grows.
    """

    def __init__(self, data: Any, path: str, report: Report) -> None:
        self.name, self._path, self._report = data.name, path, report
        packed = data.original.packed_file
        self._packed = packed.data if packed else None
        self.is_scaled = data.render.space == "OBJECT"
        self.step_size, self._clipping = float(data.render.step_size), data.render.clipping
        state = (len(self._packed),) if self._packed else _state(path)
        self.key = (path, *state, self.is_scaled, self.step_size, self._clipping)
        self._grids: dict[str, Grid | None] = {}

    @property
    def read(self) -> tuple[str, ...]:
        """Names of the grids that were asked for and are there."""
        return tuple(sorted(name for name, grid in self._grids.items() if grid is not None))

    @property
    def lacks_all(self) -> bool:
        """Whether none of the grids that were asked for is in the file, though it has some."""
        return bool(self._types) and self._types.keys().isdisjoint(self._grids)

    @contextmanager
    def _file(self) -> Iterable[str]:
        if self._packed is None:
            yield self._path
            return
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "packed.vdb"
            path.write_bytes(self._packed)
            yield str(path)

    @cached_property
    def _types(self) -> dict[str, str]:
        with self._file() as path:
            check_whole(path)
            return {g.name: g.valueTypeName for g in openvdb().readAllGridMetadata(path)}

    def grid(self, name: str) -> Grid | None:
        """The grid of this name; None where there is none that can be read, which is noted but
        where there is none at all.
        """
        if name not in self._grids:
            self._grids[name] = self._read(name) if name in self._types else None
        return self._grids[name]

    def _read(self, name: str) -> Grid | None:
        try:
            return self._load(name)
        except (*_UNREADABLE, MemoryError) as error:
            self._report.note(
                "Grids of volumes that cannot be read are 0: {}; write the file anew",
                f"{name} of {self.name} ({_first_line(error)})",
            )
            return None

    def _load(self, name: str) -> Grid | None:
        what = f"{name} of {self.name}"
        with self._file() as path:
            found = openvdb().read(path, name)
        is_vector = found.valueTypeName in _VECTORS
        if (not is_vector and found.valueTypeName not in _SCALARS) or not found.transform.isLinear:
            self._report.note(
                "Grids of volumes that are no numbers or colours, or stand in a frustum, are 0: "
                "{}; convert them",
                what,
            )
            return None
        if found.activeVoxelCount() == 0:
            return None
        low, high = (np.array(corner) for corner in found.evalActiveVoxelBoundingBox())
        low, high = low - 1, high + 1
        size = high - low + 1
        if np.prod(size.astype(float)) > MOST_VOXELS:
            self._report.note(
                "Grids of volumes of more than 268 million voxels, with what is empty in the box "
                "round them, are 0: {}; use coarser ones",
                what,
            )
            return None
        kind = {"float": np.float32, "vec3s": np.float32, "int32": np.int32, "int64": np.int64}
        shape = (*size, 3) if is_vector else tuple(size)
        dense = np.zeros(shape, kind.get(found.valueTypeName, np.float64))
        found.copyToArray(dense, ijk=tuple(int(x) for x in low))
        with np.errstate(over="ignore"):
            values = np.ascontiguousarray(dense, np.float32)
        sound = np.isfinite(values)
        if not sound.all():
            self._report.note(
                "Grids of volumes have values that are not finite, which count as 0 ({}): repair "
                "them",
                what,
            )
            values = np.where(sound, values, np.float32(0))
        corners = np.array([found.transform.indexToWorld(x) for x in _CORNERS], np.float64)
        axes = np.column_stack([*(corners[1:] - corners[0]), corners[0]])
        if not (np.isfinite(axes).all() and np.linalg.det(axes[:, :3]) != 0):
            self._report.note(
                "Grids of volumes whose transform is flat or not finite are 0: {}; repair it", what
            )
            return None
        return Grid(values, low, axes)

    def voxel(self) -> float:
        """Mean length of a side of the smallest voxels that were read, the object's units."""
        sides = (np.linalg.norm(g.object_from_index[:, :3], axis=0).mean() for g in self._some())
        return float(min(sides))

    def _some(self) -> list[Grid]:
        return [self._grids[name] for name in self.read]

    def surface(self, is_box: bool) -> MeshSource | None:
        """Round the blocks of voxels of the grids that were read that hold something, or the box
        round all of them; None where they hold nothing.
        """
        grids = self._some()
        if not grids:
            return None
        axes = grids[0].object_from_index
        if all(np.allclose(axes, g.object_from_index, rtol=1e-9, atol=0) for g in grids):
            found = _round_blocks(grids, self._clipping, is_box)
        else:
            axes, found = np.eye(4)[:3], _round_boxes(grids)
        if found is None:
            return None
        corners, triangles = found
        if np.linalg.det(axes[:, :3]) < 0:
            triangles = triangles[:, ::-1]
        vertices = (corners @ axes[:, :3].T + axes[:, 3]).astype(np.float32)
        return MeshSource(Mesh(self.name, vertices, np.ascontiguousarray(triangles)), None)


_CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))


def openvdb() -> Any:
    """The module that Blender brings; None where it brings none."""
    if hasattr(bpy.utils, "expose_bundled_modules"):
        bpy.utils.expose_bundled_modules()
    try:
        import openvdb as found
    except ImportError:
        return None
    return found if hasattr(found, "FloatGrid") else None


def read_volume(data: Any, owner: Any, report: Report) -> Volume | None:
    """What an evaluated Volume data-block shows; None, and a note, where its values cannot be
    had.
    """
    if openvdb() is None:
        report.note(
            "Volume objects need the OpenVDB module that Blender 4.5 brings: {} are left out here; "
            "convert them to meshes",
            owner.name,
        )
        return None
    if any(m.show_render for m in owner.modifiers):
        report.note(
            "Modifiers of volumes are not seen: {} are as in their files; write what they make to "
            "OpenVDB files",
            owner.name,
        )
    if not data.filepath:
        report.note(
            "Volume objects without a file are left out: {}; write them to OpenVDB files",
            owner.name,
        )
        return None
    try:
        path = _frame_path(data)
        if not path:
            return None
        found = Volume(data, path, report)
        found.grid("")
    except _UNREADABLE as error:
        report.note(
            "Volume objects whose file cannot be read are left out: {}; find it",
            f"{owner.name} ({_first_line(error)})",
        )
        return None
    return found


def _frame_path(data: Any) -> str:
    """The file of the frame, "" where a sequence shows none in it; Blender tells that of a sequence
    once it has tried to read it. Raises FileNotFoundError where a sequence lacks the file.
    """
    if not data.is_sequence:
        return bpy.path.abspath(data.filepath, library=data.original.library)
    is_sound = data.grids.load()
    path = data.grids.frame_filepath
    if not (path or is_sound):
        raise FileNotFoundError(data.grids.error_message)
    return path


def _first_line(error: BaseException) -> str:
    return (str(error)[:200].splitlines() or [type(error).__name__])[0]


def _state(path: str) -> tuple:
    try:
        state = Path(path).stat()
    except OSError:
        return ()
    return state.st_mtime_ns, state.st_size


def _filled(grid: Grid, clipping: float) -> np.ndarray:
    """(x, y, z) bool: voxels that hold more than that, and those beside them."""
    full = grid.values > clipping
    if full.ndim == 4:
        full = full.any(3)
    for axis in range(3):  # the last layers are empty: they are a border
        full = full | np.roll(full, 1, axis) | np.roll(full, -1, axis)
    return full


def _blocks(full: np.ndarray, low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which blocks have such voxels, and the index of the first block."""
    before = low % BLOCK
    after = -(before + full.shape) % BLOCK
    full = np.pad(full, list(zip(before, after, strict=True)))
    x, y, z = (n // BLOCK for n in full.shape)
    return full.reshape(x, BLOCK, y, BLOCK, z, BLOCK).any((1, 3, 5)), low // BLOCK


def _bounds(full: np.ndarray, low: np.ndarray) -> np.ndarray:
    """(2, 3): the box of what is true, by the corners of voxels."""
    sides = [full.any(tuple({0, 1, 2} - {axis})).nonzero()[0] for axis in range(3)]
    return low + [[side[0] for side in sides], [side[-1] + 1 for side in sides]]


def _round_blocks(
    grids: list[Grid], clipping: float, is_box: bool
) -> tuple[np.ndarray, np.ndarray] | None:
    """Corners, by index, and triangles of the faces between blocks that hold something and others,
    cut to the box round what they hold, which Cycles has; or of that box.
    """
    filled = [(_filled(grid, clipping), grid.low) for grid in grids]
    filled = [(full, low) for full, low in filled if full.any()]
    if not filled:
        return None
    bounds = np.stack([_bounds(*one) for one in filled])
    least, most = bounds[:, 0].min(0), bounds[:, 1].max(0)
    parts = [_blocks(*one) for one in filled]
    low = np.min([first for _, first in parts], 0) - 1
    high = np.max([first + blocks.shape for blocks, first in parts], 0) + 1
    full = np.zeros(high - low, bool)
    for blocks, first in parts:
        at = tuple(slice(a, a + n) for a, n in zip(first - low, blocks.shape, strict=True))
        full[at] |= blocks
    if is_box:
        full[1:-1, 1:-1, 1:-1] = True
    quads = []
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        for side in (0, 1):
            bare = full & ~np.roll(full, 1 - 2 * side, axis)
            corners = np.repeat(np.argwhere(bare)[:, None], 4, 1)
            corners[:, :, axis] += side
            turn = ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0))
            for k, (u, v) in enumerate(turn):
                corners[:, k, across[0]] += u
                corners[:, k, across[1]] += v
            quads.append(corners)
    corners = (np.concatenate(quads) + low) * BLOCK
    corners, numbers = np.unique(
        np.clip(corners, least, most).reshape(-1, 3), axis=0, return_inverse=True
    )
    return corners.astype(np.float64), _halved(numbers.reshape(-1, 4))


def _round_boxes(grids: list[Grid]) -> tuple[np.ndarray, np.ndarray]:
    """The box round all of them, where they stand apart."""
    unit = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, -1).T
    ends = [
        (g.low + unit * (np.array(g.values.shape[:3]) - 1)) @ g.object_from_index[:, :3].T
        + g.object_from_index[:, 3]
        for g in grids
    ]
    low, high = np.min(np.concatenate(ends), 0), np.max(np.concatenate(ends), 0)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return low + unit * (high - low), _halved(np.array(quads))


def _halved(quads: np.ndarray) -> np.ndarray:
    """(2 n, 3) uint32 triangles."""
    return np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]).astype(np.uint32)
