"""The pass Vector against Cycles, at the pixels' centres."""

from types import SimpleNamespace

import numpy as np
import pytest

import cycles_reference as cycles
from glint.addon.export import export_scene
from glint.addon.render.neighbours import with_neighbours
from glint.engine import Settings, render
from small_scenes import add, cube, moved
from test_cycles_motion import build_scene, key, straighten

bpy = cycles.bpy
PIXELS = 1e-3
PUSH = 0.05


def zooming(scene) -> None:
    key(scene.camera.data, "lens", 40.0, 60.0)
    straighten()


def parallel(scene) -> None:
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6.0


def shifted(scene) -> None:
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.3, -0.1
    scene.render.resolution_x, scene.camera.data.sensor_fit = 64, "VERTICAL"


def instanced(scene) -> None:
    """A cube on each of the four corners of a plane that turns."""
    bpy.ops.mesh.primitive_plane_add(size=2.0)
    corners = bpy.context.object
    child = add(scene, "child", cube(), moved(0, 0, 0, 0.3, 0.2, 0.4))
    child.parent, corners.instance_type = corners, "VERTS"
    key(corners, "rotation_euler", (0.0, 0.0, 0.0), (0.3, 0.0, 1.0))
    straighten()


def panorama(kind: str):
    def change(scene) -> None:
        data = scene.camera.data
        data.type = "PANO"
        (data if hasattr(data, "panorama_type") else data.cycles).panorama_type = kind

    return change


CHANGES = {
    "slide-turn": ("slide-turn", lambda scene: None),
    "stretch": ("stretch", lambda scene: None),
    "shape": ("shape", lambda scene: None),
    "velocity": ("velocity", lambda scene: None),
    "camera": ("camera-too", lambda scene: None),
    "zoom": ("camera-too", zooming),
    "parallel": ("slide-turn", parallel),  # not with a camera that moves: Cycles' is a perspective
    "shifted": ("camera-too", shifted),
    "instances": ("camera-too", instanced),
    "equirectangular": ("camera-too", panorama("EQUIRECTANGULAR")),
    "fisheye": ("camera-too", panorama("FISHEYE_EQUISOLID")),
    "cylinder": ("camera-too", panorama("CENTRAL_CYLINDRICAL")),
}


def glints(scene) -> dict[str, np.ndarray]:
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [read], notes = with_neighbours((export_scene(depsgraph).scene,), engine, depsgraph)
    assert notes == ()
    return render(read, Settings(samples=1, passes=frozenset({"Vector", "Position"}))).passes


@pytest.mark.parametrize("name", CHANGES)
def test_cycles_has_the_same_vectors(name: str) -> None:
    base, change = CHANGES[name]
    scene = build_scene(base, "CENTER")
    change(scene)
    scene.render.use_motion_blur = False
    scene.frame_set(2)
    bpy.context.view_layer.use_pass_vector = True
    glint, truth = glints(scene), cycles.render_cycles(scene)
    same = np.abs(glint["Position"] - truth["Position"]).max(-1) < 1e-3
    assert same.mean() > 0.99
    assert np.abs(truth["Vector"]).max() > 1
    assert np.abs(glint["Vector"] - truth["Vector"])[same].max() < PIXELS


def test_cycles_has_none_with_motion_blur() -> None:
    scene = build_scene("slide-turn", "CENTER")
    bpy.context.view_layer.use_pass_vector = True
    assert not cycles.render_cycles(scene)["Vector"].any()


