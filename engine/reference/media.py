"""What rays lose in the media that they pass through: where rays are inside of closed surfaces, and
the transmittance e^(-σ s) of what fills these (Beer and Lambert).
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.attributes import Attributes
from ..evaluation.march import Spans
from ..evaluation.media import MediaSpans
from ..linear.columns import dot, pick
from ..scene import EVERYTHING, Scene
from .lights import Source
from .rays import Rays
from .visibility import Visibility

Array = np.ndarray

SLIGHT = 2.0**-20
"""Of a medium's distance: what is thinner scatters nothing."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """What lies along n rays: breaks (n, p + 1), and of each piece between two, (3, n, p) a world
    unit. speed: (n,) world units along the rays.
    """

    breaks: Array
    speed: Array
    extinction: Array
    scattering: Array
    emission: Array

    @property
    def ways(self) -> Array:
        """(n, p) world units of each piece."""
        first, last = self.breaks[:, :-1], self.breaks[:, 1:]
        some = first < last
        return np.where(some, last - np.where(some, first, 0.0), 0.0) * self.speed[:, None]

    def edges(self, depths: Array) -> Array:
        """(n, m) the breaks, and where the largest of the three optical depths is one of these."""
        most = self.extinction.max(0)
        after = np.cumsum(_times(most, self.ways), 1)
        before = np.concatenate([np.zeros_like(after[:, :1]), after[:, :-1]], 1)
        end = self.breaks[:, -1:, None]
        met = (depths > before[..., None]) & (depths < after[..., None])
        with np.errstate(over="ignore"):
            way = (depths - before[..., None]) / np.where(most > 0, most, 1.0)[..., None]
        at = np.where(met, self.breaks[:, :-1, None] + way / self.speed[:, None, None], end)
        edges = np.sort(np.concatenate([self.breaks, at.reshape(len(at), -1)], 1), 1)
        edges = np.minimum(edges, self.breaks[:, -1:])
        return edges[:, : (edges < self.breaks[:, -1:]).sum(1).max(initial=1) + 1]

    def depth_at(self, t: Array) -> Array:
        """(3, n, m) optical depth at t (n, m)."""
        depth = np.zeros((3, *t.shape))
        for k in range(self.breaks.shape[1] - 1):
            first, last = self.breaks[:, k, None], self.breaks[:, k + 1, None]
            way = np.clip(t - first, 0.0, last - first) * self.speed[:, None]
            depth += self.extinction[:, :, k, None] * way
        return depth

    def scattering_at(self, t: Array) -> Array:
        """(3, n, m) at t (n, m), which lie on no break."""
        scattering = np.zeros((3, *t.shape))
        for k in range(self.breaks.shape[1] - 1):
            first, last = self.breaks[:, k, None], self.breaks[:, k + 1, None]
            scattering += self.scattering[:, :, k, None] * ((t > first) & (t < last))
        return scattering

    def glow(self) -> Array:
        """(3, n) what they give of themselves; nothing where that would be endless."""
        way = self.ways
        depths = _times(self.extinction, way)
        before = np.cumsum(np.concatenate([np.zeros_like(depths[..., :1]), depths], 2), 2)[..., :-1]
        clear = np.where(np.isinf(way), 0.0, way) * (self.extinction == 0)
        with np.errstate(over="ignore", invalid="ignore"):
            thick = -np.expm1(-depths) / np.where(self.extinction > 0, self.extinction, 1.0)
            some = np.where(self.extinction > 0, thick, clear)
            given = self.emission * some * np.exp(-before)
        return np.where(self.emission != 0, given, 0.0).sum(2)


def _times(sigma: Array, way: Array) -> Array:
    """Their product where the way may be endless."""
    with np.errstate(invalid="ignore"):
        return np.where(sigma > 0, sigma * way, 0.0)


class Media(MediaSpans):
    """The media of a scene, and what they do to light."""

    def __init__(self, scene: Scene, attributes: Attributes, visibility: Visibility) -> None:
        def meet(rays: Rays, seen: Array) -> tuple[Array, Array, Array]:
            return visibility.crossings(replace(rays, far=np.full(len(rays), np.inf)), seen)

        super().__init__(scene, attributes, visibility.geometry, meet)
        self._scatters = np.array([medium.scatters for medium in self._media], bool)
        self._shines = np.ones(len(self._media), bool)
        own = [block.light_group for block in scene.instances if scene.medium_of(block) is not None]
        groups = [] if scene.world.medium is None else [scene.world.light_group]
        self._groups = np.array(groups + own, np.intp)

    def __bool__(self) -> bool:
        return bool(self._media)

    @property
    def varies(self) -> bool:
        """Whether some medium does from place to place."""
        return any(medium.program is not None for medium in self._media)

    def cells(self, spans: Spans) -> int:
        """How many of the spans are cells of media that vary."""
        return sum(self._media[number].program is not None for number in spans.medium)

    def of(self, rows: Array) -> Media:
        """Those of some rows of the placements alone, (r,) bool, and of the world."""
        result = copy.copy(self)
        result._of_row = np.where(rows, self._of_row, -1)
        return result

    def of_group(self, number: int) -> Media:
        """The same, of which none but those of a light group give light."""
        result = copy.copy(self)
        result._shines = self._groups == number
        return result

    def depth(self, spans: Spans, near: Array, far: Array) -> Array:
        """(3, n) optical depths between near and far (n,) of each ray."""
        some, ray, way = spans.paths(near, far)
        total = np.zeros((3, len(near)))
        for sigma, sums in zip(spans.matter.extinction[:, some], total, strict=True):
            some = sigma > 0
            np.add.at(sums, ray[some], sigma[some] * way[some])
        return total

    def passed(self, spans: Spans, near: Array, far: Array) -> Array:
        """(3, n) how much light goes straight on from near to far (n,)."""
        return np.exp(-self.depth(spans, near, far))

    def pieces(self, spans: Spans, near: Array, far: Array) -> Pieces:
        """What lies along n rays from near to far (n,)."""
        n = len(near)
        order = np.argsort(spans.ray, kind="stable")
        rank = np.arange(len(order)) - np.searchsorted(spans.ray[order], spans.ray[order])
        breaks = np.repeat(far[:, None], 2 + 2 * (rank.max(initial=-1) + 1), 1)
        breaks[:, 0] = near
        ray = spans.ray[order]
        for column, name in ((2, "start"), (3, "end")):
            value = getattr(spans, name)[order]
            breaks[ray, 2 * rank + column] = np.clip(value, near[ray], np.maximum(far, near)[ray])
        breaks.sort(1)
        shape = 3, n, breaks.shape[1] - 1
        sums = {name: np.zeros(shape) for name in ("extinction", "scattering", "emission")}
        begin, finish = breaks[:, :-1], breaks[:, 1:]
        inside = np.where(np.isinf(finish), begin + 1, (begin + finish) / 2)
        for r in range(rank.max(initial=-1) + 1):
            some = order[rank == r]
            row, medium = spans.ray[some], spans.medium[some]
            here = (inside[row] > spans.start[some, None]) & (inside[row] < spans.end[some, None])
            for name, total in sums.items():
                value = getattr(spans.matter, name)[:, some, None]
                shown = self._shines[medium][:, None] if name == "emission" else True
                total[:, row] += (here & shown) * value
        return Pieces(breaks, spans.speed, **sums)

    def scattering_rays(self, spans: Spans, near: Array, far: Array) -> Array:
        """Rays along which light is scattered, on more than what rounding leaves of a medium behind
        its end.
        """
        ray, way, (first, last) = spans.ray, spans.speed[spans.ray], spans.whole
        end = np.minimum(last, far[spans.ray])
        least = SLIGHT * (end * way + spans.origin[ray])
        long = (end - np.maximum(first, near[ray])) * way > np.where(end < np.inf, least, 0.0)
        return np.unique(ray[long & self._scatters[spans.medium]])

    @property
    def emits(self) -> bool:
        """Whether one of them gives light."""
        return any(medium.emits for medium in self._media)

    def reach(self, spans: Spans, near: Array, far: Array, dark: float) -> Array:
        """far (n,), or where endless rays see next to nothing any more."""
        if not np.isinf(far).any():
            return far
        last = near.copy()
        finite = np.isfinite(spans.end)
        np.maximum.at(last, spans.ray[finite], spans.end[finite])
        if self._world < 0 or self._media[self._world].program is not None:
            return np.where(np.isinf(far), last, far)
        world = self._matter.take([self._world])
        least = world.extinction[world.scattering > 0].min(initial=np.inf)
        return np.where(np.isinf(far), last + dark / least / spans.speed, far)

    def scattering(
        self, spans: Spans, t: Array, to_light: Array, along: Array, source: Source | None
    ) -> Array:
        """(3, n) how much light from the unit directions to_light (3, n) is scattered at t of each
        ray, against its unit direction, a world unit and steradian. source: None for no light.
        """
        at = t[spans.ray]
        here = (spans.start < at) | ((spans.start == at) & (spans.start == spans.whole[0]))
        here &= at <= spans.end
        if source is not None and source.light.receivers != EVERYTHING:
            reached = self._lit_rows(source.light.receivers)
            here &= (spans.row < 0) | reached[spans.row]
        ray, matter = spans.ray[here], spans.matter.take(np.flatnonzero(here))
        g = matter.anisotropy
        cosine = dot(pick(along, ray), pick(to_light, ray))
        base = 1 + g * g - 2 * g * cosine
        with np.errstate(
            invalid="ignore"
        ):  # straight on of an anisotropy of 1: no such light counts
            phase = (1 - g * g) / (4 * np.pi * base * np.sqrt(base))
        total = np.zeros((3, len(t)))
        for sums, sigma in zip(total, matter.scattering, strict=True):
            np.add.at(sums, ray, sigma * phase)
        return total

    def _lit_rows(self, receivers: int) -> Array:
        """(r,) bool: placements that a light is for."""
        placements = self._geometry.placements
        lit = [receivers >> block.light_set & 1 for block in placements.instances]
        return np.array(lit, bool)[placements.block]
