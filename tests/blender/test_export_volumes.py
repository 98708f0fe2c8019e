"""Volume shaders become media: per unit of length, as in Cycles."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from export_support import Shader, export, mesh_object, scene, use_nodes  # noqa: F401
from glint.engine.scene.problems import scene_problems


def medium(kind: str, **inputs):
    """(notes, medium) of a material with this volume shader."""
    shader = Shader()
    node = shader.node(kind)
    for name, value in inputs.items():
        if name == "phase":
            node.phase = value
        else:
            node.inputs[name.replace("_", " ")].default_value = value
    shader.link(node, 0, shader.output, "Volume")
    result, _ = shader.export()
    (found,) = (m.medium for m in result.scene.materials if m.medium)
    return result.notes, found


@pytest.mark.parametrize("how", ["nothing", "muted", "reroute"])
def test_what_has_but_a_volume_is_clear(scene, how):  # noqa: F811
    """Nothing is linked to its surface, or what is linked brings nothing."""
    shader = Shader()
    shader.link(shader.node("ShaderNodeVolumeScatter"), 0, shader.output, "Volume")
    (surface,) = shader.output.inputs["Surface"].links
    if how == "muted":
        surface.is_muted = True
    else:
        shader.tree.links.remove(surface)
    if how == "reroute":
        shader.link(shader.node("NodeReroute"), 0, shader.output, "Surface")
    result, lobes = shader.export()
    assert not result.notes and [lobe.kind for lobe in lobes] == ["TRANSPARENT"]


def test_absorption(scene):  # noqa: F811
    notes, found = medium("ShaderNodeVolumeAbsorption", Color=(0.9, 0.5, 0.2, 1), Density=2.0)
    assert not notes and found.scattering == found.emission == (0, 0, 0)
    np.testing.assert_allclose(found.absorption, (0.2, 1.0, 1.6), rtol=1e-6)


def test_scatter(scene):  # noqa: F811
    notes, found = medium(
        "ShaderNodeVolumeScatter", Color=(0.9, 0.5, 0.2, 1), Density=2.0, Anisotropy=0.5
    )
    assert not notes and found.absorption == (0, 0, 0) and found.anisotropy == 0.5
    np.testing.assert_allclose(found.scattering, (1.8, 1.0, 0.4), rtol=1e-6)


def test_principled(scene):  # noqa: F811
    """It absorbs (1 - color) (1 - sqrt(absorption color))."""
    notes, found = medium(
        "ShaderNodeVolumePrincipled",
        Color=(0.5, 0.25, 1.0, 1),
        Absorption_Color=(0.25, 0.0, 0.0, 1),
        Density=2.0,
        Emission_Strength=3.0,
        Emission_Color=(1.0, 0.5, 0.0, 1),
    )
    assert not notes
    np.testing.assert_allclose(found.scattering, (1.0, 0.5, 2.0), rtol=1e-6)
    np.testing.assert_allclose(found.absorption, (0.5, 1.5, 0.0), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.emission, (3.0, 1.5, 0.0), rtol=1e-6)


def test_a_black_body(scene):  # noqa: F811
    """Stefan and Boltzmann's law, in millionths and over π as in Cycles."""
    _, found = medium("ShaderNodeVolumePrincipled", Blackbody_Intensity=1.0, Temperature=1500.0)
    assert found.emission[0] > found.emission[1] > 0
    np.testing.assert_allclose(
        np.dot(found.emission, (0.2126, 0.7152, 0.0722)), 5.670373e-14 / np.pi * 1500**4, rtol=0.02
    )


@pytest.mark.skipif(bpy.app.version < (4, 3), reason="the first Blender with phase functions")
@pytest.mark.parametrize("phase", ["RAYLEIGH", "DRAINE", "FOURNIER_FORAND", "MIE"])
def test_phase_functions_are_told(scene, phase):  # noqa: F811
    (note,), found = medium("ShaderNodeVolumeScatter", phase=phase)
    assert "Henyey-Greenstein" in note
    assert (found.anisotropy == 0) == (phase in ("RAYLEIGH", "DRAINE"))


def test_mixes_and_sums(scene):  # noqa: F811
    shader = Shader()
    mix, add = shader.node("ShaderNodeMixShader"), shader.node("ShaderNodeAddShader")
    absorption, scatter = (
        shader.node(f"ShaderNodeVolume{kind}") for kind in ("Absorption", "Scatter")
    )
    glow = shader.node("ShaderNodeEmission")
    mix.inputs[0].default_value = 0.25
    glow.inputs["Strength"].default_value = 2.0
    absorption.inputs["Color"].default_value = (0, 0, 0, 1)
    scatter.inputs["Color"].default_value = (1, 1, 1, 1)
    shader.tree.links.new(absorption.outputs[0], mix.inputs[1])
    shader.tree.links.new(scatter.outputs[0], mix.inputs[2])
    shader.tree.links.new(mix.outputs[0], add.inputs[0])
    shader.tree.links.new(glow.outputs[0], add.inputs[1])
    shader.link(add, 0, shader.output, "Volume")
    result, _ = shader.export()
    (found,) = (m.medium for m in result.scene.materials if m.medium)
    np.testing.assert_allclose(found.absorption, [0.75] * 3)
    np.testing.assert_allclose(found.scattering, [0.25] * 3)
    np.testing.assert_allclose(found.emission, [2.0] * 3)


