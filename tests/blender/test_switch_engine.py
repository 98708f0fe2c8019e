"""Switch to Glint and back: what is carried over, what is told with which objects, and that nothing
of the other engine's changes.
"""

import pytest

from blender_process import REGISTER_TREE, Blender
from glint.addon.export.report import Report
from glint.engine.settings import OFFERED
from glint.operators.carried_settings import samples_for

SCENE = (
    REGISTER_TREE
    + """
import json
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
if not hasattr(scene, "cycles"):
    answer("no Cycles")
    leave()
EEVEE = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"
scene.render.engine = "CYCLES"
cube, lamp = bpy.data.objects["Cube"], bpy.data.objects["Light"]

def value(owner, name):
    found = getattr(owner, name)
    return list(found) if hasattr(found, "__len__") and not isinstance(found, str) else found

def settings(owner, without=()):
    kept = ("BOOLEAN", "INT", "FLOAT", "STRING", "ENUM")
    return {p.identifier: repr(value(owner, p.identifier)) for p in owner.bl_rna.properties
            if p.type in kept and not p.is_readonly and p.identifier not in without}

def nodes(block):
    return [[node.bl_idname, [repr(value(s, "default_value")) for s in node.inputs if hasattr(s, "default_value")]]
            for node in block.node_tree.nodes] + [len(block.node_tree.links)]

def everything():
    kinds = ("scenes", "objects", "materials", "cameras", "images", "lights", "worlds", "node_groups")
    return json.dumps([
        settings(scene, ("frame_current_final",)), settings(scene.cycles), settings(scene.eevee),
        settings(scene.render, ("engine",)), settings(scene.view_settings),
        [nodes(m) for m in bpy.data.materials if m.node_tree], nodes(scene.world),
        [settings(thing) for thing in scene.objects], [settings(layer) for layer in scene.view_layers],
        [sorted(name for name in getattr(bpy.data, kind).keys() if name != "Render Result") for kind in kinds]])

def rows(kind):
    return [[row.text, json.loads(row.names)] for row in scene.glint_switch.rows if row.kind == kind]
"""  # noqa: E501 - a script for another Blender
)


def answer_of(tmp_path, program):
    run = Blender(tmp_path).run(SCENE + program)
    if run.answer == "no Cycles":
        pytest.skip("this Blender has no Cycles")
    assert run.returncode == 0, run.output
    return run.answer


def test_samples_are_a_quarter_of_the_root_of_cycles():
    """As 4 x 4 pixels share what they find."""
    counts = (1, 128, 256, 257, 1024, 4096, 4097, 1 << 20, 1 << 24, 0)
    assert [samples_for(n) for n in counts] == [4, 4, 4, 8, 8, 16, 32, 256, 256, OFFERED.samples]


def test_notes_know_all_their_names():
    report = Report()
    for number in range(6):
        report.note("Left out: {}", f"Thing {number}")
    report.note("Nothing to see")
    first, second = report.notes()
    assert first == "Left out: 'Thing 0', 'Thing 1', 'Thing 2', 'Thing 3' and 2 more"
    assert first.names == tuple(f"Thing {number}" for number in range(6))
    assert second.names == ()


def test_cycles_is_carried_over_and_comes_back_as_it_was(tmp_path):
    got = answer_of(
        tmp_path,
        """
c = scene.cycles
c.samples, c.adaptive_threshold, c.preview_samples, c.use_preview_adaptive_sampling = 1000, 0.02, 0, False
c.max_bounces, c.diffuse_bounces, c.glossy_bounces, c.transmission_bounces = 6, 3, 2, 9
c.film_exposure, c.sample_clamp_direct, c.filter_width, c.use_fast_gi = 2.0, 3.0, 2.5, True
cube.visible_volume_scatter = False
before = everything()
switched = bpy.ops.glint.switch_to_glint()
final, viewport = scene.glint.final, scene.glint.viewport
carried = [final.samples, final.error_threshold, final.max_bounces, final.diffuse_bounces,
           viewport.samples, viewport.error_threshold, viewport.max_bounces, scene.render.engine]
told = [text for text, _ in rows("DIFFERENT") + rows("UNLIKE")]
taken = [text for text, _ in rows("CARRIED")]
kept = before == everything()
poll = bpy.ops.glint.switch_to_glint.poll()
back = bpy.ops.glint.switch_back()
answer({"switched": list(switched), "carried": carried, "told": told, "taken": taken, "kept": kept, "poll": poll,
        "back": list(back), "engine": scene.render.engine, "as it was": before == everything(),
        "left": [len(scene.glint_switch.rows), bpy.ops.glint.switch_back.poll()]})
""",  # noqa: E501 - a script for another Blender
    )
    assert got["switched"] == ["FINISHED"] and got["back"] == ["FINISHED"]
    assert got["carried"] == [8, 0.0, 6, 3, 8, 0.0, 6, "GLINT"]
    assert [text for text in got["taken"] if text.startswith(("Samples", "Threshold"))] == [
        "Samples (Render) 8 (Cycles: Max Samples 1000; without noise, and as pixels share what "
        "they find, about a quarter of the root is enough)",
        "Threshold (Render) 0 (Cycles: Noise Threshold 0.02; so few samples go to all pixels)",
        "Samples (Viewport) 8 (Cycles: Max Samples 0, without a limit)",
        "Threshold (Viewport) 0 (Cycles: Noise Threshold off)",
    ]
    assert got["kept"] and got["as it was"] and got["engine"] == "CYCLES"
    assert not got["poll"] and got["left"] == [0, False]
    told = "\n".join(got["told"])
    for piece in ("Film Exposure", "Clamp Direct", "2.50 px", "Fast GI", "whatever its ray vis"):
        assert told.count(piece) == 1, piece


