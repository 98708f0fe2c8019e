"""What feeds a shader's sockets: images, attributes, arithmetic, colours and mappings."""

import numpy as np
import pytest

from export_support import (  # noqa: F401
    RED,
    Shader,
    image,
    layer_share,
    of_kind,
    outputs_of,
    principled,
    resolved,
    scene,
    set_inputs,
    srgb_to_linear,
    total,
    weight,
)
from glint.addon.export.images.images import mean_color, texels
from glint.engine.scene import Texture


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
    shader = principled(Metallic=1.0, Base_Color=(1, 1, 1, 1))
    texture = shader.node(
        "ShaderNodeTexImage", image=image(pixels=((1, 1, 1, 0.25),), float_buffer=False)
    )
    shader.link(texture, "Alpha", shader.shader, "Alpha")
    result, lobes = shader.export()
    alpha = np.rint(0.25 * 255) / 255
    np.testing.assert_allclose(total(lobes, "TRANSPARENT", result.scene.textures), 1 - alpha)
    np.testing.assert_allclose(total(lobes, "AMBIENT", result.scene.textures), alpha)
    assert [
        factor.channel for lobe in of_kind(lobes, "TRANSPARENT") for factor in lobe.factors
    ] == ["ALPHA"]


def test_colour_of_an_image_alone_is_times_alpha_under_its_curve(scene):  # noqa: F811
    """As Cycles does it (seen in 4.2 and 5.0): bytes are multiplied before the sRGB curve is
    undone.
    """
    shader = Shader()
    shader.link(
        shader.node("ShaderNodeTexImage", image=image(pixels=((0.5, 0.25, 0.75, 0.5),))),
        "Color",
        shader.shader,
        "Color",
    )
    result, lobes = shader.export()
    found = total(lobes, "DIFFUSE", result.scene.textures)
    np.testing.assert_allclose(found, (0.05126947, 0.01444384, 0.11443541), rtol=1e-5)


