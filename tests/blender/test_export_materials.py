"""Node trees to lobes: weights by hand, and what is not understood by its note."""

import bpy
import numpy as np
import pytest

from export_support import Shader, export, image, of_kind, quad, scene, srgb_to_linear, total, use_nodes, weight  # noqa: F401
from glint.addon.export.fresnel import fresnel, normal_reflectance
from glint.addon.export.roughness import dielectric_highlights, highlights, layer_albedo, layer_loss, sheen_albedo, specular_albedo

RED = (0.8, 0.2, 0.1, 1.0)


def _kinds(lobes) -> set[str]:
    return {lobe.kind for lobe in lobes}


def _set(node, **inputs) -> None:
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value


def _principled(**inputs) -> Shader:
    shader = Shader(shader="ShaderNodeBsdfPrincipled")
    shader.shader.distribution = "MULTI_GGX"
    _set(shader.shader, IOR=1.5, **inputs)
    return shader


def test_diffuse(scene):  # noqa: F811
    shader = Shader()
    _set(shader.shader, Color=RED)
    result, lobes = shader.export()
    assert _kinds(lobes) == {"AMBIENT", "DIFFUSE"}
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    np.testing.assert_allclose(total(lobes, "AMBIENT"), RED[:3])
    assert result.notes == ()


@pytest.mark.parametrize("distribution", ["GGX", "MULTI_GGX"])
@pytest.mark.parametrize("roughness", [0.2, 0.5, 1.0])
def test_rough_glossy(scene, roughness, distribution):  # noqa: F811
    """The fit's lobes; scattered again and again, light takes the colour's square for its colour."""
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    shader.shader.distribution = distribution
    _set(shader.shader, Color=RED, Roughness=roughness)
    _, lobes = shader.export()
    once, color = specular_albedo(roughness, multiscatter=False), np.array(RED[:3])
    reflected = once * color + (1 - once) * color**2 if distribution == "MULTI_GGX" else color
    fit = sorted(highlights(float(np.float32(roughness)), distribution))
    assert sorted(lobe.exponent for lobe in of_kind(lobes, "SPECULAR")) == [p for p, _ in fit]
    np.testing.assert_allclose(total(lobes, "SPECULAR"), reflected * sum(s for _, s in fit), rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "AMBIENT"), reflected if distribution == "MULTI_GGX" else once * color, rtol=1e-6)


def test_smooth_glossy_is_a_mirror(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfAnisotropic")
    _set(shader.shader, Color=RED, Roughness=0.0)
    (mirror,) = shader.export()[1]
    assert (mirror.kind, mirror.fresnel) == ("MIRROR", False)
    np.testing.assert_allclose(weight(mirror), RED[:3])


def test_glass(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfGlass")
    _set(shader.shader, Color=RED, Roughness=0.0, IOR=1.25)
    mirror, refraction = shader.export()[1]
    assert (mirror.kind, refraction.kind) == ("MIRROR", "REFRACTION")
    assert mirror.ior == refraction.ior == 1.25
    assert mirror.fresnel
    assert refraction.fresnel
    np.testing.assert_allclose([weight(mirror), weight(refraction)], [RED[:3]] * 2)


def test_refraction_and_transparent(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfRefraction")
    _set(shader.shader, Color=RED, Roughness=0.0, IOR=1.25)
    (lobe,) = shader.export()[1]
    assert (lobe.kind, lobe.ior, lobe.fresnel) == ("REFRACTION", 1.25, False)
    shader = Shader("Clear", "ShaderNodeBsdfTransparent")
    _set(shader.shader, Color=RED)
    (lobe,) = shader.export()[1]
    np.testing.assert_allclose((*weight(lobe),), RED[:3])
    assert lobe.kind == "TRANSPARENT"


def test_emission(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    _set(shader.shader, Color=RED, Strength=3)
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "EMISSION"), np.multiply(RED[:3], 3))
    assert _kinds(lobes) == {"EMISSION"}
    assert any("light nothing" in note for note in result.notes)


def test_emission_counts_only_with_colour_and_strength(scene):  # noqa: F811
    shader = _principled(Emission_Strength=1.0, Emission_Color=(0, 0, 0, 1))
    result, lobes = shader.export()
    assert not of_kind(lobes, "EMISSION")
    assert result.notes == ()


def test_translucent_is_noted(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfTranslucent")
    _set(shader.shader, Color=RED)
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    assert any("Translucent" in note and "'Material'" in note for note in result.notes)


def _loss(ior: float = 1.5, roughness: float = 0.5, world: bool = False) -> float:
    return layer_loss(roughness, ior, multiscatter=True, world=world)


def test_principled_plastic(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Roughness=0.5).export()
    f0 = normal_reflectance(1.5)
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 1 - _loss()), rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "SPECULAR"), f0 * sum(s for _, s in dielectric_highlights(0.5, f0)), rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "AMBIENT"), np.multiply(RED[:3], 1 - _loss(world=True)) + layer_albedo(0.5, 1.5), rtol=1e-6)
    assert _kinds(lobes) == {"AMBIENT", "DIFFUSE", "SPECULAR"}


