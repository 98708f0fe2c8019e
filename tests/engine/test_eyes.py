"""Eyes of a pair that look through a perspective: closed forms, one tracer beside the other, the
same bits whatever the work.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from glint import engine
from glint.engine import Settings, film
from glint.engine.analysis.explain import PixelExplainer
from glint.engine.program.table import BY_NAME
from glint.engine.scene import Camera, Lens, Scene
from glint.engine.scene.panorama import Eye
from glint.engine.scene.problems import scene_problems
from glint.engine.scene.view_axes import narrow_view_axes
from native_tools import assert_instruction_sets_agree
from test_lens import BACKENDS, card, depths, glowing, moving, scene, turned
from test_panorama import inside_of_a_ball, passes_of
from test_program_render import new_graph, shown

EYES = {
    "parallel": Eye(0.3),
    "converging": Eye(-0.4, 2.0),
    "merging": Eye(0.3, 3.0, (0.2, 0.5)),
}
LEVEL = {name: replace(eye, up=(0.0, 1.0, 0.0)) for name, eye in EYES.items()}
SIZE = (40, 32)
TILTED = turned(0.7, 1.0, 2.0, 3.0)
TILTED[:, :3] = TILTED[:, :3] @ np.array([[0.96, -0.28, 0], [0.28, 0.96, 0], [0, 0, 1.0]])


def seen(eye: Eye | None, frame=TILTED, window=(-0.9, 0.7, -0.5, 0.8), size=SIZE, **more) -> Camera:
    return Camera("PERSPECTIVE", frame, window, size, **{"clip_end": 100.0, "eye": eye} | more)


def directions(camera: Camera) -> np.ndarray:
    """(n, 3) unit, in the world, of the pixels' centres before an eye turns them."""
    left, right, bottom, top = camera.window
    nx, ny = camera.resolution
    u, v = np.meshgrid(
        left + (np.arange(nx) + 0.5) * (right - left) / nx,
        bottom + (np.arange(ny) + 0.5) * (top - bottom) / ny,
    )
    d = np.stack([u, v, -np.ones_like(u)], -1).reshape(-1, 3) @ camera.world_from_camera[:, :3].T
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def rays_of(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) places of the eye, from the camera's, and unit directions, by the formulas."""
    d, eye = directions(camera), camera.eye
    side = np.cross(d, eye.up)
    offset = np.full(len(d), eye.offset)
    if eye.pole_merge:
        low, high = eye.pole_merge
        share = np.clip((np.abs(np.arcsin(d @ eye.up)) - low) / (high - low), 0, 1)
        offset *= np.cos(share * pi / 2)
        assert (share == 0).any() and (share == 1).any() and np.count_nonzero(share % 1)
    place = offset[:, None] * side / np.linalg.norm(side, axis=1, keepdims=True)
    aim = d if np.isinf(eye.convergence) else eye.convergence * d - place
    return place, aim / np.linalg.norm(aim, axis=1, keepdims=True)


# --- closed forms


