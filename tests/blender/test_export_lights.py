"""Lights: every field, and strengths that Cycles confirms."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

from export_support import export, link, quad, scene, use_nodes  # noqa: F401
from glint.addon.export.shader_nodes import READERS
from glint.engine.analysis.fingerprint import value_fingerprint

NORMALIZE = "normalize" in bpy.types.Light.bl_rna.properties


def _light(kind: str, **settings):
    data = bpy.data.lights.new(kind, kind)
    for name, value in settings.items():
        setattr(data, name, value)
    return link(bpy.data.objects.new(kind, data))


def _only_light():
    (light,) = export().scene.lights
    return light


def test_the_frame_has_no_scale_and_shines_along_minus_z(scene):  # noqa: F811
    turn = Euler((1, 2, 3)).to_matrix()
    _light("SPOT").matrix_world = Matrix.LocRotScale((1, 2, 3), turn, Vector((2, 2, 2)))
    frame = _only_light().world_from_light
    np.testing.assert_allclose(frame[:, :3], np.array(turn), atol=1e-6)
    np.testing.assert_allclose(frame[:, 3], (1, 2, 3))


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -2, 1), (1, 1, -1)])
def test_a_mirrored_light_keeps_its_direction_and_is_right_handed(scene, scale):  # noqa: F811
    _light("AREA").matrix_world = Matrix.LocRotScale(
        (0, 0, 0), Euler((1, 2, 3)).to_matrix(), Vector(scale)
    )
    bpy.context.view_layer.update()
    frame = _only_light().world_from_light
    z = np.array(bpy.data.objects["AREA"].matrix_world)[:3, 2]
    np.testing.assert_allclose(frame[:, 2], z / np.linalg.norm(z), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(frame[:, :3]), 1, atol=1e-6)


def test_point(scene):  # noqa: F811
    _light("POINT", energy=12, shadow_soft_size=0.5, color=(1, 0.5, 0.25)).scale = (3, 3, 3)
    light = _only_light()
    assert (light.kind, light.strength, light.radius, light.color) == (
        "POINT",
        12,
        0.5,
        (1, 0.5, 0.25),
    )


def test_sun(scene):  # noqa: F811
    _light("SUN", energy=3, angle=0.25)
    light = _only_light()
    assert (light.kind, light.strength, light.angle) == ("SUN", 3, 0.25)


def test_spot(scene):  # noqa: F811
    _light("SPOT", spot_size=0.5, spot_blend=0.25, shadow_soft_size=0.125)
    light = _only_light()
    assert (light.kind, light.spot_size, light.spot_blend, light.radius) == (
        "SPOT",
        0.5,
        0.25,
        0.125,
    )


@pytest.mark.parametrize(
    ("scale", "tangent", "noted"),
    [((3, 3, 3), 1, False), ((-2, 2, 4), 0.5, False), ((4, 1, 1), 2, True)],
)
def test_a_spots_cone_is_scaled_with_its_object(scene, scale, tangent, noted):  # noqa: F811
    """By what Cycles does along each axis; a round cone stands for an oval one, with a note."""
    _light("SPOT", spot_size=0.5).scale = scale
    result = export()
    (light,) = result.scene.lights
    np.testing.assert_allclose(np.tan(light.spot_size / 2), tangent * np.tan(0.25), rtol=1e-6)
    assert [note for note in result.notes if "round" in note and "'SPOT'" in note] == list(
        result.notes
    )
    assert bool(result.notes) == noted


def test_the_widest_cone_stays_as_wide_in_any_scale(scene):  # noqa: F811
    """Blender's 180 degrees are in float32, a little more than pi: its tangent is negative."""
    _light("SPOT", spot_size=np.pi).scale = (1, 2, 0.5)
    np.testing.assert_allclose(export().scene.lights[0].spot_size, np.pi, rtol=1e-6)


