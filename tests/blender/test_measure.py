"""Measure This Scene: by script and by command, the front, "Use this", and a file that stays as it
is.
"""

import json

import pytest

from blender_process import REGISTER_TREE, Blender

pytestmark = pytest.mark.once

SCENE = (
    REGISTER_TREE
    + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x = scene.render.resolution_y = 24
scene.render.resolution_percentage = 100
scene.glint.final.samples, scene.glint.final.light_samples, scene.glint.final.error_threshold = 4, 2, 0.0
modifier = bpy.data.objects["Cube"].modifiers.new("Round", "SUBSURF")
modifier.levels, modifier.render_levels = 0, 2

def state():
    kinds = ("scenes", "objects", "cameras", "meshes", "lights", "materials", "worlds", "collections", "node_groups")
    settings = [scene.render.engine, scene.render.resolution_x, scene.camera.name, scene.camera.data.dof.use_dof]
    return [sorted(getattr(bpy.data, kind).keys()) for kind in kinds] + settings + [scene.glint.final.samples]
"""  # noqa: E501 - a script for another Blender
)
SMALL = "repeats=1, squares=96, side=12, reference_samples=16"


PANEL = """
from types import SimpleNamespace
from glint.addon.ui import lines
from glint.operators import measure_scene

preferences = SimpleNamespace(system=SimpleNamespace(ui_scale=1.0))  # it is 0 without a window
lines.bpy = SimpleNamespace(context=SimpleNamespace(preferences=preferences))

class Layout:
    def __init__(self, texts, share=1.0):
        self.texts, self.share = texts, share
    def __call__(self, **options):
        return Layout(self.texts, self.share)
    column = row = box = __call__
    def split(self, factor):
        self.rest = 1 - factor
        return Split(self.texts, self.share, factor)
    def label(self, text="", **options):
        self.texts.append([text, self.share])
    def operator(self, name, **options):
        return SimpleNamespace()

class Split(Layout):
    def __init__(self, texts, share, factor):
        super().__init__(texts, share)
        self.parts = iter((factor, 1 - factor))
    def row(self):
        return Layout(self.texts, self.share * next(self.parts))

def drawn_in(width):
    texts = []
    panel = SimpleNamespace(layout=Layout(texts))
    context = SimpleNamespace(scene=scene, region=SimpleNamespace(width=width), preferences=preferences)
    measure_scene.GLINT_RENDER_PT_trade.draw(panel, context)
    return texts
"""  # noqa: E501 - a script for another Blender


def test_a_table_that_would_be_cut_is_a_list(tmp_path):
    """Whether the longest text of its cells, here the settings' of a share of 0.29, has room."""
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
from types import SimpleNamespace
from glint.operators import measure_scene
trade, room = SimpleNamespace(shown=[None]), []
for letters, width in ((50, 1300), (63, 1300), (63, 1400), (50, 880)):
    texts = [("Error", "2 levels"), ("Settings", "y" * letters), ("What Changes", "")]
    measure_scene._told = lambda trade, row: texts
    room.append(measure_scene._has_room(trade, width))
answer(room)
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == [True, False, True, False]


def test_the_operator_measures_draws_and_changes_nothing(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + f"""
scene.camera.data.dof.use_dof = True
before = state()
bpy.ops.glint.measure_scene({SMALL}, json_path=str(FOLDER / "out.json"), plot_path=str(FOLDER / "out.png"))
from glint.operators.measure_scene import IMAGE_NAME, last_measurement
trade = last_measurement(scene.name)
pixels = bpy.data.images[IMAGE_NAME].pixels[:]
bpy.ops.glint.use_measured(row=0)
{PANEL}
answer({{
    "panel": {{width: drawn_in(width) for width in (277, 1300)}},
    "unchanged": before[:-1] == state()[:-1],
    "front": [row.tunables for row in trade.front],
    "used": [scene.glint.final.samples, scene.glint.final.light_samples, scene.glint.final.max_bounces],
    "levels": len(set(pixels)),
    "current": last_measurement(scene.name).current.tunables,
}})
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    answer = run.answer
    assert answer["unchanged"]
    first = answer["front"][0]
    assert answer["used"] == [first["samples"], first["light_samples"], first["max_bounces"]]
    assert answer["current"] == first
    assert answer["levels"] > 10
    for width, drawn in answer["panel"].items():
        told = " ".join(text.strip() for text, _ in drawn)
        for word in ("levels", " s ", "sample", "present settings"):
            assert word in told, (width, word, told)
        # six pixels a letter, and a label has two of margin at each end at least
        cut = [text for text, share in drawn if 6 * len(text) + 4 > share * int(width)]
        assert cut == [], f"cut in an editor of {width} pixels"
    table = json.loads((tmp_path / "out.json").read_text())
    assert table["complete"] and "16 samples" in table["reference"]
    assert [row["current"] for row in table["rows"]].count(True) == 1
    assert (tmp_path / "out.png").read_bytes().startswith(b"\x89PNG")


def test_the_scene_is_read_as_for_a_render(tmp_path):
    """The modifier has 2 levels for renders and none in the viewport: 12 or 192 triangles."""
    run = Blender(tmp_path).run(
        SCENE
        + """
from glint.operators.scene_copy import read_job
from glint.operators.measure_scene import Options, measure_scene
job = read_job(scene, bpy.context.view_layer.name)
fractions = []
trade = measure_scene(
    scene, bpy.context.view_layer.name, Options({"samples": [1]}, 16, repeats=1), on_progress=fractions.append
)
stopped = measure_scene(scene, bpy.context.view_layer.name, should_stop=lambda: True)
answer([len(job.scene.geometries[0].triangles), len(trade.rows), fractions[-1], len(stopped.rows), stopped.complete])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    triangles, rows, fraction, stopped_rows, complete = run.answer
    assert (triangles, fraction, stopped_rows, complete) == (192, 1.0, 0, False)
    # samples 1 and the scene's 4, all light samples (the lamp has a radius); instead of the scene's
    # bounces none, and three numbers of them with three cutoffs, one of which is the scene's own;
    # 0, 1 and 2 diffuse bounces instead of its 4; a constant world; and two ways to reflect less;
    # 1 camera ray a sample instead of its 4
    assert rows == 2 * 5 + 1 + 3 * 3 - 1 + 3 + 1 + 2 + 1


def test_a_failure_is_reported_and_leaves_nothing(tmp_path):
    """The copy of the scene goes away also when its render fails."""
    run = Blender(tmp_path).run(
        SCENE
        + """
from glint.addon.render import final
def broken(*arguments, **options):
    raise ValueError("a fault on purpose")
final.export_scene = broken
before = state()
try:
    bpy.ops.glint.measure_scene()
    said = ""
except RuntimeError as error:
    said = str(error)
answer([before == state(), said])
"""
    )
    assert run.returncode == 0, run.output
    unchanged, said = run.answer
    assert unchanged
    assert "a fault on purpose" in said and "cannot measure" in said


def test_the_command_writes_table_and_plot(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
from glint.operators import command_line
blend = str(FOLDER / "cube.blend")
bpy.ops.wm.save_as_mainfile(filepath=blend)
options = ["--samples", "1", "4", "--light-samples", "1", "--repeats", "1", "--reference-samples", "16"]
good = command_line.run(["measure", blend, "--json", str(FOLDER / "a.json"), "--plot", str(FOLDER / "a.png"), *options])
missing = command_line.run(["measure", str(FOLDER / "none.blend")])
unsound = command_line.run(["measure", blend, "--samples", "0"])
answer([good, missing, unsound, (FOLDER / "a.json").stat().st_size > 0, (FOLDER / "a.png").stat().st_size > 0])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    assert run.answer == [0, 2, 2, True, True]
    assert "rel. RMSE" in run.output and "<-" in run.output
    assert "glint measure: samples is 0" in run.output


def test_the_dialogue_with_a_window(tmp_path):
    """Invoked, ticked by the timer, stopped by Esc: driven by hand, as there is no window here."""
    run = Blender(tmp_path).run(
        SCENE
        + """
import time
from types import SimpleNamespace
from glint.operators import measure_scene
cls, said = measure_scene.GLINT_OT_measure_scene, []
scene.world = None  # no sky: fewer settings to try
manager = SimpleNamespace(
    event_timer_add=lambda step, window: "timer", event_timer_remove=lambda timer: said.append("timer removed"),
    progress_begin=lambda low, high: None, progress_update=lambda value: said.append(value), progress_end=lambda: said.append("end"),
    modal_handler_add=lambda operator: None, windows=())
context = SimpleNamespace(scene=scene, view_layer=bpy.context.view_layer, window=None, window_manager=manager, screen=None,
    workspace=SimpleNamespace(status_text_set=lambda text: said.append(text)))

def drive(stop, **options):
    said.clear()
    options = {"reference_samples": 16, "reference_seconds": 60.0, "repeats": 1, "squares": 96, "side": 12, **options}
    operator = SimpleNamespace(json_path="", plot_path="", report=lambda kind, text: said.append(text), **options)
    for name in ("_options", "_leave", "_finish", "_fail", "_show_news", "cancel"):
        setattr(operator, name, getattr(cls, name).__get__(operator))
    began = cls.invoke(operator, context, None)
    if began != {"RUNNING_MODAL"}:
        return sorted(began)[0], said[-1]
    if stop:
        assert cls.modal(operator, context, SimpleNamespace(type="ESC")) == {"PASS_THROUGH"}
    for _ in range(6000):
        time.sleep(0.05)
        ended = cls.modal(operator, context, SimpleNamespace(type="TIMER"))
        if ended != {"RUNNING_MODAL"}:
            return sorted(ended)[0], [word for word in said if not isinstance(word, float)]

stopped = drive(stop=True, reference_samples=2048, reference_seconds=1e9)
finished = drive(stop=False)

def no_thread(*arguments):
    raise RuntimeError("can't start new thread")

import _thread
from glint.engine import futures
_thread.start_new_thread = no_thread
refused = drive(stop=False)
_thread.start_new_thread, futures._LONGEST_START = lambda *arguments: 1, 0.0
lost = drive(stop=False)[0], said[-1]
answer([stopped, finished, len(measure_scene.last_measurement(scene.name).rows) > 3, refused, lost])
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    (stopped, stopped_words), (finished, finished_words), rows, *threadless = run.answer
    for ended, text in threadless:  # the system starts no thread, or one that dies at once
        assert ended == "CANCELLED" and "close programs" in text and "cannot measure" in text
    assert (stopped, finished, rows) == ("CANCELLED", "FINISHED", True)
    assert "stopped before anything" in stopped_words[-1]
    assert finished_words[-4:-1] == ["timer removed", "end", None] and any(
        "Esc stops" in str(word) for word in finished_words
    )
