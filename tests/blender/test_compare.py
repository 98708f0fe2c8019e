"""Compare with Cycles: a matched diffuse scene agrees, what is expected is said, and the file stays
as it is.
"""

import json
import re

import pytest

from blender_process import REGISTER_TREE, Blender

SCENE = (
    REGISTER_TREE
    + """
from glint.operators import command_line
from glint.operators.compare_cycles import Options, compare_with_cycles
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
if not hasattr(scene, "cycles"):
    answer("no Cycles")
    leave()
scene.render.resolution_x = scene.render.resolution_y = 32
scene.render.resolution_percentage = 100
tree = bpy.data.materials["Material"].node_tree
tree.nodes.clear()
diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
scene.camera.data.dof.use_dof = True
scene.camera.data.dof.aperture_fstop = 0.1
bpy.data.objects["Light"].data.shadow_soft_size = 0.0
floor = bpy.data.objects.new("Floor", bpy.data.meshes.new("Floor"))
floor.data.from_pydata([(-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1)], [], [(0, 1, 2, 3)])
floor.data.materials.append(bpy.data.materials["Material"])
scene.collection.objects.link(floor)
scene.timeline_markers.new("bound", frame=1).camera = scene.camera

def state():
    kinds = ("scenes", "objects", "cameras", "images", "lights", "worlds", "collections", "node_groups")
    settings = [scene.render.engine, scene.render.resolution_x, scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.device,
                scene.camera.name, scene.camera.data.dof.use_dof, scene.render.image_settings.file_format, scene.glint.final.max_bounces,
                scene.timeline_markers[0].camera.name, [layer.use for layer in scene.view_layers]]
    return [sorted(name for name in getattr(bpy.data, kind).keys() if name != "Render Result") for kind in kinds] + settings
"""  # noqa: E501 - a script for another Blender
)


def _answer(run):
    if run.answer == "no Cycles":
        pytest.skip("this Blender has no Cycles")
    return run.answer


def test_a_diffuse_scene_agrees_and_nothing_changes(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
scene.glint.final.diffuse_bounces = 0
before = state()
result = compare_with_cycles(scene, bpy.context.view_layer.name, FOLDER / "out", Options(samples=64))
answer({"unchanged": before == state(), "strip": result.strip.shape, **result.as_json()})
"""  # noqa: E501 - a script for another Blender
    )
    answer = _answer(run)
    assert answer["unchanged"]
    direct = answer["direct"]
    # What is left is Cycles' noise on edges; the floor and box alone take half of the light that
    # the full one adds.
    assert direct["rmse"] < 3 * answer["noise"] + 0.005
    assert direct["mean"] == pytest.approx(direct["reference_mean"], rel=0.02)
    assert answer["indirect"]["rmse"] > 2 * direct["rmse"]
    assert answer["strip"][1] >= 4 * 32
    saved = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert saved["direct"] == direct and (tmp_path / "out" / "compare.png").is_file()
    assert not any("Highlights" in line for line in answer["expected"])
    assert any("Light of more bounces" in line for line in answer["expected"])


@pytest.mark.parametrize(("given", "taken"), [("", 3), (", bounces=0", 0), (", bounces=5", 5)])
def test_both_bounce_as_the_scene_does_or_as_asked(tmp_path, given, taken):
    """Mirrors that show nothing in both pictures compare nothing."""
    run = Blender(tmp_path).run(
        SCENE
        + f"""
from glint.operators import compare_cycles
taken = []
def look(scene, samples, bounces, *rest, _match=compare_cycles.match_cycles):
    taken.append(bounces)
    _match(scene, samples, bounces, *rest)
compare_cycles.match_cycles = look
def draw(copy, path, _draw=compare_cycles.rendered):
    if copy.render.engine == "GLINT":
        taken.append(copy.glint.final.max_bounces)
    return _draw(copy, path)
compare_cycles.rendered = draw
scene.glint.final.max_bounces = 3
scene.glint.final.samples = 1
bpy.ops.glint.compare_cycles(directory=str(FOLDER), samples=4, side=16, full_light=False{given})
answer(taken)
"""
    )
    assert _answer(run) == [taken] * 3, run.output


def test_a_difference_is_seen(tmp_path):
    """A fault in one engine's light: Glint reads the strength number as the intensity."""
    run = Blender(tmp_path).run(
        SCENE
        + """
scene.glint.final.illumination = "CLASSIC"
result = compare_with_cycles(scene, bpy.context.view_layer.name, FOLDER / "out", Options(samples=8, full_light=False))
answer(result.as_json())
"""  # noqa: E501 - a script for another Blender
    )
    answer = _answer(run)
    assert answer["direct"]["rmse"] > 10 * answer["noise"] and answer["direct"]["off"] > 0.5
    assert answer["indirect"] is None


def test_the_sheet_is_in_an_artists_words(tmp_path):
    """And no difference of highlights is expected where both engines draw GGX."""
    run = Blender(tmp_path).run(
        SCENE
        + """
from glint.operators import compare_cycles
lines, draw = [], compare_cycles.draw_strip
compare_cycles.draw_strip = lambda pictures, told, size: (lines.append(told), draw(pictures, told, size))[1]
shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
tree.links.new(shader.outputs[0], output.inputs["Surface"])
result = compare_with_cycles(scene, bpy.context.view_layer.name, FOLDER / "out", Options(samples=4, full_light=False))
answer([lines[0][1:], result.expected])
"""  # noqa: E501 - a script for another Blender
    )
    (pixels, mean), expected = _answer(run)
    assert re.fullmatch(r"\d+\.\d % of the pixels differ by more than 1 %", pixels)
    assert re.fullmatch(r"Mean difference: \d+\.\d of 255 levels of a display", mean)
    assert not any("Highlights" in line for line in expected)


def test_operator_and_command(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "a.blend"))
before = state()
bpy.ops.glint.compare_cycles(directory=str(FOLDER / "operator"), samples=4, side=16, full_light=False)
shown = bpy.data.images.get("Glint and Cycles")
bpy.data.images.remove(shown)
unchanged = before == state()
bpy.data.objects.remove(scene.camera)
try:
    bpy.ops.glint.compare_cycles(directory=str(FOLDER / "none"), samples=4)
    failed = False
