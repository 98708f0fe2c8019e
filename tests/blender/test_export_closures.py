"""Shader nodes to lobes: their weights by hand."""

import numpy as np
import pytest

from export_support import (  # noqa: F401
    RED,
    Shader,
    image,
    kinds,
    layer_share,
    of_kind,
    outputs_of,
    principled,
    resolved,
    scene,
    set_inputs,
    total,
    weight,
)
from glint.addon.export.materials.expressions import Expressions
from glint.addon.export.materials.fresnel import fresnel, normal_reflectance
from glint.addon.export.materials.roughness import (
    between,
    scattered,
    scattered_narrow,
    scattered_wide,
    world_of,
)
from glint.addon.export.materials.sheen import sheen_table
from glint.addon.export.materials.varying import ROWS, Roughness
from glint.addon.ui.nodes import add_blinn_phong


def test_diffuse(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED)
    result, lobes = shader.export()
    assert kinds(lobes) == {"AMBIENT", "DIFFUSE"}
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    np.testing.assert_allclose(total(lobes, "AMBIENT"), RED[:3])
    assert result.notes == ()


@pytest.mark.parametrize("distribution", ["GGX", "MULTI_GGX"])
@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_rough_glossy(scene, roughness, distribution):  # noqa: F811
    """The fit's lobes with GGX's masking; what is scattered again makes them brighter, or the
    surface matt where it is very rough.
    """
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    shader.shader.distribution = distribution
    set_inputs(shader.shader, Color=RED, Roughness=roughness)
    _, lobes = shader.export()
    roughness, color = float(np.float32(roughness)), np.array(RED[:3])
    again = (
        np.array([scattered(x, roughness) for x in color])
        if distribution == "MULTI_GGX"
        else np.zeros(3)
    )
    (glossy,) = of_kind(lobes, "SPECULAR")
    assert (glossy.distribution, glossy.masking) == ("GGX", roughness**2)
    assert not (glossy.fresnel or glossy.schlick)
    brighter = color * (1 + again * scattered_narrow(roughness))
    np.testing.assert_allclose(weight(glossy), brighter, rtol=1e-6)
    world = world_of(roughness, "METAL")
    for cosine in (1.0, 0.3):
        once = world.a0 + world.a1 * (1 - cosine) ** world.q
        np.testing.assert_allclose(
            total(lobes, "AMBIENT", cosine=cosine), color * (once + again * (1 - once)), rtol=1e-6
        )
        matt = color * again * (1 - once) * scattered_wide(roughness)
        np.testing.assert_allclose(
            total(lobes, "DIFFUSE", cosine=cosine), matt, rtol=1e-6, atol=1e-12
        )


def test_metals_turn_white_at_grazing_angles(scene):  # noqa: F811
    """Principled's metal: beside F0 what Schlick's weight brings; the Glossy BSDF has the same
    colour from everywhere.
    """
    _, lobes = principled(Base_Color=(*RED[:3], 1.0), Metallic=1.0, Roughness=0.3).export()
    plain, edge = of_kind(lobes, "SPECULAR")
    assert edge.schlick and not plain.schlick
    f0 = np.array(RED[:3])
    np.testing.assert_allclose(weight(edge) / weight(plain), (1 - f0) / f0, rtol=1e-5)


