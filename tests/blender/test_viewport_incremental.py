"""The export that keeps what did not change: after any sequence of edits it gives what a full
export gives, bit for bit.
"""

import random

import bpy
import numpy as np
import pytest

from export_support import Shader, link, mesh_object, quad, scene, use_nodes  # noqa: F401
from following import Follower
from glint.addon.export import collector as walked
from glint.addon.export.materials import materials
from glint.addon.export.sync import incremental
from glint.engine.scene import Mesh
from made_up_edits import (
    EDITS,
    cast,
    color,
    edit_vertex,
    film,
    hide,
    light,
    move,
    node_value,
    personal,
    scattering,
    surround,
    swap_material,
    unlink_or_link,
)


def test_notes_last_as_long_as_what_they_are_about(scene):  # noqa: F811
    odd = Shader("Odd")
    velvet = odd.node("ShaderNodeTexWhiteNoise")
    odd.link(velvet, "Color", odd.shader, "Color")
    use_nodes(odd.material)
    plain, lamp = (
        quad("Plain"),
        link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))),
    )
    with Follower() as follower:
        follower.check()
        told = follower.live.notes()
        assert any("'Odd'" in note for note in told), told
        plain.location = (1, 0, 0)
        follower.check()
        plain.hide_viewport = True
        follower.check()
        lamp.data.energy = 7
        follower.check()
        assert follower.live.notes() == told
        odd.material.node_tree.links.clear()
        follower.check()
        assert not any("'Odd'" in note and "Noise" in note for note in follower.live.notes())


def test_an_image_without_its_file_is_told_as_long_as_a_material_shows_it(scene, tmp_path):  # noqa: F811
    """Whichever of them is edited or goes."""
    image = bpy.data.images.new("Gone", 2, 2)
    image.source, image.filepath = "FILE", str(tmp_path / "gone.png")
    shaders = [Shader(name) for name in ("One", "Two")]
    for shader in shaders:
        texture = shader.node("ShaderNodeTexImage")
        texture.image = image
        shader.link(texture, "Color", shader.shader, "Color")
    with Follower() as follower:

        def is_told():
            follower.check()
            return any("gone.png" in note for note in follower.live.notes())

        assert is_told()
        shaders[0].shader.inputs["Roughness"].default_value = 0.25
        assert is_told()
        bpy.data.objects.remove(shaders[0].quad)
        assert is_told()
        bpy.data.objects.remove(shaders[1].quad)
        assert not is_told()


