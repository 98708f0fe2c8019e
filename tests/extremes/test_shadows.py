"""N4, N8-N11: shadow rays that start on a surface, end on one, or run along one."""

from __future__ import annotations

from math import cos, radians, sin

import numpy as np
import pytest

import extreme_scenes as extreme
import small_scenes as build
from glint_picture import render_glint
from measuring import measure, wrong_pixels
from truth import true_picture

TILT = np.linalg.qr(np.array([[1.0, 0.1, 0.2], [-0.1, 1, 0.13], [-0.2, -0.1, 1]]))[0] * [
    -1.0,
    -1.0,
    1.0,
]
CONVEX = {
    "plane": lambda: build.plane(16.0, extreme.grey()),
    "tilted grid": lambda: extreme.grid_mesh(9, 14.0, material=extreme.grey(), turn=TILT),
    "convex mesh": lambda: convex_ball(),
}
QUICK = {(30.0, 0), (89.5, 0), (89.5, 1e6)}
ACNE = [
    pytest.param(shape, angle, shift, marks=[] if (angle, shift) in QUICK else pytest.mark.slow)
    for shape in CONVEX
    for angle in (30.0, 60.0, 80.0, 89.5)
    for shift in (0, 1e3, 1e6)
]


def convex_ball():
    """A flat-shaded ball of radius 14 as 560 triangles and quads."""
    data = build.ball(28, 20, False, extreme.grey())
    for vertex in data.vertices:
        vertex.co *= 14.0
    return data


@pytest.mark.parametrize(("shape", "angle", "shift"), ACNE)
def test_no_acne(shape, angle, shift, rows):
    """N4: nothing here can be in shadow of anything but itself, so that the truth is the picture
    without shadows. angle: of the sun from the zenith, in degrees.
    """
    scene = extreme.new_scene()
    offset = np.round(shift * np.array([1.0, -0.3, 0.2]))
    build.add(scene, "Shape", CONVEX[shape](), extreme.moved_to((0, 0, 0), 1.0, offset))
    sun = build.add_light(scene, "SUN", (sin(radians(angle)), 0, cos(radians(angle))), energy=2.0)
    assert sun.data.use_shadow
    camera = build.add_camera(scene, extreme.EYE, (0, 0, 0), clip_end=1000.0)
    camera.matrix_world = (
        extreme.moved_to(extreme.EYE, 1.0, offset) @ camera.matrix_world.to_3x3().to_4x4()
    )
    row = measure(
        rows,
        "N4",
        f"{shape}, sun {angle:g}° from the zenith, at {shift:g}",
        scene,
        true_picture(scene, cast_shadow=False),
    )
    assert row.glint == 0


@pytest.mark.parametrize("degrees", [89.0, 89.9, 89.999, 89.9999])
def test_grazing_sun_keeps_its_cosine(degrees, rows):
    """N8: radiance albedo E cos θ / π with cos θ from the sun's matrix as Blender holds it. Film's
    float32 adds 6e-8.
    """
    scene = extreme.new_scene()
    build.add(scene, "Floor", build.plane(100.0, extreme.grey(1.0)))
    sun = build.add_light(
        scene, "SUN", (sin(radians(degrees)), 0, cos(radians(degrees))), energy=3.0
    )
    build.add_camera(scene, (0, 0, 9), (0, 0, 0))
    truth = true_picture(scene)
    axis = np.array(sun.matrix_world, float)[:3, 2]
    cosine = axis[2] / np.linalg.norm(axis)
    assert cosine == pytest.approx(cos(radians(degrees)), rel=0.2)
    truth[..., :3] = sun.data.energy * cosine / np.pi
    row = measure(rows, "N8", f"sun {degrees:g}° from the zenith", scene, truth)
    assert row.glint == 0
    assert row.glint_error <= 1e-6


LAMP_PLACES = {
    "on the floor": (-1.3, -9.7, 0.0),
    "1e-6 above the floor": (-1.3, -9.7, 1e-6),
    "at a cube's corner": (-2.0, -1.0, 9.0),
    "in the middle of a face": (-6.0, -1.0, 5.0),
    "inside of a closed cube": (-6.0, 2.0, 5.0),
}


