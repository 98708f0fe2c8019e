"""Thin films beside Cycles: colours by the angle of view of mirrors, paint, glass and bubbles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_glint
from small_scenes import add, add_camera, add_light, ball, new_material


def filmed(kind: str, thickness: float, by_nodes: bool = False, **inputs):
    material, tree, output = new_material("film")
    node = tree.nodes.new(f"ShaderNodeBsdf{kind}")
    if "Thin Film Thickness" not in node.inputs:
        pytest.skip(f"this Blender's {kind} has no thin film")
    if "IOR" in inputs and kind == "Metallic":
        node.fresnel_type = "PHYSICAL_CONDUCTOR"
    for name, value in {"Thin Film Thickness": thickness, "Thin Film IOR": 1.33, **inputs}.items():
        node.inputs[name].default_value = value
    if by_nodes:
        added = tree.nodes.new("ShaderNodeMath")
        added.inputs[1].default_value = thickness
        source = tree.nodes.new("ShaderNodeAttribute")
        source.attribute_name = "none"
        tree.links.new(source.outputs["Fac"], added.inputs[0])
        tree.links.new(added.outputs[0], node.inputs["Thin Film Thickness"])
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def scene_of(kind: str, thickness: float, panel: bool = False, **more):
    """A ball in a white world, or in a black one with a panel."""
    scene = cycles.empty_scene(48, 48)
    cycles.set_world(scene, (0.0, 0.0, 0.0) if panel else (1.0, 1.0, 1.0))
    add(scene, "ball", ball(96, 64, material=filmed(kind, thickness, **more)))
    if panel:
        add_light(scene, "AREA", (2, -3, 3), energy=300.0, size=1.5)
    add_camera(scene, (0, -6, 0), (0, 0, 0), lens=85)
    return scene


def both(scene, backend: str, samples: int) -> tuple[np.ndarray, np.ndarray]:
    options = {"samples": 4, "light_samples": 8, "filter_width": 0.01, "diffuse_bounces": 0}
    ours = render_glint(scene, backend, max_bounces=8, **options).combined[..., :3]
    cycles.make_exact(scene, samples)
    own = scene.cycles
    own.max_bounces = own.transmission_bounces = own.glossy_bounces = 8
    own.blur_glossy = 0.0
    return ours, cycles.render_passes(scene)["Combined"][..., :3]


BLACK = {"Base Color": (0.0, 0.0, 0.0, 1.0), "IOR": 1.5}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("by_nodes", [False, True])
@pytest.mark.parametrize("thickness", [120.0, 400.0, 900.0])
def test_a_mirror(thickness: float, by_nodes: bool, backend: str) -> None:
    """Each pixel of the ball."""
    scene = scene_of("Principled", thickness, by_nodes=by_nodes, Roughness=0.0, **BLACK)
    ours, theirs = both(scene, backend, 1)
    inside = theirs.max(-1) < 0.5
    assert inside.sum() > 400 and theirs[inside].std(0).min() > 0.005
    assert np.abs(ours - theirs)[inside].max() < 2e-3


METALS = {
    "gold": ("Principled", {"Metallic": 1.0, "Base Color": (0.9, 0.6, 0.3, 1.0)}),
    "tinted": ("Metallic", {"Base Color": (0.6, 0.5, 0.5, 1.0), "Edge Tint": (0.8, 0.7, 0.9, 1.0)}),
    "conductor": ("Metallic", {"IOR": (0.2, 0.9, 1.4), "Extinction": (3.9, 2.4, 1.9)}),
}


@pytest.mark.parametrize("thickness", [100.0, 600.0])
@pytest.mark.parametrize("name", METALS)
def test_metals(name: str, thickness: float) -> None:
    """Each pixel of the ball but its rim; Cycles sums three terms."""
    if bpy.app.version < (5, 0, 0):
        pytest.skip("films on metals are of Blender 5.0")
    kind, inputs = METALS[name]
    scene = scene_of(kind, thickness, Roughness=0.0, **inputs)
    ours, theirs = both(scene, "NATIVE", 1)
    x = (np.arange(48) - 23.5) / 24
    inside = np.hypot(*np.meshgrid(x, x)) < 0.75
    assert theirs[inside].std(0).max() > 0.01
    assert np.abs(ours - theirs)[inside].max() < 0.015
    np.testing.assert_allclose(ours[inside].mean(0), theirs[inside].mean(0), rtol=5e-3)


def rings(picture: np.ndarray) -> np.ndarray:
    """(4, 3) means by how far from the middle of the ball."""
    x = ((np.arange(48) + 0.5) / 24 - 1) * 18 / 85
    r = np.hypot(*np.meshgrid(x, x))
    sine = 6 * r / np.sqrt(1 + r * r)
    edges = (0.0, 0.3, 0.6, 0.8, 0.95)
    return np.array(
        [picture[(sine >= a) & (sine < b)].mean(0) for a, b in itertools.pairwise(edges)]
    )


@pytest.mark.parametrize("roughness", [0.1, 0.2])
def test_a_rough_mirror(roughness: float) -> None:
    scene = scene_of("Principled", 400.0, Roughness=roughness, **BLACK)
    ours, theirs = map(rings, both(scene, "NATIVE", 256))
    np.testing.assert_allclose(ours, theirs, atol=2.5e-3)


def test_paint_below_a_film() -> None:
    color = (0.8, 0.5, 0.2, 1.0)
    inputs = {"Base Color": color, "IOR": 1.5, "Roughness": 0.3}
    ours, theirs = map(rings, both(scene_of("Principled", 400.0, **inputs), "NATIVE", 256))
    np.testing.assert_allclose(ours, theirs, rtol=0.01)


@pytest.mark.parametrize("ior", [1.0, 1.5])
def test_glass_and_bubbles_show_a_panel(ior: float) -> None:
    """Twice: before and behind, there from inside."""
    scene = scene_of("Glass", 400.0, panel=True, Roughness=0.0, IOR=ior)
    ours, theirs = both(scene, "NATIVE", 1024)
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=0.06)
