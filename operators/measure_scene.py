"""Measure This Scene: what each setting costs and loses here, as a table and a plot, and a button that takes a point of it.

Blender reads the operators' annotations as they are, so this module must not make them strings.
"""

import json
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ..engine import SceneError
from ..engine.plot import png_bytes
from ..engine.trade import REFERENCE_SAMPLES, Row, Trade, advice, measure
from ..engine.trade_crops import choose_crops
from ..engine.trade_plot import draw_trade
from .scene_copy import read_job
from .show_picture import show

log = logging.getLogger(__name__)

IMAGE_NAME = "Glint Time and Error"
_TICK = 0.1
_measured: dict[str, Trade] = {}
"""Scene → its last measurement in this session."""


@dataclass(frozen=True)
class Options:
    """values: knob → values to try instead of the usual ones.  reference_samples: per pixel.  reference_seconds: how long the float64
    tracer may take for the reference.  repeats: renders per setting.  crops, crop_side: how many squares of how many pixels."""

    values: dict | None = None
    reference_samples: int = REFERENCE_SAMPLES
    reference_seconds: float = 60.0
    repeats: int = 5
    crops: int = 16
    crop_side: int = 20


def measure_scene(
    scene: bpy.types.Scene,
    view_layer: str,
    options: Options = Options(),
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float], None] = lambda fraction: None,
) -> Trade:
    """Read the scene as a render would and measure it. Raises RuntimeError where Blender cannot render it, SceneError, MemoryError."""
    return prepared(scene, view_layer, options)(should_stop, on_progress)


def prepared(scene: bpy.types.Scene, view_layer: str, options: Options) -> Callable[[Callable, Callable], Trade]:
    """The measurement as a function of should_stop and on_progress that touches nothing of Blender's, for any thread."""
    job = read_job(scene, view_layer)
    crops = choose_crops(job.scene.camera.resolution, options.crops, options.crop_side)
    return lambda should_stop, on_progress: measure(
        job.scene,
        job.settings,
        values=options.values,
        crops=crops,
        reference_samples=options.reference_samples,
        reference_seconds=options.reference_seconds,
        repeats=options.repeats,
        should_stop=should_stop,
        on_progress=on_progress,
    )


def table(trade: Trade, only_front: bool = False) -> list[str]:
    """Lines of a table, the fastest first; * is the front, <- the current settings."""
    rows = trade.front if only_front else trade.rows
    heads = list(rows[0].knobs) if rows else []
    lines = ["  ".join([*heads, "  seconds", "rel. RMSE", "levels", "  PSNR", "  FLIP", "wrong %"])]
    for row in rows:
        knobs = "  ".join(f"{value!s:>{len(name)}}" for name, value in row.knobs.items())
        numbers = f"{row.frame_seconds:9.3f}  {row.relative_rmse:9.2e}  {row.levels:6.1f}  {row.psnr:6.1f}  {row.flip_mean:6.4f}"
        numbers += f"  {100 * row.wrong:7.2f}"
        lines.append(f"{knobs}  {numbers} {'*' if row.on_front else ' '}{' <-' if row.current else ''}")
    return [*lines, advice(trade), f"Errors against {trade.reference}"]


def write(trade: Trade, title: str, json_path: Path | None, plot_path: Path | None) -> None:
    """The table as JSON and the plot as PNG, where asked for."""
    if json_path:
        json_path.write_text(json.dumps({"scene": title, **trade.as_json()}, indent=1))
    if plot_path:
        plot_path.write_bytes(png_bytes(draw_trade(trade, title)))


def last_measurement(scene_name: str) -> Trade | None:
    """Of this session."""
    return _measured.get(scene_name)


