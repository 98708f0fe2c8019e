"""What shines and what glass lets pass, where a file's caustics are on and off, beside Cycles."""

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS, render_glint
from small_scenes import add, add_camera, add_light, ball, cube, lambert, moved, new_material, plane

SIZE = 16, 16


def shiny(metallic: float, roughness: float):
    material, tree, output = new_material("Shiny")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1.0)
    node.inputs["Metallic"].default_value = metallic
    node.inputs["Roughness"].default_value = roughness
    tree.links.new(node.outputs[0], output.inputs[0])
    return material


def wall_over_floor(metallic: float, roughness: float):
    """A wall that a floor in the sun lights, and nothing else."""
    scene = cycles.empty_scene(*SIZE)
    add(scene, "Floor", plane(10.0, shiny(metallic, roughness)))
    wall = add(scene, "Wall", plane(1.0, lambert((0.8, 0.8, 0.8))))
    wall.rotation_euler, wall.location = (np.pi / 2, 0, 0), (0, 0, 1.5)
    add_light(scene, "SUN", (0, 0, 9), energy=3.0)
    add_camera(scene, (0, -6, 1.5), (0, 0, 1.5), lens=200)
    return scene


def both(scene, backend: str, kind: str, is_on: bool) -> tuple[np.ndarray, np.ndarray]:
    """Of Glint and of Cycles, with that kind of caustics on or off, rows of pixels."""
    setting = {f"{kind}_caustics": "ON" if is_on else "OFF"}
    plan = {"samples": 16 if backend == "NATIVE" else 4, "light_samples": 4, "diffuse_bounces": 1}
    plan |= {"soft_light": "DEALT", "max_bounces": 4, "filter_width": 0.0}
    ours = render_glint(scene, backend, **(plan | setting)).combined[..., :3].astype(float)
    cycles.make_exact(scene, 256)
    own = scene.cycles
    own.max_bounces = own.diffuse_bounces = 1
    own.glossy_bounces = own.transmission_bounces = 0
    if kind == "refractive":
        own.max_bounces = own.transmission_bounces = own.glossy_bounces = 8
    own.caustics_reflective = own.caustics_refractive = False
    setattr(own, f"caustics_{kind}", is_on)
    return ours, cycles.render_passes(scene)["Combined"][..., :3]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("is_on", [False, True])
@pytest.mark.parametrize("roughness", [0.3, 0.7])
def test_paint_throws_as_much_as_in_cycles(roughness: float, is_on: bool, backend: str) -> None:
    """Without caustics as if it were matt all through."""
    ours, theirs = both(wall_over_floor(0.0, roughness), backend, "reflective", is_on)
    assert theirs.mean() > 0.1
    assert ours.mean() / theirs.mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("roughness", [0.0, 0.3])
def test_metal_throws_nothing_without_caustics(roughness: float, backend: str) -> None:
    ours, theirs = both(wall_over_floor(1.0, roughness), backend, "reflective", False)
    assert theirs.max() == 0 and ours.max() == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_glass_is_as_dark_as_cycles_where_a_file_has_no_caustics(backend: str) -> None:
    """A pane over a floor: a lamp and the sky light nothing below, but from beside it."""
    scene = cycles.empty_scene(*SIZE)
    cycles.set_world(scene, (0.3, 0.4, 0.5))
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.8, 0.8))))
    material, tree, output = new_material("Glass")
    node = tree.nodes.new("ShaderNodeBsdfGlass")
    node.inputs["Roughness"].default_value = 0.0
    tree.links.new(node.outputs[0], output.inputs[0])
    pane = add(scene, "Pane", cube(material), moved(0, 0, 1.5, 20.0, 20.0, 0.2))
    pane.visible_camera = False
    add_camera(scene, (0, 0, 9), (0, 0, 0), lens=80)
    add_light(scene, "SUN", (0, 0, 4), energy=3.0)
    ours, theirs = both(scene, backend, "refractive", False)
    assert theirs.mean() < 0.01 and ours.mean() < 0.01
    ours, theirs = both(scene, backend, "refractive", True)
    assert ours.min() > 0.1 and theirs.mean() > 0.1


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_of_glass_casts_a_shadow(backend: str) -> None:
    """As dark as Cycles' round its bright middle, where no sky lights it."""
    scene = cycles.empty_scene(32, 32)
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.8, 0.8))))
    material, tree, output = new_material("Glass")
    node = tree.nodes.new("ShaderNodeBsdfGlass")
    node.inputs["Roughness"].default_value = 0.0
    tree.links.new(node.outputs[0], output.inputs[0])
    body = add(scene, "Ball", ball(64, 32, material=material), moved(0, 0, 1.2, 1.0, 1.0, 1.0))
    body.visible_camera = False
    add_camera(scene, (0, 0, 9), (0, 0, 0), lens=80)
    add_light(scene, "SUN", (0, 0, 4), energy=3.0)
    ours, theirs = both(scene, backend, "reflective", False)
    dark = theirs.max(-1) < 0.01
    assert 0.05 < dark.mean() < 0.5
    assert (ours[dark].max(-1) < 0.01).mean() > 0.8
