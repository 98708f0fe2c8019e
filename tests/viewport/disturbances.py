"""What an artist may do to a view that is being traced: each disturbance comes a moment after the
view moved, and the picture that the view comes to rest with is that of an export made anew.
"""

import pathlib
import sys
from dataclasses import replace

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy
import mathutils

import in_window

window = in_window.load(*sys.argv[sys.argv.index("--") + 2 :][:1])
results = {}


def scenario():
    scene_up()
    yield 0.3
    window.space.shading.type = "RENDERED"
    yield lambda: window.session is not None
    yield from window.settle()
    for disturb in DISTURBANCES:
        in_window.say(disturb.__name__)
        turn()
        yield 0.03
        disturb()
        yield 0.03
        turn()
        yield from window.settle()
        results[disturb.__name__] = is_as_anew()
    yield from two_windows()
    in_window.answer(results)


def scene_up():
    """The default scene, a plane, and twelve spheres of one mesh in a collection of their own."""
    scene = bpy.context.scene
    scene.render.engine, scene.glint.viewport.samples = "GLINT", 1
    bpy.ops.mesh.primitive_plane_add(size=8, location=(0, 0, -1))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3)
    sphere, many = bpy.context.object, bpy.data.collections.new("Many")
    scene.collection.children.link(many)
    for k in range(12):
        thing = bpy.data.objects.new(f"Sphere {k}", sphere.data)
        thing.location = (k % 4 - 2, k // 4, 0)
        many.objects.link(thing)
    window.space.overlay.show_overlays = False


def turn():
    window.view.view_rotation = mathutils.Quaternion((0, 0, 1), 0.05) @ window.view.view_rotation
    window.region.tag_redraw()


def is_as_anew():
    """Whether the view shows what a new export of the depsgraph gives."""
    export = sys.modules[window.package + ".addon.export.sync.incremental"]
    engine = sys.modules[window.package + ".engine"]
    shown, settings, view = window.session.shown_scene
    depsgraph = bpy.context.evaluated_depsgraph_get()
    anew = export.LiveExport().update(
        depsgraph, shown.camera, passes=settings.passes, space=window.space
    )
    film = window.films["all"]
    truth = engine.render(anew, replace(settings, region=view.border))
    return (
        film.combined.shape == truth.combined.shape
        and film.combined.tobytes() == truth.combined.tobytes()
    )


# --- disturbances
# --------------------------------------------------------------------------------------------------


def delete_an_object():
    bpy.data.objects.remove(bpy.data.objects["Sphere 0"])


def rename():
    for block in (
        bpy.data.objects["Sphere 1"],
        bpy.data.meshes[0],
        bpy.data.materials[0],
        bpy.data.lights[0],
    ):
        block.name = "Another"


def hide_a_collection():
    bpy.context.view_layer.layer_collection.children["Many"].hide_viewport = True


def show_a_collection():
    bpy.context.view_layer.layer_collection.children["Many"].hide_viewport = False


def exclude_a_collection():
    bpy.context.view_layer.layer_collection.children["Many"].exclude = True


def another_view_layer():
    bpy.context.window.view_layer = bpy.context.scene.view_layers.new("Other")


def another_scene():
    other = bpy.data.scenes.new("Other")
    other.render.engine, other.glint.viewport.samples = "GLINT", 1
    other.collection.objects.link(bpy.data.objects["Cube"])
    other.collection.objects.link(bpy.data.objects["Sphere 3"])
    bpy.context.window_manager.windows[0].scene = other


def the_first_scene_again():
    first = bpy.context.window_manager.windows[0].scene = bpy.data.scenes["Scene"]
    for layer in first.view_layers:
        layer.layer_collection.children["Many"].exclude = False


def without_a_number():
    bpy.data.objects["Sphere 2"].location.x = float("nan")


def endless():
    bpy.data.objects["Sphere 3"].scale.y = float("inf")


def flat():
    bpy.data.objects["Sphere 4"].scale = (0, 0, 1)


def far_away():
    bpy.data.objects["Sphere 5"].location.x = 1e30


def back_again():
    for k in range(2, 6):
        bpy.data.objects[f"Sphere {k}"].location.x, bpy.data.objects[f"Sphere {k}"].scale = (
            0.3 * k,
            (1, 1, 1),
        )


def coarse_pixels():
    bpy.context.scene.render.preview_pixel_size = "8"


def fine_pixels():
    bpy.context.scene.render.preview_pixel_size = "1"


def another_engine_and_back():
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"
    bpy.context.scene.render.engine = "GLINT"


def no_faces():
    bpy.data.objects["Cube"].data.clear_geometry()


def no_mesh():
    bpy.data.meshes.remove(bpy.data.objects["Cube"].data)


def no_nodes():
    material = next(material for material in bpy.data.materials if material.node_tree)
    material.node_tree.nodes.clear()


def no_material():
    for material in list(bpy.data.materials):
        bpy.data.materials.remove(material)


def no_world():
    bpy.context.scene.world = None


def no_camera():
    window.view.view_perspective = "CAMERA"
    bpy.data.objects.remove(bpy.data.objects["Camera"])


def out_of_the_camera():
    window.view.view_perspective = "PERSP"


def no_lamp():
    for lamp in list(bpy.data.lights):
        bpy.data.lights.remove(lamp)


def nothing():
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)


DISTURBANCES = (
    delete_an_object,
    rename,
    hide_a_collection,
    show_a_collection,
    exclude_a_collection,
    another_view_layer,
    another_scene,
    the_first_scene_again,
    without_a_number,
    endless,
    flat,
    far_away,
    back_again,
    coarse_pixels,
    fine_pixels,
    another_engine_and_back,
    no_faces,
    no_mesh,
    no_nodes,
    no_material,
    no_world,
    no_camera,
    out_of_the_camera,
    no_lamp,
    nothing,
)


def two_windows():
    """Two windows of different scenes, one of which is closed while it is traced."""
    bpy.ops.mesh.primitive_cube_add()
    sessions = sys.modules[window.package + ".addon.viewport.timer"]._sessions
    with window.context():
        bpy.ops.wm.window_new()
    second = bpy.context.window_manager.windows[-1]
    second.scene = bpy.data.scenes["Other"]
    yield 0.5
    area = max(second.screen.areas, key=lambda area: area.width * area.height)
    area.type = "VIEW_3D"
    area.spaces[0].shading.type = "RENDERED"
    yield lambda: len(sessions) > 1
    turn()
    yield 0.05
    with bpy.context.temp_override(window=second):
        bpy.ops.wm.window_close()
    yield lambda: len(sessions) == 1
    yield from window.settle()
    results["two windows"] = is_as_anew()


in_window.play(scenario, window)
