"""One 3D view in Rendered shading: follows Blender's data and matrices, asks for pictures, shows
the newest.

Tracing is `engine.LiveRender`'s, reading Blender's data is `addon.export`'s. A view waits only for
a picture that it has just asked for, and no longer than drawing the old one would take. No Blender
data outlives a callback, and the region is known by its address only, which is compared, never
followed.
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np

from ... import engine
from ...engine.scene import Camera, Scene, SceneDelta
from ..export import ExportError
from ..export.culling import Culling
from ..export.darkness import darkness
from ..export.light_groups import NO_MEMBERS, LightGroups, Members
from ..export.sync.incremental import NO_CAMERA, shown_in
from ..render import statistics
from ..ui.properties import tracer_notes, viewport_settings_from
from . import bounds, status, timer
from .draw import Picture, as_colors
from .pacing import Motion, Pacer
from .sharing import SharedExport, export_of
from .surroundings import Surroundings, read_surroundings
from .view import View, camera_notes, culling_of, read_view

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Target:
    """What a picture is of: tag of a task.

    stage: DRAFT (coarse, while things move), FULL, FRAME (the render's own pixels).
    request: counts what was asked of a session, from 1.
    """

    request: int
    view: View
    stage: str
    shown: str
    divisor: int = 1

    @property
    def key(self) -> tuple[int, str]:
        """Equal for pictures of which a later one only refines an earlier one."""
        return self.request, self.stage


@dataclass(frozen=True)
class _ViewOptions:
    """What decides on a picture and is no data of the depsgraph's, so that no update tells of its
    changes.

    settings: with the estimated error, which the status line tells.  groups: light groups and what
    is in them, where one is shown.  culling: what Simplify leaves out.
    """

    settings: engine.Settings
    shown_pass: str
    surroundings: Surroundings
    shown: tuple
    groups: Members = NO_MEMBERS
    culling: Culling | None = None

    @classmethod
    def of(cls, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> _ViewOptions:
        settings, shown_pass = viewport_settings_from(depsgraph.scene)
        settings = replace(settings, passes=settings.passes | {"Error"})
        groups = NO_MEMBERS
        if shown_pass.startswith(engine.LIGHT_GROUP):
            known = LightGroups.of(depsgraph.view_layer)
            if shown_pass.removeprefix(engine.LIGHT_GROUP) in known.names:
                groups = known.members(depsgraph.scene.world, bpy.data.objects)
            else:
                shown_pass = "Combined"
        return cls(
            settings,
            shown_pass,
            read_surroundings(context.space_data),
            shown_in(context.space_data),
            groups,
            culling_of(context.space_data, context.region_data, depsgraph),
        )

    @property
    def export(self) -> dict[str, Any]:
        """What they want of the export, but for the view itself."""
        return {"passes": self.settings.passes, "groups": self.groups, "culling": self.culling}


class Session:
    """What a RenderEngine keeps while it draws one region."""

    def __init__(self) -> None:
        self._export: SharedExport | None = None
        self.live = engine.LiveRender()
        self._pacer = Pacer()
        self._motion = Motion()
        self.content: Scene | None = None
        self._delta: SceneDelta | None = None  # from the content before
        self._settings: engine.Settings | None = None
        self._options: _ViewOptions | None = None
        self._shown_pass = "Combined"
        self._view: View | None = None
        self._problem: str | None = None
        self._pictures: dict[str, Picture] = {}
        self._drawn = 0
        # the view and the scene of the last picture with all its own trees
        self._traced: tuple[tuple, Scene] | None = None
        self._later: list[engine.Task] = []  # what to make after the picture that was asked for
        self._asked_for = -1  # the redraw for which a picture was asked for last
        self._moves = False  # as in the redraw before
        self._is_patient = False
        self._awaited = False
        self.requests = 0
        self.answered = 0
        self.newest_at = 0.0
        self._drawn_at = 0.0
        self._shown: tuple[int, str] | None = None
        self._status = ""
        self._scene_name = ""
        self._notes: dict[str, tuple[str, ...]] = {}  # by who said them
        self._error: float | None = None
        self.region = 0
        timer.watch(self)

    # --- Blender calls
    # ----------------------------------------------------------------------------------------------

    def update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Blender's data changed: read what did, and begin anew. What looks through a camera, which
        may have moved, begins when drawn.
        """
        self.region = context.region.as_pointer()
        self._export, options = export_of(depsgraph), _ViewOptions.of(context, depsgraph)
        asked = {**options.export, "space": context.space_data}
        scene = self._export.update(self, depsgraph, NO_CAMERA, **asked)
        self._scene_name = depsgraph.scene.name
        content = options.surroundings.around(scene)
        self._warn(
            export=self._export.notes(**asked),
            camera=camera_notes(context.region_data, depsgraph.scene),
            core=tracer_notes(depsgraph.scene.glint.final.backend),
            light=darkness(content),
        )
        known = self._export.delta(**asked)
        delta = self.content and SceneDelta.between(self.content, content, known)
        if self._shows(delta, options):
            return  # another object is selected, or the display transform is another
        self.content, self._options, self._delta = content, options, delta
        self._settings, self._shown_pass = options.settings, options.shown_pass
        if self._view is not None and context.region_data.view_perspective != "CAMERA":
            # it is most likely as it was, and Blender takes a while until it draws
            self._ask(self._view)
        else:
            self._view = None

    def _shows(self, delta: SceneDelta | None, options: _ViewOptions) -> bool:
        """Whether the pictures that are there, or were asked for, are of this."""
        return (
            delta is not None
            and self.live.error is None
            and options == self._options
            and delta.keeps_content
        )

    def draw(
        self,
        render_engine: bpy.types.RenderEngine,
        context: bpy.types.Context,
        depsgraph: bpy.types.Depsgraph,
    ) -> None:
        """Put the newest picture on the screen; ask for another if this view has not been asked
        for.
        """
        self.region = context.region.as_pointer()
        timer.drawing()
        self._follow(context, depsgraph)
        if self._awaited:
            self._awaited = False
            if not self._moves:
                self.go_on()
            timer.redraws.wait(self._await, is_patient=self._is_patient or not self._pictures)
        self._fetch()
        for name in ("all", "frame"):
            if name in self._pictures:
                self._pictures[name].draw(render_engine, depsgraph.scene)
        self._tell(render_engine)

    def close(self) -> None:
        """Stop tracing and give everything back. May be called more than once."""
        timer.forget(self)
        self.live.close()
        self._later = []
        self.content = self._delta = self._traced = self._export = None
        self._pictures.clear()

    @property
    def shown_scene(self) -> tuple[Scene, engine.Settings, View] | None:
        """The scene with the view's camera, how it is traced, and the view; None while there is
        nothing to show.
        """
        if self.content is None or self._view is None:
            return None
        return self._scene(self._view.camera), self._settings, self._view

    # --- for the timer
    # ----------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        return self.live.busy or bool(self._later)

    def go_on(self) -> None:
        """Blender has drawn, and nothing moved since."""
        later, self._later = self._later, []
        if later:
            self.live.go_on(later)

    @property
    def has_news(self) -> bool:
        """Whether a picture waits to be drawn, or something else to be told."""
        newest = self.live.newest
        return (newest is not None and newest.number != self._drawn) or self._told() != self._status

    @property
    def wants_redraw(self) -> bool:
        """Whether to draw now. Better pictures of what is shown already take no more than half of
        Blender's time from the tracing.
        """
        if not self.has_news:
            return False
        newest = self.live.newest
        is_refinement = (
            newest is not None and newest.task.tag.key == self._shown and not newest.final
        )
        return not is_refinement or time.perf_counter() - self._drawn_at > 2 * timer.redraws.seconds

    # --- following
    # ----------------------------------------------------------------------------------------------

    def _follow(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Ask for another picture if what the view looks at is another."""
        if self.content is None:
            return
        if _ViewOptions.of(context, depsgraph) != self._options:
            self.update(context, depsgraph)
        try:
            view = read_view(depsgraph, context.region, context.space_data, context.region_data)
        except ExportError as error:
            self._problem, self._view = str(error), None
            return
        self._problem = None
        if self._view is None or view.key != self._view.key:
            self._view = view
            self._ask(view)

    def _ask(self, view: View) -> None:
        """New pictures of this view: a coarse one if it takes that to be in time, then all of it.
        While things move, all but the first wait until Blender has drawn and found nothing newer:
        they would take its processors for what is outdated soon.
        """
        self.requests += 1
        if self._asked_for != timer.redraws.next:
            self._moves, self._asked_for = (
                timer.redraws.follows(self._asked_for),
                timer.redraws.next,
            )
        x0, y0, x1, y1 = view.shown
        pixels = (x1 - x0) * (y1 - y0)
        shades = self._is_known(view) and self._pacer.shades_in_time(pixels)
        is_stopping = self._motion.slows(view.place, time.perf_counter()) and self._moves
        self._is_patient = is_stopping and self._pacer.prefers_whole(pixels, timer.redraws.seconds)
        divisor = 1 if shades or self._is_patient else self._pacer.divisor(pixels)
        first, *self._later = self._tasks(view, divisor, shades)
        self.live.start([first])
        self._awaited = True
        timer.wake()

    def _tasks(self, view: View, divisor: int, shades: bool) -> list[engine.Task]:
        """shades: the rays of the view are known, so that the exact picture comes as soon as
        any.
        """
        content = self._scene(view.camera)
        tasks = [self._draft(content, view, divisor)] if divisor > 1 else []
        waits = tasks or self._is_patient or self._pacer.is_slow_to_build
        if (waits and not shades) or self._bounces_anew():
            tasks.append(self._once(content, view, keep=divisor == 1))
        tasks.append(self._full(content, view, keep=divisor == 1 and len(tasks) == 0))
        if view.frame is not None and not _is_whole(view):
            tasks.append(self._frame(view))
        return tasks

    def _is_known(self, view: View) -> bool:
        """Whether all that rays of this view meet was found out for the picture on the screen: then
        it takes little more than shading.
        """
        if self._traced is None or self._traced[0] != view.key:
            return False
        return self._since_traced.keeps_places

    def _bounces_anew(self) -> bool:
        """Whether it takes time to find out how light bounces before there is an exact picture."""
        known = self._traced is not None and self._since_traced.keeps_content
        return self._settings.bounces > 0 and not known

    @property
    def _since_traced(self) -> SceneDelta:
        return SceneDelta.between(self._traced[1], self.content, self._delta)

    def _scene(self, camera: Camera) -> Scene:
        return replace(self.content, camera=bounds.stepped_up(camera, self.content))

    def _draft(self, scene: Scene, view: View, divisor: int) -> engine.Task:
        """One sample of pixels that are larger than the screen's."""
        size = tuple(max(1, round(extent / divisor)) for extent in scene.camera.resolution)
        region = _scaled(view.border, scene.camera.resolution, size) if view.border else None
        settings = replace(self._first_settings, region=region)
        coarse = replace(scene, camera=replace(scene.camera, resolution=size))
        return engine.Task(
            coarse,
            settings,
            self._target(view, "DRAFT", divisor),
            keep_first_wave=True,
            exact=False,
            delta=self._delta,
        )

    def _once(self, scene: Scene, view: View, keep: bool) -> engine.Task:
        """One sample of every pixel, with the trees that are there."""
        settings = replace(self._first_settings, region=view.border)
        return engine.Task(
            scene, settings, self._target(view, "FULL"), keep, exact=False, delta=self._delta
        )

    @property
    def _first_settings(self) -> engine.Settings:
        """Of pictures of one sample, whose error nobody can tell and no pixel needs to know."""
        return replace(
            self._settings,
            samples=1,
            visibility_samples=1,
            error_threshold=0.0,
            passes=self._settings.passes - {"Error"} | ({self._shown_pass} & engine.PASSES.keys()),
        )

    def _full(self, scene: Scene, view: View, keep: bool) -> engine.Task:
        if _is_whole(view):
            scene = replace(scene, camera=view.frame.camera)
        return engine.Task(
            scene,
            replace(self._settings, region=view.border),
            self._target(view, "FULL"),
            keep_first_wave=keep,
            delta=self._delta,
        )

    def _frame(self, view: View) -> engine.Task:
        """The render's own picture, which the view's equals but for the last bits of its rays."""
        region = None
        if view.border is not None:
            x0, y0, x1, y1 = view.border
            width, height = view.frame.camera.resolution
            moved = (x0 - view.frame.x, y0 - view.frame.y, x1 - view.frame.x, y1 - view.frame.y)
            region = tuple(
                min(max(edge, 0), (width, height)[k % 2]) for k, edge in enumerate(moved)
            )
        return engine.Task(
            replace(self.content, camera=view.frame.camera),
            replace(self._settings, region=region),
            self._target(view, "FRAME"),
            delta=self._delta,
        )

    def _target(self, view: View, stage: str, divisor: int = 1) -> _Target:
        return _Target(self.requests, view, stage, self._shown_pass, divisor)

    def _await(self, seconds: float) -> None:
        """Until there is a picture of what was asked for last."""
        self.live.wait(lambda wave: wave.task.tag.request == self.requests, seconds)

    # --- showing
    # ----------------------------------------------------------------------------------------------

    def _fetch(self) -> None:
        """Make the newest wave a texture, if it is not on the screen yet."""
        wave = self.live.newest
        if wave is None or wave.number == self._drawn:
            return
        self._drawn, self._drawn_at, self._shown = (
            wave.number,
            time.perf_counter(),
            wave.task.tag.key,
        )
        target, film = wave.task.tag, wave.film
        if target.request != self.answered:
            self.answered, self.newest_at = target.request, wave.at
        if film.samples == 1 or wave.final:
            self._learn(wave)
        if wave.task.exact and target.stage == "FULL":
            self._traced = target.view.key, wave.task.scene
        if target.stage == "FRAME" and not wave.final:
            return
        self._error = status.error_of(film)
        if wave.final:
            self._warn(tracer=film.notes)
        colors = as_colors(film.passes[target.shown], target.shown)
        name, frame = ("frame", target.view.frame) if target.stage == "FRAME" else ("all", None)
        for gone in ("frame",) if frame else ("all", "frame"):  # before what comes needs room
            self._pictures.pop(gone, None)
        self._pictures[name] = _picture(
            colors, wave.task.settings.region, target.view, frame, wave.task.scene.camera.resolution
        )

    def _warn(self, **notes: tuple[str, ...]) -> None:
        """Keep what the exporter or the tracer could not show as it is, where the user can
        read it.
        """
        self._notes |= notes
        statistics.remember_view(
            self._scene_name, tuple(note for part in self._notes.values() for note in part)
        )

    def _learn(self, wave: engine.Wave) -> None:
        height, width = wave.film.combined.shape[:2]
        if not wave.film.stats.get("camera rays", 1):
            self._pacer.note_shading(width * height, wave.seconds)
            return
        traced = wave.film.stats.get("trace", wave.seconds)
        others = max(0.0, wave.seconds - traced - wave.build_seconds)
        self._pacer.note(
            width * height,
            wave.film.samples,
            traced,
            wave.build_seconds,
            others if wave.task.tag.stage == "DRAFT" else None,
        )

    def _told(self) -> str:
        """The line of text in the corner of the view."""
        if self._problem:
            return f"Glint: {self._problem}"
        error = self.live.error
        if error is not None:
            return f"Glint: {' '.join(str(error).split())}"
        wave = self.live.newest
        unfinished = self.busy or (wave is not None and wave.task.tag.stage == "DRAFT")
        how_far = status.progress(
            wave, self._settings.samples if self._settings else 0, unfinished, self._error
        )
        if self._settings is not None and self._settings.backend == "NUMPY":
            how_far += f", {status.PYTHON}"
        return how_far + status.warned(sum(map(len, self._notes.values())))

    def _tell(self, render_engine: bpy.types.RenderEngine) -> None:
        text = self._told()
        if text != self._status:
            self._status = text
            render_engine.update_stats("", text)


def _is_whole(view: View) -> bool:
    """Whether the view shows just the render's frame."""
    return (
        view.frame is not None
        and (view.frame.x, view.frame.y) == (0, 0)
        and view.frame.camera.resolution == view.camera.resolution
    )


def _scaled(
    border: tuple[int, ...], size: tuple[int, int], new: tuple[int, int]
) -> tuple[int, int, int, int]:
    """A pixel rectangle of a picture in one of another size, at least a pixel large."""
    x0, y0, x1, y1 = (int(edge * new[k % 2] / size[k % 2]) for k, edge in enumerate(border))
    x0, y0 = min(x0, new[0] - 1), min(y0, new[1] - 1)
    return x0, y0, max(x1, x0 + 1), max(y1, y0 + 1)


def _picture(
    colors: np.ndarray, region: Any, view: View, frame: Any, resolution: tuple[int, int]
) -> Picture:
    """A film's colours where they belong on the screen. frame: of the render, if they are its; else
    pixels of a view in that resolution.
    """
    if frame is not None:
        x0, y0 = region[:2] if region else (0, 0)
        return Picture(colors, (frame.x + x0, frame.y + y0), (colors.shape[1], colors.shape[0]))
    across = view.camera.resolution[0] * view.pixel_size / resolution[0]
    up = view.camera.resolution[1] * view.pixel_size / resolution[1]
    x0, y0 = region[:2] if region else (0, 0)
    return Picture(colors, (x0 * across, y0 * up), (colors.shape[1] * across, colors.shape[0] * up))
