"""Section 4 of the lecture notes, Ray Tracing, second half: light, shadow and mirrors
(4.11-4.17).
"""

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import linear
from glint.engine.scene import Light, World
from notes_scenes import (
    ball,
    lambert_blinn_phong,
    lamp,
    on_plane,
    paint,
    quad,
    scene,
    view,
    viewing_rays,
    wall,
)

CAMERA = view(window=(-0.5, 1.0, -0.75, 0.5), resolution=(14, 12))
RED, BLUE = (
    lamp((1.5, 1.0, -0.5), (1.0, 0.25, 0.125), 2.0),
    lamp((-3.0, 0.5, -2.0), (0.125, 0.25, 1.0), 3.0),
)
K_D, K_S = (0.75, 0.5, 0.25), (0.5, 0.25, 0.125)


def seen_wall(camera=CAMERA, z=-3.0):
    """Points, normals and eyes of the pixels of a picture that a wall fills."""
    origins, directions = viewing_rays(camera)
    _, points = on_plane(origins, directions, (0, 0, z), (0, 0, 1))
    return points, np.broadcast_to([0.0, 0.0, 1.0], points.shape), origins


def test_4_11_direction_vectors_and_normal_of_a_curved_surface(draw):
    # A ball fills the view: normal, light and view directions differ in every pixel.
    camera = view(window=(-0.125, 0.25, -0.25, 0.125), resolution=(9, 9))
    film = draw(
        scene(
            camera,
            (ball((0, 0, -4), 2.0), paint(9.0, diffuse=K_D, specular=K_S)),
            lights=[RED, BLUE],
        ),
        "Position",
        "Normal",
    )
    origins, directions = viewing_rays(camera)
    a, half_b, c = (
        linear.dot(directions, directions),
        linear.dot(directions, origins - [0, 0, -4]),
        16.0 - 4.0,
    )
    points = origins + ((-half_b - np.sqrt(half_b**2 - a * c)) / a)[..., None] * directions
    normals = (points - [0, 0, -4]) / 2
    draw.check(film.passes["Normal"], normals)
    draw.check(
        film.combined[..., :3],
        lambert_blinn_phong(points, normals, origins, [RED, BLUE], K_D, K_S, 9.0),
    )


def test_4_12_lambertian_shading(draw):
    expected = lambert_blinn_phong(*seen_wall(), [RED], diffuse=K_D)
    assert np.min(expected) > 0
    draw.check(draw.colors(scene(CAMERA, (wall(-3.0), paint(diffuse=K_D)), lights=[RED])), expected)


def test_4_12_lambertian_shading_does_not_depend_on_the_viewer(draw):
    # The middle pixel of both views sees the same point of the wall, from two sides of its normal.
    colors = []
    for eye in ((0.0, 0.0, 0.0), (2.0, 1.0, -1.5)):
        camera = view(eye=eye, gaze=np.array([0.5, 0.25, -3.0]) - eye, resolution=(5, 5))
        colors.append(
            draw.colors(scene(camera, (wall(-3.0), paint(diffuse=K_D)), lights=[RED]))[2, 2]
        )
    point = np.array([[0.5, 0.25, -3.0]])
    for color in colors:
        draw.check(
            color,
            lambert_blinn_phong(point, np.array([[0, 0, 1.0]]), 0 * point, [RED], diffuse=K_D)[0],
        )


def test_4_12_the_diffuse_coefficient_scales_the_reflected_light(draw):
    # It sets how much comes back, not the contrast: the picture's ratios stay.
    share = lambert_blinn_phong(*seen_wall(), [RED], diffuse=1.0)
    for k in (0.25, 0.75, 2.0):
        draw.check(
            draw.colors(scene(CAMERA, (wall(-3.0), paint(diffuse=k)), lights=[RED])), k * share
        )


@pytest.mark.parametrize("exponent", [0.0, 1.0, 10.0, 100.0])
def test_4_13_blinn_phong_shading(draw, exponent):
    expected = lambert_blinn_phong(*seen_wall(), [RED], K_D, K_S, exponent)
    draw.check(
        draw.colors(
            scene(CAMERA, (wall(-3.0), paint(exponent, diffuse=K_D, specular=K_S)), lights=[RED])
        ),
        expected,
    )