@pytest.mark.parametrize("eye", EYES)
@pytest.mark.parametrize("backend", BACKENDS)
def test_eyes_stand_aside_of_every_direction(eye, backend):
    """Across the direction and the world's up, however the camera is turned; depths count from the
    camera's place.
    """
    camera = seen(EYES[eye])
    found = passes_of(inside_of_a_ball(camera, 4.0, (1.0, 2.0, 3.0)), backend)
    place, aim = rays_of(camera)
    from_camera = found["Position"].reshape(-1, 3) - TILTED[:, 3]
    along = from_camera - place
    np.testing.assert_allclose(np.cross(along, aim), 0, atol=4e-6)
    assert (along * aim).sum(1).min() > 0
    depth = -from_camera @ TILTED[:, 2]
    np.testing.assert_allclose(found["Depth"].reshape(-1), depth, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_clip_distances_are_those_of_the_unturned_rays(backend):
    """From inside of a ball, which rays see where its depth along the unturned ones would be
    allowed.
    """
    camera = seen(EYES["converging"], clip_start=2.3, clip_end=4.1)
    scene = inside_of_a_ball(camera, 3.0, (1.0, 2.0, 3.0))
    place, aim = rays_of(camera)
    half = (place * aim).sum(1)
    lengths = -half + np.sqrt(half**2 - (place * place).sum(1) + 9.0)
    depth = lengths * -(directions(camera) @ TILTED[:, 2])
    allowed = (depth > 2.3) & (depth < 4.1)
    assert allowed.any() and not allowed.all()
    found = passes_of(scene, backend)["Depth"].reshape(-1) < 1e9
    sure = np.abs(depth - 2.3) > 1e-6
    np.testing.assert_array_equal(found[sure], allowed[sure])


@pytest.mark.parametrize("backend", BACKENDS)
def test_programs_know_how_long_rays_are(backend):
    """From the clip distance on along the ray, which the eye has turned since."""
    graph = new_graph()
    length = graph.apply(BY_NAME["ray_length"])[0]
    shade = graph.apply(
        BY_NAME["scaled_sum"], graph.constant((0.1,) * 3), length, graph.constant((0.0,) * 3)
    )[0]
    camera = seen(EYES["merging"], clip_start=0.5)
    ball = inside_of_a_ball(camera, 4.0, (1.0, 2.0, 3.0))
    found = passes_of(replace(ball, materials=(shown(graph, shade),)), backend)
    place, _ = rays_of(camera)
    along = np.linalg.norm(found["Position"].reshape(-1, 3) - TILTED[:, 3] - place, axis=1)
    before = 0.5 / -(directions(camera) @ TILTED[:, 2])
    shown_length = 10 * found["Combined"][..., 0].reshape(-1)
    np.testing.assert_allclose(shown_length, along - before, rtol=2e-6)


# --- one tracer beside the other


@pytest.mark.parametrize("lens", [None, Lens(0.2, 4.0, 5, 0.3, 1.5)])
@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize("name", EYES)
def test_both_tracers_see_the_same(name, moves, lens):
    camera = seen(LEVEL[name], turned(0.2, 0.1, 0.0, 0.3), lens=lens)
    if moves:
        camera = moving(camera, turned(0.1, 0.0, 0.1, 0.2), turned(0.3, 0.2, 0.0, 0.4))
    passes = frozenset(film.PASSES) - {"Cost", "Fallbacks"}
    settings = {"samples": 4, "filter_width": 1.5, "passes": passes, "max_bounces": 2}
    core, reference = (passes_of(depths(camera), b, **settings) for b in BACKENDS)
    for pass_name in ("Combined", "Depth", "Position", "Mist", "Denoising Depth", "Normal"):
        wrong = np.abs(core[pass_name] - reference[pass_name])
        assert (wrong / (1 + np.abs(reference[pass_name]))).max() <= 2e-7, pass_name


@pytest.mark.parametrize("backend", BACKENDS)
def test_rays_that_go_up_stand_to_the_right(backend):
    frame = np.array([[0, -1.0, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]])  # mirrored: u = y, -w = z
    camera = seen(Eye(0.5), frame, (-0.5, 0.5, -0.5, 0.5), (1, 1))
    ceiling = scene(camera, card("up", 2.0, -1, 1, -1, 1), materials=(glowing(1, 1, 1),))
    found = passes_of(ceiling, backend)["Position"][0, 0]
    np.testing.assert_allclose(found, [0, 0.5, 2], atol=1e-6)


def test_narrow_views_keep_the_worlds_up():
    """They are traced along axes of their own."""
    camera = seen(Eye(0.03, 5.0), window=(-1e-3, 1e-3, -1e-3, 1e-3), size=(64, 64))
    assert narrow_view_axes(camera) is not None
    ball = inside_of_a_ball(camera, 4.0, (1.0, 2.0, 3.0))
    core, reference = (passes_of(ball, b)["Position"] for b in BACKENDS)
    np.testing.assert_allclose(core, reference, atol=1e-6)


def test_nothing_is_taken_for_empty_that_is_not():
    """A ball that the eye sees and that lies beside all that the camera's place does."""
    camera = seen(Eye(2.0, up=LEVEL["parallel"].up), np.eye(3, 4), (-0.1, 0.1, -0.1, 0.1))
    ball = inside_of_a_ball(camera, 0.3, (2.0, 0.0, -5.0))
    core, reference = (passes_of(ball, backend)["Depth"] for backend in BACKENDS)
    np.testing.assert_array_equal(core < 1e9, reference < 1e9)
    assert (core < 1e9).any()


def test_a_pixel_is_explained():
    wanted = depths(seen(LEVEL["converging"], turned(0.2, 0.1, 0.0, 0.3)))
    explainer = PixelExplainer(wanted, Settings(samples=1))
    found = passes_of(wanted, "NUMPY")
    place, aim = rays_of(wanted.camera)
    hits = 0
    for x, y in [(20, 16), (16, 20), (25, 12)]:
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, found["Combined"][y, x, :3], rtol=2**-20, atol=1e-9)
        own = place[y * SIZE[0] + x] + wanted.camera.world_from_camera[:, 3]
        np.testing.assert_allclose(ray.origin, own, atol=1e-9)
        np.testing.assert_allclose(ray.direction, aim[y * SIZE[0] + x], atol=1e-9)
        if ray.hit is not None:
            hits += 1
            assert ray.hit.depth == pytest.approx(found["Depth"][y, x, 0])
    assert hits


