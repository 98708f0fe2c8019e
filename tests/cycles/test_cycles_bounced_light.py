"""Light that surfaces throw onto others, beside Cycles' diffuse bounces."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import (
    add,
    add_camera,
    add_light,
    cube,
    lambert,
    looking_at,
    metal,
    moved,
    new_material,
    plane,
)
from test_cycles_media import linked

WHITE = (0.75, 0.75, 0.75)


def box():
    """Five walls, two boxes and an area light."""
    scene = cycles.empty_scene(40, 40)
    white, red, green = lambert(WHITE), lambert((0.7, 0.05, 0.05)), lambert((0.1, 0.5, 0.1))
    for name, paint, at, towards in (
        ("floor", white, (0, 0, 0), (0, 0, 1)),
        ("ceiling", white, (0, 0, 2), (0, 0, 1)),
        ("back", white, (0, 1, 1), (0, 0, 1)),
        ("left", red, (-1, 0, 1), (0, 0, 1)),
        ("right", green, (1, 0, 1), (0, 0, 1)),
    ):
        target = {"floor": (0, 0, 2), "ceiling": (0, 0, 0)}.get(name, towards)
        add(scene, name, plane(1, paint), looking_at(at, target))
    add(scene, "tall", cube(white), moved(-0.4, 0.3, 0.4, 0.3, 0.3, 0.4))
    add(scene, "low", cube(white), moved(0.4, -0.2, 0.25, 0.25, 0.25, 0.25))
    add_light(scene, "AREA", (0, 0, 1.98), energy=40, size=0.5)
    add_camera(scene, (0, -3.8, 1), (0, 0, 1), lens=35)
    return scene


def yard():
    """A painted wall, a block and a metal one on a ground of a kilometre, sun and sky."""
    scene = cycles.empty_scene(48, 32)
    cycles.set_world(scene, (0.5, 0.7, 1.0), 0.4)
    add(scene, "ground", plane(500, lambert((0.6, 0.5, 0.4))))
    add(scene, "wall", cube(lambert((0.8, 0.1, 0.05))), moved(0, 1.5, 1, 3, 0.2, 1))
    add(scene, "block", cube(lambert(WHITE)), moved(0, -0.5, 0.5, 0.5, 0.5, 0.5))
    add(scene, "metal", cube(metal(0.4)), moved(-2, -0.5, 0.5, 0.5, 0.5, 0.5))
    add_light(scene, "SUN", (1.5, -2, 3), energy=3, angle=0.01)
    add_camera(scene, (4, -6, 2.5), (0, 0, 0.6), lens=35)
    return scene


def spotted():
    """A room that one spot at the ceiling lights."""
    scene = box()
    bpy.data.objects.remove(next(o for o in scene.objects if o.type == "LIGHT"))
    add_light(scene, "SPOT", (0, 0, 0.8), (0.2, 0.1, 2), energy=200, spot_size=pi / 3)
    return scene


def smoky():
    """The same, full of what absorbs light."""
    scene = spotted()
    material, _, output = new_material("smoke")
    linked("ShaderNodeVolumeAbsorption", output, Density=0.7, Color=(0.2, 0.5, 0.8, 1))
    add(scene, "smoke", cube(material), moved(0, 0, 1, 0.98, 0.98, 0.98))
    return scene


def pair(scene, bounces: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    options = {"samples": samples, "light_samples": 2, "filter_width": 0.01, "max_bounces": 0}
    options["soft_light"] = "DEALT" if bounces else "SHARED"
    film = render_glint(scene, "NATIVE", diffuse_bounces=bounces, **options)
    cycles.make_exact(scene, 256)
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = bounces
    reference = cycles.render_passes(scene)
    return film.passes["Combined"][..., :3], reference["Combined"][..., :3]


@pytest.mark.slow
@pytest.mark.parametrize("bounces", [1, 4])
@pytest.mark.parametrize("make", [box, yard, spotted, smoky])
def test_rooms_are_as_bright_as_in_cycles(make: Callable, bounces: int) -> None:
    glint, reference = pair(make(), bounces, 256)
    mean = glint.mean((0, 1)) / reference.mean((0, 1))
    assert np.abs(mean - 1).max() < 0.05, mean
    off = np.sqrt(((glint - reference) ** 2).mean()) / np.sqrt((reference**2).mean())
    assert off < 0.08


def painted(color, roughness: float):
    """A Principled BSDF as it comes, but for its colour and roughness."""
    material, tree, output = new_material("Paint")
    node = tree.nodes.new("ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (*color, 1.0)
    node.inputs["Roughness"].default_value = roughness
    tree.links.new(node.outputs["BSDF"], output.inputs["Surface"])
    return material


WINDOW_ROOM = {
    "samples": 64,
    "light_samples": 2,
    "filter_width": 0.01,
    "diffuse_bounces": 4,
    "soft_light": "DEALT",
}
"""Settings at which a `window_room` shows little noise."""


def window_room():
    """A painted room that the sky lights through a window in the wall at x = 0."""
    scene = cycles.empty_scene(48, 36)
    cycles.set_world(scene, (0.6, 0.75, 1.0), 3.0)
    white, red = painted((0.8, 0.8, 0.8), 0.6), painted((0.7, 0.25, 0.2), 0.6)
    wood = painted((0.45, 0.32, 0.2), 0.4)
    for number, (paint, low, high) in enumerate(
        (
            (wood, (-0.2, -0.2, -0.2), (5.2, 4.2, 0)),
            (white, (-0.2, -0.2, 2.7), (5.2, 4.2, 2.9)),
            (white, (5, -0.2, 0), (5.2, 4.2, 2.7)),
            (red, (0, 4, 0), (5, 4.2, 2.7)),
            (white, (0, -0.2, 0), (5, 0, 2.7)),
            (white, (-0.2, 0, 0), (0, 1.2, 2.7)),
            (white, (-0.2, 2.8, 0), (0, 4, 2.7)),
            (white, (-0.2, 1.2, 0), (0, 2.8, 0.9)),
            (white, (-0.2, 1.2, 2.2), (0, 2.8, 2.7)),
        )
    ):
        middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
        half = [(b - a) / 2 for a, b in zip(low, high, strict=True)]
        add(scene, f"wall {number}", cube(paint), moved(*middle, *half))
    add_camera(scene, (4.7, 0.4, 1.5), (0.0, 3.0, 1.2), lens=20)
    return scene


def test_a_painted_room_behind_a_window_is_as_bright_as_in_cycles() -> None:
    """Paint is varnished: a twentieth of what comes is thrown on by its gloss, and again by the
    next wall, and seen in it.
    """
    scene = window_room()
    film = render_glint(scene, "NATIVE", **WINDOW_ROOM)
    cycles.make_exact(scene, 128)
    scene.cycles.max_bounces, scene.cycles.diffuse_bounces = 12, 4
    scene.cycles.glossy_bounces = 4
    glint, reference = (
        passes["Combined"][..., :3] for passes in (film.passes, cycles.render_passes(scene))
    )
    wall = reference.max(-1) < 2.0  # the sky apart
    mean = glint[wall].mean(0) / reference[wall].mean(0)
    assert np.abs(mean - 1).max() < 0.05, mean
