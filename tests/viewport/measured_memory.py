"""Runs inside a Blender with a window: shows or renders a million triangles, or shows a ready
picture; answers when it began to.

Without overlays: to draw them over a million triangles a software rasteriser takes 50 to 80 MB for
the moment of each redraw. That would hide what Glint takes, in every run another part of it.
"""

import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy

import control_engine
import in_window
import measured_scenes

folder, job = sys.argv[sys.argv.index("--") + 1 :]
control_engine.register()
window = in_window.load()
window.keeps_films = False  # what is measured is Glint's


def scenario():
    scene = bpy.context.scene
    scene.render.engine = "CONTROL" if job == "control" else "GLINT"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = (
        960,
        540,
        100,
    )
    camera = scene.camera.data.copy()
    measured_scenes.grid(708)
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.location = (0, 0, 5)
    window.space.overlay.show_overlays = False
    yield 5.0
    start = time.monotonic()
    if job == "view":
        window.space.shading.type = "RENDERED"
        yield lambda: window.session is not None
        yield from window.settle()
    elif job == "control":
        window.space.shading.type = "RENDERED"
        yield 3.0
    else:
        in_window.render(pathlib.Path(folder) / "final.exr")
    yield 1.0
    in_window.answer(start)


in_window.play(scenario, window)
