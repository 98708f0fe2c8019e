"""Light told apart by the groups of what makes it: their passes add up to Combined, and each is the
picture with all other light off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import media_scenes
from engine_scenes import SCENES as PLAIN
from engine_scenes import gloss
from glint import engine
from glint.engine import scene as s
from glint.engine.analysis.explain import PixelExplainer, explanation_lines
from glint.engine.scene.problems import scene_problems
from native_tools import constant, draw, lamp, material, needs_core, placed, square, view_from_above
from test_light_sets import panels

BACKENDS = [pytest.param("NATIVE", marks=needs_core), "NUMPY"]
NAMES = ("Key", "Fill", "Rim")
LIT = {
    "samples": 2,
    "light_samples": 2,
    "mesh_light": "ON",
    "diffuse_bounces": 2,
    "reflections": "ALL",
    "max_bounces": 3,
}


def fog() -> s.Scene:
    """Media that scatter, and glow, before mirrors and glass."""
    scene = media_scenes.rich()
    haze = s.Medium((0.01, 0.02, 0.03), scattering=(0.05, 0.04, 0.02), emission=(0.01, 0.0, 0.02))
    return replace(scene, world=replace(scene.world, medium=haze))


def gas() -> s.Scene:
    """The same, where what is in things glows."""
    glow = s.Medium((0.1, 0.2, 0.4), (0.2, 0.1, 0.1), (0.5, 0.3, 0.1))
    scene = fog()
    filled = [replace(m, medium=glow) if m.medium else m for m in scene.materials]
    return replace(scene, materials=tuple(filled))


def sky(scene: s.Scene) -> s.Scene:
    """With a sky that lights, and lamps that are seen."""
    rng = np.random.default_rng(1)
    dome = s.Light("sky", "DOME", np.eye(3, 4), radiance=rng.random((8, 16, 3)).astype(np.float32))
    lights = tuple(
        replace(x, visible_camera=True, visible_mirror=True, visible_transmission=True)
        for x in scene.lights
    )
    world = replace(scene.world, ambient=(0.3, 0.2, 0.1), background=(0.3, 0.2, 0.1))
    return replace(scene, lights=(*lights, dome), world=world)


def caught() -> s.Scene:
    """The first of its things is a shadow catcher."""
    scene = sky(PLAIN["soft_lights"]())
    first, *others = scene.instances
    return replace(scene, instances=(replace(first, catcher=True), *others))


def glowing(scene: s.Scene) -> s.Scene:
    """Every other material glows."""
    glow = s.Lobe("EMISSION", constant(0.4, 0.3, 0.2))
    materials = tuple(
        replace(m, lobes=(*m.lobes, glow)) if k % 2 else m for k, m in enumerate(scene.materials)
    )
    return replace(scene, materials=materials)


def crowd() -> s.Scene:
    """Under 90 lamps, which far points see in clusters, before boxes that hide some of them."""
    scene = PLAIN["hard_lights"]()
    rng = np.random.default_rng(3)
    places = rng.uniform((-4, -4, 2.0), (4, 4, 4.0), (90, 3))
    tints = rng.uniform(0.2, 1.0, (90, 3))
    lights = [
        lamp("POINT", place, strength=12.0, color=tuple(tint))
        for place, tint in zip(places, tints, strict=True)
    ]
    return replace(scene, lights=tuple(lights))


SCENES = {
    **{name: PLAIN[name] for name in ("mirrors", "glass", "alpha", "far_and_emitting")},
    "gloss": gloss,
    "sky": lambda: sky(PLAIN["soft_lights"]()),
    "glow": lambda: glowing(PLAIN["glass"]()),
    "caught": caught,
    "fog": fog,
    "gas": gas,
    "crowd": crowd,
    "panels": lambda: panels({}, {}, {"blockers": 1}),
}


def grouped(scene: s.Scene, none: bool = False) -> s.Scene:
    """Each light and thing in one of the groups in turn, or in none as well."""
    count = len(NAMES) + none

    def group(k: int) -> int:
        return k % count if k % count < len(NAMES) else -1

    def of_light(k: int, light: s.Light) -> s.Light:
        return replace(light, light_group=1 if light.kind == "DOME" else group(k))

    return replace(
        scene,
        light_groups=NAMES,
        lights=tuple(of_light(k, light) for k, light in enumerate(scene.lights)),
        instances=tuple(replace(x, light_group=group(k)) for k, x in enumerate(scene.instances)),
        world=replace(scene.world, light_group=1),
    )


def smaller(scene: s.Scene, by: int) -> s.Scene:
    """Of fewer pixels a side."""
    sides = tuple(side // by for side in scene.camera.resolution)
    return replace(scene, camera=replace(scene.camera, resolution=sides))


def of_groups(film: engine.Film) -> list[np.ndarray]:
    return [film.passes[f"Light Group {name}"].astype(float) for name in NAMES]


@needs_core
@pytest.mark.parametrize("name", sorted(SCENES.keys() - {"fog"}))  # which is part of `gas`
def test_they_add_up_to_the_picture_and_the_tracers_agree(name: str) -> None:
    scene = smaller(grouped(SCENES[name]()), 3)
    plan = LIT | {"samples": 1} | {"crowd": {"lamp_shadows": 8}}.get(name, {})
    films = [draw(scene, backend=backend, **plan) for backend in ("NATIVE", "NUMPY")]
    for film in films:
        picture = film.combined[..., :3]
        scale = max(1.0, np.abs(picture).max())
        np.testing.assert_allclose(sum(of_groups(film)), picture, atol=2e-6 * scale)
    assert sum(group.any() for group in of_groups(films[0])) >= 2
    for ours, truth in zip(*map(of_groups, films), strict=True):
        apart = np.abs(ours - truth).max(-1)
        assert (apart > 1e-4 * max(1, np.abs(truth).max())).mean() < 0.01


@needs_core
@pytest.mark.parametrize("name", SCENES)
def test_the_picture_keeps_its_bits_and_has_the_same_over_threads_and_regions(name: str) -> None:
    scene = smaller(SCENES[name](), 2)
    plan = engine.Settings(**LIT | {"samples": 8, "error_threshold": 2.0, "threads": 1})
    told = engine.render(grouped(scene, none=True), plan)
    ungrouped = engine.render(scene, plan)
    if name == "crowd":  # whose clusters are of one group each
        assert abs(ungrouped.combined[..., :3].mean() / told.combined[..., :3].mean() - 1) < 0.01
    else:
        assert (ungrouped.combined == told.combined).all()
    w, h = scene.camera.resolution
    more = engine.render(grouped(scene, none=True), replace(plan, threads=3))
    part = engine.render(grouped(scene, none=True), replace(plan, region=(3, 2, w - 1, h - 2)))
    for whole, again, cut in zip(*map(of_groups, (told, more, part)), strict=True):
        assert (whole == again).all()
        assert (whole[2 : h - 2, 3 : w - 1] == cut).all()


def alone(scene: s.Scene, group: int) -> s.Scene:
    """Nothing but what the group gives: others' things have materials that do not glow."""
    count = len(scene.materials)
    dark = [
        replace(m, lobes=tuple(lobe for lobe in m.lobes if lobe.kind != "EMISSION"), medium=None)
        for m in scene.materials
    ]
    instances = tuple(
        x if x.light_group == group else replace(x, materials=tuple(count + k for k in x.materials))
        for x in scene.instances
    )
    world = scene.world
    if world.light_group != group:
        world = replace(world, ambient=(0.0,) * 3, background=(0.0,) * 3, program=None)
    return replace(
        scene,
        lights=tuple(x for x in scene.lights if x.light_group == group),
        instances=instances,
        materials=(*scene.materials, *dark),
        world=world,
    )


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("name", ["mirrors", "glass", "alpha", "glow", "hard_lights"])
def test_each_is_the_picture_with_all_other_light_off(name: str, backend: str) -> None:
    """Lamps without extent, and what glows as it is seen: there is nothing to choose from."""
    scene = grouped((SCENES | PLAIN)[name](), none=True)
    plan = {"samples": 1, "max_bounces": 3, "mesh_light": "OFF", "backend": backend}
    found = of_groups(draw(scene, **plan))
    for group, values in enumerate(found):
        truth = draw(alone(scene, group), **plan).combined[..., :3]
        np.testing.assert_allclose(values, truth, atol=2e-6 * max(1.0, truth.max()))


