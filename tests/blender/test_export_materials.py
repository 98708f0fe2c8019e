"""Whole node trees and materials: groups, circles, outputs, defaults, and what is not understood by
its note.
"""

import bpy
import numpy as np
import pytest

from export_support import (  # noqa: F401
    RED,
    Shader,
    export,
    image,
    kinds,
    layer_share,
    of_kind,
    quad,
    resolved,
    scene,
    set_inputs,
    total,
    weight,
)
from glint import engine


def _group(depth: int, kind: str = "NodeSocketColor"):
    """Node groups, `depth` deep, that pass a colour through every level and through a reroute in
    the innermost.
    """
    tree = None
    for level in range(depth):
        outer = bpy.data.node_groups.new(f"Level{level}", "ShaderNodeTree")
        for way in ("INPUT", "OUTPUT"):
            outer.interface.new_socket("Color", in_out=way, socket_type=kind)
        start, end, middle = (
            outer.nodes.new(name)
            for name in (
                "NodeGroupInput",
                "NodeGroupOutput",
                "NodeReroute" if level % 2 else "ShaderNodeGroup",
            )
        )
        if tree is None or level % 2:
            outer.nodes.remove(middle)
            middle = (
                outer.nodes.new("NodeReroute")
                if tree is None
                else outer.nodes.new("ShaderNodeGroup")
            )
        if tree is not None:
            middle.node_tree = tree
        outer.links.new(start.outputs[0], middle.inputs[0])
        outer.links.new(middle.outputs[0], end.inputs[0])
        tree = outer
    return tree


@pytest.mark.parametrize("depth", [1, 3, 300])
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
    start, end, diffuse = (
        tree.nodes.new(name)
        for name in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeBsdfDiffuse")
    )
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
        group, diffuse = (
            shader.node("ShaderNodeGroup", node_tree=tree),
            shader.node("ShaderNodeBsdfDiffuse"),
        )
        group.inputs[0].default_value = rgb
        shader.link(group, 0, diffuse, "Color")
        shader.link(diffuse, 0, shader.shader, name)
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), (0.5, 0.25, 0))


def test_muted_nodes_pass_their_first_input(scene):  # noqa: F811
    shader = Shader()
    gamma, red = shader.node("ShaderNodeGamma", mute=True), shader.node("ShaderNodeRGB")
    red.outputs[0].default_value = RED
    set_inputs(gamma, Gamma=3.0)
    shader.link(red, 0, gamma, "Color")
    shader.link(gamma, 0, shader.shader, "Color")
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), RED[:3])


def test_muted_nodes_without_an_input_to_pass_count_as_unlinked(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED)
    image = shader.node("ShaderNodeTexImage")
    shader.link(shader.node("ShaderNodeTexCoord", mute=True), "Generated", image, "Vector")
    shader.link(image, 0, shader.shader, "Color")
    assert shader.export()[0].scene.textures
    image.mute = True
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), RED[:3])


def test_muted_links_do_not_count(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED)
    shader.link(shader.node("ShaderNodeGamma"), 0, shader.shader, "Color")
    shader.shader.inputs["Color"].links[0].is_muted = True
    np.testing.assert_allclose(total(shader.export()[1], "DIFFUSE"), RED[:3])


def test_circles_end_in_the_default(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED)
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
    """40 nodes that each use the one before twice would be 2⁴⁰ ways; 300 in a row would be too deep
    to recurse.
    """
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


def test_a_colour_behind_hundreds_of_nodes(scene):  # noqa: F811
    """More than the algebra of sums follows: a program computes what is further away."""
    shader = Shader()
    before = shader.node("ShaderNodeTexImage", image=image(name="grey")).outputs["Alpha"]
    for _ in range(300):
        node = shader.node("ShaderNodeMath")
        node.inputs[1].default_value = 0.25
        shader.tree.links.new(before, node.inputs[0])
        before = node.outputs[0]
    shader.tree.links.new(before, shader.shader.inputs["Color"])

    result, _ = shader.export()

    assert result.notes == ()
    seen = total(resolved(result), "DIFFUSE", result.scene.textures)
    np.testing.assert_allclose(seen, 1.0 + 300 * 0.25)


def test_a_shader_linked_to_a_colour_counts_for_nothing_and_is_told(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED)
    shader.link(shader.node("ShaderNodeEmission"), 0, shader.shader, "Color")
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    (note,) = result.notes
    assert "'Diffuse BSDF'" in note and "'Material'" in note


