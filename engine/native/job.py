"""Scenes and renders in the core: made, waited for, read and given back. This side wakes every
40 ms to ask whether to go on.
"""

from __future__ import annotations

import ctypes
import math
import os
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import byref, c_float
from dataclasses import replace

import numpy as np

from ..errors import NO_THREAD, SceneError
from ..film import Film, aov_pass, channels_of, empty_value, light_group_pass
from ..lights.lamps import group_stats, sharing_stats
from ..scene import Scene, left_out
from ..scene.view_axes import ViewAxes
from ..settings import Settings
from . import core_types
from .binding import ERROR_BYTES, ISA_VARIABLE
from .core_types import ProgressData, RenderSettingsData, SceneData, State, StatsData
from .packing_settings import PASS_NUMBERS, passes_of

_POLL_MILLISECONDS = 40


def with_notes(film: Film, scene: Scene, core: ctypes.CDLL) -> Film:
    """The film with what there is to say of it."""
    return replace(film, notes=(*left_out.sentences(scene, film.stats), *_instruction_set(core)))


def _instruction_set(core: ctypes.CDLL) -> Iterator[str]:
    """A note where the environment asks for one that is not to be had."""
    asked, taken = os.environ.get(ISA_VARIABLE), core.glint_isa().decode()
    if asked and asked != taken:
        yield (
            f"{ISA_VARIABLE} is {asked!r}, which this machine or the core does not have: "
            f"{taken} "
            "draws the same picture; unset it"
        )


def created(core: ctypes.CDLL, data: SceneData, base: int | None = None, exact: bool = True) -> int:
    """The handle of a new scene in the core. base: that of one from which it takes over what is the
    same.  exact: to the bits of a scene of its own. Raises as `render_native`.
    """
    error = ctypes.create_string_buffer(ERROR_BYTES)
    text = (error, ERROR_BYTES)
    if base is None:
        handle = core.glint_scene_create(byref(data), *text)
    else:
        handle = core.glint_scene_create_like(base, byref(data), exact, *text)
    if not handle:
        raise refusal(error.value.decode(errors="replace"), data)
    return handle


@contextmanager
def started(core: ctypes.CDLL, scene: int, data: RenderSettingsData) -> Iterator[int]:
    error = ctypes.create_string_buffer(ERROR_BYTES)
    handle = core.glint_render_start(scene, byref(data), error, ERROR_BYTES)
    if not handle:
        raise refusal(error.value.decode(errors="replace"), data)
    try:
        yield handle
    finally:
        core.glint_render_destroy(handle)


def refusal(text: str, data: SceneData | RenderSettingsData) -> Exception:
    if text == "no thread":
        return MemoryError(NO_THREAD)
    if text != "out of memory":
        return SceneError(text)
    return MemoryError(
        "the core ran out of memory: "
        f"{_film_needs(data) if isinstance(data, RenderSettingsData) else _scene_needs(data)}"
    )


def _scene_needs(data: SceneData) -> str:
    return (
        f"{data.geometry_count} meshes in {data.row_count} places do not fit; use fewer, or "
        "close programs"
    )


def _film_needs(data: RenderSettingsData) -> str:
    """Sums in double and the picture in float32 of every pass that is asked for."""
    x0, y0, x1, y1 = data.region
    channels = sum(
        channels_of(name, data.crypto_ids)
        for name, number in PASS_NUMBERS.items()
        if data.passes >> number & 1
    )
    gigabytes = max(0.1, (x1 - x0) * (y1 - y0) * channels * 12 / 1e9)
    return (
        f"a picture of {x1 - x0} by {y1 - y0} pixels with {channels} channels needs "
        f"{gigabytes:.1f} GB; use a smaller one, fewer passes"
    )


