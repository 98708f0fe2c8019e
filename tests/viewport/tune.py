"""How soon Tune Settings shows something of the demo scene, in one window: seconds and processor
seconds from the click to the first plot on the screen.
"""

import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy

import in_window

in_window.LONGEST = 500.0  # a busy machine; processor seconds are what is asked for
window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])


def scenario():
    with window.context():
        bpy.ops.glint.add_demo_scene()
    yield 0.5
    before, began = time.process_time(), time.perf_counter()
    with window.context():
        bpy.ops.glint.measure_scene("INVOKE_DEFAULT")
    image = sys.modules[window.package + ".operators.measure_scene"].IMAGE_NAME
    yield lambda: bpy.data.images.get(image) is not None
    told = {"processor": time.process_time() - before, "seconds": time.perf_counter() - began}
    yield 1.0
    windows = bpy.context.window_manager.windows
    told["windows"] = len(windows)
    with bpy.context.temp_override(window=windows[-1]):
        area = windows[-1].screen.areas[0]
        region = next(region for region in area.regions if region.type == "WINDOW")
        space = area.spaces.active
        told["plot"] = [
            zoom * size / room
            for zoom, size, room in zip(
                space.zoom, space.image.size, (region.width, region.height), strict=True
            )
        ]
        bpy.ops.wm.window_close()
    shown = sys.modules[window.package + ".operators.measure_scene"].last_measurement
    name, first = bpy.context.scene.name, shown(bpy.context.scene.name)
    yield lambda: shown(name) is not first
    yield 0.5
    told["until news"] = time.perf_counter() - began
    told["windows after closing it"] = len(bpy.context.window_manager.windows)
    in_window.answer(told)


in_window.play(scenario, window)
