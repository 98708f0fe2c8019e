"""Volumes that nodes drive from place to place, beside Cycles, which scatters light once here."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes
from cycles_reference import bpy
from small_scenes import add, add_camera, add_light, moved, new_material, plane
from test_cycles_media import box, compared, glowing, linked, relative

SIZE = 24


def fed(kind: str, output, value, socket: str = "Density", **inputs):
    """A volume shader of the output, one of whose inputs a node's output feeds."""
    node = linked(kind, output, **inputs)
    output.id_data.links.new(value, node.inputs[socket])
    return node


def made(tree, kind: str, *sources, output=0, **settings):
    """The output of a new node. sources: what its inputs are, in their order; None for as it is."""
    node = tree.nodes.new(kind)
    for name, value in settings.items():
        setattr(node, name, value)
    for socket, source in zip(node.inputs, sources, strict=False):
        if isinstance(source, (int, float)):
            socket.default_value = source
        elif source is not None:
            tree.links.new(source, socket)
    return node.outputs[output]


def math(tree, operation: str, *sources, clamp: bool = False):
    return made(tree, "ShaderNodeMath", *sources, operation=operation, use_clamp=clamp)


def place(tree, output: str = "Object"):
    return tree.nodes.new("ShaderNodeTexCoord").outputs[output]


def part(tree, vector, k: int):
    return made(tree, "ShaderNodeSeparateXYZ", vector, output=k)


def assert_alike(found: np.ndarray, truth: np.ndarray, squares: float = 0.02) -> None:
    """Within 1 % in the mean and 2 % in squares of 4 × 4 pixels, as Cycles has grain."""
    assert np.isfinite(found).all()
    assert abs(found.mean() / truth.mean() - 1) < 0.01
    n = SIZE // 4
    assert relative(*(p.reshape(n, 4, n, 4, 3).mean((1, 3)) for p in (found, truth))) < squares


def test_a_box_that_gets_denser_upward() -> None:
    scene = cycles.empty_scene(SIZE, SIZE)
    glowing(scene)
    material, tree, output = new_material("fog")
    density = math(tree, "MULTIPLY", part(tree, place(tree, "Generated"), 2), 2.0)
    fed("ShaderNodeVolumeAbsorption", output, density, Color=(0.9, 0.5, 0.2, 1))
    box(scene, material)
    add_camera(scene, (3.3, -6.0, 4.0), (0, 0, 0), angle=0.6)
    assert_alike(*compared(scene, 256), squares=0.005)


def test_a_ball_that_thins_out() -> None:
    """In a ball that is stretched and turned: its own coordinates count."""
    scene = cycles.empty_scene(SIZE, SIZE)
    glowing(scene)
    material, tree, output = new_material("fog")
    radius = made(tree, "ShaderNodeVectorMath", place(tree), operation="LENGTH", output="Value")
    density = math(tree, "MULTIPLY", math(tree, "SUBTRACT", 1.0, radius, clamp=True), 3.0)
    fed("ShaderNodeVolumeAbsorption", output, density, Color=(0.9, 0.5, 0.2, 1))
    mesh = small_scenes.ball(64, 32, material=material)
    thing = add(scene, "ball", mesh, moved(0.2, 0.1, 0, 1.4, 0.9, 1.2))
    thing.rotation_euler = (0.3, 0.4, 0.5)
    add_camera(scene, (0.3, -1.0, 9.0), (0, 0, 0), angle=0.4)
    assert_alike(*compared(scene, 256), squares=0.01)


LAMPS = {
    "point": ("POINT", (1.6, -1.0, 2.0), {"energy": 300.0, "shadow_soft_size": 0.1}),
    "sun": ("SUN", (-1.0, -1.0, 2.0), {"energy": 3.0, "angle": 0.02}),
}


@pytest.mark.parametrize("lamp", LAMPS)
def test_smoke_of_noise_over_a_floor(lamp: str) -> None:
    scene = cycles.empty_scene(SIZE, SIZE)
    material, tree, output = new_material("smoke")
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 1.5
    tree.links.new(place(tree), noise.inputs["Vector"])
    holes = math(tree, "SUBTRACT", noise.outputs[0], 0.4, clamp=True)
    density = math(tree, "MULTIPLY", holes, 10.0)
    inputs = {"Color": (0.8, 0.7, 0.6, 1), "Anisotropy": 0.3}
    fed("ShaderNodeVolumePrincipled", output, density, **inputs)
    box(scene, material)
    floor, _, output = new_material("floor")
    linked("ShaderNodeBsdfDiffuse", output, "Surface", Color=(0.6, 0.6, 0.6, 1))
    add(scene, "floor", plane(6, floor), moved(0, 0, -1.2))
    kind, where, more = LAMPS[lamp]
    add_light(scene, kind, where, **more)
    add_camera(scene, (3.3, -5.0, 2.5), (0, 0, -0.2), angle=0.6)
    assert_alike(*compared(scene, 512, samples=16, light_samples=2), squares=0.03)