class _Background:
    """A measurement on a thread of its own."""

    def __init__(self, work: Callable[[Callable, Callable], Trade]) -> None:
        self.fraction, self.trade, self.error = 0.0, None, None
        self._stop, self._work = threading.Event(), work
        self._thread = threading.Thread(target=self._run, name="glint measure", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.trade = self._work(self._stop.is_set, self._hear)
        except Exception as error:
            log.exception("the measurement failed")
            self.error = error

    def _hear(self, fraction: float) -> None:
        self.fraction = fraction

    @property
    def busy(self) -> bool:
        return self._thread.is_alive()

    def stop(self) -> None:
        """End soon; what was measured is kept."""
        self._stop.set()


class GLINT_OT_measure_scene(bpy.types.Operator):
    """Render small parts of this scene over a grid of settings, compare each with a reference, and plot time against error. Esc stops \
and keeps what was measured"""

    bl_idname = "glint.measure_scene"
    bl_label = "Tune Settings"

    json_path: bpy.props.StringProperty(name="JSON", description="File for the table, if any", subtype="FILE_PATH", options={"SKIP_SAVE"})
    plot_path: bpy.props.StringProperty(
        name="Plot", description="PNG file for the plot, if any", subtype="FILE_PATH", options={"SKIP_SAVE"}
    )
    reference_samples: bpy.props.IntProperty(name="Reference Samples", default=REFERENCE_SAMPLES, min=16, max=65536)
    reference_seconds: bpy.props.FloatProperty(
        name="Reference Seconds", description="The float64 tracer makes the reference if it takes no longer", default=30.0, min=0.0
    )
    repeats: bpy.props.IntProperty(
        name="Repeats", description="Renders per setting, of which the fastest counts", default=5, min=1, max=100
    )
    crops: bpy.props.IntProperty(name="Crops", description="Squares, evenly spread over the frame", default=16, min=1, max=100)
    crop_side: bpy.props.IntProperty(name="Crop Side", description="Pixels", default=20, min=8, max=512)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.scene.camera is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """All at once, for scripts."""
        try:
            trade = measure_scene(context.scene, context.view_layer.name, self._options())
        except (RuntimeError, SceneError, MemoryError) as error:
            return self._fail(error)
        return self._finish(context, trade)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        try:
            work = prepared(context.scene, context.view_layer.name, self._options())
        except RuntimeError as error:
            return self._fail(error)
        self._scene_name = context.scene.name
        self._background = _Background(work)
        self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            self._background.stop()
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._background.busy:
            percent = 100 * self._background.fraction
            context.window_manager.progress_update(percent)
            context.workspace.status_text_set(f"Glint measures this scene: {percent:.0f} % (Esc stops)")
            return {"RUNNING_MODAL"}
        self._leave(context)
        if self._background.error:
            return self._fail(self._background.error)
        return self._finish(context, self._background.trade)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender itself ends the operator: a file is loaded, a window closes."""
        self._background.stop()
        self._leave(context)

    def _options(self) -> Options:
        return Options(
            reference_samples=self.reference_samples,
            reference_seconds=self.reference_seconds,
            repeats=self.repeats,
            crops=self.crops,
            crop_side=self.crop_side,
        )

    def _leave(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _finish(self, context: bpy.types.Context, trade: Trade) -> set[str]:
        name = getattr(self, "_scene_name", context.scene.name)
        if not trade.rows:
            self.report({"INFO"}, "The measurement was stopped before anything was measured")
            return {"CANCELLED"}
        _measured[name] = trade
        write(trade, name, *(Path(bpy.path.abspath(path)) if path else None for path in (self.json_path, self.plot_path)))
        show(IMAGE_NAME, draw_trade(trade, name), context)
        self.report({"INFO"}, advice(trade))
        return {"FINISHED"}

    def _fail(self, error: Exception) -> set[str]:
        self.report({"ERROR"}, f"Glint cannot measure this scene: {' '.join(str(error).split())}")
        return {"CANCELLED"}


class GLINT_OT_use_measured(bpy.types.Operator):
    """Give the final render these settings"""

    bl_idname = "glint.use_measured"
    bl_label = "Use This"
    bl_options = {"REGISTER", "UNDO"}

    row: bpy.props.IntProperty(name="Row", description="Of the measurement's front, the fastest first", min=0, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.scene.name in _measured

    def execute(self, context: bpy.types.Context) -> set[str]:
        front = _measured[context.scene.name].front
        if self.row >= len(front):
            self.report({"ERROR"}, f"The front has {len(front)} rows")
            return {"CANCELLED"}
        use(context.scene, front[self.row])
        return {"FINISHED"}


def use(scene: bpy.types.Scene, chosen: Row) -> None:
    """Give a scene's final render the knobs of a row; the row becomes the current one."""
    for name, value in chosen.knobs.items():
        setattr(scene.glint.final, name, value)
    trade = _measured.get(scene.name)
    if trade is not None:
        rows = tuple(replace(row, current=row.knobs == chosen.knobs) for row in trade.rows)
        _measured[scene.name] = replace(trade, rows=rows)


class GLINT_RENDER_PT_trade(bpy.types.Panel):
    bl_label = "Time and Error"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {"GLINT"}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        column = self.layout.column()
        column.operator(GLINT_OT_measure_scene.bl_idname, icon="GRAPH")
        column.operator("glint.compare_cycles", icon="IMAGE_REFERENCE")
        trade = last_measurement(context.scene.name)
        if trade is None:
            return
        for number, row in enumerate(trade.front):
            line = column.row()
            knobs = " / ".join(f"{value:g}" for value in row.knobs.values())
            line.label(text=f"{knobs}: {row.frame_seconds:.2f} s, {row.relative_rmse:.2%}", icon="RADIOBUT_ON" if row.current else "NONE")
            line.operator(GLINT_OT_use_measured.bl_idname).row = number
        column.label(text=advice(trade))


_CLASSES = (GLINT_OT_measure_scene, GLINT_OT_use_measured, GLINT_RENDER_PT_trade)


def register() -> None:
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister() -> None:
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