def test_principled_specular_level_scales_f0(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Specular_IOR_Level=1.0).export()
    f0 = 2 * normal_reflectance(1.5)
    np.testing.assert_allclose(total(lobes, "SPECULAR"), f0 * sum(s for _, s in dielectric_highlights(0.5, f0)), rtol=1e-6)
    _, lobes = _principled(Base_Color=RED, Specular_IOR_Level=0.0).export()
    assert _kinds(lobes) == {"AMBIENT", "DIFFUSE"}
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3], rtol=1e-6)


def test_a_white_furnace_stays_white(scene):  # noqa: F811
    """As in Cycles: white plastic that scatters as often as it takes gives back all of a white world."""
    for roughness in (0.0, 0.1, 0.5, 1.0):
        _, lobes = _principled(Base_Color=(1, 1, 1, 1), Roughness=roughness).export()
        mirrored = layer_albedo(0.0, 1.5) if of_kind(lobes, "MIRROR") else 0.0
        np.testing.assert_allclose(total(lobes, "AMBIENT") + mirrored, 1.0, rtol=1e-6)


def test_principled_sheen(scene):  # noqa: F811
    tint = (0.2, 1.0, 0.4, 1.0)
    shader = _principled(Base_Color=RED, Specular_IOR_Level=0.0, Sheen_Weight=0.5, Sheen_Roughness=0.8, Sheen_Tint=tint)
    result, lobes = shader.export()
    reflected = 0.5 * sheen_albedo(0.8) * np.array(tint[:3])
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3] * (1 - reflected) + reflected, rtol=1e-6)
    assert any("sheen" in note for note in result.notes)


def test_principled_metal(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Metallic=1.0, Roughness=0.0).export()
    (mirror,) = lobes
    assert (mirror.kind, mirror.fresnel) == ("MIRROR", False)
    np.testing.assert_allclose(weight(mirror), RED[:3])


def test_principled_smooth_plastic_reflects_by_fresnel(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Roughness=0.0).export()
    (mirror,) = of_kind(lobes, "MIRROR")
    assert (mirror.fresnel, mirror.ior) == (True, 1.5)
    np.testing.assert_allclose(weight(mirror), 1)


def test_principled_glass_takes_the_root_of_its_colour(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Transmission_Weight=1.0, Roughness=0.0).export()
    np.testing.assert_allclose(total(lobes, "REFRACTION"), np.sqrt(RED[:3]), rtol=1e-6)
    assert _kinds(lobes) == {"MIRROR", "REFRACTION"}


def test_principled_coat(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Coat_Weight=1.0, Coat_Roughness=0.0).export()
    (mirror,) = of_kind(lobes, "MIRROR")
    assert (mirror.fresnel, mirror.ior) == (True, 1.5)
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], (1 - _loss()) * (1 - _loss(roughness=0.0))), rtol=1e-6)


def test_alpha_lets_through_what_the_surface_does_not_cover(scene):  # noqa: F811
    _, lobes = _principled(Base_Color=RED, Alpha=0.25).export()
    np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 0.75)
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 0.25 * (1 - _loss())), rtol=1e-6)


WHITE = ({"Metallic": 1.0}, {"Metallic": 1.0, "Roughness": 0.0}, {"Alpha": 0.5, "Metallic": 1.0}, {"Roughness": 0.0}, {"Roughness": 0.7})


