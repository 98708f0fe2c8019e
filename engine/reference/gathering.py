"""Bounced light from near by: each sample of a point looks along rays for what throws light on it
(final gathering), where the few points that stand for all of it would be spots, and blur the
shadows of what they lie on (Kollig and Keller 2004, Illumination in the presence of weak
singularities).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import Strands
from .blocks import Shares, shares_of
from .bumps import bump_shadow
from .coefficients import Coefficients
from .gloss import even_gloss
from .lobe_light import fibres, matt_lobes
from .paths import Interaction, Paths, leaving, widened
from .surface import Surface
from .tabled_lights import far_share
from .terminator import lowered
from .vectors import basis_around, dot, pick

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray


def gathering(
    stage: Stage, at: Interaction, sample: int, places: Array, shares: Shares | None = None
) -> list[Paths]:
    """Rays from the points that throw light back as what is matt does. places: (n,) of the tile's
    pixels in their blocks.  shares: how pixels of a block share what the rays find; None where they
    do not.
    """
    if stage.bounces:
        return bouncing(stage, at, sample, places)
    paths, hit, surface, coefficients = at.paths, at.hit, at.surface, at.coefficients
    if not stage.gathers(paths):
        return []
    gloss = _gloss(stage, at)
    past = {**_past(paths), "shared": shares is not None}
    is_shared = np.zeros(len(hit), bool)
    if shares is not None:
        is_shared = shares.group[at.pixel] >= 0
        weight = paths.weight.copy()
        weight[:, hit[is_shared]] = 1.0
        paths = replace(paths, weight=weight)
    result = []
    points = stage.gather_points(sample, places[at.pixel])
    for point in points:
        d = _direction(surface.n, point)
        k = _thrown_back(surface, coefficients.diffuse, gloss, d)
        k = np.where(is_shared, 1.0, k) / len(points)
        go = np.flatnonzero(k.any(0) & (dot(d, surface.g) > 0))
        some, given = surface.take(go), pick(k, go)
        found = leaving(paths, hit[go], some, pick(d, go), given, 0.0)
        rays = replace(found.rays, far=np.full(len(found), stage.reach))
        result.append(replace(found, rays=rays, skyless=np.ones(len(found), bool), **past))
    return [found for found in result if len(found)]


def bouncing(stage: Stage, at: Interaction, sample: int, places: Array) -> list[Paths]:
    """The ray along which light goes on that what is matt throws back; strands have points of
    bounced light. Of what bounced before, as much as the surface gives back (Russian roulette:
    Arvo, Kirk 1990, Particle transport and image synthesis). places: as `gathering`.
    """
    paths, hit = at.paths, at.hit
    if not stage.gathers(paths):
        return []
    d, k, share, least = bounce(stage, at, sample, places)
    after = np.abs(at.weight * k).max(0)
    is_strand = at.surface.primitive >= stage.geometry.first_rod
    go = np.flatnonzero((after > 0) & (dot(d, at.surface.g) > 0) & (least < share) & ~is_strand)
    given = pick(k, go) / share[go]
    found = leaving(paths, hit[go], at.surface.take(go), pick(d, go), given, 0.0)
    found = replace(found, skyless=np.ones(len(found), bool), **_past(paths))
    return [found] if len(found) else []


def bounce(
    stage: Stage, at: Interaction, sample: int, places: Array
) -> tuple[Array, Array, Array, Array]:
    """Where light goes on, (3, n); what points throw back of what comes from there, (3, n); what
    share of the rays goes on, and the number that this share has to be above, (n,) each. places: as
    `gathering`.
    """
    surface, coefficients = at.surface, at.coefficients
    *disc, least = stage.bounce_points(sample, at.paths.bounced, places[at.pixel])
    d = _direction(surface.n, np.array(disc))
    every, cosine = np.arange(len(surface)), dot(surface.n, d)
    lobes = matt_lobes(surface, coefficients, every, d)
    lobes = lobes + fibres(surface, coefficients.fibres, every, d, matt=False)
    lobes = np.where(cosine > 0, lobes / np.maximum(cosine, 2.0**-20), 0.0)
    k = _thrown_back(surface, coefficients.diffuse + lobes, _gloss(stage, at), d)
    share = np.ones(len(at.hit))
    if at.paths.bounced:
        before, after = np.abs(at.weight).max(0), np.abs(at.weight * k).max(0)
        share = np.minimum(after / np.where(before > 0, before, 1.0), 1.0)
    return d, k, share, least


def _past(paths: Paths) -> dict[str, Any]:
    """Of gather rays from what the paths meet."""
    again = {"reflections": paths.reflections + 1, "bounced": paths.bounced + 1}
    return {**again, "gathers": True}


def _thrown_back(surface: Surface, matt: Array, gloss: Array, d: Array) -> Array:
    """(3, n) what points throw back as what is matt does, of light along d (3, n)."""
    hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, d)
    low = lowered(surface.lowering, dot(surface.n, d))
    return np.where(hidden, 0.0, low * (share * matt + gloss))


def _gloss(stage: Stage, at: Interaction) -> Array:
    cosine = dot(at.surface.n, at.surface.v)
    return even_gloss(cosine, at.coefficients.highlights, stage.settings.reflecting)


def sharing(stage: Stage, at: Interaction, blocks: Array) -> Shares:
    """How pixels of a tile share what bounced light camera rays' points get. blocks: (n,) of the
    pixels.
    """
    surface, coefficients = at.surface, at.coefficients
    matt = coefficients.diffuse + _gloss(stage, at)
    some = matt.any(0) & np.isfinite(matt).all(0) & ~surface.unbent.any(0)
    some &= (dot(surface.n, surface.g) > 0) & (surface.lowering == 1)
    given = np.where(some, at.weight * matt, 0.0)
    apart = given.any(0) & stage.points_apart(surface)
    return shares_of(surface, at.pixel, given, apart, blocks)


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
    far = 0.0 if stage.bounces else far_share(dot(to, to), stage.reach)
    near = np.where(np.array(is_hair, bool)[block], 0.0, 1 - far)
    none = np.zeros_like(coefficients.diffuse)
    even = 0.0 if stage.bounces else coefficients.thrown_on(surface)
    lobes = (*coefficients.sheens, *coefficients.fibres) if stage.bounces else ()
    matt = [replace(term, k=pick(near * np.ones((3, 1)), term.index) * term.k) for term in lobes]
    return replace(
        coefficients,
        ambient=none,
        diffuse=near * (coefficients.diffuse + even + gloss),
        translucent=near * coefficients.translucent,
        emission=none,
        highlights=[],
        mirrors=[],
        refractions=[],
        sheens=[term for term in matt if not term.lobe.kind.startswith("FIBRE")],
        fibres=[term for term in matt if term.lobe.kind == "FIBRE_DIFFUSE"],
    )


def seen_lobes(stage: Stage, at: Interaction) -> Interaction:
    """The points with what the paths see of the lobes there."""
    if at.paths.gathers:
        return replace(at, coefficients=_as_diffuse(stage, at))
    if not at.paths.reflections:
        return at
    return replace(at, coefficients=widened(at.coefficients, at.paths.widest[at.hit]))
