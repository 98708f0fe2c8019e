"""Samples dealt over blocks of pixels, and light resolved: which points a pixel has, what stays to
the bit, what both tracers, all regions and passes agree on, and how near the picture comes to the
truth.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from bounced_scenes import lamp, matt, room
from engine_scenes import SCENES
from glint import engine
from glint.engine import scene as s
from glint.engine.film import LIGHTING, PARTS
from glint.engine.lights.interleaving import SIDE, interleaving
from glint.engine.sampling import (
    dealt_sample,
    dealt_samples,
    dome_points,
    interleaving_classes,
    light_points,
)
from native_tools import assert_instruction_sets_agree

needs_core = pytest.mark.skipif(
    "NATIVE" not in engine.available_backends(), reason="the core's library is not built"
)
CLASSES = SIDE * SIDE


def settings(kind: str, samples: int = 4, **more) -> engine.Settings:
    chosen = {"light_samples": 2, "diffuse_bounces": 2, "reflections": "ALL", "soft_light": kind}
    return engine.Settings(samples=samples, **{**chosen, **more})


def corner(size: int = 48) -> s.Scene:
    """A floor and a wall with a box on it, a soft lamp and a small one: wide penumbrae and sharp
    edges, corners, matt and glossy surfaces.
    """
    box = s.Mesh(
        "box",
        np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32),
        np.array(
            [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7),
             (2, 7, 6), (1, 5, 7), (1, 7, 3), (0, 2, 6), (0, 6, 4)],
            np.uint32,
        ),
    )  # fmt: skip
    square = s.Mesh(
        "square",
        np.array([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    wall = np.array([[1, 0, 0, 0], [0, 0, -1, 2], [0, 1, 0, 0]], np.float64)
    stands = np.array([[0.8, -0.3, 0, -0.2], [0.3, 0.8, 0, -0.4], [0, 0, 0.9, 0]])
    gloss = s.Material(
        "gloss",
        (s.Lobe("DIFFUSE", (s.Input((0.2, 0.4, 0.6)),)), s.Lobe("SPECULAR", exponent=60.0)),
    )
    eye = np.array([3.2, -3.4, 2.6])
    back = (eye - (0, 0.3, 0.4)) / np.linalg.norm(eye - (0, 0.3, 0.4))
    right = np.cross((0, 0, 1), back) / np.linalg.norm(np.cross((0, 0, 1), back))
    frame = np.column_stack([right, np.cross(back, right), back, eye])
    return s.Scene(
        s.Camera("PERSPECTIVE", frame, (-0.5, 0.5, -0.5, 0.5), (size, size)),
        (square, box),
        (
            s.Instances("floor", 0, np.eye(3, 4)[None], (0,)),
            s.Instances("wall", 0, wall[None], (1,)),
            s.Instances("box", 1, stands[None], (2,)),
        ),
        (matt((0.7, 0.7, 0.7)), matt((0.6, 0.2, 0.1)), gloss),
        lights=(
            lamp("POINT", (1.5, -1.0, 2.5), strength=200.0, radius=0.5),
            lamp("POINT", (-2.0, -2.0, 3.0), strength=60.0, radius=0.02),
        ),
    )


@cache
def truth() -> np.ndarray:
    """(h, w, 3) of so many samples that their points leave next to nothing."""
    film = engine.render(corner(), settings("DEALT", 1024))
    return film.combined[..., :3].astype(float)


def error(film: engine.Film, exact: np.ndarray | None = None) -> float:
    """Relative RMSE against that, else against `truth`."""
    exact = truth() if exact is None else exact
    off = film.combined[..., :3].astype(float) - exact
    return float(np.sqrt((off**2).mean() / (exact**2).mean()))


# --- which points


@pytest.mark.parametrize("samples", [1, 2, 4, 5, 16, 64])
def test_each_class_has_a_run_of_its_own(samples):
    run = dealt_samples(samples, SIDE) // CLASSES
    rows = [
        [dealt_sample(k, number, samples, SIDE) for k in range(samples)]
        for number in range(CLASSES)
    ]
    assert all(row // run == number for number, own in enumerate(rows) for row in own)
    assert len({row for own in rows for row in own}) == samples * CLASSES
    assert max(map(max, rows)) < dealt_samples(samples, SIDE)


@pytest.mark.parametrize(
    "points", [lambda n: (light_points(n)[0] + 1) / 2, dome_points], ids=["lamp", "dome"]
)
@pytest.mark.parametrize("samples", [1, 4, 16, 64])
def test_the_samples_of_a_block_and_those_of_a_pixel_are_spread_well(points, samples):
    """On an axis one lies in each of as many intervals as there are; point 0 is in the middle."""
    table = points(dealt_samples(samples, SIDE)).copy()
    table[0] = 0.0
    rows = np.array(
        [[dealt_sample(k, n, samples, SIDE) for k in range(samples)] for n in range(CLASSES)]
    )
    for k in range(samples):
        of_block = np.floor(table[rows[:, k]] * CLASSES)
        assert all(len(np.unique(axis)) >= CLASSES / 2 for axis in of_block.T)
    for own in rows:
        of_pixel = np.floor(table[own] * samples)
        assert all(len(np.unique(axis)) >= samples - (0 in own) for axis in of_pixel.T)


def test_classes_are_places_in_blocks_of_the_frame():
    whole = interleaving_classes((0, 12), (0, 8), SIDE).reshape(8, 12)
    for y in range(0, 8, SIDE):
        for x in range(0, 12, SIDE):
            assert sorted(whole[y : y + SIDE, x : x + SIDE].ravel()) == list(range(CLASSES))
    part = interleaving_classes((3, 9), (2, 7), SIDE).reshape(5, 6)
    assert (part == whole[2:7, 3:9]).all()


def test_nothing_is_dealt_where_nothing_is_soft():
    hard, soft = room(lamp()), room(lamp(radius=0.1))
    straight = partial(settings, diffuse_bounces=0)
    for kind in ("DEALT", "RESOLVED"):
        assert interleaving(hard, straight(kind)) == 1
        assert interleaving(hard, settings(kind)) == SIDE
        assert interleaving(soft, straight(kind)) == SIDE
        assert interleaving(soft, settings(kind, illumination="CLASSIC")) == 1
        assert interleaving(soft, straight(kind, light_samples=1)) == 1
        assert interleaving(soft, settings(kind, samples=1 << 18)) == 1
    assert interleaving(soft, settings("SHARED")) == 1


# --- what stays


@needs_core
@pytest.mark.parametrize("name", ["hard_lights", "alpha", "texture_repeat"])
def test_pictures_without_soft_light_are_the_same_to_the_bit(name):
    shared, *others = (
        engine.render(SCENES[name](), settings(kind, diffuse_bounces=0, reflections="OFF"))
        for kind in ("SHARED", "DEALT", "RESOLVED")
    )
    for film in others:
        assert np.array_equal(film.combined, shared.combined)


# --- both tracers, all regions, threads and passes


@needs_core
@pytest.mark.parametrize("threshold", [0.0, 4.0])
@pytest.mark.parametrize("kind", ["DEALT", "RESOLVED"])
def test_tracers_agree(kind, threshold):
    passes = frozenset({"Samples", "Error", *PARTS, *LIGHTING})
    chosen = settings(kind, 8, error_threshold=threshold, passes=passes)
    core, reference = (
        engine.render(corner(16), replace(chosen, backend=backend))
        for backend in ("NATIVE", "NUMPY")
    )
    assert np.array_equal(core.passes["Samples"], reference.passes["Samples"])
    for name in ("Combined", *LIGHTING):
        found, expected = core.passes[name].astype(float), reference.passes[name].astype(float)
        floor = 0.01 * np.abs(expected).mean() + 1e-12
        assert (np.abs(found - expected) <= 2e-4 * (np.abs(expected) + floor)).all(), name


@needs_core
@pytest.mark.parametrize("threshold", [0.0, 4.0])
@pytest.mark.parametrize("kind", ["DEALT", "RESOLVED"])
def test_a_region_has_the_bits_of_the_frame(kind, threshold):
    chosen = settings(kind, 8, error_threshold=threshold, passes=frozenset({"Diffuse Direct"}))
    whole = engine.render(corner(), chosen)
    for x0, y0, x1, y1 in ((0, 0, 7, 5), (13, 9, 31, 40), (40, 33, 48, 48)):
        part = engine.render(corner(), replace(chosen, region=(x0, y0, x1, y1)))
        for name in ("Combined", "Diffuse Direct"):
            assert np.array_equal(part.passes[name], whole.passes[name][y0:y1, x0:x1]), name


@needs_core
def test_a_region_of_the_reference_is_that_of_its_frame():
    chosen = settings("RESOLVED", 4, error_threshold=4.0, backend="NUMPY", diffuse_bounces=0)
    whole = engine.render(corner(24), chosen)
    part = engine.render(corner(24), replace(chosen, region=(6, 9, 12, 15)))
    assert np.allclose(part.combined, whole.combined[9:15, 6:12], rtol=1e-6)


@needs_core
def test_threads_do_not_matter():
    one, three = (
        engine.render(corner(), settings("RESOLVED", 4, threads=threads)) for threads in (1, 3)
    )
    assert np.array_equal(one.combined, three.combined)


def hashes() -> list[str]:
    """Of pictures by this machine's kernels."""
    films = (engine.render(corner(24), settings(kind)) for kind in ("DEALT", "RESOLVED"))
    return [hashlib.sha256(film.combined.tobytes()).hexdigest() for film in films]