@pytest.fixture
def world(scene):  # noqa: F811
    """Plain and modified meshes, shared data, textures, an empty that instances a collection,
    lights, a world with nodes.
    """
    material = Shader("Textured")
    image = bpy.data.images.new("Image", 4, 4)
    image.pixels.foreach_set(np.random.default_rng(1).random(64, np.float32))
    texture = material.node("ShaderNodeTexImage")
    texture.image = image
    material.link(texture, "Color", material.shader, "Color")
    material.quad.name = "Textured"
    plain = bpy.data.materials.new("Plain")
    plain.use_nodes = False
    shared = quad("Shared", plain, material.material)
    link(bpy.data.objects.new("Twin", shared.data))
    modified = quad("Modified", material.material)
    modified.data.uv_layers.new(name="UVMap")
    modified.modifiers.new("Subdivide", "SUBSURF").levels = 1
    quad("Personal", personal())
    instanced = bpy.data.collections.new("Instanced")
    inner = mesh_object("Inner", [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    inner.data.materials.append(personal())
    bpy.context.scene.collection.objects.unlink(inner)
    instanced.objects.link(inner)
    for name in ("EmptyA", "EmptyB"):
        empty = link(bpy.data.objects.new(name, None))
        empty.instance_type, empty.instance_collection = "COLLECTION", instanced
    child = quad("Child")
    child.parent = shared
    quad("Scatter").modifiers.new("Scatter", "NODES").node_group = scattering()
    for kind in ("POINT", "SUN", "AREA"):
        link(bpy.data.objects.new(kind.title(), bpy.data.lights.new(kind.title(), kind)))
    scene.world = bpy.data.worlds.new("World")
    use_nodes(scene.world)
    tree = scene.world.node_tree
    tree.links.new(
        tree.nodes.new("ShaderNodeBackground").outputs[0],
        tree.nodes.new("ShaderNodeOutputWorld").inputs[0],
    )
    bpy.context.view_layer.update()
    return scene


@pytest.mark.parametrize("edit", EDITS)
def test_one_edit(world, edit):
    with Follower() as follower:
        for seed in range(3):
            edit(random.Random(seed))
            follower.check()


@pytest.mark.parametrize("seed", range(12))
def test_any_sequence_of_edits(world, seed):
    r = random.Random(seed)
    with Follower(frozenset({"UV"}) if seed % 2 else frozenset()) as follower:
        for _ in range(12):
            for _ in range(r.randrange(1, 4)):
                r.choice(EDITS)(r)
            follower.check()


@pytest.mark.parametrize("edit", [move, light, color, node_value, surround, cast])
def test_what_is_no_geometry_reads_no_mesh(world, edit, monkeypatch):
    with Follower() as follower:
        follower.check()
        before = {id(geometry) for geometry in follower.scene.geometries}
        monkeypatch.setattr(walked, "read_shape", lambda *_: pytest.fail("a mesh was read"))
        monkeypatch.setattr(
            "glint.addon.export.collector.read_attributes",
            lambda *_: pytest.fail("an attribute was read"),
        )
        edit(random.Random(1))
        bpy.context.view_layer.update()
        assert {id(geometry) for geometry in follower.scene.geometries} <= before


def test_the_nodes_of_a_lamp_are_followed(world):
    """Edited, moved with their light, and with an image of which the pixels change."""
    lamp = bpy.data.objects["Point"]
    with Follower() as follower:
        follower.check()
        lamp.data.use_nodes = True
        tree = lamp.data.node_tree
        emission = next(node for node in tree.nodes if node.type == "EMISSION")
        texture, falloff = (
            tree.nodes.new(f"ShaderNode{name}") for name in ("TexImage", "LightFalloff")
        )
        texture.image = bpy.data.images.new("slide", 2, 2, float_buffer=True)
        tree.links.new(falloff.outputs["Linear"], emission.inputs["Strength"])
        follower.check()
        assert any(light.program is not None for light in follower.scene.lights)
        tree.links.new(texture.outputs["Color"], emission.inputs["Color"])
        follower.check()
        falloff.inputs["Smooth"].default_value = 3
        follower.check()
        lamp.location.x += 1
        follower.check()
        lamp.scale = (1, 2, 3)
        follower.check()
        texture.image.pixels[:] = [0.25] * 16
        texture.image.update_tag()
        follower.check()


def test_an_edited_material_walks_over_nothing(world, monkeypatch):
    unlink_or_link(random.Random(0))
    with Follower() as follower:
        follower.check()
        before = follower.scene
        with monkeypatch.context() as patched:
            patched.setattr(
                incremental, "walk", lambda *_: pytest.fail("the instances were walked over")
            )
            node_value(random.Random(1))
            bpy.context.view_layer.update()
        assert (
            follower.scene.materials != before.materials
            and follower.scene.instances is before.instances
        )
        follower.check()


def test_an_edited_node_value_compiles_its_material_alone(scene, monkeypatch):  # noqa: F811
    """Of three materials with programs; and nothing is compiled where nothing changed."""
    noises = []
    for k in range(3):
        shader = Shader(f"noise {k}")
        noise = shader.node("ShaderNodeTexNoise")
        shader.link(noise, "Color", shader.shader, "Color")
        noises.append(noise)
    compiled = []
    known = materials.compile_material

    def counted(material, *given):
        compiled.append(material.name)
        return known(material, *given)

    monkeypatch.setattr(materials, "compile_material", counted)
    with Follower() as follower:
        assert sorted(compiled) == ["noise 0", "noise 1", "noise 2"]
        compiled.clear()
        before = follower.scene
        noises[1].inputs["Scale"].default_value = 11.0
        bpy.context.view_layer.update()
        assert compiled == ["noise 1"]
        changed = [
            one.name
            for one, two in zip(before.materials, follower.scene.materials, strict=True)
            if one != two
        ]
        assert changed == ["noise 1"]
        assert follower.scene.geometries[0] is before.geometries[0]
        compiled.clear()
        scene.objects[0].location.x += 1.0
        bpy.context.view_layer.update()
        assert compiled == []
        follower.check()


@pytest.mark.skipif(bpy.app.version < (5, 2), reason="the node reads none before Blender 5.2")
def test_attributes_that_rays_read_are_those_of_all_meshes(scene):  # noqa: F811
    """Whichever is met first, and after the name is another."""
    quad("Other")
    shader = Shader("asks")
    for name in ("first", "second"):
        for thing in scene.objects:
            if thing.type == "MESH":
                rows = thing.data.attributes.new(name, "FLOAT_COLOR", "POINT").data
                rows.foreach_set("color", np.linspace(0, 1, 4 * len(rows), dtype=np.float32))
    node = shader.node("ShaderNodeRaycast")
    node.sample_attribute_items.new("RGBA", "Sampled")
    shader.link(node, "Sampled", shader.shader, "Color")
    named = next(s for s in node.inputs if s.name == "Sampled")
    with Follower() as follower:
        for name in ("first", "second", "none", "", "first"):
            named.default_value = name
            shader.material.update_tag()
            bpy.context.view_layer.update()
            follower.check()
            meshes = [g for g in follower.scene.geometries if isinstance(g, Mesh)]
            assert len(meshes) > 1
            read = [[a.name for a in mesh.attributes] for mesh in meshes]
            assert all(names == ([name] if name in ("first", "second") else []) for names in read)


def number(r):
    bpy.data.objects["Shared"].pass_index += 1


def push(r):
    bpy.data.objects["Shared"].location.x += 0.25


def dress(r):
    """Another material in a slot of the object, not of its mesh."""
    slot = bpy.data.objects["Twin"].material_slots[0]
    slot.link = "OBJECT"
    slot.material = bpy.data.materials[
        "Textured" if slot.material == bpy.data.materials["Plain"] else "Plain"
    ]


@pytest.mark.parametrize(
    "edit",
    [cast, number, dress, edit_vertex, push, hide, surround, swap_material, film, unlink_or_link],
)
def test_an_edited_material_hides_no_other_edit(world, edit):
    unlink_or_link(random.Random(0))
    with Follower() as follower:
        for seed in range(3):
            node_value(random.Random(seed))
            edit(random.Random(seed))
            follower.check()


@pytest.mark.parametrize("kind", ["MESH", "CURVE"])
def test_data_that_several_objects_share_outlive_each_of_them(scene, kind, monkeypatch):  # noqa: F811
    """Whichever of them brought the shape first, an edit is heard of through those that are left;
    and if Blender puts what was edited at the same address again.
    """
    if kind == "MESH":  # each curve object has a temporary mesh of its own
        monkeypatch.setattr(walked, "mesh_key", lambda mesh: (mesh.name,))
    data = bpy.data.curves.new("Shared", "CURVE") if kind == "CURVE" else quad("Model").data
    if kind == "CURVE":
        data.splines.new("POLY").points.add(2)
        data.splines[0].points[1].co = data.splines[0].points[2].co = (1, 1, 0, 1)
        data.bevel_depth = 0.1
    for model in list(scene.collection.objects)[1:]:
        bpy.data.objects.remove(model)
    names = [f"User {k}" for k in range(3)]
    for name in names:
        link(bpy.data.objects.new(name, data))
    with Follower() as follower:
        follower.check()
        for number, name in enumerate(names[:2]):
            bpy.data.objects.remove(bpy.data.objects[name])
            follower.check()
            if kind == "CURVE":
                data.bevel_depth = 0.2 + number
            else:
                data.vertices[0].co.z = 0.2 + number
                data.update()
            follower.check()
