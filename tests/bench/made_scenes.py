"""Ten scenes of fronts.py that no file holds, each made of what is slow or hard to draw clean."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import stages  # noqa: F401  (the path of small_scenes)
from small_scenes import add, add_camera, add_light, ball, cube, lambert, moved, new_material, plane


def principled(name: str, color=(0.8, 0.8, 0.8), **values):
    """A material of one Principled BSDF. values: of its inputs, by name with _ for spaces."""
    material, tree, output = new_material(name)
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (*color, 1.0)
    for key, value in values.items():
        node.inputs[key.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def floor(scene, material=None) -> None:
    add(scene, "floor", plane(10.0, material or lambert((0.6, 0.55, 0.5))))


def sky(scene, color=(0.5, 0.6, 0.8)) -> None:
    import bpy

    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (*color, 1.0)


def lathe(scene, name: str, profile: list[tuple[float, float]], material) -> None:
    """A body of revolution. profile: radius and height of its rings, from axis to axis."""
    import bpy

    sides = 48
    turns = [2 * math.pi * k / sides for k in range(sides)]
    vertices = [(r * math.cos(a), r * math.sin(a), z) for r, z in profile for a in turns]
    faces = [
        (i * sides + k, i * sides + (k + 1) % sides, (i + 1) * sides + (k + 1) % sides)
        + ((i + 1) * sides + k,)
        for i in range(len(profile) - 1)
        for k in range(sides)
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(material)
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    mesh.validate()
    add(scene, name, mesh)


def bottle(scene) -> None:
    """Of rough glass, with a liquid in it."""
    floor(scene)
    glass = principled("glass", (0.9, 0.95, 0.9), Roughness=0.15, IOR=1.5, Transmission_Weight=1.0)
    liquid = principled("liquid", (0.9, 0.5, 0.1), Roughness=0.0, IOR=1.33, Transmission_Weight=1.0)
    outer = [(0.0, 0.01), (0.5, 0.01), (0.55, 0.06), (0.55, 1.2), (0.2, 1.5), (0.2, 1.8)]
    inner = [(0.15, 1.8), (0.15, 1.5), (0.48, 1.15), (0.48, 0.1), (0.0, 0.1)]
    lathe(scene, "bottle", outer + inner, glass)
    lathe(scene, "drink", [(0.0, 0.12), (0.46, 0.12), (0.46, 0.9), (0.0, 0.9)], liquid)
    add_light(scene, "AREA", (2.0, -2.0, 3.0), energy=250, size=1.0)
    sky(scene)
    add_camera(scene, (2.6, -3.4, 2.0), (0.0, 0.0, 0.8))


def balls(scene) -> None:
    """Of glass, mirror and rough metal, behind and before each other."""
    floor(scene, principled("tiles", (0.3, 0.35, 0.4), Roughness=0.3))
    kinds = (
        principled("clear", (1, 1, 1), Roughness=0.0, IOR=1.45, Transmission_Weight=1.0),
        principled("frosted", (1, 0.9, 0.8), Roughness=0.3, IOR=1.45, Transmission_Weight=1.0),
        principled("chrome", (0.9, 0.9, 0.9), Roughness=0.0, Metallic=1.0),
        principled("brass", (0.9, 0.7, 0.3), Roughness=0.25, Metallic=1.0),
    )
    for k, material in enumerate(kinds):
        body = ball(32, 24, material=material)
        add(scene, material.name, body, moved(1.3 * k - 2, k % 2, 0.5, 0.5, 0.5, 0.5))
    add_light(scene, "AREA", (0.0, -3.0, 4.0), energy=300, size=1.5)
    sky(scene)
    add_camera(scene, (0.5, -6.0, 2.2), (0.0, 0.0, 0.4))


def hair(scene) -> None:
    """Three thousand strands on a ball, in a room's corner."""
    import bpy

    floor(scene)
    head = ball(32, 24, material=lambert((0.5, 0.3, 0.2)))
    add(scene, "skin", head, moved(0, 0, 1, 0.8, 0.8, 0.8))
    curves = bpy.data.hair_curves.new("hair")
    chance, count, points = random.Random(1), 3000, 6
    curves.add_curves([points] * count)
    places = []
    for _ in range(count):
        z, turn = chance.uniform(-0.4, 1.0), chance.uniform(0, 2 * math.pi)
        r = math.sqrt(1 - z * z)
        n = (r * math.cos(turn), r * math.sin(turn), z)
        for k in range(points):
            s = k / (points - 1)
            out = 0.8 + 0.6 * s
            places += [n[0] * out, n[1] * out, 1 + n[2] * out - 0.25 * s * s]
    curves.position_data.foreach_set("vector", places)
    curves.attributes.new("radius", "FLOAT", "POINT").data.foreach_set(
        "value", [0.004] * (count * points)
    )
    material, tree, output = new_material("fibre")
    node = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    curves.materials.append(material)
    add(scene, "hair", curves)
    add_light(scene, "AREA", (3.0, -3.0, 4.0), energy=400, size=1.0)
    sky(scene, (0.3, 0.35, 0.4))
    add_camera(scene, (0.0, -5.0, 2.2), (0.0, 0.0, 1.0))


