"""Metals' colours at grazing angles as lobes."""

import bpy
import numpy as np
import pytest

from export_support import Shader, of_kind, outputs_of, principled, scene, set_inputs, total  # noqa: F401
from glint.addon.export.materials.fresnel import conductor_reflectance, schlick
from glint.addon.export.materials.roughness import scattered, scattered_narrow

COLOR, TINT = np.array([0.9, 0.6, 0.2]), np.array([0.2, 0.6, 1.0])
F = (6 / 7) ** 5
needs_metallic = pytest.mark.skipif(
    not hasattr(bpy.types, "ShaderNodeBsdfMetallic"), reason="the node is of Blender 4.3"
)


def edges(lobes):
    return [lobe for lobe in of_kind(lobes, "SPECULAR") if lobe.edge]


def metallic(**inputs) -> Shader:
    shader = Shader(shader="ShaderNodeBsdfMetallic")
    set_inputs(shader.shader, Base_Color=(*COLOR, 1.0), Roughness=0.5, **inputs)
    return shader


def assert_lacks(lobes, color, tint, roughness=0.5) -> None:
    """At 82 degrees so much less than Schlick's as the tint says, brighter by what is scattered
    again.
    """
    lack = (color + (1 - color) * F) * (1 - tint)
    mean = color + (1 - color) / 21 - 7**7 / 6**6 / 126 * lack
    again = np.array([scattered(float(f), roughness) for f in mean])
    brighter = 1 + again * scattered_narrow(roughness)
    np.testing.assert_allclose(total(edges(lobes), "SPECULAR"), -lack * brighter, rtol=1e-6)


def test_principled(scene):  # noqa: F811
    shader = principled(
        Base_Color=(*COLOR, 1.0), Metallic=1.0, Roughness=0.5, Specular_Tint=(*TINT, 1.0)
    )
    result, lobes = shader.export()
    assert not result.notes
    assert_lacks(lobes, COLOR, TINT)
    set_inputs(shader.shader, Specular_Tint=(1.0, 1.0, 1.0, 1.0))
    assert not edges(shader.export()[1])


@needs_metallic
def test_metallic(scene):  # noqa: F811
    result, lobes = metallic(Edge_Tint=(*TINT, 1.0)).export()
    assert not result.notes
    assert_lacks(lobes, COLOR, TINT)


@needs_metallic
def test_conductors(scene):  # noqa: F811
    """By n and k, seen straight and at 82 degrees; what varies is told."""
    n, k = (0.2, 0.9, 1.5), (3.9, 2.4, 1.9)
    shader = metallic()
    shader.shader.fresnel_type = "PHYSICAL_CONDUCTOR"
    set_inputs(shader.shader, IOR=n, Extinction=k)
    result, lobes = shader.export()
    straight, aslant = (
        np.array([conductor_reflectance(x, *pair) for pair in zip(n, k, strict=True)])
        for x in (1.0, 1 / 7)
    )
    np.testing.assert_allclose(straight[0], ((0.2 - 1) ** 2 + 3.9**2) / ((0.2 + 1) ** 2 + 3.9**2))
    white = np.array([schlick(float(f), 1 / 7) for f in straight])
    assert_lacks(lobes, straight, np.minimum(aslant / white, 1.0))
    assert not result.notes
    shader.link(shader.node("ShaderNodeTexChecker"), "Color", shader.shader, "IOR")
    assert any("physical conductor" in note for note in shader.export()[0].notes)


@needs_metallic
@pytest.mark.parametrize("tint", [TINT, np.ones(3)])
def test_mirrors(scene, tint):  # noqa: F811
    """A tinted one by a program, one without as before."""
    shader = metallic(Edge_Tint=(*tint, 1.0))
    shader.shader.inputs["Roughness"].default_value = 0.0
    result, lobes = shader.export()
    assert any(f.output >= 0 for lobe in of_kind(lobes, "MIRROR") for f in lobe.factors) == (
        tint.min() < 1
    )
    assert not result.notes
