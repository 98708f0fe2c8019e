"""Rooms that bounced light is measured in: a Cornell box and a corridor with a door to the day."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
from mathutils import Vector

WHITE, RED, GREEN = (0.73,) * 3, (0.65, 0.05, 0.05), (0.12, 0.45, 0.15)
OF = 60
"""Frames of the camera's way through the Cornell box."""


def cornell(side: int = 256):
    """A box of 2 units with a lamp of half a unit below its ceiling; the scene."""
    scene = empty(side)
    white, red, green = (matt(color) for color in (WHITE, RED, GREEN))
    x, y, z = (-1, 1), (-1, 1), (0, 2)
    for axis, at, material in ((2, 0, white), (2, 2, white), (1, 1, white), (0, -1, red)):
        wall((x, y, z), axis, at, material)
    wall((x, y, z), 0, 1, green)
    for at, scale, turn in (
        ((-0.35, 0.3, 0.6), (0.3, 0.3, 0.6), 0.3),
        ((0.35, -0.3, 0.3), (0.3, 0.3, 0.3), -0.3),
    ):
        box(at, scale, turn, white)
    lamp((0, 0, 1.99), 0.5, 20.0)
    place(scene, 0)
    return scene


def place(scene, frame: float) -> None:
    """Puts the camera where it is in a frame of its way through the Cornell box."""
    t = frame / OF
    look(scene, (-0.5 + t, -3.6 + 0.9 * t, 1.2 - 0.4 * t), (0, 0.2, 0.9), 40)


def corridor(side: int = 256):
    """8 units long, a lamp at its near end and at the far one a door to a grey day; the scene."""
    scene = empty(side)
    white, red, green = (matt(color) for color in (WHITE, RED, GREEN))
    x, y, z = (-0.75, 0.75), (0, 8), (0, 2.4)
    for axis, at, material in ((2, 0, white), (2, 2.4, white), (1, 0, white), (0, -0.75, red)):
        wall((x, y, z), axis, at, material)
    wall((x, y, z), 0, 0.75, green)
    for part in (
        ((-0.75, -0.4), y, z),
        ((0.4, 0.75), y, z),
        ((-0.4, 0.4), y, (2.0, 2.4)),
    ):
        wall(part, 1, 8, white)
    box((0.4, 3.0, 0.4), (0.2, 0.3, 0.4), 0.2, white)
    lamp((0, 1.5, 2.39), 0.3, 8.0)
    look(scene, (0.1, 0.15, 1.5), (0, 6, 1.0), 70)
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.6, 0.7, 0.9, 1)
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 1
    return scene


ROOMS = {"cornell": cornell, "corridor": corridor}


def empty(side: int):
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    scene = bpy.context.scene
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0
    scene.render.resolution_x = scene.render.resolution_y = side
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    return scene


def look(scene, at: Sequence[float], to: Sequence[float], degrees: float) -> None:
    """Puts the scene's camera there, and makes it first where there is none."""
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(scene.camera)
    scene.camera.data.angle = math.radians(degrees)
    scene.camera.location = at
    turn = (Vector(to) - Vector(at)).to_track_quat("-Z", "Y")
    scene.camera.rotation_euler = turn.to_euler()


def matt(color: tuple[float, ...]):
    material = bpy.data.materials.new("matt")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def wall(box, axis: int, at: float, material) -> None:
    """The side of a box, two numbers an axis, that lies across an axis there."""
    u, v = (box[k] for k in range(3) if k != axis)
    corners = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])]
    points = [(*corner[:axis], at, *corner[axis:]) for corner in corners]
    mesh = bpy.data.meshes.new("wall")
    mesh.from_pydata(points, [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("wall", mesh))


def box(at: tuple[float, ...], scale: tuple[float, ...], turn: float, material) -> None:
    bpy.ops.mesh.primitive_cube_add(size=2, location=at, rotation=(0, 0, turn))
    bpy.context.object.scale = scale
    bpy.context.object.data.materials.append(material)


def lamp(at: tuple[float, ...], size: float, energy: float) -> None:
    light = bpy.data.lights.new("lamp", "AREA")
    light.size, light.energy = size, energy
    thing = bpy.data.objects.new("lamp", light)
    thing.location = at
    bpy.context.scene.collection.objects.link(thing)