def test_4_13_the_highlight_is_brightest_at_the_mirror_configuration(draw):
    # Eye and lamp stand 3 in front of the wall, 1 apart: the mirror direction meets the wall half
    # way between them.
    light = lamp((1.0, 0.0, 0.0))
    camera = view(window=(-1.1, 1.1, -1.1, 1.1), resolution=(33, 33))
    shine = draw.colors(scene(camera, (wall(-3.0), paint(50.0, specular=1.0)), lights=[light]))[
        ..., 0
    ]
    row, column = np.unravel_index(np.argmax(shine), shine.shape)
    points, _, _ = seen_wall(camera)
    assert linear.length(points[row, column] - [0.5, 0.0, -3.0]) <= 0.6 * 6.6 / 33 * np.sqrt(2)
    sharper = draw.colors(scene(camera, (wall(-3.0), paint(200.0, specular=1.0)), lights=[light]))[
        ..., 0
    ]
    assert np.sum(sharper > 0.5) < np.sum(shine > 0.5)


def test_4_13_a_light_below_the_surface_gives_no_highlight(draw):
    # n·l < 0 while n·h > 0: the notes' formula alone would shine here.
    below = lamp((6.0, 0.0, -3.5))
    points, normals, eyes = seen_wall()
    halfway = linear.unit(linear.unit(eyes - points) + linear.unit([6.0, 0.0, -3.5] - points))
    assert np.all(linear.dot(normals, halfway) > 0.1)
    film = draw(
        scene(CAMERA, (wall(-3.0), paint(2.0, diffuse=1.0, specular=1.0)), lights=[below]),
        "Specular",
        "Diffuse",
    )
    for name in ("Specular", "Diffuse", "Combined"):
        np.testing.assert_array_equal(film.passes[name][..., :3], 0.0)


def test_4_14_ambient_shading(draw):
    world = World(ambient=(0.5, 0.25, 1.0))
    drawn = scene(CAMERA, (wall(-3.0), paint(ambient=(0.5, 1.0, 0.25))), world=world)
    draw.check(draw.colors(drawn), (0.25, 0.25, 0.25))


def test_4_14_ambient_joins_the_other_terms(draw):
    world = World(ambient=(0.5, 0.25, 1.0))
    expected = np.array([0.25, 0.125, 0.5]) + lambert_blinn_phong(
        *seen_wall(), [RED], K_D, K_S, 5.0
    )
    shiny = paint(5.0, ambient=0.5, diffuse=K_D, specular=K_S)
    draw.check(draw.colors(scene(CAMERA, (wall(-3.0), shiny), lights=[RED], world=world)), expected)


def test_4_15_many_lights_superpose(draw):
    world, shiny = (
        World(ambient=(0.5, 0.25, 1.0)),
        paint(5.0, ambient=0.5, diffuse=K_D, specular=K_S),
    )
    ambient = np.array([0.25, 0.125, 0.5])
    lights = [RED, BLUE, lamp((0.0, 2.0, 1.0), strength=0.25)]
    together = draw.colors(scene(CAMERA, (wall(-3.0), shiny), lights=lights, world=world))
    draw.check(together, ambient + lambert_blinn_phong(*seen_wall(), lights, K_D, K_S, 5.0))
    each = [
        draw.colors(scene(CAMERA, (wall(-3.0), shiny), lights=[light], world=world)).astype(
            np.float64
        )
        for light in lights
    ]
    # Three pictures of float32 on the one side, one on the other.
    np.testing.assert_allclose(
        sum(each) - 2 * ambient, together, rtol=3e-5 if draw.backend == "NATIVE" else 4 * 2.0**-24
    )


PARALLEL = view("ORTHOGRAPHIC", eye=(0.0, 0.0, 1.0), resolution=(16, 16))
"""Looks down from z = 1 on a floor at z = 0, whose pixels are 1/8 wide; blockers above z = 1 are
out of its sight.
"""


def floor_with(lights, *blockers):
    return scene(
        PARALLEL,
        (wall(0.0), paint(diffuse=1.0)),
        *((blocker, paint(diffuse=0.5)) for blocker in blockers),
        lights=lights,
    )


def floor_light(lights):
    eyes, _ = viewing_rays(PARALLEL)
    points = eyes * [1.0, 1.0, 0.0]
    return points, lambert_blinn_phong(
        points, np.broadcast_to([0, 0, 1.0], points.shape), eyes, lights, diffuse=1.0
    )


def test_4_16_a_blocker_between_surface_and_light_casts_a_shadow(draw):
    light = lamp((0.0, 0.0, 4.0))
    points, lit = floor_light([light])
    # The square of half side 0.25 at half the height throws one of 0.5.
    shadow = np.all(np.abs(points[..., :2]) < 0.5, -1)
    film = draw(floor_with([light], wall(2.0, half=0.25)), "Diffuse", "Shadow")
    draw.check(film.combined[..., :3], np.where(shadow[..., None], 0.0, lit))
    draw.check(film.passes["Diffuse"], lit)
    draw.check(film.passes["Shadow"], np.where(shadow[..., None], -lit, 0.0))
    assert 0.1 < shadow.mean() < 0.5


