"""Hair curves and particle hair as the export hands them to the engine: the keys that Cycles takes,
smooth to a stated error, with what nodes read of them.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from export_support import Shader, export, link, scene, use_nodes  # noqa: F401
from following import Follower
from glint.addon.export.geometry.hashing import random_of
from glint.addon.export.geometry.splines import NEAR, Keys, cut
from glint.addon.export.geometry.strand_attributes import fibre_values
from glint.engine import Settings, render
from glint.engine.reference.closures.fibre import fibre_highlight
from glint.engine.scene import Strands
from test_fibres import seen_share, sphere


def curves(name: str, strands, radii=None):
    """A Curves object with these keys, (n, 3) each."""
    data = bpy.data.hair_curves.new(name)
    data.add_curves([len(keys) for keys in strands])
    positions = np.concatenate(strands).astype(np.float32)
    data.attributes["position"].data.foreach_set("vector", positions.ravel())
    if radii is not None:
        data.attributes.new("radius", "FLOAT", "POINT")
        data.attributes["radius"].data.foreach_set("value", np.float32(radii).ravel())
    return link(bpy.data.objects.new(name, data))


def furry(count=7, children="NONE", **settings):
    """A plane with particle hair."""
    bpy.ops.mesh.primitive_plane_add()
    emitter = bpy.context.object
    emitter.modifiers.new("Hair", "PARTICLE_SYSTEM")
    hair = emitter.particle_systems[0].settings
    hair.type, hair.count, hair.child_type, hair.render_type = "HAIR", count, children, "PATH"
    for name, value in settings.items():
        setattr(hair, name, value)
    return emitter


def strands_of(result) -> list[Strands]:
    return [g for g in result.scene.geometries if isinstance(g, Strands)]


def catmull_rom(keys, t):
    """(m, 4) of the pair of keys 1 and 2 of four, by the textbook's matrix."""
    basis = np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2
    return np.stack([t**0, t, t**2, t**3], 1) @ basis @ keys


def test_straight_curves_are_their_keys(scene):  # noqa: F811
    line = np.linspace([0, 0, 0], [0, 0, 3], 4)
    thing = curves("Fur", [line, line[:2] + 5], np.linspace(0.4, 0.1, 6))
    thing.location = (1, 2, 3)
    result = export()
    (found,) = strands_of(result)
    np.testing.assert_allclose(found.vertices, np.concatenate([line, line[:2] + 5]), atol=1e-6)
    assert found.starts.tolist() == [0, 1, 2, 4]
    np.testing.assert_allclose(found.radii[[0, 3, 4, 5]], [0.4, 0.22, 0.16, 0.1], atol=1e-6)
    (block,) = result.scene.instances
    np.testing.assert_allclose(block.world_from_object[0, :, 3], [1, 2, 3])
    assert result.stats["segments"] == 4


def test_curves_stay_near_their_spline(scene):  # noqa: F811
    """Every vertex on it, every segment within the stated share of the radius."""
    turn = np.linspace(0, 4, 8)
    keys = np.stack([np.cos(turn), np.sin(turn), 0.2 * turn], 1)
    radii = np.linspace(0.05, 0.02, 8)
    curves("Fur", [keys], radii)
    (found,) = strands_of(export())
    assert len(found.starts) > 14
    padded = np.column_stack([keys, radii])[[0, *range(8), 7]]
    t = np.linspace(0, 1, 400)
    spline = np.concatenate([catmull_rom(padded[k : k + 4], t) for k in range(7)])
    ends = np.column_stack([found.vertices, found.radii])
    apart = np.linalg.norm(ends[:, None] - spline, axis=2).min(1)
    assert apart.max() < 1e-3 * radii.min() + np.linalg.norm(np.diff(spline, axis=0), axis=1).max()
    a, d = found.vertices[found.starts], np.diff(found.vertices, axis=0)[found.starts]
    along = np.clip(
        ((spline[:, None, :3] - a) * d).sum(2) / (d * d).sum(1), 0, 1
    )  # of each point on each segment
    off = np.linalg.norm(spline[:, None, :3] - a - along[..., None] * d, axis=2).min(1)
    assert off.max() <= NEAR * 0.05
    assert off.max() > 0.05 * NEAR * 0.02  # it is not cut finer than it says


