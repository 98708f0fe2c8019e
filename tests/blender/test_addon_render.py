"""How Blender drives the engine: borders, animations, previews, messages."""

import os
import re
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from blender_process import REGISTER_TREE, Blender

DRAW = (
    REGISTER_TREE
    + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 100, 60, 50
scene.glint.final.samples = scene.glint.final.light_samples = 1
scene.glint.final.diffuse_bounces = 0
scene.glint.final.backend = "NATIVE"
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"

def draw(name):
    scene.render.filepath = str(FOLDER / name)
    bpy.ops.render.render(write_still=True)
"""  # noqa: E501 - a script for another Blender
)


def _picture(path) -> np.ndarray:
    return oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)


BORDERS = [
    (0.0, 1.0, 0.0, 1.0),
    (0.2, 0.7, 0.1, 0.6),
    (0.333, 0.667, 0.45, 0.55),
    (0.01, 0.99, 0.99, 1.0),
]


@pytest.fixture(scope="module")
def bordered_pictures(tmp_path_factory):
    """The folder of the whole picture and of two for each border, which one Blender has drawn."""
    blender = Blender(tmp_path_factory.mktemp("borders"))
    run = blender.run(
        DRAW
        + f"""
draw("whole.exr")
scene.render.use_border = True
for number, border in enumerate({BORDERS}):
    for crops in (False, True):
        scene.render.use_crop_to_border = crops
        scene.render.border_min_x, scene.render.border_max_x, scene.render.border_min_y, scene.render.border_max_y = border
        draw(f"{{'crop' if crops else 'border'}}{{number}}.exr")
"""  # noqa: E501 - a script for another Blender
    )
    assert run.returncode == 0, run.output
    return blender.folder


@pytest.mark.parametrize("number", range(len(BORDERS)))
def test_a_border_is_the_same_pixels_cut_out(bordered_pictures, number):
    whole, bordered, crop = (
        _picture(bordered_pictures / f"{name}.exr")
        for name in ("whole", f"border{number}", f"crop{number}")
    )
    assert whole.shape == bordered.shape == (30, 50, 4)
    inside = np.argwhere(bordered[..., 3] > 0)
    (y0, x0), (y1, x1) = inside.min(axis=0), inside.max(axis=0) + 1
    np.testing.assert_array_equal(bordered[y0:y1, x0:x1], whole[y0:y1, x0:x1])
    np.testing.assert_array_equal(crop, whole[y0:y1, x0:x1])


def test_an_animation_with_persistent_data_draws_every_frame_anew(tmp_path):
    """The cube moves: each frame equals the still of that frame drawn without persistent data."""
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
cube = bpy.data.objects["Cube"]
for frame in (1, 3):
    cube.location.x = float(frame)
    cube.keyframe_insert("location", frame=frame)
scene.frame_start, scene.frame_end = 1, 3
scene.render.use_persistent_data = True
scene.render.filepath = str(FOLDER / "frame_")
bpy.ops.render.render(animation=True)
scene.render.use_persistent_data = False
scene.frame_set(3)
draw("still.exr")
"""
    )
    assert run.returncode == 0, run.output
    first, last, still = (
        _picture(tmp_path / name) for name in ("frame_0001.exr", "frame_0003.exr", "still.exr")
    )
    np.testing.assert_array_equal(last, still)
    assert np.abs(first - last).max() > 0.05


def test_many_notes_are_cut_and_counted_and_each_is_told_once(tmp_path):
    run = Blender(tmp_path).run(
        DRAW
        + """
import dataclasses, glint.addon.render.final as final
export = final.export_scene
def noisy(*args, **kwargs):
    done = export(*args, **kwargs)
    return dataclasses.replace(done, notes=tuple(f"oddity {k // 2}" for k in range(60)))
final.export_scene = noisy
draw("notes.exr")
"""
    )
    assert run.returncode == 0, run.output
    told = [line for line in run.output.splitlines() if "oddity" in line]
    assert len(told) == len(set(told)) == 12, run.output
    left_out = int(re.search(r"and (\d+) more notes", run.output).group(1))
    assert left_out >= 30 - 12, "the scene itself may add notes"


def test_no_camera_is_blenders_own_error(tmp_path):
    run = Blender(tmp_path).run(DRAW + "bpy.data.objects.remove(scene.camera)\ndraw('none.exr')\n")
    assert run.returncode == 1
    assert "camera" in run.output.lower()
    assert not (tmp_path / "none.exr").exists()


def test_nothing_to_see_is_said_and_an_object_is_not(tmp_path):
    run = Blender(tmp_path).run(
        DRAW
        + """
def told(**settings):
    for name, value in settings.items():
        setattr(bpy.data.objects["Cube"], name, value)
    print("next", flush=True)
    draw("a.exr")

told()
told(hide_render=True)
told(hide_render=False, visible_camera=False)
"""
    )
    assert ["No object is there" in part for part in run.output.split("next")[1:]] == [
        False,
        True,
        True,
    ], run.output


def test_a_black_picture_says_why(tmp_path):
    """Not with a world, which is grey, nor with a lamp."""
    run = Blender(tmp_path).run(
        DRAW
        + """
bpy.data.objects.remove(bpy.data.objects["Light"])
scene.world = None
draw("dark.exr")
print("next", flush=True)
scene.world = bpy.data.worlds.new("World")
draw("grey.exr")
print("next", flush=True)
scene.world = None
scene.collection.objects.link(bpy.data.objects.new("lamp", bpy.data.lights.new("lamp", "POINT")))
draw("lit.exr")
"""
    )
    assert run.returncode == 0, run.output
    said = ["has no light and a black world" in part for part in run.output.split("next")]
    assert said == [True, False, False]