def test_texture_drives_a_mix(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeMixShader")
    red, clear = shader.node("ShaderNodeBsdfDiffuse"), shader.node("ShaderNodeBsdfTransparent")
    set_inputs(red, Color=RED)
    mask = image(pixels=((0.25, 0.25, 0.25, 1),), space="Non-Color")
    shader.link(
        shader.node("ShaderNodeTexImage", image=mask),
        "Color",
        shader.shader,
        shader.shader.inputs[0].identifier,
    )
    shader.link(red, 0, shader.shader, "Shader")
    shader.link(clear, 0, shader.shader, "Shader_001")
    result, lobes = shader.export()
    value = np.rint(0.25 * 255) / 255
    np.testing.assert_allclose(
        total(lobes, "DIFFUSE", result.scene.textures), np.multiply(RED[:3], 1 - value), rtol=1e-6
    )
    np.testing.assert_allclose(total(lobes, "TRANSPARENT", result.scene.textures), value, rtol=1e-6)
    assert all(
        factor.channel == "LUMINANCE"
        for factor in of_kind(lobes, "TRANSPARENT")[0].factors
        if factor.texture >= 0
    )


def test_vertex_colour_times_texture(scene):  # noqa: F811
    shader = Shader()
    mix = shader.node("ShaderNodeMix", data_type="RGBA", blend_type="MULTIPLY")
    mix.inputs["Factor_Float" if "Factor_Float" in mix.inputs else 0].default_value = 1.0
    shader.link(shader.node("ShaderNodeTexImage", image=image()), "Color", mix, "A_Color")
    shader.link(shader.node("ShaderNodeVertexColor", layer_name="Col"), "Color", mix, "B_Color")
    shader.tree.links.new(
        next(s for s in mix.outputs if s.identifier == "Result_Color"),
        shader.shader.inputs["Color"],
    )
    result, lobes = shader.export()
    (lobe,) = of_kind(lobes, "DIFFUSE")
    assert {factor.attribute for factor in lobe.factors} == {"", "Col"}
    expected = srgb_to_linear(np.rint(np.array([0.5, 0.25, 0.75]) * 255) / 255) * (0.1, 0.2, 0.3)
    np.testing.assert_allclose(
        weight(lobe, result.scene.textures, {"Col": (0.1, 0.2, 0.3)}), expected, rtol=1e-6
    )
    assert {a.name for a in result.scene.geometries[0].attributes} == {"UVMap", "Col"}


def test_attribute_as_a_number_is_grey(scene):  # noqa: F811
    shader = principled(Base_Color=RED)
    shader.quad.data.color_attributes["Col"].data.foreach_set(
        "color", np.tile(np.array([0.1, 0.2, 0.6, 1], np.float32), 4)
    )
    shader.link(
        shader.node("ShaderNodeVertexColor", layer_name="Col"), "Color", shader.shader, "Alpha"
    )
    _, lobes = shader.export()
    colors = {"Col": (0.1, 0.2, 0.6)}
    shown = 0.1 * 0.2126 + 0.2 * 0.7152 + 0.6 * 0.0722
    np.testing.assert_allclose(total(lobes, "TRANSPARENT", colors=colors), 1 - shown, rtol=1e-6)


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
    "ADD": 0.75 + 0.5,
    "SUBTRACT": 0.25,
    "MULTIPLY": 0.375,
    "DIVIDE": 1.5,
    "POWER": 0.75**0.5,
    "MINIMUM": 0.5,
    "MAXIMUM": 0.75,
    "LESS_THAN": 0.0,
    "GREATER_THAN": 1.0,
    "SQRT": 0.75**0.5,
    "MULTIPLY_ADD": 0.375 + 0.125,
    "SINE": np.sin(0.75),
    "FRACT": 0.75,
    "ABSOLUTE": 0.75,
    "ROUND": 1.0,
    "FLOOR": 0.0,
    "CEIL": 1.0,
    "MODULO": 0.25,
    "COMPARE": 0.0,
    "SIGN": 1.0,
}


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize("operation", MATHS)
def test_math(scene, operation, textured):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    node = shader.node("ShaderNodeMath", operation=operation)
    for socket, value in zip(node.inputs, (0.75, 0.5, 0.125), strict=True):
        socket.default_value = value
    if textured:
        picture = image(pixels=((0.75, 0.75, 0.75, 1),), float_buffer=True)
        shader.link(
            shader.node("ShaderNodeTexImage", image=picture),
            "Color",
            node,
            node.inputs[0].identifier,
        )
    shader.link(node, 0, shader.shader, "Strength")
    set_inputs(shader.shader, Color=(1, 1, 1, 1))
    result, _ = shader.export()
    assert not any("not supported" in note for note in result.notes)
    np.testing.assert_allclose(
        total(resolved(result), "EMISSION", result.scene.textures),
        MATHS[operation],
        rtol=1e-6,
        atol=1e-7,
    )


