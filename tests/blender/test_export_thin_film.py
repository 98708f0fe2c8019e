"""Thin films to lobes: their colours by the view, of glass and of what is below a film."""

import bpy
import numpy as np
import pytest

from export_support import (  # noqa: F401
    RED,
    Shader,
    of_kind,
    scene,
    set_inputs,
)
from glint.addon.export.materials.fresnel import fresnel, schlick
from glint.addon.export.materials.thin_film import (
    Metal,
    interference,
    metal_reflectance,
    reflectance,
)
from glint.engine.evaluation.points import light_path
from glint.engine.program.execute.run import run

COSINES = np.array([1.0, 0.9, 0.6, 0.3, 0.1, 0.01])


def filmed(kind: str, **inputs) -> Shader:
    shader = Shader(shader=kind)
    if "Thin Film Thickness" not in shader.shader.inputs:
        pytest.skip(f"this Blender's {kind} has no thin film")
    set_inputs(shader.shader, **inputs)
    return shader


@pytest.mark.parametrize(("thickness", "film", "ior"), [(0.0, 1.33, 1.5), (400.0, 1.0, 1.5)])
def test_no_film_is_fresnels(thickness: float, film: float, ior: float) -> None:
    found = reflectance(COSINES, thickness, film, ior)
    truth = [fresnel(c, ior) for c in COSINES]
    np.testing.assert_allclose(found, np.tile(truth, (3, 1)).T, rtol=1e-9)


def test_a_film_of_a_quarter_wave_by_hand() -> None:
    """Seen straight, in light of all wavelengths: minima where both sides' light is opposed."""
    n, base = 1.38, 1.5
    a, b = (1 - n) / (1 + n), (n - base) / (n + base)
    least, most = ((a - b) / (1 - a * b)) ** 2, ((a + b) / (1 + a * b)) ** 2
    found = np.concatenate([reflectance(np.ones(1), d, n, base) for d in np.arange(0, 800, 5.0)])
    assert (found[:, 1] > 0.9 * least).all() and (found[:, 1] < most + 1e-3).all()
    assert found[:, 1].min() < least + 0.05 * (most - least)
    assert abs(5 * found[:40, 1].argmin() * 4 * n - 550) < 30  # green light
    thick = reflectance(np.ones(1), 9e3, n, base)
    np.testing.assert_allclose(thick, reflectance(np.ones(1), np.inf, n, base), rtol=0.02)


def test_interference_fades_with_the_path() -> None:
    found = interference(np.array([0.0, 275.0, 20000.0]))
    np.testing.assert_allclose(found[0], 1.0)
    assert found[1, 1] < -0.8 and np.abs(found[2]).max() < 0.02


class Views:
    """Points that are seen at `COSINES`. kind: of the rays."""

    def __init__(self, inside: bool, kind: str = "camera") -> None:
        self._inside, self._kind = inside, kind

    def incoming(self) -> np.ndarray:
        return np.stack([np.sqrt(1 - COSINES**2), 0 * COSINES, COSINES])

    def normal(self) -> np.ndarray:
        return np.stack([0 * COSINES, 0 * COSINES, 1 + 0 * COSINES])

    def backfacing(self) -> np.ndarray:
        return np.full(len(COSINES), float(self._inside))

    def light_path(self) -> tuple[np.ndarray, ...]:
        return light_path(self._kind, len(COSINES))

    def attribute(self, name: str, shift: int) -> np.ndarray:
        return np.zeros((4, len(COSINES)))


def colors(result, lobe, **views) -> np.ndarray:
    """(n, 3) the product of a lobe's factors at those views."""
    material = next(m for m in result.scene.materials if m.name == "Material")
    outputs, product = run(material.program, Views(**views), len(COSINES)), np.ones((3, 1))
    for factor in lobe.factors:
        value = np.array(factor.value)[:, None]
        value = value * outputs[factor.output] if factor.output >= 0 else value
        product = product * (1 - value if factor.complement else value)
    return (product * np.ones((3, len(COSINES)))).T


def vary(shader: Shader, thickness: float) -> None:
    """The thickness by nodes, of which nobody knows what they give."""
    added = shader.node("ShaderNodeMath", operation="ADD")
    added.inputs[1].default_value = thickness
    source = shader.node("ShaderNodeAttribute", attribute_name="none")
    shader.tree.links.new(source.outputs["Fac"], added.inputs[0])
    shader.tree.links.new(added.outputs[0], shader.shader.inputs["Thin Film Thickness"])