SHAPES = {
    "SQUARE": ("RECTANGLE", 4, 6),
    "RECTANGLE": ("RECTANGLE", 4, 15),
    "DISK": ("ELLIPSE", 4, 6),
    "ELLIPSE": ("ELLIPSE", 4, 15),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_area_sizes_are_scaled_by_the_object(scene, shape):  # noqa: F811
    _light("AREA", shape=shape, size=2, size_y=5).scale = (2, 3, 7)
    light = _only_light()
    np.testing.assert_allclose((light.size_x, light.size_y), SHAPES[shape][1:], rtol=1e-6)
    assert (light.kind, light.shape) == ("AREA", SHAPES[shape][0])


@pytest.mark.parametrize(("turn", "is_told"), [(0.7, True), (0.0, False)])
def test_a_sheared_area_is_told(scene, turn, is_told):  # noqa: F811
    thing = link(bpy.data.objects.new("Panel", bpy.data.lights.new("Panel", "AREA")))
    thing.rotation_euler = (0, 0, turn)
    thing.parent = link(bpy.data.objects.new("Parent", None))
    thing.parent.scale = (2, 0.5, 1)
    told = [note.names for note in export().notes if "shears" in note]
    assert told == ([("Panel",)] if is_told else [])


def test_flags(scene):  # noqa: F811
    thing = _light("POINT", use_shadow=False)
    light = _only_light()
    assert (light.cast_shadow, light.visible_camera, light.visible_mirror) == (False, False, True)
    thing.visible_camera, thing.visible_glossy = True, False
    light = _only_light()
    assert (light.visible_camera, light.visible_mirror) == (True, False)
    assert light.visible_transmission
    thing.visible_glossy, thing.visible_transmission = True, False
    light = _only_light()
    assert (light.visible_mirror, light.visible_transmission) == (True, False)


def test_what_lights_light_by_their_ray_visibility(scene):  # noqa: F811
    thing = _light("POINT")
    names = "visible_diffuse", "visible_glossy", "visible_volume_scatter"

    def lit():
        light = _only_light()
        return light.lights_matt, light.lights_gloss, light.lights_media

    assert lit() == (True, True, True)
    for k, name in enumerate(names):
        setattr(thing, name, False)
        assert lit() == tuple(other != k for other in range(3))
        setattr(thing, name, True)


@pytest.mark.skipif(
    "use_soft_falloff" not in bpy.types.PointLight.bl_rna.properties,
    reason="this Blender has no soft falloff",
)
def test_soft_falloff(scene):  # noqa: F811
    thing = _light("POINT", use_soft_falloff=True)
    assert _only_light().soft_falloff
    thing.data.use_soft_falloff = False
    assert not _only_light().soft_falloff


@pytest.mark.skipif(
    "exposure" not in bpy.types.Light.bl_rna.properties,
    reason="this Blender's lights have no exposure",
)
def test_exposure_and_temperature(scene):  # noqa: F811
    thing = _light(
        "SUN", energy=3, exposure=2, color=(1, 0.5, 1), use_temperature=True, temperature=4000
    )
    light = _only_light()
    assert light.strength == 12
    np.testing.assert_allclose(light.color, np.array(thing.data.temperature_color) * (1, 0.5, 1))
    assert light.color[0] > 2 * light.color[2]


def test_instanced_lights(scene):  # noqa: F811
    collection = bpy.data.collections.new("Lamps")
    lamp = _light("POINT")
    scene.collection.objects.unlink(lamp)
    collection.objects.link(lamp)
    for x in (1, 2, 3):
        empty = link(bpy.data.objects.new("Empty", None))
        empty.instance_type, empty.instance_collection, empty.location = (
            "COLLECTION",
            collection,
            (x, 0, 0),
        )
    assert sorted(light.world_from_light[0, 3] for light in export().scene.lights) == [1, 2, 3]


def test_constant_nodes_multiply(scene):  # noqa: F811
    thing = _light("SUN")
    use_nodes(thing.data)
    tree = thing.data.node_tree
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value, emission.inputs["Strength"].default_value = (
        (1, 0.5, 0.25, 1),
        4,
    )
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputLight").inputs["Surface"])
    assert _only_light().color == (4, 2, 1)


def test_nodes_that_vary_are_a_program(scene):  # noqa: F811
    """With textures of its own, whatever else the scene has."""
    thing = _light("AREA", color=(0.5, 1, 1))
    thing.data.use_nodes = True
    tree = thing.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new("slide", 4, 4)
    tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
    result = export()
    light = result.scene.lights[0]
    assert light.color == (0.5, 1, 1) and len(light.program.outputs) == 1
    assert [texture.name for texture in light.textures] == ["slide"]
    assert light.program.textures == (0,) and result.scene.textures == ()
    assert not result.notes


def test_a_luminaire_that_cannot_be_read_is_told(scene):  # noqa: F811
    thing = _light("POINT")
    thing.data.use_nodes = True
    tree = thing.data.node_tree
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    texture = tree.nodes.new("ShaderNodeTexIES")
    texture.ies = bpy.data.texts.new("lumen.ies")
    texture.ies.write("IESNA:LM-63-2002\nTILT=NONE\n1 1000")
    tree.links.new(texture.outputs[0], emission.inputs["Strength"])
    result = export()
    assert result.scene.lights[0].program is None
    assert any("lumen.ies" in note and "POINT" in note for note in result.notes)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_power_that_is_not_finite_is_dropped_and_named(scene, bad):  # noqa: F811
    _light("SUN")
    _light("POINT", energy=bad)
    result = export()
    assert [light.kind for light in result.scene.lights] == ["SUN"]
    assert any("'POINT'" in note for note in result.notes)


def test_a_colour_channel_that_is_not_finite_is_black(scene):  # noqa: F811
    _light("SUN", color=(1, np.nan, 0.5))
    result = export()
    assert result.scene.lights[0].color == (1, 0, 0.5)
    assert any("'SUN'" in note for note in result.notes)


def test_odd_powers_are_kept(scene):  # noqa: F811
    _light("SUN", energy=-2)
    _light("POINT", energy=3e38)
    assert [light.strength for light in export().scene.lights] == [-2, np.float32(3e38)]


@pytest.mark.parametrize(
    ("settings", "said"),
    [({"energy": 0}, True), ({"color": (0, 0, 0)}, True), ({"energy": 1e-3}, False)],
    ids=str,
)
def test_a_light_that_sheds_none_is_named(scene, settings, said):  # noqa: F811
    quad()
    _light("POINT", **settings)
    assert any("shed no light ('POINT')" in note for note in export().notes) == said


def test_a_flattened_light_is_named_but_a_point_shines(scene):  # noqa: F811
    _light("POINT").scale = (0, 0, 0)
    assert len(export().scene.lights) == 1
    _light("AREA").scale = (1, 0, 1)
    result = export()
    assert [light.kind for light in result.scene.lights] == ["POINT"]
    assert any("'AREA'" in note for note in result.notes)


@pytest.mark.parametrize(
    ("shape", "size", "size_y", "said"),
    [
        ("SQUARE", 0.0, 1.0, True),
        ("DISK", 0.0, 1.0, True),
        ("RECTANGLE", 1.0, 0.0, True),
        ("ELLIPSE", 0.0, 1.0, True),
        ("SQUARE", 1.0, 0.0, False),
        ("RECTANGLE", 1.0, 1e-6, False),
    ],
)
def test_an_area_of_no_size_shines_and_is_told(scene, shape, size, size_y, said):  # noqa: F811
    """Cycles draws none of its light."""
    _light("AREA", shape=shape, size=size, size_y=size_y)
    result = export()
    assert result.scene.lights[0].strength > 0
    assert any("without a size ('AREA')" in note for note in result.notes) == said


def test_portals_are_no_lights(scene):  # noqa: F811
    _light("AREA").data.cycles.is_portal = True
    assert export().scene.lights == ()


def test_portals_are_openings_of_the_sky(scene):  # noqa: F811
    """Each that has an area, towards where it does not shine."""
    scene.world = bpy.data.worlds.new("Sky")
    for size, x in ((2.0, 1.0), (1.0, 5.0), (0.0, 9.0)):
        thing = _light("AREA", shape="RECTANGLE", size=size, size_y=0.5)
        thing.data.cycles.is_portal = True
        thing.location = (x, 2.0, 3.0)
    (sky,) = export().scene.lights
    found = sky.openings
    np.testing.assert_allclose(found.centers, [(1, 2, 3), (5, 2, 3)])
    np.testing.assert_allclose(found.shares, (2 / 3, 1 / 3))
    np.testing.assert_allclose(np.linalg.norm(found.right, axis=1), (1.0, 0.5))
    np.testing.assert_allclose(np.linalg.norm(found.up, axis=1), 0.25)
    np.testing.assert_allclose(np.cross(found.right[0], found.up[0]) / 0.25, found.normals[0])


def test_spread(scene):  # noqa: F811
    thing = _light("AREA")
    assert export().scene.lights[0].spread == pytest.approx(math.pi)
    thing.data.spread = 1
    exported = export()
    assert exported.scene.lights[0].spread == 1
    assert exported.notes == ()


UNNORMALIZED = {
    "POINT": ({"shadow_soft_size": 0.5, "use_soft_falloff": False}, 4 * np.pi * 0.25),
    "SPOT": (
        {"shadow_soft_size": 0.5, "use_soft_falloff": False, "spot_size": 2},
        4 * np.pi * 0.25,
    ),
    "AREA": ({"shape": "ELLIPSE", "size": 0.5, "size_y": 0.25}, np.pi / 4 * 0.5 * 0.25 * 4),
    "SUN": ({"angle": 0.5}, np.pi * np.sin(0.25) ** 2),
}


@pytest.mark.skipif(not NORMALIZE, reason="this Blender's lights are always normalised")
@pytest.mark.parametrize("kind", UNNORMALIZED)
def test_a_light_that_is_not_normalised_equals_one_that_is_in_cycles(scene, kind, tmp_path):  # noqa: F811
    """The exported strength, given to a normalised light, renders the same picture in Cycles."""
    settings, area = UNNORMALIZED[kind]
    thing = _light(kind, energy=3, normalize=False, **settings)
    thing.location, thing.scale = (0, 0, 3), (2, 2, 2)
    strength = _only_light().strength
    np.testing.assert_allclose(strength, 3 * area, rtol=1e-6)
    bpy.ops.mesh.primitive_plane_add(size=10)
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 8), (0, 0, 0)
    without = _cycles_mean(scene, tmp_path / "a.exr")
    thing.data.normalize, thing.data.energy = True, strength
    np.testing.assert_allclose(without, _cycles_mean(scene, tmp_path / "b.exr"), rtol=1e-5)


