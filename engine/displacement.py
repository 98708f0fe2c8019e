"""True displacement: programs that say where the vertices of a mesh go, run before anything is
traced (semantics/programs.md).

Guaranteed: one vertex has one place, that of the first of its triangles' corners whose material
displaces, so that no mesh is torn; the same bits with any number of threads and, with the core, on
every machine; finite vertices.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from .evaluation.attributes import is_uv
from .evaluation.textures import Image
from .futures import parallel_map
from .linear.columns import cross, transform, unit
from .native import programs
from .native.binding import load_error
from .program.execute.run import run as run_reference
from .program.program import Program
from .scene import CORNER, FACE, POINT, Attribute, Mesh, Texture

Array = np.ndarray

_CHUNK = 1 << 14
"""Vertices that a program runs over at once."""
_FARTHEST = 1e19
"""Coordinates beyond it have no squares in single precision."""


@dataclass(frozen=True)
class Displacement:
    """Where a material moves vertices.

    program: its output is the offset in the world; None where that is `constant` everywhere.
    textures: what the program's textures refer to. keeps_normals: shading normals stay, as the
    material bends them by what it displaces. is_placed: offsets depend on where the mesh stands.
    """

    program: Program | None
    textures: tuple[Texture, ...] = ()
    constant: tuple[float, float, float] = (0.0, 0.0, 0.0)
    keeps_normals: bool = False
    is_placed: bool = True

    @cached_property
    def _hash(self) -> int:
        return hash((self.program, self.textures, self.constant, self.keeps_normals))

    def __hash__(self) -> int:
        """Worked out once: exports look for what they displaced before, object by object."""
        return self._hash


@dataclass(frozen=True, eq=False)
class Place:
    """Where a mesh is displaced. values: as `Instances.values` has them, of this placement."""

    world_from_object: Array = field(default_factory=lambda: np.eye(4)[:3])
    values: Mapping[str, Sequence[float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Moved:
    """A displaced mesh. offsets (v, 3) float64 in object space; turned (n,) bool, the triangles
    whose normals are worked out anew; odd: how many vertices stayed as their offsets are not
    finite or beyond 1e19.
    """

    mesh: Mesh
    offsets: Array
    turned: Array
    odd: int = 0


def displaced(
    mesh: Mesh,
    displacements: Sequence[Displacement | None],
    vertex_normals: Array,
    polygons: Array | None,
    place: Place,
) -> Moved:
    """A mesh as the materials in its slots displace it.

    displacements: of each slot; slots beyond the end have that of the last. vertex_normals: (v, 3)
    unit, along which a Displacement node moves. polygons: (n,) of a mesh with CORNER normals, the
    number of the polygon of each triangle that is shaded flat, -1 of others; None for none. mesh:
    brings the attributes that programs read. place: where programs that ask find the mesh.
    """
    slots = np.minimum(_slots(mesh), len(displacements) - 1)
    moves = np.array([d is not None for d in displacements])[slots]
    first = _first_corners(mesh.triangles, moves, len(mesh.vertices))
    offsets = np.zeros((len(mesh.vertices), 3))
    for slot, displacement in enumerate(displacements):
        rows = np.flatnonzero((first >= 0) & (slots[first // 3] == slot))
        if displacement is not None and len(rows):
            offsets[rows] = _offsets(displacement, mesh, vertex_normals, first[rows], place).T
    with np.errstate(all="ignore"):
        sound = (np.abs(mesh.vertices + offsets) <= _FARTHEST).all(1) | (first < 0)
    offsets[~sound] = 0.0
    turned = moves & ~np.array([d is not None and d.keeps_normals for d in displacements])[slots]
    moved = replace(mesh, vertices=(mesh.vertices + offsets).astype(np.float32))
    normals = normals_after(mesh, moved.vertices, mesh.normals, turned, polygons)
    return Moved(replace(moved, normals=normals), offsets, turned, int((~sound).sum()))


def normals_after(
    mesh: Mesh, vertices: Array, normals: Attribute | None, turned: Array, polygons: Array | None
) -> Attribute | None:
    """Shading normals once the vertices of `mesh` are at `vertices` (v, 3).

    Those at vertices are the sums of the unit normals of the triangles that are `turned`. Those at
    corners turn as much as these do from the mesh's own; those of flat triangles are their
    polygon's.
    """
    if normals is None or not turned.any():
        return normals
    triangles = mesh.triangles[turned]
    after = _vertex_normals(vertices, triangles)
    values = normals.values.astype(np.float64)
    if normals.domain == POINT:
        touched = np.unique(triangles)
        values[touched] = after[touched]
        return replace(normals, values=values.astype(np.float32))
    assert mesh.corners is not None  # normals at corners come with them
    rows = mesh.corners[turned]
    bent = values[rows] + (after - _vertex_normals(mesh.vertices, triangles))[triangles]
    bent = unit(bent.reshape(-1, 3).T).T.reshape(bent.shape)
    if polygons is not None:
        flat = polygons[turned] >= 0
        bent[flat] = _flat_normals(vertices, triangles[flat], polygons[turned][flat])[:, None]
    values[rows] = bent
    return replace(normals, values=values.astype(np.float32))


def _slots(mesh: Mesh) -> Array:
    """(n,) material slot of each triangle."""
    if mesh.material_slots is None:
        return np.zeros(len(mesh.triangles), np.intp)
    return mesh.material_slots.astype(np.intp)


def _first_corners(triangles: Array, moves: Array, count: int) -> Array:
    """(count,) the first corner, 3 times its triangle and which of it, that has each vertex and
    whose triangle moves; -1 where none does.
    """
    corners = np.flatnonzero(np.repeat(moves, 3))[::-1]
    first = np.full(count, -1, np.intp)
    first[triangles.reshape(-1)[corners]] = corners
    return first


def _flat_normals(vertices: Array, triangles: Array, polygons: Array) -> Array:
    """(n, 3) unit: that of each triangle's polygon, by Newell."""
    numbers = np.unique(polygons, return_inverse=True)[1].reshape(-1)
    sums = np.stack([np.bincount(numbers, part) for part in _areas(vertices, triangles)])
    return unit(sums).T[numbers]