def test_smooth_glossy_is_a_mirror(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    set_inputs(shader.shader, Color=RED, Roughness=0.0)
    (mirror,) = shader.export()[1]
    assert (mirror.kind, mirror.fresnel) == ("MIRROR", False)
    np.testing.assert_allclose(weight(mirror), RED[:3])


def test_rough_glass_has_the_width_of_its_roughness(scene):  # noqa: F811
    """α² = 2 / (p + 2), α the square of the roughness."""
    for name in ("ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"):
        shader = Shader(shader=name)
        set_inputs(shader.shader, Roughness=0.5)
        result, lobes = shader.export()
        (lobe,) = of_kind(lobes, "REFRACTION")
        assert lobe.exponent == pytest.approx(30.0)
        assert not result.notes


def test_glass(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfGlass")
    set_inputs(shader.shader, Color=RED, Roughness=0.0, IOR=1.25)
    mirror, refraction, passed = shader.export()[1]
    assert (mirror.kind, refraction.kind, passed.kind) == ("MIRROR", "REFRACTION", "TRANSPARENT")
    assert mirror.ior == refraction.ior == 1.25
    assert mirror.fresnel
    assert refraction.fresnel
    np.testing.assert_allclose([weight(mirror), weight(refraction)], [RED[:3]] * 2)


def test_refraction_and_transparent(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfRefraction")
    set_inputs(shader.shader, Color=RED, Roughness=0.0, IOR=1.25)
    shader.material.use_transparent_shadow = False
    (lobe,) = shader.export()[1]
    assert (lobe.kind, lobe.ior, lobe.fresnel) == ("REFRACTION", 1.25, False)
    shader = Shader("Clear", "ShaderNodeBsdfTransparent")
    set_inputs(shader.shader, Color=RED)
    (lobe,) = shader.export()[1]
    np.testing.assert_allclose((*weight(lobe),), RED[:3])
    assert lobe.kind == "TRANSPARENT"


def test_emission(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    set_inputs(shader.shader, Color=RED, Strength=3)
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "EMISSION"), np.multiply(RED[:3], 3))
    assert kinds(lobes) == {"EMISSION"}
    assert not result.notes


def test_emission_counts_only_with_colour_and_strength(scene):  # noqa: F811
    shader = principled(Emission_Strength=1.0, Emission_Color=(0, 0, 0, 1))
    result, lobes = shader.export()
    assert not of_kind(lobes, "EMISSION")
    assert result.notes == ()


def test_translucent(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfTranslucent")
    set_inputs(shader.shader, Color=RED)
    result, lobes = shader.export()
    assert kinds(lobes) == {"TRANSLUCENT", "AMBIENT"}
    for kind in kinds(lobes):
        np.testing.assert_allclose(total(lobes, kind), RED[:3])
    assert not result.notes


def test_holdout(scene):  # noqa: F811
    """A hole, of any share, which is told no more."""
    result, lobes = Shader(shader="ShaderNodeHoldout").export()
    assert kinds(lobes) == {"HOLDOUT"} and not result.notes
    np.testing.assert_array_equal(total(lobes, "HOLDOUT"), np.ones(3))


def test_principled_plastic(scene):  # noqa: F811
    _, lobes = principled(Base_Color=RED, Roughness=0.5).export()
    f0 = normal_reflectance(1.5)
    np.testing.assert_allclose(
        total(lobes, "DIFFUSE"), np.multiply(RED[:3], 1 - layer_share()), rtol=1e-6
    )
    brighter = 1 + scattered(f0 * 20 / 21 + 1 / 21, 0.5) * scattered_narrow(0.5)
    np.testing.assert_allclose(total(lobes, "SPECULAR"), brighter, rtol=1e-6)
    assert {(lobe.fresnel, lobe.ior, lobe.masking) for lobe in of_kind(lobes, "SPECULAR")} == {
        (True, 1.5, 0.25)
    }
    for cosine in (1.0, 0.2):
        share = layer_share(cosine=cosine, kind="DIELECTRIC")
        np.testing.assert_allclose(
            total(lobes, "AMBIENT", cosine=cosine),
            np.multiply(RED[:3], 1 - share) + share,
            rtol=1e-6,
        )
    assert kinds(lobes) == {"AMBIENT", "DIFFUSE", "SPECULAR"}


def test_principled_specular_level_scales_f0(scene):  # noqa: F811
    _, lobes = principled(Base_Color=RED, Specular_IOR_Level=1.0).export()
    (ior,) = {lobe.ior for lobe in of_kind(lobes, "SPECULAR")}
    assert normal_reflectance(ior) == pytest.approx(2 * normal_reflectance(1.5))
    _, lobes = principled(Base_Color=RED, Specular_IOR_Level=0.0).export()
    assert kinds(lobes) == {"AMBIENT", "DIFFUSE"}
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3], rtol=1e-6)


@pytest.mark.parametrize("cosine", [1.0, 0.5, 0.17])
def test_a_white_furnace_stays_white(scene, cosine):  # noqa: F811
    """As in Cycles: white plastic that scatters as often as it takes gives back all of a white
    world, from each direction.
    """
    for roughness in (0.0, 0.1, 0.5, 1.0):
        _, lobes = principled(Base_Color=(1, 1, 1, 1), Roughness=roughness).export()
        mirrored = fresnel(cosine, 1.5) if of_kind(lobes, "MIRROR") else 0.0
        np.testing.assert_allclose(
            total(lobes, "AMBIENT", cosine=cosine) + mirrored, 1.0, atol=0.02 if mirrored else 1e-6
        )


def fibres(result, roughness: float, distribution: str = "MICROFIBER"):
    """Of the one material that shines like cloth: its SHEEN lobe, and the rows of its table."""
    (material,) = (m for m in result.scene.materials if any(o.kind == "SHEEN" for o in m.lobes))
    (lobe,) = of_kind(material.lobes, "SHEEN")
    (table,) = material.program.tables
    rows = np.array(table).reshape(-1, 4)[:, :3]
    np.testing.assert_allclose(rows, sheen_table(float(np.float32(roughness)), distribution))
    assert (lobe.width, lobe.lean) == tuple(rows[:, :2].max(0))
    assert min(lobe.width_output, lobe.lean_output) >= 0
    return lobe, rows


def test_principled_sheen(scene):  # noqa: F811
    """What the fibres reflect, and what they leave to the paint below, is read from one table."""
    shader = principled(
        Base_Color=RED,
        Specular_IOR_Level=0.0,
        Sheen_Weight=0.5,
        Sheen_Roughness=0.8,
        Sheen_Tint=(0.2, 1.0, 0.4, 1.0),
    )
    result, lobes = shader.export()
    lobe, _ = fibres(result, 0.8)
    share = next(factor.output for factor in lobe.factors if factor.output >= 0)
    below = of_kind(lobes, "DIFFUSE")
    assert below and all(any(f.output == share for f in lobe.factors) for lobe in below)
    assert not result.notes


def test_a_sheen_shader(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfSheen")
    shader.shader.distribution = "ASHIKHMIN"
    shader.shader.inputs["Roughness"].default_value = 0.4
    shader.shader.inputs["Color"].default_value = RED
    result, lobes = shader.export()
    lobe, _ = fibres(result, 0.4, "ASHIKHMIN")
    assert kinds(lobes) == {"SHEEN", "AMBIENT"}
    np.testing.assert_allclose(lobe.factors[0].value, RED[:3])
    assert not result.notes


@pytest.mark.parametrize("roughness", [0.0, 0.25, 0.3, 1.0])
def test_a_sheen_whose_roughness_varies_is_that_of_each_point(scene, roughness):  # noqa: F811
    seen = []
    for varies in (False, True):
        shader = Shader(f"varies {varies}", shader="ShaderNodeBsdfSheen")
        shader.shader.inputs["Roughness"].default_value = roughness
        if varies:
            picture = shader.node("ShaderNodeTexImage", image=image(name="white"))
            factor = shader.node("ShaderNodeMath", operation="MULTIPLY")
            factor.inputs[1].default_value = roughness
            shader.link(picture, "Alpha", factor, "Value")
            shader.link(factor, 0, shader.shader, "Roughness")
        result, lobes = shader.export()
        material = next(m for m in result.scene.materials if m.name == shader.material.name)
        (lobe,) = of_kind(lobes, "SHEEN")
        outputs = outputs_of(material, result.scene.textures)
        numbers = [lobe.width_output, lobe.lean_output, lobe.factors[0].output]
        seen.append([outputs[k][0] for k in numbers])
        assert not result.notes
    np.testing.assert_allclose(*seen, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("linked", [("Normal",), ("Coat Normal",), ("Normal", "Coat Normal")])
@pytest.mark.parametrize("coat", [0.0, 0.5])
def test_a_coat_has_its_own_normal(scene, linked, coat):  # noqa: F811
    """An unlinked Coat Normal is the mesh's in Cycles, whatever lies below."""
    shader = principled(Base_Color=RED, Coat_Weight=coat, Coat_Roughness=0.4)
    bent = shader.node("ShaderNodeNormalMap")
    for name in linked:
        shader.link(bent, 0, shader.shader, name)
    result, lobes = shader.export()
    assert not result.notes
    differs = coat > 0 and len(linked) == 1
    assert {lobe.kind for lobe in lobes if lobe.normal_output >= 0} == (
        {"SPECULAR"} if differs else set()
    )
    (material,) = (m for m in result.scene.materials if m.lobes == lobes)
    assert (material.bump_shadowing != "NONE") == ("Normal" in linked or differs)


def test_principled_metal(scene):  # noqa: F811
    _, lobes = principled(Base_Color=RED, Metallic=1.0, Roughness=0.0).export()
    mirror, edge = lobes
    assert {(lobe.kind, lobe.fresnel) for lobe in lobes} == {("MIRROR", False)}
    assert (mirror.schlick, edge.schlick) == (False, True)
    np.testing.assert_allclose(weight(mirror), RED[:3])
    np.testing.assert_allclose(weight(edge), np.subtract(1, RED[:3]))


def test_principled_smooth_plastic_reflects_by_fresnel(scene):  # noqa: F811
    _, lobes = principled(Base_Color=RED, Roughness=0.0).export()
    (mirror,) = of_kind(lobes, "MIRROR")
    assert (mirror.fresnel, mirror.ior) == (True, 1.5)
    np.testing.assert_allclose(weight(mirror), 1)


def test_principled_glass_takes_the_root_of_its_colour(scene):  # noqa: F811
    _, lobes = principled(Base_Color=RED, Transmission_Weight=1.0, Roughness=0.0).export()
    np.testing.assert_allclose(total(lobes, "REFRACTION"), np.sqrt(RED[:3]), rtol=1e-6)
    assert kinds(lobes) == {"MIRROR", "REFRACTION", "TRANSPARENT"}


def test_principled_coat(scene):  # noqa: F811
    result, lobes = principled(Base_Color=RED, Coat_Weight=0.5, Coat_Roughness=0.0).export()
    (mirror,) = of_kind(lobes, "MIRROR")
    assert (mirror.fresnel, mirror.ior) == (True, 1.5)
    left = 1 - 0.5 * layer_share(roughness=0.0, cosine=0.8)
    np.testing.assert_allclose(
        total(resolved(result), "DIFFUSE"),
        np.multiply(RED[:3], (1 - layer_share()) * left),
        rtol=1e-6,
    )


def test_alpha_lets_through_what_the_surface_does_not_cover(scene):  # noqa: F811
    _, lobes = principled(Base_Color=RED, Alpha=0.25).export()
    np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 0.75)
    np.testing.assert_allclose(
        total(lobes, "DIFFUSE"), np.multiply(RED[:3], 0.25 * (1 - layer_share())), rtol=1e-6
    )


WHITE = (
    {"Metallic": 1.0},
    {"Metallic": 1.0, "Roughness": 0.0},
    {"Alpha": 0.5, "Metallic": 1.0},
    {"Roughness": 0.0},
    {"Roughness": 0.7},
)


@pytest.mark.parametrize("inputs", WHITE)
def test_a_uniform_world_is_a_furnace(scene, inputs):  # noqa: F811
    """White things give back the ambient light, all of it: what they reflect, mirror and let
    through sums to one over all views.
    """
    cosines = (np.arange(1000) + 0.5) / 1000
    _, lobes = principled(Base_Color=(1.0, 1.0, 1.0, 1.0), **inputs).export()
    back = np.mean([2 * c * total(lobes, "AMBIENT", cosine=c) for c in cosines[5::10]], 0) + total(
        lobes, "TRANSPARENT"
    )
    for mirror in of_kind(lobes, "MIRROR"):
        back = back + weight(mirror) * (
            np.mean([2 * c * fresnel(c, mirror.ior) for c in cosines]) if mirror.fresnel else 1
        )
    # the tables are as good as that where the layer is smooth
    np.testing.assert_allclose(back, 1, atol=5e-3)


def test_lobes_of_weight_zero_are_gone(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    for name, kind in (
        ("Shader", "ShaderNodeBsdfDiffuse"),
        ("Shader_001", "ShaderNodeBsdfTransparent"),
    ):
        shader.link(shader.node(kind), 0, shader.shader, name)
    shader.shader.inputs[0].default_value = 0.0
    assert kinds(shader.export()[1]) == {"AMBIENT", "DIFFUSE"}


def test_mix_and_add(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    red, clear = shader.node("ShaderNodeBsdfDiffuse"), shader.node("ShaderNodeBsdfTransparent")
    set_inputs(red, Color=RED)
    shader.link(red, 0, shader.shader, "Shader")
    shader.link(clear, 0, shader.shader, "Shader_001")
    shader.shader.inputs[0].default_value = 0.25
    _, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 0.75))
    np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 0.25)
    shader = Shader("Sum", "ShaderNodeAddShader")
    red = shader.node("ShaderNodeBsdfDiffuse")
    set_inputs(red, Color=RED)
    shader.link(red, 0, shader.shader, "Shader")
    shader.link(red, 0, shader.shader, "Shader_001")
    _, lobes = shader.export()
    assert len(of_kind(lobes, "DIFFUSE")) == 1
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 2))