def _cycles_mean(scene, path) -> float:  # noqa: F811
    """Cycles draws the same samples both times, so that its noise does not matter."""
    render = scene.render
    (
        render.engine,
        scene.cycles.samples,
        scene.cycles.use_denoising,
        scene.cycles.use_adaptive_sampling,
    ) = "CYCLES", 4, False, False
    render.resolution_x = render.resolution_y = 16
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(str(path))
    values = np.empty(len(picture.pixels), np.float32)
    picture.pixels.foreach_get(values)
    assert values.max() > 0
    return float(values.reshape(-1, 4)[:, :3].mean())


@pytest.mark.parametrize("kind", sorted(k for k in READERS if hasattr(bpy.types, k)))
@pytest.mark.parametrize("lamp", ["POINT", "SUN", "SPOT", "AREA"])
def test_a_light_of_any_node_renders(scene, lamp, kind):  # noqa: F811
    """Whatever a node means on a light: `export` finds the scene sound."""
    thing = _light(lamp)
    use_nodes(thing.data)
    tree = thing.data.node_tree
    emission, node = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new(kind)
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputLight").inputs["Surface"])
    for socket in node.outputs:
        if socket.type in ("VALUE", "RGBA", "VECTOR") and socket.enabled:
            tree.links.new(socket, emission.inputs["Color"])
            export()


