"""N12: every number of Blender's camera at its ends."""

from __future__ import annotations

from math import radians, tan

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from measuring import measure
from truth import true_picture

PLACE, AIM = (1.5, -2.0, 3.0), (2.5, 1.0, 2.0)
CELLS = 11


def wall_in_view(distance: float, **camera):
    """A relief that fills most of the view of a camera with these properties, in a plane across the
    view; under a sun. It is turned, so that no edge runs through the centres of a row or a diagonal
    of pixels, where both sides would be right.
    """
    from mathutils import Matrix

    scene = extreme.new_scene()
    item = build.add_camera(scene, PLACE, AIM, **camera)
    data = item.data
    orthographic = data.type == "ORTHO"
    half = data.ortho_scale / 2 if orthographic else data.sensor_width / 2 / data.lens * distance
    center = 2 * half * data.shift_x, 2 * half * data.shift_y
    cell = 1.6 * half / CELLS
    heights = min(0.4 * cell, 0.3 * distance) * np.random.default_rng(7).uniform(
        -1, 1, (CELLS + 1, CELLS + 1)
    )
    relief = extreme.grid_mesh(CELLS, 0.8 * half, heights, extreme.grey())
    place = extreme.moved_to((*center, -distance)) @ Matrix.Rotation(0.31, 4, "Z")
    extreme.add_parented(scene, "Wall", relief, item.matrix_world @ place)
    sun = build.add_light(scene, "SUN", (0, 0, 1), energy=2.0)
    sun.matrix_world = item.matrix_world.to_3x3().to_4x4() @ build.looking_at(
        (0.5, 0.4, 1.0), (0, 0, 0)
    )
    return scene


def check(rows, case: str, scene) -> None:
    truth = true_picture(scene)
    assert (truth[..., :3].sum(-1) > 0).mean() > 0.3
    assert (truth[..., 3] == 0).sum() > 50
    assert measure(rows, "N12", case, scene, truth).glint == 0


@pytest.mark.parametrize("degrees", [0.01, 1.0, 90.0, 170.0, 179.9])
def test_field_of_view(degrees, rows):
    """A lens of 1 mm behind a wide sensor, or a long one."""
    half = tan(radians(degrees / 2))
    lens = (
        {"lens": 1.0, "sensor_width": 2 * half}
        if 2 * half > 1
        else {"lens": 18 / half, "sensor_width": 36.0}
    )
    check(rows, f"field of view {degrees:g}°", wall_in_view(2.0, **lens))


@pytest.mark.parametrize("shift", [(0.5, -0.5), (10.0, 3.0), (100.0, 0.0)])
def test_shift(shift, rows):
    check(
        rows,
        f"shift {shift[0]:g}, {shift[1]:g}",
        wall_in_view(2.0, shift_x=shift[0], shift_y=shift[1]),
    )


@pytest.mark.parametrize("exponent", [-6, -3, 0, 3, 6])
def test_orthographic(exponent, rows):
    width = 10.0**exponent
    scene = wall_in_view(
        2.0 * width, type="ORTHO", ortho_scale=width, clip_start=width, clip_end=1e7
    )
    check(rows, f"orthographic, 1e{exponent} across", scene)


@pytest.mark.parametrize("clip", [(1e-6, 1e30), (1e-6, 1e3), (1.0, 1e30), (40.0, 50.0)])
def test_clip(clip, rows):
    scene = extreme.still_life()
    scene.camera.data.clip_start, scene.camera.data.clip_end = clip
    assert (
        measure(rows, "N12", f"clip {clip[0]:g} to {clip[1]:g}", scene, true_picture(scene)).glint
        == 0
    )


@pytest.mark.parametrize(
    "scale",
    [(-1.0, 1.0, 1.0), (1e-4, 1e-4, 1e-4), (1e4, 1e4, 1e4), (1.0, 1e3, 1e-3), (1.0, -1.0, 1.0)],
)
def test_scaled_camera(scale, rows):
    scene = extreme.still_life()
    scene.camera.data.clip_start, scene.camera.data.clip_end = 1e-6, 1e30
    scene.camera.scale = scale
    assert (
        measure(
            rows,
            "N12",
            f"camera scaled by {scale[0]:g}, {scale[1]:g}, {scale[2]:g}",
            scene,
            true_picture(scene),
        ).glint
        == 0
    )
