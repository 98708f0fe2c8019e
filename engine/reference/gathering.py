"""Bounced light from near by: each sample of a point looks along rays for what throws light on it
(final gathering), where the few points that stand for all of it would be spots, and blur the
shadows of what they lie on (Kollig and Keller 2004, Illumination in the presence of weak
singularities).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..sampling import GATHER_BLOCK
from ..scene import Strands
from .bumps import bump_shadow
from .gloss import even_gloss
from .materials import Coefficients
from .paths import Interaction, Paths, leaving, widened
from .surface import Surface
from .tabled_lights import far_share
from .terminator import lowered
from .vectors import basis_around, dot, pick

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray

ALIKE = 0.97
"""Least cosine between the normals of points of pixels of a block that share what rays find."""
FLAT = 0.04
"""Of the way between these points, squared, the most along their normals."""


@dataclass(frozen=True, eq=False)
class Shares:
    """Which of n pixels of a tile get what gather rays of others find: neighbours on one surface
    look in directions of their own (Keller, Heidrich 2001, Interleaved sampling), and each takes
    what the others find as if it had found it (Bekaert, Sbert, Halton 2002, Accelerating path
    tracing by re-using paths). group: (n,) its number, -1 for none.  members: (groups, most)
    pixels, -1 for none.  x, normal: (3, n) where they look from.  matt: (3, n) what each throws
    back of light from all sides.
    """

    group: Array
    members: Array
    x: Array
    normal: Array
    matt: Array

    def given(self, pixel: Array, x: Array, g: Array) -> tuple[Array, Array, Array]:
        """(k,) which rays, (k,) the pixels that get something of what these find, (3, k) what of
        it: by how densely the rays of each look there (the balance heuristic). pixel: (m,) of the
        rays, x, g: (3, m) what they meet, and its normal.
        """
        group = self.group[pixel]
        members = self.members[group].copy()
        members[:, 0] = np.where(group < 0, pixel, members[:, 0])
        members[group < 0, 1:] = -1
        dense = np.zeros(members.shape)
        for k, other in enumerate(members.T):
            to = x - pick(self.x, other)
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.maximum(dot(pick(self.normal, other), to), 0.0) * np.abs(dot(g, to))
                dense[:, k] = np.where(other >= 0, found / dot(to, to) ** 2, 0.0)
        alone = (members >= 0).sum(1) == 1
        dense[alone] = members[alone] >= 0
        total = dense.sum(1)
        ray, k = np.nonzero((dense > 0) & (total > 0)[:, None])
        receiver = members[ray, k]
        return ray, receiver, dense[ray, k] / total[ray] * pick(self.matt, receiver)


def gathering(
    stage: Stage, at: Interaction, sample: int, places: Array, blocks: Array | None = None
) -> tuple[list[Paths], Shares | None]:
    """Rays from the points that throw light back as what is matt does. places: (n,) of the tile's
    pixels in their blocks.  blocks: (n,) which blocks these are, where pixels of a block share what
    the rays find as the shares say that are returned.
    """
    paths, hit, surface, coefficients = at.paths, at.hit, at.surface, at.coefficients
    if not stage.gathers(paths):
        return [], None
    which = stage.settings.reflecting
    gloss = even_gloss(dot(surface.n, surface.v), coefficients.highlights, which)
    points = stage.gather_points(sample, places[at.pixel])
    past = {"reflections": paths.reflections + 1, "gathers": True}
    past["shared"] = blocks is not None
    shares, sharing = None, np.zeros(len(hit), bool)
    if blocks is not None:
        shares, sharing = _shares(at, coefficients.diffuse + gloss, len(places), blocks)
        some = np.flatnonzero(sharing)
        weight = paths.weight.copy()
        weight[:, hit[some]] = 1.0
        paths = replace(paths, weight=weight)
    result = []
    for point in points:
        d = _direction(surface.n, point)
        hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, d)
        low = lowered(surface.lowering, dot(surface.n, d))
        k = np.where(hidden, 0.0, low * (share * coefficients.diffuse + gloss))
        k = np.where(sharing, 1.0, k)
        go = np.flatnonzero(k.any(0) & (dot(d, surface.g) > 0))
        some, given = surface.take(go), pick(k, go) / len(points)
        found = leaving(paths, hit[go], some, pick(d, go), given, 0.0)
        rays = replace(found.rays, far=np.full(len(found), stage.reach))
        result.append(replace(found, rays=rays, skyless=np.ones(len(found), bool), **past))
    return [found for found in result if len(found)], shares


def _shares(at: Interaction, matt: Array, pixels: int, blocks: Array) -> tuple[Shares, Array]:
    """Which of a tile's pixels share what gather rays find, and (m,) bool: which of the points do.
    matt: (3, m) what these throw back of light from all sides.
    """
    surface, pixel = at.surface, at.pixel
    sharing = matt.any(0) & np.isfinite(matt).all(0) & ~surface.unbent.any(0)
    sharing &= (dot(surface.n, surface.g) > 0) & (surface.lowering == 1)
    some = np.flatnonzero(sharing)
    x, normal, seen = np.zeros((3, 3, pixels))
    x[:, pixel], normal[:, pixel] = surface.x, surface.n
    seen[:] = 1.0
    seen[:, pixel[some]] = pick(at.weight * matt, some)
    return Shares(*groups(surface.take(some), pixel[some], blocks), x, normal, seen), sharing


def groups(
    surface: Surface, pixel: Array, blocks: Array, kinds: Array | None = None
) -> tuple[Array, Array]:
    """`Shares.group` and `members` of points of these pixels, of tiles' pixels in these blocks: in
    their order, each joins the first group of its block whose first point is on its surface and of
    its kind. kinds: (m,) of the points.
    """
    most = GATHER_BLOCK * GATHER_BLOCK
    group, members = np.full(len(blocks), -1), np.full((len(pixel) + 1, most), -1)
    if not len(pixel):
        return group, members
    order = np.argsort(blocks[pixel], kind="stable")
    _, first, row = np.unique(blocks[pixel[order]], return_index=True, return_inverse=True)
    table = np.full((len(first), most), -1)  # points of each block
    table[row, np.arange(len(order)) - first[row]] = order
    kinds = np.zeros(len(pixel)) if kinds is None else kinds
    count = 0
    for k in range(most):
        leads = np.flatnonzero((table[:, k] >= 0) & (group[pixel[table[:, k]]] < 0))
        lead = table[leads, k]
        for j in range(k, most):
            other = table[leads, j]
            free = (other >= 0) & (group[pixel[other]] < 0)
            alike = kinds[lead] == kinds[other]
            on = np.flatnonzero(free & alike & _is_one_surface(surface, lead, other))
            group[pixel[other[on]]] = count + on
            members[count + on, j] = pixel[other[on]]
        count += len(leads)
    return group, members


def _is_one_surface(surface: Surface, a: Array, b: Array) -> Array:
    n, m, way = pick(surface.n, a), pick(surface.n, b), pick(surface.x, a) - pick(surface.x, b)
    flat = FLAT * dot(way, way)
    return (dot(n, m) >= ALIKE) & (dot(way, n) ** 2 <= flat) & (dot(way, m) ** 2 <= flat)


def _direction(n: Array, point: Array) -> Array:
    """(3, n) at points (2, n) of the unit disc below the directions round n (Malley's method)."""
    x, y = point
    first, second = basis_around(n)
    return np.sqrt(np.maximum(1 - x * x - y * y, 0.0)) * n + x * first + y * second


def _as_diffuse(stage: Stage, at: Interaction) -> Coefficients:
    """What throws light on alike to all sides, as walks have it, and gives nothing of itself: as
    much of it as the points of bounced light do not have. Strands throw no light on.
    """
    surface, coefficients = at.surface, at.coefficients
    scene, block = stage.scene, stage.geometry.placements.block[surface.row]
    varnished = [any(lobe.kind == "AMBIENT" for lobe in m.lobes) for m in scene.materials]
    is_hair = [isinstance(scene.geometries[b.geometry], Strands) for b in scene.instances]
    gloss = even_gloss(dot(surface.n, surface.v), coefficients.highlights)
    gloss = np.where(np.array(varnished, bool)[surface.material], gloss, 0.0)
    o, _ = at.paths.rays.lines(at.hit)
    to = surface.x - o
    near = np.where(np.array(is_hair, bool)[block], 0.0, 1 - far_share(dot(to, to), stage.reach))
    none = np.zeros_like(coefficients.diffuse)
    return replace(
        coefficients,
        ambient=none,
        diffuse=near * (coefficients.diffuse + gloss),
        translucent=near * coefficients.translucent,
        emission=none,
        highlights=[],
        mirrors=[],
        refractions=[],
        sheens=[],
        fibres=[],
    )


def seen_lobes(stage: Stage, at: Interaction) -> Interaction:
    """The points with what the paths see of the lobes there."""
    if at.paths.gathers:
        return replace(at, coefficients=_as_diffuse(stage, at))
    if not at.paths.reflections:
        return at
    return replace(at, coefficients=widened(at.coefficients, at.paths.widest[at.hit]))
