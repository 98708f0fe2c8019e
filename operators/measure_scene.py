"""Measure This Scene: what each setting costs and loses here, as a table and a plot, and a button
that takes a point of it.

Blender reads the operators' annotations as they are, so this module must not make them strings.
"""

import functools
import json
import logging
import math
import tempfile
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ..addon.ui.lines import draw_text, fits
from ..addon.ui.panel import EnginePanel
from ..engine import SceneError
from ..engine.analysis.plot import png_bytes
from ..engine.analysis.trade import REFERENCE_SAMPLES, SIDE, SQUARES, measure
from ..engine.analysis.trade_plot import draw_trade
from ..engine.analysis.trade_rows import Row, Trade, advice
from ..engine.futures import NO_THREAD, Thread
from ..engine.settings import DECLARED
from .editors import window_of
from .pictures import write_whole
from .scene_copy import read_job
from .show_picture import show

log = logging.getLogger(__name__)

IMAGE_NAME = "Glint Time and Error"
_TICK = 0.1
_measured: dict[str, Trade] = {}
"""Scene → its last measurement in this session."""


@dataclass(frozen=True)
class Options:
    """values: tunable → values to try instead of the usual ones.  reference_samples: per pixel.
    reference_seconds: how long the float64 tracer may take for the reference.  repeats: renders per
    setting.  squares, side: how many of how many pixels across.
    """

    values: dict | None = None
    reference_samples: int = REFERENCE_SAMPLES
    reference_seconds: float = 60.0
    repeats: int = 5
    squares: int = SQUARES
    side: int = SIDE


def measure_scene(
    scene: bpy.types.Scene,
    view_layer: str,
    options: Options = Options(),
    should_stop: Callable[[], bool] = lambda: False,
    on_progress: Callable[[float], None] = lambda fraction: None,
) -> Trade:
    """Read the scene as a render would and measure it. Raises RuntimeError where Blender cannot
    render it, SceneError, MemoryError.
    """
    return prepared(scene, view_layer, options)(should_stop=should_stop, on_progress=on_progress)


def prepared(scene: bpy.types.Scene, view_layer: str, options: Options) -> Callable[..., Trade]:
    """`engine.analysis.trade.measure` of this scene, for should_stop, on_progress and on_trade: it
    touches nothing of Blender's, for any thread.
    """
    job = read_job(scene, view_layer)
    return functools.partial(measure, job.scene, job.settings, **vars(options))


def table(trade: Trade, only_front: bool = False) -> list[str]:
    """Lines of a table, the fastest first, with what the rows differ in; * is the front, <- the
    current settings; < is where no square met an error.
    """
    rows = trade.front if only_front else trade.rows
    heads = _different(rows)
    lines = [
        "  ".join(
            [*heads, "  seconds", "rel. RMSE", "   ±", "levels", "  PSNR", "  FLIP", "wrong %"]
        )
    ]
    for row in rows:
        tunables = "  ".join(f"{_shown(row.tunables[name]):>{len(name)}}" for name in heads)
        error = f"< {row.bound:.1e}" if row.bound else f"{row.relative_rmse:.2e}"
        numbers = (
            f"{row.frame_seconds:9.3f}  {error:>9}  {row.spread:3.0%}  "
            f"{row.levels:6.1f}  {row.psnr:6.1f}"
        )
        numbers += f"  {row.flip_mean:6.4f}  {100 * row.wrong:7.2f}"
        lines.append(
            f"{tunables}  {numbers} {'*' if row.on_front else ' '}{' <-' if row.current else ''}"
        )
    return [*lines, advice(trade), f"Errors against {trade.reference}"]


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def write(trade: Trade, title: str, json_path: Path | None, plot_path: Path | None) -> None:
    """The table as JSON and the plot as PNG, where asked for."""
    if json_path:
        write_whole(json_path, json.dumps({"scene": title, **trade.as_json()}, indent=1).encode())
    if plot_path:
        write_whole(plot_path, png_bytes(draw_trade(trade, title)))


def last_measurement(scene_name: str) -> Trade | None:
    """Of this session."""
    return _measured.get(scene_name)


