"""Section 4 of the lecture notes, Ray Tracing, first half: viewing rays and what they meet
(4.1-4.10).
"""

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import linear
from glint.engine.film import NO_DEPTH
from glint.engine.scene import Polygons, viewing
from notes_scenes import ball, mesh, on_plane, paint, quad, scene, view, viewing_rays, wall

GLOW = paint(emission=1.0)
OBLIQUE = (0.25, 2.0, -1.5, 0.5)
TILTED = {"eye": (3.0, -2.0, 6.0), "gaze": (-0.25, 0.5, -2.0), "up": (0.25, 1.0, 0.5)}
FLOOR = quad((0, 0, -1), (1000, 0, 0), (0, 1000, 0))


def hit_mask(film):
    return film.passes["Depth"][..., 0] < NO_DEPTH


def test_4_1_object_order_and_image_order_draw_the_same_picture(draw):
    # Object order: each triangle is taken to the pixels by the matrices of section 7 and leaves its
    # depth where it is nearest.
    camera = view(resolution=(24, 20))
    vertices = (
        np.random.default_rng(13).uniform([-3, -3, -6], [3, 3, -2], (12, 3)).astype(np.float32)
    )
    triangles = np.arange(12).reshape(4, 3)
    depth = np.full((20, 24), np.inf)
    centers = np.stack(np.meshgrid(np.arange(24.0), np.arange(20.0)), -1)
    for corners in viewing.project_to_pixels(vertices, camera)[triangles]:
        weights = linear.barycentric_by_areas(centers, *corners[:, :2])
        # Depth is not linear in the picture, its reciprocal is.
        here = 1 / linear.interpolate(weights, 1 / corners[:, 2:])[..., 0]
        depth = np.where(linear.is_inside(weights), np.minimum(depth, here), depth)
    film = draw(scene(camera, (mesh(vertices, *map(tuple, triangles)), GLOW)), "Depth")
    np.testing.assert_array_equal(hit_mask(film), np.isfinite(depth))
    assert 0.2 < np.mean(np.isfinite(depth)) < 0.9
    draw.check(film.passes["Depth"][np.isfinite(depth), 0], depth[np.isfinite(depth)])


def test_4_3_straight_lines_stay_straight():
    camera = view(**TILTED)
    a, b = np.array([1.0, 4.0, -3.0]), np.array([-2.0, 1.0, -9.0])
    line = viewing.project_to_pixels(a + np.linspace(0, 1, 20)[:, None] * (b - a), camera)[:, :2]
    off = linear.cross(
        np.append(line[-1] - line[0], 0.0), np.column_stack([line - line[0], np.zeros(20)])
    )[:, 2]
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    steps = np.diff(line, axis=0)
    # and equal steps shrink with the distance
    assert linear.length(steps[0]) > 1.5 * linear.length(steps[-1])


def test_4_4_parallel_projection_keeps_sizes_at_any_depth():
    camera = view("ORTHOGRAPHIC", resolution=(16, 16))
    near, far = (
        viewing.project_to_pixels([[0, 0, z], [0.5, 0.25, z]], camera)[:, :2] for z in (-1.0, -9.0)
    )
    np.testing.assert_allclose(near, far, rtol=0, atol=1e-14)


@pytest.mark.parametrize("kind", ["ORTHOGRAPHIC", "PERSPECTIVE"])
def test_4_5_u_is_right_v_is_up_w_is_backward(draw, kind):
    # Small balls right of, above and in front of the eye; the image plane is in front, so the
    # picture stands upright.
    for offset, (column, row) in (
        ((1.0, 0.0), (7, 4)),
        ((0.0, 1.0), (4, 7)),
        ((-1.0, 0.0), (1, 4)),
        ((0.0, -1.0), (4, 1)),
    ):
        thing = ball((0.75 * offset[0], 0.75 * offset[1], -1.0), 0.125)
        camera = view(kind, window=(-1.125, 1.125, -1.125, 1.125), resolution=(9, 9))
        rows, columns = np.nonzero(hit_mask(draw(scene(camera, (thing, GLOW)), "Depth")))
        assert (set(columns), set(rows)) == ({column}, {row})
    assert not hit_mask(draw(scene(camera, (ball((0, 0, 2), 0.5), GLOW)), "Depth")).any()


@pytest.mark.parametrize("window", [(-1.0, 1.0, -1.0, 1.0), OBLIQUE])
@pytest.mark.parametrize("kind", ["ORTHOGRAPHIC", "PERSPECTIVE"])
def test_4_6_viewing_rays(draw, kind, window):
    camera = view(kind, window=window, resolution=(10, 6), **TILTED)
    t, points = on_plane(*viewing_rays(camera), (0, 0, -1), (0, 0, 1))
    film = draw(scene(camera, (FLOOR, GLOW)), "Depth", "Position", "Normal")
    draw.check(film.passes["Position"], points)
    draw.check(film.passes["Depth"][..., 0], t)  # d has length 1 along -w, so t is the depth
    draw.check(film.passes["Normal"], (0.0, 0.0, 1.0))


