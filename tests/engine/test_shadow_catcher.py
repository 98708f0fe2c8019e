"""Catchers of shadows: closed forms, and the tracers against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import media_scenes
from engine_scenes import SCENES as PLAIN
from glint import engine
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from native_tools import constant, draw, lamp, material, needs_core, placed, square, view_from_above

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
SCENES = PLAIN | {"media": media_scenes.rich}
BEHIND = (0.4, 0.6, 0.8)
LIT = {"mesh_light": "ON", "diffuse_bounces": 2, "reflections": "ALL", "max_bounces": 3}
ALL_LIGHT = ("mirrors", "alpha", "far_and_emitting", "media")


def caught(lights: tuple[s.Light, ...], lid=0, *lobes: s.Lobe, **world) -> s.Scene:
    """From above: a catcher in z = 0, and a lid over x > 0 at z = 5 that only light sees."""
    lid_matrix = np.zeros((1, 3, 4))
    lid_matrix[0] = np.column_stack([np.eye(3), (5.0, 0, 5)])
    ground = material(*lobes or (s.Lobe("DIFFUSE", constant(0.8, 0.4, 0.2)),))
    return s.Scene(
        view_from_above(),
        (square(5.0),),
        (
            placed(0, (0,), catcher=True),
            s.Instances("lid", 0, lid_matrix, (1,), visible_camera=False),
        ),
        (ground, material(s.Lobe("DIFFUSE", constant(0.5)))),
        lights=lights,
        world=s.World(background=BEHIND, **world),
    )


def halves(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the left and the right half show, which is one colour each."""
    left, right = picture[:, :8], picture[:, 8:]
    assert (np.ptp(left, (0, 1)) < 1e-6).all() and (np.ptp(right, (0, 1)) < 1e-6).all()
    return left[0, 0], right[0, 0]


