"""Depth of field against Cycles at many samples, and Cycles' own shapes of the aperture."""

from math import radians
from types import SimpleNamespace

import numpy as np
import pytest

import cycles_reference as cycles
import small_scenes as build
from glint.addon.render.motion import with_motion
from glint_picture import render_glint

SIDE = 48
CYCLES_SAMPLES = 1024
CAMERAS = {
    "perspective": ({"lens": 50.0}, {"aperture_fstop": 0.05}),
    "blades": (
        {"lens": 35.0, "shift_x": 0.05},
        {
            "aperture_fstop": 0.03,
            "aperture_blades": 5,
            "aperture_rotation": radians(20),
            "aperture_ratio": 1.7,
        },
    ),
    "ortho": (
        {"type": "ORTHO", "ortho_scale": 5.0},
        {"aperture_fstop": 2.0, "aperture_blades": 3, "aperture_rotation": radians(-35)},
    ),
}


def build_scene(name: str):
    """Something before, in and behind the plane of focus, which an object sets."""
    scene = cycles.empty_scene(SIDE, SIDE)
    build.still_life(scene)
    lens, aperture = CAMERAS[name]
    camera = build.add_camera(scene, **lens)
    build.add_light(scene, "SUN", (3.0, -2.0, 4.5), energy=2.0)
    cycles.bpy.context.view_layer.update()
    focus = cycles.bpy.data.objects.new("Focus", None)
    # beside the view's axis: only its depth counts
    focus.matrix_world = camera.matrix_world @ camera.matrix_world.Translation((1.0, 2.0, -7.5))
    scene.collection.objects.link(focus)
    camera.data.dof.use_dof = True
    camera.data.dof.focus_object = focus
    for key, value in aperture.items():
        setattr(camera.data.dof, key, value)
    return scene


@pytest.mark.parametrize("name", CAMERAS)
def test_depth_of_field(name):
    scene = build_scene(name)
    film = render_glint(scene, "NATIVE", samples=256, filter_width=0.0)
    glint = film.passes["Combined"][..., :3].astype(np.float64)
    truth = cycles.render_cycles(scene, CYCLES_SAMPLES)["Combined"][..., :3].astype(np.float64)
    error = np.sqrt(((glint - truth) ** 2).mean()) / truth.mean()
    assert error <= 0.02


@pytest.mark.parametrize("position", ["CENTER", "START"])
def test_motion_of_the_camera(position):
    scene = build_scene("perspective")
    camera = scene.camera
    camera.data.dof.use_dof = False
    for frame, step in ((1, 0.0), (3, 0.6)):
        camera.location.x, camera.rotation_euler.z = (
            camera.location.x + step,
            camera.rotation_euler.z + step / 10,
        )
        camera.keyframe_insert("location", frame=frame)
        camera.keyframe_insert("rotation_euler", frame=frame)
    scene.frame_set(2)
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter = True, 1.0
    render.motion_blur_position = position
    engine = SimpleNamespace(
        is_preview=False,
        frame_set=lambda frame, subframe: scene.frame_set(frame, subframe=subframe),
    )
    depsgraph = cycles.bpy.context.evaluated_depsgraph_get()
    film = render_glint(
        scene,
        "NATIVE",
        edit=lambda read: with_motion((read,), engine, depsgraph)[0][0],
        samples=256,
        filter_width=0.0,
    )
    glint = film.passes["Combined"][..., :3].astype(np.float64)
    truth = cycles.render_cycles(scene, 1024)["Combined"][..., :3].astype(np.float64)
    error = np.sqrt(((glint - truth) ** 2).mean()) / truth.mean()
    assert error <= 0.02
