"""Translucent surfaces beside Cycles: leaves against the light, and a room behind a curtain."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, looking_at, mesh, new_material, plane
from test_cycles_bounced_light import WINDOW_ROOM, pair, window_room

LEAF = (0.3, 0.6, 0.1)


def translucent(color, bump: float = 0.0, mixed: float = 0.0):
    """A Translucent BSDF, bumped by waves, mixed with a Diffuse one."""
    material, tree, output = new_material("Leaf")
    node = tree.nodes.new("ShaderNodeBsdfTranslucent")
    node.inputs["Color"].default_value = (*color, 1.0)
    shader = node.outputs["BSDF"]
    if bump:
        waves, bumps = (tree.nodes.new(f"ShaderNode{name}") for name in ("TexWave", "Bump"))
        place = tree.nodes.new("ShaderNodeTexCoord")
        tree.links.new(place.outputs["Object"], waves.inputs["Vector"])
        tree.links.new(waves.outputs["Fac"], bumps.inputs["Height"])
        bumps.inputs["Distance"].default_value = bump
        tree.links.new(bumps.outputs["Normal"], node.inputs["Normal"])
    if mixed:
        mix, matt = (tree.nodes.new(f"ShaderNode{name}") for name in ("MixShader", "BsdfDiffuse"))
        matt.inputs["Roughness"].default_value = 0.0
        mix.inputs[0].default_value = mixed
        tree.links.new(shader, mix.inputs[1])
        tree.links.new(matt.outputs["BSDF"], mix.inputs[2])
        shader = mix.outputs["Shader"]
    tree.links.new(shader, output.inputs["Surface"])
    return material


def hills(material, cells: int = 24, smooth: bool = True):
    line = np.linspace(-1, 1, cells + 1)
    points = [(x, y, 0.15 * np.sin(4 * x) * np.cos(3 * y)) for y in line for x in line]
    row = cells + 1
    faces = [
        (k, k + 1, k + row + 1, k + row)
        for k in (j * row + i for j in range(cells) for i in range(cells))
    ]
    return mesh("Hills", points, faces, smooth=smooth, material=material)


@pytest.mark.parametrize("more", [{}, {"bump": 0.05}, {"mixed": 0.4}], ids=["plain", "bump", "mix"])
@pytest.mark.parametrize("light", ["SUN", "AREA", "sky"])
def test_leaves_against_the_light(light: str, more: dict) -> None:
    """Seen from above, lit from below, with a stem between. Where Cycles draws directions of a
    Translucent node, as to find the sky, it forgets what bumps hide.
    """
    scene = cycles.empty_scene(48, 48)
    add(scene, "leaf", hills(translucent(LEAF, **more)))
    add(
        scene,
        "stem",
        plane(0.2, translucent((0.5, 0.5, 0.5))),
        looking_at((0.2, 0, -0.5), (0, 0, 9)),
    )
    add_camera(scene, (0, 0, 5), (0, 0, 0), type="ORTHO", ortho_scale=1.9)
    if light == "sky":
        cycles.set_world(scene, (0.8, 0.9, 1.0))
    else:
        at = {"SUN": {"energy": 3, "angle": 0.02}, "AREA": {"energy": 40, "size": 0.7}}[light]
        add_light(scene, light, (0.6, -0.5, -2), (0, 0, 0), **at)
    glint, reference = pair(scene, 0, 64)
    off = np.sqrt(((glint - reference) ** 2).mean() / (reference**2).mean())
    forgets = light == "sky" and "bump" in more
    assert off < (0.11 if forgets else 0.03), off
    mean = np.abs(glint.mean((0, 1)) / reference.mean((0, 1)) - 1).max()
    assert mean < (0.09 if forgets else 0.01), mean
    assert reference.mean() > 0.02


def test_a_room_behind_a_curtain() -> None:
    """All of its light comes through the curtain, which is a transmission bounce in Cycles."""
    scene = window_room()
    curtain = looking_at((-0.1, 2.0, 1.5), (9.0, 2.0, 1.5))
    add(scene, "curtain", plane(1.0, translucent((0.7, 0.65, 0.5))), curtain)
    film = render_glint(scene, "NATIVE", **WINDOW_ROOM)
    cycles.make_exact(scene, 128)
    scene.cycles.max_bounces = 12
    for name in ("diffuse", "glossy", "transmission"):
        setattr(scene.cycles, f"{name}_bounces", 4)
    glint, reference = (
        passes["Combined"][..., :3] for passes in (film.passes, cycles.render_passes(scene))
    )
    assert np.abs(glint.mean((0, 1)) / reference.mean((0, 1)) - 1).max() < 0.06
