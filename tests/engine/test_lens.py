"""Depth of field: closed forms, one tracer beside the other, the same bits whatever the work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.sampling import lens_square, shutter_times
from glint.engine.sampling.lens import lens_points
from glint.engine.sampling.motion import camera_frames
from glint.engine.scene import (
    Camera,
    Input,
    Instances,
    Lens,
    Light,
    Lobe,
    Material,
    Mesh,
    Scene,
    Spheres,
)
from glint.engine.scene.problems import scene_problems
from native_tools import assert_instruction_sets_agree

BACKENDS = ("NATIVE", "NUMPY")
KINDS = ("PERSPECTIVE", "ORTHOGRAPHIC")
FOCUS = 4.0


def glowing(*rgb: float) -> Material:
    return Material("glow", (Lobe("EMISSION", (Input(rgb),)),))


def seen(kind: str, lens: Lens | None, size: int = 48, half: float = 0.3, **more) -> Camera:
    """Looks along -z from the origin; parallel views are wide enough for the same things."""
    half = half if kind == "PERSPECTIVE" else half * FOCUS
    window = (-half, half, -half, half)
    return Camera(kind, np.eye(3, 4), window, (size, size), 0.01, 100.0, lens=lens, **more)


def card(name: str, z: float, x0: float, x1: float, y0: float, y1: float) -> Mesh:
    corners = [[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]
    return Mesh(name, np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))


def scene(camera: Camera, *geometries, materials=(), lights=()) -> Scene:
    blocks = [Instances(g.name, k, np.eye(3, 4)[None], (k,)) for k, g in enumerate(geometries)]
    return Scene(camera, geometries, tuple(blocks), materials, lights=lights)


def dot(camera: Camera, at: tuple[float, float, float], radius: float = 0.01) -> Scene:
    """A small ball of radiance 1."""
    ball = Spheres("dot", np.array([at], np.float32), np.array([radius], np.float32))
    return scene(camera, ball, materials=(glowing(1.0, 1.0, 1.0),))


def turned(angle: float, *place: float) -> np.ndarray:
    """(3, 4) turned about the y axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0, s, place[0]], [0, 1, 0, place[1]], [-s, 0, c, place[2]]], np.float64)


