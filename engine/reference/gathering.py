"""Bounced light from near by: each sample of a point looks along rays for what throws light on it
(final gathering), where the few points that stand for all of it would be spots, and blur the
shadows of what they lie on (Kollig and Keller 2004, Illumination in the presence of weak
singularities).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..scene import Strands
from .bumps import bump_shadow
from .gloss import even_gloss
from .materials import Coefficients
from .paths import Paths, leaving, widened
from .surface import Surface
from .tabled_lights import far_share
from .vectors import basis_around, dot, pick

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray


def gathering(
    stage: Stage,
    paths: Paths,
    hit: Array,
    surface: Surface,
    coefficients: Coefficients,
    sample: int,
    places: Array,
) -> list[Paths]:
    """Rays from the points that throw light back as what is matt does. places: (pixels,) of each in
    its block.
    """
    if not stage.gathers(paths):
        return []
    gloss = np.zeros_like(coefficients.diffuse)
    if stage.lighting.shows_gloss:
        gloss = even_gloss(dot(surface.n, surface.v), coefficients.highlights)
    points = stage.gather_points(sample, places[paths.pixel[hit]])
    past = {"reflections": paths.reflections + 1, "glossy": True, "gathers": True}
    result = []
    for point in points:
        d = _direction(surface.n, point)
        hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, d)
        k = np.where(hidden, 0.0, share * coefficients.diffuse + gloss)
        go = np.flatnonzero(k.any(0) & (dot(d, surface.g) > 0))
        some, given = surface.take(go), pick(k, go) / len(points)
        found = leaving(paths, hit[go], some, pick(d, go), given, 0.0)
        rays = replace(found.rays, far=np.full(len(found), stage.reach))
        result.append(replace(found, rays=rays, **past))
    return [found for found in result if len(found)]


def _direction(n: Array, point: Array) -> Array:
    """(3, n) at points (2, n) of the unit disc below the directions round n (Malley's method)."""
    x, y = point
    first, second = basis_around(n)
    return np.sqrt(np.maximum(1 - x * x - y * y, 0.0)) * n + x * first + y * second


def _as_diffuse(
    stage: Stage, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
) -> Coefficients:
    """What throws light on alike to all sides, as walks have it, and gives nothing of itself: as
    much of it as the points of bounced light do not have. Strands throw no light on.
    """
    scene, block = stage.scene, stage.geometry.placements.block[surface.row]
    varnished = [any(lobe.kind == "AMBIENT" for lobe in m.lobes) for m in scene.materials]
    is_hair = [isinstance(scene.geometries[b.geometry], Strands) for b in scene.instances]
    gloss = even_gloss(dot(surface.n, surface.v), coefficients.highlights)
    gloss = np.where(np.array(varnished, bool)[surface.material], gloss, 0.0)
    o, _ = paths.rays.lines(hit)
    to = surface.x - o
    near = np.where(np.array(is_hair, bool)[block], 0.0, 1 - far_share(dot(to, to), stage.reach))
    none = np.zeros_like(coefficients.diffuse)
    return replace(
        coefficients,
        ambient=none,
        diffuse=near * (coefficients.diffuse + gloss),
        emission=none,
        highlights=[],
        mirrors=[],
        refractions=[],
        sheens=[],
        fibres=[],
    )


def seen_lobes(
    stage: Stage, paths: Paths, hit: Array, surface: Surface, coefficients: Coefficients
) -> Coefficients:
    """What the paths see of the lobes of what they meet."""
    if paths.gathers:
        return _as_diffuse(stage, paths, hit, surface, coefficients)
    return widened(coefficients, paths.widest[hit]) if paths.reflections else coefficients