RED = lamp("SUN", strength=2.0, color=(1.0, 0.5, 0.0))
OPEN = lamp("SUN", strength=1.0, color=(1.0, 1.0, 1.0), cast_shadow=False)


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_shadow_is_the_share_of_the_light_that_is_left(backend: str) -> None:
    """Of a light that is blocked and one that is not, a channel each: 1/3, 1/2 and 1."""
    plan = {"backend": backend, "filter_width": 0.0}
    scene = caught((RED, OPEN))
    ratio = np.array([1 / 3, 1 / 2, 1.0])
    film = draw(scene, "Shadow Catcher", **plan)
    for side, wanted in zip(halves(film.passes["Shadow Catcher"]), (1.0, ratio), strict=True):
        np.testing.assert_allclose(side, np.broadcast_to(wanted, 3), atol=1e-6)
    assert not film.combined.any(), "with the pass the picture has nothing of them"
    open_, dark = halves(draw(scene, "Environment", **plan).combined)
    np.testing.assert_allclose(open_, (*BEHIND, 1), rtol=1e-6)
    np.testing.assert_allclose(dark, (*ratio.mean() * np.array(BEHIND), 1), rtol=1e-6)
    film = draw(caught((RED, OPEN), transparent=True), **plan)
    open_, dark = halves(film.combined)
    np.testing.assert_allclose(open_, 0, atol=1e-7)
    np.testing.assert_allclose(dark, (0, 0, 0, 1 - ratio.mean()), atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_what_catchers_hide_from_each_other_is_no_shadow(backend: str) -> None:
    scene = caught((RED,), transparent=True)
    lid = replace(scene.instances[1], catcher=True)
    film = draw(replace(scene, instances=(scene.instances[0], lid)), backend=backend)
    assert not film.combined.any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_where_no_light_is_there_is_no_shadow(backend: str) -> None:
    film = draw(caught((), transparent=True), "Shadow Catcher", backend=backend)
    assert (film.passes["Shadow Catcher"] == 1).all()
    assert not film.combined.any()


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_veil_catches_what_it_does_not_let_through(backend: str) -> None:
    """And what is behind it is seen through it."""
    lobes = s.Lobe("DIFFUSE", constant(0.3)), s.Lobe("TRANSPARENT", constant(0.25))
    scene = caught((RED,), 0, *lobes, transparent=True)
    glow = material(s.Lobe("EMISSION", constant(2.0)))
    below = placed(0, (2,), z=-1.0, visible_shadow=False)
    scene = replace(scene, instances=(*scene.instances, below), materials=(*scene.materials, glow))
    plan = {"backend": backend, "filter_width": 0.0, "mesh_light": "OFF"}
    open_, dark = halves(draw(scene, **plan).combined)
    np.testing.assert_allclose(open_, (0.5, 0.5, 0.5, 0.25), rtol=1e-6)
    # blue is lit by nothing: two channels of three are dark
    np.testing.assert_allclose(dark, (0.5, 0.5, 0.5, 0.25 + 0.75 * 2 / 3), rtol=1e-6)


METAL = {"exponent": 50.0, "masking": 0.2}


@pytest.mark.parametrize("shine", [("MIRROR", {}), ("SPECULAR", METAL)])
@pytest.mark.parametrize("backend", BACKENDS)
def test_mirrors_see_a_catcher_and_it_does_not_mirror(backend: str, shine: tuple) -> None:
    """A mirror or metal over half of the view shows what it would if the ground were a plain
    one.
    """
    kind, more = shine
    scene = caught(
        (OPEN,), 0, s.Lobe("DIFFUSE", constant(0.5)), s.Lobe(kind, constant(0.5), **more)
    )
    tilted = np.zeros((1, 3, 4))
    c = np.sqrt(0.5)
    tilted[0] = np.column_stack([0.2 * np.array([[1, 0, 0], [0, c, c], [0, -c, c]]), (0, 0, 4)])
    mirror = s.Instances("mirror", 0, tilted, (2,))
    upright = np.column_stack([np.eye(3)[[0, 2, 1]], (0, 9, 4)])
    lamp_before_it = s.Instances("panel", 0, upright[None], (3,), visible_camera=False)
    shown = s.Lobe(kind, constant(1.0), **more), s.Lobe("EMISSION", constant(2.0))
    scene = replace(
        scene,
        instances=(*scene.instances[:1], mirror, lamp_before_it),
        materials=(*scene.materials, *(material(lobe) for lobe in shown)),
    )
    plan = {"backend": backend, "filter_width": 0.0, "mesh_light": "OFF"}
    plain = replace(
        scene, instances=(replace(scene.instances[0], catcher=False), *scene.instances[1:])
    )
    ours, theirs = (draw(x, "Mirror", **plan) for x in (scene, plain))
    on_mirror = draw(scene, "Depth", **plan).passes["Depth"][..., 0] < 9.5
    assert 0.1 < on_mirror.mean() < 0.9
    assert (ours.combined[on_mirror] == theirs.combined[on_mirror]).all()
    assert ours.passes["Mirror"][on_mirror].any() and not ours.passes["Mirror"][~on_mirror].any()
    seen = ours.combined[~on_mirror, :3]
    np.testing.assert_allclose(seen, np.broadcast_to(BEHIND, seen.shape), rtol=1e-6)


@pytest.mark.parametrize("x", [2, 12])
def test_the_pixel_is_explained(x: int) -> None:
    scene = caught((RED, OPEN))
    plan = engine.Settings(samples=1, light_samples=1, backend="NUMPY")
    explainer = PixelExplainer(scene, plan)
    ray = explainer.pixel(x, 5)
    picture = engine.render(scene, plan).combined[5, x, :3]
    np.testing.assert_allclose(ray.color, picture, rtol=1e-6)
    text = "\n".join(explanation_lines(ray))
    assert ("(0.333333, 0.5, 1) of the light" in text) == (x > 8)
    assert "catches shadows" in text


def as_catchers(scene: s.Scene) -> s.Scene:
    """Every second thing catches shadows, the floor first of all."""
    blocks = (replace(b, catcher=k % 2 == 0) for k, b in enumerate(scene.instances))
    return replace(scene, instances=tuple(blocks))


@needs_core
@pytest.mark.parametrize("number", range(len(SCENES)))
def test_the_tracers_agree(number: int) -> None:
    """In every second scene as seen over the world; in a few with light of all kinds."""
    name, transparent = list(SCENES)[number], number % 2 == 1
    scene = as_catchers(SCENES[name]())
    scene = replace(scene, world=replace(scene.world, transparent=transparent))
    passes = ("Shadow Catcher",) if number % 3 == 0 else ("Environment",)
    plan = LIT if name in ALL_LIGHT else {}
    ours, truth = (
        draw(scene, *passes, samples=2, light_samples=2, backend=backend, **plan).passes
        for backend in ("NATIVE", "NUMPY")
    )
    for key in ("Combined", *passes):
        apart = np.abs(ours[key].astype(float) - truth[key]).max(-1)
        assert (apart > 1e-4 * max(1, np.abs(truth[key]).max())).mean() < 0.01, key


@needs_core
def test_same_bits_over_threads_waves_and_regions() -> None:
    for name in ("soft_lights", "glass", "far_and_emitting"):
        scene = as_catchers(SCENES[name]())
        plan = engine.Settings(
            samples=16,
            light_samples=2,
            threads=1,
            error_threshold=2.0,
            passes=frozenset({"Shadow Catcher", "Environment"}),
            **LIT,
        )
        whole = engine.render(scene, plan).passes
        seen = engine.render(scene, replace(plan, threads=3), on_wave=lambda film: None).passes
        w, h = scene.camera.resolution
        part = engine.render(scene, replace(plan, region=(3, 2, w - 1, h - 2))).passes
        for key, values in whole.items():
            assert (seen[key] == values).all(), (name, key)
            assert (part[key] == values[2 : h - 2, 3 : w - 1]).all(), (name, key)
