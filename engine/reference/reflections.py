"""Rays that rough surfaces reflect towards others. Where their lobes are wide pixels of a block on
one surface reflect theirs in directions of their own (Keller, Heidrich 2001, Interleaved sampling),
in turn, and share what these bring.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..sampling import GLOSS_BLOCK
from .blocks import ALONE, WAITS, groups, turns
from .coefficients import Term
from .gloss import Narrow, Reflections, reflecting
from .lights import CENTER, LightPoint
from .lobe_light import highlights
from .paths import Interaction, Paths, leaving
from .surface import Surface
from .vectors import dot, pick

if TYPE_CHECKING:
    from .picture import Tile
    from .stage import Stage

Array = np.ndarray

LEAST_UNMIXED = 128.0
"""Exponent of the narrowest lobe of a point: what that reflects is seen too sharply to be mixed."""
TIMES_REST, TIMES_BEFORE, OWN, STRONG = 2.0, 16.0, 4.0, 0.1
"""What rough surfaces reflect in a sample is no more than so often the mean of the rest of the
pixel's light and of what they reflected in earlier samples, and so much of itself over the square
of the samples: of the first two all. The latter two are the more the more than STRONG the surface
gives back: metals show little else.
"""
SETTLED = 64
"""Samples from which on these limits grow with their number, so that many have none."""


@dataclass(frozen=True, eq=False)
class Mixing:
    """How n pixels of a tile share what their rays bring. group: (n,) its number, -1 for none.
    members: (groups, most) pixels, -1 for none.  turn: (n,) of each in this sample, ALONE without
    group. given: (3, n) what each gives back of light where its normal mirrors, 1 without group.
    """

    group: Array
    members: Array
    turn: Array
    given: Array

    def shares(self) -> tuple[Array, Array, Array]:
        """(k,) pixels that sent rays, (k,) pixels that get some of what these brought, and (3, k)
        how many times as much as the first get.
        """
        alone = np.flatnonzero(self.group < 0)
        rows, columns = np.nonzero(self.members >= 0)
        pixels, sends = self.members[rows, columns], self.turn[self.members] != WAITS
        sends &= self.members >= 0
        some, others = np.nonzero(sends[rows])
        sender, receiver = self.members[rows[some], others], pixels[some]
        given = pick(self.given, sender)
        part = np.divide(1.0, given, out=np.zeros_like(given), where=given != 0)
        part *= pick(self.given, receiver) / sends.sum(1)[rows[some]]
        return (
            np.concatenate([alone, sender]),
            np.concatenate([alone, receiver]),
            np.concatenate([np.ones((3, len(alone))), part], 1),
        )


def reflected(stage: Stage, at: Interaction, sample: int) -> list[Paths]:
    """What leaves rough surfaces towards others."""
    terms = reflecting(at.coefficients.highlights, stage.settings.reflecting)
    narrow = Narrow(at.surface, terms, at.weight, Reflections())
    if not narrow:
        return []
    found = _leaving(stage, at, terms, narrow, stage.lobe_point(sample, at.paths.reflections))
    return [found] if len(found) else []


def reflected_in_blocks(
    stage: Stage, at: Interaction, sample: int, blocks: Array
) -> tuple[list[Paths], Mixing | None]:
    """The same of camera rays, and how pixels share what those rays bring that are `mixed`. blocks:
    (2, n) `gloss_blocks` of the tile's pixels.
    """
    terms = reflecting(at.coefficients.highlights, stage.settings.reflecting)
    narrow = Narrow(at.surface, terms, at.weight, Reflections())
    if not narrow:
        return [], None
    given, exponents = _given(at, terms, narrow)
    mixing = _mixing(given, exponents, at, sample, blocks)
    mixed = given.any(0)
    turn = np.where(mixed, mixing.turn[at.pixel], -1)
    own, places = stage.lobe_point(sample, 0).disc, stage.gloss_points(sample)
    result = []
    for one, point in ((-1, own), (ALONE, own), *enumerate(places)):
        here = LightPoint(CENTER.square, point)
        found = _leaving(stage, at, terms, narrow, here, turn == one)
        result.append(replace(found, mixed=one >= 0))
    return [found for found in result if len(found)], mixing


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


def _given(at: Interaction, terms: list[Term], narrow: Narrow) -> tuple[Array, Array]:
    """(3, m) what points with wide lobes alone give back of light from where n mirrors the ray, 0
    elsewhere, and (m,) the exponent of their narrowest lobes.
    """
    d, drawn, exponent = narrow.draw(CENTER)
    go = np.flatnonzero(drawn & (dot(at.surface.g, d) > 0) & (exponent < LEAST_UNMIXED))
    given = np.zeros_like(at.weight)
    found = pick(at.weight, go) * _thrown(at.surface, terms, narrow, go, pick(d, go))
    given[:, go] = np.where(np.isfinite(found).all(0), found, 0.0)
    return given, exponent


def _thrown(surface: Surface, terms: list[Term], narrow: Narrow, go: Array, d: Array) -> Array:
    """What rays that are drawn along d (3, k) at points `go` (k,) carry of what they meet."""
    return highlights(surface, terms, go, d) / (np.pi * narrow.density(go, d))


def _leaving(
    stage: Stage,
    at: Interaction,
    terms: list[Term],
    narrow: Narrow,
    point: LightPoint,
    here: Array | None = None,
) -> Paths:
    """A ray from each point, or from those that are `here` (m,), in the direction in which the half
    vector at `point` of the lobes mirrors the one that met it.
    """
    paths, hit, surface = at.paths, at.hit, at.surface
    d, drawn, exponent = narrow.draw(point)
    go = np.flatnonzero(drawn & (dot(surface.g, d) > 0) & (True if here is None else here))
    d, some = pick(d, go), surface.take(go)
    own = np.exp2(np.clip(np.floor(np.log2(np.maximum(exponent[go], 1.0))), 0, 60))
    widest = paths.widest.copy()
    widest[hit[go]] = np.minimum(widest[hit[go]], own)
    k = _thrown(surface, terms, narrow, go, d)
    k = np.where(np.isfinite(k), k, 0.0)
    found = leaving(replace(paths, widest=widest), hit[go], some, d, k, stage.settings.cutoff)
    skyless = np.ones(len(found), bool)
    return replace(found, reflections=paths.reflections + 1, skyless=skyless)


def _mixing(given: Array, exponents: Array, at: Interaction, sample: int, blocks: Array) -> Mixing:
    some = np.flatnonzero(given.any(0))
    some = some[np.argsort(blocks[1, at.pixel[some]])]
    channels = np.array([1, 2, 4]) @ (pick(given, some) != 0)
    group, members = groups(
        at.surface.take(some),
        at.pixel[some],
        blocks[0],
        channels,
        (GLOSS_BLOCK + 1) ** 2,
        exponents[some],
    )
    seen = np.ones((3, blocks.shape[1]))
    seen[:, at.pixel[some]] = pick(given, some)
    return Mixing(group, members, turns(members, sample, blocks.shape[1]), seen)
