"""Sheen beside Cycles: what balls of cloth reflect of a uniform world, by the angle of view."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, ball, new_material

SIDE = 48
BASE, TINT = (0.6, 0.2, 0.4), (0.3, 1.0, 0.5)


def sheen(distribution: str) -> Callable:
    def shade(tree, roughness: float):
        node = tree.nodes.new("ShaderNodeBsdfSheen")
        node.distribution = distribution
        node.inputs["Color"].default_value = (*TINT, 1.0)
        node.inputs["Roughness"].default_value = roughness
        return node

    return shade


def over_paint(tree, roughness: float):
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    values = {
        "Base Color": (*BASE, 1.0),
        "Specular IOR Level": 0.0,
        "Sheen Weight": 0.8,
        "Sheen Roughness": roughness,
        "Sheen Tint": (*TINT, 1.0),
    }
    for name, value in values.items():
        node.inputs[name].default_value = value
    return node


def cloth(scene, shade: Callable, roughness: float) -> None:
    """A ball that fills the picture of an orthographic camera above it."""
    material, tree, output = new_material("cloth")
    tree.links.new(shade(tree, roughness).outputs[0], output.inputs["Surface"])
    add(scene, "ball", ball(128, 64, material=material))
    add_camera(scene, (0, 0, 5), (0, 0, 0), type="ORTHO", ortho_scale=2.0)
    cycles.set_world(scene, (1.0, 1.0, 1.0))
    bpy.context.view_layer.update()


@pytest.mark.parametrize("roughness", [0.3, 0.45, 0.9])
@pytest.mark.parametrize(
    ("shade", "most"),
    [(sheen("MICROFIBER"), 0.05), (sheen("ASHIKHMIN"), 0.08), (over_paint, 0.05)],
    ids=["microfiber", "ashikhmin", "principled"],
)
def test_cloth_is_as_bright_as_in_cycles(shade: Callable, most: float, roughness: float) -> None:
    """From 10° to 80° off the surface, within what the fit is told to miss, and 0.01 of noise."""
    scene = cycles.empty_scene(SIDE, SIDE)
    cloth(scene, shade, roughness)
    y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) * (2 / SIDE) - 1
    cosine = np.sqrt(np.maximum(0.0, 1 - x * x - y * y))
    seen = cosine > 0.2
    glint = render_glint(scene, "NATIVE", samples=16, filter_width=0.0).passes["Combined"][..., :3]
    reference = cycles.render_cycles(scene, 128)["Combined"][..., :3]
    off = np.abs(glint - reference)[seen]
    assert off.max() < most + 0.01
    assert np.abs((glint - reference)[seen].mean(0)).max() < 0.015
    assert np.ptp(reference[seen][:, 1]) > 0.1


@pytest.mark.parametrize("roughness", [0.3, 0.5, 1.0])
@pytest.mark.parametrize(
    ("shade", "most", "mean"),
    [(sheen("MICROFIBER"), 0.05, 0.01), (sheen("ASHIKHMIN"), 0.85, 0.11), (over_paint, 0.05, 0.01)],
    ids=["microfiber", "ashikhmin", "principled"],
)
def test_cloth_under_a_sun_is_as_in_cycles(
    shade: Callable, most: float, mean: float, roughness: float
) -> None:
    """From in front, aside and behind, n·v above 0.2: microfibres within 5 % of the brightest
    point; velvet, which is no such lobe, on average within 11 % of it.
    """
    scene = cycles.empty_scene(SIDE, SIDE)
    cloth(scene, shade, roughness)
    cycles.set_world(scene, (0.0, 0.0, 0.0))
    sun = bpy.data.lights.new("sun", "SUN")
    sun.angle, sun.energy = 0.0, np.pi
    lamp = add(scene, "sun", sun)
    y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) * (2 / SIDE) - 1
    seen = x * x + y * y < 0.96
    for angle in (0.3, 1.3, 2.4):
        from mathutils import Matrix

        lamp.matrix_world = Matrix.Rotation(angle, 4, "Y")
        bpy.context.view_layer.update()
        glint = render_glint(scene, "NATIVE").passes["Combined"][..., :3]
        reference = cycles.render_cycles(scene, 1)["Combined"][..., :3]
        lit = seen & (reference.sum(-1) > 0) & (glint.sum(-1) > 0)
        assert lit.sum() > 50
        off = np.abs(glint - reference)[lit]
        assert off.max() < most * reference[lit].max() + 0.005, angle
        assert off.mean() < mean * reference[lit].max()


@pytest.mark.parametrize("name", ["Coat Weight", "Sheen Weight"])
def test_layers_weigh_more_than_one_where_a_node_says_so(name: str) -> None:
    """A ball under a sun, by the weight of its layer: at 40 nothing is left of what lies below."""
    scene = cycles.empty_scene(24, 24)
    material, tree, output = new_material("layered")
    paint, weight = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeValue")
    inputs = {"Specular IOR Level": 0.0, "Coat Roughness": 0.4, "Base Color": (*BASE, 1.0)}
    for socket, value in inputs.items():
        paint.inputs[socket].default_value = value
    tree.links.new(paint.outputs[0], output.inputs["Surface"])
    tree.links.new(weight.outputs[0], paint.inputs[name])
    add(scene, "ball", ball(48, 32, material=material))
    add_camera(scene, (0, -3, 0), (0, 0, 0))
    add_light(scene, "SUN", (1, -3, 1), energy=3.0)
    seen = []
    for number, most in ((1.0, 0.005), (1.5, 0.005), (40.0, 0.03)):
        weight.outputs[0].default_value = number
        reference = cycles.render_cycles(scene)["Combined"][..., :3].mean()
        glint = render_glint(scene, "NATIVE").combined[..., :3].mean()
        assert glint == pytest.approx(reference, rel=most)
        seen.append(reference)
    assert abs(seen[1] / seen[0] - 1) > 0.005 and seen[2] > 1.5 * seen[1]