def test_linear_curves_are_not_bent(scene):  # noqa: F811
    if not hasattr(scene, "cycles_curves"):
        pytest.skip("this Blender is without Cycles")
    curves("Fur", [[[0, 0, 0], [1, 0, 0], [1, 1, 0]]])
    kinds = scene.cycles_curves.bl_rna.properties["shape"].enum_items.keys()
    if "THICK_LINEAR" not in kinds:
        assert len(strands_of(export())[0].starts) > 2
        return
    scene.cycles_curves.shape = "THICK_LINEAR"
    assert len(strands_of(export())[0].starts) == 2


def test_nothing_where_there_is_no_length(scene):  # noqa: F811
    curves("Dots", [[[1, 1, 1]] * 3, [[0, 0, 0]]])
    link(bpy.data.objects.new("Empty", bpy.data.hair_curves.new("Empty")))
    result = export()
    assert not strands_of(result) and result.notes == ()


def test_broken_keys_leave_out_their_neighbourhood_alone(scene):  # noqa: F811
    keys = np.linspace([0, 0, 0], [0, 0, 9], 10)
    keys[4, 0] = np.nan
    curves("Fur", [keys])
    (found,) = strands_of(export())
    good = np.isfinite(found.vertices).all(1)
    good = good[found.starts] & good[found.starts + 1]
    assert good.sum() == 7


def test_particle_hair_is_where_blender_has_it(scene):  # noqa: F811
    emitter = furry(7, root_radius=1.0, tip_radius=0.2, radius_scale=0.1, use_close_tip=False)
    emitter.location, emitter.scale = (0, 0, 2), (2, 2, 2)
    (found,) = strands_of(export())
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = emitter.evaluated_get(depsgraph)
    system = evaluated.particle_systems[0]
    steps = 2**system.settings.display_step + 1
    root = np.array(system.co_hair(evaluated, particle_no=0, step=0))
    tip = np.array(system.co_hair(evaluated, particle_no=6, step=steps - 1))
    np.testing.assert_allclose(found.vertices[0], (root - (0, 0, 2)) / 2, atol=1e-6)
    np.testing.assert_allclose(found.vertices[-1], (tip - (0, 0, 2)) / 2, atol=1e-6)
    np.testing.assert_allclose(found.radii[[0, -1]], [0.05, 0.01], rtol=1e-5)


def test_children_take_the_place_of_their_parents(scene):  # noqa: F811
    for children, count in (("NONE", 5), ("INTERPOLATED", 20)):
        emitter = furry(5, children)
        settings = emitter.particle_systems[0].settings
        settings.child_percent = settings.rendered_child_count = 4
        (found,) = strands_of(export())
        roots = np.setdiff1d(found.starts, found.starts + 1)
        assert len(roots) == count
        bpy.data.objects.remove(emitter)


def test_hidden_emitters_and_layers_without_strands(scene):  # noqa: F811
    emitter = furry()
    emitter.show_instancer_for_viewport = emitter.show_instancer_for_render = False
    result = export()
    assert [type(g) for g in result.scene.geometries] == [Strands]
    bpy.context.view_layer.use_strand = False
    assert not strands_of(export())


def test_each_system_has_its_material(scene):  # noqa: F811
    emitter = furry(2)
    for name in ("Skin", "Fur"):
        emitter.data.materials.append(bpy.data.materials.new(name))
    emitter.particle_systems[0].settings.material = 2
    result = export()
    (block,) = (b for b in result.scene.instances if b.name == emitter.name and "Fur" in _worn(b))
    (found,) = strands_of(result)
    assert set(found.material_slots) == {1} and result.scene.geometries[block.geometry] is found


