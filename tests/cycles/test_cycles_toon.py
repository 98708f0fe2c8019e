"""Toon shaders beside Cycles: bands of lamps, suns, worlds and what glows, and their shadows."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS, render_glint
from small_scenes import add, add_camera, add_light, ball, lambert, moved, new_material, plane

SHAPES = [(0.5, 0.0), (0.6, 0.3), (0.1, 0.2), (0.9, 0.6)]


def toon(component: str, size: float, smooth: float):
    material, tree, output = new_material("toon")
    node = tree.nodes.new("ShaderNodeBsdfToon")
    node.component = component
    node.inputs["Color"].default_value = (0.8, 0.5, 0.2, 1.0)
    node.inputs["Size"].default_value, node.inputs["Smooth"].default_value = size, smooth
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


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


def scene_of(component: str, size: float, smooth: float, kind: str):
    """A toon ball and floor, and a matt one that throws shadows on them."""
    scene = cycles.empty_scene(48, 36)
    material = toon(component, size, smooth)
    add(scene, "floor", plane(3.0, material))
    add(scene, "ball", ball(48, 32, material=material), moved(0, 0, 0.9, 0.9, 0.9, 0.9))
    add(
        scene,
        "small",
        ball(material=lambert((0.5, 0.5, 0.5))),
        moved(0.9, -1.2, 1.5, 0.3, 0.3, 0.3),
    )
    light(scene, kind)
    add_camera(scene)
    return scene


@functools.cache
def theirs_of(component: str, shape: tuple, kind: str, samples: int) -> np.ndarray:
    scene = scene_of(component, *shape, kind)
    cycles.make_exact(scene, samples)
    return cycles.render_passes(scene)["Combined"][..., :3]


def both(
    component: str, shape: tuple, kind: str, backend: str, samples: int, of_cycles: int
) -> tuple[np.ndarray, np.ndarray]:
    """Of the slow tracer's samples of soft light a part of the picture that has all in it."""
    theirs = theirs_of(component, shape, kind, of_cycles)
    settings = {"samples": samples, "light_samples": samples, "filter_width": 0.0}
    dark = {"max_bounces": 0, "diffuse_bounces": 0}
    part = np.s_[:, :]
    if backend == "NUMPY" and samples > 1:
        part = np.s_[8:28, 14:36]
        settings["region"] = (14, 8, 36, 28)
    scene = scene_of(component, *shape, kind)
    ours = render_glint(scene, backend, **settings, **dark).combined[..., :3]
    return ours, theirs[part]


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["POINT", "SUN"])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("component", ["DIFFUSE", "GLOSSY"])
def test_hard_lights(component: str, shape: tuple, kind: str, backend: str) -> None:
    """Each pixel, but for those that edges of bands and shadows cut."""
    ours, theirs = both(component, shape, kind, backend, 1, 1)
    off = np.abs(ours - theirs).max(-1) > 2e-3 * theirs.max()
    assert theirs.max() > 0.1 and off.mean() < 0.02
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=0.02)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["AREA", "SPHERE", "MESH", "WORLD"])
@pytest.mark.parametrize("shape", SHAPES[1:3])
@pytest.mark.parametrize("component", ["DIFFUSE", "GLOSSY"])
def test_soft_lights(component: str, shape: tuple, kind: str, backend: str) -> None:
    """The mean, and each pixel within the noise of both."""
    ours, theirs = both(component, shape, kind, backend, 8, 512)
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=0.01)
    assert np.sqrt(((ours - theirs) ** 2).mean()) < 0.06 * np.sqrt((theirs**2).mean())
