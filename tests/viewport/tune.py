"""How soon Tune Settings shows something of the demo scene, in one window: seconds and processor
seconds from the click to the first plot on the screen, and the processor seconds of a render.
"""

import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy

import in_window

in_window.LONGEST = 500.0  # a busy machine; processor seconds are what is asked for
window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])


def share(window):
    """Of an image editor's longer side, that its picture takes."""
    return share_of_zoom(window, window.screen.areas[0].spaces.active.zoom_percentage / 100)


def share_of_zoom(window, zoom):
    area = window.screen.areas[0]
    region = next(region for region in area.regions if region.type == "WINDOW")
    size = area.spaces.active.image.size
    return zoom * max(size[0] / region.width, size[1] / region.height)


def scenario():
    with window.context():
        bpy.ops.glint.add_demo_scene()
    yield 0.5
    percent = 25
    bpy.context.scene.render.resolution_percentage = percent
    before = time.process_time()
    with window.context():
        bpy.ops.render.render()
    render = (time.process_time() - before) / (percent / 100) ** 2
    bpy.context.scene.render.resolution_percentage = 100
    yield 0.5
    before, began = time.process_time(), time.perf_counter()
    with window.context():
        bpy.ops.glint.measure_scene("INVOKE_DEFAULT")
    image = sys.modules[window.package + ".operators.measure_scene"].IMAGE_NAME
    windows = bpy.context.window_manager.windows
    # the window opens once the operator has let go of its event
    yield lambda: bpy.data.images.get(image) is not None and len(windows) > 1
    told = {
        "processor": time.process_time() - before,
        "seconds": time.perf_counter() - began,
        "render": render,
    }
    told["windows"] = len(windows)
    yield lambda: share(windows[-1]) != share_of_zoom(windows[-1], 1.0)
    told["plot"] = share(windows[-1])
    with bpy.context.temp_override(window=windows[-1]):
        bpy.ops.wm.window_close()
    running = windows[0].modal_operators
    next(iter(running))._background.stop()
    yield lambda: not len(running)
    yield 0.5
    told["windows after closing it"] = len(windows)
    in_window.answer(told)


in_window.play(scenario, window)