@pytest.mark.parametrize("z", [6.0, 4.5, -1.0])
def test_4_16_a_blocker_behind_the_light_or_the_surface_casts_none(draw, z):
    light = lamp((0.0, 0.0, 4.0))
    draw.check(draw.colors(floor_with([light], wall(z, half=50.0))), floor_light([light])[1])


def test_4_16_a_sun_is_blocked_at_any_distance(draw):
    sun = Light("sun", "SUN", np.eye(4)[:3], strength=0.5)
    points, _ = floor_light([])
    shadow = np.all(np.abs(points[..., :2]) < 0.5, -1)
    draw.check(
        draw.colors(floor_with([sun], wall(1e6, half=0.5))), np.where(shadow[..., None], 0.0, 0.5)
    )


def test_4_16_each_light_has_its_own_shadow(draw):
    lights = [lamp((0.0, 0.0, 4.0), (1.0, 0.0, 0.0)), lamp((2.0, 0.0, 4.0), (0.0, 1.0, 0.0))]
    points, lit = floor_light(lights)
    x, y = np.moveaxis(points[..., :2], -1, 0)
    low = np.abs(y) < 0.5
    shadows = np.stack(
        [low & (np.abs(x) < 0.5), low & (np.abs(x + 2.0) < 0.5), np.zeros_like(low)], -1
    )
    draw.check(draw.colors(floor_with(lights, wall(2.0, half=0.25))), np.where(shadows, 0.0, lit))


def test_4_17_a_mirror_shows_what_the_reflected_ray_sees(draw):
    # The floor z = 0 is a mirror; the reflected rays meet the painted wall y = 5, lit by a lamp
    # before it.
    camera = view(
        eye=(0.0, -4.0, 3.0),
        gaze=(0.0, 4.0, -3.0),
        up=(0.0, 0.0, 1.0),
        window=(-0.25, 0.25, -0.25, 0.25),
        resolution=(10, 10),
    )
    mirror, k_m = quad((0, 0, 0), (4, 0, 0), (0, 4, 0)), np.array([0.5, 0.75, 1.0])
    painted = quad((0, 5, 5), (50, 0, 0), (0, 0, 50))
    light = lamp((1.0, 2.0, 4.0), (1.0, 0.5, 0.25), 2.0)
    drawn = scene(
        camera,
        (mirror, paint(mirror=k_m)),
        (painted, paint(7.0, diffuse=K_D, specular=K_S)),
        lights=[light],
    )

    origins, d = viewing_rays(camera)
    _, p = on_plane(origins, d, (0, 0, 0), (0, 0, 1))
    n = np.array([0.0, 0.0, 1.0])
    r = d - 2 * (d @ n)[..., None] * n
    _, q = on_plane(p, r, (0, 5, 0), (0, 1, 0))
    reflected = lambert_blinn_phong(
        q, np.broadcast_to([0.0, -1.0, 0.0], q.shape), p, [light], K_D, K_S, 7.0
    )
    assert np.all(np.abs(p) <= 4)
    film = draw(drawn, "Mirror", max_bounces=1)
    draw.check(film.combined[..., :3], k_m * reflected)
    draw.check(film.passes["Mirror"], k_m * reflected)
    np.testing.assert_array_equal(draw.colors(drawn, max_bounces=0), 0.0)


@pytest.mark.parametrize("bounces", [0, 1, 2, 7])
def test_4_17_mirrors_that_face_each_other_reflect_as_often_as_they_may(draw, bounces):
    # Each wall glows with 1 and reflects a half: 1 + 1/2 + 1/4 + … exactly.
    glowing = paint(emission=1.0, mirror=0.5)
    corridor = scene(
        view("ORTHOGRAPHIC", resolution=(4, 4)), (wall(-1.0), glowing), (wall(1.0), glowing)
    )
    np.testing.assert_array_equal(draw.colors(corridor, max_bounces=bounces), 2.0 - 0.5**bounces)


def test_4_17_the_mirror_joins_the_other_terms(draw):
    world = World(ambient=(0.5, 0.5, 0.5), background=(0.25, 0.5, 1.0))
    film = draw(scene(CAMERA, (wall(-3.0), paint(ambient=0.5, mirror=0.5)), world=world))
    draw.check(film.combined[..., :3], np.array([0.375, 0.5, 0.75]))
    assert np.all(film.combined[..., 3] == 1.0)
    dark = replace(world, background=(0.0, 0.0, 0.0))
    draw.check(
        draw.colors(scene(CAMERA, (wall(-3.0), paint(ambient=0.5, mirror=0.5)), world=dark)), 0.25
    )