@pytest.mark.parametrize("inputs", WHITE)
def test_a_uniform_world_is_a_furnace(scene, inputs):  # noqa: F811
    """White things give back the ambient light, all of it: what they reflect, mirror and let through sums to one over all views."""
    cosines = (np.arange(1000) + 0.5) / 1000
    _, lobes = _principled(Base_Color=(1.0, 1.0, 1.0, 1.0), **inputs).export()
    back = total(lobes, "AMBIENT") + total(lobes, "TRANSPARENT")
    for mirror in of_kind(lobes, "MIRROR"):
        back = back + weight(mirror) * (np.mean([2 * c * fresnel(c, mirror.ior) for c in cosines]) if mirror.fresnel else 1)
    np.testing.assert_allclose(back, 1, atol=5e-4)  # the export takes the mean over 32 views


def test_lobes_of_weight_zero_are_gone(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    for name, kind in (("Shader", "ShaderNodeBsdfDiffuse"), ("Shader_001", "ShaderNodeBsdfTransparent")):
        shader.link(shader.node(kind), 0, shader.shader, name)
    shader.shader.inputs[0].default_value = 0.0
    assert _kinds(shader.export()[1]) == {"AMBIENT", "DIFFUSE"}


def test_mix_and_add(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    red, clear = shader.node("ShaderNodeBsdfDiffuse"), shader.node("ShaderNodeBsdfTransparent")
    _set(red, Color=RED)
    shader.link(red, 0, shader.shader, "Shader")
    shader.link(clear, 0, shader.shader, "Shader_001")
    shader.shader.inputs[0].default_value = 0.25
    _, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 0.75))
    np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 0.25)
    shader = Shader("Sum", "ShaderNodeAddShader")
    red = shader.node("ShaderNodeBsdfDiffuse")
    _set(red, Color=RED)
    shader.link(red, 0, shader.shader, "Shader")
    shader.link(red, 0, shader.shader, "Shader_001")
    _, lobes = shader.export()
    assert len(of_kind(lobes, "DIFFUSE")) == 1
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 2))


