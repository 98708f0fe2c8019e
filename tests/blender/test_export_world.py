"""Ambient light and background."""

import bpy
import numpy as np
import pytest

from export_support import export, image, scene, use_nodes  # noqa: F401
from glint.addon.export.shader_nodes import READERS
from glint.engine.evaluation import sky


@pytest.fixture
def world(scene):  # noqa: F811
    """(tree, background node) of the scene's world, linked to the output."""
    scene.world = bpy.data.worlds.new("World")
    use_nodes(scene.world)
    tree = scene.world.node_tree
    background = tree.nodes.new("ShaderNodeBackground")
    tree.links.new(background.outputs[0], tree.nodes.new("ShaderNodeOutputWorld").inputs["Surface"])
    return tree, background


@pytest.mark.parametrize(
    ("output", "is_told"),
    [("Is Camera Ray", False), ("Is Reflection Ray", False), ("Is Glossy Ray", True)],
)
def test_gloss_that_would_see_another_world_is_told(world, output, is_told):
    tree, background = world
    path = tree.nodes.new("ShaderNodeLightPath")
    tree.links.new(path.outputs[output], background.inputs["Strength"])
    background.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1)
    assert any("rough reflections" in note for note in export().notes) == is_told


@pytest.mark.parametrize("is_mixed", [False, True])
def test_light_by_window_coordinates_is_told(world, is_mixed):
    """And a picture behind the scene that lights nothing is not."""
    tree, background = world
    window = tree.nodes.new("ShaderNodeTexCoord").outputs["Window"]
    if is_mixed:
        path, mixed = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMixRGB")
        tree.links.new(path.outputs["Is Camera Ray"], mixed.inputs[0])
        tree.links.new(window, mixed.inputs[2])
        window = mixed.outputs[0]
    tree.links.new(window, background.inputs["Color"])
    assert any("window coordinates" in note for note in export().notes) != is_mixed


def test_no_world_is_black(scene):  # noqa: F811
    world = export().scene.world
    assert world.ambient == world.background == (0, 0, 0)
    assert not world.transparent


def test_background_times_strength(scene, world):  # noqa: F811
    world[1].inputs["Color"].default_value, world[1].inputs["Strength"].default_value = (
        (1, 0.5, 0.25, 1),
        2,
    )
    found = export().scene.world
    assert found.ambient == found.background == (2, 1, 0.5)


def test_a_view_layer_may_leave_the_sky_out(scene, world):  # noqa: F811
    world[1].inputs["Color"].default_value = (1, 1, 1, 1)
    bpy.context.view_layer.use_sky = False
    found = export().scene.world
    assert found.ambient == found.background == (0, 0, 0)


def test_film_transparent(scene):  # noqa: F811
    scene.render.film_transparent = True
    assert export().scene.world.transparent


def test_an_environment_image_is_seen_and_lights(scene, world):  # noqa: F811
    """The upper half white, the lower black: its mean is one half, as rows near the poles cover
    less sky; the light comes from above.
    """
    tree, background = world
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    rows = np.zeros((4, 8, 4), np.float32)
    rows[2:, :, :] = 1
    texture.image = image("Sky", rows.reshape(-1, 4), (8, 4), float_buffer=True)
    texture.interpolation = "Closest"
    tree.links.new(texture.outputs[0], background.inputs["Color"])
    result = export()
    assert result.notes == ()
    assert result.scene.textures == () and len(result.scene.world.textures) == 1
    np.testing.assert_allclose(result.scene.world.ambient, 0.5, rtol=1e-6)
    (light,) = result.scene.lights
    assert light.kind == "DOME" and light.name == "World"
    np.testing.assert_array_equal(light.radiance, rows[..., :3].repeat(32, 0).repeat(32, 1))


def test_a_black_world_lights_nothing(scene, world):  # noqa: F811
    world[1].inputs["Color"].default_value = (0, 0, 0, 1)
    assert export().scene.lights == ()


@pytest.mark.parametrize(
    ("off", "seen", "shines"),
    [
        (("camera",), (0.0, 0.75, 0.75), True),
        (("glossy", "transmission"), (0.75, 0.0, 0.0), True),
        (("camera", "glossy", "transmission"), (0.0, 0.0, 0.0), True),
        (("camera", "transmission"), (0.0, 0.75, 0.0), True),
        (("diffuse", "glossy"), (0.75, 0.0, 0.75), True),
        (("diffuse", "glossy", "scatter"), (0.75, 0.0, 0.75), False),
    ],
)
def test_cycles_visibility_counts(scene, world, off, seen, shines):  # noqa: F811
    world[1].inputs["Color"].default_value = (0.75, 0.75, 0.75, 1)
    for name in off:
        setattr(scene.world.cycles_visibility, name, False)
    found = export().scene
    if found.world.program is None:
        assert found.world.background == (seen[0],) * 3 and len(set(seen)) == 1
    else:
        along, bounces = np.array([[0.0], [0.0], [1.0]]), ((0, 0, 0, 0), (1, 0, 0, 0), (1, 0, 1, 1))
        for kind, bounce, value in zip(("camera", "mirror", "mirror"), bounces, seen, strict=True):
            past = np.array(bounce, float)[:, None]
            radiance = sky.radiance(found.world.program, (), along, kind, past=past)
            np.testing.assert_allclose(radiance, value, rtol=1e-6)
    assert any(light.kind == "DOME" for light in found.lights) == shines
    for light in found.lights:
        lit = light.lights_matt, light.lights_gloss, light.lights_media
        assert lit == tuple(name not in off for name in ("diffuse", "glossy", "scatter"))
    assert (found.world.ambient == (0.0, 0.0, 0.0)) == ("diffuse" in off)


def test_what_is_not_understood_is_the_default(scene, world):  # noqa: F811
    tree, background = world
    background.inputs["Color"].default_value = (0.25, 0.5, 1, 1)
    unknown = tree.nodes.new("ShaderNodeShaderToRGB")
    tree.links.new(unknown.outputs[0], background.inputs["Color"])
    result = export()
    assert result.scene.world.background == (0.25, 0.5, 1)
    assert any("Shader to RGB" in note and "'World'" in note for note in result.notes)


def test_values_that_are_not_finite_are_black(scene, world):  # noqa: F811
    world[1].inputs["Color"].default_value = (np.nan, 0.5, np.nan, 1)
    assert export().scene.world.background == (0, 0.5, 0)


@pytest.mark.parametrize("kind", sorted(k for k in READERS if hasattr(bpy.types, k)))
def test_a_world_of_any_node_renders(scene, world, kind):  # noqa: F811
    """Whatever a node means where there is no surface: `export` finds the scene sound."""
    tree, background = world
    node = tree.nodes.new(kind)
    for socket in node.outputs:
        if socket.type not in ("VALUE", "RGBA", "VECTOR") or not socket.enabled:
            continue
        tree.links.new(socket, background.inputs["Color"])
        export()
