"""One view layer of a final render: read Blender's data, trace, fill the passes, tell what
happened.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial

import bpy

from ... import engine
from ...engine.scene import SceneDelta
from ..export import Decoded, aovs_of, export_scene, seen_by
from ..export.darkness import darkness
from ..export.keys import frame_of
from ..ui.properties import settings_from, tracer_notes
from . import last_picture
from .kept import Kept
from .memory import RenderMemory
from .motion import opens, with_motion
from .neighbours import with_neighbours
from .progress import Progress
from .quality_target import QualityTarget, quality_target_of
from .result import Picture, crypto_ids, unrendered_outputs, wanted_passes
from .stamp import Stamping
from .statistics import Statistics, remember, spent_samples
from .unused_data import unused_data
from .views import looker_of, view_names

log = logging.getLogger(__name__)

NOTES_SHOWN = 12
"""More notes than this go to the log only."""
_PREVIEW = {"samples": 4, "light_samples": 2, "max_bounces": 4, "diffuse_bounces": 1}


@dataclass
class Job:
    """Everything that the render thread needs; no Blender data.

    layer: the view layer's name.  view: of a stereoscopic or multi-view render, "" where there is
    but one. size: of the result in pixels.  preview: a material preview,
    about which nothing is told. frame: as `frame_of` has it.  target: the error that settings are
    to be found for.  renderer: what draws, where it keeps the frame before.
    delta: from the scene of that frame.  memory: since Blender's data began to be read.
    slot: as `last_picture.slot_of` has it.
    """

    scene: engine.Scene
    settings: engine.Settings
    scene_name: str
    layer: str
    size: tuple[int, int]
    statistics: Statistics
    notes: list[str]
    preview: bool
    frame: float = 1.0
    target: QualityTarget | None = None
    view: str = ""
    renderer: engine.KeptRender | None = None
    delta: SceneDelta | None = None
    memory: RenderMemory = field(default_factory=RenderMemory)
    slot: Hashable | None = None

    @property
    def title(self) -> str:
        """The layer's, and the view's."""
        return f"{self.layer}.{self.view}" if self.view else self.layer


_readers: list[list[Job]] = []
_painters: list[Callable[[Job], engine.Film]] = []
_decoded = Decoded() if bpy.app.background else None
"""For the frames of animations. Where a person works, the memory between renders is theirs."""


@contextmanager
def reading_only() -> Iterator[list[Job]]:
    """Renders within read the scene as ever and put their jobs into the list, but trace nothing and
    leave a blank result.
    """
    jobs: list[Job] = []
    _readers.append(jobs)
    try:
        yield jobs
    finally:
        _readers.remove(jobs)


@contextmanager
def films_from(painter: Callable[[Job], engine.Film]) -> Iterator[None]:
    """Renders within read the scene as ever, and `painter` gives their films instead of a tracer:
    what was drawn elsewhere reaches Blender's passes and files as if it had been drawn here.
    """
    _painters.append(painter)
    try:
        yield
    finally:
        _painters.remove(painter)


def prepare(
    render_engine: bpy.types.RenderEngine,
    depsgraph: bpy.types.Depsgraph,
    kept: Kept | None = None,
) -> tuple[Job, ...]:
    """Read the evaluated scene: a job for each view. To be called from `update()`, where Blender
    keeps its data still. kept: the frame before, of which but the changes are read.
    """
    start, memory = time.perf_counter(), RenderMemory()
    layer = depsgraph.view_layer
    if not (bpy.app.background or render_engine.is_preview):
        render_engine.update_stats(f"{depsgraph.scene.name}, {layer.name}", "Reading the scene")
    passes = wanted_passes(layer)
    width, height = render_engine.resolution_x, render_engine.resolution_y
    names = ("",) if render_engine.is_preview else view_names(depsgraph.scene.render)
    lookers = [looker_of(render_engine, name, depsgraph) for name in names]
    options = {"width": width, "height": height, "passes": passes, "looker": lookers[0]}
    options |= {"aovs": aovs_of(layer), "keeps_collapsed": opens(render_engine, depsgraph)}
    if kept is None:
        export = export_scene(depsgraph, decoded=_decoded, has_light_groups=True, **options)
    else:
        export = kept.export(depsgraph, **options)
    others = [seen_by(export.scene, looker, depsgraph, width, height) for looker in lookers[1:]]
    asking = _asking(depsgraph)
    settings, notes = _settings_of(asking, layer, passes, export.region)
    skipped = {} if render_engine.is_preview else unused_data(depsgraph, export.scene)
    target, target_notes = (None, []) if render_engine.is_preview else quality_target_of(asking)
    seen = [export.scene, *(scene for scene, _ in others)]
    moving, motion_notes = with_motion(seen, render_engine, depsgraph, names, export.displaced)
    if "Vector" in passes:
        moving, vector_notes = with_neighbours(
            moving, render_engine, depsgraph, names, export.displaced
        )
        motion_notes += vector_notes
    seconds = time.perf_counter() - start
    told = [*notes, *target_notes, *export.notes, *(note for _, own in others for note in own)]
    told += [*motion_notes, *_emptiness(moving[0]), *darkness(export.scene)]
    told += unrendered_outputs(depsgraph.scene, layer)
    size = _size(export.region, width, height)
    slot = None if render_engine.is_preview else last_picture.slot_of(depsgraph, names, size)
    memory.look()
    return tuple(
        Job(
            scene=scene,
            settings=replace(settings, **_PREVIEW) if render_engine.is_preview else settings,
            scene_name=depsgraph.scene.name,
            layer=layer.name,
            size=size,
            statistics=Statistics(
                settings.samples,
                settings.backend,
                export.stats,
                skipped=skipped,
                seconds={"sync": seconds if k == 0 else 0.0},
            ),
            notes=told,
            preview=render_engine.is_preview,
            frame=frame_of(depsgraph.scene),
            target=target,
            view=name,
            renderer=kept.renderer if kept is not None else None,
            delta=export.delta,
            memory=memory,
            slot=slot,
        )
        for k, (name, scene) in enumerate(zip(names, moving, strict=True))
    )


def _settings_of(
    asking: bpy.types.Scene,
    layer: bpy.types.ViewLayer,
    passes: frozenset[str],
    region: tuple[int, int, int, int] | None,
) -> tuple[engine.Settings, tuple[str, ...]]:
    """The settings of a view layer's final render, and what there is to say about them."""
    chosen = settings_from(asking.glint.final, asking, passes, region)
    settings, notes = _with_backend(chosen)
    samples = _layer_samples(layer, asking, settings.samples)
    return replace(settings, crypto_ids=crypto_ids(layer), samples=samples), notes