def _columns(values: Array, rows: Array) -> Array:
    """(c, n) float64 of the rows (n,) of values (k, c)."""
    return np.ascontiguousarray(values.take(rows, 0).T, np.float64)


def _face_normals(vertices: Array, triangles: Array) -> Array:
    """(3, n) unit."""
    return unit(_areas(vertices, triangles))


def _areas(vertices: Array, triangles: Array) -> Array:
    """(3, n) normals, twice as long as the triangles are large."""
    a, b, c = (_columns(vertices, corners) for corners in triangles.T)
    return cross(b - a, c - a)


def _vertex_normals(vertices: Array, triangles: Array) -> Array:
    """(v, 3) unit, of the vertices of the triangles."""
    faces = _face_normals(vertices, triangles)
    corners, count = triangles.T.reshape(-1), len(vertices)
    sums = [np.bincount(corners, np.tile(part, 3), count) for part in faces]
    return unit(np.stack(sums)).T


def _offsets(
    displacement: Displacement, mesh: Mesh, normals: Array, corners: Array, place: Place
) -> Array:
    """(3, n) float64 in object space, of the vertices at these corners (n,)."""
    placed = _Placed.of(place if displacement.is_placed else Place())
    if displacement.program is None:
        constant = np.array(displacement.constant)[:, None]
        with np.errstate(all="ignore"):
            return placed.to_object(np.repeat(constant, len(corners), 1))
    is_native = load_error() is None
    power = programs.power if is_native else np.power
    images = [Image(texture, power) for texture in displacement.textures]
    run = programs.run if is_native else run_reference
    task = partial(_some_offsets, displacement.program, mesh, normals, images, placed, run)
    chunks = [corners[k : k + _CHUNK] for k in range(0, len(corners), _CHUNK)]
    if len(chunks) == 1:
        return task(chunks[0])
    return np.concatenate(parallel_map(task, chunks), 1)


def _some_offsets(
    program: Program,
    mesh: Mesh,
    normals: Array,
    images: list[Image],
    placed: _Placed,
    run: Callable[[Program, Any, int], Sequence[Array]],
    corners: Array,
) -> Array:
    points = VertexPoints(mesh, normals, corners, placed, images)
    with np.errstate(all="ignore"):
        (offset,) = run(program, points, len(corners))
        return placed.to_object(offset)


@dataclass(frozen=True, eq=False)
class _Placed:
    """A placement's matrix (3, 4), its cofactors (3, 3) and their sign, its determinant."""

    matrix: Array
    cofactors: Array
    determinant: float
    values: Mapping[str, Sequence[float]]

    @classmethod
    def of(cls, place: Place) -> _Placed:
        matrix = np.asarray(place.world_from_object, np.float64)
        a, b, c = (matrix[:, k : k + 1] for k in range(3))
        cofactors = np.concatenate([cross(b, c), cross(c, a), cross(a, b)], 1)
        x, y, z = a[:, 0] * cofactors[:, 0]
        return cls(matrix, cofactors, float(x + y + z), place.values)

    def to_object(self, vectors: Array) -> Array:
        """(3, n) directions of the world; zeros where the matrix has no inverse."""
        if self.determinant == 0:
            return np.zeros_like(vectors)
        return transform(self.cofactors.T, vectors) / self.determinant

    def normals(self, normals: Array) -> Array:
        """(3, n) unit normals of the object's space in the world."""
        turned = unit(transform(self.cofactors, normals))
        return -turned if self.determinant < 0 else turned


