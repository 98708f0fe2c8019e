"""What the panel and the log tell of a render: what was needed, what was not, what was left out."""

from blender_process import REGISTER_TREE, Blender

SCENE = (
    REGISTER_TREE
    + """
import logging
from glint.addon.render import statistics
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x = scene.render.resolution_y = 16
scene.glint.final.samples = 1
scene.glint.final.backend = "NUMPY"
cube = bpy.data.objects["Cube"]
material = cube.active_material
tree = material.node_tree
principled = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")

def picture(name):
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new(name, 4, 4)
    return node

class Lines(logging.Handler):
    def __init__(self):
        super().__init__()
        self.lines = []
    def emit(self, record):
        self.lines.append(record.getMessage())

log = logging.getLogger("glint.addon.render.final")
log.setLevel(logging.INFO)
lines = Lines()
log.addHandler(lines)

def render():
    lines.lines.clear()
    bpy.ops.render.render()
    last = statistics.of_last_render(scene.name)
    return {"skipped": dict(last.skipped), "sections": last.sections, "log": list(lines.lines), "notes": list(last.notes)}
"""  # noqa: E501 - a script for another Blender
)


def test_what_nothing_reads_is_told(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
plain = render()
cube.data.uv_layers.new(name="Lightmap")
for number in range(6):
    cube.data.color_attributes.new(f"Col{number}", "FLOAT_COLOR", "POINT")
picture("Not linked")
cube.data.materials.append(bpy.data.materials.new("Spare"))
hidden = bpy.data.objects.new("Hidden", cube.data)
scene.collection.objects.link(hidden)
hidden.hide_render = True
more = render()
tree.links.new(picture("Read").outputs["Color"], principled.inputs["Base Color"])
native = statistics.Statistics(1, "NATIVE", {}, stamp={"tracer": "Glint 0.1.0, core interface 73"})
answer([plain, more, render(), native.sections])
"""
    )
    assert run.returncode == 0, run.output
    plain, more, textured, native = run.answer
    assert plain["skipped"] == {"UV maps": "'UVMap'"}
    assert more["skipped"] == {
        "UV maps": "'UVMap', 'Lightmap'",
        "colour attributes": "'Col0', 'Col1', 'Col2', 'Col3' and 2 more",
        "images": "'Not linked'",
        "materials": "'Spare'",
        "hidden objects": "'Hidden'",
    }
    assert (
        textured["skipped"]["UV maps"] == "'Lightmap'"
        and textured["skipped"]["images"] == "'Not linked'"
    )
    assert (
        "Required" in more["sections"]
        and more["sections"]["Not needed, not read"][0] == "UV maps: 'UVMap', 'Lightmap'"
    )
    assert more["sections"]["Required"][-1] == "traced by Python (reference)"
    assert native["Stamp"] == ["tracer: Glint 0.1.0, core interface 73"]
    one_line = [line for line in more["log"] if "12 triangles" in line]
    assert (
        len(one_line) == 1
        and "not needed: UV maps 'UVMap', 'Lightmap'; colour attributes" in one_line[0]
        and "sync" in one_line[0]
    )


def test_what_was_left_out_is_told_with_its_reason(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
dof = scene.camera.data.dof
dof.use_dof, dof.focus_distance = True, 0
blurred = render()
dof.use_dof = False
scene.render.use_motion_blur = True
answer([blurred, render()])
"""
    )
    first, second = run.answer
    assert len(first["notes"]) == 1 and "focused on its own place" in first["notes"][0]
    assert second["notes"] == []