def _worn(block):
    names = [m.name for m in export().scene.materials]
    return [names[k] for k in block.materials]


def test_hair_info_reads_what_cycles_tells(scene):  # noqa: F811
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 2], 3)] * 2, [0.1] * 6)
    material = bpy.data.materials.new("Told")
    use_nodes(material)
    tree = material.node_tree
    told, glow = tree.nodes.new("ShaderNodeHairInfo"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(told.outputs["Intercept"], glow.inputs["Color"])
    tree.links.new(told.outputs["Thickness"], glow.inputs["Strength"])
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glow.outputs[0], out.inputs[0])
    thing.data.materials.append(material)
    (found,) = strands_of(export())
    values = {a.name: a.values for a in found.attributes}
    np.testing.assert_allclose(values["(hair)"][:, 0], [0, 0.5, 1] * 2, atol=1e-6)
    np.testing.assert_allclose(values["(hair)"][:, 1], 2, rtol=1e-6)
    numbers = np.arange(2, dtype=np.uint32)
    random = random_of(numbers, np.zeros_like(numbers))
    np.testing.assert_allclose(values["(hair)"][::3, 2], random)
    np.testing.assert_allclose(values["(fibre)"], [[0, 0, 1, 0.2]] * 6, atol=1e-6)


def test_strands_run_at_joints_between_their_segments():
    """Also where one has no length, and in several strands."""
    points = [(0, 0, 0), (2, 0, 0), (2, 3, 0), (1, 1, 1), (1, 1, 5), (0, 0, 0), (0, 0, 0)]
    radii = np.arange(len(points), dtype=np.float32)
    starts = np.array([0, 1, 3, 5], np.uint32)
    found = fibre_values(Strands("bent", np.array(points, np.float32), radii, starts))
    across, along, up, none = (0.5**0.5, 0.5**0.5, 0), (1, 0, 0), (0, 0, 1), (0, 0, 0)
    wanted = [along, across, (0, 1, 0), up, up, none, none]
    np.testing.assert_allclose(found[:, :3], wanted, atol=1e-15)
    assert (found[:, 3] == 2 * radii).all()


@pytest.mark.parametrize("model", ["CHIANG", "HUANG"])
def test_principled_hair_has_lobes_round_the_strand(scene, model):  # noqa: F811
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 3], 4)])
    shader = Shader(shader="ShaderNodeBsdfHairPrincipled")
    shader.shader.model, shader.shader.parametrization = model, "MELANIN"
    thing.data.materials.append(shader.material)

    def lobes():
        return [x for x in export().scene.materials[-1].lobes if x.kind != "AMBIENT"]

    (strands,) = strands_of(export())
    assert [a.name for a in strands.attributes] == ["(fibre)"]
    # reflection before the strand and behind it, what passes, and what is reflected within, which
    # Huang's model sends to both sides
    kinds = ["FIBRE_SPECULAR"] * 2 + ["FIBRE_TRANSMISSION"] * (2 if model == "CHIANG" else 3)
    assert sorted(x.kind for x in lobes()) == sorted(kinds)
    assert len({x.fibre_output for x in lobes()}) == 1
    assert sent(lobes()).max() < 1
    if model == "HUANG":
        for name in ("Reflection", "Transmission", "Secondary Reflection"):
            shader.shader.inputs[name].default_value = 0.0
        assert not lobes()


def sent(lobes) -> np.ndarray:
    """What of even light those of one strand send on, seen from across it: times what the shape of
    each does, by the integral over the sphere.
    """
    total = np.zeros(3)
    l, size, turn = sphere()  # noqa: E741
    t = np.broadcast_to(np.array([[1.0], [0.0], [0.0]]), l.shape)
    v = np.broadcast_to(np.array([[0.0], [0.0], [1.0]]), l.shape)
    for lobe in lobes:
        share, behind = 1.0, lobe.kind == "FIBRE_TRANSMISSION"
        if behind or lobe.kind == "FIBRE_SPECULAR":
            given = fibre_highlight(t, v, l, lobe.exponent, lobe.fan, behind)
            share = (given * seen_share(turn, behind) * size).sum() / np.pi
        if lobe.kind.startswith("FIBRE"):
            total += share * np.array(lobe.factors[0].value)
    assert np.isfinite(total).all() and (total >= 0).all()
    return total


