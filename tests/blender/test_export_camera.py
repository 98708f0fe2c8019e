"""The camera's frame, window and border against Blender's own projection and its own border."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Euler, Matrix, Vector

from export_support import export, link, mesh_object, scene  # noqa: F401
from glint.addon.export import ExportError, Looker
from glint.addon.export.camera import border, crossed, inverse_axes
from glint.engine.scene import Camera
from glint.engine.scene.panorama import Eye

PROPERTY = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def pixel_of(camera: Camera, point) -> np.ndarray:
    """(2,) float64 pixel coordinates of a world point by the exported camera alone."""
    axes, eye = camera.world_from_camera[:, :3], camera.world_from_camera[:, 3]
    u, v, w = np.linalg.solve(axes, np.asarray(point, np.float64) - eye)
    if camera.kind == "PERSPECTIVE":
        u, v = u / -w, v / -w
    left, right, bottom, top = camera.window
    return (
        np.array([(u - left) / (right - left), (v - bottom) / (top - bottom)]) * camera.resolution
    )


def _blenders_pixel(scene, point) -> np.ndarray:  # noqa: F811
    found = world_to_camera_view(scene, scene.camera, Vector(point))
    return np.array([found.x * scene.render.resolution_x, found.y * scene.render.resolution_y])


lenses = st.fixed_dictionaries(
    {
        "type": st.sampled_from(["PERSP", "ORTHO"]),
        "lens": st.floats(5, 300),
        "ortho_scale": st.floats(0.01, 100),
        "sensor_fit": st.sampled_from(["AUTO", "HORIZONTAL", "VERTICAL"]),
        "sensor_width": st.floats(5, 70),
        "sensor_height": st.floats(5, 70),
        "shift_x": st.floats(-2, 2),
        "shift_y": st.floats(-2, 2),
    }
)
frames = st.fixed_dictionaries(
    {
        "resolution_x": st.integers(4, 400),
        "resolution_y": st.integers(4, 400),
        "pixel_aspect_x": st.floats(1, 3),
        "pixel_aspect_y": st.floats(1, 3),
    }
)
unit = st.floats(-1, 1)


def _set(thing, values) -> None:
    for name, value in values.items():
        setattr(thing, name, value)


@PROPERTY
@given(lens=lenses, frame=frames, point=st.tuples(unit, unit, unit))
def test_the_window_is_blenders(scene, lens, frame, point):  # noqa: F811
    """Blender works its view frame out in float32: a few ulps of the window's largest number, in
    pixels, is all that may differ.
    """
    _set(scene.camera.data, lens)
    _set(scene.render, frame)
    camera = export().scene.camera
    spot = (point[0], 2 + point[1], point[2])
    window = np.abs(camera.window)
    cells = np.array(
        [
            window[:2].max() / (camera.window[1] - camera.window[0]),
            window[2:].max() / (camera.window[3] - camera.window[2]),
        ]
    )
    ours, theirs = pixel_of(camera, spot), _blenders_pixel(scene, spot)
    size = np.array(camera.resolution)
    tolerance = 16 * np.finfo(np.float32).eps * size * (1 + cells + np.abs(theirs / size))
    assert (np.abs(ours - theirs) <= tolerance).all()


@PROPERTY
@given(lens=lenses, frame=frames)
def test_the_corners_are_those_of_the_view_frame(scene, lens, frame):  # noqa: F811
    _set(scene.camera.data, lens)
    _set(scene.render, frame)
    corners = np.array([corner[:] for corner in scene.camera.data.view_frame(scene=scene)])
    camera = export().scene.camera
    plane = corners[:, :2] / (-corners[:, 2:] if camera.kind == "PERSPECTIVE" else 1)
    left, right, bottom, top = camera.window
    tolerance = 16 * np.finfo(np.float32).eps * np.abs(camera.window).max()
    np.testing.assert_allclose(
        [plane[:, 0].min(), plane[:, 0].max()], [left, right], rtol=0, atol=tolerance
    )
    np.testing.assert_allclose(
        [plane[:, 1].min(), plane[:, 1].max()], [bottom, top], rtol=0, atol=tolerance
    )


def test_the_window_by_hand(scene):  # noqa: F811
    """36 mm on 50 mm across 64 pixels, shifted by a quarter of the sensor; half as wide pixels as
    high.
    """
    scene.camera.data.shift_x = 0.25
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1, 1
    np.testing.assert_allclose(
        export().scene.camera.window, (-0.36 + 0.18, 0.36 + 0.18, -0.27, 0.27), rtol=1e-7
    )
    scene.camera.data.sensor_fit, scene.camera.data.shift_x = "VERTICAL", 0
    np.testing.assert_allclose(export().scene.camera.window, (-0.32, 0.32, -0.24, 0.24), rtol=1e-7)


@pytest.mark.parametrize("scale", [(2, 2, 2), (1, 3, 0.5), (-1, 1, 1), (1, 1, -2)])
def test_scale_does_not_count_but_mirroring_does(scene, scale):  # noqa: F811
    turn = Euler((1, 0.2, 3)).to_matrix()
    scene.camera.matrix_world = Matrix.LocRotScale((1, 2, 3), turn, Vector(scale))
    frame = export().scene.camera.world_from_camera
    np.testing.assert_allclose(frame[:, :3], np.array(turn) * np.sign(scale), atol=1e-6)
    np.testing.assert_allclose(frame[:, 3], (1, 2, 3))


def test_clip_and_resolution(scene):  # noqa: F811
    scene.camera.data.clip_start, scene.camera.data.clip_end = 0.25, 77
    scene.render.resolution_percentage = 33
    camera = export().scene.camera
    assert (camera.clip_start, camera.clip_end, camera.resolution) == (0.25, 77, (21, 15))
    assert export(width=7, height=9).scene.camera.resolution == (7, 9)


def test_no_border_no_region(scene):  # noqa: F811
    assert export().region is None


class _Rectangles(bpy.types.RenderEngine):
    """Tells how large a result Blender makes for a border."""

    bl_idname = "GLINT_TEST_BORDER"
    bl_label = "Border"
    seen: list[tuple[int, int]] = []

    def render(self, depsgraph):
        size = border(depsgraph.scene.render, (self.resolution_x, self.resolution_y))
        width, height = size[2] - size[0], size[3] - size[1]
        result = self.begin_result(0, 0, width, height)
        pixels = len(result.layers[0].passes["Combined"].rect)
        self.end_result(result)
        self.seen.append((pixels, width * height))


@pytest.mark.parametrize(
    "edges",
    [
        (0.1, 0.2, 0.7, 0.9),
        (0.0, 0.0, 1.0, 1.0),
        (0.333, 0.25, 0.667, 0.75),
        (0.3, 0.7, 0.31, 0.72),
    ],
)
@pytest.mark.parametrize("crop", [False, True])
def test_the_border_is_blenders_rectangle(scene, edges, crop):  # noqa: F811
    bpy.utils.register_class(_Rectangles)
    try:
        render = scene.render
        render.engine, render.use_border, render.use_crop_to_border = (
            _Rectangles.bl_idname,
            True,
            crop,
        )
        render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y = edges
        render.resolution_x, render.resolution_y = 203, 117
        x0, y0, x1, y1 = export().region
        bpy.ops.render.render()
        assert _Rectangles.seen[-1][0] == _Rectangles.seen[-1][1] == (x1 - x0) * (y1 - y0)
        assert 0 <= x0 < x1 <= 203
        assert 0 <= y0 < y1 <= 117
    finally:
        bpy.utils.unregister_class(_Rectangles)


def test_bad_cameras_are_errors(scene):  # noqa: F811
    scene.camera.matrix_world = Matrix.Translation((np.nan, 0, 0))
    with pytest.raises(ExportError, match="not finite"):
        export()
    scene.camera.matrix_world = Matrix.Diagonal((1, 0, 1, 1))
    with pytest.raises(ExportError, match="scaled to nothing"):
        export()
    scene.camera = None
    with pytest.raises(ExportError, match="no camera"):
        export()


@pytest.mark.parametrize(
    "change", [{"type": "ORTHO", "ortho_scale": 0}, {"shift_x": 1e30}, {"shift_y": np.inf}], ids=str
)
def test_a_view_of_no_width_is_an_error_that_names_the_camera(scene, change):  # noqa: F811
    for name, value in change.items():
        setattr(scene.camera.data, name, value)
    with pytest.raises(ExportError, match="Camera 'Camera' has a view of no width"):
        export()


@pytest.mark.parametrize("clip", [(200, 100), (1, 1), (np.nan, 100)])
def test_a_clip_range_that_shows_nothing_is_an_error_that_names_the_camera(scene, clip):  # noqa: F811
    scene.camera.data.clip_start, scene.camera.data.clip_end = clip
    with pytest.raises(ExportError, match="Camera 'Camera' shows nothing: its clip start"):
        export()


def test_an_empty_border_is_an_error(scene):  # noqa: F811
    scene.render.use_border, scene.render.border_min_x, scene.render.border_max_x = True, 0.5, 0.5
    with pytest.raises(ExportError, match="border"):
        export()


def test_what_the_camera_cannot_do_is_noted(scene):  # noqa: F811
    assert export().notes == ()
    dof = scene.camera.data.dof
    scene.render.use_motion_blur, dof.use_dof, dof.focus_distance = True, True, 0
    assert len(export().notes) == 1


def panorama(scene, **values):  # noqa: F811
    """Blender 5 keeps these at the camera, those before it among Cycles' own."""
    data = scene.camera.data
    data.type = "PANO"
    here = data if hasattr(data, "panorama_type") else data.cycles
    for name, value in values.items():
        setattr(here, name, value)