def test_a_mirror_mixed_by_fresnel_is_exact(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    glossy, clear, factor = (shader.node(f"ShaderNode{name}") for name in ("BsdfAnisotropic", "BsdfRefraction", "Fresnel"))
    _set(glossy, Roughness=0.0, Color=(1, 1, 1, 1))
    _set(clear, Roughness=0.0, IOR=1.25, Color=(1, 1, 1, 1))
    _set(factor, IOR=1.25)
    shader.link(clear, 0, shader.shader, "Shader")
    shader.link(glossy, 0, shader.shader, "Shader_001")
    shader.link(factor, 0, shader.shader, shader.shader.inputs[0].identifier)
    mirror, refraction = shader.export()[1]
    assert (mirror.kind, mirror.fresnel, mirror.ior) == ("MIRROR", True, 1.25)
    assert (refraction.kind, refraction.fresnel, refraction.ior) == ("REFRACTION", True, 1.25)


def test_image_on_a_colour(scene):  # noqa: F811
    shader = Shader()
    texture = shader.node("ShaderNodeTexImage", image=image(pixels=((0.5, 0.25, 0.75, 1),)))
    shader.link(texture, "Color", shader.shader, "Color")
    result, lobes = shader.export()
    expected = srgb_to_linear(np.rint(np.array([0.5, 0.25, 0.75]) * 255) / 255)
    np.testing.assert_allclose(total(lobes, "DIFFUSE", result.scene.textures), expected, rtol=1e-6)
    assert len(of_kind(lobes, "DIFFUSE")) == 1
    assert result.scene.geometries[0].attributes[0].name == "UVMap"


def test_alpha_of_an_image(scene):  # noqa: F811
    shader = _principled(Metallic=1.0, Base_Color=(1, 1, 1, 1))
    texture = shader.node("ShaderNodeTexImage", image=image(pixels=((1, 1, 1, 0.25),), float_buffer=False))
    shader.link(texture, "Alpha", shader.shader, "Alpha")
    result, lobes = shader.export()
    alpha = np.rint(0.25 * 255) / 255
    np.testing.assert_allclose(total(lobes, "TRANSPARENT", result.scene.textures), 1 - alpha)
    np.testing.assert_allclose(total(lobes, "AMBIENT", result.scene.textures), alpha)
    assert [factor.channel for lobe in of_kind(lobes, "TRANSPARENT") for factor in lobe.factors] == ["ALPHA"]


def test_colour_of_an_image_alone_is_times_alpha_under_its_curve(scene):  # noqa: F811
    """As Cycles does it (seen in 4.2 and 5.0): bytes are multiplied before the sRGB curve is undone."""
    shader = Shader()
    shader.link(shader.node("ShaderNodeTexImage", image=image(pixels=((0.5, 0.25, 0.75, 0.5),))), "Color", shader.shader, "Color")
    result, lobes = shader.export()
    found = total(lobes, "DIFFUSE", result.scene.textures)
    np.testing.assert_allclose(found, (0.05126947, 0.01444384, 0.11443541), rtol=1e-5)


def test_texture_drives_a_mix(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    red, clear = shader.node("ShaderNodeBsdfDiffuse"), shader.node("ShaderNodeBsdfTransparent")
    _set(red, Color=RED)
    mask = image(pixels=((0.25, 0.25, 0.25, 1),), space="Non-Color")
    shader.link(shader.node("ShaderNodeTexImage", image=mask), "Color", shader.shader, shader.shader.inputs[0].identifier)
    shader.link(red, 0, shader.shader, "Shader")
    shader.link(clear, 0, shader.shader, "Shader_001")
    result, lobes = shader.export()
    value = np.rint(0.25 * 255) / 255
    np.testing.assert_allclose(total(lobes, "DIFFUSE", result.scene.textures), np.multiply(RED[:3], 1 - value), rtol=1e-6)
    np.testing.assert_allclose(total(lobes, "TRANSPARENT", result.scene.textures), value, rtol=1e-6)
    assert all(factor.channel == "LUMINANCE" for factor in of_kind(lobes, "TRANSPARENT")[0].factors if factor.texture >= 0)


def test_vertex_colour_times_texture(scene):  # noqa: F811
    shader = Shader()
    mix = shader.node("ShaderNodeMix", data_type="RGBA", blend_type="MULTIPLY")
    mix.inputs["Factor_Float" if "Factor_Float" in mix.inputs else 0].default_value = 1.0
    shader.link(shader.node("ShaderNodeTexImage", image=image()), "Color", mix, "A_Color")
    shader.link(shader.node("ShaderNodeVertexColor", layer_name="Col"), "Color", mix, "B_Color")
    shader.tree.links.new(next(s for s in mix.outputs if s.identifier == "Result_Color"), shader.shader.inputs["Color"])
    result, lobes = shader.export()
    (lobe,) = of_kind(lobes, "DIFFUSE")
    assert {factor.attribute for factor in lobe.factors} == {"", "Col"}
    expected = srgb_to_linear(np.rint(np.array([0.5, 0.25, 0.75]) * 255) / 255) * (0.1, 0.2, 0.3)
    np.testing.assert_allclose(weight(lobe, result.scene.textures, {"Col": (0.1, 0.2, 0.3)}), expected, rtol=1e-6)
    assert {a.name for a in result.scene.geometries[0].attributes} == {"UVMap", "Col"}


def test_attribute_as_a_number_is_grey(scene):  # noqa: F811
    shader = _principled(Base_Color=RED)
    shader.quad.data.color_attributes["Col"].data.foreach_set("color", np.tile(np.array([0.1, 0.2, 0.6, 1], np.float32), 4))
    shader.link(shader.node("ShaderNodeVertexColor", layer_name="Col"), "Color", shader.shader, "Alpha")
    result, lobes = shader.export()
    (attribute,) = result.scene.geometries[0].attributes
    np.testing.assert_allclose(attribute.values[:, :3], 0.3, rtol=1e-6)
    colors = {attribute.name: (0.3, 0.3, 0.3)}
    np.testing.assert_allclose(total(lobes, "TRANSPARENT", colors=colors), 0.7, rtol=1e-6)


def test_mix_of_textures_by_a_constant_is_a_sum(scene):  # noqa: F811
    shader = Shader()
    mix = shader.node("ShaderNodeMixRGB", blend_type="MIX")
    mix.inputs[0].default_value = 0.25
    for name, value in (("Color1", 0.5), ("Color2", 0.75)):
        picture = image(name, ((value, value, value, 1),), space="Non-Color")
        shader.link(shader.node("ShaderNodeTexImage", image=picture), "Color", mix, name)
    shader.link(mix, 0, shader.shader, "Color")
    result, lobes = shader.export()
    expected = 0.75 * np.rint(0.5 * 255) / 255 + 0.25 * np.rint(0.75 * 255) / 255
    assert len(of_kind(lobes, "DIFFUSE")) == 2
    np.testing.assert_allclose(total(lobes, "DIFFUSE", result.scene.textures), expected, rtol=1e-6)


MATHS = {
    "ADD": 0.75 + 0.5, "SUBTRACT": 0.25, "MULTIPLY": 0.375, "DIVIDE": 1.5, "POWER": 0.75**0.5, "MINIMUM": 0.5, "MAXIMUM": 0.75,
    "LESS_THAN": 0.0, "GREATER_THAN": 1.0, "SQRT": 0.75**0.5, "MULTIPLY_ADD": 0.375 + 0.125, "SINE": np.sin(0.75), "FRACT": 0.75,
    "ABSOLUTE": 0.75, "ROUND": 1.0, "FLOOR": 0.0, "CEIL": 1.0, "MODULO": 0.25, "COMPARE": 0.0, "SIGN": 1.0,
}  # fmt: skip


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("operation", MATHS)
def test_math(scene, operation, textured):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    node = shader.node("ShaderNodeMath", operation=operation)
    for socket, value in zip(node.inputs, (0.75, 0.5, 0.125), strict=True):
        socket.default_value = value
    if textured:
        picture = image(pixels=((0.75, 0.75, 0.75, 1),), float_buffer=True)
        shader.link(shader.node("ShaderNodeTexImage", image=picture), "Color", node, node.inputs[0].identifier)
    shader.link(node, 0, shader.shader, "Strength")
    _set(shader.shader, Color=(1, 1, 1, 1))
    result, lobes = shader.export()
    assert not any("not supported" in note for note in result.notes)
    np.testing.assert_allclose(total(lobes, "EMISSION", result.scene.textures), MATHS[operation], rtol=1e-6, atol=1e-7)


def _colour_nodes():
    ramp = lambda shader: shader.node("ShaderNodeValToRGB")  # noqa: E731
    return {
        "ShaderNodeInvert": (None, lambda c: 1 - c),
        "ShaderNodeGamma": ({"Gamma": 2.0}, lambda c: c**2),
        "ShaderNodeBrightContrast": ({"Bright": 0.1, "Contrast": 0.5}, lambda c: np.maximum(1.5 * c + 0.1 - 0.25, 0)),
        "ShaderNodeHueSaturation": ({"Value": 0.5}, lambda c: c * 0.5),
        "ramp": (ramp, lambda c: np.full(3, c @ (0.2126, 0.7152, 0.0722))),
        "ShaderNodeRGBToBW": (None, lambda c: np.full(3, c @ (0.2126, 0.7152, 0.0722))),
    }


@pytest.mark.parametrize("kind", _colour_nodes())
def test_colour_nodes_on_constants(scene, kind):  # noqa: F811
    settings, expected = _colour_nodes()[kind]
    shader = Shader(shader="ShaderNodeEmission")
    node = settings(shader) if callable(settings) else shader.node(kind)
    for name, value in (settings or {}).items() if not callable(settings) else ():
        node.inputs[name].default_value = value
    rgb = shader.node("ShaderNodeRGB")
    rgb.outputs[0].default_value = RED
    shader.link(rgb, 0, node, "Fac" if kind == "ramp" else "Color")
    shader.link(node, 0, shader.shader, "Color")
    _, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "EMISSION"), expected(np.array(RED[:3])), rtol=1e-5)


