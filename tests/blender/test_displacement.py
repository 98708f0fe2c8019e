"""True displacement: which vertices the export moves, and where."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from export_support import export, link, scene, use_nodes  # noqa: F401
from following import Follower
from glint.addon.export.geometry.shapes import mark_sphere
from glint.addon.render.motion import with_motion
from glint.addon.render.neighbours import with_neighbours
from glint.engine.scene import CORNER, POINT, Mesh
from test_object_motion import straighten

CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
OUT = 1 / np.sqrt(3)


class Moving:
    """A material whose Displacement node moves vertices by `height` along their normals."""

    def __init__(self, height=0.3, method="DISPLACEMENT", space="OBJECT", name="Moving"):
        self.material = bpy.data.materials.new(name)
        use_nodes(self.material)
        self.material.displacement_method = method
        self.tree = self.material.node_tree
        self.output = self.tree.nodes.new("ShaderNodeOutputMaterial")
        self.shader = self.tree.nodes.new("ShaderNodeBsdfDiffuse")
        self.tree.links.new(self.shader.outputs[0], self.output.inputs["Surface"])
        self.node = self.tree.nodes.new("ShaderNodeDisplacement")
        self.node.space = space
        for socket, value in (("Height", height), ("Midlevel", 0.0), ("Scale", 1.0)):
            self.node.inputs[socket].default_value = value
        self.tree.links.new(self.node.outputs[0], self.output.inputs["Displacement"])

    def height(self, kind, output=0, **inputs):
        """A node that gives the height."""
        node = self.tree.nodes.new(kind)
        for name, value in inputs.items():
            node.inputs[name].default_value = value
        self.tree.links.new(node.outputs[output], self.node.inputs["Height"])
        return node


def box(name="Box", *materials, smooth=True, data=None):
    """A cube from -1 to 1."""
    if data is None:
        data = bpy.data.meshes.new(name)
        data.from_pydata(CORNERS.tolist(), [], FACES)
        data.polygons.foreach_set("use_smooth", np.full(6, smooth))
        for material in materials:
            data.materials.append(material)
    return link(bpy.data.objects.new(name, data))


def mesh_of(result, name="Box"):
    found = next(block for block in result.scene.instances if block.name == name)
    return result.scene.geometries[found.geometry]


@pytest.mark.parametrize("smooth", [False, True])
def test_vertices_move_along_their_normals_and_the_mesh_stays_whole(scene, smooth):  # noqa: F811
    box("Box", Moving().material, smooth=smooth)
    result = export()
    mesh = mesh_of(result)
    np.testing.assert_allclose(mesh.vertices, CORNERS * (1 + 0.3 * OUT), atol=1e-6)
    assert (mesh.normals is None) != smooth and not result.notes
    assert len(result.scene.geometries) == 1  # not the undisplaced one as well


def test_no_ray_meets_vertices(scene):  # noqa: F811
    """What asks how rays come, or how large pixels are, is 0 there."""
    for output in ("Is Diffuse Ray", "Is Glossy Ray", "Ray Depth"):
        moving = Moving(name=output)
        path = moving.tree.nodes.new("ShaderNodeLightPath")
        moving.tree.links.new(path.outputs[output], moving.node.inputs["Height"])
        box(output, moving.material)
    moving = Moving(name="Wireframe")
    wire = moving.tree.nodes.new("ShaderNodeWireframe")
    wire.use_pixel_size = True
    moving.tree.links.new(wire.outputs[0], moving.node.inputs["Height"])
    box("Wireframe", moving.material)
    result, flat = export(), Moving(name="Flat")
    flat.node.inputs["Height"].default_value = 0.0
    box("Flat", flat.material)
    for name in ("Is Diffuse Ray", "Is Glossy Ray", "Ray Depth", "Wireframe"):
        wanted = mesh_of(export(), "Flat").vertices
        np.testing.assert_allclose(mesh_of(result, name).vertices, wanted, atol=1e-6)


def test_a_bump_moves_nothing(scene):  # noqa: F811
    moving = Moving(method="BUMP")
    moving.height("ShaderNodeTexNoise")
    box("Box", moving.material)
    result = export()
    assert np.array_equal(mesh_of(result).vertices, CORNERS.astype(np.float32))
    assert not result.displaced and not result.notes


def test_new_normals_are_sums_of_faces_and_those_of_both_stay(scene):  # noqa: F811
    """A square whose corner rises by its x: its plane's normal is that of z = x."""
    found = {}
    for method in ("DISPLACEMENT", "BOTH"):
        moving = Moving(method=method, name=method)
        coordinates = moving.tree.nodes.new("ShaderNodeTexCoord")
        apart = moving.tree.nodes.new("ShaderNodeSeparateXYZ")
        moving.tree.links.new(coordinates.outputs["Object"], apart.inputs[0])
        moving.tree.links.new(apart.outputs[0], moving.node.inputs["Height"])
        data = bpy.data.meshes.new(method)
        data.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
        data.polygons.foreach_set("use_smooth", [True])
        data.materials.append(moving.material)
        link(bpy.data.objects.new(method, data))
    result = export()
    for method in ("DISPLACEMENT", "BOTH"):
        found[method] = mesh_of(result, method)
        np.testing.assert_allclose(found[method].vertices[:, 2], [-1, 1, 1, -1], atol=1e-6)
    slope = np.array([-1, 0, 1]) / np.sqrt(2)
    np.testing.assert_allclose(found["DISPLACEMENT"].normals.values, [slope] * 4, atol=1e-6)
    np.testing.assert_allclose(found["BOTH"].normals.values, [(0, 0, 1)] * 4, atol=1e-6)
    names = {attribute.name for attribute in found["BOTH"].attributes}
    assert {"(undisplaced)", "(undisplaced normal)"} <= names
    assert not found["DISPLACEMENT"].attributes