def test_a_panorama_has_blenders_numbers(scene):  # noqa: F811
    scene.camera.data.shift_x, scene.camera.data.sensor_width = 0.25, 30
    panorama(scene, panorama_type="FISHEYE_EQUISOLID", fisheye_lens=9, fisheye_fov=2.5)
    camera = export().scene.camera
    assert camera.kind == "PANORAMA" and camera.window == (0.25, 1.25, 0.0, 1.0)
    seen = camera.panorama
    assert (seen.projection, seen.lens, seen.fov) == ("FISHEYE_EQUISOLID", 9, 2.5)
    assert camera.eye is None
    np.testing.assert_allclose(seen.sensor, (30, 30 * 48 / 64))


def test_a_panorama_of_nothing_is_an_error(scene):  # noqa: F811
    panorama(scene, panorama_type="EQUIRECTANGULAR", longitude_min=1.0, longitude_max=1.0)
    with pytest.raises(ExportError, match=r"Camera 'Camera': .* spans nothing"):
        export()


@pytest.mark.parametrize("kind", ["PERSP", "PANO"])
def test_spherical_stereo(scene, kind):  # noqa: F811
    data = scene.camera.data
    data.type, data.stereo.interocular_distance = kind, 0.5
    data.stereo.convergence_mode, data.stereo.convergence_distance = "OFFAXIS", 3.0
    looker = Looker(scene.camera, np.array(scene.camera.matrix_world, np.float64), 0.0, -1)
    found = export(looker=looker)
    assert not found.notes and found.scene.camera.eye == Eye(-0.25, 3.0)
    data.stereo.use_pole_merge, data.stereo.convergence_mode = True, "PARALLEL"
    merge = data.stereo.pole_merge_angle_from, data.stereo.pole_merge_angle_to
    assert export(looker=replace(looker, side=1)).scene.camera.eye == Eye(0.25, np.inf, merge)
    assert export(looker=replace(looker, side=0)).scene.camera.eye is None


