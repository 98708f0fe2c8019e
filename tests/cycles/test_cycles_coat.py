"""The coat of Principled against Cycles: its tint, which is stronger where light crosses it
aslant, and indices of refraction below 1, which only links can give.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS, render_pair, surface_interior
from node_tiles import add as node
from small_scenes import add, add_camera, add_light, ball, new_material

TINT = (0.5, 0.2, 0.1, 1.0)


def coated(backend: str, ior: float = 1.5, weight: float = 1.0, tint=TINT, bends: bool = False):
    """Pixels of Cycles' and of our picture of a white ball with a coat, whose normal may be a
    constant.
    """
    scene = cycles.empty_scene(48, 48)
    material, tree, output = new_material("coated")
    index = node(tree, "ShaderNodeValue", {})
    index.outputs[0].default_value = ior
    inputs = {"Base Color": (1.0, 1.0, 1.0, 1.0), "Specular IOR Level": 0.0}
    inputs |= {"Coat Roughness": 1.0, "Coat Weight": weight, "Coat Tint": tint}
    paint = node(tree, "ShaderNodeBsdfPrincipled", inputs | {"Coat IOR": index.outputs[0]})
    if bends:
        up = node(tree, "ShaderNodeCombineXYZ", {"X": 0.36, "Y": -0.8, "Z": 0.48})
        tree.links.new(up.outputs[0], paint.inputs["Coat Normal"])
    tree.links.new(paint.outputs[0], output.inputs["Surface"])
    add(scene, "ball", ball(48, 32, material=material))
    add_camera(scene, (0, -3, 0), (0, 0, 0))
    add_light(scene, "SUN", (0.5, -3, 0.5), energy=3.0)
    pair = render_pair(scene, backend, "coat")
    seen = surface_interior(pair.cycles) & (pair.cycles["Combined"][..., 0] > 0.02)
    assert seen.sum() > 200
    return tuple(picture[seen] for picture in pair.colors())


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("ior", "weight"), [(1.5, 1.0), (1.2, 1.0), (1.5, 0.4)])
def test_a_tint_is_stronger_aslant(backend, ior, weight):
    share, wanted = shares(backend, ior, weight)
    np.testing.assert_allclose(share, wanted, rtol=0.01, atol=1e-3)
    assert np.ptp(wanted[:, 1]) > 0.02


def shares(*arguments, **more):
    """What the tint leaves of each pixel, here and in Cycles, whose coats differ by version."""
    white = {"tint": (1.0, 1.0, 1.0, 1.0)}
    pairs = (coated(*arguments, **more), coated(*arguments, **more | white))
    (truth, picture), (even, plain) = pairs
    return picture / plain, truth / even


def test_a_tint_is_by_the_normal_of_the_coat():
    share, wanted = shares("NATIVE", bends=True)
    np.testing.assert_allclose(share, wanted, rtol=0.03, atol=1e-3)


@pytest.mark.parametrize("ior", [0.0, 0.6])
def test_an_index_below_one_counts_as_one(ior):
    truth, picture = coated("NATIVE", ior, tint=(1.0, 1.0, 1.0, 1.0))
    np.testing.assert_allclose(picture, truth, rtol=0.02, atol=2e-3)