@needs_core
def test_instruction_sets_do_not_matter() -> None:
    assert_instruction_sets_agree(hashes)


@needs_core
def test_waves_are_pictures_of_so_many_samples():
    """Whoever looks at them on the way gets the same picture in the end."""
    waves: dict[int, np.ndarray] = {}

    def on_wave(film: engine.Film) -> None:
        waves[film.samples] = film.combined.copy()

    watched = engine.render(corner(24), settings("RESOLVED", 16), on_wave=on_wave)
    unseen = engine.render(corner(24), settings("RESOLVED", 16))
    assert np.array_equal(watched.combined, unseen.combined)
    assert set(waves) >= {1, 2, 4, 8}


@needs_core
@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
def test_parts_and_passes_of_light_sum_to_combined(backend):
    passes = frozenset({*PARTS, *LIGHTING})
    film = engine.render(corner(16), settings("RESOLVED", 4, backend=backend, passes=passes))
    combined = film.combined[..., :3].astype(float)
    parts = sum(film.passes[name].astype(float) for name in PARTS)
    assert np.allclose(parts, combined, atol=2e-6 * combined.max())
    light = film.passes["Emission"] + film.passes["Environment"].astype(float)
    for surface in ("Diffuse", "Glossy", "Transmission"):
        color = film.passes[f"{surface} Color"]
        light += color * (film.passes[f"{surface} Direct"] + film.passes[f"{surface} Indirect"])
    assert np.allclose(light, combined, atol=2e-6 * combined.max())


