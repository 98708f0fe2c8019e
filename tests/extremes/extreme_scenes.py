"""Blender scenes that can be moved, scaled and squashed without a change of what they show."""

from __future__ import annotations

import numpy as np

import cycles_reference as cycles
import small_scenes as build

SIDE = 128
LAMP = (14, -10, 25)
POWER = 50000.0
EYE, TARGET = (26, -35, 27), (0, 0, 3)


def new_scene(side: int = SIDE):
    """An empty scene whose sky is alpha 0."""
    scene = cycles.empty_scene(side, side)
    scene.render.film_transparent = True
    return scene


def still_life(scale: float = 1.0, shift=(0.0, 0.0, 0.0)):
    """Four flat-shaded things under a point light, about 40 across; every coordinate is a whole
    number, so that float32 holds them up to 2^24 from the origin. All is scaled about the origin,
    then shifted.
    """
    scene = new_scene()
    things = (
        ("Floor", build.plane(16.0, build.lambert((0.8, 0.75, 0.7))), (0, 0, 0), (1, 1, 1)),
        ("Box", build.cube(build.lambert((0.7, 0.2, 0.1))), (-6, 2, 5), (4, 3, 4)),
        ("Prism", build.prism(material=build.lambert((0.1, 0.5, 0.3))), (6, 7, 5), (4, 4, 4)),
        ("Ball", build.ball(12, 8, False, build.lambert((0.2, 0.3, 0.8))), (4, -5, 6), (5, 5, 5)),
    )
    for name, data, place, size in things:
        build.add(scene, name, data, placed(place, size, scale, shift))
    lamp = build.add_light(scene, "POINT", (0, 0, 1), energy=POWER * scale**2)
    lamp.matrix_world = moved_to(LAMP, scale, shift)
    camera = build.add_camera(scene, EYE, TARGET, clip_start=scale, clip_end=1000 * scale)
    rotation = camera.matrix_world.to_3x3().to_4x4()
    camera.matrix_world = moved_to(EYE, scale, shift) @ rotation
    return scene


def placed(place, size, scale: float = 1.0, shift=(0.0, 0.0, 0.0)):
    """A 4×4 matrix: a diagonal, then a translation, then the scale and the shift of the whole
    scene.
    """
    return build.moved(*(np.multiply(place, scale) + shift), *(float(scale * x) for x in size))


def moved_to(place, scale: float = 1.0, shift=(0.0, 0.0, 0.0)):
    return build.moved(*(np.multiply(place, scale) + shift))


def grid_mesh(count: int, size: float, heights=None, material=None, turn=None):
    """A grid of count × count quads over [-size, size]²; heights (count + 1, count + 1); turned by
    a (3, 3) matrix before float32.
    """
    line = np.linspace(-size, size, count + 1)
    x, y = np.meshgrid(line, line)
    points = np.stack([x, y, np.zeros_like(x) if heights is None else heights], -1).reshape(-1, 3)
    points = points if turn is None else points @ np.asarray(turn).T
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1)
    faces = np.stack([first, first + 1, first + count + 2, first + count + 1], -1)
    return build.mesh("Grid", points, faces.tolist(), material=material)


def grey(value: float = 0.8):
    return build.lambert((value, value, value))


def add_parented(scene, name: str, data, matrix):
    """An object under a matrix that no decomposition into location, rotation and scale touches: the
    parent's inverse takes it whole.
    """
    item = build.add(scene, name, data)
    item.parent = build.add(scene, name + " parent", None)
    item.matrix_parent_inverse = matrix
    return item
