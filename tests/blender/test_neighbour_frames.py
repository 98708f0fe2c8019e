"""The frames before and after, as the pass Vector has them."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from export_support import export, link, quad, scene  # noqa: F401
from glint.addon.render.kept import keeps
from glint.addon.render.neighbours import with_neighbours
from glint.engine.scene.problems import scene_problems


def read(scene):  # noqa: F811
    """The exported scene as a final render has it, and the notes of its neighbours."""
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [found], notes = with_neighbours((export().scene,), engine, depsgraph)
    assert scene_problems(found) == []
    return found, notes


def fly(thing, path="location", values=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (3.0, 0.0, 0.0))) -> None:
    """At frames 4, 5 and 6."""
    for frame, value in zip((4, 5, 6), values, strict=True):
        setattr(thing, path, value)
        thing.keyframe_insert(path, frame=frame)
    bpy.context.scene.frame_set(5)


def places(found, name: str) -> list[float]:
    """x before, here and after."""
    scenes = (found.neighbours[0], found, found.neighbours[1])
    return [
        block.world_from_object[0, 0, 3]
        for some in scenes
        for block in some.instances
        if block.name == name
    ]


def test_what_flies_and_what_stands(scene):  # noqa: F811
    fly(quad("Flying"))
    still = quad("Still")
    still.location.x = 7.0
    found, notes = read(scene)
    assert places(found, "Flying") == [0.0, 1.0, 3.0]
    assert places(found, "Still") == [7.0] * 3
    assert notes == () and scene.frame_current_final == 5.0
    for other in found.neighbours:
        assert all(a is b for a, b in zip(other.geometries, found.geometries, strict=True))


@pytest.mark.parametrize(("old", "new"), [(100, 50), (50, 100)])
def test_neighbours_are_frames_that_time_remapping_stretches(scene, old, new):  # noqa: F811
    """As in Cycles, and the scene is at its frame again, with the camera that a marker binds."""
    fly(quad("Flying"))
    scene.render.frame_map_old, scene.render.frame_map_new = old, new
    other = link(bpy.data.objects.new("Other", bpy.data.cameras.new("Other")))
    for frame, camera in ((1, scene.camera), (7, other)):
        scene.timeline_markers.new(f"{frame}", frame=frame).camera = camera
    for frame in (2, 3, 6, 10):
        scene.frame_set(frame)
        seen = []
        for number in (frame - 1, frame, frame + 1):
            scene.frame_set(number)
            seen.append(bpy.data.objects["Flying"].matrix_world.translation.x)
        scene.frame_set(frame)
        bound = scene.camera
        found, _ = read(scene)
        assert places(found, "Flying") == pytest.approx(seen)
        assert (scene.frame_current, scene.frame_subframe) == (frame, 0)
        assert scene.camera == bound


def test_motion_blur_of_objects_is_not_asked(scene):  # noqa: F811
    """As in Cycles."""
    thing = quad("Flying")
    thing.cycles.use_motion_blur = False
    fly(thing)
    assert places(read(scene)[0], "Flying") == [0.0, 1.0, 3.0]


def test_the_camera_moves_and_zooms(scene):  # noqa: F811
    quad("Still")
    fly(scene.camera)
    fly(scene.camera.data, "lens", (36.0, 50.0, 72.0))
    before, after = (other.camera for other in read(scene)[0].neighbours)
    assert before.world_from_camera[0, 3] == 0.0 and after.world_from_camera[0, 3] == 3.0
    assert before.window[1] == pytest.approx(0.5) and after.window[1] == pytest.approx(0.25)


def test_shape_keys(scene):  # noqa: F811
    thing = quad("Bent")
    thing.shape_key_add(name="Basis")
    key = thing.shape_key_add(name="Up")
    for point in key.data:
        point.co.z += 1.0
    fly(key, "value", (0.25, 0.5, 1.0))
    found, notes = read(scene)
    heights = [
        some.geometries[0].vertices[:, 2].max()
        for some in (found.neighbours[0], found, found.neighbours[1])
    ]
    np.testing.assert_allclose(heights, [0.25, 0.5, 1.0])
    assert notes == ()


def test_a_mesh_of_other_faces_keeps_its_shape_and_is_told(scene):  # noqa: F811
    thing = quad("Built")
    build = thing.modifiers.new("Build", "SUBSURF")
    build.subdivision_type = "SIMPLE"
    fly(build, "render_levels", (0, 1, 2))
    fly(build, "levels", (0, 1, 2))
    found, notes = read(scene)
    assert all(other.geometries[0] is found.geometries[0] for other in found.neighbours)
    assert len(notes) == 1 and "Built" in notes[0] and "Vector" in notes[0]


def test_what_was_not_there_is_told(scene):  # noqa: F811
    hidden = quad("Appearing")
    for frame, value in ((4, True), (5, False)):
        hidden.hide_render = value
        hidden.hide_viewport = value
        hidden.keyframe_insert("hide_render", frame=frame)
        hidden.keyframe_insert("hide_viewport", frame=frame)
    scene.frame_set(5)
    _, notes = read(scene)
    assert len(notes) == 1 and "Appearing" in notes[0] and "stand still" in notes[0]


def hair_on(thing) -> None:
    system = thing.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system.settings
    system.type, system.count, system.hair_step = "HAIR", 20, 2


def test_hair_goes_with_its_object_and_what_follows_it_moves_too(scene):  # noqa: F811
    furry = quad("A furry one")
    hair_on(furry)
    fly(furry)
    fly(quad("B bare one"))
    found, notes = read(scene)
    assert places(found, "A furry one") == [0.0, 0.0, 1.0, 1.0, 3.0, 3.0]
    assert places(found, "B bare one") == [0.0, 1.0, 3.0]
    assert notes == ()


def test_with_motion_blur_the_pass_is_empty_and_told(scene):  # noqa: F811
    fly(quad("Flying"))
    scene.render.use_motion_blur = True
    found, notes = read(scene)
    assert found.neighbours is None
    assert len(notes) == 1 and "Vector" in notes[0] and "Motion Blur" in notes[0]


def test_frames_are_kept_but_where_scripts_hear_of_neighbours(scene):  # noqa: F811
    scene.render.use_persistent_data = True
    engine, layer = SimpleNamespace(is_preview=False), bpy.context.view_layer

    def is_kept() -> bool:
        bpy.context.view_layer.update()
        return keeps(engine, bpy.context.evaluated_depsgraph_get())

    def script(*_):
        """May change anything at a frame that no update tells of."""

    bpy.app.handlers.frame_change_post.append(script)
    try:
        assert is_kept()
        layer.use_pass_vector = True
        assert not is_kept()
    finally:
        bpy.app.handlers.frame_change_post.remove(script)
    assert is_kept()
