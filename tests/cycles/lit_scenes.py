"""A ball and floor of one material under each kind of light, for tests of lobes beside Cycles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import cycles_reference as cycles
from glint_picture import render_glint
from small_scenes import add, add_camera, add_light, ball, lambert, moved, new_material, plane


def glow(strength: float):
    material, tree, output = new_material("glow")
    node = tree.nodes.new("ShaderNodeEmission")
    node.inputs["Strength"].default_value = strength
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def light(scene, kind: str) -> None:
    if kind == "WORLD":
        return cycles.set_world(scene, (0.4, 0.5, 0.7))
    cycles.set_world(scene, (0.0, 0.0, 0.0))
    if kind == "MESH":
        lamp = add(scene, "lamp", plane(0.5, glow(12.0)), moved(-1.5, -2.0, 3.0))
        lamp.visible_camera = False
        return None
    options = {
        "POINT": {"energy": 400.0, "shadow_soft_size": 0.0},
        "SUN": {"energy": 3.0, "angle": 0.0},
        "AREA": {"energy": 300.0, "size": 1.0},
        "SPHERE": {"energy": 400.0, "shadow_soft_size": 0.5},
    }[kind]
    add_light(scene, kind.replace("SPHERE", "POINT"), (2.0, -3.0, 4.0), **options)
    return None


def lit_things(make: Callable, kind: str):
    """A ball and floor of the material that is made in the new scene, and a matt ball that throws
    shadows on them. kind: of light, POINT, SUN, AREA, SPHERE, MESH or WORLD.
    """
    scene = cycles.empty_scene(48, 36)
    material = make()
    add(scene, "floor", plane(3.0, material))
    add(scene, "ball", ball(48, 32, material=material), moved(0, 0, 0.9, 0.9, 0.9, 0.9))
    small = ball(material=lambert((0.5, 0.5, 0.5)))
    add(scene, "small", small, moved(0.9, -1.2, 1.5, 0.3, 0.3, 0.3))
    light(scene, kind)
    add_camera(scene)
    return scene


def direct(scene, backend: str, samples: int, **more) -> np.ndarray:
    """(h, w, 3) of Glint, in direct light, with as many points on each light."""
    settings = {"samples": samples, "light_samples": samples, "filter_width": 0.0, **more}
    film = render_glint(scene, backend, **settings, max_bounces=0, diffuse_bounces=0)
    return film.combined[..., :3]
