"""The camera's keys while the shutter is open."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from export_support import export, link, quad, scene  # noqa: F401
from glint.addon.render.motion import shutter_times, with_motion


def read(scene):  # noqa: F811
    """The exported scene as a final render has it."""
    return with_notes(scene)[0]


def told(scene):  # noqa: F811
    """The notes of that."""
    return with_notes(scene)[1]


def with_notes(scene):  # noqa: F811
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = bpy.context.evaluated_depsgraph_get()
    [found], notes = with_motion((export().scene,), engine, depsgraph)
    return found, notes


@pytest.fixture
def moving(scene):  # noqa: F811
    """A camera that moves by (1, 0, 0) a frame and is scaled; a surface that stands still."""
    quad("Quad")
    camera = scene.camera
    camera.scale = (2, 2, 2)
    for frame in (1, 21):
        camera.location = (frame, -6, 0)
        camera.keyframe_insert("location", frame=frame)
    curves = camera.animation_data.action
    slots = curves.layers[0].strips[0].channelbags[0] if hasattr(curves, "layers") else curves
    for curve in slots.fcurves:
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"
    scene.frame_set(5)
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.5
    return scene


@pytest.mark.parametrize(("position", "first"), [("CENTER", 4.75), ("START", 5.0), ("END", 4.5)])
def test_keys_are_where_the_camera_is_while_the_shutter_is_open(moving, position, first):
    moving.render.motion_blur_position = position
    camera = read(moving).camera
    found = camera.motion[:, 0, 3]
    np.testing.assert_allclose(found, first + np.array([0, 0.25, 0.5]), rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(camera.motion[:, :, :3], axis=1), 1, rtol=1e-6)
    assert moving.frame_current_final == 5.0
    assert camera.world_from_camera[0, 3] == pytest.approx(5.0)


@pytest.mark.parametrize("subframe", [0.0, 0.25])
@pytest.mark.parametrize(("old", "new"), [(100, 50), (50, 100), (100, 100)])
def test_the_shutter_runs_by_the_frames_that_time_remapping_stretches(moving, old, new, subframe):
    """As in Cycles, and the scene is at its frame again."""
    moving.render.frame_map_old, moving.render.frame_map_new = old, new
    moving.frame_step = 3
    moving.frame_set(5, subframe=subframe)
    frames = 5 + subframe + np.array([-0.25, 0, 0.25])
    np.testing.assert_allclose(read(moving).camera.motion[:, 0, 3], frames * old / new, rtol=1e-6)
    assert (moving.frame_current, moving.frame_subframe) == (5, subframe)


def test_a_camera_that_stands_still_has_no_motion(moving):
    moving.camera.animation_data_clear()
    assert read(moving).camera.motion is None


def test_without_motion_blur_there_is_no_motion(moving):
    moving.render.use_motion_blur = False
    assert read(moving).camera.motion is None


def test_a_shutter_of_no_time_is_no_motion(moving):
    moving.render.motion_blur_shutter = 0.0
    assert shutter_times(5.0, 0.0, "CENTER") == [5.0] * 3
    still = read(moving).camera.motion
    assert still is None or np.abs(still - still[0]).max() == 0


@pytest.mark.parametrize("shutter", [float("nan"), float("inf"), 1e10])
def test_a_shutter_without_a_number_blurs_nothing_and_is_told(moving, shutter):
    moving.render.motion_blur_shutter = shutter
    assert read(moving).camera.motion is None
    [note] = told(moving)
    assert "shutter is longer than a million frames" in note


def test_a_camera_bound_to_another_frame_is_not_this_one(moving):
    other = link(bpy.data.objects.new("Other", bpy.data.cameras.new("Other")))
    other.location = (100, 0, 0)
    for frame, camera in ((1, moving.camera), (6, other)):
        moving.timeline_markers.new(f"{frame}", frame=frame).camera = camera
    moving.render.motion_blur_position, moving.render.motion_blur_shutter = "START", 1.0
    np.testing.assert_allclose(read(moving).camera.motion[:, 0, 3], [5, 5.5, 6], rtol=1e-6)


def test_a_shutter_curve_is_followed(moving):
    assert read(moving).camera.shutter is None
    first, last = moving.render.motion_blur_shutter_curve.curves[0].points[:2]
    first.location, last.location = (0.0, 0.0), (1.0, 1.0)
    for point in (first, last):
        point.handle_type = "VECTOR"
    moving.render.motion_blur_shutter_curve.update()
    moving.update_tag()
    opening = read(moving).camera.shutter
    np.testing.assert_allclose(opening, np.linspace(0, 1, len(opening)), atol=0.01)


def test_a_shutter_that_never_opens_is_told(moving):
    for point in moving.render.motion_blur_shutter_curve.curves[0].points:
        point.location = (point.location[0], 0.0)
    moving.render.motion_blur_shutter_curve.update()
    assert read(moving).camera.shutter is None
    assert any("never opens" in note for note in told(moving))


@pytest.mark.parametrize(
    ("kind", "setting", "said"),
    [("PERSP", "lens", True), ("ORTHO", "ortho_scale", False), ("PERSP", "shift_x", False)],
)
def test_a_zoom_while_the_shutter_is_open_is_told(moving, kind, setting, said):
    data = moving.camera.data
    data.type = kind
    for frame, value in ((1, 2.0), (21, 9.0)):
        setattr(data, setting, value)
        data.keyframe_insert(setting, frame=frame)
    moving.frame_set(5)
    assert any("zoom" in note and "'Camera'" in note for note in told(moving)) == said
