"""Light that surfaces throw onto each other: from each point one ray goes on where what is matt
there scatters light to; what it meets is lit and scatters the next (Kajiya 1986, The rendering
equation).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import around, dot, pick
from .bumps import bump_shadow
from .coefficients import Coefficients
from .fibre_sampling import sampled
from .gloss import even_gloss
from .lights import LightSample
from .lobe_light import fibres, matt_lobes, ways_through
from .paths import Interaction, Paths, leaving, thrown_on, widened
from .stage import Stage
from .terminator import lowered

Array = np.ndarray


def bouncing(stage: Stage, at: Interaction, sample: int, places: Array) -> list[Paths]:
    """The rays along which light goes on that what is matt throws back. Of what bounced before, as
    much as the surface gives back (Russian roulette: Arvo, Kirk 1990, Particle transport and image
    synthesis). places: (n,) of the tile's pixels, as `Stage.places`.
    """
    paths, hit, surface = at.paths, at.hit, at.surface
    if paths.bounced >= stage.fibre_bounces:
        return []
    d, k, share, least = bounce(stage, at, sample, places, not stage.gathers(paths))
    side = np.where(dot(d, surface.n) < 0, -1.0, 1.0)
    given = np.abs(at.weight * k).max(0) > 0
    go = np.flatnonzero(given & (side * dot(d, surface.g) > 0) & (least < share))
    if not len(go):
        return []
    some, along = surface.take(go), pick(d, go)
    gone = leaving(paths, hit[go], some, along, pick(k, go) / share[go], 0.0)
    there = LightSample(along, np.ones(len(go)), None, np.zeros(len(go)))
    through = ways_through(surface, at.coefficients.fibres, go, there)
    if through is not None:
        rays = replace(gone.rays, origin=gone.rays.origin + through * along)
        gone = replace(gone, rays=rays)
    return [thrown_on(gone)]


def bounce(
    stage: Stage, at: Interaction, sample: int, places: Array, fibres_alone: bool
) -> tuple[Array, Array, Array, Array]:
    """Where light goes on, (3, n); what points throw back of what comes from there, (3, n); what
    share of the rays goes on, and the number that this share has to be above, (n,) each. places: as
    `bouncing`. fibres_alone: nothing throws light back but strands, and these by what is not matt.
    """
    surface, coefficients = at.surface, at.coefficients
    *disc, least = stage.bounce_points(sample, at.paths.bounced, places[at.pixel])
    point, factor = np.array(disc), np.ones(len(at.hit))
    d = around(surface.n, point)
    strands = np.flatnonzero(stage.are_strands(surface))
    if len(strands):
        number, least = least[strands], least.copy()
        of = sampled(
            surface, coefficients, at.weight, strands, point[:, strands], number, fibres_alone
        )
        d[:, strands], pdf, least[strands] = of
        cosine = np.abs(dot(pick(surface.n, strands), of[0]))
        with np.errstate(divide="ignore", invalid="ignore"):
            factor[strands] = np.where(pdf > 0, cosine / (np.pi * pdf), 0.0)
    k = factor * _thrown_back(stage, at, d, fibres_alone)
    share = np.ones(len(at.hit))
    if at.paths.bounced:
        before, after = np.abs(at.weight).max(0), np.abs(at.weight * k).max(0)
        share = np.minimum(after / np.where(before > 0, before, 1.0), 1.0)
    return d, k, share, least


def _thrown_back(stage: Stage, at: Interaction, d: Array, fibres_alone: bool) -> Array:
    """(3, n) what points throw back as what is matt does, of light along d (3, n). fibres_alone:
    nothing but strands, and these by what is not matt.
    """
    surface, coefficients = at.surface, at.coefficients
    every, cosine = np.arange(len(surface)), dot(surface.n, d)
    above = np.maximum(np.abs(cosine), 2.0**-20)
    lobes = fibres(surface, coefficients.fibres, every, d, matt=False)
    if fibres_alone:
        return lobes / above
    lobes = np.where(cosine > 0, matt_lobes(surface, coefficients, every, d), 0.0) + lobes
    matt = np.where(cosine > 0, coefficients.diffuse, 0.0) + lobes / above
    seen = dot(surface.n, surface.v)
    shown = "NONE" if at.paths.bounced else stage.settings.reflecting
    gloss = even_gloss(seen, coefficients.highlights, shown)
    gloss = np.where(cosine > 0, gloss, 0.0)
    hidden, share = bump_shadow(surface.n, surface.unbent, surface.bump, d)
    return np.where(hidden, 0.0, lowered(surface.lowering, cosine) * (share * matt + gloss))


def _lit_alone(coefficients: Coefficients) -> Coefficients:
    """What throws light on, and gives nothing of itself."""
    none = np.zeros_like(coefficients.diffuse)
    return replace(coefficients, ambient=none, emission=none, mirrors=[], refractions=[])


def _dull(surface: Surface, coefficients: Coefficients) -> Coefficients:
    """Without highlights, and DIFFUSE lobes with what those of dielectrics kept of their light."""
    terms = [term for term in coefficients.highlights if term.lobe.kind == "SPECULAR"]
    kept = even_gloss(dot(surface.n, surface.v), terms)
    return replace(coefficients, diffuse=(1 + kept) * coefficients.diffuse, highlights=[])


def seen_lobes(stage: Stage, at: Interaction) -> Interaction:
    """The points with what the paths see of the lobes there."""
    if not at.paths.reflections:
        return at
    coefficients = at.coefficients
    if at.paths.gathers:
        if stage.settings.reflective_caustics == "ON":
            gloss = [*coefficients.highlights, *coefficients.thrown]
            coefficients = replace(coefficients, highlights=gloss)
        else:
            coefficients = _dull(at.surface, coefficients)
        coefficients = _lit_alone(coefficients)
    return replace(at, coefficients=widened(coefficients, at.paths.widest[at.hit]))
