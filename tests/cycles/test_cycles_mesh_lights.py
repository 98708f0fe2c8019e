"""The light of surfaces that glow beside many of Cycles' samples."""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint, surface_interior
from small_scenes import (
    add,
    add_camera,
    ball,
    cube,
    lambert,
    looking_at,
    metal,
    moved,
    new_material,
    plane,
)


def glow(color=(1.0, 1.0, 1.0), strength: float = 1.0):
    """Emission alone."""
    material, tree, output = new_material("glow")
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*color, 1)
    emission.inputs["Strength"].default_value = strength
    tree.links.new(emission.outputs[0], output.inputs[0])
    return material


def emission_of(tree):
    return next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")


def screen(strength: float):
    """An image, across: four quarters of different colours."""
    material = glow(strength=strength)
    tree = material.node_tree
    picture = bpy.data.images.new("screen", 2, 2, float_buffer=True)
    colors = [(1, 0.1, 0.1, 1), (0.1, 1, 0.1, 1), (0.1, 0.1, 1, 1), (1, 1, 0.1, 1)]
    picture.pixels.foreach_set(np.array(colors, np.float32).reshape(-1))
    picture.pack()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = picture, "Closest"
    across = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(across.outputs["Generated"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], emission_of(tree).inputs["Color"])
    return material


def one_sided(color, strength: float):
    """Black from behind."""
    material = glow(color, strength)
    tree = material.node_tree
    geometry, sub = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeMath")
    sub.operation = "MULTIPLY_ADD"
    sub.inputs[1].default_value, sub.inputs[2].default_value = -strength, strength
    tree.links.new(geometry.outputs["Backfacing"], sub.inputs[0])
    tree.links.new(sub.outputs[0], emission_of(tree).inputs["Strength"])
    return material


def one_panel(scene):
    add(scene, "panel", plane(1, glow((1, 0.8, 0.6), 4)), looking_at((1, 0.5, 3), (0, 0, 0)))


def two_panels(scene):
    add(scene, "warm", plane(0.8, glow((1, 0.5, 0.2), 6)), looking_at((-2.5, -1, 2.5), (0, 0, 0)))
    add(scene, "cool", plane(0.8, glow((0.2, 0.5, 1), 6)), looking_at((2.5, -1, 2.5), (0, 0, 0)))


def bulbs(scene):
    for k, color in enumerate(((1, 0.2, 0.2), (0.2, 1, 0.2), (0.2, 0.2, 1))):
        add(
            scene,
            f"bulb {k}",
            ball(24, 12, True, glow(color, 30)),
            moved(k - 1, -1.4, 1.8, *[0.15] * 3),
        )


def box(scene):
    add(scene, "box", cube(glow((1, 0.9, 0.7), 5)), moved(0.3, 0.4, 2.6, 0.3, 0.3, 0.3))


def television(scene):
    add(scene, "screen", plane(1, screen(5)), looking_at((0, 1.6, 1.6), (0, 0, 1.5)))


def lid(scene):
    """Two panels that shine upward and downward, each from one side."""
    add(scene, "down", plane(1, one_sided((1, 1, 1), 5)), looking_at((-1, 0, 3), (-1, 0.1, 9)))
    add(scene, "up", plane(1, one_sided((1, 0, 0), 5)), moved(1.2, 0, 3))


NEAR = {"box", "television"}
"""What is lit most is nearer than the light is large: there 512 points are few."""
GRAINY = {"bulbs": 4096, "box": 2048, "television": 2048}
"""Of which Cycles needs more samples."""
LIT = {f.__name__: f for f in (one_panel, two_panels, bulbs, box, television, lid)}


def furnished(body):
    """A scene without lights. body: makes the material of a ball in it."""
    scene = cycles.empty_scene(48, 32)
    add(scene, "floor", plane(8, lambert((0.6, 0.6, 0.6))))
    add(scene, "ball", ball(64, 32, True, body()), moved(1.2, 0, 1))
    add(scene, "cube", cube(lambert((0.3, 0.5, 0.7))), moved(-1.2, 0.3, 0.8, 0.8, 0.8, 0.8))
    add_camera(scene, location=(0.5, -6, 3.0), target=(0, 0, 0.8))
    return scene


def compared(scene, cycles_samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Glint's picture, Cycles', and the pixels within surfaces that do not glow themselves."""
    film = render_glint(
        scene,
        "NATIVE",
        max_bounces=0,
        samples=64,
        light_samples=2,
        filter_width=0,
        passes=frozenset({"Emission"}),
    )
    passes = cycles.render_cycles(scene, cycles_samples)
    dark = ~film.passes["Emission"][..., :3].any(2) & surface_interior(passes)
    assert dark.mean() > 0.3
    return film.passes["Combined"][..., :3], passes["Combined"][..., :3], dark


@pytest.mark.slow
@pytest.mark.parametrize("name", LIT)
def test_the_light_of_what_glows_is_cycles(name):
    scene = furnished(lambda: lambert((0.7, 0.3, 0.2)))
    LIT[name](scene)
    found, wanted, dark = compared(scene, GRAINY.get(name, 1024))
    error = (found - wanted)[dark]
    assert np.sqrt(np.mean(error**2)) <= (0.04 if name in NEAR else 0.02) * wanted[dark].mean()
    assert np.abs(error.mean(0)).max() <= 0.01 * wanted[dark].mean()


@pytest.mark.parametrize(
    ("name", "roughness"), [("two_panels", 0.15), ("two_panels", 0.5), ("bulbs", 0.3)]
)
def test_highlights_of_what_glows_are_cycles(name, roughness):
    """In sum: the lobes are Blinn-Phong's."""
    scene = furnished(lambda: metal(roughness))
    LIT[name](scene)
    found, wanted, dark = compared(scene, 256)
    assert found[dark].sum() == pytest.approx(wanted[dark].sum(), rel=0.05)