@pytest.mark.parametrize("place", LAMP_PLACES)
def test_lamp_that_touches(place, rows):
    """N9: shadow segments are open, so that a lamp on a surface lights whatever it sees."""
    scene = extreme.still_life()
    scene.objects["Light"].matrix_world = build.moved(*LAMP_PLACES[place])
    truth = true_picture(scene)
    assert (truth[..., :3].max() > 0) == ("inside" not in place)
    assert measure(rows, "N9", f"lamp {place}", scene, truth).glint == 0


def test_lamp_and_camera_in_a_closed_room(rows):
    """N9: inside, everything but the lamp's own shadows is lit."""
    scene = extreme.still_life()
    build.add(scene, "Room", build.cube(extreme.grey()), build.moved(0, 0, 18, 60, 60, 20))
    assert (
        measure(rows, "N9", "lamp and camera in a closed room", scene, true_picture(scene)).glint
        == 0
    )


CONTACTS = [
    pytest.param(
        kind, sunk, turned, window, marks=[] if window in (1.0, 1e-4) else pytest.mark.slow
    )
    for kind in ("SUN", "POINT")
    for sunk in (0.0, 0.3)
    for turned in (False, True)
    for window in (1.0, 1e-1, 1e-2, 1e-3, 1e-4)
]


@pytest.mark.parametrize(("kind", "sunk", "turned", "window"), CONTACTS)
def test_contact(kind, sunk, turned, window, rows):
    """N10: a parallel view, `window` across, of where a cube meets the floor; `turned`: with all of
    it askew. SUN: from behind the cube; POINT: a lamp inside of it. Everything in view is in the
    shadow: what is lit has leaked.
    """
    from mathutils import Matrix

    scene = extreme.new_scene()
    build.add(scene, "Floor", build.plane(9.0, extreme.grey()))
    build.add(scene, "Cube", build.cube(extreme.grey()), build.moved(0.3, 0.2, 1.0 - sunk))
    if kind == "SUN":
        build.add_light(scene, "SUN", (0.2, 1.0, 0.9), energy=2.0)
    else:
        build.add_light(scene, "POINT", (0.3, 0.2, 0.5), energy=100.0)
    contact = np.array([0.41, -0.8, 0.0])
    build.add_camera(
        scene, tuple(contact + (0.3, -5.0, 4.0)), tuple(contact), type="ORTHO", ortho_scale=window
    )
    if turned:
        for item in scene.objects:
            item.matrix_world = (
                Matrix.Rotation(0.37, 4, "X") @ Matrix.Rotation(0.9, 4, "Z") @ item.matrix_world
            )
    truth = true_picture(scene)
    assert truth[..., :3].max() == 0 and (truth[..., 3] == 1).all()
    how = (
        f"{'sunk in' if sunk else 'on'} a floor{', askew' if turned else ''}, "
        f"{'sun behind' if kind == 'SUN' else 'lamp inside'}"
    )
    assert measure(rows, "N10", f"cube {how}, view {window:g}", scene, truth).glint == 0


@pytest.mark.parametrize(("segments", "rings"), [(8, 5), (12, 8), (24, 16)])
def test_smooth_coarse_ball(segments, rings, rows):
    """N11: of a convex mesh no triangle that faces the sun is in shadow. Beyond, where a triangle
    turns away and its normals do not, any choice is a choice: there the picture is the float64
    tracer's.
    """
    scene = extreme.new_scene()
    build.add(scene, "Ball", build.ball(segments, rings, True, extreme.grey()))
    build.add_light(scene, "SUN", (1.0, -0.3, 0.4), energy=2.0)
    build.add_camera(scene, (0.3, -3.6, 1.2), (0, 0, 0))
    whole, bare = true_picture(scene), true_picture(scene, cast_shadow=False)
    data = scene.objects["Ball"].data
    data.polygons.foreach_set("use_smooth", np.zeros(len(data.polygons), bool))
    facing = true_picture(scene, cast_shadow=False)[..., 0] > 0
    data.polygons.foreach_set("use_smooth", np.ones(len(data.polygons), bool))
    judged = facing & (bare[..., 0] > 0)
    assert judged.sum() > 2000
    row = measure(rows, "N11", f"smooth ball of {segments} × {rings}: acne", scene, bare, judged)
    assert row.glint == 0
    assert wrong_pixels(render_glint(scene, "NATIVE").combined, whole).sum() == 0