def test_hue_is_turned_as_blender_turns_it(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    node = shader.node("ShaderNodeHueSaturation")
    _set(node, Hue=0.75, Saturation=0.5, Value=1.0, Color=(0.8, 0.2, 0.1, 1))
    shader.link(node, 0, shader.shader, "Color")
    import colorsys

    hue, saturation, value = colorsys.rgb_to_hsv(0.8, 0.2, 0.1)
    expected = colorsys.hsv_to_rgb((hue + 0.25) % 1, saturation * 0.5, value)
    np.testing.assert_allclose(total(shader.export()[1], "EMISSION"), expected, rtol=1e-5)


def test_separate_channels_of_an_image(scene):  # noqa: F811
    """glTF's packed texture: metallic is blue, roughness green; the roughness is its mean, with a note."""
    shader = _principled(Base_Color=RED)
    packed = image(pixels=((0.9, 0.5, 0.25, 1),), space="Non-Color")
    split = shader.node("ShaderNodeSeparateColor")
    shader.link(shader.node("ShaderNodeTexImage", image=packed), "Color", split, "Color")
    shader.link(split, "Blue", shader.shader, "Metallic")
    shader.link(split, "Green", shader.shader, "Roughness")
    result, lobes = shader.export()
    metallic, roughness = np.rint(0.25 * 255) / 255, np.rint(0.5 * 255) / 255
    np.testing.assert_allclose(
        total(lobes, "DIFFUSE", result.scene.textures), np.multiply(RED[:3], (1 - metallic) * (1 - _loss(roughness=roughness))), rtol=1e-6
    )
    exponents = {p for p, _ in (*highlights(roughness), *dielectric_highlights(roughness, normal_reflectance(1.5)))}
    np.testing.assert_allclose(sorted({lobe.exponent for lobe in of_kind(lobes, "SPECULAR")}), sorted(exponents), rtol=1e-4)
    assert any("'Roughness'" in note for note in result.notes)


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE", "VECTOR"])
def test_mapping(scene, kind):  # noqa: F811
    from mathutils import Euler, Vector

    shader = Shader()
    texture, mapping, uv = shader.node("ShaderNodeTexImage", image=image()), shader.node("ShaderNodeMapping", vector_type=kind), None
    uv = shader.node("ShaderNodeTexCoord")
    rotation, scaling = Euler((0.3, 0.2, 1.0)), Vector((2.0, 0.5, 3.0))
    location = Vector((0.25, -0.5, 1.0))
    _set(mapping, Rotation=rotation, Scale=scaling)
    if kind != "VECTOR":
        _set(mapping, Location=location)
    shader.link(uv, "UV", mapping, "Vector")
    shader.link(mapping, "Vector", texture, "Vector")
    shader.link(texture, "Color", shader.shader, "Color")
    transform = np.array(of_kind(shader.export()[1], "DIFFUSE")[0].factors[0].uv_transform)
    turn = rotation.to_matrix()
    for u, v in ((0, 0), (1, 0), (0.3, 0.8)):
        point = Vector((u, v, 0))
        if kind == "TEXTURE":
            back = turn.inverted() @ (point - location)
            expected = [back[k] / scaling[k] for k in range(2)]
        else:
            scaled = Vector([a * b for a, b in zip(point, scaling, strict=True)])
            expected = (turn @ scaled + (location if kind == "POINT" else Vector()))[:2]
        np.testing.assert_allclose(transform @ (u, v, 1), expected, atol=1e-6)


def test_uv_map_by_name(scene):  # noqa: F811
    shader = Shader()
    shader.quad.data.uv_layers.new(name="Second")
    texture = shader.node("ShaderNodeTexImage", image=image())
    shader.link(shader.node("ShaderNodeUVMap", uv_map="Second"), "UV", texture, "Vector")
    shader.link(texture, "Color", shader.shader, "Color")
    result, lobes = shader.export()
    assert {factor.uv for lobe in lobes for factor in lobe.factors} == {"Second"}
    assert [a.name for a in result.scene.geometries[0].attributes] == ["Second"]


def test_blinn_phong_node(scene):  # noqa: F811
    from glint.addon import nodes

    nodes.register()
    try:
        shader = Shader(shader="GlintBlinnPhongNode")
        colors = {"Ambient": (0.1, 0.2, 0.3), "Diffuse": (0.4, 0.5, 0.6), "Specular": (0.7, 0.8, 0.9), "Mirror": (0.25, 0.5, 0.75)}
        _set(shader.shader, Exponent=20, Alpha=0.5, Emission=(2, 3, 4, 1), **{name: (*rgb, 1) for name, rgb in colors.items()})
        result, lobes = shader.export()
        for name, rgb in {**colors, "Emission": (2, 3, 4)}.items():
            np.testing.assert_allclose(total(lobes, name.upper()), np.multiply(rgb, 0.5), rtol=1e-6)
        np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 0.5)
        assert of_kind(lobes, "SPECULAR")[0].exponent == 20
        assert len(lobes) == 6
        assert not any("supported" in note for note in result.notes)
    finally:
        bpy.ops.wm.read_factory_settings(use_empty=True)  # Blender 4.2 crashes later if a node outlives its class
        nodes.unregister()


