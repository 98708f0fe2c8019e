"""What a restless user does in a 3D view, at random. Each edit takes a `Hand`, whose dice alone
decide what happens.
"""

import pathlib
import random
from dataclasses import dataclass

import bpy
import mathutils

import in_window


@dataclass
class Hand:
    """dice: of this edit.  engine: the render engine that is tried.  file: which `reload` opens."""

    window: in_window.Window
    engine: str
    file: pathlib.Path
    dice: random.Random

    def vector(self, size=3.0):
        return [self.dice.uniform(-size, size) for _ in range(3)]

    def thing(self, *kinds):
        return self.dice.choice(
            [found for found in bpy.context.scene.objects if not kinds or found.type in kinds]
        )


def move(hand):
    hand.thing().location = hand.vector()


def orbit(hand):
    view = hand.window.view
    view.view_rotation = (
        mathutils.Quaternion(hand.vector(1), hand.dice.uniform(0, 0.5)) @ view.view_rotation
    )


def zoom(hand):
    hand.window.view.view_distance = hand.dice.uniform(1, 30)


def projection(hand):
    hand.window.view.view_perspective = hand.dice.choice(["PERSP", "ORTHO", "CAMERA"])


def light(hand):
    lamp = hand.thing("LIGHT").data
    lamp.energy, lamp.color = hand.dice.uniform(0, 1000), [hand.dice.random() for _ in range(3)]


def material(hand):
    found = hand.dice.choice([found for found in bpy.data.materials if found.node_tree])
    node = next((node for node in found.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if node is not None:
        node.inputs["Base Color"].default_value = (*[hand.dice.random() for _ in range(3)], 1)
        node.inputs["Metallic"].default_value = hand.dice.random()


def vertex(hand):
    mesh = hand.thing("MESH").data
    if not mesh.is_editmode and len(mesh.vertices):
        hand.dice.choice(mesh.vertices).co = hand.vector()
        mesh.update()


def add(hand):
    kind = hand.dice.choice(
        ["primitive_cube_add", "primitive_uv_sphere_add", "primitive_monkey_add"]
    )
    with hand.window.context():
        getattr(bpy.ops.mesh, kind)(location=hand.vector())


def delete(hand):
    found = [found for found in bpy.context.scene.objects if found.type == "MESH"]
    if len(found) > 2:
        bpy.data.objects.remove(hand.dice.choice(found))


def edit_mode(hand):
    if bpy.context.mode == "OBJECT":
        bpy.context.view_layer.objects.active = hand.thing("MESH")
    with hand.window.context():
        bpy.ops.object.mode_set(mode=hand.dice.choice(["EDIT", "OBJECT", "SCULPT"]))


def edit_vertices(hand):
    if bpy.context.mode == "EDIT_MESH":
        with hand.window.context():
            bpy.ops.mesh.select_all(action="SELECT")
            bpy.ops.transform.translate(value=hand.vector(0.2))


def undo(hand):
    with hand.window.context():
        bpy.ops.ed.undo()


def redo(hand):
    with hand.window.context():
        bpy.ops.ed.redo()


def push(hand):
    bpy.ops.ed.undo_push(message="soak")


def shading(hand):
    # Material Preview is left out: Blender compiles its shaders for minutes in software.
    hand.window.space.shading.type = hand.dice.choice(["RENDERED", "RENDERED", "SOLID"])


def engine(hand):
    bpy.context.scene.render.engine = hand.dice.choice(
        [hand.engine, hand.engine, "BLENDER_WORKBENCH"]
    )


def resize(hand):
    space = hand.window.space
    space.show_region_ui = not space.show_region_ui
    space.show_region_toolbar = not space.show_region_toolbar


def quad_view(hand):
    with hand.window.context():
        bpy.ops.screen.region_quadview()


def local_view(hand):
    bpy.context.view_layer.objects.active = hand.thing("MESH")
    bpy.context.view_layer.objects.active.select_set(True)
    with hand.window.context():
        bpy.ops.view3d.localview()


def border(hand):
    scene, space, dice = bpy.context.scene, hand.window.space, hand.dice
    space.use_render_border = scene.render.use_border = dice.random() < 0.5
    space.render_border_min_x, space.render_border_max_x = sorted((dice.random(), dice.random()))
    scene.render.border_min_x, scene.render.border_max_x = sorted((dice.random(), dice.random()))


def settings(hand):
    scene, dice = bpy.context.scene, hand.dice
    if hand.engine == "GLINT":
        scene.glint.viewport.samples = dice.choice([1, 2, 8])
        scene.glint.viewport_pass = dice.choice(
            ["Combined", "Combined", "Normal", "Depth", "Shadow"]
        )
    scene.render.preview_pixel_size = dice.choice(["AUTO", "1", "2", "4"])
    scene.render.film_transparent = dice.random() < 0.5


def hide(hand):
    found = hand.thing()
    found.hide_viewport = not found.hide_viewport


def frame(hand):
    bpy.context.scene.frame_set(hand.dice.randrange(1, 20))


def play(hand):
    with hand.window.context():
        bpy.ops.screen.animation_play()


def reload(hand):
    bpy.ops.wm.open_mainfile(filepath=str(hand.file))


def nothing_left(hand):
    for found in [found for found in bpy.data.objects if found.type == "MESH"][6:]:
        bpy.data.objects.remove(found)


EDITS = (
    move,
    move,
    orbit,
    orbit,
    zoom,
    projection,
    light,
    material,
    vertex,
    add,
    delete,
    edit_mode,
    edit_vertices,
    undo,
    redo,
    push,
    shading,
    engine,
    resize,
    quad_view,
    local_view,
    border,
    settings,
    hide,
    frame,
    play,
    reload,
    nothing_left,
)

UNTOLD = {move, light, material, vertex, delete, border, settings, hide, nothing_left}
"""Changes that no operator makes: they are pushed, so that Blender's undo knows of them, as it does
of all that buttons change.

Without it Blender 4.3.2 itself crashes: an object is hidden by `hide_viewport`, another is added by
an operator, one is hidden again, and then undo leaves freed data-blocks in the file, whose names
the Outliner draws, or which redo follows. It does so with NOTHING, too.
"""

EXCHANGING = {undo, redo, reload, quad_view, local_view, engine, shading}
"""After these Blender wants to see its events before another operator runs, as it does in a user's
hands.
"""