def moving(camera: Camera, *keys: np.ndarray) -> Camera:
    return replace(camera, motion=np.stack(keys), world_from_camera=keys[len(keys) // 2])


def depths(camera: Camera) -> Scene:
    """Cards before, in and behind the plane of focus, a ball, a sun and its shadows."""
    cards = (
        card("near", -2.0, -0.5, 0.0, -0.4, 0.3),
        card("sharp", -FOCUS, -0.3, 0.5, -0.5, 0.5),
        card("far", -9.0, 0.1, 3.0, -2.0, 2.0),
    )
    ball = Spheres("ball", np.array([[-0.6, 0.5, -3]], np.float32), np.array([0.4], np.float32))
    colors = (0.8, 0.2, 0.1), (0.1, 0.9, 0.2), (0.1, 0.3, 0.9), (0.7, 0.7, 0.7)
    surfaces = tuple(Material("surface", (Lobe("DIFFUSE", (Input(c),)),)) for c in colors)
    tilted = np.array([[1, 0, 0, 0], [0, 0.8, -0.6, 0], [0, 0.6, 0.8, 0]], np.float64)
    sun = Light("sun", "SUN", tilted, strength=3.0)
    return scene(camera, *cards, ball, materials=surfaces, lights=(sun,))


def picture(wanted: Scene, **settings) -> np.ndarray:
    chosen = {"samples": 8, "filter_width": 1.5, "backend": "NATIVE"} | settings
    return render(wanted, Settings(**chosen)).passes["Combined"][..., :3]


# --- closed forms


def moments(image: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Centre and variances of the light along u and v, in the window."""
    left, right, _, _ = camera.window
    line = left + (np.arange(len(image)) + 0.5) * (right - left) / len(image)
    weight = image[..., 0] / image[..., 0].sum()
    places = np.stack(np.meshgrid(line, line))
    centre = (weight * places).sum((1, 2))
    return centre, (weight * (places - centre[:, None, None]) ** 2).sum((1, 2))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("depth", [2.0, 8.0])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_a_dot_out_of_focus_is_the_circle_of_confusion(kind, depth, ratio):
    """A ray through (x, y) on the lens and p in the window is at depth z at x + z (p − x/f), or p +
    x − x z/f: a dot there is spread over r |1/z − 1/f|, or r |1 − z/f|.
    """
    lens, ball = Lens(0.5, FOCUS, ratio=ratio), 0.01 * depth  # wide enough for many samples
    camera = seen(kind, lens, 64)
    image = picture(dot(camera, (0.05, -0.02, -depth), ball), samples=1024, filter_width=0.0)
    centre, variance = moments(image, camera)
    shrink = depth if kind == "PERSPECTIVE" else 1.0
    circle = 0.5 * abs(1 - depth / FOCUS) / shrink * np.array([1 / ratio, 1])
    np.testing.assert_allclose(centre, np.array([0.05, -0.02]) / shrink, atol=0.03 * circle[1])
    # of an even ellipse, a quarter of its half axes' squares; the ball's own disc adds to it
    expected = (circle**2 + (ball / shrink) ** 2) / 4
    np.testing.assert_allclose(np.sqrt(variance), np.sqrt(expected), rtol=0.02)


@pytest.mark.parametrize("blades", [3, 5, 6])
@pytest.mark.parametrize("rotation", [0.0, 0.7])
def test_blades_make_a_polygon(blades, rotation):
    """Its corners are on the circle, the first side's middle at the rotation."""
    points = lens_points(Lens(2.0, 1.0, blades, rotation), 256).reshape(-1, 2) / 2
    around = np.arctan2(points[:, 1], points[:, 0]) - rotation
    turn = 2 * np.pi / blades
    beside = (around + turn / 2) % turn - turn / 2
    apothem = np.linalg.norm(points, axis=1) * np.cos(beside)
    assert np.cos(turn / 2) * 0.97 < apothem.max() <= np.cos(turn / 2) + 1e-12
    # even over the area: its second moments, and as many points in the half next to the middle
    np.testing.assert_allclose((points**2).mean(0), (2 + np.cos(turn)) / 12, rtol=0.02)
    inner = apothem < np.cos(turn / 2) / np.sqrt(2)
    assert inner.mean() == pytest.approx(0.5, abs=0.02)


def test_near_and_far_bokeh_stand_on_their_heads():
    """A triangle's picture: behind the focus it is turned round as its light crosses over."""
    shapes = []
    for depth in (2.0, 8.0):
        camera = seen("PERSPECTIVE", Lens(0.5, FOCUS, 3, np.pi / 2), 64, 0.3)
        image = picture(dot(camera, (0.0, 0.0, -depth), 0.01), samples=1024, filter_width=0.0)
        rows = np.flatnonzero(image[..., 0].any(1))
        low, high = (np.count_nonzero(image[r, :, 0]) for r in (rows[3], rows[-4]))
        shapes.append(np.sign(high - low))
    assert shapes[0] == -shapes[1] != 0


def test_points_are_spread_within_a_pixel_and_within_a_block():
    points = lens_square(2, 16)
    assert points.shape == (4, 16, 2) and np.abs(points).max() < 1
    for own in points:
        for axis in own.T:
            assert len(np.unique(np.floor((axis + 1) / 2 * 16))) == 16
    together = points.reshape(-1, 2)
    for axis in together.T:
        assert len(np.unique(np.floor((axis + 1) / 2 * 64))) == 64


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_in_focus_is_sharp(kind):
    lens = Lens(0.3, FOCUS)
    sharp = [card("sharp", -FOCUS, -0.3, 0.51, -0.52, 0.47)]
    both = [
        picture(scene(seen(kind, some), *sharp, materials=(glowing(1, 2, 3),)))
        for some in (lens, None)
    ]
    np.testing.assert_allclose(*both, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_a_lens_of_no_size_is_a_pinhole(kind, backend):
    small, none = (
        picture(depths(seen(kind, lens)), backend=backend) for lens in (Lens(0.0, FOCUS), None)
    )
    np.testing.assert_allclose(small, none, atol=1e-6)


# --- one tracer beside the other


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "lens", [Lens(0.1, FOCUS), Lens(0.3, FOCUS, 5, 0.4, 2.0), Lens(0.05, 1e9), Lens(0.2, 1.5, 3)]
)
@pytest.mark.parametrize("planes", [(), ((0.3, 0.1, -1.0, 5.0), (0.0, 1.0, 0.0, 0.4))])
def test_both_tracers_see_the_same(kind, lens, planes):
    wanted = depths(seen(kind, lens, clip_planes=planes))
    settings = Settings(samples=4, filter_width=1.5, passes=("Depth", "Normal"))
    core, reference = (
        render(wanted, replace(settings, backend=backend)).passes for backend in BACKENDS
    )
    for name in ("Combined", "Depth", "Normal"):
        wrong = np.abs(core[name] - reference[name]) > 1e-4 * (1 + np.abs(reference[name]))
        assert wrong.reshape(48 * 48, -1).any(1).mean() <= 0.002, name


def test_both_tracers_stop_pixels_alike():
    wanted = depths(seen("PERSPECTIVE", Lens(0.1, FOCUS)))
    both = [picture(wanted, backend=b, samples=64, error_threshold=4.0) for b in BACKENDS]
    assert (np.abs(both[0] - both[1]) > 1e-4).any(2).mean() <= 0.002
    full = picture(wanted, samples=64)
    assert 0 < np.abs(both[0] - full).mean() < 4 / 255


def test_a_pixel_is_explained_through_its_first_point_of_the_lens():
    wanted = depths(seen("PERSPECTIVE", Lens(0.2, FOCUS), clip_planes=((0, 0, 1, -0.5),)))
    shown = picture(wanted, samples=1, backend="NUMPY")
    explainer = PixelExplainer(wanted, Settings(samples=1, filter_width=1.5))
    for x, y in [(5, 9), (20, 20), (33, 12), (40, 41)]:
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, shown[y, x], rtol=2**-20, atol=1e-12)
    assert "other points of the lens" in explanation_lines(ray)[0]


# --- the same bits


def blurred(kind: str) -> Scene:
    """Through a lens that moves."""
    lens = Lens(0.2, FOCUS, 5, 0.3, 1.5)
    return depths(moving(seen(kind, lens), turned(-0.05, -0.2, 0, 0), turned(0.03, 0.2, 0.1, 0)))


def test_threads_and_borders_do_not_change_a_bit():
    wanted = blurred("PERSPECTIVE")
    whole = picture(wanted, threads=1)
    np.testing.assert_array_equal(whole, picture(wanted, threads=3))
    np.testing.assert_array_equal(whole[11:40, 5:30], picture(wanted, region=(5, 11, 30, 40)))


def test_same_bits_from_every_instruction_set():
    assert_instruction_sets_agree(
        lambda: [picture(blurred(kind)).tobytes() for kind in KINDS],
    )


# --- extremes


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "lens", [Lens(2500.0, FOCUS), Lens(1e6, 1e-5), Lens(1e-30, 1e30), Lens(1.0, 1e300)]
)
def test_extreme_lenses_are_finite(kind, backend, lens):
    image = picture(depths(seen(kind, lens, 16)), backend=backend, samples=4)
    assert np.isfinite(image).all()


@pytest.mark.parametrize(
    ("lens", "words"),
    [
        (Lens(np.nan, 1.0), "lens"),
        (Lens(1.0, 0.0), "focus 0.0"),
        (Lens(-1.0, 1.0), "radius -1.0"),
        (Lens(1.0, 1.0, ratio=0.0), "ratio 0.0"),
        (Lens(1.0, 1.0, 2), "2 blades"),
    ],
)
def test_problems_name_the_number(lens, words):
    [problem] = scene_problems(depths(seen("PERSPECTIVE", lens)))
    assert words in problem


# --- a camera that moves


def test_frames_turn_evenly_and_go_straight():
    keys = turned(-0.3, 0, 0, 0), turned(0.0, 1, 0, 0), turned(0.5, 1, 2, 0)
    frames = camera_frames(moving(seen("PERSPECTIVE", None), *keys), shutter_times(2, 64))
    frames = frames.reshape(-1, 3, 4)
    angles = np.arctan2(frames[:, 0, 2], frames[:, 0, 0])
    times = np.where(angles < 0, (angles + 0.3) / 0.6, 0.5 + angles)
    line = np.sort(times)
    np.testing.assert_allclose(line, (np.arange(256) + 0.5) / 256, atol=1 / 256)
    x, y = np.minimum(2 * times, 1), np.maximum(2 * times - 1, 0) * 2
    np.testing.assert_allclose(frames[:, :2, 3], np.stack([x, y], 1), atol=1e-12)
    axes = frames[:, :, :3]
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), [np.eye(3)] * 256, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_dot_is_a_streak_as_long_as_the_way(kind):
    """Evenly lit, so that its variance is a twelfth of its length's square."""
    way, depth = 0.6, 3.0
    still = seen(kind, None, 64)
    camera = moving(still, turned(0, -way / 2, 0, 0), turned(0, way / 2, 0, 0))
    camera = replace(camera, world_from_camera=np.eye(3, 4))
    image = picture(dot(camera, (0.0, 0.0, -depth), 0.02), samples=1024, filter_width=0.0)
    _, variance = moments(image, camera)
    shrink = depth if kind == "PERSPECTIVE" else 1.0
    expected = (way / shrink) ** 2 / 12 + (0.02 / shrink) ** 2 / 4
    assert np.sqrt(variance[0]) == pytest.approx(np.sqrt(expected), rel=0.01)
    assert np.sqrt(variance[1]) < 0.02 / shrink


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lens", [None, Lens(0.1, FOCUS, 5, ratio=2.0)])
def test_both_tracers_see_the_same_motion(kind, lens):
    keys = turned(-0.05, -0.2, 0, 0), turned(0.02, 0.0, 0.05, 0.1), turned(0.03, 0.2, 0.1, 0)
    wanted = depths(moving(seen(kind, lens), *keys))
    settings = Settings(samples=4, filter_width=1.5, passes=("Depth", "Position"))
    core, reference = (
        render(wanted, replace(settings, backend=backend)).passes for backend in BACKENDS
    )
    for name in ("Combined", "Depth", "Position"):
        wrong = np.abs(core[name] - reference[name]) > 1e-4 * (1 + np.abs(reference[name]))
        assert wrong.reshape(48 * 48, -1).any(1).mean() <= 0.002, name
    still = picture(replace(wanted, camera=replace(wanted.camera, motion=None)), samples=4)
    assert np.abs(core["Combined"][..., :3] - still).mean() > 0.01


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_motion_to_the_same_place_is_none(backend):
    camera = seen("PERSPECTIVE", Lens(0.1, FOCUS))
    key = np.array(camera.world_from_camera)
    both = (picture(depths(c), backend=backend) for c in (camera, moving(camera, key, key)))
    np.testing.assert_allclose(*both, atol=1e-6)


def test_problems_name_the_motion():
    [problem] = scene_problems(
        depths(replace(seen("PERSPECTIVE", None), motion=np.full((2, 3, 4), np.nan)))
    )
    assert "motion" in problem
