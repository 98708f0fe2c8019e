"""The float32 core against the float64 reference on scenes that use every feature (docs/semantics
is the text both are written from).
"""

import functools
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import (
    GREY_WORLD,
    SCENES,
    ball_mesh,
    grid_mesh,
    light,
    look_at,
    surface,
)
from glint import engine
from glint.engine import scene as s
from glint.engine.reference import occlusion
from glint.engine.sampling import occlusion_points

pytestmark = pytest.mark.skipif(
    "NATIVE" not in engine.available_backends(), reason="the core's library is not built"
)

ALL_PASSES = frozenset(engine.PASSES) - {"Combined", "Fallbacks"}
SETTINGS = engine.Settings(samples=1, light_samples=3, max_bounces=4, passes=ALL_PASSES)

TURNED = 8 * 2.0**-24 * 10
"""By so much single precision may turn a ray that looks a unit far in a scene ten units wide."""


def both(name: str, settings: engine.Settings) -> tuple[engine.Film, engine.Film]:
    scene = SCENES[name]()
    return engine.render(scene, settings), engine.render(scene, replace(settings, backend="NUMPY"))


def relative_error(measured: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(h, w) largest channel's |measured - truth| over the larger of |truth| and 1 % of the
    picture's mean.

    The floor keeps a pixel that is black but for rounding from counting as infinitely wrong.
    """
    measured, truth = measured.astype(float), truth.astype(float)
    seen = np.abs(truth[np.abs(truth) < 1e9])
    floor = 0.01 * (seen.mean() if seen.size else 1.0) + 1e-30
    return (np.abs(measured - truth) / np.maximum(np.abs(truth), floor)).max(-1)


def conditioned(key: str, values: np.ndarray) -> np.ndarray:
    """Gap squared: the chord of a ray that all but touches a sphere is 2 √(r² − b²), whose square
    alone moves in step with the ray.
    """
    return values.astype(float) ** 2 if key == "Gap" else values


def grazes_alone(name: str, core: engine.Film, error: np.ndarray) -> bool:
    """Whether the core's occlusion is what the reference has with directions turned by a rounding,
    wherever it is not what it has without: a direction of many may graze a strand.
    """
    found = core.passes["Ambient Occlusion"]
    far = error > 1e-4
    (y0, x0), (y1, x1) = (edge(np.argwhere(far), 0).tolist() for edge in (np.min, np.max))
    part = np.s_[y0 : y1 + 1, x0 : x1 + 1]
    near = [
        relative_error(found[part], turned)
        for turned in turned_occlusion(name, (x0, y0, x1 + 1, y1 + 1))
    ]
    return bool((np.minimum.reduce(near)[far[part]] < 1e-4).all())


@functools.cache
def turned_occlusion(name: str, region: tuple[int, int, int, int]) -> list[np.ndarray]:
    """The reference's occlusion, which no light changes, of directions turned to four sides."""
    settings = replace(
        SETTINGS, passes=frozenset({"Ambient Occlusion"}), backend="NUMPY", region=region
    )
    films = []
    for turn in np.vstack([TURNED * np.eye(2), -TURNED * np.eye(2)]):

        def turned(samples: int, each: int, turn: np.ndarray = turn) -> np.ndarray:
            return occlusion_points(samples, each) + turn

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(occlusion, "occlusion_points", turned)
            dark = replace(SCENES[name](), lights=())
            films.append(engine.render(dark, settings).passes["Ambient Occlusion"])
    return films


@pytest.mark.parametrize("illumination", engine.settings.ILLUMINATIONS)
@pytest.mark.parametrize("name", SCENES)
def test_same_picture(name: str, illumination: str) -> None:
    core, reference = both(name, replace(SETTINGS, illumination=illumination))
    errors = {
        key: relative_error(*(conditioned(key, film.passes[key]) for film in (core, reference)))
        for key in reference.passes
    }
    worst = {
        key: (float(error.max()), int((error > 1e-4).sum()))
        for key, error in errors.items()
        if error.max() > 1e-4
    }
    if "Ambient Occlusion" in worst and grazes_alone(name, core, errors["Ambient Occlusion"]):
        del worst["Ambient Occlusion"]
    assert not worst, f"{name}: pass -> (largest relative error, pixels beyond 1e-4): {worst}"


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("distance", [1e3, 1e4])
def test_no_shadow_on_a_convex_body_seen_from_afar(distance: float, copies: int) -> None:
    """A smooth ball through a long lens: where a step of float32 at its distance is more than
    lifted starts lie above the faces.
    """
    matrix = np.repeat(np.eye(4)[None, :3], copies, 0)
    matrix[1:, 2, 3] = 5 * distance  # out of sight
    eye, half = distance * np.array([0.68, -0.57, 0.46]), 1.1 / distance
    camera = s.Camera(
        "PERSPECTIVE", look_at(eye, (0, 0, 0)), (-half, half, -half, half), (100, 100)
    )
    body, paint = s.Instances("ball", 0, matrix, (0,)), surface(diffuse=0.8, ambient=0.0)
    scene = s.Scene(
        camera, (ball_mesh(80),), (body,), (paint,), lights=(light("SUN", strength=3.0),)
    )
    core, reference = (
        engine.render(scene, replace(SETTINGS, passes=frozenset(), backend=backend)).combined
        for backend in ("NATIVE", "NUMPY")
    )
    assert (reference[..., :3].max(-1) > 0).sum() > 2200
    assert np.abs(core[..., :3].astype(float) - reference[..., :3]).max() <= 1e-4


@pytest.mark.parametrize("copies", [1, 2])
def test_hits_are_off_by_no_more_than_float32_at_their_distance(copies: int) -> None:
    """A grid far away, turned so that no corner is a number of float32."""
    distance, turned = 1e4, look_at((0.3, 0.5, 0.7), (0, 0, 0))[:, :3]
    matrix = np.zeros((copies, 3, 4))
    matrix[:, :, :3] = turned * 3
    matrix[1:, 2, 3] = 5 * distance  # out of sight
    half = 2 / distance
    eye = distance * np.array([0.68, -0.57, 0.46])
    camera = s.Camera("PERSPECTIVE", look_at(eye, (0, 0, 0)), (-half, half, -half, half), (64, 64))
    body = s.Instances("grid", 0, matrix, (0,))
    scene = s.Scene(camera, (grid_mesh(20),), (body,), (surface(),), world=GREY_WORLD)
    core, reference = (
        engine.render(scene, replace(SETTINGS, backend=backend)).passes["Position"].astype(float)
        for backend in ("NATIVE", "NUMPY")
    )
    seen = reference.any(-1)
    off = np.linalg.norm(core - reference, axis=-1)[seen].max()
    away = np.linalg.norm(camera.world_from_camera[:, 3])
    slant = 1 / 0.3  # a corner's step along the plane's normal, along the ray
    assert seen.mean() > 0.5
    assert 0 < off <= 2**-24 * np.sqrt(3) * slant * away


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize(("thickness", "seen"), [(0.0, False), (5e-9, False), (2e-8, True)])
def test_spheres_without_thickness_are_left_out(thickness: float, seen: bool, copies: int) -> None:
    """Two unit columns that lie apart by the angle `thickness`: the determinant of all three."""
    flat = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, thickness, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    ball = s.Spheres("b", np.zeros((1, 3), np.float32), np.ones(1, np.float32))
    glow = s.Material("glow", (s.Lobe("EMISSION", (s.Input((1.0, 1.0, 1.0)),)),))
    camera = s.Camera(
        "PERSPECTIVE", look_at((0, -5, 0), (0, 0, 0)), (-0.5, 0.5, -0.5, 0.5), (16, 16)
    )
    scene = s.Scene(
        camera, (ball,), (s.Instances("i", 0, np.repeat(flat[None], copies, 0), (0,)),), (glow,)
    )
    for backend in ("NATIVE", "NUMPY"):
        film = engine.render(scene, engine.Settings(samples=1, backend=backend))
        assert (film.combined[..., 0] > 0).any() == seen == (not film.notes), backend


@pytest.mark.parametrize("name", SCENES)
def test_same_picture_antialiased(name: str) -> None:
    core, reference = both(name, replace(SETTINGS, samples=2, passes=frozenset()))
    assert relative_error(core.combined, reference.combined).max() <= 1e-4


@pytest.mark.parametrize("backend", engine.settings.BACKENDS)
@pytest.mark.parametrize("name", SCENES)
def test_parts_sum_to_combined(name: str, backend: str) -> None:
    scene = SCENES[name]()
    smaller = 2 if backend == "NATIVE" else 6
    size = tuple(side // smaller for side in scene.camera.resolution)
    scene = replace(scene, camera=replace(scene.camera, resolution=size))
    film = engine.render(scene, replace(SETTINGS, samples=2, backend=backend))
    total = sum(film.passes[part].astype(float) for part in engine.PARTS)
    size = sum(np.abs(film.passes[part].astype(float)) for part in engine.PARTS)
    # Every part and Combined are rounded to float32 once: half an ulp each.
    assert (
        np.abs(total - film.combined[..., :3]) <= 2.0**-23 * (size + np.abs(film.combined[..., :3]))
    ).all()


@pytest.mark.parametrize("name", SCENES)
def test_same_bits_whatever_the_threads_and_regions(name: str) -> None:
    scene, settings = SCENES[name](), replace(SETTINGS, samples=3)
    nx, ny = scene.camera.resolution
    whole = engine.render(scene, replace(settings, threads=1))
    for threads in (2, 5, 1):
        again = engine.render(scene, replace(settings, threads=threads))
        for key, value in whole.passes.items():
            assert np.array_equal(value.view(np.uint32), again.passes[key].view(np.uint32)), (
                key,
                threads,
            )
    for x0, x1 in ((0, nx // 3), (nx // 3, nx)):
        for y0, y1 in ((0, ny // 2 + 1), (ny // 2 + 1, ny)):
            part = engine.render(scene, replace(settings, region=(x0, y0, x1, y1)))
            for key, value in part.passes.items():
                assert np.array_equal(
                    value.view(np.uint32),
                    np.ascontiguousarray(whole.passes[key][y0:y1, x0:x1]).view(np.uint32),
                ), key
