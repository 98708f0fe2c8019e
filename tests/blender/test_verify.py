"""The reproducibility stamp: in the files, verified, and a liar found out."""

import json
import re

import numpy as np
import OpenImageIO as oiio
import pytest

from blender_process import COMPOSITOR, REGISTER_TREE, Blender

SET_UP = """
from glint.operators import command_line
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 24, 16, 100
scene.glint.final.samples = scene.glint.final.light_samples = 1
scene.glint.final.backend = "NATIVE"
cube = bpy.data.objects["Cube"]
cube.keyframe_insert("location", frame=1)
cube.location.x = 1.0
cube.keyframe_insert("location", frame=3)
image = scene.render.image_settings

def draw(name, kind, depth="32", frame=3, subframe=0.0):
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE" if "MULTI" in kind else "IMAGE"
    image.file_format, image.color_depth = kind, depth
    scene.frame_set(frame, subframe=subframe)
    scene.render.filepath = str(FOLDER / name)
    bpy.ops.render.render(write_still=True)

def save(name):
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / name))
    return str(FOLDER / name)

def verify(*names):
    return command_line.run(["verify", *(str(FOLDER / name) for name in names)])
"""  # noqa: E501 - a script for another Blender
MAKE = REGISTER_TREE + SET_UP
KINDS = [
    ("a.exr", "OPEN_EXR", "32"),
    ("a.exr", "OPEN_EXR", "16"),
    ("a.exr", "OPEN_EXR_MULTILAYER", "32"),
    ("a.png", "PNG", "8"),
    ("a.png", "PNG", "16"),
]


@pytest.fixture(scope="module")
def verified(tmp_path_factory):
    """The answers and what was told of each of `KINDS`, in one Blender."""
    run = Blender(tmp_path_factory.mktemp("kinds")).run(
        REGISTER_TREE
        + f"""
answers = []
for name, kind, depth in {KINDS!r}:
    exec({SET_UP!r})
    print("NEXT", flush=True)
    save("a.blend")
    draw(name, kind, depth)
    scene.frame_set(1)
    save("a.blend")
    same = verify(name)
    bpy.context.scene.glint.final.samples = 2
    bpy.data.objects["Light"].data.energy *= 1.01
    save("b.blend")
    answers.append([same, verify(name, "b.blend")])
answer(answers)
"""
    )
    assert run.returncode == 0, run.output
    return list(zip(run.answer, run.output.split("NEXT")[1:], strict=True))


@pytest.mark.parametrize("number", range(len(KINDS)), ids=map("-".join, KINDS))
def test_the_same_picture_is_the_same_and_another_is_not(verified, number):
    """Frame 3 from a file that is saved at frame 1, without saying which file it was."""
    answer, told = verified[number]
    assert answer == [0, 1]
    assert "the settings changed: samples 1 → 2" in told and "the scene changed" in told
    assert "pixels differ, in columns" in told and told.count("other bits") == 1


