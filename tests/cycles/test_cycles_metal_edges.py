"""Metals' colours at grazing angles beside Cycles: Principled's Specular Tint, the Metallic BSDF's
Edge Tint, physical conductors, rough and as mirrors.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS, render_glint
from small_scenes import add, add_camera, ball, new_material

GOLD = (0.9, 0.6, 0.2, 1.0)
TINT = (0.2, 0.6, 0.9, 1.0)
HAS_METALLIC = hasattr(bpy.types, "ShaderNodeBsdfMetallic")


def tinted(kind: str, roughness: float):
    material, tree, output = new_material(kind)
    node = tree.nodes.new(f"ShaderNodeBsdf{kind.partition(' ')[0]}")
    node.inputs["Base Color"].default_value = GOLD
    node.inputs["Roughness"].default_value = roughness
    if kind == "Principled":
        node.inputs["Metallic"].default_value = 1.0
        node.inputs["Specular Tint"].default_value = TINT
    elif kind == "Metallic":
        node.inputs["Edge Tint"].default_value = TINT
    else:
        node.fresnel_type = "PHYSICAL_CONDUCTOR"
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def rings(picture: np.ndarray) -> np.ndarray:
    """(5, 3) means over rings of the ball, from its middle to its outline."""
    size = len(picture)
    y, x = (np.mgrid[:size, :size] + 0.5) / size * 2 - 1
    radius = np.hypot(x, y) / 0.95
    edges = (0.0, 0.6, 0.8, 0.9, 0.95, 0.985)
    return np.array(
        [picture[(radius >= a) & (radius < b)].mean(0) for a, b in itertools.pairwise(edges)]
    )


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("kind", ["Principled", "Metallic", "Metallic conductor"])
def test_a_ball_in_an_even_world(kind: str, roughness: float, backend: str) -> None:
    """Ring by ring the colour that Fresnel says."""
    if kind != "Principled" and not HAS_METALLIC:
        pytest.skip("the node is of Blender 4.3")
    scene = cycles.empty_scene(64, 64)
    cycles.set_world(scene, (0.5, 0.5, 0.5))
    add(scene, "ball", ball(96, 64, material=tinted(kind, roughness)))
    camera = add_camera(scene, (0, 0, 5), (0, 0, 0))
    data = (camera or scene.camera).data
    data.type, data.ortho_scale = "ORTHO", 2 / 0.95
    settings = {
        "samples": 16 if backend == "NATIVE" else 8,
        "light_samples": 8,
        "max_bounces": 1,
        "filter_width": 0.0,
    }
    ours = render_glint(scene, backend, **settings).combined[..., :3]
    cycles.make_exact(scene, 128, bounces=1)
    theirs = cycles.render_passes(scene)["Combined"][..., :3]
    np.testing.assert_allclose(rings(ours), rings(theirs), atol=0.02)