def test_hard_edges_stay_hard_and_flat_faces_flat(scene):  # noqa: F811
    """The top is flat, and its rim hard, as other faces are smooth: normals are on corners."""
    moving = Moving()
    moving.height("ShaderNodeAttribute", "Fac").attribute_name = "lift"
    cube = box("Box", moving.material)
    cube.data.polygons[5].use_smooth = False
    lift = cube.data.attributes.new("lift", "FLOAT", "POINT")
    lift.data.foreach_set("value", np.arange(8, dtype=np.float32) / 8)
    mesh = mesh_of(export())
    assert mesh.normals.domain == CORNER
    np.testing.assert_allclose(
        mesh.vertices, CORNERS * (1 + np.arange(8)[:, None] / 8 * OUT), atol=1e-6
    )
    a, b, c, d = mesh.vertices[list(FACES[5])].astype(float)
    newell = np.cross(c - a, d - b)
    newell /= np.linalg.norm(newell)
    off = np.abs(mesh.normals.values[mesh.corners] - newell).max((1, 2))
    top = (CORNERS[mesh.triangles][:, :, 2] > 0).all(1)
    assert top.sum() == 2 and off[top].max() <= 1e-6 and off[~top].min() > 0.3
    assert np.abs(np.linalg.norm(mesh.normals.values, axis=1) - 1).max() <= 1e-6


def test_slots_of_one_mesh_move_their_own_faces(scene):  # noqa: F811
    """A vertex that two materials share goes where that of its first face takes it."""
    still = bpy.data.materials.new("Still")
    cube = box("Box", Moving(0.3).material, still, Moving(-0.2, name="In").material)
    cube.data.polygons.foreach_set("material_index", [0, 1, 1, 1, 1, 1])
    moved = np.linalg.norm(mesh_of(export()).vertices, axis=1) - np.sqrt(3)
    left = CORNERS[:, 0] < 0
    np.testing.assert_allclose(moved, np.where(left, 0.3, 0.0), atol=1e-6)
    cube.data.polygons.foreach_set("material_index", [0, 1, 2, 1, 1, 1])
    cube.data.update()
    moved = np.linalg.norm(mesh_of(export()).vertices, axis=1) - np.sqrt(3)
    front = ~left & (CORNERS[:, 1] < 0)
    np.testing.assert_allclose(moved, np.where(left, 0.3, np.where(front, -0.2, 0)), atol=1e-6)


def test_objects_with_other_materials_on_one_mesh_have_their_own(scene):  # noqa: F811
    one = box("One", Moving(0.3).material)
    two = box("Two", data=one.data)
    two.material_slots[0].link = "OBJECT"
    two.material_slots[0].material = Moving(-0.2, name="Other").material
    three = box("Three", data=one.data)
    three.scale = (2, 1, -3)
    result = export()
    assert len(result.scene.geometries) == 2 and not result.notes
    for name, height in (("One", 0.3), ("Two", -0.2), ("Three", 0.3)):
        want = CORNERS * (1 + height * OUT)
        np.testing.assert_allclose(mesh_of(result, name).vertices, want, atol=1e-6)
    assert mesh_of(result, "One") is mesh_of(result, "Three")


