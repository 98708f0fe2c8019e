"""What a 3D view may hide or bring back, in one window: a clip border, local view, the
passepartout, undo and redo.

Each shows what something else shows that Blender itself decides: Solid shading's depth, hidden
objects, F12, the picture before.
"""

import itertools
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy
import gpu
import mathutils
import numpy as np

import in_window

window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])
folder = pathlib.Path(sys.argv[sys.argv.index("--") + 1])
results = {}


def scenario():
    scene_up()
    yield 0.3
    yield from clip_border()
    yield from local_view()
    yield from undo_and_redo()
    yield from passepartout()
    both_eyes()
    in_window.answer(results)


def scene_up():
    """A cube that a sphere touches, above a plane; nothing behind them."""
    scene = bpy.context.scene
    scene.render.engine, scene.render.film_transparent = "GLINT", True
    for group in (scene.glint.final, scene.glint.viewport):
        group.samples = 1
    bpy.ops.mesh.primitive_plane_add(size=6, location=(0, 0, -1))
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1.8, 0, 0))
    window.space.overlay.show_overlays = False  # lamps and cameras have a depth there
    look(0.9)


def look(angle):
    view = window.view
    view.view_perspective, view.view_distance, view.view_location = "PERSP", 12, (0, 0, 0)
    view.view_rotation = mathutils.Euler((angle, 0.1, 0.5)).to_quaternion()


def picture():
    """Yield from this: the converged picture of what is there now, in `films`."""
    window.space.shading.type = "RENDERED"
    yield lambda: window.session is not None
    yield from window.settle()


def film(name="all"):
    return window.films[name].combined


# --- clip border
# --------------------------------------------------------------------------------------------------


def clip_border():
    """Planes through a border round the left part of the region, seen from there and from
    elsewhere: shown is where Solid has a depth.
    """
    masks = results["clip border"] = {}
    yield from clipped("without", masks)
    width, height = window.region.width, window.region.height
    with window.context():
        border = {
            "xmin": width // 4,
            "xmax": width // 2,
            "ymin": height // 4,
            "ymax": 3 * height // 4,
        }
        assert bpy.ops.view3d.clip_border("EXEC_DEFAULT", **border, wait_for_input=False) == {
            "FINISHED"
        }
    assert window.view.use_clip_planes
    yield from clipped("from there", masks)
    look(0.5)
    yield from clipped("from elsewhere", masks)
    window.view.use_clip_planes = False
    look(0.9)


def clipped(name, masks):
    """Yield from this: how many pixels Solid shows, and how many more and fewer Glint does."""
    yield from solid_depth()
    yield from picture()
    solid, glint = depth[0] < 1, film()[:, :, 3] > 0.5
    masks[name] = {
        "solid": int(solid.sum()),
        "more": int((glint & ~solid).sum()),
        "fewer": int((solid & ~glint).sum()),
    }


depth = []


def solid_depth():
    """Yield from this: the depth buffer of Solid shading is in `depth`."""
    depth.clear()

    def read():
        width, height = window.region.width, window.region.height
        buffer = gpu.state.active_framebuffer_get().read_depth(0, 0, width, height)
        buffer.dimensions = width * height
        depth[:] = [np.array(buffer, np.float32).reshape(height, width)]

    window.space.shading.type = "SOLID"
    yield 0.2
    handler = bpy.types.SpaceView3D.draw_handler_add(read, (), "WINDOW", "POST_VIEW")
    window.region.tag_redraw()
    yield lambda: bool(depth)
    bpy.types.SpaceView3D.draw_handler_remove(handler, "WINDOW")


# --- local view, undo, passepartout
# ----------------------------------------------------------------------------------------------


