"""Where objects, shapes and lights are while the shutter is open."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from export_support import export, link, quad, scene  # noqa: F401
from glint.addon.export.geometry import volumes
from glint.addon.export.keys import moved, read_pose
from glint.addon.export.report import Report
from glint.addon.render.final import prepare
from glint.addon.render.motion import with_motion
from glint.addon.ui import properties
from glint.engine.scene.problems import scene_problems
from volume_files import NEEDED, fog_box, write_grids


def engine_of(scene) -> SimpleNamespace:  # noqa: F811
    """What turns to other frames, as a render engine does."""
    return SimpleNamespace(
        is_preview=False,
        resolution_x=16,
        resolution_y=16,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )


def read(scene):  # noqa: F811
    """The exported scene as a final render has it, and the notes of its motion."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [found], notes = with_motion((export().scene,), engine_of(scene), depsgraph)
    assert scene_problems(found) == []
    return found, notes


@pytest.fixture
def blurred(scene):  # noqa: F811
    """Motion blur, the shutter open from frame 4.75 to 5.25."""
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    scene.frame_set(5)
    return scene


def fly(thing, path="location", first=(0.0, 0.0, 0.0), last=(20.0, 0.0, 0.0)) -> None:
    """From frame 1 to 21, evenly."""
    for frame, value in ((1, first), (21, last)):
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)
    straighten(thing.animation_data.action)


def straighten(action) -> None:
    slots = action.layers[0].strips[0].channelbags[0] if hasattr(action, "layers") else action
    for curve in slots.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def block_of(found, name):
    return next(block for block in found.instances if block.name == name)


def test_an_object_that_flies_has_keys_and_the_others_none(blurred):
    fly(quad("Flying"))
    quad("Still")
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    block = block_of(found, "Flying")
    np.testing.assert_allclose(block.motion[:, 0, 0, 3], [3.75, 4.0, 4.25], rtol=1e-6)
    assert block.world_from_object[0, 0, 3] == pytest.approx(4.0)
    assert block_of(found, "Still").motion is None
    assert found.camera.motion is None and notes == ()
    assert all(g.motion is None for g in found.geometries)
    assert blurred.frame_current_final == 5.0


def test_without_motion_blur_or_time_there_is_no_motion(blurred):
    fly(quad("Flying"))
    blurred.render.motion_blur_shutter = 0.01
    bpy.context.scene.frame_set(5)
    assert block_of(read(blurred)[0], "Flying").motion is not None
    blurred.render.use_motion_blur = False
    assert block_of(read(blurred)[0], "Flying").motion is None


def test_steps_and_switches_of_an_object_are_kept(blurred):
    flying, off = quad("Flying"), quad("Off")
    fly(flying)
    fly(off)
    flying.cycles.motion_steps = 2
    off.cycles.use_motion_blur = False
    bpy.context.scene.frame_set(5)
    found, _ = read(blurred)
    assert len(block_of(found, "Flying").motion) == 5
    assert block_of(found, "Off").motion is None


def test_a_child_moves_with_its_parent(blurred):
    parent, child = link(bpy.data.objects.new("Parent", None)), quad("Child")
    child.parent = parent
    fly(parent)
    bpy.context.scene.frame_set(5)
    found, _ = read(blurred)
    np.testing.assert_allclose(block_of(found, "Child").motion[:, 0, 0, 3], [3.75, 4.0, 4.25])


def test_shape_keys_deform(blurred):
    thing = quad("Shape")
    thing.data.polygons[0].use_smooth = True
    thing.shape_key_add(name="Basis")
    key = thing.shape_key_add(name="Tall")
    key.data[2].co.z += 2.0
    for frame, value in ((1, 0.0), (21, 1.0)):
        key.value = value
        key.keyframe_insert("value", frame=frame)
    straighten(thing.data.shape_keys.animation_data.action)
    bpy.context.scene.frame_set(5)
    found, _ = read(blurred)
    mesh = found.geometries[block_of(found, "Shape").geometry]
    np.testing.assert_allclose(mesh.motion[:, 2, 2], [0.375, 0.4, 0.425], rtol=1e-5)
    assert mesh.normal_motion.shape == (3, *mesh.normals.values.shape)
    assert block_of(found, "Shape").motion is None
    thing.cycles.use_deform_motion = False
    thing.update_tag()
    found, _ = read(blurred)
    assert found.geometries[block_of(found, "Shape").geometry].motion is None