def test_what_depends_on_the_place_is_worked_out_for_each(scene):  # noqa: F811
    """World space: 0.3 in the world, along the normals of the world."""
    one = box("One", Moving(0.3, space="WORLD").material)
    two = box("Two", data=one.data)
    two.scale, two.location = (2, 2, -2), (5, 0, 0)
    result = export()
    assert len(result.scene.geometries) == 2
    np.testing.assert_allclose(
        mesh_of(result, "One").vertices, CORNERS * (1 + 0.3 * OUT), atol=1e-6
    )
    np.testing.assert_allclose(
        mesh_of(result, "Two").vertices, CORNERS * (1 + 0.15 * OUT), atol=1e-6
    )


def test_instances_are_displaced_as_the_first_of_them(scene):  # noqa: F811
    """Which is told where it matters."""
    moving = Moving(0.3)
    leaf = box("Leaf", moving.material)
    parent = box("Parent", bpy.data.materials.new("Still"))
    parent.instance_type, leaf.parent = "VERTS", parent
    result = export()
    assert len(result.scene.geometries) == 2 and not result.notes
    moving.node.space = "WORLD"
    (note,) = export().notes
    assert "displaced as the first of them" in note and "Leaf" in note


def test_vectors_linked_straight_to_the_output_are_of_the_world(scene):  # noqa: F811
    moving = Moving()
    color = moving.tree.nodes.new("ShaderNodeCombineXYZ")
    for name, value in zip("XYZ", (0.1, 0.2, 0.4), strict=True):
        color.inputs[name].default_value = value
    moving.tree.links.new(color.outputs[0], moving.output.inputs["Displacement"])
    cube = box("Box", moving.material)
    cube.scale = (2, 1, 1)
    np.testing.assert_allclose(mesh_of(export()).vertices, CORNERS + (0.05, 0.2, 0.4), atol=1e-6)