# --- how near to the truth


@needs_core
def test_averaging_is_nearer_to_the_truth():
    dealt, resolved = (error(engine.render(corner(), settings(k))) for k in ("DEALT", "RESOLVED"))
    assert resolved < 0.6 * dealt


@needs_core
@pytest.mark.parametrize("samples", [16, 64])
def test_edges_of_shadows_are_not_blurred(samples):
    """Straight light alone, of a wide lamp and of a small one: averaging adds next to nothing to
    what the samples are off by.
    """
    chosen = [settings(k, samples, diffuse_bounces=0) for k in ("DEALT", "RESOLVED")]
    near = settings("SHARED", 256, light_samples=8, diffuse_bounces=0)
    truth, dealt, resolved = (
        engine.render(corner(), own).combined[..., :3].astype(float) for own in (near, *chosen)
    )
    off, off_resolved = (np.sqrt(((x - truth) ** 2).mean()) for x in (dealt, resolved))
    assert off_resolved < 1.1 * off


@needs_core
def test_pixels_where_surfaces_meet_are_averaged() -> None:
    """Of what bounces, over the surfaces' colours: along corners and outlines as inside of them."""
    passes = frozenset({"Normal", "Diffuse Indirect"})
    chosen = ("DEALT", 1024), ("DEALT", 8), ("RESOLVED", 8)
    films = [engine.render(corner(), settings(*own, passes=passes)) for own in chosen]
    normal = films[0].passes["Normal"]
    mixed = np.zeros(normal.shape[:2], bool)
    rows, columns = (np.abs(np.diff(normal, axis=axis)).max(-1) > 0.3 for axis in (0, 1))
    for here, turned in ((mixed[1:], rows), (mixed[:-1], rows)):
        here |= turned
    for here, turned in ((mixed[:, 1:], columns), (mixed[:, :-1], columns)):
        here |= turned
    exact, *found = (film.passes["Diffuse Indirect"].astype(float) for film in films)
    off, off_resolved = (np.sqrt(((light - exact)[mixed] ** 2).mean()) for light in found)
    assert mixed.mean() > 0.05
    assert off_resolved < 0.45 * off


