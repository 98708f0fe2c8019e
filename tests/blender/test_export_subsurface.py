"""Subsurface scattering to DIFFUSE lobes with a radius."""

import numpy as np
import pytest

from export_support import (  # noqa: F401
    RED,
    Shader,
    image,
    of_kind,
    principled,
    scene,
    set_inputs,
    total,
)
from glint.addon.export.materials import subsurface


@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK", "RANDOM_WALK_SKIN"])
def test_subsurface(scene, method):  # noqa: F811
    """As far as Cycles' methods go, and as bright."""
    shader = Shader(shader="ShaderNodeSubsurfaceScattering")
    shader.shader.falloff = method
    set_inputs(shader.shader, Color=RED, Radius=(1.0, 0.5, 0.0), Scale=0.2)
    result, lobes = shader.export()
    (lobe,) = of_kind(lobes, "DIFFUSE")
    albedos, (distances, gains) = (
        subsurface._ALBEDOS,
        subsurface._METHODS.get(method, subsurface._BURLEY),
    )
    d, gain = (np.interp(RED[:3], albedos, column) for column in (distances, gains))
    np.testing.assert_allclose(lobe.radius, 0.2 * d * (1.0, 0.5, 0.0), rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), gain * RED[:3], rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "AMBIENT"), RED[:3])
    assert result.notes == ()


def test_what_subsurface_leaves_out_is_noted(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeSubsurfaceScattering")
    set_inputs(shader.shader, IOR=1.6, Roughness=0.5, Anisotropy=0.3)
    notes = shader.export()[0].notes
    assert [any(name in note for note in notes) for name in ("IOR", "Roughness", "anisotropy")] == [
        True
    ] * 3


def test_principled_subsurface_is_a_share_of_its_diffuse_light(scene):  # noqa: F811
    """What is left of it, and what has no scale or weight, comes out where it goes in."""

    def lobes_of(**inputs):
        return principled(Base_Color=RED, **inputs).export()[1]

    plain, shared = lobes_of(), lobes_of(Subsurface_Weight=0.25, Subsurface_Scale=0.1)
    below = [lobe for lobe in shared if lobe.goes_below]
    rest = [lobe for lobe in shared if lobe.kind == "DIFFUSE" and not lobe.goes_below]
    assert below and len({lobe.radius for lobe in below}) == 1
    gain = np.interp(RED[:3], subsurface._ALBEDOS, subsurface._WALK[1])
    whole = total(plain, "DIFFUSE")
    np.testing.assert_allclose(total(below, "DIFFUSE"), 0.25 * gain * whole, rtol=1e-5)
    np.testing.assert_allclose(total(rest, "DIFFUSE"), 0.75 * whole, rtol=1e-5)
    for still in ({"Subsurface_Weight": 1.0, "Subsurface_Scale": 0.0}, {"Subsurface_Scale": 1.0}):
        assert not any(lobe.goes_below for lobe in lobes_of(**still))


def test_subsurface_of_an_image(scene):  # noqa: F811
    """Its colour decides how far light goes: a program's output."""
    shader = Shader(shader="ShaderNodeSubsurfaceScattering")
    picture = shader.tree.nodes.new("ShaderNodeTexImage")
    picture.image = image()
    shader.tree.links.new(picture.outputs["Color"], shader.shader.inputs["Color"])
    result, lobes = shader.export()
    below = [lobe for lobe in lobes if lobe.kind == "DIFFUSE"]
    assert below and all(lobe.radius_output >= 0 for lobe in below)
    assert result.notes == ()