def test_hair_shaders_on_faces_are_told(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeBsdfHair")
    bpy.data.objects.remove(bpy.data.objects["Quad"])  # which wears it
    bpy.ops.mesh.primitive_plane_add()
    plane = bpy.context.object
    plane.data.materials.append(bpy.data.materials.new("bare"))
    plane.data.materials.append(shader.material)
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 3], 4)])
    thing.data.materials.append(shader.material)
    assert not [note for note in export().notes if "no strand" in note]
    plane.data.polygons[0].material_index = 1
    (told,) = [note for note in export().notes if "no strand" in note]
    assert plane.name in told and "Fur" not in told


@pytest.mark.parametrize("model", ["CHIANG", "HUANG"])
def test_hair_of_any_colour_sends_no_more_than_comes(scene, model):  # noqa: F811
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 3], 4)])
    shader = Shader(shader="ShaderNodeBsdfHairPrincipled")
    shader.shader.model, shader.shader.parametrization = model, "COLOR"
    thing.data.materials.append(shader.material)
    for color in ((1, 1, 1, 1), (0, 0.5, 2, 1), (np.nan, -1, 1e30, 1)):
        shader.shader.inputs["Color"].default_value = color
        for ior in (1.0, 1.3, 1.55, 2.0, 4.0, 1000.0):
            shader.shader.inputs["IOR"].default_value = ior
            lobes = [x for x in export().scene.materials[-1].lobes if x.kind != "AMBIENT"]
            assert (sent(lobes) <= 1 + 1e-6).all()  # as close as the sum over the sphere is


def test_colours_that_are_not_finite_count_as_0_and_are_told(scene):  # noqa: F811
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 3], 4)])
    colors = thing.data.attributes.new("Dye", "FLOAT_VECTOR", "POINT")
    colors.data.foreach_set("vector", np.float32([np.nan, 1, 1] * 4))
    shader = Shader(shader="ShaderNodeEmission")
    shader.link(
        shader.node("ShaderNodeAttribute", attribute_name="Dye"), "Color", shader.shader, "Color"
    )
    thing.data.materials.append(shader.material)
    result = export()
    ((dye,),) = (found.attributes for found in strands_of(result))
    assert (dye.values == [0, 1, 1, 1]).all()
    assert any(
        note.startswith("Attributes have values that are not finite") and "'Dye of Fur'" in note
        for note in result.notes
    )


def test_a_strand_has_the_map_and_colours_of_its_root(scene):  # noqa: F811
    emitter = furry(6)
    material = bpy.data.materials.new("Mapped")
    use_nodes(material)
    tree = material.node_tree
    texture, glow = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeEmission")
    tree.links.new(texture.outputs[0], glow.inputs["Color"])
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(glow.outputs[0], out.inputs[0])
    emitter.data.materials.append(material)
    (found,) = strands_of(export())
    (uv,) = found.attributes
    assert uv.domain == "FACE" and uv.values.shape == (len(found.starts), 2)
    # the plane spans -1 to 1 and its map 0 to 1
    first = np.flatnonzero(~np.isin(found.starts, found.starts + 1))
    np.testing.assert_allclose(
        uv.values[first], found.vertices[found.starts[first], :2] / 2 + 0.5, atol=1e-5
    )


