"""Strands and true spheres that move within their objects while the shutter is open."""

import bpy
import numpy as np
import pytest

from export_support import Shader, link, scene  # noqa: F401
from glint.addon.export.geometry.shapes import mark_sphere
from glint.addon.export.shader_nodes.reader import FIBRE
from glint.engine import Settings, render
from glint.engine.scene import Mesh, Spheres, Strands
from test_hair import curves, furry
from test_object_motion import block_of, blurred, fly, read, straighten  # noqa: F401


def node_group(thing, kinds: tuple[str, ...], links, **values):
    """Geometry nodes on a thing. links: of numbers of nodes with numbers or names of sockets."""
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    nodes = [group.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput", *kinds)]
    for a, out, b, into in links:
        group.links.new(nodes[a].outputs[out], nodes[b].inputs[into])
    thing.modifiers.new("Nodes", "NODES").node_group = group
    return nodes


def leaning(thing, first: tuple = ()) -> None:
    """Each point goes along x with the frame, by its z."""
    kinds = ("GeometryNodeSetPosition", "GeometryNodeInputPosition", "ShaderNodeSeparateXYZ",
             "GeometryNodeInputSceneTime", "ShaderNodeMath", "ShaderNodeCombineXYZ",
             *first)  # fmt: skip
    links = [(2, 0, 1, 0), (3, 0, 4, 0), (4, 2, 6, 0), (5, "Frame", 6, 1), (6, 0, 7, 0),
             (7, 0, 2, "Offset")]  # fmt: skip
    links += [(0, 0, 8, 0), (8, 0, 2, 0)] if first else [(0, 0, 2, 0)]
    node_group(thing, kinds, links)[6].operation = "MULTIPLY"


def geometry_of(found, name: str, kind: type):
    blocks = [b for b in found.instances if b.name == name]
    shapes = [found.geometries[b.geometry] for b in blocks]
    return next(shape for shape in shapes if isinstance(shape, kind))


def upright(count: int = 4) -> list:
    return [np.linspace([x, 0, 0], [x, 0, 1], 3) for x in np.linspace(-1, 1, count)]


def drawn_alike(found) -> np.ndarray:
    """The picture of the core, which the reference draws too."""
    plan = {"samples": 4, "filter_width": 0.0, "passes": frozenset()}
    native, truth = (
        render(found, Settings(backend=backend, **plan)).combined.astype(np.float64)
        for backend in ("NATIVE", "NUMPY")
    )
    assert (np.abs(native - truth).max(-1) > 1e-4).mean() < 0.01
    return native


def test_curves(blurred):  # noqa: F811
    thing = curves("Fur", upright(), np.full(12, 0.02))
    leaning(thing)
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    strands = geometry_of(found, "Fur", Strands)
    z = strands.vertices[:, 2]
    assert z.max() == 1.0 and notes == ()
    for k, frame in enumerate((4.75, 5.0, 5.25)):
        own = strands.vertices[:, 0] + z * (frame - 5.0)
        np.testing.assert_allclose(strands.motion[k, :, 0], own, atol=1e-5)
    np.testing.assert_allclose(strands.motion[1], strands.vertices, atol=1e-6)
    assert strands.radius_motion is None
    assert block_of(found, "Fur").motion is None


def test_steps_and_switches(blurred):  # noqa: F811
    more, off = curves("More", upright()), curves("Off", upright())
    leaning(more)
    leaning(off)
    more.cycles.motion_steps, off.cycles.use_deform_motion = 2, False
    bpy.context.scene.frame_set(5)
    found, _ = read(blurred)
    assert len(geometry_of(found, "More", Strands).motion) == 5
    assert geometry_of(found, "Off", Strands).motion is None


def test_radii(blurred):  # noqa: F811
    thing = curves("Fur", upright(), np.full(12, 0.02))
    kinds = "GeometryNodeSetCurveRadius", "GeometryNodeInputSceneTime"
    node_group(thing, kinds, [(0, 0, 2, 0), (3, "Frame", 2, "Radius"), (2, 0, 1, 0)])
    bpy.context.scene.frame_set(5)
    strands = geometry_of(read(blurred)[0], "Fur", Strands)
    np.testing.assert_allclose(strands.radius_motion[:, 0], [4.75, 5.0, 5.25], rtol=1e-6)


def test_what_stands_still_has_no_motion(blurred):  # noqa: F811
    """Particle hair far from the origin is told as float32 of the world."""
    curves("Fur", upright())
    bpy.ops.mesh.primitive_plane_add()
    cloud = bpy.context.object
    cloud.name = "Cloud"
    node_group(cloud, ("GeometryNodeMeshToPoints",), [(0, 0, 2, 0), (2, 0, 1, 0)])
    hairy = furry()
    hairy.name = "Hairy"
    fly(hairy, first=(900.0, 70.0, 0.1), last=(920.0, 70.0, 0.1))
    fly(hairy, "rotation_euler", first=(0.0, 0.0, 0.0), last=(1.0, 2.0, 3.0))
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    assert notes == ()
    assert all(g.motion is None for g in found.geometries)
    assert {type(g) for g in found.geometries} == {Mesh, Strands, Spheres}
    assert all(b.motion is not None for b in found.instances if b.name == "Hairy")


def test_hair_follows_the_mesh_that_it_grows_on(blurred):  # noqa: F811
    thing = furry(count=30)
    thing.shape_key_add(name="Basis")
    key = thing.shape_key_add(name="Up")
    for point in key.data:
        point.co.z += 20.0
    for frame, value in ((1, 0.0), (21, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    straighten(thing.data.shape_keys.animation_data.action)
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    hair = geometry_of(found, thing.name, Strands)
    assert notes == ()
    rise = hair.motion[:, :, 2] - hair.vertices[:, 2]
    np.testing.assert_allclose(rise, np.broadcast_to([[-0.25], [0], [0.25]], rise.shape), atol=1e-4)
    assert geometry_of(found, thing.name, Mesh).motion is not None


def test_points_and_marked_spheres(blurred):  # noqa: F811
    bpy.ops.mesh.primitive_plane_add(location=(0, 0, 0))
    cloud = bpy.context.object
    cloud.name = "Cloud"
    for number, vertex in enumerate(cloud.data.vertices):
        vertex.co.z = number
    leaning(cloud, ("GeometryNodeMeshToPoints",))
    bpy.ops.mesh.primitive_uv_sphere_add()
    ball = bpy.context.object
    ball.name = "Ball"
    mark_sphere(ball.data)
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Big")
    for point in key.data:
        point.co *= 21.0
    for frame, value in ((1, 0.0), (21, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    straighten(ball.data.shape_keys.animation_data.action)
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    assert notes == ()
    points = geometry_of(found, "Cloud", Spheres)
    way = points.motion[:, :, 0] - points.centers[:, 0]
    expected = np.array([[-0.25], [0], [0.25]]) * points.centers[:, 2]
    np.testing.assert_allclose(way, expected, atol=1e-5)
    sphere = geometry_of(found, "Ball", Spheres)
    np.testing.assert_allclose(sphere.radius_motion[:, 0], [4.75, 5.0, 5.25], rtol=1e-4)


def test_other_numbers_of_points_are_told(blurred):  # noqa: F811
    thing = curves("Fur", upright())
    kinds = "GeometryNodeResampleCurve", "GeometryNodeInputSceneTime"
    node_group(thing, kinds, [(0, 0, 2, "Curve"), (3, "Frame", 2, "Count"), (2, 0, 1, 0)])
    blurred.render.motion_blur_shutter = 2.0
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    assert geometry_of(found, "Fur", Strands).motion is None
    assert any("change their number of points while" in note and "Fur" in note for note in notes)


@pytest.mark.parametrize("shader", ["ShaderNodeBsdfHair", "ShaderNodeBsdfHairPrincipled"])
def test_tangents_turn_along(blurred, shader):  # noqa: F811
    """Light of lobes round the tangent, in both tracers."""
    thing = curves("Fur", upright(7), np.full(21, 0.1))
    leaning(thing)
    material = Shader(shader=shader)
    thing.data.materials.append(material.material)
    lamp = link(bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN")))
    lamp.rotation_euler = (1.0, 0.3, 0.0)
    camera = blurred.camera
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3.0
    camera.location, camera.rotation_euler = (0, -5, 0.5), (np.pi / 2, 0, 0)
    blurred.render.resolution_x = blurred.render.resolution_y = 32
    blurred.render.motion_blur_shutter = 2.0
    bpy.context.scene.frame_set(1)
    found, _ = read(blurred)
    strands = geometry_of(found, "Fur", Strands)
    (tangents,) = (a for a in strands.attributes if a.name == FIBRE)
    for k, frame in enumerate((0.0, 1.0, 2.0)):
        expected = np.array([frame, 0, 1]) / np.hypot(frame, 1)
        mine = tangents.motion[k, :, :3] * np.sign(tangents.motion[k, :, 2:3])
        np.testing.assert_allclose(mine, np.broadcast_to(expected, mine.shape), atol=1e-4)
    assert drawn_alike(found)[..., :3].max() > 0.01