def test_a_file_that_is_loaded_has_no_statistics(tmp_path):
    run = Blender(tmp_path).run(
        SCENE
        + """
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "a.blend"))
loads = {
    "new": lambda: bpy.ops.wm.read_homefile(use_factory_startup=True),
    "file": lambda: bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "a.blend")),
    "revert": lambda: bpy.ops.wm.revert_mainfile(),
}
told = {}
for name, load in loads.items():
    scene = bpy.context.scene
    scene.render.engine, scene.render.resolution_percentage = "GLINT", 10
    bpy.ops.render.render()
    statistics.remember_view(scene.name, ("note",))
    before = statistics.of_last_render(scene.name) is not None
    load()
    name_now = bpy.context.scene.name
    told[name] = [before, statistics.of_last_render(name_now) is None, not statistics.of_views(name_now)]
answer(told)
"""  # noqa: E501 - a script for another Blender
    )
    assert run.answer == dict.fromkeys(("new", "file", "revert"), [True] * 3), run.output


def test_samples_and_memory_are_those_of_the_render(tmp_path):
    """Pixels that converge stop early: how many samples they took is said, and the memory is the
    whole process's.
    """
    run = Blender(tmp_path).run(
        SCENE
        + """
from pathlib import Path
final = scene.glint.final
final.soft_light = "SHARED"  # sixteen times fewer steps of NumPy's
final.samples, final.error_threshold = 64, 0.05
early = render()
mean, most = statistics.of_last_render(scene.name).spent
final.samples, final.error_threshold = 4, 0.0
whole = render()
status = Path("/proc/self/status")
lines = status.read_text().splitlines() if status.exists() else []
resident = next((int(line.split()[1]) * 1024e-6 for line in lines if "VmRSS" in line), 0)
answer([early["sections"], mean, most, whole["sections"], resident])
"""
    )
    early, mean, most, whole, resident = run.answer
    assert 4 <= mean < most <= 64
    assert f"{mean:.1f} samples per pixel on average and {most} at most" in early["Required"]
    assert "4 samples per pixel" in whole["Required"]
    now, highest = (float(line.split()[-2]) for line in whole["Memory of Blender"])
    assert 50 < now <= highest
    if resident:
        assert abs(now - resident) < 0.1 * resident


def test_the_most_memory_is_of_this_render(tmp_path):
    """What another file held before has no part in it, what the render itself held has; megabytes
    are those of Blender's header and of Cycles.
    """
    run = Blender(tmp_path).run(
        SCENE
        + """
import numpy as np
from glint.addon.render import final, memory

def most():
    bpy.ops.render.render()
    return statistics.of_last_render(scene.name).memory[1]

other_file = np.ones(400 << 17)
del other_file
before = most()
render_engine = final.engine.render

def large(*given, on_progress, **more):
    arrays = np.ones(300 << 17)
    on_progress(0.5)
    del arrays
    return render_engine(*given, on_progress=on_progress, **more)

final.engine.render = large
during = most()
final.engine.render = lambda *given, **more: (np.ones(900 << 17), render_engine(*given, **more))[1]
unseen = most()
answer([before, during, unseen, memory.process_megabytes()])
"""
    )
    before, during, unseen, (now, ever) = run.answer
    assert ever > now + 300
    assert before < now + 200, "another file's 400 MB"
    assert 250 < during - before < 350
    assert unseen > before + 700, "nobody looked while it was held"


def test_a_file_of_tiles_says_at_most(tmp_path):
    """Tiles do not know how many samples the frame's pixels took."""
    run = Blender(tmp_path).run(
        SCENE
        + """
from glint.addon.render import final
words = []
stamp = final.Picture.stamp
final.Picture.stamp = lambda picture, title, fields: (words.append(fields["scene"]), stamp(picture, title, fields))
scene.glint.final.soft_light = "SHARED"
for samples, threshold in ((8, 4.0), (1, 0.0)):
    scene.glint.final.samples, scene.glint.final.error_threshold = samples, threshold
    bpy.ops.render.render()
answer(words)
"""  # noqa: E501 - a script for another Blender
    )
    stopping, whole = run.answer
    assert "at most 8 samples per pixel" in stopping.split(", ")
    assert "1 sample per pixel" in whole.split(", ")
