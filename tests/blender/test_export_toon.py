"""Toon shaders to lobes: their numbers by hand, and by nodes."""

import numpy as np
import pytest

from export_support import RED, Shader, of_kind, scene, set_inputs, total, weight  # noqa: F401
from glint.addon.export.materials.nodes_toon import toon_albedo
from glint.engine.reference.closures.toon import toon_albedo as albedo_of_reference

KINDS = {"DIFFUSE": "TOON_DIFFUSE", "GLOSSY": "TOON_SPECULAR"}


@pytest.mark.parametrize("component", KINDS)
def test_numbers(scene, component):  # noqa: F811
    """Of a world it gives back as much as its edge leaves."""
    shader = Shader(shader="ShaderNodeBsdfToon")
    shader.shader.component = component
    set_inputs(shader.shader, Color=RED, Size=0.25, Smooth=0.5)
    result, lobes = shader.export()
    (lobe,) = of_kind(lobes, KINDS[component])
    assert (lobe.size, lobe.smooth) == (0.25, 0.5) and not result.notes
    np.testing.assert_allclose(weight(lobe), RED[:3])
    np.testing.assert_allclose(total(lobes, "AMBIENT"), np.multiply(RED[:3], 0.5036763), rtol=1e-6)


@pytest.mark.parametrize(("name", "number"), [("Size", "size"), ("Smooth", "smooth")])
def test_numbers_by_nodes(scene, name, number):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfToon")
    shader.link(shader.node("ShaderNodeTexChecker"), "Fac", shader.shader, name)
    result, lobes = shader.export()
    (lobe,) = of_kind(lobes, "TOON_DIFFUSE")
    outputs = {"size": lobe.size_output, "smooth": lobe.smooth_output}
    assert outputs.pop(number) >= 0 and list(outputs.values()) == [-1]
    assert getattr(lobe, number) == 1.0 and not result.notes


@pytest.mark.parametrize(("size", "smooth"), [(0.5, 0.0), (0.25, 0.5), (0.8, 0.7), (0.0, 0.3)])
def test_both_say_the_same_of_a_world(size, smooth):
    assert toon_albedo(size, smooth) == pytest.approx(float(albedo_of_reference(size, smooth)))