def test_a_picture_between_two_frames_is_verified(tmp_path):
    run = Blender(tmp_path).run(
        MAKE
        + """
save("a.blend")
draw("a.exr", "OPEN_EXR", frame=1, subframe=0.3)
scene.frame_set(1)
save("a.blend")
answer(verify("a.exr"))
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == 0, run.output


def test_views_are_verified(tmp_path):
    """A file for each eye, and one for both."""
    run = Blender(tmp_path).run(
        MAKE
        + """
save("a.blend")
scene.render.use_multiview, image.views_format = True, "INDIVIDUAL"
draw("eye", "OPEN_EXR")
save("a.blend")
eyes = [verify("eye_L.exr"), verify("eye_R.exr")]
scene = bpy.context.scene
image = scene.render.image_settings
image.views_format = "STEREO_3D"
draw("both.png", "PNG", "8")
save("a.blend")
both = verify("both.png")
bpy.context.scene.camera.data.stereo.interocular_distance = 0.5
save("b.blend")
answer([*eyes, both, verify("both.png", "b.blend")])
"""
    )
    assert run.returncode == 0, run.output
    assert run.answer == [0, 0, 0, 1], run.output
    assert "ViewLayer.left: the same bits" in run.output
    assert "ViewLayer.right: other bits" in run.output


def test_where_a_file_was_changed_is_told(tmp_path):
    """One pixel painted over: the hashes agree, the file does not."""
    blender = Blender(tmp_path)
    made = blender.run(MAKE + 'save("a.blend")\ndraw("a.exr", "OPEN_EXR")\nsave("a.blend")')
    assert made.returncode == 0, made.output
    buffer = oiio.ImageBuf(str(tmp_path / "a.exr"))
    spec, pixels = buffer.spec(), buffer.get_pixels(oiio.FLOAT)
    pixels[4, 7, 1] += 0.5
    forged = oiio.ImageOutput.create(str(tmp_path / "forged.exr"))
    forged.open(str(tmp_path / "forged.exr"), spec)
    forged.write_image(np.ascontiguousarray(pixels))
    forged.close()
    run = blender.run(
        MAKE + 'answer([verify("a.exr", "a.blend"), verify("forged.exr", "a.blend")])'
    )
    assert run.answer == [0, 1], run.output
    assert (
        "1 of 384 pixels differ, in columns 7 to 7, rows 11 to 11 from the bottom, by up to 0.5"
        in run.output
    )
    assert "the same bits in every pass" in run.output.split("1 of 384")[0].splitlines()[-2]


def test_the_stamp_depends_on_the_picture_and_not_on_threads(tmp_path):
    run = Blender(tmp_path).run(
        MAKE
        + """
from glint.addon.render import statistics
stamps = []
for threads, samples, place in ((1, 1, 0.0), (2, 1, 0.0), (1, 2, 0.0), (1, 1, 0.25)):
    scene.glint.final.threads, scene.glint.final.samples = threads, samples
    bpy.data.objects["Light"].location.x = place
    bpy.ops.render.render()
    stamps.append(statistics.of_last_render(scene.name).stamp)
answer(stamps)
"""
    )
    one, threads, samples, moved = run.answer
    assert one == threads
    assert {field for field in one if one[field] != samples[field]} == {"pixels", "settings"}
    assert {field for field in one if one[field] != moved[field]} == {"pixels", "geometry"}
    assert json.loads(one["settings"])["samples"] == 1


def test_what_has_no_stamp_cannot_be_verified(tmp_path):
    (tmp_path / "text.exr").write_text("not a picture")
    (tmp_path / "cut.png").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\x05tEXtab")
    run = Blender(tmp_path).run(
        MAKE
        + """
blend = save("a.blend")
scene.render.engine = "CYCLES"
scene.cycles.samples = 1
draw("cycles.png", "PNG", "8")
answer([verify(name, "a.blend") for name in ("text.exr", "cut.png", "cycles.png", "none.png")])
"""
    )
    assert run.answer == [2, 2, 2, 2], run.output
    assert "neither OpenEXR nor PNG" in run.output and "carries no stamp" in run.output


FORGED = [
    ("settings", "[1]"),
    ("settings", "nothing"),
    ("settings", "[" * 100_000),
    ("frame", "two"),
    ("frame", "9" * 30),
]


def test_a_forged_stamp_gets_a_sentence(tmp_path):
    blender = Blender(tmp_path)
    made = blender.run(MAKE + 'save("a.blend")\ndraw("a.exr", "OPEN_EXR")')
    assert made.returncode == 0, made.output
    for number, (field, text) in enumerate(FORGED):
        buffer = oiio.ImageBuf(str(tmp_path / "a.exr"))
        buffer.specmod().attribute(f"glint.ViewLayer.{field}", text)
        assert buffer.write(str(tmp_path / f"forged{number}.exr"))
    run = blender.run(
        MAKE + f'answer([verify(f"forged{{k}}.exr", "a.blend") for k in range({len(FORGED)})])'
    )
    assert run.answer == [2] * len(FORGED), run.output
    assert run.output.count("carries a stamp that no render wrote") == len(FORGED)


HOSTILE = (
    COMPOSITOR
    + """
scene.render.use_compositing = True
layers = tree.nodes.new("CompositorNodeRLayers")
tree.links.new(layers.outputs["Image"], output.inputs["Image"])
files = tree.nodes.new("CompositorNodeOutputFile")
if hasattr(files, "directory"):
    files.directory, files.file_name = str(FOLDER / "written"), "delivery"
    files.file_output_items.new("RGBA", "Image")
else:
    files.base_path = str(FOLDER / "written")
tree.links.new(layers.outputs["Image"], files.inputs[0])
text = bpy.data.texts.new("start.py")
text.use_module = True
text.write(f"open({str(FOLDER / 'ran')!r}, 'w').close()")
driver = cube.driver_add("location", 2).driver
driver.type = "SCRIPTED"
driver.expression = f"[open({str(FOLDER / 'drove')!r}, 'w').close(), 0.25][1]"
style = bpy.data.texts.new("style.py")
style.write(f"open({str(FOLDER / 'styled')!r}, 'w').close()")
freestyle = bpy.context.view_layer.freestyle_settings
freestyle.mode = "SCRIPT"
freestyle.modules.new().script = style
bpy.context.preferences.filepaths.use_scripts_auto_execute = True

def done():
    names = [name for name in ("written", "ran", "drove", "styled") if (FOLDER / name).exists()]
    for name in names:
        path = FOLDER / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return names
"""
)


@pytest.mark.parametrize("freestyle", [False, True])
def test_commands_that_look_run_nothing_of_a_file(tmp_path, freestyle):
    """Compositor, scripts, drivers and Freestyle of a file that may come from anybody."""
    run = Blender(tmp_path).run(
        MAKE
        + HOSTILE
        + f"""
import shutil
scene.render.use_freestyle = {freestyle}
draw("a.exr", "OPEN_EXR")
blend = save("a.blend")
by_render = done()
codes = [verify("a.exr", "a.blend")]
codes += [command_line.run(["compare", blend, "--out", str(FOLDER / "out"), "--samples", "1"])]
codes += [command_line.run(["measure", blend, "--squares", "1", "--side", "4", "--repeats", "1",
                            "--reference-samples", "1", "--samples", "1"])]
by_commands = done()
codes += [command_line.run(["verify", str(FOLDER / "a.exr"), blend, "--scripts"])]
by_scripts = done()
frames = ["frames", blend, "1", "--out", str(FOLDER / "frames")]
codes += [command_line.run(frames)]
by_frames = done()
codes += [command_line.run([*frames, "--check"])]
by_check = done()
codes += [command_line.run([*frames, "--check", "--scripts"])]
answer([by_render, codes, by_commands, by_scripts, by_frames, by_check, done()])
"""
    )
    by_render, codes, by_commands, by_scripts, by_frames, by_check, by_check_scripts = run.answer
    assert "written" in by_render and "written" in by_frames
    assert by_commands == by_check == []
    assert codes == [1, 0, 0, 0, 0, 1, 0], run.output
    assert by_scripts == by_check_scripts == ["ran", "drove"]
    # drivers are tried by other threads: Blender tells whichever of the two it refused first
    told = re.findall(r"the file's (Text|Driver) '(.*)' did not run, nor others", run.output)
    assert ("Text", "start.py") in told or any(
        kind == "Driver" and name.startswith("[open(") for kind, name in told
    ), run.output
    assert "add --scripts where you trust the file" in run.output


def test_what_a_compositor_adds_is_told_and_not_called_a_difference(tmp_path):
    run = Blender(tmp_path).run(
        MAKE
        + COMPOSITOR
        + """
scene.render.use_compositing = True
layers = tree.nodes.new("CompositorNodeRLayers")
invert = tree.nodes.new("CompositorNodeInvert")
tree.links.new(layers.outputs["Image"], invert.inputs["Color"])
tree.links.new(invert.outputs["Color"], output.inputs["Image"])
draw("a.exr", "OPEN_EXR")
save("a.blend")
answer(verify("a.exr", "a.blend"))
"""
    )
    assert run.answer == 0, run.output
    assert "do not run here, so the hashes alone were compared" in run.output