def test_what_somebody_chose_in_glint_stays(tmp_path):
    got = answer_of(
        tmp_path,
        """
final = scene.glint.final
final.samples = 200
bpy.ops.glint.switch_to_glint()
first = [final.samples, final.max_bounces, rows("KEPT")]
bpy.ops.glint.switch_back()
scene.cycles.max_bounces = scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = 7
bpy.ops.glint.switch_to_glint()
second = [final.samples, final.max_bounces]
final.max_bounces = 3
bpy.ops.glint.switch_back()
bpy.ops.glint.switch_to_glint()
answer([first, second, [final.samples, final.max_bounces]])
""",
    )
    first, second, third = got
    assert first[:2] == [200, 12] and first[2][0][0].startswith("Samples (Render) 200")
    assert second == [200, 7] and third == [200, 3]


def test_lines_select_what_they_are_about(tmp_path):
    got = answer_of(
        tmp_path,
        """
glass = bpy.data.materials.new("Pane")
glass.use_nodes = True
tree = glass.node_tree
tree.nodes.clear()
shader, output = tree.nodes.new("ShaderNodeBsdfGlass"), tree.nodes.new("ShaderNodeOutputMaterial")
tree.links.new(shader.outputs[0], output.inputs["Surface"])
loose = tree.nodes.new("ShaderNodeBsdfToon")
inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
inner.nodes.new("ShaderNodeSubsurfaceScattering")
group = tree.nodes.new("ShaderNodeGroup")
group.node_tree = inner
for number in range(6):
    pane = bpy.data.objects.new(f"Pane {number}", cube.data.copy())
    pane.data.materials.clear()
    pane.data.materials.append(glass)
    scene.collection.objects.link(pane)
pane.hide_set(True)
lamp.data.cycles.max_bounces = 2
bpy.ops.glint.switch_to_glint()
found = {}
for number, row in enumerate(scene.glint_switch.rows):
    if json.loads(row.names):
        ended = bpy.ops.glint.select_changed(row=number)
        active = bpy.context.view_layer.objects.active
        found[row.text] = [row.kind, list(ended), sorted(o.name for o in bpy.context.selected_objects), active.name]
answer(found)
""",  # noqa: E501 - a script for another Blender
    )

    def about(start):
        [value] = [value for text, value in got.items() if text.startswith(start)]
        return value

    panes = [f"Pane {number}" for number in range(5)]
    assert about("Glass throws no caustics") == ["DIFFERENT", ["FINISHED"], panes, panes[0]]
    assert about("Glass BSDF: ")[:3] == ["NEARLY", ["FINISHED"], panes]
    assert about("Max Bounces of lights")[2] == ["Light"]
    assert not [text for text in got if text.startswith(("Toon", "Subsurface"))]


def test_undo_takes_the_switch_back(tmp_path):
    got = answer_of(
        tmp_path,
        """
bpy.ops.ed.undo_push(message="before")
bpy.ops.glint.switch_to_glint()
bpy.ops.ed.undo_push(message="after")
during = [bpy.context.scene.render.engine, len(bpy.context.scene.glint_switch.rows) > 0]
bpy.ops.ed.undo()
scene = bpy.context.scene
answer([during, [scene.render.engine, len(scene.glint_switch.rows), scene.glint.final.is_property_set("samples")]])
""",  # noqa: E501 - a script for another Blender
    )
    assert got == [["GLINT", True], ["CYCLES", 0, False]]