def _asking(depsgraph: bpy.types.Depsgraph) -> bpy.types.Scene:
    """The scene whose settings count. Scripts change properties of add-ons without a word to a
    depsgraph that Blender keeps, and only an evaluated scene has what is animated.
    """
    scene = depsgraph.scene
    return scene if scene.animation_data is None else depsgraph.scene_eval


def run(
    render_engine: bpy.types.RenderEngine,
    jobs: Sequence[Job],
    is_interrupted: Callable[[], bool],
) -> None:
    """Trace the views of a layer and fill Blender's render result. After an error the result is
    gone and the exception goes on; KeyboardInterrupt is raised where `is_interrupted` stopped the
    work.
    """
    if _readers and not jobs[0].preview:
        _readers[-1].extend(jobs)
        return
    notes: list[str] = []
    for job in jobs:
        if job is not jobs[0]:  # a target is for the first view, and its settings for all
            job.target, job.settings = None, jobs[0].settings
        notes += _run_view(render_engine, job, is_interrupted)
        if render_engine.test_break():
            break
    if not jobs[0].preview:
        tell_notes(render_engine, notes)


def _run_view(
    render_engine: bpy.types.RenderEngine, job: Job, is_interrupted: Callable[[], bool]
) -> list[str]:
    """The same of one view; gives the notes."""
    picture = Picture(render_engine, job.layer, job.size, job.view)

    def should_stop() -> bool:
        return is_interrupted() or render_engine.test_break()

    try:
        with nullcontext() if job.preview else Stamping(job.scene) as stamping:
            film = _trace(render_engine, job, picture, should_stop)
            if is_interrupted():
                raise KeyboardInterrupt
            _finish(render_engine, job, picture, film, stamping)
    except BaseException:
        picture.discard()
        raise
    return [*job.notes, *film.notes]


def _trace(
    render_engine: bpy.types.RenderEngine,
    job: Job,
    picture: Picture,
    should_stop: Callable[[], bool],
) -> engine.Film:
    """The picture, with the settings that reach the job's target if it has one; statistics learn
    the seconds and what was reached.
    """
    start = time.perf_counter()
    is_seen = not (bpy.app.background or job.preview)
    progress = Progress(render_engine, f"{job.scene_name}, {job.title}", is_seen)
    watched = progress.watching("Looking for settings", should_stop)
    forecast = job.target.choose(job.scene, job.settings, watched) if job.target else None
    job.settings = forecast.settings if forecast else job.settings
    passes = job.settings.passes

    def show(film: engine.Film) -> None:
        progress.end_wave(film)
        picture.show(film)

    def follow(fraction: float) -> None:
        _tell_memory(render_engine, job)
        progress.trace(fraction, job.settings)

    if _painters and not job.preview:
        film = _painters[-1](job)
    else:
        draw = (
            engine.render if job.renderer is None else partial(job.renderer.render, delta=job.delta)
        )
        film = draw(
            job.scene,
            replace(job.settings, passes=passes | _watched(job.settings, is_seen)),
            should_stop=should_stop,
            on_progress=follow,
            on_wave=None if bpy.app.background else show,
        )
    job.statistics.spent = spent_samples(film)
    film = replace(
        film,
        passes={
            name: values
            for name, values in film.passes.items()
            if name in passes | {"Combined"} or name.startswith((engine.AOV, engine.LIGHT_GROUP))
        },
    )
    job.statistics.seconds["engine"] = time.perf_counter() - start
    if forecast:
        job.statistics.target = job.target.told(
            job.scene, forecast, film, progress.watching("Checking the error", should_stop)
        )
    return film