def test_an_eye_may_see_what_is_beside_the_frame(scene):  # noqa: F811
    mesh_object("face", [(0, 0, 0), (1, 0, 0), (0, 0, 1)], [(0, 1, 2)])
    scene.camera.location.x += 200
    assert any("sees no object" in note for note in export().notes)
    looker = Looker(scene.camera, np.array(scene.camera.matrix_world, np.float64), 0.0, -1)
    assert not export(looker=looker).notes


def test_looking_through_a_spot_light_takes_in_its_cone(scene):  # noqa: F811
    light = bpy.data.lights.new("Spot", "SPOT")
    light.spot_size = np.pi / 2
    scene.camera = link(bpy.data.objects.new("Spot", light))
    camera = export().scene.camera
    # 18 / 16, as Cycles' lens for lights
    np.testing.assert_allclose(camera.window[:2], (-1.125, 1.125), rtol=1e-6)


def test_inverse_of_axes():
    """Of unit axes, mirrored and sheared ones among them."""
    rng = np.random.default_rng(3)
    for axes in rng.normal(size=(50, 3, 3)):
        axes /= np.linalg.norm(axes, axis=0)
        closeness = 1e-15 * np.linalg.cond(axes) ** 2
        assert np.abs(inverse_axes(axes) @ axes - np.eye(3)).max() < 10 * closeness


