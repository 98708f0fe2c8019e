"""Rough matt surfaces to lobes: their shares by hand, by nodes, under a varnish, and beside light
that goes below.
"""

import numpy as np
import pytest

from export_support import (  # noqa: F401
    RED,
    Shader,
    image,
    kinds,
    layer_share,
    of_kind,
    principled,
    resolved,
    scene,
    set_inputs,
    total,
)
from glint.addon.export.materials.rough_diffuse import oren_nayar
from glint.engine.reference.closures.oren_nayar import NEVER_LOST, lost_once

COLOR = np.array(RED[:3])
ROUGH = ("OREN_NAYAR", "OREN_NAYAR_MULTIPLE")
MEAN_LOST = NEVER_LOST - (2 * np.pi - 5.6) / (3 * np.pi)
"""The mean of `lost_once` over even light."""


def wanted(roughness: float, color: np.ndarray = COLOR) -> np.ndarray:
    """(3, 3): of the three kinds of lobes their weights."""
    found = np.array([oren_nayar(roughness, c) for c in color]).T
    return found * color


def ambient(roughness: float, cosine: float) -> np.ndarray:
    """(3,) what of a uniform world it gives back to that side, with all that its facets scatter."""
    once, turned, again = wanted(roughness)
    lost = lost_once(np.array(cosine))
    return once + turned * (NEVER_LOST - lost) + again * lost * MEAN_LOST


def test_shares() -> None:
    """As Cycles has them: all light of a white surface comes back, A and B of one half by hand."""
    once, turned, again = oren_nayar(1.0, 1.0)
    assert once == pytest.approx(0.7765220671) and turned == once
    assert turned * MEAN_LOST * (1 + 0 * again) == pytest.approx(again * MEAN_LOST**2)
    assert oren_nayar(0.5, 0.0) == pytest.approx((0.8742051, 0.43710255, 0.0))
    assert oren_nayar(0.0, 0.7) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize("roughness", [0.25, 1.0])
def test_diffuse(scene, roughness):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED, Roughness=roughness)
    result, lobes = shader.export()
    assert not result.notes and result.scene.materials[0].program is None
    for kind, share in zip(("DIFFUSE", *ROUGH), wanted(roughness), strict=True):
        np.testing.assert_allclose(total(lobes, kind), share, rtol=1e-6)
    for cosine in (1.0, 0.6, 0.1):
        found = total(lobes, "AMBIENT", cosine=cosine)
        np.testing.assert_allclose(found, ambient(roughness, cosine), atol=0.007)


def test_without_roughness_there_is_one_lobe(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED, Roughness=0.0)
    plain = shader.export()[1]
    set_inputs(shader.shader, Roughness=9e-6)
    assert shader.export()[1] == plain and kinds(plain) == {"DIFFUSE", "AMBIENT"}


@pytest.mark.parametrize("linked", [("Roughness",), ("Color",), ("Roughness", "Color")])
def test_by_nodes(scene, linked):  # noqa: F811
    """What nodes give takes the place of the numbers."""
    shader = Shader()
    set_inputs(shader.shader, Color=RED, Roughness=0.3)
    for name in linked:
        grey = image(pixels=((0.6, 0.6, 0.6, 1.0),), space="Non-Color")
        shader.link(shader.node("ShaderNodeTexImage", image=grey), 0, shader.shader, name)
    result, _ = shader.export()
    assert not result.notes
    color = np.full(3, 0.6) if "Color" in linked else COLOR
    lobes = resolved(result)
    for kind, share in zip(
        ("DIFFUSE", *ROUGH), wanted(0.6 if "Roughness" in linked else 0.3, color), strict=True
    ):
        found = total(lobes, kind, result.scene.textures)
        np.testing.assert_allclose(found, share, rtol=5e-3)


def has_input() -> bool:
    return "Diffuse Roughness" in principled().shader.inputs


@pytest.mark.parametrize("cosine", [1.0, 0.5])
def test_under_a_varnish(scene, cosine):  # noqa: F811
    """Each lobe is what the layer leaves it."""
    if not has_input():
        pytest.skip("this Blender's Principled BSDF has no Diffuse Roughness")
    shader = principled(Base_Color=RED, Diffuse_Roughness=0.7)
    result, lobes = shader.export()
    assert not result.notes
    through = 1 - layer_share(cosine=cosine)
    for kind, share in zip(ROUGH, wanted(0.7)[1:], strict=True):
        np.testing.assert_allclose(total(lobes, kind, cosine=cosine), through * share, rtol=1e-5)


def test_light_that_goes_below_is_not_rough(scene):  # noqa: F811
    if not has_input():
        pytest.skip("this Blender's Principled BSDF has no Diffuse Roughness")
    shader = principled(Base_Color=RED, Diffuse_Roughness=0.7, Subsurface_Weight=0.25)
    rough, plain = shader.export()[1], []
    set_inputs(shader.shader, Diffuse_Roughness=0.0)
    plain = shader.export()[1]
    below = [[x for x in lobes if x.goes_below] for lobes in (rough, plain)]
    assert below[0] == below[1] and below[0]
    rest = [x for x in of_kind(plain, "DIFFUSE") if not x.goes_below]
    share = oren_nayar(0.7, 0.0)[1]
    assert rest and share > 0.4
    found = [x for x in of_kind(rough, "OREN_NAYAR") if x.exponent == 0]
    np.testing.assert_allclose(
        total(found, "OREN_NAYAR"),
        share * 0.75 * (1 - layer_share()) * COLOR,
        rtol=1e-5,
    )
