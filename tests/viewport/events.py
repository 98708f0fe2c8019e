"""The events of a working day in one window, in sequence: what each shows is compared with the
final render, how soon is printed.
"""

import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy
import mathutils
import numpy as np

import in_window

window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])
folder = pathlib.Path(sys.argv[sys.argv.index("--") + 1])
results, latency, ready = {}, {}, {}


def scene_up():
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.render.film_transparent = False
    for group in (scene.glint.final, scene.glint.viewport):
        group.samples, group.light_samples, group.max_bounces = 4, 2, 2
    cube = bpy.data.objects["Cube"]
    cube.modifiers.new("Subdivide", "SUBSURF").levels = cube.modifiers[
        "Subdivide"
    ].render_levels = 3
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1))
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    scene.collection.objects.link(sun)


def through_the_camera():
    """The render's pixels one to one: a frame of the region's size, and the zoom at which Blender
    shows it so.
    """
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = window.region.width, window.region.height
    scene.render.resolution_percentage = 100
    window.view.view_perspective = "CAMERA"
    window.view.view_camera_zoom = (2 - 2**0.5) * 50
    window.view.view_camera_offset = (0, 0)


def compare(name):
    """The converged picture against F12, and the framebuffer against both."""
    yield from window.settle()
    window.space.overlay.show_overlays = False
    yield from window.read()
    window.space.overlay.show_overlays = True
    final = in_window.render(folder / "final.exr")
    film = window.films.get("frame", window.films.get("all"))
    shown = film.combined
    same = shown.shape == final.shape and shown.tobytes() == final.tobytes()
    worst = float(np.abs(shown - final).max()) if shown.shape == final.shape else -1.0
    results[name] = {
        "same bits": same,
        "worst": worst,
        "framebuffer": in_window.shown_error(window.framebuffer, final),
    }


def timed(name, count, action, pause=0.0):
    """Do something many times; how long until another picture is on the screen."""
    window.times, window.ready = latency.setdefault(name, []), ready.setdefault(name, [])
    for k in range(count):
        yield from window.frames(lambda k=k: action(k))
        if pause:
            yield pause


def orbit(k):
    window.view.view_rotation = mathutils.Quaternion((0, 0, 1), 0.02) @ window.view.view_rotation
    window.region.tag_redraw()


def move_cube(k):
    # never where it stands: that would ask for no picture
    bpy.data.objects["Cube"].location.x = 0.05 * (k + 1)


def edit_light(k):
    bpy.data.lights["Light"].energy = 500 + 40 * k


def edit_material(k):
    bpy.data.materials["Material"].node_tree.nodes["Principled BSDF"].inputs[
        "Base Color"
    ].default_value = (0.1 * k, 0.4, 0.5, 1)


def edit_world(k):
    bpy.data.worlds["World"].node_tree.nodes["Background"].inputs["Color"].default_value = (
        0.02 * k,
        0.05,
        0.05,
        1,
    )


def scenario():
    scene_up()
    yield 0.3
    start = time.perf_counter()
    window.space.shading.type = "RENDERED"
    yield lambda: window.session is not None and window.session._drawn > 0
    latency["first picture"] = [time.perf_counter() - start]
    yield from window.settle()
    through_the_camera()
    yield from compare("camera view")
    for name, edit in (
        ("object", move_cube),
        ("light", edit_light),
        ("material", edit_material),
        ("world", edit_world),
    ):
        yield from timed(name, 10, edit, 0.05)
        yield from compare(name)
    window.view.view_perspective = "PERSP"
    yield from window.settle()
    yield from timed("orbit", 40, orbit)
    yield from playing()
    start = time.perf_counter()
    yield (
        lambda: (
            window.films["all"].combined.shape[:2] == (window.region.height, window.region.width)
        )
    )
    latency["stop to full resolution"] = [time.perf_counter() - start]
    yield from window.settle()
    yield from idle()
    yield from explain()
    yield from solid()
    in_window.answer(
        {
            "results": results,
            "latency": latency,
            "ready": ready,
            "updates": window.updates,
            "idle": idle_share,
            "explained": explained,
            "pictures and Solid's redraws a second": rate,
        }
    )


def playing():
    """Turn the view all the time: new pictures a second."""
    first, start = len(window.draws), time.perf_counter()
    k = 0
    while time.perf_counter() < start + 3:
        orbit(k)
        yield 0.008
    answered = [answered for _, answered, *_ in window.draws[first:]]
    rate.append(len(set(answered)) / (time.perf_counter() - start))


def solid():
    """What Blender's own Solid shading does here at most: redraws a second while the view turns."""
    count = []
    handler = bpy.types.SpaceView3D.draw_handler_add(
        lambda: count.append(1), (), "WINDOW", "POST_PIXEL"
    )
    window.space.shading.type = "SOLID"
    yield 0.5
    count.clear()
    start = time.perf_counter()
    while time.perf_counter() < start + 3:
        orbit(0)
        yield 0.008
    rate.append(len(count) / (time.perf_counter() - start))
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")


rate = []
idle_share = []
explained = {}


def explain():
    """Explain Pixel against the picture of one sample, before neighbours are averaged: the pixel in
    the middle.
    """
    bpy.context.scene.glint.final.soft_light = "DEALT"  # the view takes the final render's
    bpy.context.scene.glint.viewport.samples = 1
    window.region.tag_redraw()
    yield lambda: window.films["all"].samples == 1
    yield from window.settle()
    operator = sys.modules[window.package + ".operators.explain_pixel"]
    x, y = window.region.width // 2, window.region.height // 2
    explained["color"] = operator.explain_view(window.region, x, y).color
    explained["pixel"] = window.films["all"].combined[y, x, :3].tolist()
    with window.context():
        assert bpy.ops.glint.explain_pixel(x=x, y=y) == {"FINISHED"}
        assert bpy.ops.glint.copy_explanation() == {"FINISHED"}


def idle():
    """Processor time that a second of a converged view costs, of a second."""
    before, start = time.process_time(), time.perf_counter()
    yield 2.0
    idle_share.append((time.process_time() - before) / (time.perf_counter() - start))


in_window.play(scenario, window)
