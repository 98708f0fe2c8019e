"""All primitives of a scene in world space relative to the camera: what rays are tested against.

Primitives are triangles, then spheres, polygons and segments of strands, and have a *number* in the
scene (by instance, then primitive) that settles ties. Faces with a vertex that is not finite, and
instances squeezed to a line or a point, are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..linear import determinant
from ..linear.columns import cross, explode, pick, transform_each
from ..scene import Mesh, Polygons, Scene, Spheres, Strands
from .placements import Placements, place, primitive_count

Array = np.ndarray

THIN = 1e-8
"""Spheres and strands are left out where the unit columns of their matrix have no larger
determinant (semantics/hits.md).
"""

ULPS = 64 * 2.0**-52
"""Relative size of the margins round computed points: hit points, corners and shears each err by a
few ulps (NumPy's float64).
"""

KINDS = ("camera", "mirror", "shadow", "transmission", "diffuse")
"""Kinds of rays; an `Instances` has a flag visible_<kind> for each."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Spheres under their matrices. object_from_world: (k, 3, 3) inverse; center_world (3, k),
    center (3, k) in the object, radius (k,), row (k,) of `Placements`.
    """

    center: Array
    radius: Array
    row: Array
    center_world: Array
    object_from_world: Array


@dataclass(frozen=True, eq=False)
class Rods:
    """Segments of strands under their matrices. start, axis (3, k): in the object, the axis to the
    other end; radii (2, k) of both ends, row (k,) of `Placements`, start_world (3, k),
    object_from_world (k, 3, 3) inverse.
    """

    start: Array
    axis: Array
    radii: Array
    row: Array
    start_world: Array
    object_from_world: Array


@dataclass(frozen=True, eq=False)
class Faces:
    """Polygons: corners (3, m) in world space round each polygon, start (k + 1,) of its first
    corner, normal (3, k) Newell's, unit.
    """

    corners: Array
    start: Array
    normal: Array


@dataclass(frozen=True, eq=False)
class Geometry:
    """points: (3, v) vertices.  triangles: (3, t) rows of points.  number: (p,) of each primitive
    in the scene. row: (p,) int32 of `Placements`.  material: (p,) int32 index into
    `Scene.materials`, -1 for the default one. lower, upper: (3, s) bounds of the s spheres,
    polygons and segments.  reach: largest coordinate. visible: for each kind of ray the primitives
    it sees, (p,) bool, or None for all.  mirrors_differ: whether some instances are seen in mirrors
    and cast no shadow, or the other way.  diffuse_differs: in mirrors and not by diffuse rays, or
    the other way.  glass_differs: in mirrors and not through glass, or the other way.  left_out:
    sentences.
    """

    placements: Placements
    points: Array
    triangles: Array
    balls: Balls
    faces: Faces
    rods: Rods
    number: Array
    row: Array
    material: Array
    lower: Array
    upper: Array
    reach: float
    visible: dict[str, Array | None]
    mirrors_differ: bool
    diffuse_differs: bool
    glass_differs: bool
    left_out: tuple[str, ...]

    @property
    def triangle_count(self) -> int:
        return self.triangles.shape[1]

    @property
    def ball_count(self) -> int:
        return len(self.balls.radius)

    @property
    def face_count(self) -> int:
        return len(self.faces.start) - 1

    @property
    def first_rod(self) -> int:
        """Where segments begin among the primitives."""
        return self.triangle_count + self.ball_count + self.face_count

    @property
    def count(self) -> int:
        return len(self.number)

    def primitive_of(self, index: Array) -> Array:
        """Which primitive of its geometry the primitive at `index` is."""
        return self.number[index] - self.placements.first[self.row[index]]


def gather(scene: Scene, eye: Array) -> Geometry:
    """The geometry of a sound scene, seen from `eye`."""
    placements = place(scene, eye)
    drawn = [_Drawn(scene, placements, b) for b in range(len(scene.instances))]
    meshes, balls, faces, rods = (
        [d for d in drawn if isinstance(d.geometry, kind)]
        for kind in (Mesh, Spheres, Polygons, Strands)
    )
    ordered = meshes + balls + faces + rods
    points, triangles = _triangles(meshes)
    ball = _balls(balls, placements)
    face = _faces(faces)
    rod = _rods(rods, placements)
    lower, upper = _shape_bounds(ball, face, rod, placements)
    number, row, material = (
        _joined([getattr(d, name) for d in ordered], np.intp)
        for name in ("number", "row", "material")
    )
    reach = max((np.abs(a).max() for a in (points, lower, upper) if a.size), default=0.0)
    return Geometry(
        placements,
        points,
        triangles,
        ball,
        face,
        rod,
        number,
        row.astype(np.int32),
        material.astype(np.int32),
        lower,
        upper,
        float(reach),
        {kind: _visible(ordered, kind) for kind in KINDS},
        any(block.visible_mirror != block.visible_shadow for block in scene.instances),
        any(block.visible_mirror != block.visible_diffuse for block in scene.instances),
        any(block.visible_mirror != block.visible_transmission for block in scene.instances),
        tuple(text for d in drawn for text in d.left_out),
    )


def _joined(
    parts: list[Array], dtype: type, axis: int = -1, shape: tuple[int, ...] = (0,)
) -> Array:
    return (
        np.concatenate(parts, axis).astype(dtype, copy=False) if parts else np.zeros(shape, dtype)
    )


class _Drawn:
    """The primitives of one block of instances that can be drawn: `rows` of Placements times `kept`
    primitives of the geometry.
    """

    def __init__(self, scene: Scene, placements: Placements, block: int):
        self.instances = scene.instances[block]
        self.geometry = scene.geometries[self.instances.geometry]
        mine = np.flatnonzero(placements.block == block)
        shown = (
            _has_inside(placements, mine)
            if isinstance(self.geometry, Spheres | Strands)
            else placements.rank[mine] >= 2
        )
        self.rows = mine[shown]
        self.matrices = placements.world_from_object[self.rows]
        sound = _finite_primitives(self.geometry)
        self.kept = np.flatnonzero(sound)
        self.row = np.repeat(self.rows, len(self.kept))
        self.number = (placements.first[self.rows][:, None] + self.kept).ravel()
        self.material = np.tile(
            _materials(scene, self.instances, self.geometry)[self.kept], len(self.rows)
        )
        self.left_out = tuple(self._notes(len(mine) - len(self.rows), len(sound) - len(self.kept)))

    def _notes(self, squeezed: int, broken: int) -> Iterator[str]:
        name = self.instances.name
        if squeezed:
            shape = (
                "so flat that the spheres or strands have no inside"
                if isinstance(self.geometry, Spheres | Strands)
                else "of scales that leave no surface"
            )
            yield (
                f"{name!r}: {squeezed} placements are {shape} and were left out; scale two axes "
                "alike"
            )
        if broken:
            yield (
                f"{name!r}: {broken} primitives have coordinates that are not finite, or no "
                "extent, and were left out; repair the geometry"
            )


def _has_inside(placements: Placements, rows: Array) -> Array:
    """(k,) bool: the unit columns span a volume worth an inverse, by `THIN`."""
    linear = placements.world_from_object[rows][:, :, :3]
    linear = linear / np.maximum(np.abs(linear).max((1, 2)), 1e-300)[:, None, None]
    with np.errstate(invalid="ignore"):
        return np.abs(determinant(linear / np.linalg.norm(linear, axis=1)[:, None, :])) > THIN


def _finite_primitives(geometry: Mesh | Spheres | Polygons | Strands) -> Array:
    """(n,) bool: all coordinates (and the radius) are finite."""
    if isinstance(geometry, Strands):
        return _sound_segments(geometry)
    if isinstance(geometry, Spheres):
        return (
            np.isfinite(geometry.centers).all(1)
            & np.isfinite(geometry.radii)
            & (geometry.radii > 0)
        )
    finite = np.isfinite(geometry.vertices).all(1)
    if isinstance(geometry, Mesh):
        return finite[geometry.triangles].all(1)
    sizes = np.diff(geometry.offsets.astype(np.intp))
    bad = np.bincount(
        np.repeat(np.arange(len(sizes)), sizes), ~finite[geometry.indices], len(sizes)
    )
    return (bad == 0) & (sizes >= 3)


def _sound_segments(strands: Strands) -> Array:
    """(n,) bool: finite, and with a radius at one end at least."""
    radii = strands.radii
    sound = np.isfinite(strands.vertices).all(1) & np.isfinite(radii) & (radii >= 0)
    first = strands.starts.astype(np.intp)
    return sound[first] & sound[first + 1] & (np.maximum(radii[first], radii[first + 1]) > 0)


def _materials(scene: Scene, instances, geometry) -> Array:
    """(n,) index into the scene's materials per primitive; -1 where there is none."""
    if not instances.materials:
        return np.full(primitive_count(geometry), -1)
    slots = (
        np.zeros(primitive_count(geometry), np.intp)
        if geometry.material_slots is None
        else geometry.material_slots.astype(np.intp)
    )
    chosen = np.array(instances.materials, np.intp)[np.minimum(slots, len(instances.materials) - 1)]
    return np.where((chosen >= 0) & (chosen < len(scene.materials)), chosen, -1)


def _placed(vertices: Array, matrices: Array) -> Array:
    """(v, 3) under (k, 3, 4) -> (3, k * v)."""
    x, y, z = vertices.astype(np.float64).T
    m = matrices[:, :, :, None]
    return np.stack(
        [(m[:, i, 0] * x + m[:, i, 1] * y + m[:, i, 2] * z + m[:, i, 3]).ravel() for i in range(3)]
    )


def _triangles(meshes: list[_Drawn]) -> tuple[Array, Array]:
    points, triangles, base = [], [], 0
    for mesh in meshes:
        vertices = mesh.geometry.vertices
        vertices = np.where(np.isfinite(vertices), vertices, 0)  # of faces that are left out
        points.append(_placed(vertices, mesh.matrices))
        starts = base + len(vertices) * np.arange(len(mesh.rows))
        corners = mesh.geometry.triangles[mesh.kept].astype(np.intp)
        triangles.append((starts[:, None, None] + corners).reshape(-1, 3).T)
        base += points[-1].shape[1]
    return _joined(points, np.float64, 1, (3, 0)), np.ascontiguousarray(
        _joined(triangles, np.intp, 1, (3, 0))
    )


def _balls(drawn: list[_Drawn], placements: Placements) -> Balls:
    centers = [np.tile(d.geometry.centers[d.kept].astype(np.float64).T, len(d.rows)) for d in drawn]
    center = _joined(centers, np.float64, 1, (3, 0))
    radius = _joined(
        [np.tile(d.geometry.radii[d.kept].astype(np.float64), len(d.rows)) for d in drawn],
        np.float64,
    )
    row = _joined([d.row for d in drawn], np.intp)
    used, place_of = np.unique(row, return_inverse=True)
    inverse = _inverses(placements, used)
    m = placements.world_from_object[row]
    world = transform_each(m, center) + m[:, :, 3].T
    return Balls(center, radius, row, world, inverse[place_of])


def _rods(drawn: list[_Drawn], placements: Placements) -> Rods:
    def ends(d: _Drawn, values: Array, offset: int) -> Array:
        rows = d.geometry.starts[d.kept].astype(np.intp) + offset
        return np.tile(np.atleast_2d(values.astype(np.float64).T)[:, rows], len(d.rows))

    def joined(attribute: str, offset: int, rows: int) -> Array:
        parts = [ends(d, getattr(d.geometry, attribute), offset) for d in drawn]
        return _joined(parts, np.float64, 1, (rows, 0))

    start = joined("vertices", 0, 3)
    row = _joined([d.row for d in drawn], np.intp)
    used, place_of = np.unique(row, return_inverse=True)
    m = placements.world_from_object[row]
    return Rods(
        start,
        joined("vertices", 1, 3) - start,
        np.concatenate([joined("radii", 0, 1), joined("radii", 1, 1)]),
        row,
        transform_each(m, start) + m[:, :, 3].T,
        _inverses(placements, used)[place_of],
    )


def _inverses(placements: Placements, rows: Array) -> Array:
    """(k, 3, 3) through the SVD (notes, sections 5.3 and 6.5)."""
    linear = placements.world_from_object[rows][:, :, :3]
    u, s, vt = np.linalg.svd(linear) if len(rows) else (linear, linear[:, 0], linear)
    return np.einsum("rji,rj,rkj->rik", vt, 1 / s, u)


def _faces(drawn: list[_Drawn]) -> Faces:
    corners, sizes = [np.zeros((3, 0))], [np.zeros(0, np.intp)]
    for d in drawn:
        offsets = d.geometry.offsets.astype(np.intp)
        count = np.diff(offsets)[d.kept]
        each, place_in = explode(count)
        corner = d.geometry.indices[offsets[d.kept[each]] + place_in]
        corners.append(_placed(d.geometry.vertices[corner], d.matrices))
        sizes.append(np.tile(count, len(d.rows)))
    corner, start = (
        np.concatenate(corners, 1),
        np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.intp),
    )
    return Faces(corner, start, _newell(corner, start))