def test_what_is_broken_leaves_the_rest_of_the_picture(scene, tmp_path):  # noqa: F811
    """A missing file, a number that is not finite, a circle and a shader in a colour's place, each
    told with its material; and a sound one, drawn as when alone.
    """
    missing = bpy.data.images.new("Gone", 1, 1)
    missing.source, missing.filepath = "FILE", str(tmp_path / "gone.png")
    sources = {
        "Missing": ("ShaderNodeTexImage", {"image": missing}, "gone.png"),
        "Infinite": ("ShaderNodeRGB", {}, "not finite"),
        "Circle": ("ShaderNodeGamma", {}, "circle"),
        "Invalid": ("ShaderNodeEmission", {}, "shader is linked to a value"),
    }
    for place, (name, (kind, settings, _)) in enumerate(sources.items()):
        shader = Shader(name)
        node = shader.node(kind, **settings)
        shader.link(node, 0, shader.shader, "Color")
        if name == "Infinite":
            node.outputs[0].default_value = (np.inf, np.nan, 0.5, 1.0)
        if name == "Circle":
            shader.link(node, 0, node, "Color")
        shader.quad.location = (2.5 * place - 5, 0, 0)
    shader = Shader("Sound")
    set_inputs(shader.shader, Color=RED)
    shader.quad.location = (5, 0, 0)

    result, lobes = shader.export()

    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    for name, (_, _, told) in sources.items():
        named = [note for note in result.notes if told in note]
        assert len(named) == 1 and f"'{name if name != 'Missing' else 'Gone'}'" in named[0], name
    film = engine.render(result.scene, engine.Settings(samples=1))
    assert np.isfinite(film.combined).all()


def test_what_is_not_understood_is_the_default_and_one_note(scene):  # noqa: F811
    for name in ("One", "Two"):
        shader = Shader(name)
        set_inputs(shader.shader, Color=RED)
        shader.link(shader.node("ShaderNodeShaderToRGB"), 0, shader.shader, "Color")
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), RED[:3])
    (note,) = result.notes
    assert "Shader to RGB" in note
    assert "'One', 'Two'" in note


def test_normal_maps_and_displacement_bend_the_normal(scene):  # noqa: F811
    shader = Shader()
    shader.link(shader.node("ShaderNodeNormalMap"), 0, shader.shader, "Normal")
    height = shader.node("ShaderNodeDisplacement")
    shader.link(shader.node("ShaderNodeTexNoise"), 0, height, "Height")
    shader.link(height, 0, shader.output, "Displacement")
    result, lobes = shader.export()
    assert not result.notes
    (material,) = (m for m in result.scene.materials if m.lobes == lobes)
    assert material.program is not None and material.normal_output == 0


