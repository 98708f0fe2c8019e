"""Where rays meet surfaces: points, normals and the side that is seen (notes, sections 2.7, 4.7-4.9
and 6.2).
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from ..evaluation.attributes import Attributes
from ..evaluation.geometry import ULPS, Geometry
from ..evaluation.surface import Spot, Surface, along_rod, points_on
from ..linear.columns import add_at, dot, length, pick, transform_each, unit
from .cancellation import Cancellation
from .rays import Rays, weigh
from .shapes import meet_rod

Array = np.ndarray

BLOCK = 1 << 15
_ONCE = np.array([[1.0], [0.0], [0.0], [0.0]])


def spot_at(geometry: Geometry, rays: Rays, ray: Array, primitive: Array) -> Spot:
    """Where ray `ray` (n,) meets `primitive` (n,)."""
    weights = np.zeros((3, len(ray)))
    flat = np.flatnonzero(primitive < geometry.triangle_count)
    weights[:, flat] = weigh(rays, geometry, ray[flat], primitive[flat]).barycentric()
    weights[0, primitive >= geometry.triangle_count] = 1.0
    rods = np.flatnonzero(primitive >= geometry.first_rod)
    if len(rods):
        weights[:2, rods] = _along(geometry, rays, ray[rods], primitive[rods])
    return Spot.of(geometry, primitive, weights)


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
    x, g, reach = points_on(geometry, primitive, spot.weights, o, d, depth)
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
