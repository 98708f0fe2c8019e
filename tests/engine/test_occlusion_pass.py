"""The pass Ambient Occlusion: closed forms, one tracer beside the other, the same bits whatever the
work.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES, at, box_mesh, surface
from glint.engine import scene as s
from glint.engine.scene.problems import scene_problems
from native_tools import constant, draw, needs_core, pixel_centers, square, view_from_above

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
PASS = "Ambient Occlusion"
FAR = 1e4
WIDE = 1e3
SPREAD = 2 * 1024**-0.75
"""An edge across N stratified directions decides about √N of them, each by up to 1 / N."""


def upright(x: float, height: float) -> np.ndarray:
    """A square of 2 by 2 across as a wall in the plane at x that stands on z = 0."""
    linear = np.array([[0, 0, 1.0], [WIDE, 0, 0], [0, height / 2, 0]])
    return at((x, 0, height / 2), linear)


def floor_and(
    *others: tuple[s.Geometry, np.ndarray], reach: float = FAR, half: float = 1.0, material=None
) -> s.Scene:
    """A floor seen from above, half to each side, by a camera below and beside all else."""
    geometries = [square(WIDE), *(geometry for geometry, _ in others)]
    instances = [s.Instances("floor", 0, at(), (0,))]
    instances += [
        s.Instances(f"thing {k}", k, matrix, (1,), visible_camera=False)
        for k, (_, matrix) in enumerate(others, 1)
    ]
    return s.Scene(
        view_from_above(8, half),
        tuple(geometries),
        tuple(instances),
        (surface(), material or surface()),
        world=s.World(occlusion_distance=reach),
    )


def openness(scene: s.Scene, backend: str = "NATIVE", **settings) -> np.ndarray:
    """(h, w, 3) with 1024 directions."""
    assert scene_problems(scene) == []
    plan = {"samples": 64, "light_samples": 2, "filter_width": 0.0, **settings}
    return draw(scene, PASS, backend=backend, **plan).passes[PASS]


def x_and_y(half: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    centers = pixel_centers(8, half)
    return centers[..., 0], centers[..., 1]


@pytest.mark.parametrize("backend", BACKENDS)
def test_nothing_near_and_nothing_open(backend: str) -> None:
    few = {"backend": backend, "samples": 4}
    assert (openness(floor_and(), **few) == 1).all()
    around = (box_mesh(), at(linear=5.0))
    assert not openness(floor_and(around), **few).any()
    assert (openness(floor_and(around, reach=0.0), **few) == 1).all()
    assert (openness(floor_and(around, reach=3.0), **few) == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("reach", [FAR, 1])
def test_normals_below_the_face_that_is_seen_frontally(backend: str, reach: float) -> None:
    """Directions below it leave through the face: a start that is moved beyond it and back along
    the view's ray by as much lies in it again.
    """
    normals = np.tile(np.float32([0.9, 0.0, -np.sqrt(0.19)]), (4, 1))
    scene = floor_and(reach=reach)
    bent = replace(scene.geometries[0], normals=s.Attribute("normals", s.POINT, normals))
    found = openness(replace(scene, geometries=(bent,)), backend, samples=4)
    assert (found == 1).all()


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("height", [0.5, 1.2, 1.9])
def test_a_ceiling_within_reach(backend: str, height: float) -> None:
    """Directions of a cosine below h / D get by: the square of that."""
    found = openness(floor_and((square(WIDE), at((0, 0, height))), reach=2.0), backend)
    np.testing.assert_allclose(found, (height / 2) ** 2, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_endless_wall_hides_half(backend: str) -> None:
    found = openness(floor_and((square(1.0), upright(1.5, WIDE))), backend)
    np.testing.assert_allclose(found, 0.5, atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_low_wall(backend: str) -> None:
    """Of an endless strip half of 1 - cos of its elevation."""
    found = openness(floor_and((square(1.0), upright(1.5, 1.0))), backend)
    away = 1.5 - x_and_y()[0]
    hidden = (1 - away / np.hypot(away, 1.0)) / 2
    np.testing.assert_allclose(found, (1 - hidden)[..., None].repeat(3, -1), atol=SPREAD)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_ball_above(backend: str) -> None:
    """r² h / d³ of it is hidden, d the distance of the centre."""
    ball = s.Spheres("ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    found = openness(floor_and((ball, at((0.3, -0.2, 1.5)))), backend)
    x, y = x_and_y()
    distance = np.sqrt((x - 0.3) ** 2 + (y + 0.2) ** 2 + 1.5**2)
    expected = 1 - 1.5 / distance**3
    np.testing.assert_allclose(found, expected[..., None].repeat(3, -1), atol=SPREAD)


@needs_core
def test_more_directions_are_nearer() -> None:
    scene = floor_and((square(1.0), upright(1.5, 1.0)))
    away = 1.5 - x_and_y()[0]
    expected = 1 - (1 - away / np.hypot(away, 1.0)) / 2
    errors = [
        np.sqrt(((openness(scene, samples=n)[..., 0] - expected) ** 2).mean()) for n in (4, 32, 256)
    ]
    assert errors[0] < 0.03 and errors[1] < errors[0] / 2 and errors[2] < errors[1] / 2


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_lets_light_through(backend: str) -> None:
    """A coloured veil over all leaves its colour; seen itself it is open, for its own share."""
    tint = (0.25, 0.5, 0.75)
    veil = s.Material("veil", (s.Lobe("TRANSPARENT", constant(*tint)),))
    above = floor_and((square(WIDE), at((0, 0, 2.0))), material=veil)
    found = openness(above, backend, samples=4)
    np.testing.assert_allclose(found[4, 4], tint, atol=1e-3)  # at the horizon it ends
    seen = replace(above.instances[1], visible_camera=True)
    both = openness(replace(above, instances=(above.instances[0], seen)), backend, samples=4)
    t = np.array(tint)
    np.testing.assert_allclose(both[4, 4], 1 - t + t * t, atol=1e-3)


@pytest.mark.parametrize("backend", BACKENDS)
def test_fog(backend: str) -> None:
    """It dims what the camera sees from 10 above, and what is open over that as far as 2."""
    scene, fog = floor_and(reach=2.0), s.Medium((0.05, 0.1, 0.2))
    found = openness(
        replace(scene, world=replace(scene.world, medium=fog)), backend, samples=2, light_samples=1
    )
    expected = np.exp(-12.0 * np.array(fog.absorption))
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_casts_no_shadow_hides_nothing(backend: str) -> None:
    scene = floor_and((square(WIDE), at((0, 0, 2.0))))
    free = replace(scene.instances[1], visible_shadow=False)
    assert (
        openness(replace(scene, instances=(scene.instances[0], free)), backend, samples=4) == 1
    ).all()


@pytest.mark.parametrize("backend", BACKENDS)
def test_holdouts_catchers_and_nothing_have_none(backend: str) -> None:
    scene = floor_and()
    for change in ({"holdout": True}, {"catcher": True}, {"visible_camera": False}):
        block = replace(scene.instances[0], **change)
        assert not openness(replace(scene, instances=(block,)), backend, samples=4).any()


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES))
def test_one_tracer_beside_the_other(name: str) -> None:
    """Rays that graze an edge may go either way."""
    scene = replace(SCENES[name](), world=replace(SCENES[name]().world, occlusion_distance=2.0))
    settings = {"samples": 2, "light_samples": 1}
    native, reference = openness(scene, **settings), openness(scene, "NUMPY", **settings)
    difference = np.abs(native - reference).max(-1)
    assert native.any() and native.max() <= 1 + 1e-6
    assert (difference > 1e-6).mean() < 2e-3


@needs_core
def test_the_same_bits_whatever_the_work() -> None:
    scene = SCENES["flat_and_smooth"]()
    settings = {"samples": 4, "light_samples": 1, "filter_width": 1.5}
    width, height = scene.camera.resolution
    whole = openness(scene, **settings)
    np.testing.assert_array_equal(openness(scene, threads=1, **settings), whole)
    region = (width // 4, height // 4, width // 2, height - 3)
    part = whole[region[1] : region[3], region[0] : region[2]]
    np.testing.assert_array_equal(openness(scene, region=region, **settings), part)


@needs_core
@pytest.mark.parametrize("name", ["flat_and_smooth", "alpha", "mirrors"])
def test_the_picture_stays_as_it_is(name: str) -> None:
    scene, settings = SCENES[name](), {"samples": 4, "max_bounces": 2}
    alone, beside = draw(scene, **settings), draw(scene, PASS, **settings)
    np.testing.assert_array_equal(alone.combined, beside.combined)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_tiny_and_huge(backend: str, size: float) -> None:
    """The ceiling of half the reach, and the same without an end to it."""
    base = floor_and((square(WIDE), at((0, 0, 1.0))), reach=2.0)
    blocks = tuple(
        replace(block, world_from_object=block.world_from_object * size) for block in base.instances
    )
    view = view_from_above(8, size, 10 * size)
    for reach, expected in ((2.0 * size, 0.25), (1e30, 0.0)):
        world = s.World(occlusion_distance=reach)
        scene = replace(base, camera=view, instances=blocks, world=world)
        found = openness(scene, backend, samples=64 if expected else 4)
        np.testing.assert_allclose(found, expected, atol=SPREAD)


def test_a_distance_below_0_is_refused() -> None:
    for reach in (-1.0, 1e31, np.nan, np.inf):
        [found] = scene_problems(floor_and(reach=reach))
        assert "occlusion_distance" in found