def test_a_fire_whose_colour_and_density_vary() -> None:
    scene = cycles.empty_scene(SIZE, SIZE)
    glowing(scene)
    material, tree, output = new_material("fire")
    height = part(tree, place(tree, "Generated"), 2)
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].color = (1, 0.5, 0.1, 1)
    ramp.color_ramp.elements[1].color = (0, 0, 0, 1)
    tree.links.new(height, ramp.inputs[0])
    density = math(tree, "MULTIPLY", height, 0.6)
    inputs = {"Color": (0, 0, 0, 1), "Emission_Strength": 0.8}
    node = fed("ShaderNodeVolumePrincipled", output, density, **inputs)
    tree.links.new(ramp.outputs[0], node.inputs["Emission Color"])
    box(scene, material)
    add_camera(scene, (3.3, -6.0, 2.0), (0, 0, 0), angle=0.6)
    assert_alike(*compared(scene, 256))


def test_a_temperature_that_falls_upward() -> None:
    """The brightness of black bodies goes with its fourth power."""
    scene = cycles.empty_scene(SIZE, SIZE)
    material, tree, output = new_material("fire")
    height = part(tree, place(tree, "Generated"), 2)
    kelvin = math(tree, "MULTIPLY_ADD", height, -800.0, 2000.0)
    inputs = {"Color": (0, 0, 0, 1), "Density": 0.5, "Blackbody_Intensity": 1.0}
    fed("ShaderNodeVolumePrincipled", output, kelvin, "Temperature", **inputs)
    box(scene, material)
    add_camera(scene, (3.3, -6.0, 2.0), (0, 0, 0), angle=0.6)
    assert_alike(*compared(scene, 256))


def test_ground_fog_of_the_world_in_a_room() -> None:
    """Rays without end see no fog that varies in Cycles, so walls end them here. Marched there, as
    what finds a bound of the density misses thin layers in so large a world.
    """
    scene = cycles.empty_scene(SIZE, SIZE)
    wall, _, output = new_material("wall")
    linked("ShaderNodeBsdfDiffuse", output, "Surface", Color=(0.6, 0.6, 0.6, 1))
    add(scene, "room", small_scenes.cube(wall), moved(0, 0, 4, 6, 6, 4.0))
    add(scene, "box", small_scenes.cube(wall), moved(0, 1, 0.5, 0.7, 0.7, 0.5))
    tree = scene.world.node_tree
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    height = part(tree, made(tree, "ShaderNodeNewGeometry", output="Position"), 2)
    thin = math(tree, "EXPONENT", math(tree, "MULTIPLY", height, -1.0))
    density = math(tree, "MULTIPLY", thin, 0.3)
    fed("ShaderNodeVolumeScatter", output, density, Color=(0.8, 0.85, 0.9, 1))
    scene.world.cycles.volume_step_size = 0.1
    add_light(scene, "POINT", (1.0, -1.0, 4.0), energy=500.0, shadow_soft_size=0.1)
    add_camera(scene, (0, -5.5, 1.5), (0, 0, 0.7), angle=0.9)
    assert_alike(*compared(scene, 256, samples=16, light_samples=2))


def test_what_a_mesh_has_is_0_in_its_volume() -> None:
    """An attribute of the mesh, and that which Principled Volume names, are nothing in both."""
    scene = cycles.empty_scene(SIZE, SIZE)
    glowing(scene)
    material, tree, output = new_material("fog")
    attribute = made(tree, "ShaderNodeAttribute", attribute_name="density", output=2)
    density = math(tree, "ADD", attribute, part(tree, place(tree, "Generated"), 2))
    inputs = {"Color": (0, 0, 0, 1), "Absorption_Color": (0.5, 0.2, 0.1, 1)}
    fed("ShaderNodeVolumePrincipled", output, density, **inputs)
    mesh = small_scenes.cube(material)
    layer = mesh.attributes.new("density", "FLOAT", "POINT")
    layer.data.foreach_set("value", np.linspace(0, 1, len(mesh.vertices), dtype=np.float32))
    add(scene, "box", mesh, moved(0, 0, 0))
    add_camera(scene, (3.3, -6.0, 4.0), (0, 0, 0), angle=0.6)
    assert_alike(*compared(scene, 256), squares=0.005)
    assert bpy.context.scene is scene