def local_view():
    """All but the plane in local view is the same picture as the plane hidden."""
    plane = bpy.data.objects["Plane"]
    yield from picture()
    whole = film()
    for thing in bpy.data.objects:
        thing.select_set(thing != plane)
    with window.context():
        bpy.ops.view3d.localview(frame_selected=False)
    yield from picture()
    local = film()
    with window.context():
        bpy.ops.view3d.localview(frame_selected=False)
    yield from picture()
    results["left local view"] = same(film(), whole)
    plane.hide_viewport = True
    yield from picture()
    results["local view"] = same(film(), local) and not same(local, whole)
    plane.hide_viewport = False


def undo_and_redo():
    """An object moved, a material painted, a mesh edited: each undone and done again."""
    pictures = []
    for edit in (lambda: None, move, paint, lift):
        edit()
        with window.context():
            bpy.ops.ed.undo_push(message="edit")
        yield from picture()
        pictures.append(film())
    results["edits"] = not any(same(a, b) for a, b in itertools.pairwise(pictures))
    for k in (2, 1, 0):
        with window.context():
            bpy.ops.ed.undo()
        yield from picture()
        results[f"undo to {k}"] = same(film(), pictures[k])
    for k in (1, 2, 3):
        with window.context():
            bpy.ops.ed.redo()
        yield from picture()
        results[f"redo to {k}"] = same(film(), pictures[k])


def move():
    bpy.data.objects["Cube"].location.y = 0.7


def paint():
    bpy.data.materials["Material"].node_tree.nodes["Principled BSDF"].inputs[
        "Base Color"
    ].default_value = (0.9, 0.1, 0.2, 1)


def lift():
    mesh = bpy.data.meshes["Cube"]
    mesh.vertices[0].co.z += 0.8
    mesh.update()


def passepartout():
    """A frame inside the region, pixel on pixel: the same bits as F12 there, and drawn where
    it is.
    """
    scene, view = bpy.context.scene, window.view
    width, height = window.region.width, window.region.height
    frame = width - 2 * (width // 6), height - 2 * (height // 6)
    scene.render.film_transparent = False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = (
        *frame,
        100,
    )
    scene.camera.data.show_passepartout, scene.camera.data.passepartout_alpha = True, 1.0
    view.view_perspective, view.view_camera_offset = "CAMERA", (0, 0)
    view.view_camera_zoom = (2 * (frame[0] / width) ** 0.5 - 2**0.5) * 50
    yield from picture()
    yield from window.read()
    shown = film("frame") if "frame" in window.films else film()
    final = in_window.render(folder / "final.exr")
    x, y = width // 6, height // 6
    inside = window.framebuffer[y : y + frame[1], x : x + frame[0]]
    results["passepartout"] = same(shown, final)
    results["passepartout framebuffer"] = in_window.shown_error(inside, final)


def both_eyes():
    """F12 with stereoscopy in a program with a window: no view stays black, and they differ but for
    eyes that are no distance apart, which are the camera's own.
    """
    settings = bpy.context.scene.render
    # an EXR would be read as part of two views
    settings.image_settings.file_format, settings.image_settings.color_depth = "PNG", "16"
    stereo = bpy.context.scene.camera.data.stereo
    stereo.convergence_mode = "PARALLEL"
    for name, is_stereo, apart in (("flat", False, 0.0), ("eye", True, 0.0), ("wide", True, 0.5)):
        stereo.interocular_distance = apart
        settings.use_multiview, settings.image_settings.views_format = is_stereo, "INDIVIDUAL"
        settings.filepath = str(folder / f"{name}.png")
        bpy.ops.render.render(write_still=True)
    settings.use_multiview = False
    flat, left, right, wide_left, wide_right = (
        in_window.read_file(folder / f"{name}.png")
        for name in ("flat", "eye_L", "eye_R", "wide_L", "wide_R")
    )
    alike = same(left, right) and np.abs(left.astype(float) - flat).mean() < 0.01 * flat.max()
    results["both eyes"] = bool(flat[:, :, :3].any()) and alike and not same(wide_left, wide_right)


def same(one, other):
    return one.shape == other.shape and one.tobytes() == other.tobytes()


in_window.play(scenario, window)
