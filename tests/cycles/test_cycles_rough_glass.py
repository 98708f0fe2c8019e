"""What is seen through rough glass, beside Cycles."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import add, add_camera, ball, moved, new_material, plane


@pytest.mark.parametrize("distribution", ["BECKMANN", "GGX"])
@pytest.mark.parametrize("roughness", [0.2, 0.4, 0.6])
def test_an_edge_behind_it_is_as_blurred_as_in_cycles(roughness: float, distribution: str) -> None:
    """A pane of one side above a square that glows, along a line across its edge: within 0.03."""
    scene = cycles.empty_scene(48, 16)
    material, tree, output = new_material("glow")
    glow = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    add(scene, "half", plane(4, material), moved(4, 0, 0))
    material, tree, output = new_material("glass")
    glass = tree.nodes.new("ShaderNodeBsdfRefraction")
    glass.distribution = distribution
    glass.inputs["Roughness"].default_value = roughness
    tree.links.new(glass.outputs[0], output.inputs["Surface"])
    add(scene, "pane", plane(2, material), moved(0, 0, 4))
    add_camera(scene, (0, 0, 6), (0, 0, 0), type="ORTHO", ortho_scale=3.0)
    bpy.context.view_layer.update()
    glint = render_glint(scene, "NATIVE", samples=256, max_bounces=2, filter_width=0.0)
    reference = cycles.render_cycles(scene, 256, bounces=2)["Combined"][..., :3]
    found, truth = (
        np.asarray(picture)[..., :3].mean((0, 2))
        for picture in (glint.passes["Combined"], reference)
    )
    assert np.abs(found - truth).max() < 0.03
    assert abs(found.mean() - truth.mean()) < 0.01
    blurred = (truth > 0.02) & (truth < 0.98)
    assert blurred.sum() > 40 * roughness**2


def _even_world(scene) -> np.ndarray:
    """Cycles' picture without Filter Glossy, which takes light away from glass: it makes lobes
    wider after they were scaled for what they scatter again.
    """
    cycles.make_exact(scene, 64, bounces=24)
    scene.cycles.transmission_bounces, scene.cycles.blur_glossy = 24, 0.0
    return cycles.render_passes(scene)["Combined"]


@pytest.mark.parametrize(("roughness", "most"), [(0.1, 0.015), (0.3, 0.025)])
def test_a_ball_in_an_even_world_is_as_bright_as_in_cycles(roughness: float, most: float) -> None:
    """From its middle to where light that it mirrors inside is half of all: rings of a tenth of the
    radius.
    """
    scene = cycles.empty_scene(96, 96)
    cycles.set_world(scene, (1.0, 1.0, 1.0))
    material, tree, output = new_material("glass")
    glass = tree.nodes.new("ShaderNodeBsdfGlass")
    glass.inputs["Roughness"].default_value, glass.inputs["IOR"].default_value = roughness, 1.45
    tree.links.new(glass.outputs[0], output.inputs["Surface"])
    add(scene, "ball", ball(48, 32, material=material))
    add_camera(scene, (0, -6, 0), (0, 0, 0), type="ORTHO", ortho_scale=2.0)
    bpy.context.view_layer.update()
    glint = render_glint(scene, "NATIVE", samples=256, max_bounces=24, filter_width=0.0)
    reference = _even_world(scene)
    found, truth = (np.asarray(x)[..., :3].mean(2) for x in (glint.passes["Combined"], reference))
    across = (np.arange(96) + 0.5) / 48 - 1
    ring = (10 * np.hypot(across, across[:, None])).astype(int)
    for number in range(10):
        inside = ring == number
        assert abs(found[inside].mean() - truth[inside].mean()) < most, number


@pytest.mark.parametrize("elevation", [40, 20, 10])
def test_a_pane_seen_aslant_in_an_even_world_is_as_bright_as_in_cycles(elevation: float) -> None:
    """Within 0.06: light that facets send to the wrong side of the pane is lost."""
    scene = cycles.empty_scene(16, 16)
    cycles.set_world(scene, (1.0, 1.0, 1.0))
    material, tree, output = new_material("glass")
    glass = tree.nodes.new("ShaderNodeBsdfGlass")
    glass.inputs["Roughness"].default_value, glass.inputs["IOR"].default_value = 0.3, 1.45
    tree.links.new(glass.outputs[0], output.inputs["Surface"])
    add(scene, "pane", plane(50, material))
    e = np.radians(elevation)
    place = (0, -20 * np.cos(e), 20 * np.sin(e))
    add_camera(scene, place, (0, 0, 0), type="ORTHO", ortho_scale=0.01)
    bpy.context.view_layer.update()
    glint = render_glint(scene, "NATIVE", samples=64, max_bounces=24, filter_width=0.0)
    reference = _even_world(scene)
    found, truth = (np.asarray(x)[..., :3].mean() for x in (glint.passes["Combined"], reference))
    assert found == pytest.approx(truth, abs=0.06)