@pytest.mark.parametrize("varies", [False, True])
@pytest.mark.parametrize("thickness", [120.0, 400.0, 900.0])
def test_glass(scene, thickness, varies):  # noqa: F811
    """What is not reflected is refracted; from inside the film is thinner by the index, and beyond
    the angle of total reflection all is.
    """
    shader = filmed("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.5)
    set_inputs(shader.shader, Thin_Film_Thickness=thickness, Thin_Film_IOR=1.3)
    if varies:
        vary(shader, thickness)
    result, lobes = shader.export()
    assert not result.notes
    (mirror,), (glass,) = of_kind(lobes, "MIRROR"), of_kind(lobes, "REFRACTION")
    assert not mirror.fresnel and not glass.fresnel
    within = 2e-3 if varies else 1e-3
    outside = reflectance(COSINES, thickness, 1.3, 1.5)
    for seen in ({"inside": False}, {"inside": True, "kind": "shadow"}):
        np.testing.assert_allclose(colors(result, mirror, **seen), outside, atol=within)
        np.testing.assert_allclose(colors(result, glass, **seen), 1 - outside, atol=within)
    cosine = np.sqrt(np.maximum(1 - 1.5**2 * (1 - COSINES**2), 0))
    inside = reflectance(cosine, thickness / 1.5, 1.3, 1.5)
    total = np.abs(inside - 1) < 1e-12  # weights of colours sum to 1 but for rounding
    assert total.all(1).sum() == 4
    np.testing.assert_allclose(colors(result, mirror, inside=True), inside, atol=within)


def test_a_bubble_is_a_film_alone(scene):  # noqa: F811
    shader = filmed("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.0, Thin_Film_Thickness=300.0)
    result, lobes = shader.export()
    (mirror,) = of_kind(lobes, "MIRROR")
    truth = reflectance(COSINES, 300.0, shader.shader.inputs["Thin Film IOR"].default_value, 1.0)
    np.testing.assert_allclose(colors(result, mirror, inside=False), truth, atol=1e-3)


@pytest.mark.parametrize("tint", [1.0, 0.25])
def test_what_is_below_a_film(scene, tint):  # noqa: F811
    """It gets what the film leaves of its strongest channel; a tint is of the reflectance at F0."""
    shader = filmed("ShaderNodeBsdfPrincipled", Base_Color=RED, Roughness=0.0, IOR=1.5)
    set_inputs(shader.shader, Thin_Film_Thickness=500.0, Thin_Film_IOR=1.33)
    set_inputs(shader.shader, Specular_Tint=(tint,) * 3 + (1.0,))
    result, lobes = shader.export()
    assert not result.notes
    (mirror,), (matt,) = of_kind(lobes, "MIRROR"), of_kind(lobes, "DIFFUSE")
    film = reflectance(COSINES, 500.0, 1.33, 1.5)
    share = np.clip((1 - film) / 0.96, 0, 1)
    film = film * (1 - (1 - tint) * share)
    views = {"inside": True}
    np.testing.assert_allclose(colors(result, mirror, **views), film, atol=1e-3)
    below = (1 - film.max(1))[:, None] * RED[:3]
    np.testing.assert_allclose(colors(result, matt, **views), below, atol=1e-3)


@pytest.mark.parametrize("thickness", [0.0, 0.1])
def test_without_a_film_all_is_as_before(scene, thickness):  # noqa: F811
    shader = filmed("ShaderNodeBsdfGlass", Thin_Film_Thickness=thickness)
    assert all(lobe.fresnel for lobe in shader.export()[1] if lobe.kind == "REFRACTION")


@pytest.mark.parametrize("edge", [None, 0.6])
def test_a_film_without_thickness_is_the_metal(edge: float | None) -> None:
    """By its index, or by F82's model where the film is as air."""
    metal = Metal((0.2, 0.9, 1.4), (3.9, 2.4, 1.9), None if edge is None else (edge,) * 3)
    found = metal_reflectance(COSINES, 0.0, 1.0, metal)
    for channel, (n, k) in enumerate(zip(metal.index, metal.extinction, strict=True)):
        f0 = abs((complex(n, k) - 1) / (complex(n, k) + 1)) ** 2
        assert found[0, channel] == pytest.approx(f0)
        at = metal_reflectance(np.array([1 / 7]), 0.0, 1.0, metal)[0, channel]
        wanted = exact_conductor(1 / 7, complex(n, k)) if edge is None else edge
        assert at == pytest.approx(wanted, rel=1e-6)


def exact_conductor(cosine: float, n: complex) -> float:
    """Fresnel's equations by hand."""
    below = np.sqrt(1 - (1 - cosine**2) / n**2)
    across, along = (
        (cosine - n * below) / (cosine + n * below),
        (n * cosine - below) / (n * cosine + below),
    )
    return float(abs(across) ** 2 + abs(along) ** 2) / 2


def test_metals_are_those_of_their_colour() -> None:
    """What a colour and the reflectance at 82 degrees guess has that colour."""
    metal = Metal.of((0.9, 0.6, 0.3), (0.8, 0.7, 0.5))
    straight = [abs((complex(a, b) - 1) / (complex(a, b) + 1)) ** 2
                for a, b in zip(metal.index, metal.extinction, strict=True)]  # fmt: skip
    np.testing.assert_allclose(straight, (0.9, 0.6, 0.3), rtol=1e-6)


@pytest.mark.parametrize("kind", ["Principled", "Metallic"])
def test_metals(scene, kind):  # noqa: F811
    if not hasattr(bpy.types, f"ShaderNodeBsdf{kind}"):
        pytest.skip("the node is of Blender 4.3")
    shader = filmed(f"ShaderNodeBsdf{kind}", Roughness=0.0, Thin_Film_Thickness=300.0)
    set_inputs(shader.shader, Base_Color=RED, Thin_Film_IOR=1.33)
    name = "Specular Tint" if kind == "Principled" else "Edge Tint"
    shader.shader.inputs[name].default_value = (0.5, 0.6, 0.7, 1.0)
    if kind == "Principled":
        set_inputs(shader.shader, Metallic=1.0)
    result, lobes = shader.export()
    assert not result.notes
    (mirror,) = of_kind(lobes, "MIRROR")
    at_edge = [schlick(f, 1 / 7) * t for f, t in zip(RED[:3], (0.5, 0.6, 0.7), strict=True)]
    truth = metal_reflectance(COSINES, 300.0, 1.33, Metal.of(RED[:3], tuple(at_edge)))
    np.testing.assert_allclose(colors(result, mirror, inside=True), truth, atol=2e-3)


def test_films_on_metals_that_vary_are_told(scene):  # noqa: F811
    shader = filmed("ShaderNodeBsdfPrincipled", Metallic=1.0, Thin_Film_Thickness=300.0)
    shader.link(shader.node("ShaderNodeTexChecker"), "Color", shader.shader, "Base Color")
    assert any("thin film" in note for note in shader.export()[0].notes)