def under_the_sky(thing: s.Geometry, placed: s.Instances, *lamps: s.Light) -> s.Scene:
    """A floor seen from above, below something that the camera does not see, in the light of an
    even sky.
    """
    floor = s.Mesh(
        "floor",
        np.array([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    above = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5]], np.float64)
    sky = s.Light("sky", "DOME", np.eye(3, 4), radiance=np.full((2, 4, 3), 0.5, np.float32))
    return s.Scene(
        s.Camera("ORTHOGRAPHIC", above, (-2, 2, -2, 2), (96, 96)),
        (floor, thing),
        (s.Instances("floor", 0, np.eye(3, 4)[None], (0,)), replace(placed, visible_camera=False)),
        (matt((0.7, 0.7, 0.7)),),
        lights=(sky, *lamps),
    )


def in_the_sun(thing: s.Geometry, places: np.ndarray) -> s.Scene:
    """With a hard sun, and things (k, 3, 4) between that and the floor."""
    sun = s.Light("sun", "SUN", np.eye(3, 4), strength=3.0)
    return under_the_sky(thing, s.Instances("things", 1, places, (0,) * len(places)), sun)


def drawn_below(scene: s.Scene, kind: str, samples: int) -> np.ndarray:
    """(h, w) in direct light."""
    chosen = settings(kind, samples, light_samples=1, diffuse_bounces=0)
    return engine.render(scene, chosen).combined[..., 1].astype(float)


@needs_core
@pytest.mark.parametrize(("place", "radius"), [((2.5, 1.0, 1.2), 0.8), ((0.0, 0.0, 3.0), 1.0)])
def test_what_repeats_from_block_to_block_is_not_seen(place, radius):
    """A ball hides one or two of the few directions to the sky that a class of pixels has, by
    chance of both halves of the samples alike: no weave over its shadow.
    """
    ball = s.Spheres("ball", np.array([place], np.float32), np.array([radius], np.float32))
    scene = under_the_sky(ball, s.Instances("ball", 1, np.eye(3, 4)[None], (0,)))

    def weave(kind: str) -> float:
        """How far pixels are from the mean of the four blocks that they are the middle of."""
        found = drawn_below(scene, kind, 8)
        blocks = np.lib.stride_tricks.sliding_window_view(found, (4, 4)).mean((-1, -2))
        mean = (blocks[:-1, :-1] + blocks[1:, :-1] + blocks[:-1, 1:] + blocks[1:, 1:]) / 4
        return float((found[2:-2, 2:-2] / mean - 1).std())

    assert weave("RESOLVED") < 0.1 * weave("DEALT")