@needs_core
@pytest.mark.parametrize("name", ["glow", "sky", "crowd", "panels"])
def test_light_of_tables_is_near_the_picture_with_all_other_light_off(name: str) -> None:
    scene = smaller(grouped(SCENES[name]()), 2)
    plan = LIT | {"samples": 64, "lamp_shadows": 16}
    for group, values in enumerate(of_groups(draw(scene, **plan))):
        truth = draw(alone(scene, group), **plan).combined[..., :3].astype(float)
        assert abs(values.mean() / truth.mean() - 1) < 0.03, group
        off = np.sqrt(((values - truth) ** 2).mean()) / np.sqrt((truth**2).mean())
        assert off < 0.1, (group, off)


@pytest.mark.parametrize("backend", BACKENDS)
def test_closed_forms_of_a_lamp_a_panel_and_the_surroundings(backend: str) -> None:
    """A floor of 0.8 in two suns of π E and one of no group, before nothing: E 0.8 each."""
    floor = material(s.Lobe("DIFFUSE", constant(0.8)), s.Lobe("EMISSION", constant(0.1)))
    suns = [lamp("SUN", strength=np.pi * e, light_group=g) for e, g in ((2, 0), (3, 1), (5, -1))]
    scene = s.Scene(
        view_from_above(4),
        (square(0.5),),
        (placed(0, (0,), light_group=2),),
        (floor,),
        lights=tuple(suns),
        world=s.World(background=(0.4, 0.2, 0.0), light_group=0),
        light_groups=NAMES,
    )
    film = draw(scene, backend=backend, mesh_light="OFF", filter_width=0.0)
    key, fill, rim = of_groups(film)
    for values, inside, beside in (
        (key, 1.6, (0.4, 0.2, 0.0)),
        (fill, 2.4, 0.0),
        (rim, 0.1, 0.0),
        (film.combined[..., :3], 8.1, (0.4, 0.2, 0.0)),
    ):
        np.testing.assert_allclose(values[1:3, 1:3], inside, rtol=1e-6)
        np.testing.assert_allclose(values[0], np.broadcast_to(beside, (4, 3)), rtol=1e-6)


@needs_core
def test_bad_groups_are_refused_by_name() -> None:
    scene = grouped(PLAIN["hard_lights"]())
    bad = replace(scene, lights=(replace(scene.lights[0], light_group=7),))
    assert any("light_group is 7" in text for text in scene_problems(bad))
    worse = replace(scene, world=replace(scene.world, light_group=-2))
    assert any("light_group is -2" in text for text in scene_problems(worse))
    many = replace(scene, light_groups=tuple(map(str, range(65))))
    assert any("65 light groups" in text for text in scene_problems(many))


@pytest.mark.parametrize("backend", BACKENDS)
def test_statistics_and_explanations_name_them(backend: str) -> None:
    scene = grouped(PLAIN["hard_lights"]())
    assert "feature: 3 light groups" in draw(scene, backend=backend).stats
    ray = PixelExplainer(scene, engine.Settings(backend=backend)).pixel(24, 16)
    text = "\n".join(explanation_lines(ray))
    assert f"'{scene.lights[0].name}' in the light group 'Key'" in text
