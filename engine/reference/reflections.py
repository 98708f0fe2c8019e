"""Rays that rough surfaces reflect towards others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..evaluation.surface import Surface
from ..linear.columns import dot, pick
from .closures import Term
from .gloss import Narrow, Reflections, reflecting
from .lights import LightPoint
from .lobe_light import highlights
from .paths import Interaction, Paths, leaving
from .picture import Tile
from .stage import Stage

Array = np.ndarray

TIMES_REST, TIMES_BEFORE, OWN, STRONG = 2.0, 16.0, 4.0, 0.1
"""What rough surfaces reflect in a sample is no more than so often the mean of the rest of the
pixel's light and of what they reflected in earlier samples, and so much of itself over the square
of the samples: of the first two all. The latter two are the more the more than STRONG the surface
gives back: metals show little else.
"""
SETTLED = 64
"""Samples from which on these limits grow with their number, so that many have none."""


def reflected(stage: Stage, at: Interaction, sample: int) -> list[Paths]:
    """What leaves rough surfaces towards others."""
    terms = reflecting(at.coefficients.highlights, stage.settings.reflecting)
    narrow = Narrow(at.surface, terms, at.weight, Reflections())
    if not narrow:
        return []
    found = _leaving(stage, at, terms, narrow, stage.lobe_point(sample, at.paths.reflections))
    return [found] if len(found) else []


def shown(tile: Tile, found: Tile, thrown: Array, sample: int) -> Array:
    """(3, n) how much of what rough surfaces reflect in a sample is shown: what few of a pixel's
    rays find would be a dot. found: that.  thrown: (n,) the most that rough surfaces give back of
    what such rays meet.  tile: the rest, which keeps how much both are.
    """
    tile.brought[:] = [np.abs(part.color()).max(0) for part in (found, tile)]
    gloss, rest = tile.brought
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        own = OWN * gloss / (sample + 1) + TIMES_BEFORE * tile.before[0]
        most = TIMES_REST * (tile.before[1] + rest) + np.maximum(1.0, (thrown / STRONG) ** 2) * own
        most /= min(sample + 1, SETTLED)
        part = np.where(gloss > most, most / gloss, 1.0)
    return np.tile(part, (3, 1))


def _thrown(surface: Surface, terms: list[Term], narrow: Narrow, go: Array, d: Array) -> Array:
    """What rays that are drawn along d (3, k) at points `go` (k,) carry of what they meet."""
    return highlights(surface, terms, go, d) / (np.pi * narrow.density(go, d))


def _leaving(
    stage: Stage,
    at: Interaction,
    terms: list[Term],
    narrow: Narrow,
    point: LightPoint,
) -> Paths:
    """A ray from each point in the direction in which the half vector at `point` of the lobes
    mirrors the one that met it.
    """
    paths, hit, surface = at.paths, at.hit, at.surface
    d, drawn, exponent = narrow.draw(point)
    go = np.flatnonzero(drawn & (dot(surface.g, d) > 0))
    d, some = pick(d, go), surface.take(go)
    own = np.exp2(np.clip(np.floor(np.log2(np.maximum(exponent[go], 1.0))), 0, 60))
    widest = paths.widest.copy()
    widest[hit[go]] = np.minimum(widest[hit[go]], own)
    k = _thrown(surface, terms, narrow, go, d)
    k = np.where(np.isfinite(k), k, 0.0)
    found = leaving(replace(paths, widest=widest), hit[go], some, d, k, stage.settings.cutoff)
    skyless = np.ones(len(found), bool)
    return replace(found, reflections=paths.reflections + 1, skyless=skyless)
