"""The scenes of measured.py. The middle of the view is red, and green where an event shows."""

import bpy
import numpy as np

RED, GREEN, GREY = (0.8, 0.02, 0.02, 1), (0.02, 0.8, 0.02, 1), (0.5, 0.5, 0.5, 1)


def spheres():
    """62 k triangles, one sun and one point light: a red sphere left of a green one, and another
    behind, on a grey plane.
    """
    lit()
    for name, color, location in (
        ("red", RED, (-1, 0, 0)),
        ("green", GREEN, (1, 0, 0)),
        ("grey", GREY, (0, 2, 0)),
    ):
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6, radius=0.9, location=location)
        wear(bpy.context.object, name, color)
        bpy.context.object.data.shade_smooth()
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=16, y_subdivisions=16, size=12, location=(0, 0, -1)
    )
    wear(bpy.context.object, "plane", GREY)


def instances(count, carried=False):
    """A red cube among `count` green ones that share its mesh's triangles, which lie in a plane
    below it. Returns the red one.

    carried: the green ones are no objects, but one at each vertex of a mesh.
    """
    lit()
    bpy.ops.mesh.primitive_cube_add(size=0.08)
    mesh = bpy.context.object.data
    wear(bpy.context.object, "many", GREEN)
    bpy.data.objects.remove(bpy.context.object)
    side, many = int(count**0.5), bpy.data.collections.new("many")
    places = [
        ((k % side - side / 2) * 0.07, (k // side - side / 2) * 0.07, -1) for k in range(count)
    ]
    if carried:
        carrier = bpy.data.objects.new("carrier", bpy.data.meshes.new("vertices"))
        carrier.data.from_pydata(places, [], [])
        carrier.instance_type, places = "VERTS", [(0, 0, 0)]
        many.objects.link(carrier)
    for place in places:
        thing = bpy.data.objects.new("one", mesh)
        thing.location, thing.parent = place, carrier if carried else None
        many.objects.link(thing)
    # at the end: Blender counts all objects anew after each change of the scene
    bpy.context.scene.collection.children.link(many)
    red = bpy.data.objects.new("the one", mesh)
    red.scale = (6, 6, 6)
    red.material_slots[0].link = "OBJECT"
    red.material_slots[0].material = made("one", RED)
    bpy.context.scene.collection.objects.link(red)
    return red


def grid(subdivisions):
    """2 subdivisions² smooth triangles on 2 × 2 units. Returns the mesh.

    From arrays, because Blender's own operator holds more than a render.
    """
    lit()
    side = subdivisions + 1
    mesh = bpy.data.meshes.new("grid")
    y, x = np.mgrid[0:side, 0:side].astype(np.float32) * 2 / subdivisions - 1
    mesh.vertices.add(side * side)
    mesh.vertices.foreach_set("co", np.stack([x, y, np.zeros_like(x)], -1).reshape(-1))
    corner = np.arange(side * side, dtype=np.int32).reshape(side, side)[:-1, :-1].reshape(-1, 1) + (
        0,
        1,
        side + 1,
        side,
    )
    mesh.loops.add(corner.size)
    mesh.loops.foreach_set("vertex_index", corner.reshape(-1).astype(np.int32))
    mesh.polygons.add(len(corner))
    mesh.polygons.foreach_set("loop_start", np.arange(0, corner.size, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    thing = bpy.data.objects.new("grid", mesh)
    bpy.context.scene.collection.objects.link(thing)
    wear(thing, "grid", RED)
    return mesh


def lit():
    """Nothing but a sun and a point light."""
    bpy.data.batch_remove(
        [
            *bpy.data.objects,
            *bpy.data.lights,
            *bpy.data.meshes,
            *bpy.data.materials,
            *bpy.data.collections,
        ]
    )
    sun, point = bpy.data.lights.new("Sun", "SUN"), bpy.data.lights.new("Point", "POINT")
    sun.energy, point.energy, point.shadow_soft_size = 2, 400, 0
    sun.angle = 0
    for lamp, location in ((sun, (0, 0, 5)), (point, (1, -4, 4))):
        thing = bpy.data.objects.new(lamp.name, lamp)
        thing.location = location
        bpy.context.scene.collection.objects.link(thing)
    bpy.data.objects["Sun"].rotation_euler = (0.6, 0.3, 0)


def wear(thing, name, color):
    thing.data.materials.append(made(name, color))


def made(name, color):
    """A new rough material."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = color
    return material
