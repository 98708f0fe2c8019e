"""Subsurface scattering beside Cycles: edges of light, walls lit from behind, a head."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.engine.analysis.flip import flip
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, lambert, moved, new_material, plane

METHODS = ["BURLEY", "RANDOM_WALK", "RANDOM_WALK_SKIN"]


def wax(method: str, color=(0.8, 0.5, 0.3), radius=(1.0, 0.5, 0.5), scale: float = 0.5):
    material, tree, output = new_material("Wax")
    node = tree.nodes.new("ShaderNodeSubsurfaceScattering")
    node.falloff = method
    node.inputs["Color"].default_value = (*color, 1.0)
    node.inputs["Radius"].default_value = radius
    node.inputs["Scale"].default_value = scale
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def skin(method: str, scale: float):
    material, tree, output = new_material("Skin")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.subsurface_method = method
    node.inputs["Base Color"].default_value = (0.8, 0.55, 0.45, 1.0)
    node.inputs["Subsurface Weight"].default_value = 1.0
    node.inputs["Subsurface Radius"].default_value = (1.0, 0.2, 0.1)
    node.inputs["Subsurface Scale"].default_value = scale
    node.inputs["Roughness"].default_value = 0.6
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def box(material, x: float, z: float, low: float) -> None:
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, low + z / 2))
    bpy.context.object.scale = (x, x, z)
    bpy.context.object.data.materials.append(material)


def pair(scene, samples: int, of_cycles: int) -> tuple[np.ndarray, np.ndarray]:
    film = render_glint(
        scene, "NATIVE", samples=samples, light_samples=2, filter_width=0.01, soft_light="RESOLVED"
    )
    cycles.make_exact(scene, of_cycles)
    return film.combined[..., :3], cycles.render_passes(scene)["Combined"][..., :3]


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_the_edge_of_sunlight_on_a_thick_slab(method: str) -> None:
    """How bright it is at each distance from the edge, over what the light is far from it."""
    scene = cycles.empty_scene(96, 16)
    scale = {"BURLEY": 2.0, "RANDOM_WALK": 2.0, "RANDOM_WALK_SKIN": 1.5}[method]
    box(wax(method, scale=scale), 40.0, 10.0, -10.0)
    sheet = add(scene, "sheet", plane(10.0, lambert((0.5,) * 3)), moved(10, 0, 1))
    sheet.visible_camera = False
    add_camera(scene, (0, 0, 5), (0, 0, 0), type="ORTHO", ortho_scale=3.0)
    add_light(scene, "SUN", (0, 0, 3), (0, 0, 0), energy=np.pi, angle=0.0)
    glint, reference = (picture.mean(0) for picture in pair(scene, 256, 256))
    off = np.abs(glint / glint[0] - reference / reference[0])
    most, mean = (0.06, 0.015) if method == "BURLEY" else (0.1, 0.035)
    assert off.max() < most and off.mean() < mean, (off.max(0), off.mean(0))
    beyond = reference[48:].sum(0) / reference[0]
    assert beyond.min() > 0.7  # pixels
    np.testing.assert_allclose(glint[48:].sum(0) / glint[0], beyond, rtol=0.15)


@pytest.mark.parametrize("method", METHODS[:2])
@pytest.mark.parametrize("thick", [0.04, 0.1])
def test_walls_lit_from_behind(method: str, thick: float) -> None:
    """Red, of which most comes through; a diffuse wall is black."""
    scene = cycles.empty_scene(16, 16)
    box(wax(method, (0.8, 0.6, 0.5), (1.0, 0.5, 0.3), 0.3), 20.0, thick, -thick / 2)
    add_camera(scene, (0, 0, 5), (0, 0, 0), type="ORTHO", ortho_scale=2.0)
    add_light(scene, "SUN", (0, 0, -2), (0, 0, 0), energy=np.pi, angle=0.0)
    glint, reference = (picture.mean((0, 1)) for picture in pair(scene, 64, 512))
    assert 0.6 < glint[0] / reference[0] < 1.25, (glint, reference)
    assert reference[0] > 0.15


@pytest.mark.parametrize(("method", "scale"), [("BURLEY", 2.0), ("RANDOM_WALK", 0.7)])
def test_a_head(method: str, scale: float) -> None:
    """Lit from the side: what is dark without it glows, and shines through at the ears."""
    scene = cycles.empty_scene(64, 64)
    bpy.ops.mesh.primitive_monkey_add(size=2)
    head = bpy.context.object
    head.data.materials.append(skin(method, scale))
    head.data.polygons.foreach_set("use_smooth", [True] * len(head.data.polygons))
    smooth = head.modifiers.new("smooth", "SUBSURF")
    smooth.levels = smooth.render_levels = 2
    head.rotation_euler = (0.9, 0, 0.3)
    add_camera(scene, (0, -5, 0.8), (0, 0, 0), type="PERSP", lens=60)
    add_light(scene, "AREA", (2.5, 0.5, 1.5), (0, 0, 0), energy=250, size=0.6)
    cycles.set_world(scene, (0.05, 0.05, 0.06))
    glint, reference = pair(scene, 64, 256)
    film = render_glint(
        scene, "NATIVE", samples=16, light_samples=2, filter_width=0.01, subsurface="OFF"
    )
    matt = film.combined[..., :3]
    np.testing.assert_allclose(glint.mean((0, 1)), reference.mean((0, 1)), rtol=0.07)
    seen, without = (flip(picture, reference).mean() for picture in (glint, matt))
    assert seen < 0.6 * without, (seen, without)
    assert abs(matt.mean((0, 1))[0] / reference.mean((0, 1))[0] - 1) > 0.15
