"""Small scenes for the Cycles checks: every one is a few objects, Lambert materials and one
light.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy


def add(scene, name: str, data, matrix=None):
    """An object of `data`, placed by a 4×4 matrix."""
    from mathutils import Matrix

    item = bpy.data.objects.new(name, data)
    item.matrix_world = Matrix() if matrix is None else matrix
    scene.collection.objects.link(item)
    return item


def moved(x: float, y: float, z: float, *scale: float):
    """Translation times a diagonal scale."""
    from mathutils import Matrix

    return Matrix.Translation((x, y, z)) @ Matrix.Diagonal((*(scale or (1.0, 1.0, 1.0)), 1.0))


def looking_at(location, target):
    """A 4×4 matrix at `location` whose -z axis points to `target`."""
    from mathutils import Matrix, Vector

    direction = Vector(target) - Vector(location)
    return Matrix.Translation(location) @ direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()


def new_material(name: str):
    """(material, node tree, output node), all other nodes removed."""
    material = bpy.data.materials.new(name)
    cycles.use_nodes(material)
    material.node_tree.nodes.clear()
    return material, material.node_tree, material.node_tree.nodes.new("ShaderNodeOutputMaterial")


def lambert(color):
    """A Diffuse BSDF of roughness 0."""
    material, tree, output = new_material("Lambert")
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value, node.inputs["Roughness"].default_value = (*color, 1.0), 0.0
    tree.links.new(node.outputs["BSDF"], output.inputs["Surface"])
    return material


def metal(roughness: float, color=(0.8, 0.7, 0.5)):
    """A Glossy BSDF."""
    material, tree, output = new_material("Metal")
    node = tree.nodes.new("ShaderNodeBsdfAnisotropic")
    node.inputs["Roughness"].default_value = roughness
    node.inputs["Color"].default_value = (*color, 1)
    tree.links.new(node.outputs[0], output.inputs[0])
    return material


def mirror(color):
    """The same of roughness 0."""
    return metal(0.0, color)


def mesh(name: str, vertices, faces, smooth: bool = False, material=None):
    """A mesh from lists of points and of corner indices."""
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(v) for v in vertices], [], [tuple(f) for f in faces])
    data.polygons.foreach_set("use_smooth", np.full(len(data.polygons), smooth))
    if material is not None:
        data.materials.append(material)
    return data


def plane(size: float, material=None):
    return mesh(
        "Plane",
        [(-size, -size, 0), (size, -size, 0), (size, size, 0), (-size, size, 0)],
        [(0, 1, 2, 3)],
        material=material,
    )


def cube(material=None):
    """The cube [-1, 1]³."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh("Cube", corners, faces, material=material)


def ball(segments: int = 24, rings: int = 16, smooth: bool = True, material=None):
    """A unit UV sphere: quads and two fans of triangles."""
    points = [(0, 0, 1.0)]
    for i in range(1, rings):
        polar = pi * i / rings
        points += [
            (
                sin(polar) * cos(2 * pi * j / segments),
                sin(polar) * sin(2 * pi * j / segments),
                cos(polar),
            )
            for j in range(segments)
        ]
    points.append((0, 0, -1.0))
    last = len(points) - 1
    faces = []
    for j in range(segments):
        k = (j + 1) % segments
        faces += [(0, 1 + j, 1 + k), (last, last - segments + k, last - segments + j)]
        for above in range(1, 1 + (rings - 2) * segments, segments):
            below = above + segments
            faces.append((above + j, below + j, below + k, above + k))
    return mesh("Ball", points, faces, smooth, material)


def prism(sides: int = 7, material=None):
    """An upright prism with n-gon caps, radius 1, height 2."""
    ring = [(cos(2 * pi * k / sides), sin(2 * pi * k / sides)) for k in range(sides)]
    points = [(x, y, z) for z in (-1, 1) for x, y in ring]
    walls = [(k, (k + 1) % sides, sides + (k + 1) % sides, sides + k) for k in range(sides)]
    return mesh(
        "Prism",
        points,
        [*walls, tuple(range(sides))[::-1], tuple(range(sides, 2 * sides))],
        material=material,
    )


def add_camera(scene, location=(4.2, -5.6, 4.4), target=(0.0, 0.0, 0.4), **properties):
    """The scene's camera; properties are those of bpy.types.Camera."""
    data = bpy.data.cameras.new("Camera")
    for name, value in properties.items():
        setattr(data, name, value)
    scene.camera = add(scene, "Camera", data, looking_at(location, target))
    return scene.camera


def add_light(scene, kind: str, location, target=(0.0, 0.0, 0.0), **properties):
    """A hard light (no radius, no angle) unless properties say otherwise."""
    data = bpy.data.lights.new("Light", kind)
    if kind in ("POINT", "SPOT"):
        data.shadow_soft_size = 0.0
    if kind == "SUN":
        data.angle = 0.0
    for name, value in properties.items():
        setattr(data, name, value)
    return add(scene, "Light", data, looking_at(location, target))


def still_life(scene) -> None:
    """A floor, a flat box, a prism with n-gons and a flat-shaded ball, which throw shadows on each
    other.
    """
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.75, 0.7))))
    add(scene, "Box", cube(lambert((0.7, 0.2, 0.1))), moved(-1.3, 0.5, 0.61, 0.7, 0.5, 0.6))
    add(
        scene,
        "Prism",
        prism(material=lambert((0.1, 0.5, 0.3))),
        moved(1.1, 1.2, 0.81, 0.6, 0.6, 0.8),
    )
    add(
        scene,
        "Ball",
        ball(12, 8, False, lambert((0.2, 0.3, 0.8))),
        moved(0.6, -0.9, 0.71, 0.7, 0.7, 0.7),
    )


def smooth_life(scene) -> None:
    """A floor, two smooth balls."""
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.75, 0.7))))
    add(
        scene,
        "Ball",
        ball(48, 32, True, lambert((0.2, 0.3, 0.8))),
        moved(0.6, -0.7, 0.91, 0.9, 0.9, 0.9),
    )
    add(
        scene,
        "Small",
        ball(40, 24, True, lambert((0.7, 0.3, 0.2))),
        moved(-1.1, 0.7, 0.61, 0.6, 0.6, 0.6),
    )