except RuntimeError:
    failed = True
code = command_line.run(["compare", str(FOLDER / "a.blend"), "--out", str(FOLDER / "command"), "--samples", "4", "--side", "16"])
answer([unchanged, failed, len(bpy.data.scenes), code, (FOLDER / "command" / "compare.png").is_file()])
"""  # noqa: E501 - a script for another Blender
    )
    assert _answer(run) == [True, True, 1, 0, True], run.output
    assert "The same light in both: RMSE" in run.output and "Light of more bounces" in run.output


def test_escape_stops(tmp_path):
    """Invoked, ticked by the timer, stopped by Esc: driven by hand, as there is no window here."""
    run = Blender(tmp_path).run(
        SCENE
        + """
import time
from types import SimpleNamespace
from glint.operators.compare_cycles import GLINT_OT_compare_cycles as cls
said = []
manager = SimpleNamespace(
    event_timer_add=lambda step, window: "timer", event_timer_remove=lambda timer: said.append("timer removed"),
    modal_handler_add=lambda operator: None, invoke_props_dialog=lambda operator: cls.execute(operator, context))
context = SimpleNamespace(scene=scene, view_layer=bpy.context.view_layer, window=None, window_manager=manager, screen=None,
    workspace=SimpleNamespace(status_text_set=said.append))
options = {"directory": str(FOLDER / "out"), "samples": 4, "bounces": 0, "side": 16, "full_light": False}
operator = SimpleNamespace(report=lambda kind, text: said.append(text), **options)
operator.properties = SimpleNamespace(is_property_set=options.__contains__)
operator._steps = operator._timer = None
operator._picture, operator._since = cls._picture, cls._since
for name in ("_advance", "_finish", "cancel"):
    setattr(operator, name, getattr(cls, name).__get__(operator))
before = state()
steps = [cls.invoke(operator, context, None)]
for kind in ("TIMER", "MOUSEMOVE"):
    steps.append(cls.modal(operator, context, SimpleNamespace(type=kind)))
while "picture 2" not in said[-1]:
    time.sleep(0.01)
    cls.modal(operator, context, SimpleNamespace(type="TIMER"))