def test_4_6_perspective_directions_lead_from_the_eye_through_the_window_in_front(draw):
    # A square in the image plane at distance 1 along -w fills exactly its own share of the window.
    camera = view(window=(-2, 2, -2, 2), resolution=(8, 8))
    lit = hit_mask(draw(scene(camera, (wall(-1.0, half=1.0), GLOW)), "Depth"))
    expected = np.zeros((8, 8), bool)
    expected[2:6, 2:6] = True
    np.testing.assert_array_equal(lit, expected)


def sphere_roots(origins, directions, center, radius):
    """Both t of the quadratic that section 4.7 asks to solve, NaN where there are none."""
    a, b = linear.dot(directions, directions), 2 * linear.dot(directions, origins - center)
    c = linear.dot(origins - center, origins - center) - radius**2
    with np.errstate(invalid="ignore"):
        root = np.sqrt(b * b - 4 * a * c)
    return (-b - root) / (2 * a), (-b + root) / (2 * a)


@pytest.mark.parametrize("kind", ["ORTHOGRAPHIC", "PERSPECTIVE"])
def test_4_7_ray_sphere(draw, kind):
    camera = view(kind, resolution=(21, 21), window=(-1.5, 1.5, -1.5, 1.5))
    origins, directions = viewing_rays(camera)
    center, radius = np.array([0.25, -0.5, -3.0]), 1.25
    near, _ = sphere_roots(origins, directions, center, radius)
    film = draw(scene(camera, (ball(center, radius), GLOW)), "Depth", "Normal")
    seen = np.isfinite(near)
    np.testing.assert_array_equal(hit_mask(film), seen)
    assert 0.05 < seen.mean() < 0.95
    points = (origins + near[..., None] * directions)[seen]
    draw.check(film.passes["Depth"][seen, 0], near[seen])
    draw.check(film.passes["Normal"][seen], (points - center) / radius)


def test_4_7_from_inside_the_sphere_the_far_root_counts(draw):
    camera = view(eye=(0.25, 0.0, 0.5))
    _, far = sphere_roots(*viewing_rays(camera), np.zeros(3), 2.0)
    draw.check(
        draw(scene(camera, (ball((0, 0, 0), 2.0), GLOW)), "Depth").passes["Depth"][..., 0], far
    )


CORNERS = np.array([[-1.5, -1.25, -3.0], [2.0, -0.75, -4.0], [0.25, 1.75, -2.5]])


@pytest.mark.parametrize("kind", ["ORTHOGRAPHIC", "PERSPECTIVE"])
def test_4_8_ray_triangle_by_cramers_rule(draw, kind):
    camera = view(kind, window=(-1.0, 1.0, -1.1, 0.9), resolution=(19, 17))
    origins, directions = viewing_rays(camera)
    a, b, c = CORNERS
    columns = np.stack(
        [
            np.broadcast_to(a - b, directions.shape),
            np.broadcast_to(a - c, directions.shape),
            directions,
        ],
        -1,
    )
    beta, gamma, t = np.moveaxis(np.linalg.solve(columns, (a - origins)[..., None])[..., 0], -1, 0)
    inside = (beta > 0) & (gamma > 0) & (beta + gamma < 1)
    film = draw(scene(camera, (mesh(CORNERS, (0, 1, 2)), GLOW)), "Depth", "Position")
    np.testing.assert_array_equal(hit_mask(film), inside)
    assert 0.1 < inside.mean() < 0.9
    draw.check(film.passes["Depth"][inside, 0], t[inside])
    by_weights = linear.interpolate(np.stack([1 - beta - gamma, beta, gamma], -1), CORNERS)
    draw.check(film.passes["Position"][inside], by_weights[inside])


def test_4_8_rays_through_a_shared_edge_hit(draw):
    # The diagonal of the square runs through the centres of pixels (i, i): the open test of the
    # notes loses them in both triangles.
    camera = view("ORTHOGRAPHIC", resolution=(16, 16))
    film = draw(scene(camera, (wall(-2.0, half=1.0), GLOW)), "Depth")
    assert hit_mask(film).all()
    origins, _ = viewing_rays(camera)
    lower, upper = np.array([[-1.0, -1], [1, -1], [1, 1]]), np.array([[-1.0, -1], [1, 1], [-1, 1]])
    weights = [
        linear.barycentric_by_areas(origins[..., :2], *corners) for corners in (lower, upper)
    ]
    np.testing.assert_array_equal(linear.is_inside(weights[0]) | linear.is_inside(weights[1]), True)
    by_open_test = linear.is_inside(weights[0], closed=False) | linear.is_inside(
        weights[1], closed=False
    )
    np.testing.assert_array_equal(by_open_test, ~np.eye(16, dtype=bool))


