"""Compare with Cycles and Tune Settings end as operators, however they end: called off in the
dialog, stopped by Esc in either window, done, and done again.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy

import in_window

in_window.LONGEST = 300.0
window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])
PICTURE = "Glint and Cycles"


def running():
    manager = bpy.context.window_manager
    return [operator.bl_idname for each in manager.windows for operator in each.modal_operators]


def escape(number):
    """Press it in the middle of a window."""
    pressed = bpy.context.window_manager.windows[number]
    place = {"x": pressed.width // 2, "y": pressed.height // 2}
    pressed.event_simulate("MOUSEMOVE", "NOTHING", **place)
    pressed.event_simulate("ESC", "PRESS", **place)
    pressed.event_simulate("ESC", "RELEASE", **place)


def compare():
    """As after OK in its dialog."""
    module = sys.modules[window.package + ".operators.compare_cycles"]
    module.GLINT_OT_compare_cycles._with_window = True
    with window.context():
        bpy.ops.glint.compare_cycles("EXEC_DEFAULT", samples=4, side=48, full_light=False)


def scenario():
    told = {}
    bpy.context.scene.render.resolution_percentage = 10
    with window.context():
        bpy.ops.glint.compare_cycles("INVOKE_DEFAULT")
    yield 0.5
    escape(0)
    yield 0.5
    compare()
    escape(0)
    yield lambda: not running()
    told["stopped"] = PICTURE not in bpy.data.images
    for name in ("once", "twice"):
        compare()
        yield lambda: PICTURE in bpy.data.images and not running()
        yield 1.0
        told[name] = [len(bpy.context.window_manager.windows), running()]
        bpy.data.images.remove(bpy.data.images[PICTURE])
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[1]):
        bpy.ops.wm.window_close()
    with window.context():
        bpy.ops.glint.measure_scene("INVOKE_DEFAULT")
    yield lambda: len(bpy.context.window_manager.windows) == 2
    yield 0.5
    told["measures"] = running()
    escape(1)
    yield lambda: not running()
    module = sys.modules[window.package + ".operators.measure_scene"]
    told["whole"] = module.last_measurement(bpy.context.scene.name).complete
    in_window.answer(told)


in_window.play(scenario, window)