@pytest.mark.parametrize(("kind", "length"), [("PERSP", 0.08), ("ORTHO", 1.0)])
def test_depth_of_field(scene, kind, length):  # noqa: F811
    data = scene.camera.data
    data.type, data.lens = kind, 80.0
    assert export().scene.camera.lens is None
    dof = data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop, dof.aperture_blades = True, 3.0, 1.4, 6
    dof.aperture_rotation, dof.aperture_ratio = 0.5, 1.5
    result = export()
    lens = result.scene.camera.lens
    found = lens.radius, lens.focus, lens.blades, lens.rotation, lens.ratio
    np.testing.assert_allclose(found, (length / 2.8, 3.0, 6, 0.5, 1.5), rtol=1e-6)
    assert result.notes == ()


def test_a_focus_object_is_as_far_as_it_is_along_the_view(scene):  # noqa: F811
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_object = True, link(bpy.data.objects.new("Focus", None))
    dof.focus_object.location, scene.camera.scale = (4, 1.5, -3), (2, 2, 2)
    assert export().scene.camera.lens.focus == pytest.approx(7.5, rel=1e-6)


def test_a_bone_may_be_in_focus(scene):  # noqa: F811
    armature = bpy.data.armatures.new("Rig")
    rig = link(bpy.data.objects.new("Rig", armature))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = armature.edit_bones.new("Head")
    bone.head, bone.tail = (0, 2.0, 0), (0, 2.0, 1.0)
    bpy.ops.object.mode_set(mode="OBJECT")
    dof = scene.camera.data.dof
    dof.use_dof, dof.focus_object, dof.focus_subtarget = True, rig, "Head"
    assert export().scene.camera.lens.focus == pytest.approx(8.0, rel=1e-6)


def test_extreme_apertures(scene):  # noqa: F811
    dof = scene.camera.data.dof
    dof.use_dof, dof.aperture_fstop = True, 0.001
    assert export().scene.camera.lens.radius == pytest.approx(25.0, rel=1e-4)
    dof.aperture_fstop = 0.0
    assert export().scene.camera.lens.radius == pytest.approx(2500.0, rel=1e-4)
    dof.focus_distance = 0.0
    [note] = export().notes
    assert "'Camera' is focused on its own place" in note


@pytest.mark.parametrize("name", ["focus_distance", "aperture_fstop", "aperture_rotation"])
def test_an_aperture_that_is_not_finite_is_told(scene, name):  # noqa: F811
    dof = scene.camera.data.dof
    dof.use_dof = True
    setattr(dof, name, float("nan"))
    assert not np.isfinite(getattr(dof, name))
    result = export()
    assert result.scene.camera.lens is None and "not finite" in result.notes[0]


def test_cross_products_are_numpys_to_the_bit():
    pairs = (
        np.random.default_rng(1).normal(0, 1, (200, 2, 3))
        * 10.0 ** np.arange(-100, 100)[:, None, None]
    )
    assert [crossed(a, b) for a, b in pairs] == [tuple(np.cross(a, b)) for a, b in pairs]
