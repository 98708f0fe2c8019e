"""What rays bring after a bounce is held to a most."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bounced_scenes import ALBEDO, lamp, room
from glint import engine
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.film import LIGHTING, PARTS
from test_path_bounces import SCENES, film

BACKENDS = [b for b in ("NATIVE", "NUMPY") if b in engine.available_backends()]
ONCE = ALBEDO * 100 / (4 * np.pi**2)
"""Radiance of the wall of a ball round a lamp, and, times the albedo, of what bounces once."""


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("most", [0.1, 0.4, 1e3])
def test_a_bounce_in_a_ball_brings_no_more(backend: str, most: float) -> None:
    """All of its rays bring the same."""
    plan = {"clamp_indirect": most, "samples": {"NATIVE": 16, "NUMPY": 4}[backend]}
    without = film(room(lamp()), 0, backend, **plan).combined[..., :3]
    found = film(room(lamp()), 1, backend, **plan).combined[..., :3] - without
    brought = ALBEDO * ONCE
    wanted = brought * min(3 * most / brought.sum(), 1.0)
    np.testing.assert_allclose(without.mean((0, 1)), ONCE, rtol=2e-3)
    np.testing.assert_allclose(found.mean((0, 1)), wanted, rtol=5e-3)


@pytest.mark.parametrize("name", SCENES)
def test_both_tracers_hold_the_same(name: str) -> None:
    plan = {"samples": 2, "max_bounces": 2, "reflections": "ALL", "clamp_indirect": 0.05}
    plan |= {"passes": frozenset({*PARTS, *LIGHTING})}
    core, reference = (film(SCENES[name](), 3, backend, **plan) for backend in ("NATIVE", "NUMPY"))
    free = film(SCENES[name](), 3, **plan | {"clamp_indirect": 0.0}).combined
    assert not np.array_equal(core.combined, free)
    for key, values in reference.passes.items():
        near = 1e-4 * (np.abs(values) + np.abs(values).mean() + 1e-6)
        assert (np.abs(core.passes[key] - values) > near).any(-1).mean() <= 3 / 144, key


def facing_mirrors(k: float, matt: float = 0.0, count: int = 2) -> s.Scene:
    """Some of reflectance k over a matt layer: one at 45 degrees before the camera, each of the
    others beside the one before, and the last shows it the sky.
    """
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    sheet = s.Polygons("sheet", corners, np.array([0, 4], np.uint32), np.arange(4, dtype=np.uint32))
    lobes = [s.Lobe("MIRROR", (s.Input((k,) * 3),))]
    lobes += [s.Lobe("DIFFUSE", (s.Input((matt,) * 3),))] if matt else []
    instances = tuple(
        s.Instances(f"sheet {x}", 0, placed(x, z, turn)[None], (0,))
        for x, z, turn in ((0.0, 0.0, np.pi / 4), (3.0, 0.0, -0.6), (4.16, 2.98, -1.385))[:count]
    )
    camera = s.Camera(
        "ORTHOGRAPHIC", np.column_stack([np.eye(3), (0, 0, 5)]), (-0.1, 0.1, -0.1, 0.1), (4, 4)
    )
    world = s.World(background=(30.0, 60.0, 90.0))
    return s.Scene(camera, (sheet,), instances, (s.Material("chrome", tuple(lobes)),), world=world)


def placed(x: float, z: float, turn: float) -> np.ndarray:
    """Turned round y, at x and z."""
    c, n = np.cos(turn), np.sin(turn)
    return np.array([(c, 0, n, x), (0, 1, 0, 0), (-n, 0, c, z)])


SKY = np.array([30.0, 60.0, 90.0])


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_surroundings_in_a_first_mirror_are_not_held(backend: str) -> None:
    scene = facing_mirrors(0.5)
    once = replace(scene, instances=scene.instances[:1])
    found = film(once, 0, backend, max_bounces=4, clamp_indirect=1.0).combined[..., :3]
    np.testing.assert_allclose(found, np.broadcast_to(0.5 * SKY, found.shape), rtol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("k", "matt"), [(1.0, 0.0), (0.25, 0.0), (0.25, 0.25)])
def test_the_surroundings_in_a_second_mirror_are_held_by_the_chance_of_the_way(
    backend: str, k: float, matt: float
) -> None:
    """Whatever the mirrors keep, a path would come there; beside a matt layer as bright half of
    them at each.
    """
    found = film(facing_mirrors(k, matt), 0, backend, max_bounces=4, clamp_indirect=1.0)
    free = film(facing_mirrors(k, matt), 0, backend, max_bounces=1, clamp_indirect=1.0)
    chance = (k / (k + matt)) ** 2
    wanted = k * k * SKY * min(1.0, 3 * chance / (k * k * SKY.sum()))
    brought = (found.combined - free.combined)[..., :3]
    np.testing.assert_allclose(brought, np.broadcast_to(wanted, brought.shape), rtol=1e-4)


@pytest.mark.parametrize("backend", BACKENDS)
def test_by_chance_fewer_rays_bring_as_much(backend: str) -> None:
    """Of a third mirror, by Russian roulette: about half of the rays go on for all."""
    dim = s.Light("dim", "POINT", placed(0.0, 9.0, 0.0), strength=1e-9, radius=0.1)
    scene = replace(facing_mirrors(0.4, 0.4, count=3), lights=(dim,))  # soft: so there is roulette
    plan = {"samples": 16, "clamp_indirect": 1.0}
    deep, less = (film(scene, 0, backend, **plan, max_bounces=n) for n in (4, 2))
    wanted = 3 * 0.5**3 * SKY / SKY.sum()
    brought = (deep.combined - less.combined)[..., :3].mean((0, 1))
    np.testing.assert_allclose(brought, wanted, rtol=0.02)


@pytest.mark.parametrize("name", ["mirror", "rough gloss", "fog", "skin"])
def test_an_explained_pixel_adds_up_and_says_so(name: str) -> None:
    scene = SCENES[name]()
    plan = {"samples": 1, "max_bounces": 2, "reflections": "ALL", "clamp_indirect": 2e-3}
    picture = film(scene, 2, "NUMPY", **plan).combined[..., :3]
    settings = engine.Settings(
        **plan, light_samples=2, diffuse_bounces=2, soft_light="DEALT", filter_width=0.0
    )
    explainer, told = PixelExplainer(scene, settings), 0
    for x, y in ((5, 5), (6, 7), (2, 6), (9, 3)):
        ray = explainer.pixel(x, y)
        np.testing.assert_allclose(ray.color, picture[y, x], rtol=1e-4, atol=1e-6)
        told += any("Clamp Indirect leaves" in line for line in explanation_lines(ray))
    assert told
