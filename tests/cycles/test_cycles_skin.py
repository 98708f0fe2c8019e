"""Skin under fur beside Cycles: the light that it gets, and what it throws back."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from test_cycles_hair import COLORS, SUNS, ball_of_fur, worn

SKINS = {"bright": (0.8,) * 3 + (1,), "middling": (0.3,) * 3 + (1,), "dark": (0.02,) * 3 + (1,)}


def skin_and_fur(count: int, skin: str, light: str, color="brown", model="CHIANG", floor=False):
    """A ball of fur in the sun, and what is fur."""
    scene, fur = ball_of_fur(count)
    scene.render.resolution_x = scene.render.resolution_y = 48
    below = next(o for o in scene.objects if o.type == "MESH").data.materials[0].node_tree
    below.nodes["Diffuse BSDF"].inputs["Color"].default_value = SKINS[skin]
    node = worn(fur, "ShaderNodeBsdfHairPrincipled")
    node.parametrization, node.inputs["Color"].default_value = "COLOR", COLORS[color]
    node.model = model
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.angle, lamp.energy = 0.05, 3.0
    sun = bpy.data.objects.new("Sun", lamp)
    sun.rotation_euler = SUNS[light]
    scene.collection.objects.link(sun)
    if floor:
        bpy.ops.mesh.primitive_plane_add(size=12, location=(0, 0, -1.6))
        grey = worn(bpy.context.object, "ShaderNodeBsdfDiffuse")
        grey.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1)
    return scene, fur


def both_means(scene, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the upper half of Cycles' picture with 8 bounces, and ours."""
    scene.render.use_border = scene.render.use_crop_to_border = True
    scene.render.border_min_y = (20 + 0.01) / 48
    # over whole pixels, which the sun reaches here and there
    cycles.make_exact(scene, 128, 0, 8)
    scene.cycles.filter_width = 1.0
    scene.cycles.transmission_bounces = scene.cycles.diffuse_bounces = 8
    truth = cycles.render_passes(scene)["Combined"]
    told = {"diffuse_bounces": 4, "max_bounces": 8, "soft_light": "DEALT"}
    film = render_glint(scene, "NATIVE", samples=samples, **told)
    assert truth.shape == film.combined.shape
    assert truth.shape[0] * 48 == truth.shape[1] * 28
    return tuple(f[..., :3].mean((0, 1)) for f in (truth, film.combined))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "color", "light"),
    [
        ("CHIANG", "brown", "front"),
        ("CHIANG", "black", "top"),
        ("CHIANG", "brown", "side"),
        ("HUANG", "black", "front"),
        ("HUANG", "brown", "top"),
        ("HUANG", "black", "side"),
    ],
)
def test_skin_under_fur_gets_the_light_that_passes_this(model, color, light):
    """Of a ball under 6000 strands that the camera does not see: within a fifth."""
    scene, fur = skin_and_fur(6000, "middling", light, color, model)
    scene.render.resolution_x = scene.render.resolution_y = 96
    fur.visible_camera = False
    truth, mine = both_means(scene, 64)
    np.testing.assert_allclose(mine, truth, rtol=0.2)


@pytest.mark.parametrize(("light", "floor"), [("front", False), ("front", True), ("side", False)])
def test_what_a_bright_skin_throws_onto_fur(light, floor):
    """Of a ball of fur in the sun, what a bright skin below adds to the mean beside Cycles' with 8
    bounces, within a fifth.
    """
    bright, dark = (
        both_means(skin_and_fur(1500, skin, light, floor=floor)[0], 64)
        for skin in ("bright", "dark")
    )
    np.testing.assert_allclose(bright[1] - dark[1], bright[0] - dark[0], rtol=0.2)