# --- the same bits


def all_at_once(**more) -> Scene:
    camera = seen(LEVEL["merging"], size=(64, 56), lens=Lens(0.1, 4.0, 5), **more)
    return depths(moving(camera, turned(-0.05, -0.2, 0, 0), turned(0.03, 0.2, 0.1, 0)))


def picture(wanted: Scene, **settings) -> np.ndarray:
    return passes_of(wanted, **{"samples": 8, "filter_width": 1.5} | settings)["Combined"]


@pytest.mark.parametrize("plain", [False, True])
def test_threads_and_borders_do_not_change_a_bit(plain):
    wanted = depths(seen(LEVEL["converging"], np.eye(3, 4))) if plain else all_at_once()
    settings = {"error_threshold": 2.0, "samples": 32} if plain else {}
    whole = picture(wanted, threads=1, **settings)
    np.testing.assert_array_equal(whole, picture(wanted, threads=3, **settings))
    part = picture(wanted, region=(5, 11, 35, 30), **settings)
    np.testing.assert_array_equal(whole[11:30, 5:35], part)


def hashes() -> str:
    return hashlib.sha256(picture(all_at_once()).tobytes()).hexdigest()


def test_same_bits_from_every_instruction_set():
    assert assert_instruction_sets_agree(hashes)


# --- what cannot be looked through


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("kind", ["PERSPECTIVE", "PANORAMA"])
@pytest.mark.parametrize("eye", [Eye(1e300, 1e-300), Eye(1e-300, 1e-300, (0.0, 5e-324))])
def test_extremes_are_finite(eye, kind, backend):
    camera = replace(seen(eye, size=(8, 8)), kind=kind)
    if kind == "PANORAMA":
        camera = replace(camera, panorama=engine.scene.panorama.Panorama("EQUIRECTANGULAR"))
    for some in (inside_of_a_ball(camera, 2.0), depths(replace(camera, lens=Lens(0.1, 2.0)))):
        assert np.isfinite(passes_of(some, backend)["Combined"]).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"eye": 1}, "eye is a int"),
        ({"eye": Eye(np.nan)}, "eye's offset"),
        ({"eye": Eye(0.1, 0.0)}, "convergence is 0.0"),
        ({"eye": Eye(0.1, 1.0, (0.5, 0.5))}, "pole_merge (0.5, 0.5)"),
        ({"eye": Eye(0.1, up=(0.0, 0.0, 2.0))}, "up (0.0, 0.0, 2.0) is not of length 1"),
        ({"kind": "ORTHOGRAPHIC"}, "eye is for cameras that look from one place"),
        ({"clip_planes": ((0.0, 0.0, 1.0, 0.0),)}, "clip_planes cut nothing for an eye"),
    ],
)
def test_problems_name_the_number(changes, words):
    camera = replace(seen(Eye(0.1)), **changes)
    [problem] = scene_problems(inside_of_a_ball(camera, 1.0))
    assert words in problem