class Job:
    """One render at work in the core."""

    def __init__(
        self,
        core: ctypes.CDLL,
        handle: int,
        scene: Scene,
        settings: Settings,
        axes: ViewAxes | None,
        on_moving: Callable[[], None] = lambda: None,
    ) -> None:
        self._core, self._handle, self._axes, self._on_moving = core, handle, axes, on_moving
        self._names, self._crypto_ids = passes_of(settings), settings.crypto_ids
        self._aovs, self._lights, self._settings = scene.aovs, scene.lights, settings
        self._light_groups = scene.light_groups
        x0, y0, x1, y1 = settings.region or (0, 0, *scene.camera.resolution)
        self._shape = (y1 - y0, x1 - x0)

    def run(
        self,
        should_stop: Callable[[], bool],
        on_progress: Callable[[float], None],
        on_wave: Callable[[Film], None] | None,
    ) -> Film:
        shown = 0
        while True:
            progress = self._core.glint_render_wait(self._handle, _POLL_MILLISECONDS)
            on_progress(progress.fraction)
            ended = progress.state >= State.DONE
            if on_wave is not None and progress.samples > shown:
                shown = progress.samples
                film = self.film(shown, complete=True, ended=ended)
                if progress.state == State.HELD:
                    self._core.glint_render_resume(self._handle)
                on_wave(film)
            if ended:
                return self.result(progress)
            if should_stop():
                self._core.glint_render_cancel(self._handle)
            elif progress.state == State.MOVING:
                self._on_moving()

    def result(self, progress: ProgressData) -> Film:
        """The picture of a render that has ended; raises as `render.render_native`."""
        if progress.state == State.FAILED:
            text = self._core.glint_render_error(self._handle).decode(errors="replace")
            if text == "out of memory":
                count = self._core.glint_render_stats(self._handle).primitives
                needs = (
                    f"{count} triangles, spheres, strands and polygons with their trees do not fit"
                )
                raise MemoryError(
                    f"the core ran out of memory: {needs}; use fewer, a smaller picture, or close "
                    "programs"
                )
            raise RuntimeError(f"the core failed: {text}")
        return self.film(progress.samples, complete=progress.state != State.CANCELLED, ended=True)

    def film(self, samples: int, complete: bool, ended: bool) -> Film:
        """What there is after so many samples; read-only unless the render has `ended`."""
        passes = {name: self._pass(name, samples, ended) for name in self._names}
        for number, names, each, title in (
            (core_types.Pass.AOV, self._aovs, 4, aov_pass),
            (core_types.Pass.LIGHT_GROUPS, self._light_groups, 3, light_group_pass),
        ):
            if names:
                values = self._picture(number.name, number, each * len(names), samples, ended, 0.0)
                for k, name in enumerate(names):
                    passes[title(name)] = values[..., each * k : each * (k + 1)]
        data = self._core.glint_render_stats(self._handle)
        return Film(
            self._axes.world_passes(passes) if self._axes else passes,
            samples,
            complete,
            _stats(data)
            | sharing_stats(self._lights, self._settings)
            | group_stats(self._light_groups),
        )

    def _pass(self, name: str, samples: int, ended: bool) -> np.ndarray:
        channels = channels_of(name, self._crypto_ids)
        return self._picture(name, PASS_NUMBERS[name], channels, samples, ended, empty_value(name))

    def _picture(
        self, name: str, number: int, channels: int, samples: int, ended: bool, empty: float
    ) -> np.ndarray:
        """(h, w, c) float32; of an untouched picture when no wave is complete.

        The core's own memory, which is freed with the array and all that look into it. Read-only
        unless the render has `ended`.
        """
        shape = (*self._shape, channels)
        if samples == 0:
            return np.full(shape, empty, np.float32)
        size = math.prod(shape)
        handle = self._core.glint_render_picture(self._handle, number, size)
        if not handle:
            needs = f"pass {name!r} needs {size * 4 / 1e9:.1f} GB"
            raise MemoryError(
                f"the core ran out of memory: {needs}; use a smaller picture or fewer passes"
            )
        memory = (c_float * size).from_address(self._core.glint_picture_values(handle))
        weakref.finalize(memory, self._core.glint_picture_free, handle).atexit = False
        picture = np.frombuffer(memoryview(memory), np.float32).reshape(shape)
        picture.flags.writeable = ended
        return picture


def _stats(data: StatsData) -> dict[str, float]:
    """Seconds, counts, and a 1 for each feature that the scene made active."""
    kinds = ("camera", "shadow", "mirror", "refraction", "transparent", "gather", "probe")
    rays = {f"{kind} rays": float(getattr(data, f"{kind}_rays")) for kind in kinds}
    counts = (
        "triangles",
        "instances",
        "primitives",
        "threads",
        "dropped_primitives",
        "dropped_instances",
        "dropped_lights",
    )
    features = {
        f"feature: {feature.name.lower().replace('_', ' ')}": 1.0
        for feature in core_types.Feature
        if data.features & feature
    }
    return {
        "build": data.build_seconds,
        "trace": data.trace_seconds,
        **{name.replace("_", " "): float(getattr(data, name)) for name in counts},
        "bytes": float(data.tree_bytes),
        "nodes": float(data.tree_nodes),
        "rays": sum(rays.values()),
        **rays,
        **({"media points": float(data.media_points)} if data.media_points else {}),
        **features,
    }