steps.append(cls.modal(operator, context, SimpleNamespace(type="ESC")))
files = sorted(path.name for path in (FOLDER / "out").iterdir())
from glint.operators.compare_cycles import _left
said.insert(0, _left(0.05, 3.0) + _left(0.25, 3.0))
answer([[sorted(step)[0] for step in steps], files, before == state(), said])
"""  # noqa: E501 - a script for another Blender
    )
    steps, files, unchanged, said = _answer(run)
    assert steps == ["RUNNING_MODAL", "RUNNING_MODAL", "PASS_THROUGH", "CANCELLED"]
    assert files == ["glint.exr"] and unchanged and said[0] == ", about 9 s left"
    assert said[-3:] == ["timer removed", None, "The comparison was stopped"]


def test_in_a_window_it_works_in_steps_to_the_same_pictures(tmp_path):
    """Each step ends soon, tells how far it is, and is where the comparison may be closed."""
    run = Blender(tmp_path).run(
        SCENE
        + """
import threading
import numpy as np
from glint.operators import compare_cycles
from glint.operators.compare_cycles import comparison_steps
from glint.operators.pictures import read_picture
compare_cycles._STEP, compare_cycles._STEPS = 0.0, 8
scene.glint.final.samples, scene.glint.final.diffuse_bounces = 2, 0
layer, options, before, steps = bpy.context.view_layer.name, Options(samples=16, side=24), state(), []
ended = compare_with_cycles(scene, layer, FOLDER / "at once", options)
going = comparison_steps(scene, layer, FOLDER / "in steps", options, in_window=True)
try:
    while True:
        steps.append(next(going))
        alive = before == state()
except StopIteration as end:
    same = end.value
names = [path.name for path in (FOLDER / "at once").glob("*.exr")]
off = {name: float(np.abs(read_picture(FOLDER / "at once" / name) - read_picture(FOLDER / "in steps" / name)).max()) for name in names}
scene.glint.final.samples = 4096
going = comparison_steps(scene, layer, FOLDER / "closed", options, in_window=True)
next(going), next(going)
going.close()
answer([[step for step in steps if step[0] > 1], off, same.noise / ended.noise, alive and before == state(), len(bpy.data.scenes)])
"""  # noqa: E501 - a script for another Blender
    )
    steps, off, noise, unchanged, scenes = _answer(run)
    assert [step[0] for step in steps] == sorted(step[0] for step in steps)
    for number in (2, 3, 4):
        assert [step[2] for step in steps if step[0] == number] == [k / 8 for k in range(8)]
    assert len(off) == 4 and set(off.values()) == {0.0}
    assert noise == 1 and unchanged and scenes == 1


def test_a_file_that_was_never_saved_and_a_render_result_of_another_name(tmp_path):
    """Nothing goes into the folder that Blender happened to start in; why a comparison failed is
    told.
    """
    run = Blender(tmp_path).run(
        SCENE
        + """
import os, tempfile
tempfile.tempdir = str(FOLDER / "temporary")
os.mkdir(tempfile.tempdir)
before = sorted(os.listdir())
scene.glint.final.samples, scene.render.engine = 1, "GLINT"
bpy.ops.render.render()
next(image for image in bpy.data.images if image.type == "RENDER_RESULT").name = "Image"
scene.camera = bpy.data.objects["Floor"]  # which is no camera
bpy.ops.glint.compare_cycles(samples=4, side=8, full_light=False)
found = [path.name for path in (FOLDER / "temporary").glob("glint-compare-*/*")]
import glint.operators.compare_cycles as module
def broken(*arguments):
    raise LookupError("broken on purpose")
module.compare = broken
try:
    bpy.ops.glint.compare_cycles(samples=4, side=8, full_light=False)
except RuntimeError as error:
    answer([before == sorted(os.listdir()), sorted(found), str(error).strip()])
"""
    )
    nowhere_else, found, message = _answer(run)
    assert nowhere_else and {"compare.json", "compare.png", "glint.exr"} <= set(found)
    assert f"Pictures and numbers are in {tmp_path}/temporary/glint-compare-" in run.output
    assert message == "Error: The comparison failed: LookupError: broken on purpose"