def _group(depth: int, kind: str = "NodeSocketColor"):
    """Node groups, `depth` deep, that pass a colour through every level and through a reroute in the innermost."""
    tree = None
    for level in range(depth):
        outer = bpy.data.node_groups.new(f"Level{level}", "ShaderNodeTree")
        for way in ("INPUT", "OUTPUT"):
            outer.interface.new_socket("Color", in_out=way, socket_type=kind)
        start, end, middle = (
            outer.nodes.new(name) for name in ("NodeGroupInput", "NodeGroupOutput", "NodeReroute" if level % 2 else "ShaderNodeGroup")
        )
        if tree is None or level % 2:
            outer.nodes.remove(middle)
            middle = outer.nodes.new("NodeReroute") if tree is None else outer.nodes.new("ShaderNodeGroup")
        if tree is not None:
            middle.node_tree = tree
        outer.links.new(start.outputs[0], middle.inputs[0])
        outer.links.new(middle.outputs[0], end.inputs[0])
        tree = outer
    return tree


@pytest.mark.parametrize("depth", [1, 3, 256])
def test_nested_groups(scene, depth):  # noqa: F811
    shader = Shader()
    group = shader.node("ShaderNodeGroup", node_tree=_group(depth))
    group.inputs[0].default_value = RED
    shader.link(group, 0, shader.shader, "Color")
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    assert result.notes == ()


