"""Points of surfaces: which primitive, where, and which way it faces there (notes, sections 2.7,
4.7-4.9 and 6.2).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..linear.columns import cross, dot, pick, transform_each, unit
from .geometry import Geometry, Rods

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Spot:
    """Which place on which primitive: enough to read materials. All (n,), weights (3, n)
    barycentric (on strands of both ends and 0; 0 off both).
    """

    primitive: Array
    geometry: Array
    local: Array
    weights: Array
    material: Array

    @classmethod
    def of(cls, geometry: Geometry, primitive: Array, weights: Array) -> Spot:
        """At the weights (3, n) of the primitives (n,)."""
        number = geometry.placements.geometry[geometry.row[primitive]]
        local, material = geometry.primitive_of(primitive), geometry.material[primitive]
        return Spot(primitive, number, local, weights, material)


@dataclass(frozen=True, eq=False)
class Surface(Spot):
    """n shaded points, relative to the camera. x g n (3, n): point, geometric and shading normal,
    both turned to the viewer.

    v: (3, n) unit, to the viewer.  start: (3, n) where shadow rays start.  outside: (n,) bool, the
    outer side is seen. offset: (n,) how far from the surface other rays must start to be clear of
    rounding.  row: (n,) of Placements.  mesh_n: (3, n) shading normals before materials'
    programs bend them.  unbent: (3, n) what the normals were bent from where bumps hide light, else
    0; bump: (n,) how, as `bumps.bump_shadow` takes it.  far: (n,) lengths of the rays that meet
    them.  grazing, lowering: (n,) as `terminator` takes them.  past: (4, n) what these went
    through, as `SurfacePoints.ray_depth` has it; a bounce where nobody says otherwise.
    """

    row: Array
    x: Array
    g: Array
    n: Array
    v: Array
    start: Array
    outside: Array
    offset: Array
    mesh_n: Array
    unbent: Array
    bump: Array
    far: Array
    grazing: Array
    lowering: Array
    past: Array

    def __len__(self) -> int:
        return len(self.primitive)

    def take(self, index: Array) -> Surface:
        """The points at these places."""
        return Surface(**{f.name: getattr(self, f.name).take(index, -1) for f in fields(self)})


def points_on(
    geometry: Geometry, primitive: Array, weights: Array, o: Array, d: Array, depth: Array
) -> tuple[Array, Array, Array]:
    """Points (3, n) on primitives (n,), outward unit normals (3, n), and the largest coordinates
    (n,) of what they were worked out from.

    On triangles the points are those of the barycentric weights (3, n); on others those at `depth`
    (n,) of the rays o, d (3, n), brought back to the surface.
    """
    n = len(primitive)
    x, g, reach = np.zeros((3, n)), np.zeros((3, n)), np.zeros(n)
    flat = np.flatnonzero(primitive < geometry.triangle_count)
    triangle, w = primitive[flat], pick(weights, flat)
    a, b, c = (pick(geometry.points, corner[triangle]) for corner in geometry.triangles)
    x[:, flat] = w[0] * a + w[1] * b + w[2] * c
    mirror = geometry.placements.mirror[geometry.row[triangle]]
    g[:, flat] = unit(cross(b - a, c - a)) * mirror
    reach[flat] = np.maximum(np.maximum(np.abs(a).max(0), np.abs(b).max(0)), np.abs(c).max(0))
    _place_shapes(geometry, primitive, o, d, depth, x, g, reach)
    return x, g, reach


def _place_shapes(
    geometry: Geometry,
    primitive: Array,
    o: Array,
    d: Array,
    depth: Array,
    x: Array,
    g: Array,
    reach: Array,
) -> None:
    """Fills in spheres, polygons and strands."""
    shape = primitive - geometry.triangle_count
    balls = np.flatnonzero((shape >= 0) & (shape < geometry.ball_count))
    if len(balls):
        at = pick(o, balls) + depth[balls] * pick(d, balls)
        x[:, balls], g[:, balls] = _ball_points(geometry, shape[balls], at)
    faces = np.flatnonzero((shape >= geometry.ball_count) & (primitive < geometry.first_rod))
    if len(faces):
        index = shape[faces] - geometry.ball_count
        n, first = (
            pick(geometry.faces.normal, index),
            pick(geometry.faces.corners, geometry.faces.start[index]),
        )
        at = pick(o, faces) + depth[faces] * pick(d, faces)
        x[:, faces] = at - dot(at - first, n) * n
        g[:, faces] = n * geometry.placements.mirror[geometry.row[primitive[faces]]]
    rods = np.flatnonzero(primitive >= geometry.first_rod)
    if len(rods):
        x[:, rods], g[:, rods] = _rod_points(
            geometry,
            primitive[rods] - geometry.first_rod,
            pick(o, rods) + depth[rods] * pick(d, rods),
        )
    some = np.flatnonzero(shape >= 0)
    if len(some):
        s = shape[some]
        corner = np.maximum(np.abs(pick(geometry.lower, s)), np.abs(pick(geometry.upper, s))).max(0)
        reach[some] = np.maximum(corner, np.abs(pick(o, some)).max(0))


def _ball_points(geometry: Geometry, index: Array, at: Array) -> tuple[Array, Array]:
    """Points brought back to the sphere in its object, and outward normals by the cofactor
    matrix.
    """
    balls, placements = geometry.balls, geometry.placements
    row = balls.row[index]
    from_center = transform_each(
        balls.object_from_world[index], at - pick(balls.center_world, index)
    )
    direction = unit(from_center)
    arm = balls.radius[index] * direction
    x = pick(balls.center_world, index) + transform_each(placements.world_from_object[row], arm)
    return x, unit(transform_each(placements.normals[row], direction)) * placements.mirror[row]


def _rod_points(geometry: Geometry, index: Array, at: Array) -> tuple[Array, Array]:
    """Points brought back to the hull, and outward normals, as `_ball_points`."""
    rods, placements = geometry.rods, geometry.placements
    s, off = along_rod(rods, index, at)
    direction, radii = unit(off), rods.radii[:, index]
    arm = s * pick(rods.axis, index) + ((1 - s) * radii[0] + s * radii[1]) * direction
    row = rods.row[index]
    x = pick(rods.start_world, index) + transform_each(placements.world_from_object[row], arm)
    return x, unit(transform_each(placements.normals[row], direction)) * placements.mirror[row]


def along_rod(rods: Rods, index: Array, at: Array) -> tuple[Array, Array]:
    """How far along (m,), from 0 to 1, is the sphere that touches the hull at the points `at`
    (3, m) of the world, and from its centre (3, m) to them, in the object.
    """
    from_start = transform_each(rods.object_from_world[index], at - pick(rods.start_world, index))
    axis, radii = pick(rods.axis, index), rods.radii[:, index]
    length = np.sqrt(dot(axis, axis))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        sine = (radii[0] - radii[1]) / length
        square = (1 - sine) * (1 + sine)
        s = (dot(from_start, axis) / length - radii[0] * sine) / (square * length)
    s = np.where((length > 0) & (square > 0), np.clip(s, 0, 1), radii[0] < radii[1])
    return s, from_start - s * axis
