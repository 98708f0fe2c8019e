"""Light that surfaces throw onto each other: from each point one ray goes on where what is matt
there scatters light to; what it meets is lit and scatters the next (Kajiya 1986, The rendering
equation).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene import Strands
from .bumps import bump_shadow
from .coefficients import Coefficients
from .gloss import even_gloss
from .lights import LightSample
from .lobe_light import fibres, matt_lobes, ways_through
from .paths import Interaction, Paths, leaving, widened
from .surface import Surface
from .terminator import lowered
from .vectors import basis_around, dot, pick

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray


def bouncing(stage: Stage, at: Interaction, sample: int, places: Array) -> list[Paths]:
    """The rays along which light goes on that what is matt throws back, those of strands by
    themselves. Of what bounced before, as much as the surface gives back (Russian roulette: Arvo,
    Kirk 1990, Particle transport and image synthesis). places: (n,) of the tile's pixels, as
    `Stage.places`.
    """
    paths, hit, surface = at.paths, at.hit, at.surface
    if not stage.gathers(paths):
        return []
    d, k, share, least = bounce(stage, at, sample, places)
    after = np.abs(at.weight * k).max(0)
    is_strand = surface.primitive >= stage.geometry.first_rod
    side = np.where(dot(d, surface.n) < 0, -1.0, 1.0)
    goes = (after > 0) & (side * dot(d, surface.g) > 0) & (is_strand | (least < share))
    found = []
    for of_strands in (False, True):
        go = np.flatnonzero(goes & (is_strand == of_strands))
        if not len(go) or (of_strands and paths.gathers):
            continue
        given = pick(k, go) if of_strands else pick(k, go) / share[go]
        some, along = surface.take(go), pick(d, go)
        gone = leaving(paths, hit[go], some, along, given, 0.0)
        if of_strands:
            sample_there = LightSample(along, np.ones(len(go)), None, np.zeros(len(go)))
            through = ways_through(surface, at.coefficients.fibres, go, sample_there)
            if through is not None:
                rays = replace(gone.rays, origin=gone.rays.origin + through * along)
                gone = replace(gone, rays=rays)
        skyless = np.ones(len(gone), bool)
        found.append(replace(gone, skyless=skyless, around=of_strands, **_past(paths)))
    return found


def bounce(
    stage: Stage, at: Interaction, sample: int, places: Array
) -> tuple[Array, Array, Array, Array]:
    """Where light goes on, (3, n); what points throw back of what comes from there, (3, n); what
    share of the rays goes on, and the number that this share has to be above, (n,) each. places: as
    `bouncing`.
    """
    surface, coefficients = at.surface, at.coefficients
    *disc, least = stage.bounce_points(sample, at.paths.bounced, places[at.pixel])
    side = _sides(stage, surface, coefficients, least)
    d, factor = _onward(surface.n, np.array(disc), side)
    k = factor * _thrown_back(stage, at, d)
    share = np.ones(len(at.hit))
    if at.paths.bounced:
        before, after = np.abs(at.weight).max(0), np.abs(at.weight * k).max(0)
        share = np.minimum(after / np.where(before > 0, before, 1.0), 1.0)
    return d, k, share, least


def dimmed(stage: Stage, paths: Paths, depth: Array) -> Paths:
    """Those of strands after what their like on the way take. depth: (n,) of what they meet."""
    met = np.flatnonzero(np.isfinite(depth))
    weight, shadows = paths.weight.copy(), stage.shadows.of_strands().met_by("diffuse")
    weight[:, met] *= shadows.along(paths.rays.take(met), depth[met])
    return replace(paths, weight=weight)


def _sides(stage: Stage, surface: Surface, coefficients: Coefficients, number: Array) -> Array:
    """(n,) 0, or of points on strands -1 where their ray goes to the back, else 1, times how many
    sides it stands for: of strands that let light pass, half go to the back.
    """
    passes = np.zeros(len(surface), bool)
    for term in coefficients.fibres:
        if term.lobe.kind == "FIBRE_TRANSMISSION":
            passes[term.index] = True
    is_strand = surface.primitive >= stage.geometry.first_rod
    return is_strand * np.where(passes, np.where(number < 0.5, 2.0, -2.0), 1.0)


def _past(paths: Paths) -> dict[str, Any]:
    """Of rays from what the paths meet."""
    again = {"reflections": paths.reflections + 1, "bounced": paths.bounced + 1}
    return {**again, "gathers": True}


def _thrown_back(stage: Stage, at: Interaction, d: Array) -> Array:
    """(3, n) what points throw back as what is matt does, of light along d (3, n)."""
    surface, coefficients = at.surface, at.coefficients
    every, cosine = np.arange(len(surface)), dot(surface.n, d)
    lobes = np.where(cosine > 0, matt_lobes(surface, coefficients, every, d), 0.0)
    lobes = lobes + fibres(surface, coefficients.fibres, every, d, matt=False)
    lobes = lobes / np.maximum(np.abs(cosine), 2.0**-20)
    matt = np.where(cosine > 0, coefficients.diffuse, 0.0) + lobes
    seen = dot(surface.n, surface.v)
    gloss = even_gloss(seen, coefficients.highlights, stage.settings.reflecting)
    gloss = np.where(cosine > 0, gloss, 0.0)
    hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, d)
    return np.where(hidden, 0.0, lowered(surface.lowering, cosine) * (share * matt + gloss))


def _onward(n: Array, point: Array, side: Array) -> tuple[Array, Array]:
    """(3, m) where rays go on, at points (2, m) of the unit disc: as densely as the cosine round n
    (Malley's method); from strands, whose lobes know none, evenly over half of the sphere. And (m,)
    the cosine's density over that. side: (m,) as `_sides`.
    """
    x, y = point
    first, second = basis_around(n)
    rest = np.maximum(1 - x * x - y * y, 0.0)
    up = np.where(side != 0, np.sign(side) * rest, np.sqrt(rest))
    across = np.where(side != 0, np.sqrt(1 + rest), 1.0)
    factor = np.where(side != 0, 2 * np.abs(side) * rest, 1.0)
    return up * n + across * (x * first + y * second), factor


def _as_diffuse(stage: Stage, at: Interaction) -> Coefficients:
    """What throws light on, and gives nothing of itself. Strands throw no light on."""
    surface, coefficients = at.surface, at.coefficients
    scene, block = stage.scene, stage.geometry.placements.block[surface.row]
    varnished = [any(lobe.kind == "AMBIENT" for lobe in m.lobes) for m in scene.materials]
    is_hair = [isinstance(scene.geometries[b.geometry], Strands) for b in scene.instances]
    gloss = even_gloss(dot(surface.n, surface.v), coefficients.highlights)
    gloss = np.where(np.array(varnished, bool)[surface.material], gloss, 0.0)
    near = np.where(np.array(is_hair, bool)[block], 0.0, 1.0)
    none, ones = np.zeros_like(coefficients.diffuse), np.ones((3, 1))
    lobes = (*coefficients.sheens, *coefficients.fibres)
    matt = [replace(term, k=pick(near * ones, term.index) * term.k) for term in lobes]
    return replace(
        coefficients,
        ambient=none,
        diffuse=near * (coefficients.diffuse + gloss),
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