def test_groups_with_a_shader_inside(scene):  # noqa: F811
    tree = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    tree.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketColor")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    start, end, diffuse = (tree.nodes.new(name) for name in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeBsdfDiffuse"))
    tree.links.new(start.outputs[0], diffuse.inputs["Color"])
    tree.links.new(diffuse.outputs[0], end.inputs[0])
    shader = Shader(shader=None)
    for rgb in (RED, (0.1, 0.9, 0.3, 1)):
        group = shader.node("ShaderNodeGroup", node_tree=tree)
        group.inputs[0].default_value = rgb
        shader.link(group, 0, shader.output, "Surface")
        np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), rgb[:3])


def test_two_uses_of_a_group_are_told_apart(scene):  # noqa: F811
    """The nodes inside are the same, what they are fed is not."""
    tree = _group(1)
    gamma = tree.nodes.new("ShaderNodeGamma")
    tree.links.new(tree.nodes["Group Input"].outputs[0], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], tree.nodes["Group Output"].inputs[0])
    shader = Shader(shader="ShaderNodeAddShader")
    for name, rgb in (("Shader", (0.5, 0, 0, 1)), ("Shader_001", (0, 0.25, 0, 1))):
        group, diffuse = shader.node("ShaderNodeGroup", node_tree=tree), shader.node("ShaderNodeBsdfDiffuse")
        group.inputs[0].default_value = rgb
        shader.link(group, 0, diffuse, "Color")
        shader.link(diffuse, 0, shader.shader, name)
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), (0.5, 0.25, 0))


def test_muted_nodes_pass_their_first_input(scene):  # noqa: F811
    shader = Shader()
    gamma = shader.node("ShaderNodeGamma", mute=True)
    _set(gamma, Color=RED, Gamma=3.0)
    shader.link(gamma, 0, shader.shader, "Color")
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), RED[:3])


def test_muted_links_do_not_count(scene):  # noqa: F811
    shader = Shader()
    _set(shader.shader, Color=RED)
    shader.link(shader.node("ShaderNodeGamma"), 0, shader.shader, "Color")
    shader.shader.inputs["Color"].links[0].is_muted = True
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), RED[:3])


def test_circles_end_in_the_default(scene):  # noqa: F811
    shader = Shader()
    _set(shader.shader, Color=RED)
    first, second = shader.node("ShaderNodeGamma"), shader.node("ShaderNodeInvert")
    shader.link(first, 0, second, "Color")
    shader.link(second, 0, first, "Color")
    shader.link(first, 0, shader.shader, "Color")
    result, lobes = shader.export()
    assert np.isfinite(total(lobes, "DIFFUSE")).all()
    assert sum("circle" in note for note in result.notes) <= 1