def test_attributes_uv_and_images_are_read_at_vertices(scene):  # noqa: F811
    moving = Moving()
    image = bpy.data.images.new("Height", 2, 1, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels = [0.25, 0.25, 0.25, 1, 0.5, 0.5, 0.5, 1]
    texture = moving.height("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    cube = box("Box", moving.material)
    layer = cube.data.uv_layers.new(name="map")
    vertex = np.empty(24, np.int32)
    cube.data.loops.foreach_get("vertex_index", vertex)
    uv = np.where(CORNERS[vertex, 2:] > 0, 0.75, 0.25) * [1, 0]
    layer.data.foreach_set("uv", uv.astype(np.float32).ravel())
    moved = np.linalg.norm(mesh_of(export()).vertices, axis=1) - np.sqrt(3)
    np.testing.assert_allclose(moved, np.where(CORNERS[:, 2] > 0, 0.5, 0.25), atol=1e-6)
    node = moving.height("ShaderNodeAttribute", "Fac")
    node.attribute_name = "lift"
    lift = cube.data.attributes.new("lift", "FLOAT", "POINT")
    lift.data.foreach_set("value", np.arange(8, dtype=np.float32) / 8)
    result = export()
    moved = np.linalg.norm(mesh_of(result).vertices, axis=1) - np.sqrt(3)
    np.testing.assert_allclose(moved, np.arange(8) / 8, atol=1e-6)
    assert not result.scene.textures and not mesh_of(result).attributes


def test_what_is_not_finite_stays_where_it_was(scene):  # noqa: F811
    moving = Moving()
    node = moving.height("ShaderNodeAttribute", "Fac")
    node.attribute_name = "lift"
    power = moving.tree.nodes.new("ShaderNodeMath")
    power.operation = "POWER"
    power.inputs[0].default_value = 1e30
    moving.tree.links.new(node.outputs["Fac"], power.inputs[1])
    moving.tree.links.new(power.outputs[0], moving.node.inputs["Height"])
    cube = box("Box", moving.material)
    lift = cube.data.attributes.new("lift", "FLOAT", "POINT")
    lift.data.foreach_set("value", np.array([0, 0, 0, 0, 40, 1, 0, 0], np.float32))
    result = export()
    moved = np.linalg.norm(mesh_of(result).vertices, axis=1) - np.sqrt(3)
    np.testing.assert_allclose(moved, [1, 1, 1, 1, 0, 0, 1, 1], atol=1e-6)
    (note,) = result.notes
    assert "not finite" in note and "Box" in note


def test_spheres_cameras_and_adaptive_subdivision_are_told(scene):  # noqa: F811
    moving = Moving()
    coordinates = moving.tree.nodes.new("ShaderNodeTexCoord")
    moving.tree.links.new(coordinates.outputs["Window"], moving.node.inputs["Height"])
    bpy.ops.mesh.primitive_uv_sphere_add()
    ball = bpy.context.object
    ball.data.materials.append(moving.material)
    mark_sphere(ball.data)
    cube = box("Box", moving.material)
    adaptive = cube.modifiers.new("Subdivision", "SUBSURF")
    own = adaptive if hasattr(adaptive, "use_adaptive_subdivision") else cube.cycles
    own.use_adaptive_subdivision = True
    notes = "\n".join(export().notes)
    assert "True spheres are not displaced" in notes and "does not know the camera" in notes
    assert "Adaptive subdivision is not rendered: 'Box'" in notes


def engine_of(scene):  # noqa: F811
    return SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )


def bend(cube) -> None:
    """A shape key that lifts the cube by 2 from frame 1 to 21."""
    cube.shape_key_add(name="Basis")
    key = cube.shape_key_add(name="Up")
    key.data.foreach_set("co", (CORNERS + (0, 0, 2)).astype(np.float32).ravel())
    for frame, value in ((1, 0.0), (21, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    straighten(cube.data.shape_keys.animation_data.action)


def test_a_mesh_that_bends_stays_displaced(scene):  # noqa: F811
    """By what displaces it at the frame."""
    bend(box("Box", Moving().material))
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    scene.frame_set(5)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    result = export()
    out = CORNERS * (1 + 0.3 * OUT)
    [found], notes = with_motion(
        (result.scene,), engine_of(scene), depsgraph, displaced=result.displaced
    )
    mesh = next(g for g in found.geometries if isinstance(g, Mesh))
    assert notes == () and mesh.normals.domain == POINT
    lifts = 2 * (np.array([4.75, 5, 5.25]) - 1) / 20
    np.testing.assert_allclose(mesh.motion, [out + (0, 0, lift) for lift in lifts], atol=1e-6)
    np.testing.assert_allclose(mesh.normal_motion, [mesh.normals.values] * 3, atol=1e-6)
    scene.render.use_motion_blur = False
    [found], _ = with_neighbours(
        (result.scene,), engine_of(scene), depsgraph, displaced=result.displaced
    )
    before = found.neighbours[0].geometries[0].vertices
    np.testing.assert_allclose(before, out + (0, 0, 0.3), atol=1e-6)


def test_the_viewport_follows_every_edit(scene, tmp_path):  # noqa: F811
    moving, placed = Moving(), Moving(space="WORLD", name="Placed")
    noise = moving.height("ShaderNodeTexNoise")
    image = bpy.data.images.new("Height", 2, 2)
    image.filepath_raw, image.file_format = str(tmp_path / "height.png"), "PNG"
    image.save()
    texture = placed.height("ShaderNodeTexImage")
    texture.image = image
    cube, other = box("Box", moving.material), box("Other", placed.material)
    other.data.uv_layers.new(name="map")
    lone = bpy.data.objects.new("Lone", cube.data)
    with Follower() as follower:

        def edited(edit) -> bool:
            before = follower.scene.geometries
            edit()
            follower.check()
            after = follower.scene.geometries
            return any(one is not two for one, two in zip(before, after, strict=False))

        assert edited(lambda: setattr(noise.inputs["Scale"], "default_value", 3.0))
        assert not edited(lambda: setattr(cube, "location", (1, 2, 3)))
        assert edited(lambda: setattr(other, "scale", (2, 1, 1)))
        assert not edited(lambda: setattr(moving.shader.inputs[0], "default_value", (1, 0.5, 0, 1)))
        assert not edited(lambda: setattr(placed.shader.inputs[0], "default_value", (1, 0.5, 0, 1)))
        assert edited(
            lambda: (setattr(cube.data.vertices[0], "co", (-2, -1, -1)), cube.data.update())
        )
        assert edited(lambda: (image.pixels.foreach_set([0.5] * 16), image.update_tag()))
        assert edited(lambda: setattr(moving.material, "displacement_method", "BOTH"))
        assert edited(lambda: setattr(moving.material, "displacement_method", "BUMP"))
        edited(lambda: link(lone))
        assert edited(lambda: setattr(moving.material, "displacement_method", "DISPLACEMENT"))
        assert edited(lambda: setattr(placed.node, "space", "OBJECT"))
        assert not edited(lambda: setattr(other, "scale", (1, 3, 1)))
