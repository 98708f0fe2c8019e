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


def scenario():
    with window.context():
        bpy.ops.glint.add_demo_scene()
    yield 0.5
    percent = 50
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
    yield lambda: bpy.data.images.get(image) is not None
    in_window.answer(
        {
            "processor": time.process_time() - before,
            "seconds": time.perf_counter() - began,
            "render": render,
        }
    )


in_window.play(scenario, window)