def test_circles_of_reroutes_and_shaders_end(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeAddShader")
    first, second = shader.node("NodeReroute"), shader.node("NodeReroute")
    shader.link(first, 0, second, second.inputs[0].identifier)
    shader.link(second, 0, first, first.inputs[0].identifier)
    shader.link(first, 0, shader.shader, "Shader")
    shader.link(shader.shader, 0, shader.shader, "Shader_001")
    assert shader.export()[1] == ()


@pytest.mark.parametrize("kind", ["ShaderNodeAddShader", "ShaderNodeMixShader"])
def test_long_chains_end(scene, kind):  # noqa: F811
    """40 nodes that each use the one before twice would be 2⁴⁰ ways; 300 in a row would be too deep to recurse."""
    shader = Shader()
    before = shader.shader
    for _ in range(300 if kind == "ShaderNodeMixShader" else 40):
        node = shader.node(kind)
        shader.link(before, 0, node, "Shader")
        shader.link(before, 0, node, "Shader_001")
        before = node
    shader.link(before, 0, shader.output, "Surface")
    result, lobes = shader.export()
    if kind == "ShaderNodeAddShader":
        np.testing.assert_allclose(total(lobes, "DIFFUSE"), 0.8 * 2.0**40, rtol=1e-6)
    else:
        assert any("too deeply" in note for note in result.notes)


def test_what_is_not_understood_is_the_default_and_one_note(scene):  # noqa: F811
    for name in ("One", "Two"):
        shader = Shader(name)
        _set(shader.shader, Color=RED)
        shader.link(shader.node("ShaderNodeTexNoise"), "Color", shader.shader, "Color")
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    (note,) = result.notes
    assert "Noise" in note
    assert "'One', 'Two'" in note


def test_bumps_and_displacement_are_noted_once(scene):  # noqa: F811
    shader = Shader()
    shader.link(shader.node("ShaderNodeNormalMap"), 0, shader.shader, "Normal")
    shader.link(shader.node("ShaderNodeDisplacement"), 0, shader.output, "Displacement")
    notes = shader.export()[0].notes
    assert len(notes) == 2
    assert all("'Material'" in note for note in notes)


def test_no_output_is_black(scene):  # noqa: F811
    shader = Shader()
    shader.tree.nodes.remove(shader.output)
    result, lobes = shader.export()
    assert lobes == ()
    assert any("output" in note for note in result.notes)


def test_a_colour_on_the_surface_glows(scene):  # noqa: F811
    shader = Shader(shader=None)
    rgb = shader.node("ShaderNodeRGB")
    rgb.outputs[0].default_value = RED
    shader.link(rgb, 0, shader.output, "Surface")
    np.testing.assert_allclose(total(shader.export()[1], "EMISSION"), RED[:3])


def test_the_output_for_all_engines_counts(scene):  # noqa: F811
    shader = Shader()
    _set(shader.shader, Color=RED)
    eevee, black = shader.node("ShaderNodeOutputMaterial", target="EEVEE"), shader.node("ShaderNodeEmission")
    shader.link(black, 0, eevee, "Surface")
    assert _kinds(shader.export()[1]) == {"AMBIENT", "DIFFUSE"}


def test_no_material_is_blenders_default_grey(scene):  # noqa: F811
    quad()
    (material,) = export().scene.materials
    (diffuse,) = of_kind(material.lobes, "DIFFUSE")
    principled = bpy.app.version >= (5, 0, 0)  # seen in Cycles: 5.0 made the default surface a Principled BSDF
    np.testing.assert_allclose(weight(diffuse), 0.8 * (1 - _loss() if principled else 1), rtol=1e-6)
    assert bool(of_kind(material.lobes, "SPECULAR")) == principled


def test_empty_slots_are_the_default(scene):  # noqa: F811
    thing = quad("Quad", bpy.data.materials.new("Material"))
    thing.data.materials.append(None)
    result = export()
    assert [result.scene.materials[k].name for k in result.scene.instances[0].materials] == ["Material", "Default"]


@pytest.mark.skipif(bpy.app.version >= (5, 0, 0), reason="every material has nodes from Blender 5.0 on")
def test_a_material_without_nodes(scene):  # noqa: F811
    material = bpy.data.materials.new("Plain")
    material.use_nodes, material.diffuse_color, material.metallic = False, (*RED[:3], 1), 0.25
    quad("Quad", material)
    lobes = export().scene.materials[0].lobes
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), np.multiply(RED[:3], 0.75), rtol=1e-6)
    assert of_kind(lobes, "SPECULAR")


def test_values_that_are_not_finite_are_zero(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    value = shader.node("ShaderNodeCombineXYZ")
    _set(value, X=np.nan, Y=0.5, Z=0.25)
    shader.link(value, 0, shader.shader, "Color")
    np.testing.assert_allclose(total(shader.export()[1], "EMISSION"), (0, 0.5, 0.25))


def test_material_index(scene):  # noqa: F811
    shader = Shader()
    shader.material.pass_index = 9
    assert shader.export()[0].scene.materials[0].index == 9
