"""What shadow catchers show and Ambient Occlusion, resolved: how near they come to the truth, what
stays, and what both tracers, all regions and passes agree on.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from glint.engine.film import CATCHER, LIGHTING, OCCLUSION, PARTS
from test_resolve import corner, needs_core, settings

KINDS = ("pass", "alpha", "behind")


def caught(kind: str, size: int = 48) -> s.Scene:
    """The corner, whose floor and wall catch shadows, under a sky that is a light where settings
    say so.
    """
    scene = corner(size)
    floor, wall, box = scene.instances
    shown = replace(floor, catcher=True), replace(wall, catcher=True), box
    radiance = np.full((4, 8, 3), (0.4, 0.6, 0.8), np.float32)
    sky = s.Light("sky", "DOME", np.eye(3, 4), radiance=radiance, light_group=1)
    lights = (*(replace(light, light_group=0) for light in scene.lights), sky)
    world = s.World(background=(0.4, 0.6, 0.8), transparent=kind == "alpha", light_group=1)
    return replace(
        scene,
        instances=shown,
        lights=lights,
        world=replace(world, occlusion_distance=2.0),
        light_groups=("lamps", "sky"),
    )


STRAIGHT = {"diffuse_bounces": 0, "reflections": "OFF", "world_light": "CONSTANT"}


def plan(kind: str, soft_light: str, samples: int = 8, **more) -> engine.Settings:
    passes = frozenset({CATCHER, OCCLUSION} if kind == "pass" else {OCCLUSION})
    return settings(soft_light, samples, **{"passes": passes, "world_light": "OCCLUDED", **more})


def shown(film: engine.Film, kind: str) -> np.ndarray:
    """(h, w, c) what catchers show."""
    return (film.passes[CATCHER] if kind == "pass" else film.combined).astype(float)


@cache
def truth(kind: str) -> engine.Film:
    return engine.render(caught(kind), plan(kind, "RESOLVED", 64, light_samples=32))


def is_alone(film: engine.Film) -> np.ndarray:
    """(h, w) bool: pixels that show catchers alone."""
    return ~film.passes[OCCLUSION].any(-1)


def error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(((found - expected) ** 2).mean()))


@needs_core
@pytest.mark.parametrize("kind", KINDS)
def test_averaging_is_nearer_to_the_truth(kind):
    dealt, resolved = (engine.render(caught(kind), plan(kind, k)) for k in ("DEALT", "RESOLVED"))
    expected = truth(kind)
    alone = is_alone(expected)
    off, off_resolved = (
        error(shown(film, kind)[alone], shown(expected, kind)[alone]) for film in (dealt, resolved)
    )
    assert off_resolved < 0.5 * off


@needs_core
def test_ambient_occlusion_is_nearer_to_the_truth():
    """But in creases of few pixels, which are averaged over."""
    scene = replace(corner(96), world=s.World(occlusion_distance=2.0))
    chosen = {**STRAIGHT, "filter_width": 0.0}
    expected, *found = (
        engine.render(scene, plan("alpha", *own, **chosen)).passes[OCCLUSION].astype(float)
        for own in (("SHARED", 128), ("DEALT", 8), ("RESOLVED", 8))
    )
    seen = expected.any(-1) & (expected < 0.99).all(-1)
    off, off_resolved = (np.median(np.abs(film - expected)[seen]) for film in found)
    assert off_resolved < 0.5 * off
    assert error(found[1], expected) < error(found[0], expected)


@needs_core
@pytest.mark.parametrize("kind", KINDS)
def test_few_points_a_sample_leave_no_shadow_too_light(kind):
    """As the mean of ratios is, each of so few directions of the sky."""
    scene = caught(kind)
    scene = replace(scene, lights=scene.lights[-1:])
    few, many = {"light_samples": 1}, {"samples": 64, "light_samples": 64}
    found, expected = (
        engine.render(
            scene, plan(kind, "RESOLVED", **{**STRAIGHT, "world_light": "OCCLUDED", **own})
        )
        for own in (few, many)
    )
    off = (shown(found, kind) - shown(expected, kind))[is_alone(expected)].mean(0)
    assert (np.abs(off) < 2e-3).all()


@needs_core
@pytest.mark.parametrize("kind", KINDS)
def test_edges_of_shadows_are_not_blurred(kind):
    """Straight light of a wide lamp and a small one: averaging adds next to nothing to what the
    samples are off by.
    """
    scene = caught(kind)
    near = plan(kind, "RESOLVED", 256, light_samples=8, **STRAIGHT)
    expected = engine.render(scene, near)
    alone = is_alone(expected)
    off, off_resolved = (
        error(
            shown(engine.render(scene, plan(kind, k, 16, **STRAIGHT)), kind)[alone],
            shown(expected, kind)[alone],
        )
        for k in ("DEALT", "RESOLVED")
    )
    assert off_resolved < 1.1 * off


@needs_core
@pytest.mark.parametrize("kind", KINDS)
def test_hard_lamps_throw_the_same_shadows_to_the_bit(kind):
    scene = caught(kind)
    hard = tuple(replace(light, radius=0.0) for light in scene.lights[:-1])
    shared, resolved = (
        engine.render(replace(scene, lights=hard), plan(kind, k, **STRAIGHT)).passes
        for k in ("SHARED", "RESOLVED")
    )
    for name, values in shared.items():
        assert np.array_equal(resolved[name], values), name


@needs_core
@pytest.mark.parametrize(("kind", "threshold"), [("pass", 0.0), ("alpha", 4.0), ("behind", 0.0)])
def test_tracers_agree(kind, threshold):
    more = {CATCHER} if kind == "pass" else set()
    passes = frozenset({OCCLUSION, "Samples", "Error", *PARTS, *LIGHTING, *more})
    for samples in (2, 8):
        chosen = plan(kind, "RESOLVED", samples, error_threshold=threshold, passes=passes)
        core, reference = (
            engine.render(caught(kind, 12), replace(chosen, backend=backend)).passes
            for backend in ("NATIVE", "NUMPY")
        )
        assert np.array_equal(core["Samples"], reference["Samples"])
        for name, values in reference.items():
            expected = values.astype(float)
            off = np.abs(core[name].astype(float) - expected)
            assert (off <= 3e-4 * np.abs(expected) + 1e-6 * max(1, expected.max())).all(), name


@needs_core
@pytest.mark.parametrize("threshold", [0.0, 4.0])
@pytest.mark.parametrize("kind", KINDS)
def test_a_region_has_the_bits_of_the_frame(kind, threshold):
    chosen = plan(kind, "RESOLVED", error_threshold=threshold)
    whole = engine.render(caught(kind), replace(chosen, threads=1)).passes
    for x0, y0, x1, y1 in ((0, 0, 7, 5), (13, 9, 31, 40), (40, 33, 48, 48)):
        region = replace(chosen, region=(x0, y0, x1, y1), threads=3)
        for name, values in engine.render(caught(kind), region).passes.items():
            assert np.array_equal(values, whole[name][y0:y1, x0:x1]), name


@needs_core
@pytest.mark.parametrize("backend", ["NATIVE", "NUMPY"])
@pytest.mark.parametrize("kind", KINDS)
def test_sums_stay(kind, backend):
    """Parts and groups sum to Combined, and the picture does not depend on who asks for more."""
    few = plan(kind, "RESOLVED", 4, backend=backend)
    scene = caught(kind, 8)
    alone = engine.render(scene, few)
    film = engine.render(scene, replace(few, passes=few.passes | set(PARTS)))
    assert np.array_equal(alone.combined, film.combined)
    combined = film.combined[..., :3].astype(float)
    parts = sum(film.passes[name].astype(float) for name in PARTS)
    assert np.allclose(parts, combined, atol=2e-6 * combined.max())
    groups = sum(film.passes[f"Light Group {name}"].astype(float) for name in scene.light_groups)
    assert np.allclose(groups, combined, atol=2e-6 * combined.max())