def test_a_bent_normal_is_turned_with_each_light(scene):  # noqa: F811
    data = bpy.data.lights.new("Light", "POINT")
    use_nodes(data)
    tree = data.node_tree
    bent, shown, end = (
        tree.nodes.new(f"ShaderNode{name}") for name in ("NormalMap", "Emission", "OutputLight")
    )
    bent.space = "OBJECT"
    bent.inputs["Color"].default_value = (0.9, 0.3, 0.6, 1.0)
    tree.links.new(bent.outputs[0], shown.inputs["Color"])
    tree.links.new(shown.outputs[0], end.inputs["Surface"])
    for turn in (0.0, 1.0):
        link(bpy.data.objects.new("Light", data)).rotation_euler = (turn, 0.0, 0.0)
    one, other = export().scene.lights
    assert one.program is not None and value_fingerprint(one.program) != value_fingerprint(
        other.program
    )


def test_no_thread_of_the_linear_algebra_library_wakes(scene, monkeypatch):  # noqa: F811
    """NumPy's inverse does that, even of 3 rows, and the thread spins beside the tracer."""

    def refused(*_):
        raise AssertionError("NumPy was asked for an inverse")

    for name in ("inv", "solve"):
        monkeypatch.setattr(np.linalg, name, refused)
    for kind in ("POINT", "SUN", "SPOT", "AREA"):
        _light(kind).scale = (1.0, 2.0, 3.0)
    assert len(export().scene.lights) == 4