def _newell(corners: Array, start: Array) -> Array:
    """Unit normals (3, k): the sum of cross products of successive corners, taken relative to the
    first one.
    """
    if len(start) < 2:
        return np.zeros((3, 0))
    sizes = np.diff(start)
    relative = corners - np.repeat(pick(corners, start[:-1]), sizes, 1)
    following = np.arange(len(corners[0])) + 1
    following[start[1:] - 1] = start[:-1]
    area = cross(relative, pick(relative, following))
    total = np.add.reduceat(area, start[:-1], 1)
    size = np.sqrt((total * total).sum(0))
    return total / np.where(size > 0, size, 1.0)


def _shape_bounds(
    balls: Balls, faces: Faces, rods: Rods, placements: Placements
) -> tuple[Array, Array]:
    linear = placements.world_from_object[balls.row][:, :, :3]
    half = balls.radius * np.sqrt((linear * linear).sum(2)).T
    lower, upper = [balls.center_world - half], [balls.center_world + half]
    if len(faces.start) > 1:
        lower.append(np.minimum.reduceat(faces.corners, faces.start[:-1], 1))
        upper.append(np.maximum.reduceat(faces.corners, faces.start[:-1], 1))
    matrices = placements.world_from_object[rods.row]
    across = np.sqrt((matrices[:, :, :3] ** 2).sum(2)).T
    there = rods.start_world + transform_each(matrices, rods.axis)
    first, second = rods.radii[0] * across, rods.radii[1] * across
    lower.append(np.minimum(rods.start_world - first, there - second))
    upper.append(np.maximum(rods.start_world + first, there + second))
    return np.concatenate(lower, 1), np.concatenate(upper, 1)


def _visible(ordered: list[_Drawn], kind: str) -> Array | None:
    """(p,) bool of the primitives, None for all."""
    flags = [getattr(d.instances, "visible_" + kind) for d in ordered]
    sizes = [len(d.number) for d in ordered]
    return None if all(flags) else np.repeat(np.array(flags, bool), sizes)