def fog(scene) -> None:
    """Lit by a spot lamp through bars."""
    material, tree, output = new_material("fog")
    node = tree.nodes.new("ShaderNodeVolumeScatter")
    node.inputs["Density"].default_value = 0.15
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    floor(scene)
    add(scene, "fog", cube(material), moved(0, 0, 2, 4, 4, 2.1))
    for k in range(5):
        add(scene, f"bar{k}", cube(lambert((0.3,) * 3)), moved(k - 2, 1, 2, 0.1, 0.1, 1.5))
    add_light(scene, "SPOT", (0.5, 3.5, 3.5), (0, -1, 0.5), energy=1500, spot_size=1.2)
    add_camera(scene, (0.0, -7.0, 2.0), (0.0, 0.0, 1.4))


def lamps(scene) -> None:
    """Ninety small soft ones over a crowd of boxes."""
    floor(scene)
    chance = random.Random(2)
    for k in range(60):
        size = chance.uniform(0.1, 0.35)
        place = chance.uniform(-4, 4), chance.uniform(-4, 4), size
        add(scene, f"box{k}", cube(lambert((0.7, 0.6, 0.5))), moved(*place, size, size, size))
    for _ in range(90):
        place = chance.uniform(-4, 4), chance.uniform(-4, 4), chance.uniform(0.8, 2.0)
        color = [chance.uniform(0.4, 1.0) for _ in range(3)]
        add_light(scene, "POINT", place, energy=8, shadow_soft_size=0.08, color=color)
    add_camera(scene, (0.0, -7.5, 4.5), (0.0, 0.0, 0.2))


def room(scene) -> None:
    """Lit by the sky through two windows."""
    wall = lambert((0.75, 0.72, 0.68))
    for name, place in {
        "floor": (0, 0, -0.1, 3, 3, 0.1),
        "ceiling": (0, 0, 2.6, 3, 3, 0.1),
        "back": (0, 3, 1.25, 3, 0.1, 1.45),
        "left": (-3, 0, 1.25, 0.1, 3, 1.45),
        "front": (0, -3.1, 1.25, 3, 0.1, 1.45),
        "sill": (3, 0, 0.35, 0.1, 3, 0.45),
        "lintel": (3, 0, 2.3, 0.1, 3, 0.3),
        "pier": (3, 0, 1.4, 0.1, 0.6, 0.6),
    }.items():
        add(scene, name, cube(wall), moved(*place))
    add(scene, "table", cube(lambert((0.5, 0.25, 0.12))), moved(0.6, 0.5, 0.4, 0.8, 0.5, 0.4))
    add(scene, "ball", ball(material=lambert((0.2, 0.4, 0.6))), moved(0.6, 0.5, 1.2, 0.4, 0.4, 0.4))
    sky(scene, (2.0, 2.3, 2.8))
    add_light(scene, "SUN", (4, -1, 4), energy=6, angle=0.02)
    add_camera(scene, (-2.4, -2.4, 1.5), (1.2, 1.2, 0.9), lens=24)


