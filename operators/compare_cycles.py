"""The same scene in Glint and in Cycles with matched settings: both pictures, their difference in
numbers, and which of it is expected.

Blender reads the operator's annotations as they are, so this module must not make them strings.
"""

import json
import logging
import math
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TypeVar

import bpy
import numpy as np

from ..addon.render import final
from ..engine import Film, render
from ..engine.analysis.comparison import Difference, compare, difference_picture, draw_strip
from ..engine.analysis.flip import displayed
from ..engine.analysis.plot import png_bytes
from ..engine.futures import Future, Thread
from .after_previews import previews_run
from .pictures import write_picture, write_whole
from .scene_copy import copied, read_job, rendered
from .show_picture import show

log = logging.getLogger(__name__)

_TICK = 0.1
"""Seconds between two looks at whether Esc was pressed."""
_STEP, _STEPS, _LARGER = 0.5, 64, 8
"""Seconds of Cycles' work at a time in a window, into how many steps a picture falls at most, as
each reads the scene, and how many times the rows of a step the next one may take.
"""
_KNOWN = 0.1
"""Share of a picture from which on the rest of its time is told."""
_FEWEST = 2
"""Samples of half a render: with one, Cycles' two halves hardly differ, and nothing would be known
of its noise.
"""
_NO_BOUNCES = ("max", "diffuse", "glossy", "transmission", "volume")

T = TypeVar("T")
Steps = Generator[tuple[int, str, float], None, T]


@dataclass(frozen=True)
class Options:
    """samples: of Cycles.  bounces: of mirrors and glass, in both engines; None: the scene's.
    side: pixels of the longer side at most. full_light: also render Cycles with all the light that
    the scene's own settings give it.
    """

    samples: int = 64
    bounces: int | None = None
    side: int = 512
    full_light: bool = True


@dataclass(frozen=True, eq=False)
class Comparison:
    """direct: Glint against Cycles with Glint's light: direct, and as many diffuse bounces.
    noise: RMSE of Cycles' own noise in it, as displayed. indirect: Cycles with all light
    against itself without, None where it was not rendered. seconds: by picture. expected: which
    differences are to be expected, one sentence each. strip: (h, w, 3), row 0 on top.
    """

    direct: Difference
    noise: float
    indirect: Difference | None
    seconds: dict[str, float]
    expected: tuple[str, ...]
    strip: np.ndarray

    def as_json(self) -> dict:
        """The numbers and sentences."""
        return {
            "direct": asdict(self.direct),
            "noise": self.noise,
            "indirect": asdict(self.indirect) if self.indirect else None,
            "seconds": self.seconds,
            "expected": list(self.expected),
        }


def direct_light_only(scene: bpy.types.Scene, samples: int, seed: int = 0) -> None:
    """Cycles without bounces, clamping, denoising or adaptive sampling, on the CPU."""
    _plain_sampling(scene, samples, seed)
    for kind in _NO_BOUNCES:
        setattr(scene.cycles, f"{kind}_bounces", 0)
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    scene.cycles.light_sampling_threshold = 0.0


def _plain_sampling(scene: bpy.types.Scene, samples: int, seed: int) -> None:
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.seed = samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_light_tree = False


def match_cycles(
    scene: bpy.types.Scene,
    samples: int,
    bounces: int,
    seed: int = 0,
    diffuse: int = 0,
    volume: int = 0,
) -> None:
    """Cycles with Glint's pixel filter and Glint's light: after `bounces` mirror reflections and
    refractions, `diffuse` bounces from surfaces that scatter it, and `volume` from media.
    """
    scene.render.engine = "CYCLES"
    direct_light_only(scene, samples, seed)
    scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = bounces
    scene.cycles.diffuse_bounces, scene.cycles.volume_bounces = diffuse, volume
    scene.cycles.max_bounces = max(bounces, diffuse)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = (
        "BLACKMAN_HARRIS",
        scene.render.filter_size,
    )


