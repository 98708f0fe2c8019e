"""What a pixel gets of the rays of its block, for Explain Pixel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .blocks import Shares
from .gathering import gathering, sharing
from .paths import Interaction, Paths, one_by_one
from .reflections import reflected_in_blocks
from .surface import Surface
from .vectors import pick

if TYPE_CHECKING:
    from .stage import Stage

Array = np.ndarray


@dataclass(eq=False)
class PixelBlock:
    """Of what a pixel's camera ray meets first the gather rays and those that rough surfaces
    reflect, one each: its own and those that pixels of its block share with it; of the latter (3,)
    what the pixel gets of what they bring. None where it has but its own.

    own: which pixel of the block of gather rays it is.  turns: how many pixels take turns with
    shadows of the points of bounced light.
    """

    own: int = 0
    near: list[Paths] | None = None
    mixed: list[tuple[Paths, Array]] | None = None
    turns: int = 1
    _shares: Shares | None = field(default=None, repr=False)

    def share_gathers(self, stage: Stage, at: Interaction, own: int, places: Array) -> None:
        """Takes in what the camera rays of the block of gather rays meet. places: (n,) of its
        pixels, as `gathering` has them.
        """
        self.own = own
        self._shares = sharing(stage, at, np.zeros(len(places), np.intp))
        self.turns = int(max(self._shares.turns(at.pixel, 0).count[at.pixel == own], default=1))
        found = gathering(stage, at, 0, places, self._shares)
        self.near = list(one_by_one(found, self._alike()))

    def mix(self, stage: Stage, at: Interaction, own: int) -> Iterator[tuple[Paths, Array]]:
        """Of those of the block that mixes what wide lobes reflect, as `mixed`. own: which pixel of
        that it is.
        """
        count = len(at.paths)
        one = np.stack([np.zeros(count, np.intp), np.arange(count)])
        rays, mixing = reflected_in_blocks(stage, at, 0, one)
        if mixing is None:
            return
        sender, receiver, share = mixing.shares()
        for k in np.flatnonzero(receiver == own):
            some = [found for found in rays if found.mixed or sender[k] == own]
            yield from ((found, share[:, k]) for found in one_by_one(some, sender[k]))

    def _alike(self) -> Array:
        """(k,) the pixels that share bounced light with the pixel, and itself."""
        group = -1 if self._shares is None else self._shares.group[self.own]
        if self._shares is None or group < 0:
            return np.full(1, self.own)
        members = self._shares.members[group]
        return members[members >= 0]

    def share(self, paths: Paths, surface: Surface | None) -> Array:
        """(3, 1) what the pixel gets of what its own gather ray, or a neighbour's, finds there; an
        even part where that finds nothing.
        """
        if not paths.shared:
            return np.ones((3, 1))
        assert self._shares is not None
        if surface is None:
            return pick(self._shares.matt, np.array([self.own])) / len(self._alike())
        _, receiver, share = self._shares.given(paths.pixel, surface.x, surface.g)
        return share[:, receiver == self.own].sum(1, keepdims=True)
