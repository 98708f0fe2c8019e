"""Anisotropic highlights beside Cycles: as far from it as round ones of the same roughness."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import render_pair
from small_scenes import add, add_camera, add_light, new_material
from test_cycles_normals import wrapped

CASES = [
    *(("BsdfGlossy", r, *c) for r in (0.3, 0.5) for c in ((0.5, 0), (-0.5, 0.0), (0.8, 0.1))),
    ("BsdfPrincipled", 0.5, 0.5, 0.0),
    ("BsdfPrincipled", 0.7, 1.0, 0.1),
    ("BsdfMetallic", 0.5, 0.9, 0.3),
]


def picture(kind: str, roughness: float, amount: float, turn: float, tangent: str):
    """(Cycles', Glint's) of a ball under a sun, its tangent as it is without a link, or linked."""
    scene = cycles.empty_scene(96, 96)
    material, tree, output = new_material("brushed")
    try:
        shader = tree.nodes.new("ShaderNode" + kind)
    except RuntimeError:
        pytest.skip(f"this Blender has no {kind}")
    names = ("Anisotropic", "Anisotropic Rotation"), ("Anisotropy", "Rotation")
    amounts, turns = next(pair for pair in names if pair[0] in shader.inputs)
    values = {"Roughness": roughness, amounts: amount, turns: turn}
    values |= {"Metallic": 1.0} if kind == "BsdfPrincipled" else {}
    for name, value in values.items():
        shader.inputs[name].default_value = value
    if tangent != "NONE":
        node = tree.nodes.new("ShaderNodeTangent")
        node.direction_type = tangent
        tree.links.new(node.outputs[0], shader.inputs["Tangent"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    add(scene, "ball", wrapped(material))
    add_camera(scene, (0, -3, 0.6), (0, 0, 0))
    add_light(scene, "SUN", (2, -1.5, 1), energy=3.0)
    return render_pair(scene, "NATIVE", "brushed").colors()


@pytest.mark.parametrize("tangent", ["NONE", "UV_MAP", "RADIAL"])
@pytest.mark.parametrize("case", CASES, ids=str)
def test_brushed_balls(case, tangent: str) -> None:
    wanted, found = picture(*case, tangent)
    assert abs(found.mean() / wanted.mean() - 1) <= 0.03
    assert np.sqrt(((found - wanted) ** 2).mean()) <= 0.008 * wanted.max()
    off = np.abs(np.roll(wanted, 3, 0) - wanted)  # as narrow as that: three pixels tell
    assert np.sqrt((off**2).mean()) > 3 * np.sqrt(((found - wanted) ** 2).mean())
