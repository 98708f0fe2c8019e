"""Mirror and glass split at a path's first surfaces, beyond these by chance
(semantics/mirrors.md).
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bounced_scenes import HERE, ball, lamp
from bounced_scenes import drawn as bounced
from glint.engine.film import Film
from glint.engine.reference import paths
from glint.engine.reference.rays import IncoherentRays
from glint.engine.scene import Camera, Instances, Lobe, Material, Scene, World
from native_tools import needs_core
from test_path_bounces import SCENES, film, noise_of

pytestmark = needs_core
DEEP = 8
"""Bounces."""


@cache
def drawn(backend: str, samples: int = 2) -> Film:
    return film(SCENES["glass"](), 1, backend, samples=samples, max_bounces=DEEP)


def colors(found: Film) -> np.ndarray:
    return found.combined[..., :3].astype(np.float64)


def test_both_tracers_choose_the_same() -> None:
    core, reference = (colors(drawn(backend)) for backend in ("NATIVE", "NUMPY"))
    off = np.abs(core - reference).max(-1) > 1e-4 * reference.mean()
    assert off.mean() <= 2 / off.size  # rounding says what a ray at an edge meets


def test_the_mean_is_that_of_all_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    some = drawn("NUMPY", 16)
    monkeypatch.setattr(paths, "LEAST_WEIGHT", 2.0**-40)
    every = film(SCENES["glass"](), 1, "NUMPY", samples=16, max_bounces=DEEP)
    apart = colors(some) - colors(every)
    assert apart.any()
    assert (np.abs(apart.mean((0, 1))) <= 4 * noise_of(apart)).all()
    rays = [found.stats["rays"] for found in (some, every)]
    assert rays[0] < 0.9 * rays[1]


def test_as_deep_as_eyes_see_nothing_is_left_to_chance(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = {"samples": 2, "max_bounces": paths.SPLITS}
    found = film(SCENES["glass"](), 1, "NUMPY", **plan)
    monkeypatch.setattr(paths, "LEAST_WEIGHT", 1e3)
    np.testing.assert_array_equal(
        film(SCENES["glass"](), 1, "NUMPY", **plan).combined, found.combined
    )


def test_of_two_halves_of_a_path_just_one_goes_on() -> None:
    """What a surface mirrors and what goes through, which weigh the least weight together: of each
    as many as its share.
    """
    share, count = 0.3, 4096
    rays = IncoherentRays.of(np.zeros((3, 1)), np.ones((3, 1)), np.zeros(1), np.ones(1))
    path = replace(paths.camera_paths(rays, np.ones(1)), depth=paths.SPLITS + 1)
    gone = []
    for weight, refracted in ((1 - share, False), (share, True)):
        here = replace(
            path,
            weight=np.full((3, 1), weight * paths.LEAST_WEIGHT),
            refractions=np.full(1, 2 + refracted),
        )
        some = [paths._going_on(here, sample, refracted=refracted) for sample in range(count)]
        assert {float(p.weight.max()) for p in some if len(p)} == {paths.LEAST_WEIGHT}
        gone.append(np.array([len(p) for p in some]))
    np.testing.assert_array_equal(gone[0] + gone[1], 1)
    assert abs(gone[1].mean() - share) < 2 / np.sqrt(count)


def test_nested_balls_under_an_even_sky_are_as_bright_as_that() -> None:
    """In both tracers, whose choices of what is mirrored and what goes through are the same."""
    glass = Material(
        "glass", tuple(Lobe(kind, fresnel=True, ior=1.45) for kind in ("MIRROR", "REFRACTION"))
    )
    frame = np.column_stack([np.eye(3), (0.0, 0.0, 9.0)])
    sky = replace(lamp("DOME", strength=1.0), radiance=np.ones((4, 8, 3), np.float32))
    scene = Scene(
        Camera("ORTHOGRAPHIC", frame, (-1.0, 1.0, -1.0, 1.0), (8, 8)),
        (ball(0.8), ball(0.5)),
        tuple(Instances(str(k), k, HERE[None], (0,)) for k in range(2)),
        (glass,),
        world=World(background=(1.0, 1.0, 1.0)),
        lights=(sky,),
    )
    plan = {"samples": 2, "max_bounces": 12, "soft_light": "DEALT"}
    core, reference = (bounced(scene, 0, backend, **plan) for backend in ("NATIVE", "NUMPY"))
    np.testing.assert_allclose(core, reference, rtol=1e-5)
    assert abs(core.mean() - 1) < 4 * noise_of(core).max()
    assert 0.01 < core[..., 0].std() < 0.035
