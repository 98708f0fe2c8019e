"""Exported arrays against Blender's slow but plain API."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from export_support import Shader, export, link, mesh_object, quad, scene  # noqa: F401
from glint.addon.export.geometry import meshes
from glint.addon.export.geometry.shapes import mark_sphere
from glint.addon.export.materials.terms import GREY
from glint.addon.ui import sphere
from glint.engine.scene import CORNER, POINT, Mesh, Spheres


def _slow(thing):
    """What the plain API says of an evaluated mesh: vertices, triangles, corners, polygon of each
    triangle.
    """
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    mesh.calc_loop_triangles()
    triangles = mesh.loop_triangles
    return (
        mesh,
        np.array([v.co for v in mesh.vertices]),
        np.array([t.vertices for t in triangles]),
        np.array([t.loops for t in triangles]),
        np.array([t.polygon_index for t in triangles]),
    )


def _only_mesh(**options) -> Mesh:
    (mesh,) = export(**options).scene.geometries
    return mesh


SHAPES = {
    "monkey": lambda: bpy.ops.mesh.primitive_monkey_add(),
    "n-gon": lambda: bpy.ops.mesh.primitive_circle_add(vertices=11, fill_type="NGON"),
    "triangles": lambda: bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2),
    "concave": lambda: mesh_object(
        "C", [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 0.5, 0), (0, 2, 0)], [(0, 1, 2, 3, 4)]
    ),
    "loose edges": lambda: mesh_object(
        "L", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (9, 9, 9)], [(0, 1, 2)]
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_triangles_are_blenders(scene, shape):  # noqa: F811
    SHAPES[shape]()
    thing = next(o for o in scene.objects if o.type == "MESH")
    mesh = _only_mesh()
    _, vertices, triangles, _, _ = _slow(thing)
    np.testing.assert_array_equal(mesh.vertices, vertices.astype(np.float32))
    np.testing.assert_array_equal(mesh.triangles, triangles)
    assert mesh.triangles.dtype == np.uint32


def test_triangles_of_large_meshes_are_looked_up_in_parts(scene, monkeypatch):  # noqa: F811
    bpy.ops.mesh.primitive_monkey_add()
    monkeypatch.setattr(meshes, "_GATHERED", 100)
    np.testing.assert_array_equal(_only_mesh().triangles, _slow(bpy.context.object)[2])


def test_modifiers_are_applied(scene):  # noqa: F811
    thing = quad()
    thing.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    thing.modifiers["Subdivision"].levels = 2
    assert len(_only_mesh().triangles) == 32


def test_flat_meshes_have_no_normals(scene):  # noqa: F811
    bpy.ops.mesh.primitive_cube_add()
    assert _only_mesh().normals is None


def test_smooth_meshes_have_vertex_normals(scene):  # noqa: F811
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.data.polygons.foreach_set("use_smooth", np.ones(500, bool))
    bpy.context.object.data.update()
    mesh = _only_mesh()
    slow = np.array([v.normal for v in _slow(bpy.context.object)[0].vertices])
    assert mesh.normals.domain == POINT
    np.testing.assert_allclose(mesh.normals.values, slow, atol=1e-7)


@pytest.mark.parametrize("kind", ["mixed", "custom"])
def test_mixed_and_custom_normals_are_by_corner(scene, kind):  # noqa: F811
    bpy.ops.mesh.primitive_monkey_add()
    data = bpy.context.object.data
    if kind == "mixed":
        data.polygons.foreach_set("use_smooth", np.arange(500) % 2 == 0)
        data.update()
    else:
        data.normals_split_custom_set([(0.6, 0, 0.8)] * len(data.loops))
    mesh = _only_mesh()
    slow, _, _, loops, _ = _slow(bpy.context.object)
    normals = np.array([n.vector for n in slow.corner_normals])
    assert mesh.normals.domain == CORNER
    np.testing.assert_allclose(mesh.normals.values[mesh.corners], normals[loops], atol=1e-7)
    if kind == "custom":
        # Blender keeps them as two 16-bit angles in each fan's own frame: most are exact to 1e-4
        assert np.median(np.abs(mesh.normals.values - [0.6, 0, 0.8])) < 1e-4


def test_material_slots_follow_the_faces(scene):  # noqa: F811
    bpy.ops.mesh.primitive_monkey_add()
    data = bpy.context.object.data
    for name in "ABC":
        data.materials.append(bpy.data.materials.new(name))
    data.polygons.foreach_set("material_index", (np.arange(500) * 7 % 3).astype(np.int32))
    result = export()
    _, _, _, _, faces = _slow(bpy.context.object)
    np.testing.assert_array_equal(result.scene.geometries[0].material_slots, faces * 7 % 3)
    assert [result.scene.materials[k].name for k in result.scene.instances[0].materials] == [
        "A",
        "B",
        "C",
    ]


def test_a_material_index_beyond_the_slots_is_kept_for_the_last_slot(scene):  # noqa: F811
    thing = quad("Quad", bpy.data.materials.new("Only"))
    thing.data.polygons[0].material_index = 7
    result = export()
    assert result.scene.geometries[0].material_slots.tolist() == [7, 7]
    assert len(result.scene.instances[0].materials) == 1


def test_only_the_uv_maps_that_something_reads_are_exported(scene):  # noqa: F811
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.data.uv_layers.new(name="Second")
    assert _only_mesh().attributes == ()
    mesh = _only_mesh(passes=frozenset({"UV"}))
    slow, _, _, loops, _ = _slow(bpy.context.object)
    uv = np.array([x.vector for x in slow.uv_layers[0].uv])
    assert [a.name for a in mesh.attributes] == [slow.uv_layers[0].name]
    np.testing.assert_array_equal(
        mesh.attributes[0].values[mesh.corners], uv.astype(np.float32)[loops]
    )


def test_the_map_that_is_active_for_rendering_comes_first(scene):  # noqa: F811
    shader = Shader()
    second = shader.quad.data.uv_layers.new(name="Second")
    second.active_render = True
    texture, uv = shader.node("ShaderNodeTexImage"), shader.node("ShaderNodeUVMap", uv_map="UVMap")
    shader.link(uv, "UV", texture, "Vector")
    shader.link(texture, "Color", shader.shader, "Color")
    assert [a.name for a in _only_mesh().attributes] == ["UVMap"]
    assert [a.name for a in _only_mesh(passes=frozenset({"UV"})).attributes] == ["Second", "UVMap"]


def test_the_active_map_read_by_name_too_comes_once(scene):  # noqa: F811
    shader = Shader(shader="ShaderNodeAddShader")
    for name, by_name in (("Shader", False), ("Shader_001", True)):
        texture, diffuse = shader.node("ShaderNodeTexImage"), shader.node("ShaderNodeBsdfDiffuse")
        if by_name:
            shader.link(shader.node("ShaderNodeUVMap", uv_map="UVMap"), "UV", texture, "Vector")
        shader.link(texture, "Color", diffuse, "Color")
        shader.link(diffuse, 0, shader.shader, name)
    assert [a.name for a in _only_mesh().attributes] == ["UVMap"]


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
@pytest.mark.parametrize("kind", ["BYTE_COLOR", "FLOAT_COLOR"])
def test_colour_attributes_are_scene_linear(scene, kind, domain):  # noqa: F811
    shader = Shader()
    attribute = shader.quad.data.color_attributes.new("Paint", kind, domain)
    for k, value in enumerate(attribute.data):
        value.color = (0.1 * k, 0.5, 0.9, 0.25)
    node = shader.node("ShaderNodeVertexColor", layer_name="Paint")
    shader.link(node, "Color", shader.shader, "Color")
    (found,) = _only_mesh().attributes
    slow = np.array([value.color[:] for value in attribute.data])
    assert (found.name, found.domain) == ("Paint", domain)
    np.testing.assert_array_equal(found.values, slow.astype(np.float32))


@pytest.mark.parametrize(
    ("name", "values"), [("Col", [0.25, 0.5, 0.75, 0.125]), ("UVMap", [0.25, 0.5])]
)
def test_one_attribute_is_read_as_colour_and_as_coordinates(scene, name, values):  # noqa: F811
    """By the same name, which finds one array: the tracers read (u, v, 0) of a map, and the first
    two columns of a colour.
    """
    shader = Shader(shader="ShaderNodeAddShader")
    data = shader.quad.data
    if name == "Col":
        data.color_attributes["Col"].data.foreach_set(
            "color", np.tile(np.float32(values), len(data.loops))
        )
    else:
        data.uv_layers["UVMap"].data.foreach_set("uv", np.tile(np.float32(values), len(data.loops)))
    texture, node = (
        shader.node("ShaderNodeTexImage"),
        shader.node("ShaderNodeAttribute", attribute_name=name),
    )
    shader.link(node, "Vector", texture, "Vector")
    for socket, source in (("Shader", texture), ("Shader_001", node)):
        diffuse = shader.node("ShaderNodeBsdfDiffuse")
        shader.link(source, "Color", diffuse, "Color")
        shader.link(diffuse, 0, shader.shader, socket)
    result, lobes = shader.export()
    assert {(factor.uv, factor.attribute) for lobe in lobes for factor in lobe.factors} == {
        (name, ""),
        ("", name),
    }
    (attribute,) = result.scene.geometries[0].attributes
    np.testing.assert_array_equal(attribute.values, np.tile(np.float32(values), (4, 1)))


def test_attributes_on_faces_are_handed_to_triangles(scene):  # noqa: F811
    shader = Shader()
    bpy.data.objects.remove(shader.quad)
    bpy.ops.mesh.primitive_monkey_add()
    data = bpy.context.object.data
    data.materials.append(shader.material)
    data.attributes.new("Number", "FLOAT", "FACE").data.foreach_set(
        "value", np.arange(500, dtype=np.float32)
    )
    node = shader.node("ShaderNodeAttribute", attribute_name="Number")
    shader.link(node, "Color", shader.shader, "Color")
    mesh = _only_mesh()
    _, _, _, _, faces = _slow(bpy.context.object)
    np.testing.assert_array_equal(
        mesh.attributes[0].values, np.repeat(faces[:, None], 4, 1) * [1, 1, 1, 0] + [0, 0, 0, 1]
    )


def test_a_mesh_in_edit_mode_is_read(scene):  # noqa: F811
    bpy.ops.mesh.primitive_monkey_add()
    bpy.ops.object.shade_smooth()
    before = _only_mesh(passes=frozenset({"UV"}))
    bpy.ops.object.mode_set(mode="EDIT")
    during = _only_mesh(passes=frozenset({"UV"}))
    bpy.ops.object.mode_set(mode="OBJECT")
    np.testing.assert_array_equal(before.triangles, during.triangles)
    np.testing.assert_array_equal(before.vertices, during.vertices)
    np.testing.assert_array_equal(before.attributes[0].values, during.attributes[0].values)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_attributes_that_are_not_finite_count_as_0_and_are_told(scene, bad):  # noqa: F811
    shader = Shader()
    data = shader.quad.data
    data.uv_layers[0].data.foreach_set("uv", np.float32([bad, 1] * 4))
    data.attributes.new("Number", "FLOAT", "POINT").data.foreach_set(
        "value", np.float32([bad, 1, 2, 3])
    )
    attribute = shader.node("ShaderNodeAttribute", attribute_name="Number")
    shader.link(attribute, "Fac", shader.shader, "Roughness")
    shader.link(attribute, "Color", shader.shader, "Color")
    result = export(passes=frozenset({"UV"}))
    values = {a.name: a.values[:, :2].tolist() for a in result.scene.geometries[0].attributes}
    numbers = [[0, 0], [1, 1], [2, 2], [3, 3]]
    assert values == {"UVMap": [[0, 1]] * 4, "Number": numbers, f"{GREY}Number": numbers}
    assert (
        "Attributes have values that are not finite, which count as 0 ('UVMap of Quad', 'Number of "
        "Quad'): repair or remove them"
    ) in result.notes


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30])
def test_faces_with_vertices_that_are_not_finite_are_counted_out(scene, bad):  # noqa: F811
    thing = mesh_object(
        "Broken",
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (bad, 0, 0)],
        [(0, 1, 2), (0, 2, 3), (0, 3, 4)],
    )
    thing.data.attributes.new("material_index", "INT", "FACE").data.foreach_set(
        "value", np.array([0, 1, 2], np.int32)
    )
    result = export()
    mesh = result.scene.geometries[0]
    assert mesh.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert mesh.vertices.max() == 1 and mesh.vertices.min() == 0
    assert mesh.material_slots.tolist() == [0, 1]
    assert any("'Broken'" in note and "1 of its triangles" in note for note in result.notes)


def test_corners_go_with_the_triangles_that_are_left(scene):  # noqa: F811
    thing = mesh_object(
        "Broken",
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (np.nan, 0, 0)],
        [(0, 1, 4), (0, 1, 2, 3), (0, 3, 4)],
    )
    thing.data.uv_layers.new(name="UVMap").data.foreach_set("uv", np.arange(20, dtype=np.float32))
    mesh = _only_mesh(passes=frozenset({"UV"}))
    uv = mesh.attributes[0].values[mesh.corners]
    assert sorted(map(tuple, mesh.triangles.tolist())) == [(0, 1, 2), (0, 2, 3)]
    np.testing.assert_array_equal(uv[:, :, 0], 2 * (3 + mesh.triangles))


@pytest.mark.parametrize("kind", ["FLOAT", "INT", "FLOAT_COLOR"])
def test_values_on_edges_are_means_at_the_vertices(scene, kind):  # noqa: F811
    """As in Cycles."""
    shader = Shader()
    layer = shader.quad.data.attributes.new("Wear", kind, "EDGE")
    ends = np.array([edge.vertices[:] for edge in shader.quad.data.edges])
    values = np.arange(1, len(ends) + 1)
    for item, value in zip(layer.data, values.tolist(), strict=True):
        setattr(item, *(("color", [value] * 4) if "COLOR" in kind else ("value", value)))
    shader.link(shader.node("ShaderNodeAttribute", attribute_name="Wear"), 0, shader.shader, 0)
    result = shader.export()[0]
    (found,) = (a for a in result.scene.geometries[0].attributes if a.name == "Wear")
    wanted = [values[(ends == k).any(1)].mean() for k in range(4)]
    assert found.domain == "POINT" and not result.notes
    np.testing.assert_allclose(found.values[:, 0], wanted, rtol=1e-6)


def test_meshes_without_faces_are_nothing(scene):  # noqa: F811
    mesh_object("Points", [(0, 0, 0)], [])
    mesh_object("Empty", [], [])
    assert export().scene.geometries == ()


@pytest.mark.parametrize("kind", ["CURVE", "FONT", "META", "SURFACE"])
def test_curves_texts_and_the_like_come_once_as_meshes(scene, kind):  # noqa: F811
    add = {
        "CURVE": lambda: bpy.ops.curve.primitive_bezier_circle_add(),
        "FONT": lambda: bpy.ops.object.text_add(),
        "META": lambda: bpy.ops.object.metaball_add(),
        "SURFACE": lambda: bpy.ops.surface.primitive_nurbs_surface_sphere_add(),
    }
    add[kind]()
    if kind == "CURVE":
        bpy.context.object.data.bevel_depth = 0.1
    result = export()
    assert result.notes == ()
    assert len(result.scene.geometries) == len(result.scene.instances) == 1
    copy = bpy.data.meshes.new_from_object(
        bpy.context.object.evaluated_get(bpy.context.evaluated_depsgraph_get())
    )
    copy.calc_loop_triangles()
    assert len(result.scene.geometries[0].triangles) == len(copy.loop_triangles)


def test_point_clouds_are_spheres(scene):  # noqa: F811
    tree = _nodes_on(quad())
    points = tree.nodes.new("GeometryNodeMeshToPoints")
    points.inputs["Radius"].default_value = 0.125
    _between(tree, points)
    spheres = [g for g in export().scene.geometries if isinstance(g, Spheres)]
    assert len(spheres) == 1
    np.testing.assert_array_equal(
        np.sort(spheres[0].centers, 0),
        np.sort(np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]), 0),
    )
    np.testing.assert_array_equal(spheres[0].radii, np.full(4, 0.125, np.float32))


@pytest.mark.parametrize("primitive", ["primitive_uv_sphere_add", "primitive_ico_sphere_add"])
def test_marked_meshes_are_spheres(scene, primitive):  # noqa: F811
    """To the last bits of float32, wherever they lie in their object; modifiers keep the mark."""
    getattr(bpy.ops.mesh, primitive)(radius=0.7)
    ball = bpy.context.object
    ball.data.transform(Matrix.Translation((0.25, 1, -0.5)))
    mark_sphere(ball.data)
    ball.scale = (1, 2, 3)
    ball.modifiers.new("Edges", "EDGE_SPLIT").split_angle = 0
    link(bpy.data.objects.new("Twin", ball.data))
    result = export()
    spheres = result.scene.geometries[0]
    assert isinstance(spheres, Spheres)
    np.testing.assert_allclose(spheres.centers, [(0.25, 1, -0.5)], atol=5e-7)
    np.testing.assert_allclose(spheres.radii, [0.7], atol=5e-7)
    assert [len(block.world_from_object) for block in result.scene.instances] == [1, 1]
    assert result.notes == ()


def test_what_a_mark_cannot_keep_is_said(scene):  # noqa: F811
    """A mesh that is no sphere is rendered as it is; a texture has no place on a sphere."""
    bpy.ops.mesh.primitive_cone_add(depth=3)
    mark_sphere(bpy.context.object.data)
    shader = Shader()
    shader.link(
        shader.node("ShaderNodeTexImage", image=bpy.data.images.new("Image", 4, 4)),
        "Color",
        shader.shader,
        "Color",
    )
    mark_sphere(shader.quad.data)
    result = export()
    assert [type(geometry) for geometry in result.scene.geometries] == [Mesh, Spheres]
    assert ["vertices lie on no sphere" in note and "Cone" in note for note in result.notes] == [
        True,
        False,
    ]
    assert ["no UV maps" in note and "Quad" in note for note in result.notes] == [False, True]


def test_the_mark_has_a_switch_and_a_menu_entry(scene):  # noqa: F811
    sphere.register()
    try:
        bpy.ops.mesh.glint_add_sphere()
        mesh = bpy.context.object.data
        assert mesh.glint_sphere and all(polygon.use_smooth for polygon in mesh.polygons)
        assert isinstance(export().scene.geometries[0], Spheres)
        mesh.glint_sphere = False
        assert isinstance(export().scene.geometries[0], Mesh)
    finally:
        sphere.unregister()


def _nodes_on(thing):
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    tree.nodes.new("NodeGroupInput")
    tree.nodes.new("NodeGroupOutput")
    thing.modifiers.new("Nodes", "NODES").node_group = tree
    return tree


def _between(tree, node) -> None:
    tree.links.new(tree.nodes["Group Input"].outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], tree.nodes["Group Output"].inputs[0])


def test_nothing_of_blender_outlives_the_export(scene):  # noqa: F811
    Shader()
    result = export(passes=frozenset({"UV"}))
    seen, todo = set(), [result]
    while todo:
        value = todo.pop()
        if id(value) in seen or isinstance(value, (str, int, float, type(None), np.ndarray)):
            continue
        seen.add(id(value))
        assert not isinstance(value, bpy.types.bpy_struct)
        todo.extend(
            value
            if isinstance(value, (tuple, list, set, frozenset))
            else value.values()
            if isinstance(value, dict)
            else vars(value).values()
        )


def test_a_shared_mesh_brings_what_either_user_reads(scene):  # noqa: F811
    shader = Shader()
    texture = shader.node("ShaderNodeTexImage")
    shader.link(texture, "Color", shader.shader, "Color")
    first = link(bpy.data.objects.new("Plain", shader.quad.data))
    first.material_slots[0].link = "OBJECT"
    first.material_slots[0].material = bpy.data.materials.new("Plain")
    result = export()
    assert len(result.scene.geometries) == 1
    assert len(result.scene.instances) == 2
    assert len({i.materials for i in result.scene.instances}) == 2
    assert [a.name for a in result.scene.geometries[0].attributes] == ["UVMap"]


def test_the_active_map_comes_first_whoever_asks_first(scene):  # noqa: F811
    by_name, active = Shader("By name"), Shader("Active")
    bpy.data.objects.remove(active.quad)
    by_name.quad.data.uv_layers.new(name="Second").active_render = True
    for shader in (by_name, active):
        shader.link(shader.node("ShaderNodeTexImage"), "Color", shader.shader, "Color")
    texture = next(node for node in by_name.tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    by_name.link(by_name.node("ShaderNodeUVMap", uv_map="UVMap"), "UV", texture, "Vector")
    other = link(bpy.data.objects.new("Other", by_name.quad.data))
    other.material_slots[0].link, other.material_slots[0].material = "OBJECT", active.material
    assert [a.name for a in _only_mesh().attributes] == ["Second", "UVMap"]