def nodes(scene) -> None:
    """Materials of many textures and bumps."""
    for k in range(3):
        material, tree, output = new_material(f"rock{k}")
        shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
        ramp, bump = tree.nodes.new("ShaderNodeValToRGB"), tree.nodes.new("ShaderNodeBump")
        noise, cells = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeTexVoronoi")
        wave = tree.nodes.new("ShaderNodeTexWave")
        noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 3 + k, 8
        cells.inputs["Scale"].default_value, bump.inputs["Strength"].default_value = 5 + 2 * k, 0.4
        ramp.color_ramp.elements[0].color = (0.1, 0.05, 0.2 * k, 1)
        tree.links.new(noise.outputs[0], ramp.inputs[0])
        tree.links.new(ramp.outputs[0], shader.inputs["Base Color"])
        tree.links.new(cells.outputs[0], bump.inputs["Height"])
        tree.links.new(bump.outputs[0], shader.inputs["Normal"])
        tree.links.new(wave.outputs[1], shader.inputs["Roughness"])
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
        rock = ball(32, 24, material=material)
        add(scene, f"rock{k}", rock, moved(1.6 * k - 1.6, 0, 0.7, 0.7, 0.7, 0.7))
    floor(scene, material)
    add_light(scene, "AREA", (2.0, -3.0, 4.0), energy=300, size=1.0)
    sky(scene)
    add_camera(scene, (0.0, -5.5, 2.4), (0.0, 0.0, 0.4))


def catcher(scene) -> None:
    """Of shadows, under what is set into a photograph."""
    floor(scene)
    scene.objects["floor"].is_shadow_catcher = True
    scene.render.film_transparent = True
    add(scene, "box", cube(lambert((0.7, 0.3, 0.2))), moved(-0.6, 0, 0.4, 0.4, 0.4, 0.4))
    shiny = principled("ball", (0.2, 0.4, 0.7), Roughness=0.2)
    add(scene, "ball", ball(32, 24, material=shiny), moved(0.7, 0, 0.5, 0.5, 0.5, 0.5))
    add_light(scene, "AREA", (2.5, -1.5, 3.0), energy=300, size=1.0)
    sky(scene)
    add_camera(scene, (0.5, -5.0, 2.6), (0.0, 0.0, 0.3))


def wires(scene) -> None:
    """A quarter of a pixel thin, dark before the sky and bright before a wall."""
    floor(scene)
    add(scene, "wall", cube(lambert((0.1,) * 3)), moved(2, 3, 1.5, 2, 0.1, 1.5))
    for k in range(24):
        light = lambert((0.9,) * 3 if k % 2 else (0.05,) * 3)
        bar = moved(0, 0.1 * k, 0.3 + 0.11 * k, 4, 0.003, 0.003)
        add(scene, f"wire{k}", cube(light), bar)
    add_light(scene, "SUN", (2, -3, 4), energy=3, angle=0.01)
    sky(scene)
    add_camera(scene, (0.0, -6.0, 1.6), (0.0, 0.0, 1.2))


def skin(scene) -> None:
    """Wax, cloth and lacquer: what glows within, has a sheen, and a coat."""
    floor(scene)
    kinds = (
        principled("wax", (0.8, 0.5, 0.35), Subsurface_Weight=1.0, Subsurface_Scale=0.15),
        principled("cloth", (0.3, 0.1, 0.2), Roughness=0.9, Sheen_Weight=1.0),
        principled("lacquer", (0.5, 0.02, 0.02), Roughness=0.4, Coat_Weight=1.0),
    )
    for k, material in enumerate(kinds):
        body = ball(32, 24, material=material)
        add(scene, material.name, body, moved(1.3 * k - 1.3, 0, 0.5, 0.5, 0.5, 0.5))
    add_light(scene, "AREA", (2.0, 2.0, 3.0), energy=300, size=1.0)
    sky(scene, (0.2, 0.25, 0.3))
    add_camera(scene, (0.0, -4.5, 1.8), (0.0, 0.0, 0.4))


MADE: dict[str, Callable] = {
    made.__name__: made
    for made in (bottle, balls, hair, fog, lamps, room, nodes, catcher, wires, skin)
}


def open_made(name: str) -> None:
    """The scene of that name, square, in a new file."""
    import bpy

    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    MADE[name](bpy.context.scene)
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = 512
