"""What programs ask of the scene: rays from the points that they run over (SEMANTICS.md, Rays that
nodes ask for). They are traced without shading, so that no program runs another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..sampling import node_points
from .rays import Bundle
from .surface import Surface
from .vectors import dot, pick
from .visibility import NOTHING, Hits, Visibility

Array = np.ndarray


def uncounted(index: Array) -> None:
    """Where programs run once more over the same points."""


@dataclass(frozen=True, eq=False)
class SceneQueries:
    """Rays of one sample. disc: (k, 2), `sampling.node_points`. reach: of occlusion, in the world.

    on_rays: called with the points (m,) of the surface for each ray of theirs.
    """

    visibility: Visibility
    disc: Array
    sample: int
    reach: float
    on_rays: Callable[[Array], None] = uncounted

    def disc_points(self, each: int) -> Array:
        """(each, 2) of the unit disc: those of the sample, where it takes so many."""
        return self.disc[(self.sample * each + np.arange(each)) % len(self.disc)]

    def blocked(
        self, surface: Surface, index: Array, direction: Array, reach: Array, own: bool
    ) -> Array:
        """(m,) bool: whether anything is nearer than `reach` (m,) along unit directions (3, m) from
        the points `index` (m,) of the surface; never where that is not above 0.

        own: surfaces of the points' own instances alone, whatever they hide from.
        """
        asked = np.flatnonzero(reach > 0)
        start = self._start(surface, index[asked], pick(direction, asked))
        rays = Bundle.of(start, pick(direction, asked), np.zeros(len(asked)), reach[asked])
        self.on_rays(index[asked])
        found = np.zeros(len(index), bool)
        found[asked] = self._first(rays, surface.row[index[asked]], own).primitive != NOTHING
        return found

    def _start(self, surface: Surface, index: Array, direction: Array) -> Array:
        """(3, m) clear of the surface, on the side to which the rays leave."""
        g, offset = pick(surface.g, index), surface.offset[index]
        beside = np.where(dot(g, direction) < 0, -offset, offset)
        return pick(surface.x, index) + beside * g

    def _first(self, rays: Bundle, row: Array, own: bool) -> Hits:
        geometry = self.visibility.geometry
        if not own:
            return self.visibility.closest_of(rays, geometry.visible["shadow"])
        found = Hits(np.full(len(rays), NOTHING), np.full(len(rays), np.inf))
        for number in np.unique(row):
            mine = np.flatnonzero(row == number)
            hits = self.visibility.closest_of(rays.take(mine), geometry.row == number)
            found.primitive[mine], found.depth[mine] = hits.primitive, hits.depth
        return found


def points_of_nodes(samples: int, each: int) -> Array:
    """`sampling.node_points`, or none where nobody asks."""
    return node_points(samples, each) if each > 0 else np.zeros((0, 2))