def _watched(settings: engine.Settings, is_seen: bool) -> frozenset[str]:
    """Passes that statistics and progress read, whoever else does."""
    shown = {"Error"} if is_seen else set()
    return frozenset(shown | ({"Samples"} if settings.error_threshold > 0 else set()))


def _tell_memory(render_engine: bpy.types.RenderEngine, job: Job) -> tuple[float, float]:
    """What this process holds now, and at most since the render began, for Blender's header."""
    now, most = job.memory.look()
    if not job.preview:
        render_engine.update_memory_stats(memory_used=now, memory_peak=most)
    return now, most


def tell_notes(render_engine: bpy.types.RenderEngine, notes: list[str]) -> None:
    """Report each different note once; a long list is cut, and is whole in the log."""
    unique = list(dict.fromkeys(notes))
    for note in unique:
        log.info("note: %s", note)
    for note in unique[:NOTES_SHOWN]:
        render_engine.report({"WARNING"}, note)
    if len(unique) > NOTES_SHOWN:
        render_engine.report(
            {"WARNING"},
            f"and {len(unique) - NOTES_SHOWN} more notes: the log (level INFO) has them all",
        )


def _layer_samples(layer: bpy.types.ViewLayer, scene: bpy.types.Scene, samples: int) -> int:
    """The view layer's own number of samples where it has one, as Cycles takes it."""
    how = getattr(getattr(scene, "cycles", None), "use_layer_samples", "USE")
    if layer.samples == 0 or how == "IGNORE":
        return samples
    return min(layer.samples, samples) if how == "BOUNDED" else layer.samples


def _with_backend(settings: engine.Settings) -> tuple[engine.Settings, tuple[str, ...]]:
    """The settings with a tracer that can run here, and what there is to say about it."""
    notes = tracer_notes(settings.backend)
    return (replace(settings, backend="NUMPY") if notes else settings), notes


def _emptiness(scene: engine.Scene) -> list[str]:
    """A note when the camera has nothing to see."""
    if any(block.visible_camera for block in scene.instances):
        return []
    return [
        "No object is there for the camera to see: all are hidden, from renders or from cameras, "
        "or have no faces"
    ]


def _size(region: tuple[int, int, int, int] | None, width: int, height: int) -> tuple[int, int]:
    if region is None:
        return width, height
    x0, y0, x1, y1 = region
    return x1 - x0, y1 - y0


def _finish(
    render_engine: bpy.types.RenderEngine,
    job: Job,
    picture: Picture,
    film: engine.Film,
    stamping: Stamping | None,
) -> None:
    """stamping: of the job's scene; None for pictures that get no stamp."""
    if film.samples == 0:
        _leave_the_last(job, picture, film)
        return
    start = time.perf_counter()
    statistics, stamped = job.statistics, stamping is not None and film.complete
    if stamped:
        stamping.begin_pixels(film)
    picture.finish(film)
    if not job.preview:
        last_picture.keep(job.slot, film.combined)
    statistics.samples, statistics.traced = film.samples, film.stats
    statistics.may_stop = job.settings.error_threshold > 0
    statistics.notes = tuple(dict.fromkeys((*job.notes, *film.notes)))
    statistics.seconds |= {stage: film.stats.get(stage, 0.0) for stage in ("build", "trace")}
    statistics.stamp = stamping.fields(job.settings, job.frame) if stamped else {}
    lines = {
        # tiles do not know how many samples the frame's pixels took
        "scene": replace(statistics, spent=None).scene_line,
        "seconds": statistics.stages_line,
        "target": statistics.target,
    }
    picture.stamp(
        job.title, {name: text for name, text in lines.items() if text} | statistics.stamp
    )
    wanted = job.settings.passes & frozenset(engine.CRYPTOMATTES)
    if wanted:
        found = engine.manifests(job.scene)
        picture.describe({name: found[name] for name in sorted(wanted)})
    statistics.seconds["write"] = time.perf_counter() - start
    if not job.preview:
        _tell_statistics(render_engine, job)


def _leave_the_last(job: Job, picture: Picture, film: engine.Film) -> None:
    """Of a render that was stopped before it had a picture."""
    before = last_picture.kept(job.slot)
    if before is None:
        picture.discard()
    else:
        picture.finish(replace(film, passes={"Combined": before}))


def _tell_statistics(render_engine: bpy.types.RenderEngine, job: Job) -> None:
    statistics = job.statistics
    statistics.memory = _tell_memory(render_engine, job)
    render_engine.update_stats(job.title, statistics.stages_line)
    skipped = f"; not needed: {statistics.skipped_line}" if statistics.skipped else ""
    target = f"; {statistics.target}" if statistics.target else ""
    log.info(
        "%s, %s: %s; %s%s%s",
        job.scene_name,
        job.title,
        statistics.stages_line,
        statistics.scene_line,
        skipped,
        target,
    )
    remember(job.scene_name, job.title, statistics)