def test_eevee_is_carried_over(tmp_path):
    got = answer_of(
        tmp_path,
        """
scene.render.engine = EEVEE
scene.eevee.taa_render_samples, scene.eevee.taa_samples = 96, 0
cube.visible_glossy = False
before = everything()
bpy.ops.glint.switch_to_glint()
final, viewport = scene.glint.final, scene.glint.viewport
told = rows("DIFFERENT") + rows("UNLIKE")
bpy.ops.glint.switch_back()
answer([[final.samples, viewport.samples, final.diffuse_bounces], told, scene.render.engine == EEVEE, before == everything()])
""",  # noqa: E501 - a script for another Blender
    )
    carried, told, is_back, is_as_it_was = got
    assert carried == [24, 8, 4] and is_back and is_as_it_was
    assert any(names == ["Cube"] and "Ray Visibility" in text for text, names in told)
    assert any(text.startswith("Surfaces throw light") for text, _ in told)


def test_a_scene_that_cannot_be_read_is_switched_and_told(tmp_path):
    got = answer_of(
        tmp_path,
        """
bpy.data.objects.remove(scene.camera)
bpy.ops.glint.switch_to_glint()
answer([scene.render.engine, rows("DIFFERENT")])
""",
    )
    assert got[0] == "GLINT"
    assert any("is not known" in text and "camera" in text.lower() for text, _ in got[1])


def test_where_the_buttons_are(tmp_path):
    got = answer_of(
        tmp_path,
        """
from types import SimpleNamespace
from glint.operators import switch_engine
drawn = []

class Layout:
    def operator(self, name, text="", **options):
        drawn.append([name, text])
        return SimpleNamespace(row=None)
    def label(self, text="", **options):
        drawn.append(["label", text])
    def column(self, **options):
        return self
    row = column

region = SimpleNamespace(width=400)
switch_engine.draw_text = lambda *given: None  # a program without windows has no width
def shown():
    drawn.clear()
    context = SimpleNamespace(scene=scene, engine=scene.render.engine, region=region)
    switch_engine._draw_switch(SimpleNamespace(layout=Layout()), context)
    panel = switch_engine.GLINT_RENDER_PT_switched
    if panel.poll(context):
        panel.draw(SimpleNamespace(layout=Layout()), context)
    return [line for line in drawn if line[0] != "label" or line[1] in ("Looks Different", "Taken Over")]

glass = cube.active_material.node_tree.nodes["Principled BSDF"]
glass.inputs["Transmission Weight"].default_value = 1.0
before = shown()
bpy.ops.glint.switch_to_glint()
during = shown()
bpy.ops.glint.switch_back()
scene.render.engine = "GLINT"
answer([before, during, shown()])
""",  # noqa: E501 - a script for another Blender
    )
    before, during, plain = got
    assert before == [["glint.switch_to_glint", ""]] and plain == []
    assert during[:2] == [["glint.switch_back", "Back to Cycles"], ["glint.compare_cycles", ""]]
    assert during[2] == ["glint.list_changed", ""]
    assert ["label", "Looks Different"] in during and ["label", "Taken Over"] in during
    assert ["glint.select_changed", ""] in during


def test_the_list_is_made_again_after_edits(tmp_path):
    first, stale, again, settings = answer_of(
        tmp_path,
        """
scene.cycles.use_fast_gi = True
scene.world = scene.world or bpy.data.worlds.new("World")
scene.world.cycles.is_caustics_light = True
bpy.ops.glint.switch_to_glint()
def told():
    return [text for text, _ in rows("DIFFERENT")]
def of_settings():
    return [rows(kind) for kind in ("UNLIKE", "CARRIED", "KEPT")]
first, before = told(), of_settings()
scene.world.cycles.is_caustics_light = False
cube.visible_volume_scatter = False
stale = told()
bpy.ops.glint.list_changed()
answer([first, stale, told(), before == of_settings() and len(before[0]) > 0])
""",
    )
    shadows, media = "Shadow caustics", "Media see"
    assert any(text.startswith(shadows) for text in first) and stale == first
    assert not any(text.startswith(shadows) for text in again)
    assert any(text.startswith(media) for text in again)
    assert settings


def test_a_rolling_shutter_is_in_the_list(tmp_path):
    told = answer_of(
        tmp_path,
        """
scene.render.use_motion_blur = True
scene.cycles.rolling_shutter_type = "TOP"
bpy.ops.glint.switch_to_glint()
answer([text for text, _ in rows("UNLIKE")])
""",
    )
    assert sum("Rolling Shutter" in text for text in told) == 1