class VertexPoints:
    """What programs read of the vertices of a mesh (`program.execute.run.Points`), each at a corner
    of a triangle. Nobody sees them: they face along their normals.
    """

    def __init__(
        self, mesh: Mesh, normals: Array, corners: Array, placed: _Placed, images: list[Image]
    ) -> None:
        """normals: (v, 3) of the vertices; corners: (n,) 3 times the triangle and which of it."""
        self._mesh, self._placed, self._images = mesh, placed, images
        self._triangle, self._corner = corners // 3, corners % 3
        self._vertex = mesh.triangles[self._triangle, self._corner]
        self._own = unit(_columns(normals, self._vertex))
        self._rows = {POINT: self._vertex, FACE: self._triangle}
        if mesh.corners is not None:
            self._rows[CORNER] = mesh.corners[self._triangle, self._corner]

    def attribute(self, name: str, shift: int) -> Array:
        """(4, n)."""
        found = next((a for a in self._mesh.attributes if a.name == name), None)
        if found is None:
            return np.zeros((4, len(self._vertex)))
        values = self._values(found)
        if len(values) == 4:
            return values
        filled = np.zeros((4, len(self._vertex)))
        filled[: len(values)], filled[3] = values, 1.0
        return filled

    def uv(self, name: str, shift: int) -> Array:
        """(2, n)."""
        maps = (a for a in self._mesh.attributes if is_uv(a, name))
        found = next(maps, None)
        return np.zeros((2, len(self._vertex))) if found is None else self._values(found)[:2]

    def image(self, texture: int, u: Array, v: Array) -> Array:
        """(4, n)."""
        return self._images[texture].read(u, v)

    def position(self, shift: int) -> Array:
        return transform(self._placed.matrix, self.object_position(0)) + self._origin

    def object_position(self, shift: int) -> Array:
        return _columns(self._mesh.vertices, self._vertex)

    @cached_property
    def _normal(self) -> Array:
        return self._placed.normals(self._own)

    def normal(self) -> Array:
        return self._normal

    def incoming(self) -> Array:
        return self._normal

    def reflection(self) -> Array:
        return self._normal

    def object_normal(self) -> Array:
        return self._own

    def face_normal(self) -> Array:
        own = _face_normals(self._mesh.vertices, self._mesh.triangles[self._triangle])
        return self._placed.normals(own)

    def backfacing(self) -> Array:
        return np.zeros(len(self._vertex))

    def normal_to_world(self, normal: Array) -> Array:
        return self._placed.normals(normal)

    def normal_to_object(self, normal: Array) -> Array:
        return unit(transform(self._placed.matrix[:, :3].T, normal))

    def from_object(self, vector: Array, is_point: bool) -> Array:
        moved = transform(self._placed.matrix, vector)
        return moved + self._origin if is_point else moved

    def to_object(self, vector: Array, is_point: bool) -> Array:
        return self._placed.to_object(vector - self._origin if is_point else vector)

    def object_location(self) -> Array:
        return np.repeat(self._origin, len(self._vertex), 1)

    def instance_value(self, name: str) -> Array:
        """(4, n)."""
        value = np.array(self._placed.values.get(name, (0.0,) * 4), np.float64)
        return np.repeat(value[:, None], len(self._vertex), 1)

    def barycentric(self, shift: int) -> Array:
        return (np.arange(3)[:, None] == self._corner).astype(np.float64)

    def edge_distance(self, shift: int) -> Array:
        return np.zeros(len(self._vertex))

    def light_path(self) -> tuple[Array, ...]:
        return (np.zeros(len(self._vertex)),) * 4

    def pixel_step(self, axis: int) -> Array:
        return np.zeros((3, len(self._vertex)))

    def ray_length(self) -> Array:
        return np.zeros(len(self._vertex))

    def ray_depth(self) -> tuple[Array, ...]:
        return (np.zeros(len(self._vertex)),) * 4

    @property
    def _origin(self) -> Array:
        return self._placed.matrix[:, 3:]

    def _values(self, attribute: Attribute) -> Array:
        """(c, n), what is not finite as 0."""
        values = _columns(attribute.values, self._rows[attribute.domain])
        return np.where(np.isfinite(values), values, 0.0)
