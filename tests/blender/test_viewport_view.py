"""The camera of a 3D view from Blender's matrices: checked with projections made by Blender itself
and by hand.
"""

import bpy
import numpy as np
import pytest

from glint.addon.export.camera import export_camera
from glint.addon.export.report import Report
from glint.addon.viewport import bounds
from glint.addon.viewport.pacing import BUDGET, LONGEST_WAIT, Motion, Pacer
from glint.addon.viewport.redraws import LOOK, Redraws
from glint.addon.viewport.view import clip_of, frame_of, view_camera, window_of
from glint.engine.scene import Camera, Instances, Mesh, Scene

SIZE = (96, 54)


def blenders_camera(**settings):
    """A camera object with these settings of its data, and Blender's own projection of it,
    float32.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    data = bpy.data.cameras.new("Camera")
    for name, value in settings.items():
        setattr(data, name, value)
    thing = bpy.data.objects.new("Camera", data)
    thing.location, thing.rotation_euler = (1, -6, 2), (1.2, 0.1, 0.3)
    bpy.context.scene.collection.objects.link(thing)
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    return thing, np.array(thing.calc_matrix_camera(depsgraph, x=SIZE[0], y=SIZE[1]), np.float64)


KINDS = [
    {"type": "PERSP", "lens": 35.0, "clip_start": 0.1, "clip_end": 50.0},
    {"type": "PERSP", "lens": 85.0, "shift_x": 0.3, "shift_y": -0.2, "sensor_fit": "VERTICAL"},
    {"type": "ORTHO", "ortho_scale": 7.0, "shift_x": -0.1, "clip_start": 1.0, "clip_end": 30.0},
]


@pytest.mark.parametrize("settings", KINDS)
def test_a_projection_gives_back_the_window_and_the_clip_distances(settings):
    """Blender's projection in float32 against the export's own formula in float64."""
    thing, projection = blenders_camera(**settings)
    camera = export_camera(thing, bpy.context.scene.render, SIZE, Report())
    np.testing.assert_allclose(window_of(projection), camera.window, rtol=2**-20, atol=2**-20)
    np.testing.assert_allclose(clip_of(projection), (camera.clip_start, camera.clip_end), rtol=2e-3)


@pytest.mark.parametrize("settings", KINDS)
@pytest.mark.parametrize("pixel_size", [1, 2, 4])
def test_points_of_the_screen_are_points_of_rays(settings, pixel_size):
    """A point on the ray of a traced pixel's centre projects to the middle of the screen pixels
    that it stands for.
    """
    thing, projection = blenders_camera(**settings)
    view = np.linalg.inv(np.array(thing.matrix_world, np.float64))
    pixels = tuple(-(-extent // pixel_size) for extent in SIZE)
    camera = view_camera(projection, np.linalg.inv(view)[:3], pixels, SIZE, pixel_size)
    left, right, bottom, top = camera.window
    for i, j in ((0, 0), (5, 7), (pixels[0] - 1, pixels[1] - 1)):
        u, v = (
            left + (i + 0.5) * (right - left) / pixels[0],
            bottom + (j + 0.5) * (top - bottom) / pixels[1],
        )
        x, y, z, e = camera.world_from_camera.T
        depth = 3.0
        point = e + (u * x + v * y) * (depth if camera.kind == "PERSPECTIVE" else 1.0) - depth * z
        clip = projection @ view @ [*point, 1.0]
        screen = (clip[:2] / clip[3] + 1) / 2 * SIZE
        np.testing.assert_allclose(screen, (np.array([i, j]) + 0.5) * pixel_size, atol=1e-3)


def test_a_view_that_shows_the_render_one_to_one_is_known():
    frame = Camera("PERSPECTIVE", np.eye(4)[:3], (-0.4, 0.4, -0.3, 0.3), (80, 60))
    step = 0.01
    around = (-0.4 - 7 * step, 0.4 + 9 * step, -0.3 - 5 * step, 0.3 + 3 * step)
    assert frame_of(around, (96, 68), frame) == (7, 5)
    assert frame_of(frame.window, (80, 60), frame) == (0, 0)
    assert frame_of(tuple(np.float32(edge) for edge in around), (96, 68), frame) == (7, 5), (
        "float32 rounding is no other place"
    )
    assert frame_of(tuple(edge + 0.3 * step for edge in around), (96, 68), frame) is None, (
        "between the pixels"
    )
    assert frame_of(tuple(edge * 1.01 for edge in around), (96, 68), frame) is None, "another size"


def test_a_parallel_view_steps_up_to_the_scene():
    """Blender's eye stands behind by the clip distance: the same rays from just before the scene,
    what was in front stays in front.
    """
    mesh = Mesh(
        "Mesh",
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32),
        np.array([[0, 1, 2]], np.uint32),
    )
    scene = Scene(
        Camera("PERSPECTIVE", np.eye(4)[:3], (-1, 1, -1, 1), (1, 1)),
        (mesh,),
        (Instances("Mesh", 0, np.eye(4)[None, :3], ()),),
    )
    above = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1000]])
    away = Camera("ORTHOGRAPHIC", above, (-1, 1, -1, 1), (4, 4), 0.0, 2000.0)
    near = bounds.stepped_up(away, scene)
    step = 1000 - near.world_from_camera[2, 3]
    assert 0 < near.world_from_camera[2, 3] <= 2 and near.clip_end == away.clip_end - step
    inside = bounds.stepped_up(
        Camera("ORTHOGRAPHIC", np.eye(4)[:3], (-1, 1, -1, 1), (4, 4), 0.0, 10.0), scene
    )
    assert inside.world_from_camera[2, 3] == 0, "a scene that begins at the eye needs no step"


def taught(seconds, pixels):
    """A pacer that has seen pictures of so many pixels take so long."""
    pacer = Pacer(rate=0.0)
    for _ in range(30):
        pacer.note(pixels, 1, seconds, 0.0, 0.002)
    return pacer


def test_pictures_while_moving_fit_into_their_time():
    pixels = 960 * 540
    pacer = taught(0.001, 1000)
    divisor = pacer.divisor(pixels)
    assert pacer.seconds(pixels / divisor**2) <= BUDGET * 1.001
    assert pacer.seconds(pixels / (divisor - 1) ** 2) > BUDGET, "no coarser than it takes"
    assert Pacer(rate=1e-12).divisor(pixels) == 1
    assert pacer.note(0, 1, 1.0, 0.0, None) is None and pacer.divisor(pixels) == divisor, (
        "an empty picture teaches nothing"
    )


def test_coarse_pictures_tell_what_fine_ones_take():
    """Milliseconds measured on 62 000 triangles: the divisor does not depend on which of them were
    seen.
    """
    divisors = {
        taught(seconds, pixels).divisor(960 * 540)
        for pixels, seconds in ((518400, 0.082), (129600, 0.032), (14400, 0.007))
    }
    assert max(divisors) - min(divisors) <= 1


def test_whole_pictures_are_traced_in_motion_where_coarse_ones_would_delay_them():
    pacer, pixels = taught(0.09, 518400), 518400
    assert not pacer.prefers_whole(pixels, 0.01), (
        "after a coarse picture and a fast redraw the whole one is in time"
    )
    assert pacer.prefers_whole(pixels, 0.08)
    assert not taught(0.2, 518400).prefers_whole(pixels, 0.08), "it would be late by itself"


def test_a_view_that_moves_slower_than_before_is_about_to_stop():
    motion, now, x = Motion(), 0.0, 0.0
    for _ in range(5):
        now, x = now + 0.08, x + 0.4
        assert not motion.slows(np.array([x, 0.0]), now), "it moves evenly"
    now, x = now + 0.04, x + 0.2
    assert not motion.slows(np.array([x, 0.0]), now), (
        "the redraw took less time, and the view was no slower"
    )
    assert not motion.slows(np.array([x, 0.0]), now + 0.01), "what does not move says nothing"
    now, x = now + 0.08, x + 0.2
    assert motion.slows(np.array([x, 0.0]), now)
    assert not motion.slows(np.array([x + 0.4, 0.0]), now + 0.08), "it goes on"
    assert not motion.slows(np.zeros(3), now + 1), "another kind of view"


def test_pixels_are_shaded_at_once_where_that_was_fast():
    pacer = Pacer()
    assert not pacer.shades_in_time(1), "nothing is known yet"
    pacer.note_shading(1000, 1e-4)
    assert pacer.shades_in_time(400_000) and not pacer.shades_in_time(600_000)
    for _ in range(30):
        pacer.note_shading(1000, 2e-4)
    assert pacer.shades_in_time(200_000) and not pacer.shades_in_time(300_000)


class Clock:
    """Seconds that pass only when told."""

    def __init__(self):
        self.now = 5.0

    def __call__(self):
        return self.now

    def wait(self, seconds):
        self.now += seconds


def redrawn(redraws, clock, seconds, views=1):
    """A redraw in which every view waits as long as it may; how long each did."""
    waited = []
    for _ in range(views):
        redraws.begin()
        redraws.wait(lambda most: waited.append(most) or clock.wait(most), is_patient=False)
    clock.wait(seconds)
    redraws.end()
    return waited


def test_a_view_waits_no_longer_than_a_redraw_takes():
    clock = Clock()
    redraws = Redraws(clock)
    for _ in range(40):
        redrawn(redraws, clock, 0.02)
    assert redrawn(redraws, clock, 0.02) == [pytest.approx(0.02)], (
        "waiting does not count as drawing"
    )
    for _ in range(40):
        redrawn(redraws, clock, 0.2)
    assert redrawn(redraws, clock, 0.2) == [LONGEST_WAIT]


def test_views_that_are_drawn_together_wait_together():
    clock = Clock()
    redraws = Redraws(clock)
    for _ in range(40):
        redrawn(redraws, clock, 0.02, views=4)
    assert sum(redrawn(redraws, clock, 0.02, views=4)) == pytest.approx(0.02)


def test_a_view_that_shows_nothing_waits_longer():
    waited = []
    Redraws(Clock()).wait(waited.append, is_patient=True)
    assert waited[0] > LONGEST_WAIT


def test_a_redraw_is_over_when_blender_had_time_to_begin_another():
    clock = Clock()
    redraws = Redraws(clock)
    redrawn(redraws, clock, 0.02)
    assert not redraws.is_over, "events may wait"
    clock.wait(LOOK)
    assert redraws.is_over
    redraws.begin()
    clock.wait(LOOK)
    assert not redraws.is_over


def test_redraws_without_a_pause_follow_each_other():
    clock = Clock()
    redraws = Redraws(clock)
    redrawn(redraws, clock, 0.02)
    clock.wait(0.03)
    redraws.begin()
    assert redraws.follows(1) and not redraws.follows(0)
    redraws.end()
    assert not redraws.follows(1), "nothing is being drawn"
    clock.wait(0.3)
    redraws.begin()
    assert not redraws.follows(2), "what moves has stopped in between"