def pushed(thing, by: float, first: str) -> None:
    """Geometry nodes that push each point of a thing along x, by how far it is up and the frame;
    first: what becomes of it before.
    """
    group = bpy.data.node_groups.new("Push", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = (
        "NodeGroupInput", "GeometryNodeSetPosition", "NodeGroupOutput", "GeometryNodeInputPosition",
        "ShaderNodeSeparateXYZ", "GeometryNodeInputSceneTime", "ShaderNodeMath", "ShaderNodeMath",
        "ShaderNodeCombineXYZ",
    )  # fmt: skip
    given, push, out, at, parts, time, product, scaled, offset = map(group.nodes.new, kinds)
    product.operation = scaled.operation = "MULTIPLY"
    scaled.inputs[1].default_value = by
    for source, target in (
        (given.outputs[0], push.inputs["Geometry"]), (push.outputs[0], out.inputs[0]),
        (at.outputs[0], parts.inputs[0]), (parts.outputs[2], product.inputs[0]),
        (time.outputs["Frame"], product.inputs[1]), (product.outputs[0], scaled.inputs[0]),
        (scaled.outputs[0], offset.inputs[0]), (offset.outputs[0], push.inputs["Offset"]),
    ):  # fmt: skip
        group.links.new(source, target)
    if first:
        made = group.nodes.new(first)
        made.inputs["Radius"].default_value = 0.2
        group.links.new(given.outputs[0], made.inputs[0])
        group.links.new(made.outputs[0], push.inputs["Geometry"])
    thing.modifiers.new("Push", "NODES").node_group = group


def before_a_camera(make):
    scene = cycles.empty_scene(48, 48)
    thing = bpy.data.objects.new("Thing", make())
    scene.collection.objects.link(thing)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    camera.location, camera.rotation_euler = (0, -9, 0), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene, thing


def strands():
    data = bpy.data.hair_curves.new("Hair")
    data.add_curves([5] * 6)
    x, z = np.repeat(np.linspace(-1.2, 1.2, 6), 5), np.tile(np.linspace(-1.4, 1.4, 5), 6)
    places = np.column_stack([x + 0.1 * np.sin(3 * z), np.zeros(30), z]).astype(np.float32)
    data.attributes["position"].data.foreach_set("vector", places.ravel())
    data.attributes.new("radius", "FLOAT", "POINT")
    data.attributes["radius"].data.foreach_set("value", np.full(30, 0.08, np.float32))
    return data


def points():
    x, z = np.meshgrid(np.linspace(-1.4, 1.4, 6), np.linspace(-1.4, 1.4, 6))
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata(np.column_stack([x.ravel(), np.zeros(36), z.ravel()]).tolist(), [], [])
    return mesh


def moving_within(make, first: str = ""):
    """The scene at a frame with the pass Vector."""
    scene, thing = before_a_camera(make)
    scene.cycles_curves.shape = "THICK"
    pushed(thing, PUSH, first)
    scene.frame_set(2)
    bpy.context.view_layer.use_pass_vector = True
    return scene


def test_strands_that_move_within_their_objects() -> None:
    """Cycles has their middles: a radius aside the push is another by up to a tenth of it."""
    scene = moving_within(strands)
    glint, truth = glints(scene)["Vector"], cycles.render_cycles(scene)["Vector"]
    both = (np.abs(glint).max(-1) > 0) & (np.abs(truth).max(-1) > 0)
    assert both.sum() > 0.9 * (np.abs(truth).max(-1) > 0.01).sum() > 100
    assert np.abs(truth).max() > 0.5
    assert np.percentile(np.abs(glint - truth)[both], 95) < 0.1
    tracers = [render_vector(scene, backend) for backend in ("NATIVE", "NUMPY")]
    np.testing.assert_allclose(*tracers, atol=1e-5)


def test_points_that_move_within_their_objects() -> None:
    """In closed form: those of Cycles 5.0.1 come from the origin of their object, and go there."""
    scene = moving_within(points, "GeometryNodeMeshToPoints")
    tracers = [render_vector(scene, backend) for backend in ("NATIVE", "NUMPY")]
    np.testing.assert_allclose(*tracers, atol=1e-5)
    z, centers = (np.arange(48) + 0.5) / 12 - 2, np.linspace(-1.4, 1.4, 6)
    up = centers[np.abs(z[:, None] - centers).argmin(1)]
    seen = np.abs(tracers[0]).max(-1) > 0
    assert seen.sum() > 400
    for k in (0, 2):
        expected = np.broadcast_to(-PUSH * up[:, None] * 12, seen.shape)
        np.testing.assert_allclose(tracers[0][..., k][seen], expected[seen], atol=1e-4)
    assert not tracers[0][..., (1, 3)][seen].round(4).any()


def render_vector(scene, backend: str) -> np.ndarray:
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [read], _ = with_neighbours((export_scene(depsgraph).scene,), engine, depsgraph)
    settings = Settings(samples=1, passes=frozenset({"Vector"}), backend=backend)
    return render(read, settings).passes["Vector"]


def test_hair_that_gets_other_points_is_told() -> None:
    """Its curves have a point more each frame; it stands still."""
    scene, thing = before_a_camera(strands)
    group = bpy.data.node_groups.new("More", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    kinds = ("NodeGroupInput", "GeometryNodeResampleCurve", "NodeGroupOutput",
             "GeometryNodeInputSceneTime")  # fmt: skip
    given, more, out, time = map(group.nodes.new, kinds)
    group.links.new(given.outputs[0], more.inputs["Curve"])
    group.links.new(more.outputs[0], out.inputs[0])
    group.links.new(time.outputs["Frame"], more.inputs["Count"])
    thing.modifiers.new("More", "NODES").node_group = group
    scene.frame_set(6)
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [read], notes = with_neighbours((export_scene(depsgraph).scene,), engine, depsgraph)
    assert len(notes) == 1 and "number of points" in notes[0] and "Thing" in notes[0]
    settings = Settings(samples=1, passes=frozenset({"Vector"}))
    assert not render(read, settings).passes["Vector"].any()
