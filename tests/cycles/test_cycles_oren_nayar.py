"""Rough matt surfaces beside Cycles: the Roughness of Diffuse and the Diffuse Roughness of
Principled, as constants and by nodes, under lamps, suns, worlds and what glows.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
import test_cycles_bounced_light as bounced
from cycles_reference import bpy
from glint_picture import BACKENDS, render_glint
from small_scenes import add, add_camera, ball, lambert, moved, new_material, plane
from test_cycles_toon import light

ROUGHNESSES = (0.25, 1.0)
HAS_INPUT = bpy.app.version >= (4, 3, 0)
"""Whether Principled has a Diffuse Roughness."""


def rough(kind: str, roughness: float):
    """VARIED: by a texture, as its colour is."""
    material, tree, output = new_material("rough")
    principled = kind == "PRINCIPLED"
    node = tree.nodes.new(f"ShaderNodeBsdf{'Principled' if principled else 'Diffuse'}")
    name = "Diffuse Roughness" if principled else "Roughness"
    node.inputs[name].default_value = roughness
    color = node.inputs["Base Color" if principled else "Color"]
    color.default_value = (0.9, 0.5, 0.2, 1.0)
    if principled:
        node.inputs["Specular IOR Level"].default_value = 0.0
    if kind == "VARIED":
        noise = tree.nodes.new("ShaderNodeTexNoise")
        noise.inputs["Scale"].default_value = 1.5
        tree.links.new(noise.outputs[0], node.inputs[name])
        tree.links.new(noise.outputs["Color"], color)
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def scene_of(kind: str, roughness: float, lit_by: str):
    """A rough ball and floor, and a matt one that throws shadows on them."""
    scene = cycles.empty_scene(48, 36)
    material = rough(kind, roughness)
    add(scene, "floor", plane(3.0, material))
    add(scene, "ball", ball(48, 32, material=material), moved(0, 0, 0.9, 0.9, 0.9, 0.9))
    add(
        scene,
        "small",
        ball(material=lambert((0.5, 0.5, 0.5))),
        moved(0.9, -1.2, 1.5, 0.3, 0.3, 0.3),
    )
    light(scene, lit_by)
    add_camera(scene)
    return scene


def both(scene, backend: str, samples: int, of_cycles: int) -> tuple[np.ndarray, np.ndarray]:
    settings = {"samples": samples, "light_samples": samples, "filter_width": 0.0}
    dark = {"max_bounces": 0, "diffuse_bounces": 0}
    ours = render_glint(scene, backend, **settings, **dark).combined[..., :3]
    cycles.make_exact(scene, of_cycles)
    return ours, cycles.render_passes(scene)["Combined"][..., :3]


KINDS = ["DIFFUSE", "VARIED", *(["PRINCIPLED"] if HAS_INPUT else [])]
CONSTANT = [(kind, r) for kind in KINDS if kind != "VARIED" for r in ROUGHNESSES]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lit_by", ["POINT", "SUN"])
@pytest.mark.parametrize(("kind", "roughness"), [*CONSTANT, ("VARIED", 0.5)])
def test_hard_lights(kind: str, roughness: float, lit_by: str, backend: str) -> None:
    """Each pixel, but for those that edges of shadows cut."""
    ours, theirs = both(scene_of(kind, roughness, lit_by), backend, 1, 1)
    off = np.abs(ours - theirs).max(-1) > 3e-5 * theirs.max()
    assert theirs.max() > 0.1 and off.mean() < 0.01
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lit_by", ["AREA", "SPHERE", "MESH", "WORLD"])
@pytest.mark.parametrize("kind", KINDS)
def test_soft_lights(kind: str, lit_by: str, backend: str) -> None:
    """The mean, and each pixel within the noise of both."""
    ours, theirs = both(scene_of(kind, 1.0, lit_by), backend, 8, 512)
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=1e-3)
    assert np.sqrt(((ours - theirs) ** 2).mean()) < 0.01 * np.sqrt((theirs**2).mean())


def painted(color, roughness: float = 1.0):
    material = rough("DIFFUSE", roughness)
    node = next(x for x in material.node_tree.nodes if x.bl_idname == "ShaderNodeBsdfDiffuse")
    node.inputs["Color"].default_value = (*color, 1.0)
    return material


@pytest.mark.parametrize("bounces", [1, 4])
@pytest.mark.parametrize("make", [bounced.box, bounced.yard])
def test_rooms_are_as_bright(make, bounces: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rough walls that throw light on to each other."""
    monkeypatch.setattr(bounced, "lambert", painted)
    glint, reference = bounced.pair(make(), bounces, 256)
    mean = glint.mean((0, 1)) / reference.mean((0, 1))
    assert np.abs(mean - 1).max() < 0.05, mean
    off = np.sqrt(((glint - reference) ** 2).mean()) / np.sqrt((reference**2).mean())
    assert off < 0.08
