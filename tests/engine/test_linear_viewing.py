"""Projection of points and boxes to pixels for `engine.scene` cameras, against the viewing rays of
semantics/camera.md.
"""

from fractions import Fraction
from math import ceil, floor

import numpy as np
import pytest

from glint.engine import linear
from glint.engine.scene import Camera, viewing

EPS = np.finfo(np.float64).eps
RNG = np.random.default_rng(7)


def camera(
    kind="PERSPECTIVE",
    frame=None,
    window=(-1.0, 1.0, -0.75, 0.75),
    resolution=(40, 30),
    clip_start=0.1,
    clip_end=100.0,
):
    return Camera(
        kind, np.eye(4)[:3] if frame is None else frame, window, resolution, clip_start, clip_end
    )


def posed(translation=(3.0, -2.0, 5.0), scales=(1.0, 1.0, 1.0)):
    return np.column_stack([linear.rotate([1.0, 2.0, 0.5], 1.2) * np.array(scales), translation])


CAMERAS = {
    "perspective": camera(),
    "posed": camera(frame=posed()),
    "oblique": camera(frame=posed(), window=(0.5, 2.0, -3.0, -1.0)),
    "mirrored and scaled": camera(frame=posed(scales=(-2.0, 0.5, 3.0))),
    "flipped window": camera(window=(1.0, -1.0, -0.75, 0.75)),
    "wide": camera(window=(-1e3, 1e3, -1e3, 1e3)),
    "narrow": camera(window=(-1e-4, 1e-4, -1e-4, 1e-4)),
    "parallel": camera("ORTHOGRAPHIC", posed(), window=(-4.0, 4.0, -3.0, 3.0)),
    "parallel, behind its plane too": camera(
        "ORTHOGRAPHIC", posed(), window=(-4.0, 4.0, -3.0, 3.0), clip_start=-50.0, clip_end=50.0
    ),
    "no clip": camera(frame=posed(), clip_start=0.0, clip_end=np.inf),
    "one pixel": camera(frame=posed(), resolution=(1, 1)),
    "far away": camera(frame=posed((1e7, -2e7, 3e6))),
}
EVERY_CAMERA = pytest.mark.parametrize("name", CAMERAS)


def ray_points(camera, pixels, depths):
    """World points at the given depths of the viewing rays through `pixels`, by the formulas of
    section 4.6.
    """
    left, right, bottom, top = camera.window
    nx, ny = camera.resolution
    u = left + (pixels[:, 0] + 0.5) * (right - left) / nx
    v = bottom + (pixels[:, 1] + 0.5) * (top - bottom) / ny
    if camera.kind == "PERSPECTIVE":
        u, v = u * depths, v * depths
    return (
        np.stack([u, v, -depths], -1) @ camera.world_from_camera[:, :3].T
        + camera.world_from_camera[:, 3]
    )


@EVERY_CAMERA
def test_points_of_a_pixels_ray_project_to_that_pixel(name):
    camera = CAMERAS[name]
    pixels = RNG.uniform(-0.5, 1, (300, 2)) * camera.resolution
    depths = RNG.uniform(0.5, 50.0, 300)
    points = ray_points(camera, pixels, depths)
    # The points are rounded to their own size; the frame's condition and the pixels per unit
    # stretch that.
    linear_part = camera.world_from_camera[:, :3]
    stretch = np.linalg.norm(np.linalg.inv(linear_part), 2)
    size = (
        np.max(np.abs(points))
        + np.max(np.abs(camera.world_from_camera))
        + np.max(np.abs(points - camera.world_from_camera[:, 3])) * 3
    )
    off = 8 * EPS * size * stretch
    per_unit = np.max(
        camera.resolution
        / np.abs([camera.window[1] - camera.window[0], camera.window[3] - camera.window[2]])
    )
    widest = np.max(np.abs(camera.window))
    bound = 2 * off * per_unit * (1 + widest) + 32 * EPS * (
        per_unit * widest + np.max(camera.resolution)
    )
    found = viewing.project_to_pixels(points, camera)
    np.testing.assert_allclose(found[:, :2], pixels, rtol=0, atol=bound)
    np.testing.assert_allclose(found[:, 2], depths, rtol=0, atol=off)


def test_points_behind_the_eye_have_negative_depth_and_the_eyes_plane_is_not_finite():
    found = viewing.project_to_pixels(
        [[0.1, 0.1, 2.0], [0.5, 0.5, 0.0], [0.0, 0.0, 0.0]], CAMERAS["perspective"]
    )
    assert found[0, 2] == -2.0
    assert not np.isfinite(found[1:, :2]).any()


def test_a_flattened_camera_is_refused():
    with pytest.raises(ValueError, match="singular"):
        viewing.project_to_pixels(np.zeros((1, 3)), camera(frame=posed(scales=(1.0, 0.0, 1.0))))


def seen_pixels(camera, low, high, placement, per_axis=12):
    """Pixels (k, 2) whose square a dense set of points of the box, within the clip range and the
    frame, projects to.
    """
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, per_axis)] * 3), -1).reshape(-1, 3)
    points = linear.transform_points(placement, low + grid * (high - low))
    pixels = viewing.project_to_pixels(points, camera)
    depths = pixels[:, 2]
    pixels = pixels[
        np.isfinite(pixels).all(1) & (depths >= camera.clip_start) & (depths <= camera.clip_end)
    ]
    nearest = np.floor(pixels[:, :2] + 0.5)
    return nearest[np.all((nearest >= 0) & (nearest < camera.resolution), 1)]


