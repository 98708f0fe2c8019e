"""Pattern textures in pictures, as an artist makes them: nothing linked to Vector, so they lie in
the mesh's Generated coordinates.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_pair, surface_interior
from small_scenes import add, add_camera, ball, moved, prism

SETTINGS = {
    "ShaderNodeTexChecker": {},
    "ShaderNodeTexGradient": {"gradient_type": "RADIAL"},
    "ShaderNodeTexWave": {"wave_type": "RINGS", "rings_direction": "Y"},
    "ShaderNodeTexMagic": {"turbulence_depth": 2},
    "ShaderNodeTexBrick": {"squash": 0.6, "squash_frequency": 3},
    "ShaderNodeTexGabor": {"gabor_type": "3D"},
}
NODES = [kind for kind in SETTINGS if hasattr(bpy.types, kind)]
STEPS = ("ShaderNodeTexChecker", "ShaderNodeTexBrick")
"""Textures with edges, where the last bit of a coordinate decides about a pixel."""


def shining(kind: str):
    """A material that shines with a texture."""
    material = bpy.data.materials.new("texture")
    cycles.use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    texture, emission, surface = (
        tree.nodes.new(name) for name in (kind, "ShaderNodeEmission", "ShaderNodeOutputMaterial")
    )
    for name, value in SETTINGS[kind].items():
        setattr(texture, name, value)
    for name, value in {"Distortion": 1.5, "Detail": 2.5, "Mortar Smooth": 0.5}.items():
        if name in texture.inputs:
            texture.inputs[name].default_value = value
    tree.links.new(texture.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], surface.inputs["Surface"])
    return material


@pytest.mark.parametrize("kind", NODES)
def test_picture_is_that_of_cycles(kind):
    scene = cycles.empty_scene(72, 72)
    material = shining(kind)
    add(scene, "Ball", ball(material=material), moved(1.1, -0.6, 0.8, 1.2, 1.2, 1.2))
    add(scene, "Prism", prism(material=material), moved(-1.2, 0.6, 0.6, 1.1, 1.1, 1.3))
    add_camera(scene)
    pair = render_pair(scene, "NATIVE", kind)
    found, wanted = pair.colors()
    inside = surface_interior(pair.cycles)
    assert inside.sum() > 300
    error = np.abs(found - np.maximum(wanted, 0.0)).max(-1)[inside]
    allowed = 0.005 if kind in STEPS else 0.0
    assert (error > 1e-3).mean() <= allowed, (
        f"{(error > 1e-3).sum()} pixels, up to {error.max():.2g}"
    )
    assert wanted[inside].std() > 0.02, "the texture is nearly flat, so nothing is checked"