def test_a_view_follows_hair(scene):  # noqa: F811
    """What is kept between exports is what a fresh one has."""
    emitter = furry(5, "INTERPOLATED")
    settings = emitter.particle_systems[0].settings
    settings.child_percent = settings.rendered_child_count = 3
    fur = curves("Fur", [np.linspace([0, 0, 0], [0, 1, 2], 4)] * 2)
    fur.data.materials.append(bpy.data.materials.new("Fur"))
    with Follower() as follower:
        follower.check()
        emitter.location = fur.location = (1, 2, 0)
        follower.check()
        settings.count = 9
        follower.check()
        settings.radius_scale = 0.5
        follower.check()
        fur.data.position_data[0].vector = (0.5, 0, 0)
        fur.data.update_tag()
        follower.check()
        emitter.modifiers[0].show_viewport = False
        follower.check()
        fur.hide_viewport = True
        follower.check()


def test_melanin_may_vary_and_be_odd(scene):  # noqa: F811
    """By Random Color and by a node; what is negative or above 1 counts as the nearest of these."""
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 3], 4)] * 3)
    shader = Shader(shader="ShaderNodeBsdfHairPrincipled")
    shader.shader.parametrization = "MELANIN"
    thing.data.materials.append(shader.material)
    steady = len(export().scene.materials[-1].program.code)
    shader.shader.inputs["Random Color"].default_value = 0.7
    result = export()
    assert not [note for note in result.notes if "Random Color" in note]
    assert "(hair)" in [a.name for a in strands_of(result)[0].attributes]
    assert len(result.scene.materials[-1].program.code) > steady
    value = shader.node("ShaderNodeValue")
    shader.link(value, "Value", shader.shader, "Random")
    for number in (-1e30, -1.0, 0.0, 1.0, 1e30):
        value.outputs[0].default_value = number
        film = render(export().scene, Settings(samples=1, backend="NUMPY", diffuse_bounces=1))
        assert np.isfinite(film.combined).all()


def test_random_roughness_differs_from_strand_to_strand(scene):  # noqa: F811
    """As the strand's random number says: exponents of Roughness 0.3 times 0.4 to 1.6."""
    thing = curves("Fur", [np.linspace([x, 0, 0], [x, 0, 3], 4) for x in range(40)])
    shader = Shader(shader="ShaderNodeBsdfHairPrincipled")
    thing.data.materials.append(shader.material)
    result, lobes = shader.export()
    assert not [note for note in result.notes if "Random Roughness" in note or "Offset" in note]
    assert all(lobe.exponent_output < 0 for lobe in lobes)
    shader.shader.inputs["Random Roughness"].default_value = 0.6
    result, lobes = shader.export()
    assert not [note for note in result.notes if "Random Roughness" in note]
    shine = [lobe for lobe in lobes if lobe.kind == "FIBRE_SPECULAR"]
    assert shine and all(lobe.exponent_output >= 0 for lobe in shine)
    (hair,) = (a for a in strands_of(result)[0].attributes if a.name == "(hair)")
    assert np.ptp(hair.values[:, 2]) > 0.5


@pytest.mark.parametrize("offset", [1e6, -1e6, float("nan")])
def test_odd_offsets_lean_no_further(scene, offset):  # noqa: F811
    thing = curves("Fur", [np.linspace([0, 0, 0], [0, 0, 3], 4)])
    shader = Shader(shader="ShaderNodeBsdfHairPrincipled")
    thing.data.materials.append(shader.material)
    shader.shader.inputs["Offset"].default_value = offset
    _, lobes = shader.export()
    assert all(0.1 < lobe.ior < 10 for lobe in lobes if lobe.kind.startswith("FIBRE"))


def test_keys_beside_one_that_is_not_finite_stay_where_they_are():
    positions = np.array([[0, 0, 0], [np.nan, 0, 1], [0, 0, 2]], np.float32)
    radii, slots = np.array([3, 2, 1], np.float32), np.zeros(1, np.uint16)
    found = cut(Keys(positions, radii, np.array([0, 3]), slots))
    assert found.at[0].tolist() == [0, 0, 0, 3] and found.at[-1].tolist() == [0, 0, 2, 1]
