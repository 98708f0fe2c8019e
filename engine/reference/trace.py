"""The render loop: samples, and tiles of pixels within a sample (notes, section 4.2: image-order
rendering).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np

from ..film import FIRST_ESTIMATE, Film
from ..lights.interleaving import interleaving, visibility_samples
from ..lights.lamps import group_stats, sharing_stats
from ..sampling import (
    class_beyond,
    dealt_offsets,
    dealt_sample,
    interleaving_classes,
    offset_classes,
)
from ..sampling.motion import is_moving, moment, sample_times
from ..scene import Scene
from ..settings import Settings
from .camera import Spread
from .cancellation import Cancellation, Stopped
from .generations import Generations
from .picture import DATA, Picture, Tile
from .raster import Strips
from .rays import Rays
from .refinement import ErrorEstimate, Refinement, widened
from .resolve import reach
from .stage import Stage

Array = np.ndarray

RAYS_OF_SAMPLE = 16
"""So many camera rays that light does not follow take about as long as a sample."""
TILE = 1 << 19
"""Pixels traced together: many, because each tile projects the whole scene; not all of a large
picture, because of memory.
"""


def render_reference(
    scene: Scene,
    settings: Settings,
    should_stop: Callable[[], bool],
    on_progress: Callable[[float], None],
    on_wave: Callable[[Film], None] | None,
) -> Film:
    """The picture of `scene`, as engine.render describes it, in float64 NumPy."""
    tracer = Tracer(scene, settings, Cancellation(should_stop))
    complete = tracer.run(on_progress, on_wave)
    return tracer.film(complete)


class Tracer:
    """One render. picture: the sums so far, float64."""

    def __init__(self, scene: Scene, settings: Settings, cancellation: Cancellation):
        self._scene, self._settings, self._cancellation = scene, settings, cancellation
        self._shown = settings.region or (0, 0, *scene.camera.resolution)
        self._deals = interleaving(scene, settings)
        resolves = self._deals > 1 and settings.soft_light == "RESOLVED"
        margin = reach(self._deals) if resolves else 0
        resolution = scene.camera.resolution
        self._region = self._traced = widened(self._shown, margin, resolution)
        refines = settings.error_threshold > 0 or "Error" in settings.passes
        if refines and settings.samples >= FIRST_ESTIMATE:
            self._region = widened(self._traced, 1 + margin, resolution)
        x0, y0, x1, y1 = self._region
        self.picture = Picture(
            x1 - x0,
            y1 - y0,
            settings.passes,
            settings.crypto_ids,
            scene.aovs,
            scene.light_groups,
            self._deals if resolves else 1,
            scene.world.transparent,
        )
        is_spread = (
            scene.camera.lens is not None or scene.camera.motion is not None or is_moving(scene)
        )
        self._refinement = Refinement(settings, self._is_traced(), is_spread) if refines else None
        estimates = "Error" in settings.passes or (refines and resolves)
        self._estimate = ErrorEstimate((y1 - y0, x1 - x0)) if estimates else None
        self._resolves = resolves
        self._each = visibility_samples(scene, settings)
        self._offsets = dealt_offsets(settings.samples, self._each, settings.filter_width)
        self._has_seen = False
        self._spreads = Spread.samples(scene, settings.samples)
        self._times = sample_times(scene, settings.samples)[0] if is_moving(scene) else None
        self._finished = 0  # samples
        self._stage: Stage | None = None
        self._seconds: dict[str, float] = {}

    def run(
        self,
        on_progress: Callable[[float], None] = lambda _: None,
        on_wave: Callable[[Film], None] | None = None,
    ) -> bool:
        """Traces all samples; False when stopped."""
        try:
            with self._clock("build"):
                self._stage = self._stage_of(0)
            samples = self._settings.samples
            steps = samples + samples * (self._each - 1) / RAYS_OF_SAMPLE
            for sample in range(samples):
                if sample > 0 and self._times is not None:
                    with self._clock("build"):
                        self._stage = self._stage_of(sample)
                with self._clock("trace"):
                    for done in self._sample(self._stage, sample):
                        on_progress((sample + done) / steps)
                self._finished = sample + 1
                if (sample + 1) & sample == 0:
                    self._end_wave(sample + 1)
                if on_wave and (sample + 1) & sample == 0:
                    on_wave(self.film(True))
            self._end_wave(samples)
            if self._has_seen:
                on_progress(1.0)
        except Stopped:
            return False
        return True

    def _stage_of(self, sample: int) -> Stage:
        """What stands there at the time of a sample."""
        times = self._times
        scene = self._scene if times is None else moment(self._scene, times[sample])
        stage = Stage(scene, self._settings, self._cancellation)
        if self._stage is not None:
            stage.rays.update(self._stage.rays)
        return stage

    def film(self, complete: bool) -> Film:
        """The picture so far."""
        stats = self._stage.stats() if self._stage else {}
        notes = self._stage.geometry.left_out if self._stage else ()
        passes = self.picture.means()
        if self._estimate:
            passes["Error"] = self._estimate.levels(self.picture.samples)[None]
        (x0, y0, x1, y1), (left, bottom, _, _) = self._shown, self._region
        shown = slice(y0 - bottom, y1 - bottom), slice(x0 - left, x1 - left)
        return Film(
            self.picture.images(passes, shown),
            self._finished,
            complete,
            stats
            | self._seconds
            | sharing_stats(self._scene.lights, self._settings)
            | group_stats(self._scene.light_groups),
            notes,
        )

    def _is_traced(self) -> Array:
        """(h, w) bool of the region."""
        (x0, y0, x1, y1), (left, bottom, right, top) = self._traced, self._region
        x, y = np.arange(left, right), np.arange(bottom, top)[:, None]
        return (x0 <= x) & (x < x1) & (y0 <= y) & (y < y1)

    def _end_wave(self, samples: int) -> None:
        if samples == self._settings.samples and self._each > 1 and not self._has_seen:
            with self._clock("trace"):
                self._see()
        self.picture.resolve()
        if self._estimate and self._refinement:
            self._estimate.end_wave(self.picture.color_and_loss(), samples, self._refinement.active)
        if self._refinement and self._resolves and self._estimate:
            self._refinement.end_wave_ahead(samples, self._estimate)
        elif self._refinement:
            self._refinement.end_wave(self.picture.color_and_loss()[:3], samples)

    def _strips(self) -> Iterator[tuple[int, tuple[int, int], tuple[int, int]]]:
        """The region bit by bit: its first pixel, and from where to where it goes."""
        x0, y0, x1, y1 = self._region
        rows = max(TILE // (x1 - x0), 1)
        for y in range(y0, y1, rows):
            yield (y - y0) * (x1 - x0), (x0, x1), (y, min(y + rows, y1))

    def _rays(
        self, stage: Stage, x: tuple[int, int], y: tuple[int, int], number: int
    ) -> Callable[[Array], tuple[Rays, Strips | None]]:
        """What gives some pixels of one class those of their camera rays that have the number."""
        spread, classes = self._spreads[number % self._settings.samples], self._each
        rays = [stage.camera.rays(x, y, own[number], spread) for own in self._offsets]
        which = offset_classes(x, y, classes)

        def of(pixels: Array) -> tuple[Rays, Strips | None]:
            every, strips = rays[which[pixels[0]] if classes > 1 else 0]
            whole = len(pixels) == len(every)
            return (every, strips) if whole else (every.take(pixels), None)

        return of

    def _sample(self, stage: Stage, sample: int) -> Iterator[float]:
        """Traces one sample of every pixel tile by tile; yields the finished fraction."""
        _, y0, _, y1 = self._region
        for first, across, up in self._strips():
            rays = self._rays(stage, across, up, sample)
            stage.cancellation.check()
            places = stage.places(across, up)
            every = np.arange(len(places))
            if self._refinement:
                every = np.flatnonzero(self._refinement.active[first : first + len(places)])
            for chosen, dealt in self._dealt(every, across, up, sample):
                some, strips = rays(chosen)
                self._trace(stage, first + chosen, sample, dealt, some, strips, places[chosen])
            yield (up[1] - y0) / (y1 - y0)

    def _see(self) -> None:
        """The camera rays beyond the samples, of the pixels that these tell more about."""
        stage, samples, self._has_seen = self._stage, self._settings.samples, True
        assert stage is not None
        uneven = self.picture.uneven()
        for number in range(samples, samples * self._each):
            for first, across, up in self._strips():
                rays, places = self._rays(stage, across, up, number), stage.places(across, up)
                every = np.flatnonzero(uneven[first : first + len(places)])
                for chosen, dealt in self._dealt(every, across, up, number):
                    tile = Tile(len(chosen), frozenset(), 0, len(self._scene.light_groups))
                    seen = Generations(stage, tile, number, dealt, places[chosen])
                    seen.see(rays(chosen)[0])
                    self.picture.see(first + chosen, tile)

    def _dealt(
        self, pixels: Array, x: tuple[int, int], y: tuple[int, int], sample: int
    ) -> Iterator[tuple[Array, int]]:
        """Those of some pixels of a tile that take one sample of the tables, and which it is, for
        their camera ray of that number.
        """
        if self._deals == 1:
            yield pixels, sample
            return
        classes = interleaving_classes(x, y, self._deals)[pixels]
        for number in np.unique(classes):
            samples, round_ = self._settings.samples, sample // self._settings.samples
            dealt = class_beyond(int(number), round_, self._deals)
            own = dealt_sample(sample % samples, dealt, samples, self._deals)
            yield pixels[classes == number], own

    def _trace(
        self,
        stage: Stage,
        here: Array,
        sample: int,
        dealt: int,
        rays: Rays,
        strips: Strips | None,
        places: Array,
    ) -> None:
        """A sample of the pixels `here`."""
        tile = Tile(
            len(rays),
            self._settings.passes.intersection(DATA) if sample == 0 else frozenset(),
            len(self._scene.aovs),
            len(self._scene.light_groups),
        )
        tile.before = self.picture.brought[:, here]
        if len(rays):
            Generations(stage, tile, sample, dealt, places).run(rays, strips)
        self.picture.keep(here, tile)
        if self._refinement:
            values = np.concatenate([tile.color(), tile.lost[None]])
            self._refinement.note(here, values, tile.soft_light, tile.cut)

    def _clock(self, name: str) -> _Clock:
        return _Clock(self._seconds, name)


class _Clock:
    """Adds the seconds that a with block takes to an entry of a dictionary, however the block
    ends.
    """

    def __init__(self, seconds: dict[str, float], name: str):
        self._seconds, self._name = seconds, name

    def __enter__(self) -> None:
        self._began = perf_counter()

    def __exit__(self, *_: object) -> None:
        self._seconds[self._name] = (
            self._seconds.get(self._name, 0.0) + perf_counter() - self._began
        )