@needs_core
@pytest.mark.parametrize("pixels", [2, 3, 4, 5, 8])
def test_stripes_of_shadow_stay(pixels):
    """Of bars in the sun, so far apart, also where that is the side of a block."""
    apart = pixels / 24
    bar = s.Mesh(
        "bar",
        np.array([(-6, 0, 1), (6, 0, 1), (6, apart / 2, 1), (-6, apart / 2, 1)], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
    )
    places = np.repeat(np.eye(3, 4)[None], int(9 / apart), 0)
    places[:, 1, 3] = apart * np.arange(len(places)) - 4.5
    scene = in_the_sun(bar, places)
    truth, dealt, resolved = (
        drawn_below(scene, *how) for how in (("DEALT", 1024), ("DEALT", 32), ("RESOLVED", 32))
    )
    off, off_resolved = (np.sqrt(((found - truth) ** 2).mean()) for found in (dealt, resolved))
    assert off_resolved < 1.1 * off


@needs_core
@pytest.mark.parametrize("pixels", [3.5, 4, 4.5])
def test_dots_of_shadow_stay(pixels):
    """Four fifths of the contrast of squares in the sun, about as far apart both ways as blocks are
    wide, where halves of the samples are sure of them.
    """
    apart = pixels / 24
    corners = np.array([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], np.float32)
    corners[:, :2] *= 0.6 * apart
    square = s.Mesh("square", corners, np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    side = np.arange(int(5 / apart)) * apart - 2.5
    places = np.repeat(np.eye(3, 4)[None], len(side) ** 2, 0)
    places[:, 0, 3], places[:, 1, 3] = np.repeat(side, len(side)), np.tile(side, len(side))
    scene = in_the_sun(square, places)
    dots = drawn_below(scene, "DEALT", 1024)
    dots -= dots.mean()
    assert (drawn_below(scene, "RESOLVED", 64) * dots).sum() > 0.8 * (dots**2).sum()


@needs_core
def test_more_samples_are_nearer():
    """Where no gloss throws light on, which few rays find."""
    scene = corner()
    scene = replace(scene, materials=(*scene.materials[:2], matt((0.2, 0.4, 0.6))))
    exact = engine.render(scene, settings("DEALT", 1024)).combined[..., :3].astype(float)
    errors = [error(engine.render(scene, settings("RESOLVED", n)), exact) for n in (1, 4, 16, 64)]
    bounds = 0.043, 0.0205, 0.0095, 0.007
    assert all(found < most for found, most in zip(errors, bounds, strict=True))


@needs_core
def test_resolved_light_has_the_same_mean():
    dealt, resolved = (
        engine.render(corner(), settings(kind)).combined[..., :3].mean((0, 1))
        for kind in ("DEALT", "RESOLVED")
    )
    assert np.allclose(dealt, resolved, rtol=0.003)
    assert np.allclose(resolved, truth().mean((0, 1)), rtol=0.01)


@needs_core
@pytest.mark.parametrize("power", [-80, 60])
def test_brightness_does_not_matter(power):
    def scene(times: float) -> s.Scene:
        found = corner(24)
        lights = tuple(replace(x, strength=x.strength * times) for x in found.lights)
        return replace(found, lights=lights)

    one, other = (
        engine.render(scene(times), settings("RESOLVED")).combined[..., :3].astype(float)
        for times in (1.0, 2.0**power)
    )
    assert np.allclose(one, other / 2.0**power, rtol=1e-4)


@needs_core
def test_lights_beyond_all_floats_leave_no_holes():
    found = corner(16)
    bright = replace(found.lights[0], strength=1e300)
    film = engine.render(replace(found, lights=(bright,)), settings("RESOLVED"))
    assert np.isfinite(film.combined).all()
