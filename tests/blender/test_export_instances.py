"""Places, sharing and visibility against a plain walk over the depsgraph."""

import gc

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from export_support import Shader, export, link, mesh_object, quad, scene, use_nodes  # noqa: F401
from glint.engine.scene import EVERYTHING, Instances


def _plain_walk(kinds=("MESH",)) -> dict[tuple, np.ndarray]:
    """Object data's name → (k, 3, 4) places, one matrix at a time."""
    places: dict[str, list] = {}
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if (
            instance.show_self
            and instance.object.type in kinds
            and len(instance.object.data.polygons)
        ):
            places.setdefault(instance.object.name, []).append(np.array(instance.matrix_world)[:3])
    return {name: np.array(rows) for name, rows in places.items()}


def _places(instances: tuple[Instances, ...]) -> dict[str, np.ndarray]:
    places: dict[str, list] = {}
    for row in instances:
        places.setdefault(row.name, []).extend(row.world_from_object)
    return {name: np.array(rows) for name, rows in places.items()}


def _assert_same_places() -> None:
    found, plain = _places(export().scene.instances), _plain_walk()
    assert found.keys() == plain.keys()
    for name, rows in plain.items():
        np.testing.assert_array_equal(found[name], rows)


def _collection():
    collection = bpy.data.collections.new("Parts")
    for k, name in enumerate(("A", "B")):
        part = quad(name)
        bpy.context.scene.collection.objects.unlink(part)
        collection.objects.link(part)
        part.location = (k, 2 * k, 3)
    return collection


def _empty_with(collection, **settings):
    empty = link(bpy.data.objects.new("Instancer", None))
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    for name, value in settings.items():
        setattr(empty, name, value)
    return empty


def test_collection_instances_share_meshes(scene):  # noqa: F811
    collection = _collection()
    _empty_with(collection, location=(5, 0, 0), rotation_euler=(1, 2, 3))
    _empty_with(collection, scale=(-1, 2, 0.5))
    assert len(export().scene.geometries) == 2
    _assert_same_places()


def test_nested_collections(scene):  # noqa: F811
    outer = bpy.data.collections.new("Outer")
    inner = _empty_with(_collection(), location=(0, 0, 1))
    scene.collection.objects.unlink(inner)
    outer.objects.link(inner)
    _empty_with(outer, rotation_euler=(0.5, 0, 0))
    _assert_same_places()


@pytest.mark.parametrize("way", ["VERTS", "FACES"])
def test_instancing_on_vertices_and_faces(scene, way):  # noqa: F811
    bpy.ops.mesh.primitive_ico_sphere_add()
    parent = bpy.context.object
    child = quad("Child")
    child.parent = parent
    parent.instance_type = way
    _assert_same_places()
    parent.show_instancer_for_render = parent.show_instancer_for_viewport = False
    _assert_same_places()
    assert {row.name for row in export().scene.instances} == {"Child"}


def test_particles(scene):  # noqa: F811
    bpy.ops.mesh.primitive_plane_add()
    emitter, part = bpy.context.object, quad("Part")
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_end, settings.render_type, settings.instance_object = (
        30,
        1,
        "OBJECT",
        part,
    )
    scene.frame_set(5)
    _assert_same_places()
    assert len(_places(export().scene.instances)["Part"]) > 20
    emitter.show_instancer_for_render = emitter.show_instancer_for_viewport = False
    assert {row.name for row in export().scene.instances} == {"Part"}


def scatter(count: int, node: str = "GeometryNodeObjectInfo", mark: str = ""):
    """A grid of about `count` points that geometry nodes turn into placed, turned and scaled
    icospheres. mark: an attribute of the instances that gets their places.
    """
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=1)
    part = bpy.context.object
    side = round(count**0.5)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=side - 1, y_subdivisions=side - 1, size=2)
    grid = bpy.context.object
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    names = (
        "NodeGroupInput",
        "NodeGroupOutput",
        "GeometryNodeInstanceOnPoints",
        node,
        "FunctionNodeRandomValue",
    )
    start, end, place, what, random = (tree.nodes.new(name) for name in names)
    random.data_type = "FLOAT_VECTOR"
    if node == "GeometryNodeObjectInfo":
        what.inputs["Object"].default_value = part
        what.inputs["As Instance"].default_value = True
        tree.links.new(what.outputs["Geometry"], place.inputs["Instance"])
    else:
        tree.links.new(what.outputs["Mesh"], place.inputs["Instance"])
    points = start.outputs[0]
    if mark:
        store = tree.nodes.new("GeometryNodeStoreNamedAttribute")
        store.data_type, store.inputs["Name"].default_value = "FLOAT_VECTOR", mark
        where = tree.nodes.new("GeometryNodeInputPosition").outputs[0]
        tree.links.new(points, store.inputs[0])
        tree.links.new(where, store.inputs["Value"])
        points = store.outputs[0]
    tree.links.new(points, place.inputs["Points"])
    tree.links.new(random.outputs[0], place.inputs["Rotation"])
    tree.links.new(random.outputs[0], place.inputs["Scale"])
    tree.links.new(place.outputs[0], end.inputs[0])
    grid.modifiers.new("Scatter", "NODES").node_group = tree
    grid.location, grid.rotation_euler, grid.scale = (1, 2, 3), (0.1, 0.2, 0.3), (1, 0.5, 2)
    return grid, part