def contains(bounds, pixels):
    x0, y0, x1, y1 = bounds if bounds else (0, 0, 0, 0)
    return np.all((pixels >= [x0, y0]) & (pixels < [x1, y1]))


@EVERY_CAMERA
def test_no_pixel_of_a_box_is_missing(name):
    camera = CAMERAS[name]
    for _ in range(40):
        sides, placement = RNG.uniform(0, 8, 3), RNG.normal(size=(3, 4)) * 2
        placement[:, 3] += (
            camera.world_from_camera[:, 3]
            - 4 * RNG.uniform(-0.5, 1) * camera.world_from_camera[:, 2]
        )
        low = RNG.normal(size=3)
        bounds = viewing.pixel_bounds_of_box(low, low + sides, camera, placement)
        assert contains(bounds, seen_pixels(camera, low, low + sides, placement))


def test_bounds_of_a_box_in_view_are_tight():
    # Front face 2×2 at depth 2, back face at 4: the front fills window [-0.5, 0.5]², pixels 9.5 ...
    # 29.5 and 4.5 ... 24.5 inclusive.
    bounds = viewing.pixel_bounds_of_box([-1, -1, -4], [1, 1, -2], CAMERAS["perspective"])
    assert bounds == (9, 4, 31, 26)  # the squares of pixels 9 and 30 only touch, which counts


def test_a_margin_widens_the_bounds_by_the_filters_reach():
    assert viewing.pixel_bounds_of_box(
        [-1, -1, -4], [1, 1, -2], CAMERAS["perspective"], margin=2.0
    ) == (8, 3, 32, 27)


@pytest.mark.parametrize(
    ("low", "high"),
    [
        ([-1, -1, 1], [1, 1, 4]),  # behind the eye
        ([-1, -1, -0.05], [1, 1, 4]),  # before the near plane
        ([-1, -1, -300], [1, 1, -101]),  # beyond the far plane
        ([9, -1, -8], [10, 1, -7]),  # to the right of the frame
        ([-1, 7, -8], [1, 9, -7]),  # above it
    ],
)
def test_boxes_out_of_view_have_no_bounds(low, high):
    assert viewing.pixel_bounds_of_box(low, high, CAMERAS["perspective"]) is None


def test_a_box_round_the_eye_covers_the_frame():
    for clip_start in (0.0, 0.1):
        assert viewing.pixel_bounds_of_box(
            [-1, -1, -1], [1, 1, 1], camera(clip_start=clip_start)
        ) == (0, 0, 40, 30)


def test_a_box_that_crosses_the_near_plane_keeps_its_near_part():
    # The back at depth 2 starts at window 0.025, pixel 20. The cut at the near plane 0.1 ends at
    # window (0.6, ±0.1): pixel 31.5, which the square of pixel 32 touches, and pixels 12.5 and
    # 16.5. Without cutting the edges only the back would count.
    bounds = viewing.pixel_bounds_of_box([0.05, -0.01, -2], [0.06, 0.01, 1], CAMERAS["perspective"])
    assert bounds == (20, 12, 33, 18)


def test_non_finite_boxes_count_as_everywhere():
    assert viewing.pixel_bounds_of_box([np.nan, 0, 0], [1, 1, 1], CAMERAS["perspective"]) == (
        0,
        0,
        40,
        30,
    )
    assert viewing.pixel_bounds_of_box([0, 0, 0], [1, 1, np.inf], CAMERAS["perspective"]) == (
        0,
        0,
        40,
        30,
    )


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
def test_rounding_far_from_the_origin_is_bounded_from_above(kind):
    # At 1e9 an ulp is 1e-7: a third of a pixel of this narrow view. Truth by fractions; with margin
    # 0 every lost pixel shows.
    eye = np.array([1e9, -1e9, 1e9])
    there = Camera(
        kind, np.column_stack([np.eye(3), eye]), (-1e-4, 1e-4, -1e-4, 1e-4), (600, 600), 0.0
    )
    for _ in range(100):
        low = RNG.uniform(-1e-4, 0, 3)
        high = low + RNG.uniform(0, 1e-4, 3)
        translation = eye + np.array([*RNG.uniform(-5e-5, 5e-5, 2), -1.0])
        bounds = viewing.pixel_bounds_of_box(
            low, high, there, np.column_stack([np.eye(3), translation]), margin=0.0
        )
        exact = []
        for axis in range(2):
            ends = [
                Fraction(x) + Fraction(translation[axis]) - Fraction(eye[axis])
                for x in (low[axis], high[axis])
            ]
            depths = [
                Fraction(eye[2]) - Fraction(translation[2]) - Fraction(z) for z in (low[2], high[2])
            ]
            depths = depths if kind == "PERSPECTIVE" else [Fraction(1)]
            exact.append(
                sorted(
                    (x / depth / Fraction(1e-4) + 1) * 300 - Fraction(1, 2)
                    for x in ends
                    for depth in depths
                )
            )
        (left, *_, right), (bottom, *_, top) = exact
        first, last = (
            np.maximum([ceil(left), ceil(bottom)], 0),
            np.minimum([floor(right), floor(top)], 599),
        )
        if np.all(first <= last):
            assert contains(bounds, np.array([first, last]))
        if bounds:  # and not by much: 3 ulp of both terms are 4 pixels at each end
            assert bounds[2] - bounds[0] <= right - left + 10
            assert bounds[3] - bounds[1] <= top - bottom + 10
