"""Scenes that Hypothesis makes up: the core's picture is the float64 reference's.

GLINT_SCENES sets how many there are.
"""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings

import random_scenes
from engine_scenes import GREY_WORLD, camera
from glint import engine
from glint.engine import scene as s
from glint.engine.scene.problems import scene_problems
from test_core_against_reference import conditioned, relative_error
from test_random_scenes import EDGES

pytestmark = pytest.mark.skipif(
    "NATIVE" not in engine.available_backends(), reason="the core's library is not built"
)
WORK = {"Cost", "Fallbacks"}
"""Passes that tell what was done, not what is seen: a light's point in the very plane of a surface
is asked for or not as rounding has it, and sheds nothing.
"""
ALPHA_ROUNDING = 2 * 128 * 2.0**-53
"""What is left of the alpha of pixels that holdouts and catchers take all of: 1 - Σ T (1 - t) over
what a ray meets, 128 surfaces at most, is 0 but for the rounding of as many products and of as many
sums, none of them above 1. Colour has no such difference.
"""
PASSES = frozenset(engine.PASSES) - {"Combined"} - WORK
SCENES = int(os.environ.get("GLINT_SCENES", "60"))


def well_conditioned(key: str, film: engine.Film) -> np.ndarray:
    """The pass, and light by the surface that gives it back times what it gives back: the light
    itself. A colour that is 0 but for rounding says nothing.
    """
    surface, _, what = key.rpartition(" ")
    values = film.passes[key]
    if what in ("Direct", "Indirect") and f"{surface} Color" in film.passes:
        values = values.astype(np.float64) * film.passes[f"{surface} Color"]
    return conditioned(key, values)


@hypothesis_settings(
    max_examples=SCENES,
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
@given(random_scenes.scenes(), random_scenes.settings())
def test_same_picture(scene, settings):
    assert scene_problems(scene) == []
    settings = replace(settings, passes=PASSES)
    core, reference = (
        engine.render(scene, replace(settings, backend=backend)) for backend in ("NATIVE", "NUMPY")
    )
    assert core.notes == reference.notes
    for key in reference.passes:
        both = [well_conditioned(key, film) for film in (core, reference)]
        if key == "Combined":
            empty = np.abs([picture[..., 3] for picture in both]).max(0) <= ALPHA_ROUNDING
            for picture in both:
                picture[empty, 3] = 0.0
        errors = relative_error(*both)
        off = ~(errors <= 1e-4)
        assert off.mean() <= EDGES, f"{key}: {off.sum()} pixels differ, by up to {errors.max()}"


@pytest.mark.parametrize("backend", engine.settings.BACKENDS)
def test_a_sky_is_seen_in_the_world_alone(backend):
    """Whatever a DOME light says of its own shape."""
    map_ = np.ones((8, 16, 3), np.float32)
    sky = s.Light("sky", "DOME", np.eye(3, 4), radiance=map_, radius=0.2)
    empty = s.Scene(camera(size=(8, 8)), lights=(sky,), world=GREY_WORLD)
    drawn = [
        engine.render(
            replace(empty, lights=(replace(sky, visible_camera=seen, visible_mirror=seen),)),
            engine.Settings(samples=1, backend=backend),
        ).combined
        for seen in (False, True)
    ]
    assert (drawn[0] == drawn[1]).all() and drawn[0][..., :3].max() > 0