def limit_size(scene: bpy.types.Scene, side: int) -> None:
    """Fewer pixels of the same view, where it has more than `side` on its longer side."""
    render = scene.render
    width, height = (
        max(1, pixels * render.resolution_percentage // 100)
        for pixels in (render.resolution_x, render.resolution_y)
    )
    factor = min(1.0, side / max(width, height))
    render.resolution_x, render.resolution_y = (
        max(1, round(pixels * factor)) for pixels in (width, height)
    )
    render.resolution_percentage = 100


def compare_with_cycles(
    scene: bpy.types.Scene, view_layer: str, folder: Path, options: Options = Options()
) -> Comparison:
    """Render both and write compare.png, compare.json and the pictures as EXR into `folder`; the
    scene stays as it is.

    Raises RuntimeError with Blender's message when a render fails, OSError when a file cannot be
    written.
    """
    steps = comparison_steps(scene, view_layer, folder, options)
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def comparison_steps(
    scene: bpy.types.Scene, view_layer: str, folder: Path, options: Options, in_window: bool = False
) -> Steps[Comparison]:
    """`compare_with_cycles`, step by step: yields the number of the picture that is made next, who
    makes it and the share of it that is done, and may be closed wherever it does. in_window: Glint
    works in the background meanwhile, and Cycles in steps of about `_STEP` seconds, to the same
    pictures.
    """
    if options.bounces is None:
        options = replace(options, bounces=scene.glint.final.max_bounces)
    folder.mkdir(parents=True, exist_ok=True)
    seconds: dict[str, float] = {}
    yield 1, "by Glint", 0.0
    job = read_job(scene, view_layer)
    glint = yield from _glint(scene, view_layer, folder, options, seconds, in_window)
    cycles = _Cycles(scene, view_layer, folder, options, seconds, in_window)
    first = yield from cycles.direct(0)
    second = yield from cycles.direct(1)
    direct, noise = _mean_and_noise(first, second)
    full = (yield from cycles.full()) if options.full_light else None
    indirect = compare(direct, full) if full is not None else None
    numbers = compare(glint, direct)
    expected = expected_differences(job, numbers, noise, indirect)
    result = Comparison(
        numbers,
        noise,
        indirect,
        seconds,
        expected,
        _strip(scene.name, glint, direct, full, numbers),
    )
    write_whole(folder / "compare.png", png_bytes(result.strip))
    write_whole(folder / "compare.json", json.dumps(result.as_json(), indent=1).encode())
    return result


def _glint(
    scene: bpy.types.Scene,
    view_layer: str,
    folder: Path,
    options: Options,
    seconds: dict,
    in_window: bool,
) -> Steps[np.ndarray]:
    @contextmanager
    def chosen() -> Iterator[bpy.types.Scene]:
        with copied(scene, view_layer, in_focus=True) as copy:
            copy.render.engine = "GLINT"
            copy.glint.final.max_bounces = options.bounces
            limit_size(copy, options.side)
            yield copy

    film, took = None, 0.0
    if in_window:
        with chosen() as copy, final.reading_only() as jobs:
            bpy.ops.render.render(scene=copy.name)
        if jobs and jobs[0].target is None:
            film, took = yield from _traced(jobs[0])
    with chosen() as copy, final.films_from(lambda job: film) if film else nullcontext():
        picture, seconds["glint"] = rendered(copy, folder / "glint.exr")
    seconds["glint"] += took
    return picture


def _traced(job: final.Job) -> Steps[tuple[Film, float]]:
    """The film of a job and its seconds, by another thread; stopped where this is closed."""
    start, stop = time.perf_counter(), threading.Event()
    shares, work = (
        [0.0],
        Future(
            lambda: render(
                job.scene, job.settings, should_stop=stop.is_set, on_progress=shares.append
            )
        ),
    )
    thread = Thread(work.run)
    try:
        while thread.is_alive():
            yield 1, "by Glint", shares[-1]
        return work.result(), time.perf_counter() - start
    finally:
        stop.set()


class _Cycles:
    """Pictures of a scene by Cycles. Arguments as those of `comparison_steps`; seconds: to fill."""

    def __init__(
        self,
        scene: bpy.types.Scene,
        view_layer: str,
        folder: Path,
        options: Options,
        seconds: dict[str, float],
        in_window: bool,
    ) -> None:
        self._scene, self._view_layer, self._folder = scene, view_layer, folder
        self._options, self._seconds, self._in_window = options, seconds, in_window

    def direct(self, seed: int) -> Steps[np.ndarray]:
        """One of two pictures with half of the samples each, and Glint's light."""
        samples = max(_FEWEST, self._options.samples // 2)

        def choose(copy: bpy.types.Scene) -> None:
            final = copy.glint.final
            diffuse, volume = final.diffuse_bounces, final.volume_bounces
            match_cycles(copy, samples, self._options.bounces, seed, diffuse, volume)
            copy.cycles.sample_clamp_indirect = final.clamp_indirect
            copy.cycles.caustics_reflective = final.reflective_caustics == "ON"
            copy.cycles.caustics_refractive = final.refractive_caustics == "ON"

        path = self._folder / f"cycles_direct_{seed}.exr"
        return self._drawn(2 + seed, "by Cycles", "cycles", choose, path)

    def full(self) -> Steps[np.ndarray]:
        """With all the light that the scene's own settings give it."""

        def choose(copy: bpy.types.Scene) -> None:
            copy.render.engine = "CYCLES"
            _plain_sampling(copy, self._options.samples, 0)
            copy.cycles.pixel_filter_type = "BLACKMAN_HARRIS"
            copy.cycles.filter_width = copy.render.filter_size

        path = self._folder / "cycles_full.exr"
        return self._drawn(4, "all light of Cycles", "cycles full", choose, path)

    def _drawn(
        self,
        number: int,
        who: str,
        clock: str,
        choose: Callable[[bpy.types.Scene], None],
        path: Path,
    ) -> Steps[np.ndarray]:
        """A picture of as many rows at a time as take a step's seconds."""
        strips: list[np.ndarray] = []
        done, count, rows = 0, 0, 1
        while done < rows:
            yield number, who, done / rows
            with copied(self._scene, self._view_layer, in_focus=True) as copy:
                choose(copy)
                limit_size(copy, self._options.side)
                rows = copy.render.resolution_y
                fewest = math.ceil(rows / _STEPS) if self._in_window else rows
                count = min(max(count, fewest), rows - done)
                _draw_rows(copy.render, done, done + count)
                picture, took = rendered(copy, path)
            strips.append(picture[done : done + count])
            self._seconds[clock] = self._seconds.get(clock, 0.0) + took
            done += count
            count = min(round(count * _STEP / took), _LARGER * count)
        if len(strips) > 1:
            picture = np.concatenate(strips)
            write_picture(path, picture)
        return picture


def _draw_rows(render: bpy.types.RenderSettings, first: int, last: int) -> None:
    """These rows of the picture alone, from the bottom, at their places."""
    render.use_border, render.use_crop_to_border = True, False
    render.border_min_x, render.border_max_x = 0.0, 1.0
    # Blender and Cycles cut to whole rows
    render.border_min_y = (first + 0.25) / render.resolution_y
    render.border_max_y = min((last + 0.25) / render.resolution_y, 1.0)


def _mean_and_noise(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, float]:
    """Of two pictures with different seeds: their difference tells the noise of their mean, an RMSE
    as displayed.
    """
    shown = (displayed(first) - displayed(second)) / 2
    return (first + second) / 2, float(np.sqrt(np.mean(shown**2)))


def expected_differences(
    job, numbers: Difference, noise: float, indirect: Difference | None
) -> tuple[str, ...]:
    """What of the difference has a known cause. job: as Glint read it."""
    lines = [
        f"Noise of Cycles: RMSE {noise:.4f} of the {numbers.rmse:.4f} between the engines; Glint "
        "has none"
    ]
    glossy = sum(
        any(lobe.kind == "SPECULAR" and lobe.distribution == "BLINN_PHONG" for lobe in lobes)
        for lobes in (material.lobes for material in job.scene.materials)
    )
    if glossy:
        lines.append(
            f"Highlights of {_several(glossy, 'material')}: Glint draws Blinn-Phong lobes where "
            "Cycles draws GGX"
        )
    if indirect is not None:
        lines.append(
            f"Light of more bounces than both followed: RMSE {indirect.rmse:.4f}, "
            f"{indirect.off:.1%} of the pixels off by more than 1 % "
            "between Cycles with and without it; it is in no number above"
        )
    lines += [f"Left out or changed by Glint: {note}" for note in dict.fromkeys(job.notes)]
    return tuple(lines)


def _several(count: int, name: str) -> str:
    return f"{count} {name}{'s' if count != 1 else ''}"


def _strip(
    name: str, glint: np.ndarray, direct: np.ndarray, full: np.ndarray | None, numbers: Difference
) -> np.ndarray:
    pictures = [displayed(glint), displayed(direct), difference_picture(glint, direct)]
    titles = "Glint | Cycles, the same light | difference ×4"
    if full is not None:
        pictures.append(displayed(full))
        titles += " | Cycles, all light"
    lines = (
        f"{name}: {titles}",
        f"{100 * numbers.off:.1f} % of the pixels differ by more than 1 %",
        f"Mean difference: {255 * numbers.rmse:.1f} of 255 levels of a display",
    )
    return draw_strip(pictures, lines, (max(glint.shape[1], 120), glint.shape[0]))


class GLINT_OT_compare_cycles(bpy.types.Operator):
    """Render this scene with Glint and with Cycles, both with the light that Glint follows, and
    show both and their difference. Changes nothing of the scene. \
Esc stops"""

    bl_idname = "glint.compare_cycles"
    bl_label = "Compare with Cycles"

    directory: bpy.props.StringProperty(
        name="Folder",
        description="Where the pictures and numbers go; while the file is not saved, a folder "
        "among the temporary ones stands for //",
        subtype="DIR_PATH",
        default="//compare",
    )
    samples: bpy.props.IntProperty(
        name="Cycles Samples", description="Time grows in proportion", default=64, min=4, max=65536
    )
    bounces: bpy.props.IntProperty(
        name="Bounces",
        description="Of mirrors and glass, in both engines; those of the scene, if not changed",
        default=12,
        min=0,
        max=64,
        options={"SKIP_SAVE"},
    )
    side: bpy.props.IntProperty(
        name="Longest Side",
        description="Pixels; larger frames are made smaller",
        default=512,
        min=16,
        max=16384,
    )
    full_light: bpy.props.BoolProperty(
        name="All Light",
        description="Also render Cycles with all bounces of its own settings, to tell what they "
        "add; takes longest",
        default=True,
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and hasattr(context.scene, "cycles")

    _with_window = False
    _steps: Steps[Comparison] | None = None
    _timer: bpy.types.Timer | None = None
    _picture, _since = 0, 0.0  # which is made, since when

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._with_window = True
        self.bounces = context.scene.glint.final.max_bounces
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All at once for scripts; step by step where there is a window, which lives on, and hears
        Esc.
        """
        bounces = self.bounces if self.properties.is_property_set("bounces") else None
        options = Options(self.samples, bounces, self.side, self.full_light)
        self._folder = chosen_folder(self.directory)
        self._steps = comparison_steps(
            context.scene, context.view_layer.name, self._folder, options, self._with_window
        )
        if self._with_window:
            self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
            context.window_manager.modal_handler_add(self)
            return {"RUNNING_MODAL"}
        while (ended := self._advance(context)) is None:
            pass
        return ended

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "The comparison was stopped")
            return {"CANCELLED"}
        if event.type != "TIMER" or previews_run():
            return {"PASS_THROUGH"}
        ended = self._advance(context)
        if ended is not None:
            self.cancel(context)
        return ended or {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Leave no timer and no copy of the scene; nothing was begun where the dialog is called
        off.
        """
        if self._steps is not None:
            self._steps.close()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            context.workspace.status_text_set(None)

    def _advance(self, context: bpy.types.Context) -> set[str] | None:
        """One more step; how the operator ended, if it did."""
        try:
            number, who, share = next(self._steps)
        except StopIteration as end:
            return self._finish(context, end.value)
        except Exception as error:
            log.exception("the comparison failed")
            self.report({"ERROR"}, f"The comparison failed: {_reason(error)}")
            return {"CANCELLED"}
        if self._with_window:
            now = time.perf_counter()
            if number != self._picture:
                self._picture, self._since = number, now
            context.workspace.status_text_set(
                f"Glint compares with Cycles: picture {number} of {3 + self.full_light}, {who}, "
                f"{share:.0%}{_left(share, now - self._since)} (Esc stops)"
            )
        return None

    def _finish(self, context: bpy.types.Context, result: Comparison) -> set[str]:
        show("Glint and Cycles", result.strip, context)
        for line in (*report_lines(result), f"Pictures and numbers are in {self._folder}"):
            self.report({"INFO"}, line)
        return {"FINISHED"}


def _left(share: float, took: float) -> str:
    """How long a picture still takes of which a share took so many seconds; nothing at first."""
    return f", about {max(1, round(took / share - took))} s left" if share >= _KNOWN else ""


def chosen_folder(directory: str) -> Path:
    """The folder that a user named. Beside a file that was never saved there is none: then a new
    one among the temporary files.
    """
    if directory.startswith("//") and not bpy.data.filepath:
        return Path(tempfile.mkdtemp(prefix="glint-compare-"))
    return Path(bpy.path.abspath(directory))


def _reason(error: Exception) -> str:
    """In one line; what Blender reported begins with Error: already."""
    text = " ".join(str(error).split()).removeprefix("Error: ")
    return (
        text
        if isinstance(error, (RuntimeError, OSError, MemoryError)) and text
        else f"{type(error).__name__}: {text}"
    )


def report_lines(result: Comparison) -> list[str]:
    """The comparison in words."""
    d = result.direct
    times = ", ".join(f"{name} {value:.2f} s" for name, value in result.seconds.items())
    return [
        f"The same light in both: RMSE {d.rmse:.4f}, {d.off:.1%} of the pixels off by more than 1 "
        f"%, FLIP {d.flip_mean:.4f} "
        f"(99th percentile {d.flip_p99:.3f}), means {d.mean:.4f} and {d.reference_mean:.4f}",
        *result.expected,
        f"Seconds, Blender's own work included: {times}",
    ]


def register() -> None:
    bpy.utils.register_class(GLINT_OT_compare_cycles)


def unregister() -> None:
    bpy.utils.unregister_class(GLINT_OT_compare_cycles)