class _Background:
    """A measurement on a thread of its own. trade: what is known so far."""

    def __init__(self, work: Callable[..., Trade]) -> None:
        self.fraction, self.trade, self._error = 0.0, None, None
        self._stop, self._work = threading.Event(), work
        self._thread = Thread(self._run)

    def _run(self) -> None:
        try:
            self.trade = self._work(
                should_stop=self._stop.is_set, on_progress=self._hear, on_trade=self._keep
            )
        except Exception as error:
            log.exception("the measurement failed")
            self._error = error

    def _hear(self, fraction: float) -> None:
        self.fraction = fraction

    def _keep(self, trade: Trade) -> None:
        self.trade = trade

    @property
    def busy(self) -> bool:
        return self._thread.is_alive()

    @property
    def error(self) -> Exception | None:
        """What went wrong, once it is no longer busy."""
        return RuntimeError(NO_THREAD) if self._thread.is_lost else self._error

    def stop(self) -> None:
        """End soon; what was measured is kept."""
        self._stop.set()


class GLINT_OT_measure_scene(bpy.types.Operator):
    """Find settings for this scene: small parts of it are rendered with many settings, and time and
    error of each are listed and plotted. \
The list sharpens while you watch; Esc stops and keeps it"""

    bl_idname = "glint.measure_scene"
    bl_label = "Tune Settings"

    json_path: bpy.props.StringProperty(
        name="JSON",
        description="File for the table, if any",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    plot_path: bpy.props.StringProperty(
        name="Plot",
        description="PNG file for the plot, if any",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )
    reference_samples: bpy.props.IntProperty(
        name="Reference Samples", default=REFERENCE_SAMPLES, min=16, max=65536
    )
    reference_seconds: bpy.props.FloatProperty(
        name="Reference Seconds",
        description="The float64 tracer makes the reference if it takes no longer",
        default=30.0,
        min=0.0,
    )
    repeats: bpy.props.IntProperty(
        name="Repeats",
        description="Renders per setting, of which the fastest counts",
        default=5,
        min=1,
        max=100,
    )
    squares: bpy.props.IntProperty(
        name="Squares",
        description="Parts of the frame to render; more are more certain",
        default=SQUARES,
        min=8,
        max=4096,
    )
    side: bpy.props.IntProperty(
        name="Side", description="Pixels across each square", default=SIDE, min=8, max=512
    )

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
            background = _Background(work)
        except RuntimeError as error:
            return self._fail(error)
        self._scene_name, self._shown = context.scene.name, None
        self._background = background
        _at_work.add(self._background)
        self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            _stop_all()
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._background.busy:
            percent = 100 * self._background.fraction
            context.window_manager.progress_update(percent)
            context.workspace.status_text_set(
                f"Glint measures this scene: {percent:.0f} % (Esc stops and keeps what is known)"
            )
            self._show_news(context)
            return {"RUNNING_MODAL"}
        self._leave(context)
        if self._background.error:
            return self._fail(self._background.error)
        return self._finish(context, self._background.trade)

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender itself ends the operator: a file is loaded, a window closes."""
        _stop_all()
        self._leave(context)

    def _options(self) -> Options:
        names = ("reference_samples", "reference_seconds", "repeats", "squares", "side")
        return Options(**{name: getattr(self, name) for name in names})

    def _show_news(self, context: bpy.types.Context) -> None:
        """What became known since the last time, in the panel and the plot."""
        trade = self._background.trade
        if trade is None or trade is self._shown or not trade.rows:
            return
        opens, plot = self._shown is None, draw_trade(trade, self._scene_name)
        show(IMAGE_NAME, plot, context, opens, _hear_escape)
        self._shown = _measured[self._scene_name] = trade
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()

    def _leave(self, context: bpy.types.Context) -> None:
        _at_work.discard(self._background)
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _finish(self, context: bpy.types.Context, trade: Trade) -> set[str]:
        name = getattr(self, "_scene_name", context.scene.name)
        if not trade.rows:
            self.report({"INFO"}, "The measurement was stopped before anything was measured")
            return {"CANCELLED"}
        _measured[name] = trade
        json_path, plot_path = (
            Path(bpy.path.abspath(path)) if path else None
            for path in (self.json_path, self.plot_path)
        )
        plot_path = (
            plot_path or Path(tempfile.mkdtemp(prefix="glint-measure-")) / "time-and-error.png"
        )
        try:
            write(trade, name, json_path, plot_path)
        except OSError as error:
            return self._fail(error)
        seen = getattr(self, "_shown", None) is not None
        show(IMAGE_NAME, draw_trade(trade, name), context, opens=not seen)
        self.report(
            {"INFO"}, f"{advice(trade)}. The plot is the image '{IMAGE_NAME}' and {plot_path}"
        )
        return {"FINISHED"}

    def _fail(self, error: Exception) -> set[str]:
        self.report({"ERROR"}, f"Glint cannot measure this scene: {' '.join(str(error).split())}")
        return {"CANCELLED"}


_at_work: set[_Background] = set()


def _stop_all() -> None:
    for background in _at_work:
        background.stop()


def _hear_escape(area: bpy.types.Area) -> None:
    """Let Esc in the area's window stop measurements, too: Blender tells modal operators of their
    own window's events alone.
    """
    with bpy.context.temp_override(window=window_of(area), area=area):
        bpy.ops.glint.hear_escape("INVOKE_DEFAULT")


class GLINT_OT_hear_escape(bpy.types.Operator):
    """Stop Tune Settings where Esc is pressed in the window of its plot"""

    bl_idname = "glint.hear_escape"
    bl_label = "Stop Tune Settings on Esc"
    bl_options = {"INTERNAL"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        self._timer = context.window_manager.event_timer_add(_TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC":
            _stop_all()
        if _at_work:
            return {"PASS_THROUGH"}
        self.cancel(context)
        return {"FINISHED", "PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        context.window_manager.event_timer_remove(self._timer)


class GLINT_OT_use_measured(bpy.types.Operator):
    """Give the final render these settings"""

    bl_idname = "glint.use_measured"
    bl_label = "Use This"
    bl_options = {"REGISTER", "UNDO"}

    row: bpy.props.IntProperty(
        name="Row",
        description="Of those that are shown, the fastest first",
        min=0,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene is not None and context.scene.name in _measured

    def execute(self, context: bpy.types.Context) -> set[str]:
        shown = _measured[context.scene.name].shown
        if self.row >= len(shown):
            self.report({"ERROR"}, f"There are {len(shown)} rows")
            return {"CANCELLED"}
        use(context.scene, shown[self.row])
        return {"FINISHED"}


def use(scene: bpy.types.Scene, chosen: Row) -> None:
    """Give a scene's final render the tunables of a row; the row becomes the current one."""
    for name, value in chosen.tunables.items():
        setattr(scene.glint.final, name, value)
    trade = _measured.get(scene.name)
    if trade is not None:
        rows = tuple(replace(row, current=row.tunables == chosen.tunables) for row in trade.rows)
        _measured[scene.name] = replace(trade, rows=rows)


class GLINT_RENDER_PT_trade(EnginePanel, bpy.types.Panel):
    bl_label = "Time and Error"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = self.layout.column()
        column.operator(GLINT_OT_measure_scene.bl_idname, icon="GRAPH")
        column.operator("glint.compare_cycles", icon="IMAGE_REFERENCE")
        trade = last_measurement(context.scene.name)
        if trade is None:
            return
        if not trade.complete or trade.repeats == 0:
            column.label(text="Measured so far:")
        if _has_room(trade, context.region.width / context.preferences.system.ui_scale):
            _draw_table(column.box().column(align=True), trade)
        else:
            _draw_list(column, trade, context.region)
        draw_text(column.column(align=True), [advice(trade)], context.region)


_COLUMNS = (("Time", 0.1), ("Error", 0.3), ("Settings", 0.29), ("What Changes", 0.21), ("", 0.1))
"""Headings of the table, and their shares of its width."""
_TABLE = 900
"""Pixels on a screen of scale 1 from which on the table has room for its buttons."""


def _has_room(trade: Trade, width: float) -> bool:
    """Whether nothing of the table is cut in an editor of so many pixels on a screen of scale 1."""
    cells = [
        (text, share * width)
        for row in trade.shown
        for (_, text), (_, share) in zip(_told(trade, row), _COLUMNS[1:], strict=False)
    ]
    return width >= _TABLE and all(fits(text, pixels) for text, pixels in cells)


def _draw_table(column: bpy.types.UILayout, trade: Trade) -> None:
    """A line for each choice under headings."""
    for (heading, _), cell in zip(_COLUMNS, _cells(column), strict=True):
        cell.label(text=heading)
    for number, row in enumerate(trade.shown):
        cells = _cells(column)
        cells[0].label(text=seconds_text(row.frame_seconds), icon=_mark(row))
        for cell, text in zip(cells[1:], (text for _, text in _told(trade, row)), strict=False):
            cell.label(text=text)
        _draw_choice(cells[-1], row, number)


def _cells(column: bpy.types.UILayout) -> list[bpy.types.UILayout]:
    """Of a new line, as wide as `_COLUMNS` says."""
    cells, rest, left = [], column, 1.0
    for _, share in _COLUMNS[:-1]:
        split = rest.split(factor=share / left)
        cells.append(split.row())
        rest, left = split.row(), left - share
    return [*cells, rest]


def _draw_list(column: bpy.types.UILayout, trade: Trade, region: bpy.types.Region) -> None:
    """A box for each choice, for editors in which the table would be cut."""
    for number, row in enumerate(trade.shown):
        box = column.box().column(align=True)
        head = box.row()
        head.label(text=seconds_text(row.frame_seconds), icon=_mark(row))
        _draw_choice(head, row, number)
        draw_text(box, [f"{name}: {text}" for name, text in _told(trade, row) if text], region)


def _told(trade: Trade, row: Row) -> list[tuple[str, str]]:
    """Heading and text of what is said of a choice beside its time."""
    texts = (error_text(row), settings_text(trade, row), change_text(trade, row))
    return [(name, text) for (name, _), text in zip(_COLUMNS[1:], texts, strict=False)]


def _mark(row: Row) -> str:
    return "RADIOBUT_ON" if row.current else "RADIOBUT_OFF"


def _draw_choice(layout: bpy.types.UILayout, row: Row, number: int) -> None:
    if row.current:
        layout.label(text="")
    else:
        layout.operator(GLINT_OT_use_measured.bl_idname).row = number


_SEEN = (
    (1.0, "not visible"),
    (3.0, "hardly visible"),
    (10.0, "visible side by side"),
    (math.inf, "plainly visible"),
)
"""Levels of 255 below which an error is that."""


def seconds_text(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def error_text(row: Row) -> str:
    """In levels, as a share of the picture's brightness, and in words: what is cut off in a narrow
    editor are the words.
    """
    if row.bound:
        return f"none met: below {row.bound:.2%}"
    words = next(words for limit, words in _SEEN if row.levels < limit or limit == math.inf)
    return f"{row.levels:.2g} levels, {row.relative_rmse:.2%}: {words}"


def tunable_text(name: str, value: Any) -> str:
    """16 samples; threshold 4; rough reflections off."""
    label = DECLARED[name].label.lower()
    if not DECLARED[name].is_whole():
        return f"{label} {DECLARED[name].shown(value)}"
    return f"{value:g} {label.removesuffix('s') if value == 1 else label}"


def settings_text(trade: Trade, row: Row) -> str:
    """The samples, and what else the rows differ in."""
    return ", ".join(tunable_text(name, row.tunables[name]) for name in _different(trade.shown))


def _different(rows: Sequence[Row]) -> list[str]:
    """The tunables that some rows differ in, and the first."""
    names = list(rows[0].tunables) if rows else []
    return names[:1] + [n for n in names[1:] if len({row.tunables[n] for row in rows}) > 1]


def change_text(trade: Trade, row: Row) -> str:
    """What a row takes and loses beside the current settings."""
    current = trade.current
    if row.current:
        return "present settings"
    if current is None or not current.frame_seconds > 0:
        return ""
    time = row.frame_seconds / current.frame_seconds
    speed = f"{1 / time:.2g} × faster" if time < 1 else f"{time:.2g} × slower"
    if not (current.relative_rmse > 0 and row.relative_rmse > 0):
        return speed
    error = row.relative_rmse / current.relative_rmse
    return f"{speed}, {error:.2g} × the error"


_CLASSES = (
    GLINT_OT_measure_scene,
    GLINT_OT_hear_escape,
    GLINT_OT_use_measured,
    GLINT_RENDER_PT_trade,
)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
