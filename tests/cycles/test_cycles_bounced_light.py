"""Light that surfaces throw onto others, beside Cycles' diffuse bounces."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, cube, lambert, looking_at, metal, moved, plane

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


def pair(scene, bounces: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    options = {"samples": samples, "light_samples": 2, "filter_width": 0.01, "max_bounces": 0}
    film = render_glint(scene, "NATIVE", diffuse_bounces=bounces, **options)
    cycles.make_exact(scene, 1024)
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = bounces
    reference = cycles.render_passes(scene)
    return film.passes["Combined"][..., :3], reference["Combined"][..., :3]


@pytest.mark.parametrize("bounces", [1, 4])
@pytest.mark.parametrize("make", [box, yard, spotted])
def test_rooms_are_as_bright_as_in_cycles(make: Callable, bounces: int) -> None:
    glint, reference = pair(make(), bounces, 256)
    mean = glint.mean((0, 1)) / reference.mean((0, 1))
    assert np.abs(mean - 1).max() < 0.05, mean
    off = np.sqrt(((glint - reference) ** 2).mean()) / np.sqrt((reference**2).mean())
    assert off < 0.08
