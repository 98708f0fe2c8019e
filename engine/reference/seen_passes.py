"""What passes tell of the surfaces that camera rays see, other than light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..evaluation.surface import Surface
from ..film import NO_DEPTH, OCCLUSION
from ..linear.columns import dot, length, pick
from . import catchers
from .motion_vectors import motion_vectors
from .occlusion import openness
from .paths import Interaction, beyond
from .picture import Tile
from .resolve import IMAGES, LIGHTS, UNHIDDEN
from .scene_queries import SceneQueries
from .stage import Stage
from .visibility import NOTHING

Array = np.ndarray


class SeenPasses:
    """Writes what camera rays meet in one sample of a tile to the tile's passes.

    queries: how programs ask for rays at a surface's points, of these pixels.
    """

    def __init__(
        self,
        stage: Stage,
        tile: Tile,
        sample: int,
        queries: Callable[[Array, Surface], SceneQueries | None],
    ) -> None:
        self._stage, self._tile, self._sample, self._queries = stage, tile, sample, queries

    def wants_data(self, at: Interaction) -> Array:
        """(m,) bool: points in pixels whose data passes are still to come."""
        return self._tile.wanted[at.pixel] & (at.paths.depth == 0)

    def record(self, at: Interaction, depth: Array) -> None:
        """Data passes of pixels that have none yet, where less than half of the light passes
        straight through.
        """
        k = at.coefficients.transparent
        chosen = np.flatnonzero(self.wants_data(at) & ((k[0] + k[1] + k[2]) / 3 < 0.5))
        if not len(chosen):
            return
        stage, some = self._stage, at.surface.take(chosen)
        uv = stage.attributes.uv("")
        moved = {"Vector": motion_vectors(stage, some)} if "Vector" in self._tile.data else {}
        self._tile.record(
            at.pixel[chosen],
            Depth=stage.camera.hit_depth(some.x, depth[chosen])
            if stage.scene.camera.motion is None
            else stage.camera.depth(some.x) * stage.camera.unit,
            Position=some.x + stage.eye[:, None],
            Normal=some.n,
            Grazing=np.abs(dot(some.n, some.v))[None],
            UV=np.concatenate(
                [uv.at(some.geometry, some.local, some.weights), uv.has(some.geometry)[None]]
            ),
            Object_Index=stage.per_object("object_index", some.row),
            Material_Index=stage.shader.pass_index(some.material),
            **moved,
        )

    def find_gaps(self, at: Interaction, depth: Array) -> None:
        """How far behind the first hits the rays' next ones lie."""
        if "Gap" not in self._tile.data or at.paths.straight.any():
            return
        rays = beyond(at.paths.rays.take(at.hit), at.surface, depth)
        again = self._stage.visibility.closest(rays, at.paths.kind)
        gaps = self._tile.data["Gap"][0]
        # rays that went on through what dims nothing have theirs
        found = np.flatnonzero((again.primitive != NOTHING) & (gaps[at.pixel] == NO_DEPTH))
        _, d = rays.lines(found)
        gaps[at.pixel[found]] = (again.depth[found] - depth[found]) * length(d)

    def see(self, at: Interaction) -> None:
        """What passes that are means of what is seen have of these surfaces."""
        stage, surface, weight = self._stage, at.surface, at.weight
        passed = at.coefficients.transparent
        share = weight.mean(0) * (1 - passed.mean(0))
        self._tile.denoise(
            at.pixel,
            Normal=share * stage.camera.along_axes(surface.n),
            Albedo=weight * at.coefficients.albedo(),
            Depth=(share * stage.camera.distance_seen(surface.x))[None],
        )
        seen = (weight * (1 - np.clip(passed, 0.0, 1.0))).mean(0)
        self._tile.see(
            at.pixel,
            seen * (1 - stage.mist(stage.camera.distance(surface.x))),
            share,
            stage.crypto_ids(surface),
        )

    def guide(self, at: Interaction) -> None:
        """What tells pixels' surfaces apart, where their light is resolved."""
        if not self._stage.resolves:
            return
        share = at.weight.mean(0) * (1 - at.coefficients.transparent.mean(0))
        self._add_guides(at, np.flatnonzero(share > 0), share)

    def _add_guides(self, at: Interaction, here: Array, share: Array, image: str = "") -> None:
        """Adds of the surfaces `here` that much (n,) of each, to those of an image."""
        columns = np.concatenate([at.surface.n, at.surface.x, np.ones((1, len(share)))])
        self._tile.guide(at.pixel[here], share[here] * columns[:, here], image)

    def guide_image(self, at: Interaction) -> None:
        """The same of what mirrors and clear glass show, with its colours."""
        given = at.coefficients
        color = at.weight * (given.matt() + given.glossy() + given.round_fibres())
        color += at.weight * given.translucent
        for name in IMAGES:
            is_lit = color.any(0) & (at.paths.image(self._tile.is_rough_glass[at.pixel]) == name)
            here = np.flatnonzero(is_lit)
            self._tile.add(LIGHTS[name], at.pixel[here], color[:, here])
            self._add_guides(at, here, at.weight.mean(0), name)

    def give_aovs(self, at: Interaction) -> None:
        """What surfaces give to AOVs, up to the first that lets less than half through."""
        tile, passed = self._tile, at.coefficients.transparent
        chosen = np.flatnonzero(tile.wants_aovs[at.pixel])
        some, here = at.surface.take(chosen), at.pixel[chosen]
        queries = self._queries(here, some)
        given = self._stage.shader.aovs(some, at.paths.kind, len(tile.aovs) // 4, queries)
        tile.aovs[:, here] += given * pick(at.weight, chosen).mean(0)
        opaque = (passed[0] + passed[1] + passed[2]) / 3 < 0.5
        tile.wants_aovs[at.pixel[opaque]] = False

    def add_openness(self, at: Interaction) -> None:
        """What is open over the points, of what of the rays stays there, where the pass is asked
        for.
        """
        if OCCLUSION not in self._stage.settings.passes:
            return
        stays = at.weight * catchers.opacity(at.coefficients)
        found = openness(self._stage, at.surface, self._sample, lambda: self._tile.charge(at.pixel))
        self._tile.add(OCCLUSION, at.pixel, stays * found)
        self.note_asked(at)

    def note_asked(self, at: Interaction) -> None:
        """Of the points how much is asked that."""
        if OCCLUSION in self._stage.settings.passes:
            stays = at.weight * catchers.opacity(at.coefficients)
            self._tile.add(UNHIDDEN, at.pixel, stays)
