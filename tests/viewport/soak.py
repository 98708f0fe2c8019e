"""Random edits, undo, resizes, mode switches, file reloads and engine switches in one window: no crash, no stuck thread, no growth."""

import gc
import pathlib
import random
import resource
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))

import bpy
import mathutils

import in_window

arguments = sys.argv[sys.argv.index("--") + 1 :]
folder, seconds, seed = pathlib.Path(arguments[0]), float(arguments[1]), int(arguments[2])
window = in_window.load(*arguments[3:4])
r = random.Random(seed)
done, failed, memory = {}, {}, []


def vector(size=3.0):
    return [r.uniform(-size, size) for _ in range(3)]


def thing(*kinds):
    return r.choice([found for found in bpy.context.scene.objects if not kinds or found.type in kinds])


def move():
    thing().location = vector()


def orbit():
    window.view.view_rotation = mathutils.Quaternion(vector(1), r.uniform(0, 0.5)) @ window.view.view_rotation


def zoom():
    window.view.view_distance = r.uniform(1, 30)


def projection():
    window.view.view_perspective = r.choice(["PERSP", "ORTHO", "CAMERA"])


def light():
    lamp = thing("LIGHT").data
    lamp.energy, lamp.color = r.uniform(0, 1000), [r.random() for _ in range(3)]


def material():
    found = r.choice([found for found in bpy.data.materials if found.node_tree])
    node = next((node for node in found.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if node is not None:
        node.inputs["Base Color"].default_value = (*[r.random() for _ in range(3)], 1)
        node.inputs["Metallic"].default_value = r.random()


def vertex():
    mesh = thing("MESH").data
    if not mesh.is_editmode and len(mesh.vertices):
        r.choice(mesh.vertices).co = vector()
        mesh.update()


def add():
    with window.context():
        getattr(bpy.ops.mesh, r.choice(["primitive_cube_add", "primitive_uv_sphere_add", "primitive_monkey_add"]))(location=vector())


def delete():
    found = [found for found in bpy.context.scene.objects if found.type == "MESH"]
    if len(found) > 2:
        bpy.data.objects.remove(r.choice(found))


def edit_mode():
    if bpy.context.mode == "OBJECT":
        bpy.context.view_layer.objects.active = thing("MESH")
    with window.context():
        bpy.ops.object.mode_set(mode=r.choice(["EDIT", "OBJECT", "SCULPT"]))


def edit_vertices():
    if bpy.context.mode == "EDIT_MESH":
        with window.context():
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.transform.translate(value=vector(0.2))


def undo():
    with window.context():
        bpy.ops.ed.undo()


def redo():
    with window.context():
        bpy.ops.ed.redo()


def push():
    bpy.ops.ed.undo_push(message="soak")


def shading():
    window.space.shading.type = r.choice(["RENDERED", "RENDERED", "SOLID"])  # Material Preview compiles for minutes in software


def engine():
    bpy.context.scene.render.engine = r.choice(["GLINT", "GLINT", "BLENDER_WORKBENCH"])


def resize():
    window.space.show_region_ui = not window.space.show_region_ui
    window.space.show_region_toolbar = not window.space.show_region_toolbar


def quad_view():
    with window.context():
        bpy.ops.screen.region_quadview()


def local_view():
    bpy.context.view_layer.objects.active = thing("MESH")
    bpy.context.view_layer.objects.active.select_set(True)
    with window.context():
        bpy.ops.view3d.localview()


def border():
    scene, space = bpy.context.scene, window.space
    space.use_render_border = scene.render.use_border = r.random() < 0.5
    space.render_border_min_x, space.render_border_max_x = sorted((r.random(), r.random()))
    scene.render.border_min_x, scene.render.border_max_x = sorted((r.random(), r.random()))


def settings():
    scene = bpy.context.scene
    scene.glint.viewport.samples = r.choice([1, 2, 8])
    scene.glint.viewport_pass = r.choice(["Combined", "Combined", "Normal", "Depth", "Shadow"])
    scene.render.preview_pixel_size = r.choice(["AUTO", "1", "2", "4"])
    scene.render.film_transparent = r.random() < 0.5


def hide():
    found = thing()
    found.hide_viewport = not found.hide_viewport


def frame():
    bpy.context.scene.frame_set(r.randrange(1, 20))


def play():
    with window.context():
        bpy.ops.screen.animation_play()


def reload():
    bpy.ops.wm.open_mainfile(filepath=str(folder / "soak.blend"))


def nothing_left():
    for found in [found for found in bpy.data.objects if found.type == "MESH"][6:]:
        bpy.data.objects.remove(found)


EDITS = [move, move, orbit, orbit, zoom, projection, light, material, vertex, add, delete, edit_mode, edit_vertices, undo, redo, push,
         shading,         engine, resize, quad_view, local_view, border, settings, hide, frame, play, reload, nothing_left]  # fmt: skip


EXCHANGING = {undo, redo, reload, quad_view, local_view, engine, shading}
"""After these Blender wants to see its events before another operator runs, as it does in a user's hands."""


def scenario():
    scene = bpy.context.scene
    scene.render.engine = "GLINT"
    scene.glint.viewport.samples = scene.glint.final.samples = 2
    bpy.data.objects["Cube"].keyframe_insert("location", frame=1)
    bpy.data.objects["Cube"].location.x = 2
    bpy.data.objects["Cube"].keyframe_insert("location", frame=20)
    window.space.shading.type = "RENDERED"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "soak.blend"))
    yield 1.0
    start, measured = time.perf_counter(), 0.0
    while time.perf_counter() < start + seconds:
        for edit in r.choices(EDITS, k=r.randrange(1, 4)):
            once(edit)
            if edit in EXCHANGING:
                break
        yield r.choice([0.0, 0.02, 0.1])
        if time.perf_counter() > measured + 5:
            measured = time.perf_counter()
            memory.append(resident())
    yield from rest()
    in_window.answer({
        "done": done, "failed": failed, "memory": memory, "threads": threads(),
        "draws": len(window.draws), "busy": window.session.busy, "converged": window.converged(), "error": str(window.session._live.error),
    })  # fmt: skip


def once(edit):
    """Blender refuses some of this (RuntimeError): such is the user's life."""
    done[edit.__name__] = done.get(edit.__name__, 0) + 1
    try:
        edit()
    except RuntimeError as error:
        failed[edit.__name__] = str(error).strip()[:100]


def rest():
    """Back to one rendered view of the file, settled."""
    if bpy.context.screen.is_animation_playing:
        play()
    yield 0.2
    once(reload)
    yield 0.5
    bpy.context.scene.render.engine, window.space.shading.type = "GLINT", "RENDERED"
    window.session = None
    yield lambda: window.session is not None
    yield from window.settle()
    gc.collect()
    yield 0.5
    memory.append(resident())


def threads():
    return [thread.name for thread in threading.enumerate() if thread.name == "glint live"]


def resident():
    """The most memory that this process has held so far, megabytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


in_window.play(scenario, window)
