"""What only a whole Blender program has: its command line, its exit codes, its windows. `make
test-blenders` runs these in Debian's.
"""

import os
import signal
import subprocess
import time

import pytest

from blender_process import finish
from packed import ENABLE
from test_installed_extension import SCENE

pytestmark = pytest.mark.skipif(
    not os.environ.get("GLINT_BLENDER"),
    reason="needs a whole Blender program: GLINT_BLENDER names one",
)

BREAK = """
import sys
import bl_ext.user_default.glint.addon.render.final as final
def broken(*args, **kwargs):
    raise ValueError("broken on purpose")
final.export_scene = broken
"""

# Renders for long, and leaves a file once it traces.
TELL = """
import bpy, pathlib
import bl_ext.user_default.glint.addon.render.final as final
trace = final._trace
def tracing(*arguments, **options):
    pathlib.Path({begun!r}).touch()
    return trace(*arguments, **options)
final._trace = tracing
scene = bpy.context.scene
scene.glint.final.samples, scene.glint.final.error_threshold = 65536, 0
scene.render.resolution_x = scene.render.resolution_y = 1000
"""

# Visits the tabs of the Properties editor with each kind of light, Rendered shading, F12 and the
# demo, then quits.
USE_THE_WINDOWS = """
import bpy, sys, traceback

bpy.context.preferences.view.show_splash = False
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.glint")
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_x = scene.render.resolution_y = 64
scene.glint.final.samples = 2

def area(kind):
    return next(area for area in bpy.context.window_manager.windows[0].screen.areas if area.type == kind)

def visit(tab, name="Cube"):
    bpy.context.view_layer.objects.active = bpy.data.objects[name]
    area("PROPERTIES").spaces[0].context = tab
    area("PROPERTIES").tag_redraw()

def light(kind):
    bpy.data.lights["Light"].type = kind
    visit("DATA", "Light")

def shade(kind):
    area("VIEW_3D").spaces[0].shading.type = kind

def finish():
    print("ALL STEPS DONE", flush=True)
    bpy.ops.wm.quit_blender()

steps = [lambda tab=tab: visit(tab) for tab in ("RENDER", "OUTPUT", "VIEW_LAYER", "SCENE", "WORLD", "OBJECT", "MATERIAL")]
steps += [lambda kind=kind: light(kind) for kind in ("POINT", "SUN", "SPOT", "AREA")]
steps += [lambda: visit("DATA", "Camera"), lambda: shade("RENDERED"), lambda: shade("SOLID")]
steps += [lambda: bpy.ops.render.render("INVOKE_DEFAULT"), lambda: None, lambda: bpy.ops.glint.add_demo_scene(), finish]

def tick():
    try:
        steps.pop(0)()
    except Exception:
        traceback.print_exc()
        finish()
    return 0.7 if steps else None

bpy.app.timers.register(tick, first_interval=1.0)
"""  # noqa: E501 - a script for another Blender


@pytest.fixture(scope="module")
def blender(installed):
    return installed("python")


@pytest.fixture(scope="module")
def scene_file(blender) -> str:
    """A small .blend file as the Blender sees it."""
    run = blender.run(
        ENABLE + SCENE + 'bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "small.blend"))\n'
    )
    assert run.returncode == 0, run.output
    return blender.inside(blender.folder / "small.blend")


def _render(blender, scene_file: str, name: str, file_format: str, *options: str):
    output = blender.inside(blender.folder / name) + "_####"
    return blender.start(
        [
            *blender.program,
            "-b",
            scene_file,
            *options,
            "-E",
            "GLINT",
            "-o",
            output,
            "-F",
            file_format,
            "-f",
            "1",
        ]
    )


@pytest.mark.parametrize(("file_format", "suffix"), [("PNG", "png"), ("OPEN_EXR", "exr")])
def test_the_command_line_renders(blender, scene_file, file_format, suffix):
    run = _render(blender, scene_file, "good", file_format)
    assert run.returncode == 0, run.output
    assert (blender.folder / f"good_0001.{suffix}").stat().st_size > 1000


@pytest.mark.parametrize(
    ("file_format", "suffix"), [("PNG", "png"), ("OPEN_EXR", "exr"), ("OPEN_EXR_MULTILAYER", "exr")]
)
def test_an_error_gives_exit_code_1_and_no_file(blender, scene_file, file_format, suffix):
    patch = blender.folder / "break.py"
    patch.write_text(BREAK)
    run = _render(
        blender, scene_file, f"bad_{file_format}", file_format, "-P", blender.inside(patch)
    )
    assert run.returncode == 1, run.output
    assert not (blender.folder / f"bad_{file_format}_0001.{suffix}").exists()
    assert "Glint failed (ValueError): broken on purpose" in run.output


@pytest.mark.parametrize("file_format", ["PNG", "OPEN_EXR", "OPEN_EXR_MULTILAYER"])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_leaves_no_picture(blender, scene_file, name, file_format):
    begun = blender.folder / f"begun_{name}_{file_format}"
    patch = blender.folder / "tell.py"
    patch.write_text(TELL.format(begun=blender.inside(begun)))
    output = blender.folder / f"stopped_{name}_{file_format}"
    command = [*blender.program, "-b", scene_file, "-P", blender.inside(patch), "-E", "GLINT"]
    process = blender.launch(
        [*command, "-o", blender.inside(output) + "_####", "-F", file_format, "-f", "1"]
    )
    while not begun.exists() and process.poll() is None:
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(getattr(signal, name))  # `chroot` has become the program
    run = finish(process, timeout=120)
    assert begun.exists(), run.output
    expected = 1 if name == "SIGINT" else -signal.SIGTERM
    assert run.returncode == expected, run.output
    assert not list(blender.folder.glob(f"{output.name}*"))


def test_the_command_says_what_is_installed(blender):
    run = blender.start([*blender.program, "-b", "--command", "glint", "info"])
    assert run.returncode == 0, run.output
    values = dict(
        line.split(maxsplit=1)
        for line in run.output.splitlines()
        if line.startswith(("version ", "edition ", "tracers "))
    )
    assert values.keys() == {"version", "edition", "tracers"}, run.output
    assert (values["edition"], values["tracers"]) == ("pure Python", "NUMPY")


def test_the_windows_draw_without_an_error(blender):
    """Panels, viewport and F12 on a virtual screen."""
    script = blender.folder / "windows.py"
    script.write_text(USE_THE_WINDOWS)
    host = blender.program[:-1]
    screen = subprocess.Popen(
        [*host, "Xvfb", ":78", "-screen", "0", "1280x800x24"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        time.sleep(2)
        command = [
            *host,
            "env",
            "DISPLAY=:78",
            "LIBGL_ALWAYS_SOFTWARE=1",
            blender.program[-1],
            "-P",
            blender.inside(script),
        ]
        run = blender.start(command, timeout=180)
    finally:
        screen.terminate()
        screen.wait()
    assert "ALL STEPS DONE" in run.output, run.output
    assert "Traceback" not in run.output, run.output
    assert "Error" not in run.output, run.output
