"""N14: highlights from the broadest to the sharpest, k_s I (n·h)^p through Blender's node to the
pixel.

The view is so narrow that the highlight fills it: a pixel's h turns by half of what its ray turns.
The closed form takes the rays and the sun from Blender's matrices in float64. What the acceptance
list allows is for the power itself; Film rounds it to float32, which adds half a unit in the last
place of values up to 1: 2^-25.
"""

from __future__ import annotations

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from cycles_reference import render_cycles
from glint.addon.ui.nodes import add_blinn_phong
from glint_picture import render_glint
from measuring import compare
from test_cycles_blinn_phong import Network

ALLOWED = {0.0: 1e-6, 1.0: 1e-6, 1e2: 1e-6, 1e4: 1e-5, 1e6: 1e-4, 1e9: 5e-3}
FILM = 2.0**-25
SUN = (0.0, 1.0, 1.0)


def shining_floor(exponent: float, eye=(0.0, -2.0, 2.0)):
    """A floor of k_s 1 and nothing else, under a sun of I = 1, seen where the sun is mirrored; the
    view spans eight standard widths.
    """
    scene = extreme.new_scene()
    material, tree, output = build.new_material("Shine")
    node = add_blinn_phong(tree)
    for name in ("Ambient", "Diffuse", "Mirror", "Emission"):
        node.inputs[name].default_value = (0.0, 0.0, 0.0, 1.0)
    node.inputs["Specular"].default_value = (1.0, 1.0, 1.0, 1.0)
    node.inputs["Exponent"].default_value = exponent
    tree.links.new(node.outputs["BSDF"], output.inputs["Surface"])
    build.add(scene, "Floor", build.plane(50.0, material))
    build.add_light(scene, "SUN", SUN, energy=np.pi)
    half = min(0.5, 8.0 / max(exponent, 1.0) ** 0.5)
    build.add_camera(scene, eye, (0.0, 0.0, 0.0), lens=18 / half)
    return scene


def axes_of(item) -> np.ndarray:
    axes = np.array(item.matrix_world, float)[:3, :3]
    return axes / np.linalg.norm(axes, axis=0)


def power_of(scene, exponent: float) -> np.ndarray:
    """(h, w) of (n·h)^p with n = +z, from the squared sine: right to 1e-15 relative for every p
    here.
    """
    axes, light = axes_of(scene.camera), axes_of(scene.objects["Light"])[:, 2]
    half = scene.camera.data.sensor_width / 2 / scene.camera.data.lens
    line = half * ((2 * np.arange(extreme.SIDE) + 1) / extreme.SIDE - 1)
    x, y = np.meshgrid(line, line)
    ray = np.stack([x, y, -np.ones_like(x)], -1) @ axes.T
    h = light - ray / np.linalg.norm(ray, axis=-1, keepdims=True)
    sine2 = (h[..., 0] ** 2 + h[..., 1] ** 2) / (h**2).sum(-1)
    return np.exp(exponent / 2 * np.log1p(-sine2))


def as_cycles_network(scene, exponent: float) -> None:
    """The floor emits max(0, n·h)^p by Cycles' own math nodes."""
    tree = scene.objects["Floor"].data.materials[0].node_tree
    tree.nodes.clear()
    net = Network(tree)
    geometry = tree.nodes.new("ShaderNodeNewGeometry").outputs
    half = net.vector(
        "NORMALIZE",
        net.vector("ADD", tuple(axes_of(scene.objects["Light"])[:, 2]), geometry["Incoming"]),
    )
    shine = net.math(
        "POWER",
        net.math("MAXIMUM", net.vector("DOT_PRODUCT", geometry["Normal"], half), 0.0),
        exponent,
    )
    emission, output = (
        tree.nodes.new("ShaderNodeEmission"),
        tree.nodes.new("ShaderNodeOutputMaterial"),
    )
    tree.links.new(shine, emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])


@pytest.mark.parametrize("exponent", ALLOWED)
def test_exponent(exponent, rows):
    scene = shining_floor(exponent)
    strength = scene.objects["Light"].data.energy / np.pi
    truth = np.ones((extreme.SIDE, extreme.SIDE, 4))
    truth[..., :3] = strength * power_of(scene, exponent)[..., None]
    assert truth.max() > 0.9
    assert exponent < 2 or truth.min() < 0.1
    glint = render_glint(scene, "NATIVE").combined
    as_cycles_network(scene, exponent)
    row = compare(
        rows, "N14", f"exponent {exponent:g}", (render_cycles(scene)["Combined"], glint), truth
    )
    assert np.isfinite(glint).all()
    assert np.abs(glint - truth).max() <= ALLOWED[exponent] + FILM
    assert row.glint == 0


@pytest.mark.parametrize("exponent", [0.0, 1e9])
def test_no_half_vector(exponent):
    """Seen along the sun's rays from below, v + l is 0 in the middle and the sun is behind the
    surface: black, not NaN.
    """
    picture = render_glint(shining_floor(exponent, eye=(0.0, -2.0, -2.0)), "NATIVE").combined
    assert (picture[..., 3] == 1).all()
    assert (picture[..., :3] == 0).all()
