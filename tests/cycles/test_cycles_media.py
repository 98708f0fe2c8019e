"""What is inside of things and everywhere, beside Cycles, which scatters light once here."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, moved, new_material, plane


def linked(kind: str, output, socket: str = "Volume", **inputs):
    """A new node of a tree, with these inputs, linked to the output."""
    tree = output.id_data
    node = tree.nodes.new(kind)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], output.inputs[socket])
    return node


def glowing(scene, color=(0.9, 0.7, 0.5)) -> None:
    """A wall behind everything, seen as it is."""
    material, _, output = new_material("wall")
    linked("ShaderNodeEmission", output, "Surface", Color=(*color, 1.0))
    add(scene, "wall", plane(40, material), moved(0, 0, -4))


def ball(scene, material, size: float = 1.2, place=(0.0, 0.0, 0.0)) -> None:
    add(scene, "ball", small_scenes.ball(64, 32, material=material), moved(*place, *(size,) * 3))


def box(scene, material, size: float = 1.0, place=(0.0, 0.0, 0.0)) -> None:
    add(scene, "box", small_scenes.cube(material), moved(*place, *(size,) * 3))


def compared(scene, truth: int = 16, bounces: int = 0, **settings):
    """(h, w, 3) of Glint and of Cycles."""
    bpy.context.view_layer.update()
    settings = {"samples": 1, "max_bounces": bounces, **settings}
    film = render_glint(scene, "NATIVE", filter_width=0.0, **settings)
    cycles.make_exact(scene, truth, bounces=bounces)
    cycles.march_volumes(scene)
    scene.cycles.transmission_bounces = bounces
    scene.cycles.diffuse_bounces = settings.get("diffuse_bounces", 0)
    exact = cycles.render_passes(scene)["Combined"]
    return film.passes["Combined"][..., :3].astype(float), exact[..., :3].astype(float)


def relative(found, truth) -> float:
    """Root of the mean square over the mean."""
    return float(np.sqrt(np.square(found - truth).mean()) / truth.mean())


VOLUMES = {
    "absorption": ("ShaderNodeVolumeAbsorption", {"Color": (0.9, 0.5, 0.2, 1), "Density": 0.7}),
    "principled": (
        "ShaderNodeVolumePrincipled",
        {"Color": (0, 0, 0, 1), "Absorption_Color": (0.8, 0.3, 0.1, 1), "Density": 0.6},
    ),
}


@pytest.mark.parametrize("kind", VOLUMES)
def test_what_absorbs_in_a_box_and_a_ball_across_each_other(kind: str) -> None:
    """Two media, which overlap: straight through both."""
    scene = cycles.empty_scene(48, 48)
    glowing(scene)
    node, inputs = VOLUMES[kind]
    for make, shift in ((ball, -0.5), (box, 0.6)):
        material, _, output = new_material(make.__name__)
        linked(node, output, **inputs)
        make(scene, material, place=(shift, 0, 0))
    add_camera(scene, (0.3, -1.0, 9.0), (0, 0, 0), angle=0.6)
    found, truth = compared(scene)
    assert relative(found, truth) < 2e-3


def test_colored_glass() -> None:
    scene = cycles.empty_scene(48, 48)
    glowing(scene)
    material, _, output = new_material("glass")
    linked("ShaderNodeBsdfRefraction", output, "Surface", Color=(1, 1, 1, 1), IOR=1.3, Roughness=0)
    linked("ShaderNodeVolumeAbsorption", output, Color=(0.2, 0.8, 0.5, 1), Density=0.8)
    ball(scene, material)
    add_camera(scene, (0.3, -1.0, 9.0), (0, 0, 0), angle=0.4)
    found, truth = compared(scene, bounces=4)
    assert relative(found, truth) < 2e-3


def test_light_through_what_absorbs() -> None:
    """A shadow with colours, in a world that absorbs too, with the camera inside of a medium."""
    scene = cycles.empty_scene(48, 48)
    material, _, output = new_material("floor")
    linked("ShaderNodeBsdfDiffuse", output, "Surface", Color=(0.8, 0.8, 0.8, 1))
    add(scene, "floor", plane(6, material), moved(0, 0, -2))
    material, _, output = new_material("fluid")
    linked("ShaderNodeVolumeAbsorption", output, Color=(0.9, 0.5, 0.2, 1), Density=0.7)
    ball(scene, material)
    box(scene, material, 0.5, (0.3, -1.0, 6.0))
    out = next(n for n in scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    linked("ShaderNodeVolumeAbsorption", out, Color=(0.5, 0.8, 0.9, 1), Density=0.1)
    add_light(scene, "POINT", (1.0, 0.5, 3.0), energy=300.0)
    add_camera(scene, (0.3, -1.0, 6.0), (0, 0, -2), angle=0.8)
    found, truth = compared(scene)
    assert relative(found, truth) < 2e-3


FOG = {"Color": (0.9, 0.7, 0.4, 1), "Density": 0.5, "Anisotropy": 0.4}
LAMPS = {
    "point": ("POINT", (1.6, -1.0, 1.5), {"energy": 200.0}),
    "inside": ("POINT", (0.3, 0.2, 0.3), {"energy": 100.0, "shadow_soft_size": 0.2}),
    "spot": ("SPOT", (2.0, -1.0, 2.0), {"energy": 400.0, "spot_size": 0.5, "spot_blend": 0.2}),
    "area": ("AREA", (1.0, -1.5, 2.0), {"energy": 200.0, "size": 1.0}),
    "sun": ("SUN", (1.0, -1.0, 2.0), {"energy": 3.0}),
}


def assert_alike(found: np.ndarray, truth: np.ndarray) -> None:
    """Within 0.5 % in the mean and 2 % in squares of 4 × 4 pixels, as Cycles has grain."""
    assert abs(found.mean() / truth.mean() - 1) < 0.005
    squares = [p.reshape(6, 4, 6, 4, 3).mean((1, 3)) for p in (found, truth)]
    assert relative(*squares) < 0.02


@pytest.mark.parametrize("lamp", LAMPS)
def test_what_a_box_of_fog_scatters_once(lamp: str) -> None:
    """With a bar in it, which throws its shadow through the fog."""
    scene = cycles.empty_scene(24, 24)
    material, _, output = new_material("fog")
    linked("ShaderNodeVolumeScatter", output, **FOG)
    box(scene, material)
    material, _, output = new_material("bar")
    linked("ShaderNodeBsdfDiffuse", output, "Surface", Color=(0.1, 0.1, 0.1, 1))
    add(scene, "bar", small_scenes.cube(material), moved(0.3, -0.3, 0.7, 0.3, 0.8, 0.05))
    kind, place, more = LAMPS[lamp]
    add_light(scene, kind, place, **more)
    add_camera(scene, (0.3, -6.0, 2.0), (0, 0, 0), angle=0.5)
    assert_alike(*compared(scene, 1024, samples=64, light_samples=2))


def test_fire() -> None:
    """What glows, and dims what is behind; it lights nothing."""
    scene = cycles.empty_scene(24, 24)
    glowing(scene)
    for shift, density in ((-0.4, 0.8), (0.4, 0.0)):
        material, _, output = new_material("fire")
        linked(
            "ShaderNodeVolumePrincipled",
            output,
            Color=(0, 0, 0, 1),
            Density=density,
            Emission_Strength=0.3,
            Emission_Color=(1.0, 0.5, 0.2, 1.0),
            Blackbody_Intensity=1.0,
            Temperature=1500.0,
        )
        ball(scene, material, 0.7, (shift, 0, 0))
    add_camera(scene, (0.3, -1.0, 9.0), (0, 0, 0), angle=0.4)
    found, truth = compared(scene)
    assert relative(found, truth) < 2e-3


def test_a_cone_of_light_in_the_world() -> None:
    scene = cycles.empty_scene(24, 24)
    out = next(n for n in scene.world.node_tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    linked("ShaderNodeVolumeScatter", out, Color=(0.5, 0.7, 0.9, 1), Density=0.08, Anisotropy=-0.3)
    add_light(scene, "SPOT", (0.0, 0.0, 4.0), energy=2000.0, spot_size=0.7, shadow_soft_size=0.1)
    add_camera(scene, (0.3, -9.0, 1.0), (0, 0, 0.5), angle=0.7)
    assert_alike(*compared(scene, 4096, samples=64, light_samples=2))


def test_a_sky_and_a_lamp_of_triangles_in_fog() -> None:
    scene = cycles.empty_scene(24, 24)
    cycles.set_world(scene, (0.2, 0.3, 0.5))
    material, _, output = new_material("fog")
    linked("ShaderNodeVolumeScatter", output, **FOG)
    ball(scene, material)
    material, _, output = new_material("glow")
    linked("ShaderNodeEmission", output, "Surface", Strength=20.0)
    add(scene, "glow", small_scenes.cube(material), moved(1.6, -0.5, 1.6, 0.3, 0.3, 0.3))
    add_camera(scene, (0.3, -6.0, 2.0), (0, 0, 0), angle=0.5)
    assert_alike(*compared(scene, 1024, samples=64, light_samples=2))


def test_fog_lights_what_lamps_do_not_reach() -> None:
    """A wall beside the cone of a spot lamp: all its light has gone by way of the fog."""
    scene = cycles.empty_scene(32, 32)
    material, _, output = new_material("fog")
    linked("ShaderNodeVolumeScatter", output, Density=0.2)
    box(scene, material, 3.0)
    add(scene, "wall", plane(2.0, small_scenes.lambert((0.8, 0.6, 0.4))))
    add_light(scene, "SPOT", (-2, 0, 2.5), (2, 0, 2.5), energy=2000, spot_size=0.8)
    add_camera(scene, (0, 0, 0.5), (0, 0, 0), angle=1.2)
    settings = {"samples": 64, "light_samples": 2, "soft_light": "DEALT", "diffuse_bounces": 4}
    found, truth = compared(scene, 512, bounces=4, **settings)
    np.testing.assert_allclose(found.mean((0, 1)), truth.mean((0, 1)), rtol=0.03)
    assert truth.mean() > 0.03
