"""The Light Path node beside Cycles: what surfaces show of how a ray came to them."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import BACKENDS, render_glint, surface_interior
from small_scenes import add, add_camera, moved, new_material, plane

OUTPUTS = (
    "Is Camera Ray",
    "Is Glossy Ray",
    "Is Singular Ray",
    "Is Reflection Ray",
    "Is Transmission Ray",
    "Is Shadow Ray",
    "Is Diffuse Ray",
    "Ray Length",
    "Ray Depth",
    "Diffuse Depth",
    "Glossy Depth",
    "Transparent Depth",
    "Transmission Depth",
)
BOUNCES = 4


def shader(name: str, kind: str, **inputs):
    material, tree, output = new_material(name)
    node = tree.nodes.new(kind)
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def telling(output: str):
    """A material that shines with an output of the node."""
    material, tree, surface = new_material("telling")
    path, emission = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(path.outputs[output], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], surface.inputs["Surface"])
    return material


def fill(scene, material) -> None:
    """A floor seen straight, through one pane and two of glass, through one and two veils, and in
    a mirror; a camera whose clip start is not next to it.
    """
    add(scene, "floor", plane(6, material))
    add(scene, "wall", plane(6, material), moved(0, 0, 8, 1, 1, 1))
    glass = shader("glass", "ShaderNodeBsdfRefraction", Roughness=0.0, IOR=1.2)
    veil = shader("veil", "ShaderNodeBsdfTransparent", Color=(0.9, 0.8, 0.7, 1.0))
    mirror = shader("mirror", "ShaderNodeBsdfAnisotropic", Roughness=0.0, Color=(0.9,) * 3 + (1,))
    for name, made, x, heights in (
        ("glass", glass, -1.6, (1.0,)),
        ("panes", glass, -0.6, (1.0, 1.4)),
        ("veil", veil, 0.4, (1.0,)),
        ("veils", veil, 1.4, (0.8, 1.4)),
        ("mirror", mirror, 2.4, (0.5,)),
    ):
        for height in heights:
            add(scene, name, plane(0.4, made), moved(x, 0, height))
    add_camera(scene, (0.4, -1.0, 6.0), (0.4, 0.0, 0.0), clip_start=0.5)


def in_cycles(scene) -> dict[str, np.ndarray]:
    cycles.make_exact(scene, bounces=BOUNCES)
    scene.cycles.transmission_bounces = BOUNCES
    return cycles.render_passes(scene)


@pytest.mark.parametrize("output", OUTPUTS)
def test_an_output_is_cycles(output: str) -> None:
    scene = cycles.empty_scene(64, 48)
    fill(scene, telling(output))
    wanted = in_cycles(scene)
    inside = surface_interior(wanted)
    for backend in BACKENDS:
        film = render_glint(scene, backend, max_bounces=BOUNCES)
        found = film.passes["Combined"][..., :3]
        off = np.abs(found - wanted["Combined"][..., :3])[inside]
        assert off.max() <= 2e-4, (backend, off.max())
    assert inside.mean() > 0.5
    if output not in ("Is Shadow Ray", "Is Diffuse Ray", "Diffuse Depth"):
        assert wanted["Combined"][..., 0][inside].std() > 0.02


MATT_OUTPUTS = ("Is Camera Ray", "Is Glossy Ray", "Is Singular Ray", "Is Reflection Ray")
MATT_OUTPUTS += ("Is Transmission Ray", "Is Diffuse Ray", "Ray Depth", "Diffuse Depth")
MATT_OUTPUTS += ("Glossy Depth", "Transparent Depth", "Transmission Depth")


@pytest.mark.parametrize("output", MATT_OUTPUTS)
def test_a_world_lights_matt_surfaces_as_cycles(output: str) -> None:
    """A sky of 0.2 and the output."""
    scene = cycles.empty_scene(16, 16)
    cycles.use_nodes(scene.world)
    tree = scene.world.node_tree
    tree.nodes.clear()
    path, add_up = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMath")
    background = tree.nodes.new("ShaderNodeBackground")
    add_up.inputs[1].default_value = 0.2
    tree.links.new(path.outputs[output], add_up.inputs[0])
    tree.links.new(add_up.outputs[0], background.inputs["Color"])
    tree.links.new(background.outputs[0], tree.nodes.new("ShaderNodeOutputWorld").inputs["Surface"])
    add(scene, "floor", plane(6, shader("white", "ShaderNodeBsdfDiffuse")))
    add_camera(scene, (0, -1, 4), (0, 0, 0))
    wanted = in_cycles(scene)["Combined"][..., :3]
    assert wanted.std() < 1e-5
    for backend in BACKENDS:
        film = render_glint(scene, backend, max_bounces=BOUNCES, world_light="OCCLUDED")
        np.testing.assert_allclose(film.passes["Combined"][..., :3], wanted, rtol=1e-3)


@pytest.mark.parametrize("output", ["Is Camera Ray", "Is Glossy Ray", "Is Singular Ray"])
def test_what_glows_for_other_rays_lights_nothing_matt(output: str) -> None:
    """As in Cycles: a wall that glows where mirrors, or the camera, see it."""
    scene = cycles.empty_scene(16, 16)
    add(scene, "floor", plane(2, shader("white", "ShaderNodeBsdfDiffuse")))
    wall = add(scene, "wall", plane(2, telling(output)), moved(0, 1, 1))
    wall.rotation_euler.x = np.pi / 2
    add_camera(scene, (0, -0.5, 3), (0, -0.5, 0), lens=150)
    assert in_cycles(scene)["Combined"][..., :3].max() == 0
    for backend in BACKENDS:
        found = render_glint(scene, backend, mesh_light="ON").passes["Combined"][..., :3]
        assert found.max() == 0


def test_shadows_know_how_long_they_are() -> None:
    """A pane that lets light through by the length of the ray that looks for it."""
    scene = cycles.empty_scene(48, 48)
    material, tree, output = new_material("pane")
    path, node = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeBsdfTransparent")
    scaled = tree.nodes.new("ShaderNodeMath")
    scaled.operation, scaled.inputs[1].default_value = "MULTIPLY", 0.25
    tree.links.new(path.outputs["Ray Length"], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], node.inputs["Color"])
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    add(scene, "floor", plane(3, shader("white", "ShaderNodeBsdfDiffuse")))
    add(scene, "pane", plane(1, material), moved(0, 0, 1.5))
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 300.0, 0.0
    add(scene, "lamp", lamp, moved(0.3, 0.2, 3.0))
    add_camera(scene, (0, -4, 0.8), (0, 0, 0.2))
    wanted = in_cycles(scene)
    inside = surface_interior(wanted)
    for backend in BACKENDS:
        found = render_glint(scene, backend, max_bounces=BOUNCES).passes["Combined"][..., :3]
        off = np.abs(found - wanted["Combined"][..., :3])[inside]
        assert np.quantile(off, 0.98) <= 2e-4 * wanted["Combined"][..., :3].max()