@pytest.mark.parametrize(
    "corners",
    [
        [[-1, -1, -2], [0, 0, -2], [1, 1, -2]],  # degenerate: three points on a line
        [[0, 0, -2], [0, 0, -2], [0, 0, -2]],
        [[0, -1, -2], [0, 1, -2], [0, 0, -4]],  # parallel to the rays
    ],
)
def test_4_8_no_solution_for_degenerate_triangles_and_parallel_rays(draw, corners):
    film = draw(
        scene(view("ORTHOGRAPHIC", resolution=(9, 9)), (mesh(corners, (0, 1, 2)), GLOW)), "Depth"
    )
    assert not hit_mask(film).any()


def polygon(*corners, z=-2.0):
    vertices = np.array([(x, y, z) for x, y in corners], np.float32)
    return Polygons(
        "polygon",
        vertices,
        np.array([0, len(corners)], np.uint32),
        np.arange(len(corners), dtype=np.uint32),
    )


def plane_points(camera):
    return viewing_rays(camera)[0][..., :2]


def test_4_9_ray_polygon_with_a_notch(draw):
    camera = view("ORTHOGRAPHIC", resolution=(32, 32))
    shape = polygon(
        (-0.75, -0.75),
        (0.75, -0.75),
        (0.75, 0.0),
        (0.125, 0.0),
        (0.125, 0.5),
        (0.75, 0.5),
        (0.75, 0.875),
        (-0.75, 0.875),
    )
    x, y = np.moveaxis(plane_points(camera), -1, 0)
    inside = (np.abs(x) < 0.75) & (y > -0.75) & (y < 0.875) & ~((x > 0.125) & (y > 0) & (y < 0.5))
    film = draw(scene(camera, (shape, GLOW)), "Depth")
    np.testing.assert_array_equal(hit_mask(film), inside)
    draw.check(film.passes["Depth"][inside, 0], 2.0)


def test_4_9_odd_crossings_are_inside_even_are_outside(draw):
    # A pentagram: its tips lie on the inner side of exactly four of its five lines, the hole in the
    # middle of all five.
    angles = np.pi / 2 + 4 * np.pi / 5 * np.arange(5)
    tips = np.float32(0.9 * np.stack([np.cos(angles), np.sin(angles)], -1)).astype(np.float64)
    camera = view("ORTHOGRAPHIC", resolution=(40, 40))
    points = plane_points(camera)
    inner = sum(
        linear.barycentric_by_areas(points, np.zeros(2), a, b)[..., 0] > 0
        for a, b in zip(tips, np.roll(tips, -1, 0), strict=True)
    )
    film = draw(scene(camera, (polygon(*tips), GLOW)), "Depth")
    np.testing.assert_array_equal(hit_mask(film), inner == 4)
    assert np.any(inner == 5)


def test_4_9_the_plane_of_a_tilted_polygon(draw):
    camera = view(window=(-0.5, 0.5, -0.5, 0.5), resolution=(12, 12))
    # the plane x - 0.5 y + 4 z + 14 = 0
    vertices = np.array([[-4, -4, -3], [4, -4, -5], [4, 4, -4], [-4, 4, -2]], np.float32)
    shape = Polygons("tilted", vertices, np.array([0, 4], np.uint32), np.arange(4, dtype=np.uint32))
    t, points = on_plane(*viewing_rays(camera), vertices[0].astype(np.float64), (1.0, -0.5, 4.0))
    film = draw(scene(camera, (shape, GLOW)), "Depth", "Position", "Normal")
    draw.check(film.passes["Depth"][..., 0], t)
    draw.check(film.passes["Position"], points)
    draw.check(film.passes["Normal"], linear.unit([1.0, -0.5, 4.0]))


def test_4_10_the_scene_answers_with_the_smallest_t(draw):
    camera = view(resolution=(24, 24))
    things = [
        (ball((0.5, 0.25, -3.0), 1.0), GLOW),
        (wall(-2.5, half=1.25, center=(-1.0, 0.0)), GLOW),
        (mesh(CORNERS, (0, 1, 2)), GLOW),
    ]
    alone = [draw(scene(camera, thing), "Depth").passes["Depth"] for thing in things]
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        film = draw(scene(camera, *(things[k] for k in order)), "Depth")
        np.testing.assert_array_equal(film.passes["Depth"], np.min(alone, 0))
    nearest = np.argmin(alone, 0)
    assert set(np.unique(nearest[np.min(alone, 0) < NO_DEPTH])) == {0, 1, 2}


def test_4_10_t_has_bounds(draw):
    camera = replace(view(resolution=(6, 6)), clip_start=2.5, clip_end=3.5)
    for z, seen in ((-2.0, False), (-3.0, True), (-4.0, False)):
        assert hit_mask(draw(scene(camera, (wall(z), GLOW)), "Depth")).all() == seen
    behind = draw(scene(camera, (wall(-2.0), GLOW), (wall(-3.0), GLOW)), "Depth")
    draw.check(behind.passes["Depth"], 3.0)