def _colour_nodes():
    ramp = lambda shader: shader.node("ShaderNodeValToRGB")  # noqa: E731
    return {
        "ShaderNodeInvert": (None, lambda c: 1 - c),
        "ShaderNodeGamma": ({"Gamma": 2.0}, lambda c: c**2),
        "ShaderNodeBrightContrast": (
            {"Bright": 0.1, "Contrast": 0.5},
            lambda c: np.maximum(1.5 * c + (float(np.float32(0.1)) - 0.25), 0),
        ),
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
    np.testing.assert_allclose(
        total(lobes, "EMISSION"), expected(np.float32(RED[:3]).astype(float)), rtol=1e-5
    )


def test_hue_is_turned_as_blender_turns_it(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    node = shader.node("ShaderNodeHueSaturation")
    set_inputs(node, Hue=0.75, Saturation=0.5, Value=1.0, Color=(0.8, 0.2, 0.1, 1))
    shader.link(node, 0, shader.shader, "Color")
    import colorsys

    hue, saturation, value = colorsys.rgb_to_hsv(0.8, 0.2, 0.1)
    expected = colorsys.hsv_to_rgb((hue + 0.25) % 1, saturation * 0.5, value)
    np.testing.assert_allclose(total(shader.export()[1], "EMISSION"), expected, rtol=1e-5)


def test_separate_channels_of_an_image(scene):  # noqa: F811
    """glTF's packed texture: metallic is blue, roughness green."""
    shader = principled(Base_Color=RED)
    packed = image(pixels=((0.9, 0.5, 0.25, 1),), space="Non-Color")
    split = shader.node("ShaderNodeSeparateColor")
    shader.link(shader.node("ShaderNodeTexImage", image=packed), "Color", split, "Color")
    shader.link(split, "Blue", shader.shader, "Metallic")
    shader.link(split, "Green", shader.shader, "Roughness")
    result, lobes = shader.export()
    metallic, roughness = np.rint(0.25 * 255) / 255, np.rint(0.5 * 255) / 255
    (material,) = (m for m in result.scene.materials if m.program)
    outputs = outputs_of(material, result.scene.textures)
    diffuse = sum(
        lobe.factors[0].value * outputs[lobe.factors[0].output]
        for lobe in of_kind(lobes, "DIFFUSE")
        if lobe.exponent == 0
    )
    constant = principled(Base_Color=RED, Roughness=roughness, Metallic=metallic).export()[1]
    plain = [lobe for lobe in of_kind(constant, "DIFFUSE") if lobe.exponent == 0]
    np.testing.assert_allclose(diffuse, total(plain, "DIFFUSE"), rtol=1e-3, atol=1e-4)
    (width,) = {outputs[lobe.masking_output][0] for lobe in of_kind(lobes, "SPECULAR")}
    np.testing.assert_allclose(width, roughness**2, rtol=5e-3)
    assert not result.notes


def test_separate_takes_the_factor_along(scene):  # noqa: F811
    """A channel of a picture times a colour is that channel times the colour's, whatever the
    picture's encoding.
    """
    shader = Shader(shader="ShaderNodeEmission")
    shown, split = (
        shader.node("ShaderNodeTexImage", image=image(pixels=((0.8, 0.4, 0.2, 1),))),
        shader.node("ShaderNodeSeparateColor"),
    )
    scaled = shader.node("ShaderNodeMixRGB", blend_type="MULTIPLY")
    set_inputs(scaled, Fac=1.0, Color2=(1.0, 0.5, 1.0, 1.0))
    shader.link(shown, "Color", scaled, "Color1")
    shader.link(scaled, 0, split, "Color")
    shader.link(split, "Green", shader.shader, "Strength")
    result, _ = shader.export()
    green = 0.5 * srgb_to_linear(np.rint(0.4 * 255) / 255)
    np.testing.assert_allclose(total(resolved(result), "EMISSION"), np.full(3, green), rtol=1e-6)


@pytest.mark.parametrize("encoding", ["SRGB", "LINEAR"])
@pytest.mark.parametrize("channel", ["COLOR", "ALPHA", "LUMINANCE"])
def test_means_are_counted_right(encoding, channel):
    """Bytes by their counts, against the mean of the decoded texels."""
    bytes_ = np.random.default_rng(3).integers(0, 256, (31, 17, 4), np.uint8)
    for pixels in (bytes_, bytes_.astype(np.float32) / 255):
        texture = Texture(
            "t", pixels, encoding if pixels is bytes_ else "LINEAR", "REPEAT", "LINEAR"
        )
        np.testing.assert_allclose(
            mean_color(texture, channel),
            texels(texture, channel).mean(0, dtype=np.float64),
            rtol=1e-6,
        )


@pytest.mark.parametrize("kind", ["POINT", "TEXTURE", "VECTOR"])
def test_mapping(scene, kind):  # noqa: F811
    from mathutils import Euler, Vector

    shader = Shader()
    texture, mapping, uv = (
        shader.node("ShaderNodeTexImage", image=image()),
        shader.node("ShaderNodeMapping", vector_type=kind),
        None,
    )
    uv = shader.node("ShaderNodeTexCoord")
    rotation, scaling = Euler((0.3, 0.2, 1.0)), Vector((2.0, 0.5, 3.0))
    location = Vector((0.25, -0.5, 1.0))
    set_inputs(mapping, Rotation=rotation, Scale=scaling)
    if kind != "VECTOR":
        set_inputs(mapping, Location=location)
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


def _attribute_times_two(shader: Shader):
    """A node that gives twice the colour attribute, which the tests take to be (x, x, x), less one
    half.
    """
    node = shader.node("ShaderNodeMath", operation="MULTIPLY_ADD")
    node.inputs[1].default_value, node.inputs[2].default_value = 2.0, -0.5
    shader.link(
        shader.node("ShaderNodeVertexColor", layer_name="Col"),
        "Color",
        node,
        node.inputs[0].identifier,
    )
    return node


def _through_math(shader: Shader) -> str:
    node = _attribute_times_two(shader)
    node.use_clamp = True
    shader.link(node, 0, shader.shader, "Strength")
    return "EMISSION"


def _through_map_range(shader: Shader) -> str:
    node = shader.node("ShaderNodeMapRange", clamp=True)
    set_inputs(node, From_Min=0.25, From_Max=0.75)
    shader.link(shader.node("ShaderNodeVertexColor", layer_name="Col"), "Color", node, "Value")
    shader.link(node, 0, shader.shader, "Strength")
    return "EMISSION"


def _through_clamp(shader: Shader) -> str:
    node = shader.node("ShaderNodeClamp")
    shader.link(_attribute_times_two(shader), 0, node, "Value")
    shader.link(node, 0, shader.shader, "Strength")
    return "EMISSION"


def _through_mix(shader: Shader) -> str:
    node = shader.node("ShaderNodeMix", data_type="RGBA")
    for socket, value in (("A_Color", 0.0), ("B_Color", 1.0)):
        next(s for s in node.inputs if s.identifier == socket).default_value = (value,) * 3 + (1.0,)
    shader.link(_attribute_times_two(shader), 0, node, "Factor_Float")
    shader.tree.links.new(
        next(s for s in node.outputs if s.identifier == "Result_Color"),
        shader.shader.inputs["Strength"],
    )
    return "EMISSION"


def _through_mix_shader(shader: Shader) -> str:
    mix, clear = shader.node("ShaderNodeMixShader"), shader.node("ShaderNodeBsdfTransparent")
    shader.link(_attribute_times_two(shader), 0, mix, mix.inputs[0].identifier)
    shader.link(shader.shader, 0, mix, mix.inputs[1].identifier)
    shader.link(clear, 0, mix, mix.inputs[2].identifier)
    shader.link(mix, 0, shader.output, "Surface")
    return "TRANSPARENT"


def _through_alpha(shader: Shader) -> str:
    principled_node = shader.node("ShaderNodeBsdfPrincipled")
    set_inputs(principled_node, Metallic=1.0, Base_Color=(1, 1, 1, 1))
    shader.link(_attribute_times_two(shader), 0, principled_node, "Alpha")
    shader.link(principled_node, 0, shader.output, "Surface")
    return "AMBIENT"


def _as_a_reflectance(shader: Shader) -> str:
    node = shader.node("ShaderNodeBsdfDiffuse")
    shader.link(_attribute_times_two(shader), 0, node, "Color")
    shader.link(node, 0, shader.output, "Surface")
    return "DIFFUSE"


CLAMPS = (
    _through_math,
    _through_map_range,
    _through_clamp,
    _through_mix,
    _through_mix_shader,
    _through_alpha,
)


@pytest.mark.parametrize("build", [*CLAMPS, _as_a_reflectance])
def test_what_varies_is_clamped_where_blender_clamps(scene, build):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    set_inputs(shader.shader, Color=(1, 1, 1, 1), Strength=1.0)
    kind = build(shader)
    result, lobes = shader.export()
    (name,) = {factor.attribute for lobe in lobes for factor in lobe.factors if factor.attribute}
    for x in (-3.0, 0.3, 0.6, 0.9, 40.0):
        expected = (
            max(2 * x - 0.5, 0.0) if build is _as_a_reflectance else np.clip(2 * x - 0.5, 0, 1)
        )
        assert total(lobes, kind, colors={name: (x,) * 3}) == pytest.approx(
            np.full(3, expected), abs=1e-9
        ), x
    assert not any("clamped" in note for note in result.notes)


def test_a_clamp_that_no_factor_can_say_is_a_programs(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeEmission")
    add = shader.node("ShaderNodeMath", operation="ADD", use_clamp=True)
    for number, value in enumerate((0.75, 0.5)):
        picture = image(f"{value}", ((value,) * 3 + (1,),), space="Non-Color")
        shader.link(
            shader.node("ShaderNodeTexImage", image=picture),
            "Color",
            add,
            add.inputs[number].identifier,
        )
    shader.link(add, 0, shader.shader, "Strength")
    result, lobes = shader.export()
    (lobe,) = of_kind(lobes, "EMISSION")
    assert lobe.factors[0].output == 0
    material = next(m for m in result.scene.materials if m.program)
    assert outputs_of(material, result.scene.textures)[0] == pytest.approx(np.ones(3))
    assert not any("clamped" in note for note in result.notes)
    add.operation = "MULTIPLY"
    result, lobes = shader.export()
    assert len(of_kind(lobes, "EMISSION")[0].factors) == 2, (
        "a product of images cannot leave 0 to 1"
    )
    assert not result.notes[1:]