def test_a_mirror_mixed_by_fresnel_is_exact(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    glossy, clear, factor = (
        shader.node(f"ShaderNode{name}")
        for name in ("BsdfAnisotropic", "BsdfRefraction", "Fresnel")
    )
    set_inputs(glossy, Roughness=0.0, Color=(1, 1, 1, 1))
    set_inputs(clear, Roughness=0.0, IOR=1.25, Color=(1, 1, 1, 1))
    set_inputs(factor, IOR=1.25)
    shader.link(clear, 0, shader.shader, "Shader")
    shader.link(glossy, 0, shader.shader, "Shader_001")
    shader.link(factor, 0, shader.shader, shader.shader.inputs[0].identifier)
    mirror, refraction, _ = shader.export()[1]
    assert (mirror.kind, mirror.fresnel, mirror.ior) == ("MIRROR", True, 1.25)
    assert (refraction.kind, refraction.fresnel, refraction.ior) == ("REFRACTION", True, 1.25)


def test_blinn_phong_node(scene):  # noqa: F811
    shader = Shader(shader=None)
    node = add_blinn_phong(shader.tree)
    shader.link(node, "BSDF", shader.output, "Surface")
    colors = {
        "Ambient": (0.1, 0.2, 0.3),
        "Diffuse": (0.4, 0.5, 0.6),
        "Specular": (0.7, 0.8, 0.9),
        "Mirror": (0.25, 0.5, 0.75),
    }
    set_inputs(
        node,
        Exponent=20,
        Alpha=0.5,
        Emission=(2, 3, 4, 1),
        **{name: (*rgb, 1) for name, rgb in colors.items()},
    )
    result, lobes = shader.export()
    for name, rgb in {**colors, "Emission": (2, 3, 4)}.items():
        np.testing.assert_allclose(total(lobes, name.upper()), np.multiply(rgb, 0.5), rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 0.5)
    assert of_kind(lobes, "SPECULAR")[0].exponent == 20
    assert len(lobes) == 6
    assert not any("supported" in note for note in result.notes)


@pytest.mark.parametrize("tint", [(0.0, 0.0, 0.0), (0.2, 0.5, 0.1)])
def test_a_tinted_layer_keeps_less_from_what_is_below(scene, tint):  # noqa: F811
    """The layer below loses what the tinted one reflects, by its largest channel, as in Cycles."""
    _, lobes = principled(Base_Color=RED, Specular_Tint=(*tint, 1.0)).export()
    np.testing.assert_allclose(
        total(lobes, "DIFFUSE"), np.multiply(RED[:3], 1 - layer_share(tint=max(tint))), rtol=1e-6
    )


@pytest.mark.parametrize("roughness", [0.5, 1.0])
def test_a_metal_coloured_by_a_texture_is_the_same_metal(scene, roughness):  # noqa: F811
    """Where the texture has its colour, whatever else is in it."""
    shader = principled(Base_Color=RED, Metallic=1.0, Roughness=roughness)
    plain = shader.export()[1]
    pixels = (RED, (1.0, 1.0, 1.0, 1.0), (0.0, 0.9, 0.0, 1.0))
    picture = image(pixels=pixels, size=(3, 1), float_buffer=True, space="Non-Color")
    texture = shader.node("ShaderNodeTexImage", image=picture)
    shader.link(texture, "Color", shader.shader, "Base Color")
    result, _ = shader.export()
    textured = resolved(result)
    for kind in ("SPECULAR", "AMBIENT"):
        np.testing.assert_allclose(
            total(textured, kind, result.scene.textures), total(plain, kind), rtol=1e-6
        )


@pytest.mark.parametrize("amount", [0.0, 0.5, -0.5])
def test_anisotropic_highlights_are_stretched(scene, amount):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    set_inputs(shader.shader, Roughness=0.4, Anisotropy=amount, Rotation=0.2)
    tangent = shader.node("ShaderNodeCombineXYZ")
    set_inputs(tangent, X=0.1, Y=3.0)
    shader.link(tangent, 0, shader.shader, "Tangent")
    result, lobes = shader.export()
    assert not result.notes
    assert all((x.stretch_output >= 0) == (amount != 0) for x in of_kind(lobes, "SPECULAR"))
    if amount:
        (material,) = (m for m in result.scene.materials if m.lobes == lobes)
        output = of_kind(lobes, "SPECULAR")[0].stretch_output
        size = np.linalg.norm(outputs_of(material, result.scene.textures)[output])
        assert size == pytest.approx(2.0 if amount > 0 else 0.5, rel=1e-6)


def test_widths_of_highlights_end_at_one(scene):  # noqa: F811
    """What is beyond makes the roughness of the whole less."""
    lobes = []
    for roughness, amount in ((0.8, 0.9), (0.8, 0.0)):
        shader = Shader(shader="ShaderNodeBsdfAnisotropic")
        set_inputs(shader.shader, Roughness=roughness, Anisotropy=amount)
        lobes.append(max(x.masking for x in of_kind(shader.export()[1], "SPECULAR")))
    assert lobes[0] < 0.6 * lobes[1]


def test_a_table_of_colours_asks_once_for_each_row():
    asked, expressions = [], Expressions()
    value = expressions.number(expressions.apply("position", shift=0))
    Roughness(value, expressions).color(lambda r: asked.append(r) or (r, r, r))
    assert len(asked) == ROWS


def test_values_in_between_are_numpys():
    places, values = np.sort(np.random.default_rng(1).random((2, 9)), 1).tolist()
    x = [*np.random.default_rng(2).uniform(-0.5, 1.5, 500).tolist(), *places]
    found = [between(one, places, values) for one in x]
    np.testing.assert_array_max_ulp(np.array(found), np.interp(x, places, values), 2)
    assert found[-9:] == values
