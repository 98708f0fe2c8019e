"""Where rays meet surfaces: points, normals and the side that is seen (notes, sections 2.7, 4.7-4.9
and 6.2).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..linear.columns import add_at, cross, dot, length, pick, transform_each, unit
from .attributes import Attributes
from .cancellation import Cancellation
from .geometry import Geometry
from .rays import ULPS, Rays, weigh
from .shapes import along_rod, meet_rod

Array = np.ndarray

BLOCK = 1 << 15
_ONCE = np.array([[1.0], [0.0], [0.0], [0.0]])


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


def spot_at(geometry: Geometry, rays: Rays, ray: Array, primitive: Array) -> Spot:
    """Where ray `ray` (n,) meets `primitive` (n,)."""
    weights = np.zeros((3, len(ray)))
    flat = np.flatnonzero(primitive < geometry.triangle_count)
    weights[:, flat] = weigh(rays, geometry, ray[flat], primitive[flat]).barycentric()
    weights[0, primitive >= geometry.triangle_count] = 1.0
    rods = np.flatnonzero(primitive >= geometry.first_rod)
    if len(rods):
        weights[:2, rods] = _along(geometry, rays, ray[rods], primitive[rods])
    row = geometry.row[primitive]
    return Spot(
        primitive,
        geometry.placements.geometry[row],
        geometry.primitive_of(primitive),
        weights,
        geometry.material[primitive],
    )


def _along(geometry: Geometry, rays: Rays, ray: Array, primitive: Array) -> Array:
    """(2, n) weights of the two ends where rays meet segments."""
    index, (o, d) = primitive - geometry.first_rod, rays.lines(ray)
    s, _ = along_rod(geometry.rods, index, o + meet_rod(geometry.rods, index, o, d) * d)
    return np.stack([1 - s, s])


def surface_at(
    geometry: Geometry,
    attributes: Attributes,
    rays: Rays,
    ray: Array,
    primitive: Array,
    depth: Array,
    cancellation: Cancellation,
    backwards: bool = False,
) -> Surface:
    """The surfaces that rays `ray` meet at `depth`, worked out in blocks that fit into the
    processor's cache; backwards: as seen from the rays' other end.
    """
    parts = []
    for begin in range(0, max(len(ray), 1), BLOCK):
        cancellation.check()
        part = slice(begin, begin + BLOCK)
        parts.append(
            _surface(geometry, attributes, rays, ray[part], primitive[part], depth[part], backwards)
        )
    if len(parts) == 1:
        return parts[0]
    whole = Surface(
        **{
            f.name: np.concatenate([getattr(part, f.name) for part in parts], -1)
            for f in fields(Surface)
        }
    )
    cancellation.check()
    return whole


def _surface(
    geometry: Geometry,
    attributes: Attributes,
    rays: Rays,
    ray: Array,
    primitive: Array,
    depth: Array,
    backwards: bool,
) -> Surface:
    spot = spot_at(geometry, rays, ray, primitive)
    o, d = rays.lines(ray)
    row = geometry.row[primitive]
    x, g, reach = _triangle_points(geometry, spot)
    _place_shapes(geometry, primitive, o, d, depth, x, g, reach)
    v = unit(d if backwards else -d)
    outside = dot(g, v) >= 0
    side = np.where(outside, 1.0, -1.0)
    n, start = _shading_normals(geometry, attributes, spot, row, x, g, side)
    grazing, shading = geometry.placements.offsets[:, geometry.placements.block[row]]
    return Surface(
        **vars(spot),
        row=row,
        x=x,
        g=g * side,
        n=n,
        v=v,
        start=start,
        outside=outside,
        offset=ULPS * reach,
        mesh_n=n,
        unbent=np.zeros_like(n),
        bump=np.zeros(len(depth)),
        far=length(x - o),
        grazing=grazing,
        lowering=1 / (1 - 0.5 * shading),
        past=np.repeat(_ONCE, len(depth), 1),
    )


def _triangle_points(geometry: Geometry, spot: Spot) -> tuple[Array, Array, Array]:
    """Points from barycentric weights, outward normals, largest coordinates of the corners; zeros
    off triangles.
    """
    flat = np.flatnonzero(spot.primitive < geometry.triangle_count)
    x, g, reach = (
        np.zeros((3, len(spot.primitive))),
        np.zeros((3, len(spot.primitive))),
        np.zeros(len(spot.primitive)),
    )
    triangle, w = spot.primitive[flat], pick(spot.weights, flat)
    a, b, c = (pick(geometry.points, corner[triangle]) for corner in geometry.triangles)
    x[:, flat] = w[0] * a + w[1] * b + w[2] * c
    mirror = geometry.placements.mirror[geometry.row[triangle]]
    g[:, flat] = unit(cross(b - a, c - a)) * mirror
    reach[flat] = np.maximum(np.maximum(np.abs(a).max(0), np.abs(b).max(0)), np.abs(c).max(0))
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
        x[:, balls], g[:, balls] = _ball_points(
            geometry, shape[balls], pick(o, balls) + depth[balls] * pick(d, balls), pick(o, balls)
        )
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


def _ball_points(geometry: Geometry, index: Array, at: Array, o: Array) -> tuple[Array, Array]:
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


def _bulge(v: list[Array], n: list[Array], w: Array) -> Array:
    """(m,) how far over a face the surface may be that its normals tell of: the least of what the
    three corners' tangent planes have there over the highest corner, or half of a parabola's.
    v, n: (3, m) each, corners and their unit normals. w: (3, m) weights.
    """
    over = [[dot(v[j] - v[k], n[k]) for j in range(3)] for k in range(3)]
    least: Array = np.min(
        [
            np.maximum(np.max(over[k], 0) - sum(w[j] * over[k][j] for j in range(3)), 0.0)
            for k in range(3)
        ],
        0,
    )
    parabola = -sum(w[j] * w[k] * (over[j][k] + over[k][j]) for j, k in ((0, 1), (0, 2), (1, 2)))
    return np.maximum(least, parabola / 2)


def _shading_normals(
    geometry: Geometry,
    attributes: Attributes,
    spot: Spot,
    row: Array,
    x: Array,
    g: Array,
    side: Array,
):
    """Interpolated normals, and the lifted starts of shadow rays (after Hanika 2021, Hacking the
    shadow terminator).
    """
    pool = attributes.normals()
    smooth = np.flatnonzero(pool.has(spot.geometry) & (spot.primitive < geometry.triangle_count))
    n, start = g * side, x.copy()
    if not len(smooth):
        return n, start
    w, side = pick(spot.weights, smooth), side[smooth]
    matrix, mirror = (
        geometry.placements.normals[row[smooth]],
        geometry.placements.mirror[row[smooth]],
    )
    corners = pool.at_corners(spot.geometry[smooth], spot.local[smooth])
    mixed = (
        unit(transform_each(matrix, w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2]))
        * mirror
        * side
    )
    zero = ~mixed.any(0)
    n[:, smooth] = np.where(zero, pick(n, smooth), mixed)
    normals = [unit(transform_each(matrix, corner)) * mirror * side for corner in corners]
    places = [pick(geometry.points, t[spot.primitive[smooth]]) for t in geometry.triangles]
    lift = _bulge(places, normals, w) * sum(w[k] * normals[k] for k in range(3))
    face = pick(g, smooth) * side
    # never below the face: a thin thing's normals may point there by their rounding
    lift -= np.minimum(0.0, dot(lift, face)) * face
    add_at(start, smooth, lift)
    return n, start