def test_an_armature_deforms(blurred):
    rig = link(bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig")))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = rig.data.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    thing = quad("Skin")
    thing.vertex_groups.new(name="Bone").add(range(4), 1.0, "REPLACE")
    thing.modifiers.new("Armature", "ARMATURE").object = rig
    pose = rig.pose.bones["Bone"]
    for frame, x in ((1, 0.0), (21, 20.0)):
        pose.location = (x, 0, 0)
        pose.keyframe_insert("location", frame=frame)
    straighten(rig.animation_data.action)
    bpy.context.scene.frame_set(5)
    found, _ = read(blurred)
    mesh = found.geometries[block_of(found, "Skin").geometry]
    np.testing.assert_allclose(np.diff(mesh.motion[:, 0, 0]), [0.25, 0.25], rtol=1e-4)


def test_a_mesh_whose_faces_change_keeps_its_shape_with_a_note(blurred):
    thing = quad("Array")
    array = thing.modifiers.new("Array", "ARRAY")
    for frame, count in ((4, 1), (6, 3)):
        array.count = count
        array.keyframe_insert("count", frame=frame)
    straighten(thing.animation_data.action)
    blurred.render.motion_blur_shutter = 2.0
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    assert found.geometries[block_of(found, "Array").geometry].motion is None
    assert any("number of vertices or faces changes" in note and "Array" in note for note in notes)


def test_instances_are_matched_by_who_they_are(blurred):
    """Of an instancer whose vertices move; each vertex carries its own instance."""
    carrier, child = quad("Carrier"), quad("Leaf")
    child.parent = carrier
    carrier.instance_type = "VERTS"
    fly(carrier)
    bpy.context.scene.frame_set(5)
    found, _ = read(blurred)
    block = block_of(found, "Leaf")
    assert block.motion.shape == (3, 4, 3, 4)
    steps = np.diff(block.motion[..., 3], axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to([0.25, 0, 0], (2, 4, 3)), atol=1e-6)


@pytest.mark.parametrize("gone", [False, True])
def test_instances_may_come_in_another_order(blurred, gone):
    carrier, child = quad("Carrier"), quad("Leaf")
    child.parent = carrier
    carrier.instance_type = "VERTS"
    found, report = export().scene, Report()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    here, there = read_pose(depsgraph), read_pose(depsgraph)
    leaf = next(thing for thing in there.things if thing.name == "Leaf")
    leaf.matrices, leaf.numbers = leaf.matrices[::-1] + 1.0, leaf.numbers[::-1]
    if gone:
        leaf.matrices, leaf.numbers = leaf.matrices[1:], leaf.numbers[1:]
    motion = block_of(moved(found, here, [here, here, there], report), "Leaf").motion
    lost = 3 if gone else 4  # the last of the four
    np.testing.assert_array_equal(motion[2, :lost], motion[0, :lost] + 1.0)
    np.testing.assert_array_equal(motion[2, lost:], motion[0, lost:])
    assert [note.names for note in report.notes()] == ([("Leaf",)] if gone else [])


def test_what_comes_or_goes_stands_still_with_a_note(blurred):
    thing = quad("Fading")
    fly(thing)
    for frame, hidden in ((1, False), (5, False), (6, True)):
        thing.hide_viewport = hidden
        thing.keyframe_insert("hide_viewport", frame=frame)
    blurred.render.motion_blur_shutter = 2.0
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    x = block_of(found, "Fading").motion[:, 0, 0, 3]
    np.testing.assert_allclose(x, [3.0, 4.0, 4.0], rtol=1e-6)
    assert any("not there for all" in note and "Fading" in note for note in notes)


def test_particles_move_though_others_are_born(blurred):
    rain, drop = quad("Rain"), quad("Drop")
    emission = rain.modifiers.new("P", "PARTICLE_SYSTEM").particle_system.settings
    emission.count, emission.frame_start, emission.frame_end, emission.lifetime = 40, 1, 40, 100
    emission.render_type, emission.instance_object, emission.normal_factor = "OBJECT", drop, -6
    for frame in range(1, 6):
        blurred.frame_set(frame)
    motion = next(b.motion for b in read(blurred)[0].instances if len(b.world_from_object) > 1)
    falls = np.ptp(motion[..., 2, 3], axis=0)
    assert len(falls) >= 4 and (falls[:3] > 0.01).all()


def test_a_velocity_stands_for_what_other_frames_lack(blurred):
    """Of a liquid that has other vertices in each frame."""
    thing = quad("Liquid")
    velocity = thing.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    velocity.data.foreach_set("vector", np.tile([24.0, 0, np.nan], 4).astype(np.float32))
    array = thing.modifiers.new("Array", "ARRAY")
    for frame, count in ((4, 1), (6, 3)):
        array.count = count
        array.keyframe_insert("count", frame=frame)
    blurred.render.motion_blur_shutter = 2.0
    blurred.frame_set(5)
    found, notes = read(blurred)
    mesh = found.geometries[block_of(found, "Liquid").geometry]
    steps = mesh.motion - mesh.vertices
    np.testing.assert_allclose(steps[:, :, 0], np.tile([[-1], [0], [1]], 8), atol=1e-6)
    assert (steps[:, :, 1:] == 0).all()
    assert [note.names for note in notes] == [("velocity of Liquid",)]


def test_a_rolling_shutter_is_told(blurred):
    quad("Still")
    assert read(blurred)[1] == ()
    blurred.cycles.rolling_shutter_type = "TOP"
    blurred.update_tag()
    (note,) = read(blurred)[1]
    assert "Rolling Shutter" in note


@pytest.mark.skipif(volumes.openvdb() is None, reason=NEEDED)
@pytest.mark.parametrize("names", [("velocity",), ("velocity_x", "velocity_y", "velocity_z")])
def test_velocity_grids_are_told(blurred, tmp_path, names):
    data = bpy.data.volumes.new("Smoke")
    fog = fog_box(4)
    way = np.stack([fog] * 3, -1) if len(names) == 1 else fog
    grids = {"density": fog} | dict.fromkeys(names, way)
    data.filepath = write_grids(tmp_path / "smoke.vdb", 0.25, (0, 0, 0), **grids)
    link(bpy.data.objects.new("Smoke", data))
    (note,) = (note for note in read(blurred)[1] if "Velocity grids" in note)
    assert note.names == ("Smoke",)


def test_lights_move(blurred):
    lamp = link(bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA")))
    fly(lamp)
    link(bpy.data.objects.new("Rest", bpy.data.lights.new("Rest", "POINT")))
    bpy.context.scene.frame_set(5)
    lights = {light.name: light for light in read(blurred)[0].lights}
    np.testing.assert_allclose(lights["Lamp"].motion[:, 0, 3], [3.75, 4.0, 4.25], rtol=1e-6)
    assert lights["Rest"].motion is None


def test_instances_move_beside_one_that_is_scaled_to_nothing(blurred):
    """By geometry nodes, the first of them by 0."""
    carrier = quad("Carrier")
    tree = bpy.data.node_groups.new("Row", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    line, cube, number, put, output = (
        tree.nodes.new(kind)
        for kind in (
            "GeometryNodeMeshLine",
            "GeometryNodeMeshCube",
            "GeometryNodeInputIndex",
            "GeometryNodeInstanceOnPoints",
            "NodeGroupOutput",
        )
    )
    line.inputs["Count"].default_value = 3
    for start, end in (
        (line.outputs[0], put.inputs["Points"]),
        (cube.outputs[0], put.inputs["Instance"]),
        (number.outputs[0], put.inputs["Scale"]),
        (put.outputs[0], output.inputs[0]),
    ):
        tree.links.new(start, end)
    carrier.modifiers.new("row", "NODES").node_group = tree
    fly(carrier)
    bpy.context.scene.frame_set(5)
    found, notes = read(blurred)
    (block,) = (one for one in found.instances if len(one.world_from_object) == 2)
    assert notes == ()
    np.testing.assert_allclose(block.motion[:, :, 0, 3], [[3.75] * 2, [4.0] * 2, [4.25] * 2])


@pytest.fixture
def registered():
    """Glint's settings."""
    properties.register()
    yield
    properties.unregister()


@pytest.mark.usefixtures("registered")
def test_what_is_nothing_at_the_frame_itself_is_there_when_the_shutter_opens(blurred):
    """And what is nothing all the time is left out, with its note, and so is the one beside it
    without motion blur.
    """
    growing, never = quad("Growing"), quad("Never")
    fly(growing, "scale", (-4.0,) * 3, (16.0,) * 3)
    never.scale = (0, 0, 0)
    blurred.frame_set(5)
    assert tuple(growing.evaluated_get(bpy.context.evaluated_depsgraph_get()).scale) == (0, 0, 0)
    (job,) = prepare(engine_of(blurred), bpy.context.evaluated_depsgraph_get())
    (block,) = job.scene.instances
    assert block.name == "Growing" and scene_problems(job.scene) == []
    np.testing.assert_allclose(block.motion[:, 0, 0, 0], [-0.25, 0.0, 0.25], atol=1e-7)
    assert [note for note in job.notes if "leaves no surface" in note and "Never" in note]
    assert not [note for note in job.notes if "Growing" in note or "No object is there" in note]
    blurred.collection.objects.unlink(growing)
    (job,) = prepare(engine_of(blurred), bpy.context.evaluated_depsgraph_get())
    assert job.scene.instances == ()
    assert [note for note in job.notes if "No object is there" in note]
    blurred.collection.objects.link(growing)
    blurred.render.use_motion_blur = False
    (job,) = prepare(engine_of(blurred), bpy.context.evaluated_depsgraph_get())
    assert job.scene.instances == ()
    assert [note for note in job.notes if "No object is there" in note]