def test_strange_numbers(scene):  # noqa: F811
    _, found = medium("ShaderNodeVolumeAbsorption", Color=(3.0, 0, 0, 1), Density=1e38)
    assert found.absorption == (0, 1e30, 1e30)


def varied(kind: str, socket: str, source: str = "ShaderNodeTexNoise", output=0, **inputs):
    """(notes, medium) of a material whose volume has an input that a node feeds."""
    shader = Shader()
    node, feeding = shader.node(kind), shader.node(source)
    for name, value in inputs.items():
        node.inputs[name.replace("_", " ")].default_value = value
    shader.tree.links.new(feeding.outputs[output], node.inputs[socket])
    shader.link(node, 0, shader.output, "Volume")
    result, _ = shader.export()
    assert not scene_problems(result.scene)
    (found,) = (m.medium for m in result.scene.materials if m.name == shader.material.name)
    return result, found


def outputs_of(found) -> set[str]:
    """What its program makes."""
    names = ("absorption", "scattering", "emission", "anisotropy")
    return {name for name in names if getattr(found, f"{name}_output") >= 0}


def test_what_varies_is_a_program(scene):  # noqa: F811
    result, found = varied("ShaderNodeVolumeScatter", "Density", Anisotropy=0.25)
    assert not result.notes and outputs_of(found) == {"scattering"}
    assert found.anisotropy == 0.25 and found.step == 1 / 32
    _, found = varied("ShaderNodeVolumeScatter", "Anisotropy")
    assert outputs_of(found) == {"anisotropy"} and any(found.scattering)
    _, found = varied("ShaderNodeVolumePrincipled", "Emission Strength")
    assert outputs_of(found) == {"emission"} and any(found.scattering)
    _, found = varied("ShaderNodeVolumePrincipled", "Temperature", Blackbody_Intensity=1.0)
    assert outputs_of(found) == {"emission"}
    _, found = varied("ShaderNodeVolumePrincipled", "Absorption Color")
    assert outputs_of(found) == {"absorption"}
    _, found = varied("ShaderNodeVolumePrincipled", "Color")
    assert outputs_of(found) == {"absorption", "scattering"}


def test_generated_coordinates_are_of_the_texture_space(scene):  # noqa: F811
    """Noise without a vector reads them: they come with the placement, meshes have none inside."""
    result, _ = varied("ShaderNodeVolumeAbsorption", "Density")
    (block,) = (b for b in result.scene.instances if b.values)
    assert {name: tuple(rows[0]) for name, rows in block.values.items()} == {
        "(texture space scale)": (0.5, 0.5, 0.5, 0.0),
        "(texture space start)": (0.5, 0.5, 0.5, 0.0),
    }


def test_what_meshes_have_is_0_inside(scene):  # noqa: F811
    result, found = varied("ShaderNodeVolumeAbsorption", "Density", "ShaderNodeUVMap")
    assert "UV map" in result.notes[0] and found is None


def test_the_step_is_the_material_s_and_the_scene_s(scene):  # noqa: F811
    shader = Shader()
    node, noise = shader.node("ShaderNodeVolumeScatter"), shader.node("ShaderNodeTexNoise")
    shader.tree.links.new(noise.outputs[0], node.inputs["Density"])
    shader.link(node, 0, shader.output, "Volume")
    shader.material.cycles.volume_step_rate = 2.0
    bpy.context.scene.cycles.volume_step_rate = 0.25
    (found,) = (m.medium for m in shader.export()[0].scene.materials if m.medium)
    assert found.step == 1 / 64


def test_on_a_surface_it_shows_nothing(scene):  # noqa: F811
    shader = Shader()
    shader.link(shader.node("ShaderNodeVolumeScatter"), 0, shader.output, "Surface")
    result, lobes = shader.export()
    assert not lobes and "link those" in result.notes[0]


def test_the_world(scene):  # noqa: F811
    world = bpy.data.worlds.new("hazy")
    bpy.context.scene.world = world
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeVolumeScatter")
    output = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    found = export().scene.world.medium
    np.testing.assert_allclose(found.scattering, [0.8] * 3)
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs[0], node.inputs["Density"])
    world.cycles.volume_step_size = 3.0
    world.update_tag()
    result = export()
    assert result.scene.world.medium.scattering_output == 0 and not scene_problems(result.scene)
    assert result.scene.world.medium.step == 3.0


def foggy(name: str, density: float) -> bpy.types.Material:
    """A material of nothing but Volume Absorption."""
    material = bpy.data.materials.new(name)
    use_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    node = tree.nodes.new("ShaderNodeVolumeAbsorption")
    node.inputs["Density"].default_value = density
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    return material


@pytest.mark.parametrize(("densities", "told"), [((1.0, 2.0), True), ((1.0, 1.0), False)])
def test_several_in_one_object_are_told(scene, densities, told):  # noqa: F811
    media = (foggy(f"fog {k}", density) for k, density in enumerate(densities))
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)]
    thing = mesh_object("Twofold", corners, [(0, 1, 2, 3), (0, 1, 4)], *media)
    thing.data.polygons[1].material_index = 1
    notes = [note for note in export().notes if "Several volumes" in note]
    assert len(notes) == told and all("'Twofold'" in note for note in notes)