def test_shaders_with_normals_of_their_own_are_told(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeAddShader")
    for name, bent in (("Shader", True), ("Shader_001", False)):
        diffuse = shader.node("ShaderNodeBsdfDiffuse")
        shader.link(diffuse, 0, shader.shader, name)
        if bent:
            shader.link(shader.node("ShaderNodeNormalMap"), 0, diffuse, "Normal")
    result, lobes = shader.export()
    (note,) = result.notes
    assert "normals of their own" in note
    np.testing.assert_allclose(total(lobes, "DIFFUSE"), 2 * 0.8, rtol=1e-6)
    assert len(of_kind(lobes, "DIFFUSE")) == 1


@pytest.mark.parametrize("bent", ["Diffuse", "Glossy"])
def test_what_shines_keeps_the_normal_of_its_shader(scene, bent):  # noqa: F811
    """Mixed with what is matt, one of them bumped."""
    shader = Shader(shader="ShaderNodeMixShader")
    for kind, name in (("Diffuse", "Shader"), ("Glossy", "Shader_001")):
        part = shader.node(f"ShaderNodeBsdf{kind}")
        part.inputs["Roughness"].default_value = 0.0 if kind == "Diffuse" else 0.5
        shader.link(part, 0, shader.shader, name)
        if kind == bent:
            shader.link(shader.node("ShaderNodeNormalMap"), 0, part, "Normal")
    result, lobes = shader.export()
    assert not result.notes
    assert all(lobe.normal_output >= 0 for lobe in of_kind(lobes, "SPECULAR"))
    (material,) = (m for m in result.scene.materials if m.lobes == lobes)
    assert (material.normal_output >= 0) == (bent == "Diffuse")
    assert material.bump_shadowing != "NONE"


def test_a_mirror_over_glass_keeps_their_common_normal(scene):  # noqa: F811
    """A Fresnel node that mixes an ideal mirror in."""
    shader = Shader(shader="ShaderNodeMixShader")
    bent = shader.node("ShaderNodeNormalMap")
    shader.link(shader.node("ShaderNodeFresnel"), 0, shader.shader, "Fac")
    for kind, name in (("Refraction", "Shader"), ("Glossy", "Shader_001")):
        part = shader.node(f"ShaderNodeBsdf{kind}")
        part.inputs["Roughness"].default_value = 0.0
        shader.link(bent, 0, part, "Normal")
        shader.link(part, 0, shader.shader, name)
    result, lobes = shader.export()
    assert not result.notes
    assert kinds(lobes) == {"MIRROR", "REFRACTION", "TRANSPARENT"}
    (material,) = (m for m in result.scene.materials if m.lobes == lobes)
    assert material.normal_output >= 0


def test_the_bounds_of_a_volume_are_not_seen(scene):  # noqa: F811
    """Fog round a whole scene has a volume and no surface."""
    shader = Shader()
    shader.link(shader.node("ShaderNodeVolumePrincipled"), 0, shader.output, "Volume")
    shader.tree.links.remove(shader.output.inputs["Surface"].links[0])
    result, lobes = shader.export()
    assert not result.notes
    assert [lobe.kind for lobe in lobes] == ["TRANSPARENT"]
    np.testing.assert_allclose(total(lobes, "TRANSPARENT"), 1)


@pytest.mark.parametrize(
    ("target", "is_drawn"), [("CYCLES", True), ("EEVEE", False), ("ALL", False)]
)
def test_an_output_of_cycles_comes_before_one_for_all(scene, target, is_drawn):  # noqa: F811
    """As in Cycles, whichever is active."""
    shader = Shader()
    other = shader.node("ShaderNodeOutputMaterial", target=target)
    shader.link(shader.node("ShaderNodeEmission"), 0, other, "Surface")
    shader.output.is_active_output = True
    assert ("EMISSION" in kinds(shader.export()[1])) == is_drawn


def test_no_output_is_black(scene):  # noqa: F811
    shader = Shader()
    shader.tree.nodes.remove(shader.output)
    result, lobes = shader.export()
    assert lobes == ()
    assert any("output" in note for note in result.notes)


def test_an_output_without_a_surface_is_black_and_told(scene):  # noqa: F811
    shader = Shader(shader=None)
    result, lobes = shader.export()
    assert lobes == ()
    assert any("without a surface" in note and "'Material'" in note for note in result.notes)


def test_a_group_without_an_output_is_black_and_told(scene):  # noqa: F811
    shader = Shader(shader=None)
    tree = bpy.data.node_groups.new("Hollow", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    group = shader.tree.nodes.new("ShaderNodeGroup")
    group.node_tree = tree
    shader.link(group, 0, shader.output, "Surface")
    result, lobes = shader.export()
    assert lobes == ()
    assert any("Groups without an output" in note for note in result.notes)


def test_a_colour_on_the_surface_glows(scene):  # noqa: F811
    shader = Shader(shader=None)
    rgb = shader.node("ShaderNodeRGB")
    rgb.outputs[0].default_value = RED
    shader.link(rgb, 0, shader.output, "Surface")
    np.testing.assert_allclose(total(shader.export()[1], "EMISSION"), RED[:3])


def test_the_output_for_all_engines_counts(scene):  # noqa: F811
    shader = Shader()
    set_inputs(shader.shader, Color=RED)
    eevee, black = (
        shader.node("ShaderNodeOutputMaterial", target="EEVEE"),
        shader.node("ShaderNodeEmission"),
    )
    shader.link(black, 0, eevee, "Surface")
    assert kinds(shader.export()[1]) == {"AMBIENT", "DIFFUSE"}


def test_no_material_is_blenders_default_grey(scene):  # noqa: F811
    quad()
    (material,) = export().scene.materials
    # seen in Cycles: 5.0 made the default surface a Principled BSDF
    layered = bpy.app.version >= (5, 0, 0)
    np.testing.assert_allclose(
        total(material.lobes, "DIFFUSE"), 0.8 * (1 - layer_share() if layered else 1), rtol=1e-6
    )
    assert bool(of_kind(material.lobes, "SPECULAR")) == layered


def test_empty_slots_are_the_default(scene):  # noqa: F811
    thing = quad("Quad", bpy.data.materials.new("Material"))
    thing.data.materials.append(None)
    thing.data.polygons[0].material_index = 1
    result = export()
    assert result.scene.materials[result.scene.instances[0].materials[1]].name == "default_surface"


@pytest.mark.skipif(
    bpy.app.version >= (5, 0, 0), reason="every material has nodes from Blender 5.0 on"
)
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
    set_inputs(value, X=np.nan, Y=0.5, Z=0.25)
    shader.link(value, 0, shader.shader, "Color")
    result, lobes = shader.export()
    np.testing.assert_allclose(total(lobes, "EMISSION"), (0, 0.5, 0.25))
    assert any("not finite count as 0 in 'Material'" in note for note in result.notes)


def test_material_index(scene):  # noqa: F811
    shader = Shader()
    shader.material.pass_index = 9
    assert shader.export()[0].scene.materials[0].index == 9
