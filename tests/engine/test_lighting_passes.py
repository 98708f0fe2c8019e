"""Passes of light by the kind of surface that gives it back, and of what surfaces give back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import media_scenes
from engine_scenes import SCENES as PLAIN
from glint import engine
from glint.engine import scene as s
from glint.engine.film import LIGHTING, VOLUME
from native_tools import constant, draw, lamp, material, needs_core, placed, square, view_from_above


def fog() -> s.Scene:
    """Media that scatter, and glow, before mirrors and glass."""
    scene = media_scenes.rich()
    haze = s.Medium((0.01, 0.02, 0.03), scattering=(0.05, 0.04, 0.02), emission=(0.01, 0.0, 0.02))
    return replace(scene, world=replace(scene.world, medium=haze))


SCENES = PLAIN | {"media": media_scenes.rich, "fog": fog}
BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
REST = ("Emission", "Environment")
LIT = {"mesh_light": "ON", "diffuse_bounces": 2, "reflections": "ALL", "max_bounces": 3}
ALL_LIGHT = ("mirrors", "glass", "far_and_emitting", "fog")


def half(scene: s.Scene) -> s.Scene:
    """Of half as many pixels a side."""
    sides = tuple(side // 2 for side in scene.camera.resolution)
    return replace(scene, camera=replace(scene.camera, resolution=sides))


def recombined(passes: dict[str, np.ndarray]) -> np.ndarray:
    """(h, w, 3) as a compositor puts them together."""
    total = sum(passes[name].astype(float) for name in (*REST, *VOLUME))
    for kind in ("Diffuse", "Glossy", "Transmission"):
        direct, indirect, color = (
            passes[f"{kind} {what}"].astype(float) for what in ("Direct", "Indirect", "Color")
        )
        total += (direct + indirect) * color
    return total


@needs_core
@pytest.mark.parametrize("name", SCENES)
def test_they_put_the_picture_together_and_the_tracers_agree(name: str) -> None:
    plan = {"samples": 2, "light_samples": 2, "max_bounces": 2}
    plan |= LIT if name in ALL_LIGHT else {}
    plan |= {"samples": 1} if name == "fog" else {}
    scene = half(SCENES[name]())
    films = [
        draw(scene, *LIGHTING, *REST, backend=backend, **plan).passes
        for backend in ("NATIVE", "NUMPY")
    ]
    for passes in films:
        picture = passes["Combined"][..., :3]
        scale = max(1.0, np.abs(picture).max())
        np.testing.assert_allclose(recombined(passes), picture, atol=2e-6 * scale)
    ours, truth = films
    for key in LIGHTING:
        apart = np.abs(ours[key].astype(float) - truth[key]).max(-1)
        assert (apart > 1e-4 * max(1, np.abs(truth[key]).max())).mean() < 0.01, key


SUN = lamp("SUN", strength=np.pi)
RED = (0.8, 0.4, 0.2)


def view(*lobes: s.Lobe, **more) -> s.Scene:
    """A floor from above in the sun, before a grey world."""
    floor = placed(0, (0,))
    world = s.World(background=(0.5, 0.5, 0.5))
    return s.Scene(
        view_from_above(8), (square(),), (floor,), (material(*lobes),), lights=(SUN,), world=world,
        **more,
    )  # fmt: skip


def colors(scene: s.Scene, backend: str, **plan) -> dict[str, np.ndarray]:
    """Of each pass its one colour."""
    passes = draw(scene, *LIGHTING, *REST, backend=backend, **plan).passes
    for values in passes.values():
        assert (np.ptp(values, (0, 1)) < 1e-6).all()
    return {name: passes[name][0, 0] for name in LIGHTING}


@pytest.mark.parametrize("backend", BACKENDS)
def test_matt_light_and_its_colour(backend: str) -> None:
    found = colors(view(s.Lobe("DIFFUSE", constant(*RED))), backend)
    np.testing.assert_allclose(found["Diffuse Color"], RED, rtol=1e-6)
    np.testing.assert_allclose(found["Diffuse Direct"], 1, rtol=1e-6)
    for name in set(LIGHTING) - {"Diffuse Color", "Diffuse Direct"}:
        assert not found[name].any(), name


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_mirror_of_the_sky_is_direct_and_of_a_floor_is_not(backend: str) -> None:
    silver = s.Lobe("MIRROR", constant(*RED))
    found = colors(view(silver), backend, max_bounces=2)
    np.testing.assert_allclose(found["Glossy Color"], RED, rtol=1e-6)
    np.testing.assert_allclose(found["Glossy Direct"], 0.5, rtol=1e-6)
    assert not found["Glossy Indirect"].any()
    scene = view(silver)
    tilted = np.zeros((1, 3, 4))
    tilted[0] = np.column_stack([np.diag([1.0, 1.0, -1.0]), (0, 0, 5.0)])
    lid = s.Instances("lid", 0, tilted, (1,), visible_camera=False, visible_shadow=False)
    glow = material(s.Lobe("AMBIENT", constant(0.25)))
    scene = replace(
        scene,
        instances=(*scene.instances, lid),
        materials=(*scene.materials, glow),
        world=replace(scene.world, ambient=(1.0, 1.0, 1.0)),
    )
    found = colors(scene, backend, max_bounces=2)
    assert not found["Glossy Direct"].any()
    np.testing.assert_allclose(found["Glossy Indirect"], 0.25, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_glass_is_transmission_and_what_it_mirrors_is_glossy(backend: str) -> None:
    """Seen straight on: ((n - 1) / (n + 1))^2 of the light is mirrored."""
    lobes = (
        s.Lobe("REFRACTION", constant(1.0), ior=1.5, fresnel=True),
        s.Lobe("MIRROR", constant(1.0), ior=1.5, fresnel=True),
    )
    found = colors(view(*lobes), backend, max_bounces=2)
    np.testing.assert_allclose(found["Glossy Color"], 0.04, rtol=1e-6)
    np.testing.assert_allclose(found["Transmission Color"], 0.96, rtol=1e-6)
    for name in ("Glossy Direct", "Transmission Direct"):
        np.testing.assert_allclose(found[name], 0.5, rtol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_of_a_lobe_without_a_colour_has_the_colour_one(backend: str) -> None:
    """An AMBIENT lobe alone: nothing is lost where the parts are put together."""
    scene = view(s.Lobe("AMBIENT", constant(0.3)))
    scene = replace(scene, world=replace(scene.world, ambient=(1.0, 1.0, 1.0)))
    found = colors(scene, backend)
    np.testing.assert_allclose(found["Diffuse Color"], 1)
    np.testing.assert_allclose(found["Diffuse Direct"], 0.3, rtol=1e-6)


@needs_core
def test_same_bits_with_and_without_them_over_threads_waves_and_regions() -> None:
    for name in ("glass", "alpha", "soft_lights", "fog"):
        scene = half(SCENES[name]())
        plan = engine.Settings(
            samples=16, light_samples=2, threads=1, error_threshold=2.0, passes=frozenset(LIGHTING)
        )
        whole = engine.render(scene, plan).passes
        plain = engine.render(scene, replace(plan, passes=frozenset()))
        assert (plain.combined == whole["Combined"]).all()
        one = engine.render(scene, replace(plan, passes=frozenset({"Glossy Direct"}))).passes
        assert (one["Glossy Direct"] == whole["Glossy Direct"]).all()
        seen = engine.render(scene, replace(plan, threads=3), on_wave=lambda film: None).passes
        w, h = scene.camera.resolution
        part = engine.render(scene, replace(plan, region=(3, 2, w - 1, h - 2))).passes
        for key, values in whole.items():
            assert (seen[key] == values).all(), (name, key)
            assert (part[key] == values[2 : h - 2, 3 : w - 1]).all(), (name, key)