@pytest.mark.parametrize("node", ["GeometryNodeObjectInfo", "GeometryNodeMeshCube"])
def test_geometry_nodes_instances(scene, node):  # noqa: F811
    scatter(100, node)
    _assert_same_places()


def test_instances_of_instances(scene):  # noqa: F811
    grid, _ = scatter(9)
    collection = bpy.data.collections.new("Grids")
    collection.objects.link(grid)
    _empty_with(collection, location=(0, 0, 9))
    _assert_same_places()


def _read_of_instancer(name: str):
    """A material that shows an attribute of instances."""
    material = bpy.data.materials.new("Marked")
    use_nodes(material)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    read = nodes.new("ShaderNodeAttribute")
    read.attribute_type, read.attribute_name = "INSTANCER", name
    shader, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    links.new(read.outputs["Color"], shader.inputs["Color"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def _with_ids(grid, number) -> None:
    """Gives the points of a scatter ids; number: of each by its place in the row."""
    ids = grid.data.attributes.new("id", "INT", "POINT")
    ids.data.foreach_set("value", [number(k) for k in range(len(ids.data))])


needs_sets = pytest.mark.skipif(
    not hasattr(bpy.types.Object, "evaluated_geometry"), reason="Blender tells no geometry sets"
)


@needs_sets
@pytest.mark.parametrize(
    "number",
    [None, lambda k: 7 * k + 3, lambda k: k // 3],
    ids=("places", "ids", "repeated"),
)
@pytest.mark.parametrize("carrier", ["object", "collection", "nodes"])
def test_instances_know_their_attributes(scene, carrier, number):  # noqa: F811
    """Each tells where its scatter put it: by ids, repeated ones too, and through what instances
    the scatter.
    """
    grid, part = scatter(25, mark="place")
    part.data.materials.append(_read_of_instancer("place"))
    part["place"] = (9.0, 9.0, 9.0)  # where no instance has it
    if number is not None:
        _with_ids(grid, number)
    if carrier == "collection":
        collection = bpy.data.collections.new("Grids")
        scene.collection.objects.unlink(grid)
        collection.objects.link(quad("First"))
        collection.objects.link(grid)
        _empty_with(collection, location=(0, 0, 9))
    elif carrier == "nodes":
        nodes = scatter(4)[0].modifiers[0].node_group.nodes
        carried = next(n for n in nodes if n.bl_idname == "GeometryNodeObjectInfo")
        carried.inputs["Object"].default_value = grid
    vertices = sorted(tuple(v.co) for v in grid.data.vertices)
    blocks = [b for b in export().scene.instances if b.name == part.name and len(b.values)]
    marked = [b for b in blocks if len(b.world_from_object) > 1]
    assert len(marked) == (2 if carrier == "nodes" else 1)
    for block in marked:
        found, at = block.values["INSTANCER:place"][:, :3], block.world_from_object[:, :, 3]
        for k in range(0, len(at), 25):  # all that one scatter instances
            assert sorted(map(tuple, found[k : k + 25].tolist())) == vertices
            places = np.c_[found[k : k + 25], np.ones(25)]
            moved = places @ np.linalg.lstsq(places, at[k : k + 25], rcond=None)[0]
            np.testing.assert_allclose(moved, at[k : k + 25], atol=1e-5)


def test_odd_matrices_pass_through(scene):  # noqa: F811
    parent = link(bpy.data.objects.new("Parent", None))
    parent.scale = (1, 5, 0.2)
    for k, scale in enumerate([(-1, 1, 1), (1, 0, 1), (1e-6, 1, 1e6)]):
        thing = quad(f"Odd{k}")
        thing.parent, thing.rotation_euler, thing.scale = parent, (1, 2, 3), scale
    bpy.context.view_layer.update()
    assert export().notes == ()
    _assert_same_places()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_places_that_are_not_finite_are_named(scene, bad):  # noqa: F811
    quad("Good")
    quad("Bad").matrix_world = Matrix.Translation((bad, 0, 0))
    result = export()
    assert [row.name for row in result.scene.instances] == ["Good"]
    assert sum("'Bad'" in note for note in result.notes) == 1


def test_only_the_bad_places_of_many_are_dropped(scene):  # noqa: F811
    parent = mesh_object("Parent", [(0, 0, 0), (np.nan, 0, 0), (2, 0, 0)], [])
    child = quad("Child")
    child.parent, parent.instance_type = parent, "VERTS"
    result = export()
    blocks = {
        len(row.world_from_object): row.world_from_object[:, 0, 3].tolist()
        for row in result.scene.instances
    }
    assert blocks[2] == [0, 2]
    assert any("'Child'" in note for note in result.notes)


def test_hidden_objects_are_left_out(scene):  # noqa: F811
    hidden = quad("Hidden")
    hidden.hide_render = hidden.hide_viewport = True
    assert export().scene.instances == ()


FLAGS = {
    "visible_camera": "visible_camera",
    "visible_glossy": "visible_mirror",
    "visible_shadow": "visible_shadow",
    "visible_transmission": "visible_transmission",
    "visible_diffuse": "visible_diffuse",
    "visible_volume_scatter": "visible_media",
    "is_holdout": "holdout",
    "is_shadow_catcher": "catcher",
}


@pytest.mark.parametrize("flag", FLAGS)
def test_each_flag_has_its_field(scene, flag):  # noqa: F811
    thing = quad()
    thing.pass_index = 7
    setattr(thing, flag, not getattr(thing, flag))
    (row,) = export().scene.instances
    changed = {
        name
        for name in FLAGS.values()
        if getattr(row, name) != (name not in ("holdout", "catcher"))
    }
    assert changed == {FLAGS[flag]}
    assert row.object_index == 7


def test_an_instancer_hides_what_it_places(scene):  # noqa: F811
    _empty_with(_collection(), visible_camera=False, is_holdout=True)
    assert all(
        not row.visible_camera and row.visible_shadow and row.holdout
        for row in export().scene.instances
    )


def test_collections_of_the_view_layer_hold_out_and_hide(scene):  # noqa: F811
    for name in ("Hole", "Indirect"):
        collection = bpy.data.collections.new(name)
        scene.collection.children.link(collection)
        collection.objects.link(mesh_object(name, [(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]))
        scene.collection.objects.unlink(bpy.data.objects[name])
    layers = bpy.context.view_layer.layer_collection.children
    layers["Hole"].holdout, layers["Indirect"].indirect_only = True, True
    result = export()
    hole, indirect = result.scene.instances
    assert hole.holdout and hole.visible_camera
    assert not indirect.holdout and not indirect.visible_camera
    assert [note for note in result.notes if "'Indirect'" in note and "'Hole'" not in note]


def test_what_shadow_catchers_do_not_show_is_noted(scene):  # noqa: F811
    glow = bpy.data.materials.new("Glow")
    if bpy.app.version < (5, 0):
        glow.use_nodes = True
    thing = quad("Catcher", glow)
    thing.is_shadow_catcher = True
    assert not export().notes
    tree = thing.active_material.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Emission Strength"].default_value = 1.0
    assert any("'Catcher'" in note for note in export().notes)
    shader.inputs["Emission Strength"].default_value = 0.0
    gas = tree.nodes.new("ShaderNodeEmission")
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(gas.outputs[0], output.inputs["Volume"])
    assert any("glow light nothing: 'Catcher'" in note for note in export().notes)


@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e300])
def test_properties_that_are_not_finite_count_as_0_and_are_told(scene, bad):  # noqa: F811
    shader = Shader()
    node = shader.node("ShaderNodeAttribute", attribute_type="OBJECT", attribute_name="Own")
    shader.link(node, "Color", shader.shader, "Color")
    shader.quad["Own"] = [bad, 0.5, 0.25]
    result = export()
    ((values,),) = (block.values.values() for block in result.scene.instances)
    assert values.tolist() == [[0.0, 0.5, 0.25, 1.0]]
    assert any("not finite" in note and "'Own of Quad'" in note for note in result.notes)


def test_what_cannot_be_rendered_is_named_once_per_kind(scene):  # noqa: F811
    for name in ("Smoke", "Fog"):
        link(bpy.data.objects.new(name, bpy.data.volumes.new(name)))
    notes = export().notes
    assert sum("'Smoke'" in note and "'Fog'" in note for note in notes) == 1
    assert len(notes) == 1


def test_material_override_of_the_view_layer(scene):  # noqa: F811
    quad("Quad", bpy.data.materials.new("Own"))
    bpy.context.view_layer.material_override = bpy.data.materials.new("Override")
    assert [m.name for m in export().scene.materials] == ["Override"]


@pytest.mark.skipif(
    "world_override" not in bpy.types.ViewLayer.bl_rna.properties,
    reason="this Blender has no such override",
)
def test_world_override_of_the_view_layer(scene):  # noqa: F811
    world = bpy.data.worlds.new("Override")
    use_nodes(world)
    tree = world.node_tree
    tree.nodes.clear()
    shader, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Background", "OutputWorld"))
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    shader.inputs["Color"].default_value = (0.25, 0.5, 1.0, 1.0)
    bpy.context.view_layer.world_override = world
    np.testing.assert_allclose(export().scene.world.background, (0.25, 0.5, 1.0))


def test_what_glows_is_linked_as_lamps_are(scene):  # noqa: F811
    """A panel that lights one thing, and has shadows of another."""
    panel, lit, dark = (quad(name) for name in ("panel", "lit", "dark"))
    for thing, of in ((lit, "receiver_collection"), (dark, "blocker_collection")):
        part = bpy.data.collections.new(of)
        part.objects.link(thing)
        setattr(panel.light_linking, of, part)
    result = export()
    found = {thing.name: thing for thing in result.scene.instances}
    sets = {name: 1 << thing.light_set for name, thing in found.items()}
    assert len(set(sets.values())) == 3
    for links, name in ((found["panel"].receivers, "lit"), (found["panel"].blockers, "dark")):
        assert [other for other, own in sets.items() if links & own] == [name]
    assert found["lit"].receivers == found["lit"].blockers == EVERYTHING
    assert not result.notes
    glow, mirror = Shader(shader="ShaderNodeEmission"), Shader(shader="ShaderNodeBsdfAnisotropic")
    mirror.shader.inputs["Roughness"].default_value = 0.0
    panel.data.materials.append(glow.material)
    lit.data.materials.append(mirror.material)
    assert any("Mirrors and glass" in note and "'panel'" in note for note in export().notes)


def test_light_groups_of_lamps_things_and_the_world(scene):  # noqa: F811
    """By name, of those that the view layer has; what is instanced keeps its own."""
    layer = bpy.context.view_layer
    for name in ("Key", "Fill"):
        layer.lightgroups.add(name=name)
    quad("glowing").lightgroup = "Fill"
    for name, group in (("a", "Key"), ("b", "Gone"), ("c", "")):
        link(bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))).lightgroup = group
    inner = bpy.data.objects.new("inner", bpy.data.objects["glowing"].data)
    inner.lightgroup = "Key"
    part = bpy.data.collections.new("part")
    part.objects.link(inner)
    carrier = link(bpy.data.objects.new("carrier", None))
    carrier.instance_type, carrier.instance_collection = "COLLECTION", part
    carrier.lightgroup = "Fill"
    scene.world = bpy.data.worlds.new("World")
    scene.world.lightgroup = "Fill"
    result = export(has_light_groups=True).scene
    assert result.light_groups == ("Key", "Fill")
    found = {thing.name: thing.light_group for thing in (*result.lights, *result.instances)}
    assert found == {"glowing": 1, "a": 0, "b": -1, "c": -1, "inner": 0, "World": 1}
    assert result.world.light_group == 1
    plain = export().scene
    assert plain.light_groups == () and plain.world.light_group == -1
    assert {thing.light_group for thing in (*plain.lights, *plain.instances)} == {-1}


def test_light_groups_beyond_the_most_are_told(scene):  # noqa: F811
    quad()
    for number in range(65):
        bpy.context.view_layer.lightgroups.add(name=f"group {number:02}")
    result = export(has_light_groups=True)
    assert len(result.scene.light_groups) == 64
    assert any("group 64" in note and "at most 64" in note for note in result.notes)


@pytest.mark.parametrize("was_on", [True, False])
def test_pythons_collector_is_as_it_was_after_an_export_that_fails(scene, was_on):  # noqa: F811
    scene.camera = None
    (gc.enable if was_on else gc.disable)()
    try:
        with pytest.raises(Exception, match="camera"):
            export()
        assert gc.isenabled() == was_on
    finally:
        gc.enable()
