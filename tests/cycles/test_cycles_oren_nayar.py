"""Rough matt surfaces beside Cycles: the Roughness of Diffuse and the Diffuse Roughness of
Principled, as constants and by nodes, under lamps, suns, worlds and what glows.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
import test_cycles_bounced_light as bounced
from cycles_reference import bpy
from glint_picture import BACKENDS
from lit_scenes import direct, lit_things
from small_scenes import new_material

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


def both(
    kind: str, roughness: float, lit_by: str, backend: str, samples: int, of_cycles: int
) -> tuple[np.ndarray, np.ndarray]:
    scene = lit_things(lambda: rough(kind, roughness), lit_by)
    ours = direct(scene, backend, samples)
    cycles.make_exact(scene, of_cycles)
    return ours, cycles.render_passes(scene)["Combined"][..., :3]


KINDS = ["DIFFUSE", "VARIED", *(["PRINCIPLED"] if HAS_INPUT else [])]
CONSTANT = [(kind, r) for kind in KINDS if kind != "VARIED" for r in ROUGHNESSES]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lit_by", ["POINT", "SUN"])
@pytest.mark.parametrize(("kind", "roughness"), [*CONSTANT, ("VARIED", 0.5)])
def test_hard_lights(kind: str, roughness: float, lit_by: str, backend: str) -> None:
    """Each pixel, but for those that edges of shadows cut."""
    ours, theirs = both(kind, roughness, lit_by, backend, 1, 1)
    off = np.abs(ours - theirs).max(-1) > 3e-5 * theirs.max()
    assert theirs.max() > 0.1 and off.mean() < 0.01
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("lit_by", ["AREA", "SPHERE", "MESH", "WORLD"])
@pytest.mark.parametrize("kind", KINDS)
def test_soft_lights(kind: str, lit_by: str, backend: str) -> None:
    """The mean, and each pixel within the noise of both."""
    ours, theirs = both(kind, 1.0, lit_by, backend, 8, 512)
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