def test_nothing_that_ends_a_render_leaves_a_picture(tmp_path):
    """Ctrl-C (twice, as people press it) while tracing, after it and while reading; an exit; an
    error.
    """
    run = Blender(tmp_path).run(
        DRAW
        + """
import gc, os, signal
import glint.addon.render.final as final
signal.signal(signal.SIGINT, signal.default_int_handler)
true = {"export_scene": final.export_scene, "_trace": final._trace, "_finish": final._finish}

def interrupt():
    os.kill(os.getpid(), signal.SIGINT)
    os.kill(os.getpid(), signal.SIGINT)

def raising(error):
    def broken(*arguments, **options):
        raise error
    return broken

def pressing(name):
    def pressed(*arguments, **options):
        interrupt()
        return true[name](*arguments, **options)
    return pressed

ends = {
    "traced": ("_trace", pressing("_trace")),
    "written": ("_finish", pressing("_finish")),
    "read": ("export_scene", raising(KeyboardInterrupt())),
    "exit": ("_trace", raising(SystemExit(0))),
    "error": ("_trace", raising(ValueError("broken on purpose"))),
}
told = {}
for file_format in ("PNG", "OPEN_EXR"):
    scene.render.image_settings.file_format = file_format
    for end, (name, function) in ends.items():
        setattr(final, name, function)
        try:
            told[end] = str(draw(f"{file_format}_{end}"))
        except RuntimeError as error:
            told[end] = str(error).strip()
        setattr(final, name, true[name])
draw("whole")
ends.clear()
gc.collect()  # errors hold engines that Blender has freed
answer(told)
"""
    )
    assert run.returncode == 0, run.output
    interrupted = "Error: Glint was interrupted: there is no picture"
    assert [run.answer[end] for end in ("traced", "written", "read")] == [interrupted] * 3
    assert "SystemExit" in run.answer["exit"] and "broken on purpose" in run.answer["error"]
    assert [path.name for path in tmp_path.glob("*.*") if path.suffix in (".png", ".exr")] == [
        "whole.exr"
    ]
    assert "Exception ignored" not in run.output


def test_a_thread_that_does_not_start_is_told_as_what_it_is(tmp_path):
    run = Blender(tmp_path).run(
        DRAW
        + """
from glint import engine
def refused(*_, **__):
    raise RuntimeError("can't start new thread")
engine.render = refused
draw("none.exr")
"""
    )
    assert run.returncode == 1 and not (tmp_path / "none.exr").exists()
    assert (
        "Error: Glint ran out of memory: the system starts no further thread: close programs"
        in run.output
    )


@pytest.mark.parametrize(("name", "file_format"), [("SIGINT", "OPEN_EXR"), ("SIGTERM", "PNG")])
def test_a_signal_from_outside_ends_the_program_without_a_picture(tmp_path, name, file_format):
    """While the core traces: nothing of Python runs then but what the engine lets."""
    program = (
        DRAW
        + f"""
import signal
import glint.addon.render.final as final
signal.signal(signal.SIGINT, signal.default_int_handler)
trace = final._trace

def tracing(*arguments, **options):
    (FOLDER / "begun").touch()
    return trace(*arguments, **options)

final._trace = tracing
scene.render.image_settings.file_format = {file_format!r}
scene.glint.final.backend = "NATIVE"
scene.glint.final.samples, scene.glint.final.error_threshold = 65536, 0
scene.render.resolution_x = scene.render.resolution_y = 4000
draw("picture")
"""
    )
    blender = Blender(tmp_path)
    with ThreadPoolExecutor() as pool:
        running = pool.submit(blender.run, program, timeout=60)
        begun = blender.folder / "begun"
        while not begun.exists() and not running.done():
            time.sleep(0.05)
        time.sleep(0.5)
        found = [p for p in Path("/proc").glob("[0-9]*") if _runs(p, blender.folder)]
        for process in found:
            os.kill(int(process.name), getattr(signal, name))
        run = running.result()
    assert found, run.output
    assert run.returncode not in (0, -signal.SIGSEGV, -signal.SIGABRT), run.output
    assert not list(blender.folder.glob("picture*"))


def _runs(process: Path, folder: Path) -> bool:
    """Whether its command line names the folder."""
    try:
        return str(folder) in (process / "cmdline").read_text()
    except OSError:
        return False


def test_what_moves_blurs_in_a_render_and_the_frame_stays(tmp_path):
    """The cube of the factory's file slides; in a second render it stands still."""
    blender = Blender(tmp_path)
    run = blender.run(
        DRAW
        + """
cube = bpy.data.objects["Cube"]
for frame, x in ((1, -2.0), (3, 2.0)):
    cube.location.x = x
    cube.keyframe_insert("location", frame=frame)
scene.frame_set(2)
scene.glint.final.samples, scene.glint.final.backend = 16, "NATIVE"
scene.glint.final.soft_light = "SHARED"  # even light, by which the cube is told from the world
scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 1.0
draw("moving.exr")
print("stands at", scene.frame_current_final)
cube.cycles.use_motion_blur = False
draw("still.exr")
"""
    )
    moving, still = (_picture(tmp_path / name) for name in ("moving.exr", "still.exr"))
    assert "stands at 2.0" in run.output
    # the cube before the grey world, of which it covers more while it slides
    covered = [
        np.count_nonzero(np.abs(p - p[0, 0])[..., :3].max(-1) > 0.005) for p in (moving, still)
    ]
    assert covered[0] > 1.5 * covered[1] > 0
    assert 0.8 < moving[..., :3].sum() / still[..., :3].sum() < 1.25
