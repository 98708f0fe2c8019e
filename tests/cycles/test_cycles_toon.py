"""Toon shaders beside Cycles: bands of lamps, suns, worlds and what glows, and their shadows."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS
from lit_scenes import direct, lit_things
from small_scenes import new_material

SHAPES = [(0.5, 0.0), (0.6, 0.3), (0.1, 0.2), (0.9, 0.6)]


def toon(component: str, size: float, smooth: float):
    material, tree, output = new_material("toon")
    node = tree.nodes.new("ShaderNodeBsdfToon")
    node.component = component
    node.inputs["Color"].default_value = (0.8, 0.5, 0.2, 1.0)
    node.inputs["Size"].default_value, node.inputs["Smooth"].default_value = size, smooth
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def scene_of(component: str, size: float, smooth: float, kind: str):
    return lit_things(lambda: toon(component, size, smooth), kind)


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
    scene = scene_of(component, *shape, kind)
    if backend == "NUMPY" and samples > 1:
        return direct(scene, backend, samples, region=(14, 8, 36, 28)), theirs[8:28, 14:36]
    return direct(scene, backend, samples), theirs


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


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["AREA", "SPHERE", "MESH", "WORLD"])
@pytest.mark.parametrize("shape", SHAPES[1:3])
@pytest.mark.parametrize("component", ["DIFFUSE", "GLOSSY"])
def test_soft_lights(component: str, shape: tuple, kind: str, backend: str) -> None:
    """The mean, and each pixel within the noise of both."""
    ours, theirs = both(component, shape, kind, backend, 8, 512)
    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=0.01)
    assert np.sqrt(((ours - theirs) ** 2).mean()) < 0.06 * np.sqrt((theirs**2).mean())
