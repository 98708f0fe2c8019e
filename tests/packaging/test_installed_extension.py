"""Both editions, installed from their zips in a Blender of their own: they render, and they fail
loudly.
"""

import os
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from blender_process import ROOT
from packed import ENABLE

SCENE = """
def small_scene():
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 64, 48, 100
    scene.glint.final.samples = scene.glint.final.light_samples = 1
    return scene

def output(scene, name, file_format):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE" if "MULTILAYER" in file_format else "IMAGE"
    settings.file_format = file_format
    if "EXR" in file_format:
        settings.color_depth = "32"
    scene.render.filepath = str(FOLDER / name)

scene = small_scene()
"""  # noqa: E501 - a script for another Blender
FORMATS = {"PNG": "picture.png", "OPEN_EXR": "picture.exr", "OPEN_EXR_MULTILAYER": "layers.exr"}


def _pixels(path: Path) -> np.ndarray:
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)


@pytest.fixture(scope="module")
def pictures(installed):
    """Edition → (run, Blender) of one render to PNG and EXR."""
    made = {}
    for edition in ("full", "python"):
        blender = installed(edition)
        made[edition] = (
            blender.run(
                ENABLE
                + SCENE
                + """
for file_format, name in (("PNG", "picture.png"), ("OPEN_EXR", "picture.exr")):
    output(scene, name, file_format)
    bpy.ops.render.render(write_still=True)
engine = sys.modules["bl_ext.user_default.glint.engine"]
core = sys.modules.get("glint_core")
answer({"backends": engine.available_backends(), "core": core.__file__ if core else ""})
"""
            ),
            blender,
        )
    return made


@pytest.mark.parametrize("edition", ["full", "python"])
def test_an_edition_renders_png_and_exr(pictures, edition):
    run, blender = pictures[edition]
    assert run.returncode == 0, run.output
    for name in ("picture.png", "picture.exr"):
        pixels = _pixels(blender.folder / name)
        assert pixels.shape[:2] == (48, 64)
        assert np.isfinite(pixels).all()
        assert pixels[..., :3].std() > 0.01, "the cube must stand out from its background"


def test_the_full_edition_traces_with_the_core_of_its_own_wheel(pictures):
    run, blender = pictures["full"]
    assert run.answer["backends"] == ["NATIVE", "NUMPY"], run.output
    assert run.answer["core"].startswith(blender.inside(blender.folder)), (
        "the core came from somewhere else"
    )
    assert "NumPy tracer" not in run.output


def test_the_python_edition_says_once_per_render_that_numpy_traces(pictures):
    run, _ = pictures["python"]
    assert run.answer["backends"] == ["NUMPY"]
    assert run.output.count("the NumPy tracer renders") == 2, run.output


def test_both_editions_draw_the_same_picture(pictures):
    """float32 tracing against float64: 1e-4 of the radiance, and no pixel that sees something
    else.
    """
    full, python = (
        _pixels(pictures[edition][1].folder / "picture.exr") for edition in ("full", "python")
    )
    np.testing.assert_allclose(full, python, rtol=1e-4, atol=1e-6)


# where it breaks → a statement that breaks it
BREAKS = {
    "export": "final.export_scene = broken",
    "trace": "final.engine.render = broken",
    "result": "sys.modules[final.Picture.__module__]._fill_passes = broken",
    "statistics": "final.remember = broken",
}


@pytest.mark.parametrize(
    ("place", "file_format"),
    [
        pytest.param(
            place, name, marks=() if place == "result" or name == "PNG" else pytest.mark.slow
        )
        for place in BREAKS
        for name in FORMATS
    ],
)
def test_an_error_writes_no_file_and_fails_with_a_message(installed, place, file_format):
    blender = installed("python")
    name = f"{place}-{FORMATS[file_format]}"
    run = blender.run(
        ENABLE
        + SCENE
        + f"""
final = sys.modules["bl_ext.user_default.glint.addon.render.final"]
def broken(*args, **kwargs):
    raise ValueError("broken on purpose")
{BREAKS[place]}
scene.glint.final.diffuse_bounces = 0
output(scene, {name!r}, {file_format!r})
bpy.ops.render.render(write_still=True)
"""
    )
    assert run.returncode == 1, run.output
    assert not (blender.folder / name).exists(), "a picture was saved although the render failed"
    assert "Error: Glint failed (ValueError): broken on purpose" in run.output
    assert "Traceback" in run.output


@pytest.mark.skipif("GLINT_BLENDER" in os.environ, reason="`make render` starts bpy")
def test_make_render_looks_at_what_was_written(installed):
    """No file may be longer than some bytes: a full disk, of which Blender says that it saved the
    picture.
    """
    blender = installed("python")
    run = blender.run(
        ENABLE
        + SCENE
        + f"""
import resource, signal
sys.path.insert(0, {str(ROOT / "packaging")!r})
import render_scene, tree
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (1500, resource.RLIM_INFINITY))
tree.main(lambda: render_scene._write_pictures(scene, FOLDER / "full.exr", FOLDER / "full.png") and 0)
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 1, run.output
    assert (
        "the picture was rendered, but not written" in run.output
        and "full.exr is not whole" in run.output
    )


WRONG = {
    "no layer": ("layers.blend", "", "out", "none of its view layers is rendered"),
    "strips": ("strips.blend", "", "out", "Blender did not ask Glint for a picture"),
    "a file for a folder": ("good.blend", "", "good.blend", "there can be no folder"),
    "a folder for a file": ("good.blend", "", "taken", "good.exr cannot be replaced"),
    "a word for a frame": ("good.blend", "x", "out", "FRAME=x: use a whole number"),
    "a frame too far": ("good.blend", "5000000", "out", "FRAME=5000000: use a whole number"),
    "no file": ("none.blend", "", "out", "there is no such file"),
}
"""Scene, frame and folder that are wrong, and what is said of it."""


@pytest.mark.skipif("GLINT_BLENDER" in os.environ, reason="`make render` starts bpy")
def test_make_render_refuses_with_a_sentence(installed):
    """Blender crashes without a view layer, and makes pictures of strips by itself."""
    blender = installed("python")
    run = blender.run(
        ENABLE
        + SCENE
        + f"""
import argparse, contextlib, io
sys.path.insert(0, {str(ROOT / "packaging")!r})
import render_scene, tree
def save(name):
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / name))
save("good.blend")
scene.view_layers[0].use = False
save("layers.blend")
scene.view_layers[0].use = True
editor = scene.sequence_editor_create()
strips = editor.strips if hasattr(editor, "strips") else editor.sequences
end = {{"length": 9}} if bpy.app.version >= (5, 0) else {{"frame_end": 9}}
strips.new_effect(name="red", type="COLOR", channel=1, frame_start=1, **end)
save("strips.blend")
(FOLDER / "taken" / "good.exr").mkdir(parents=True)
told = {{}}
for title, (name, frame, out, _) in {WRONG!r}.items():
    options = argparse.Namespace(scene=str(FOLDER / name), frame=frame, out=str(FOLDER / out))
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        try:
            tree.main(lambda: render_scene._render(options))
        except SystemExit as end:
            told[title] = (end.code, said.getvalue())
answer(told)
"""
    )
    assert run.returncode == 0, run.output
    for title, (code, said) in run.answer.items():
        assert code == 1 and WRONG[title][-1] in said and "picture " not in said, (title, said)
    assert run.answer.keys() == WRONG.keys()
