"""What programs ask of the scene: rays from the points that they run over (semantics/programs.md).
They are traced without shading, so that no program runs another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..evaluation.attributes import Attributes
from ..evaluation.surface import Surface
from ..linear.columns import pick
from ..program.execute.rays import Asked, Met
from ..sampling import node_points
from .rays import IncoherentRays
from .surface import surface_at
from .visibility import NOTHING, Hits, Visibility

Array = np.ndarray


def uncounted(index: Array) -> None:
    """Where programs run once more over the same points."""


@dataclass(frozen=True, eq=False)
class SceneQueries:
    """Rays of one sample. table: `sampling.node_points`. reach: of occlusion, in the world.

    on_rays: called with the points (m,) of the surface for each ray of theirs.
    """

    visibility: Visibility
    attributes: Attributes
    table: Array
    sample: int
    reach: float
    on_rays: Callable[[Array], None] = uncounted

    def rows(self, each: int) -> Array:
        """(each, 5) of the table: those of the sample, where it takes so many."""
        return self.table[(self.sample * each + np.arange(each)) % len(self.table)]

    def blocked(self, surface: Surface, index: Array, asked: Asked, of: str) -> Array:
        """As `Queries` of `evaluation.points` has it, and what follows."""
        rays, ray = self._rays(index, asked)
        found = np.zeros(len(index), bool)
        found[ray] = self._first(rays, surface.row[index[ray]], of).primitive != NOTHING
        return found

    def nearest(self, surface: Surface, index: Array, asked: Asked, of: str) -> Met:
        rays, ray = self._rays(index, asked)
        hits = self._first(rays, surface.row[index[ray]], of)
        there = np.flatnonzero(hits.primitive != NOTHING)
        return self._met(rays, ray, there, hits.primitive[there], hits.depth[there])

    def crossings(self, surface: Surface, index: Array, asked: Asked) -> Met:
        rays, ray = self._rays(index, asked)
        row, geometry = surface.row[index[ray]], self.visibility.geometry
        found = []
        for number in np.unique(row):
            mine = np.flatnonzero(row == number)
            hits = self.visibility.layers(rays.take(mine), geometry.row == number)
            found.append((mine[hits[0]], hits[1], hits[2]))
        if not found:
            none = np.zeros(0, np.intp)
            return self._met(rays, ray, none, none, np.zeros(0))
        return self._met(rays, ray, *map(np.concatenate, zip(*found, strict=True)))

    def _rays(self, index: Array, asked: Asked) -> tuple[IncoherentRays, Array]:
        """Those that are asked for, and which they are."""
        ray = np.flatnonzero(asked.reach > 0)
        start, direction = pick(asked.start, ray), pick(asked.direction, ray)
        self.on_rays(index[ray])
        return IncoherentRays.of(start, direction, np.zeros(len(ray)), asked.reach[ray]), ray

    def _first(self, rays: IncoherentRays, row: Array, of: str) -> Hits:
        geometry = self.visibility.geometry
        if of != "own":
            kinds = list(geometry.visible.values()) if of == "any" else [geometry.visible[of]]
            some = [kind for kind in kinds if kind is not None]
            everything = len(some) < len(kinds)
            return self.visibility.closest_of(rays, None if everything else np.any(some, 0))
        found = Hits(np.full(len(rays), NOTHING), np.full(len(rays), np.inf))
        for number in np.unique(row):
            mine = np.flatnonzero(row == number)
            hits = self.visibility.closest_of(rays.take(mine), geometry.row == number)
            found.primitive[mine], found.depth[mine] = hits.primitive, hits.depth
        return found

    def _met(
        self, rays: IncoherentRays, ray: Array, of: Array, primitive: Array, depth: Array
    ) -> Met:
        """of: which of the rays that are asked for. ray: which of all these are."""
        v = self.visibility
        place = (v.geometry, self.attributes, rays, of, primitive, depth, v.cancellation)
        return Met(ray[of], depth, surface_at(*place))


def points_of_nodes(samples: int, each: int) -> Array:
    """`sampling.node_points`, or none where nobody asks."""
    return node_points(samples, each) if each > 0 else np.zeros((0, 5))
