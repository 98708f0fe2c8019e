"""Passes of light and of colours against Cycles."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.engine.film import BY_SURFACE
from glint_picture import render_glint, surface_interior
from small_scenes import (
    add,
    add_camera,
    add_light,
    cube,
    lambert,
    mirror,
    moved,
    new_material,
    plane,
)

SIZE = 40, 30
NAMES = tuple(f"use_pass_{name.lower().replace(' ', '_')}" for name in BY_SURFACE)


def glass():
    material, tree, output = new_material("Glass")
    material.use_transparent_shadow = False  # Cycles' share of it is left out: diffuse_bounces
    node = tree.nodes.new("ShaderNodeBsdfGlass")
    node.inputs["Roughness"].default_value, node.inputs["IOR"].default_value = 0.0, 1.45
    tree.links.new(node.outputs[0], output.inputs[0])
    return material


def scene_of_kinds():
    """A matt floor, a mirror, a pane of glass, in a sun before a grey world."""
    scene = cycles.empty_scene(*SIZE)
    cycles.set_world(scene, (0.3, 0.4, 0.5))
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.4, 0.2))))
    add(scene, "Mirror", cube(mirror((0.9, 0.8, 0.7))), moved(-1.1, 0.4, 0.7, 0.7, 0.7, 0.7))
    add(scene, "Glass", cube(glass()), moved(1.1, -0.3, 0.7, 0.6, 0.6, 0.6))
    add_camera(scene)
    add_light(scene, "SUN", (3, 1, 4), energy=3.0)
    for switch in NAMES:
        setattr(bpy.context.view_layer, switch, True)
    return scene


@pytest.fixture(scope="module")
def both() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    scene = scene_of_kinds()
    plan = {"samples": 16, "light_samples": 4, "filter_width": 0.0, "max_bounces": 8}
    ours = render_glint(scene, "NATIVE", passes=frozenset({*BY_SURFACE, "Position"}), **plan).passes
    cycles.make_exact(scene, 256, bounces=8)
    scene.cycles.transmission_bounces = 8
    scene.cycles.diffuse_bounces = 0
    return ours, cycles.render_passes(scene)


@pytest.mark.parametrize("name", BY_SURFACE)
def test_they_are_those_of_cycles(name: str, both) -> None:
    ours, truth = both
    inside = surface_interior(truth)
    ours, truth = ours[name][inside].astype(float), truth[name][inside]
    if name == "Diffuse Indirect":  # not asked for; Cycles has a little by way of glass
        assert not ours.any()
        return
    assert np.sqrt(((ours - truth) ** 2).mean()) < 0.02 * max(truth.max(), 1e-3), name
