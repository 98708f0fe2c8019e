"""Settings from a target error: the prediction holds against the float64 tracer, on few rays, the
same whoever asks.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES
from glint import engine
from glint.engine.analysis import target as t
from glint.engine.analysis.trade_crops import area
from native_tools import needs_core

SIZE = (96, 64)
BASE = engine.Settings(filter_width=1.5, light_samples=2)


def scene_of(name: str) -> engine.Scene:
    scene = SCENES[name]()
    return replace(scene, camera=replace(scene.camera, resolution=SIZE))


@functools.cache
def truth_of(name: str) -> np.ndarray:
    """(h, w, 3) of 256 samples by the core, which a strip of the float64 tracer's picture vouches
    for.
    """
    scene, plan = scene_of(name), replace(BASE, samples=8, region=(30, 30, 54, 34))
    core, exact = (
        engine.render(scene, replace(plan, backend=backend)).combined
        for backend in ("NATIVE", "NUMPY")
    )
    assert np.abs(core - exact).max() <= 1e-4 * np.abs(exact).max()
    return engine.render(scene, replace(plan, samples=256, region=None)).combined[..., :3]


CASES = (
    ("flat_and_smooth", t.Target("LEVELS", 12.0)),
    ("flat_and_smooth", t.Target("RMSE", 0.02)),
    ("soft_lights", t.Target("RMSE", 0.06)),
)


@needs_core
@pytest.mark.parametrize(
    ("name", "target"), CASES, ids=[f"{name}-{target.measure}" for name, target in CASES]
)
def test_the_prediction_is_within_a_factor_of_two_of_the_true_error(
    name: str, target: t.Target
) -> None:
    scene = scene_of(name)
    forecast = t.choose_settings(scene, BASE, target)
    film = engine.render(scene, forecast.settings)
    true = t.error_between(target.measure, film.combined[..., :3], truth_of(name))
    assert forecast.met and forecast.settings.samples >= 4
    assert forecast.error / 2 <= true <= forecast.error * 2
    assert len(forecast.look.squares(is_check=True)) > 1
    reached = t.reached_error(scene, forecast, film)
    assert reached / 2 <= true <= reached * 2


@needs_core
def test_a_smaller_error_takes_more_rays_and_one_that_nothing_reaches_says_so() -> None:
    scene = scene_of("flat_and_smooth")
    coarse, fine = (
        t.choose_settings(scene, BASE, t.Target("RMSE", value)) for value in (0.1, 0.02)
    )
    assert coarse.settings.samples < fine.settings.samples
    rays = [engine.render(scene, found.settings).stats["camera rays"] for found in (coarse, fine)]
    assert rays[0] < rays[1] and fine.error <= 0.02 < coarse.error <= 0.1
    never = t.choose_settings(
        scene, replace(BASE, region=(20, 20, 30, 30)), t.Target("LEVELS", 1e-3)
    )
    assert (
        never.settings.samples == t.MOST_SAMPLES
        and not never.met
        and "best that is offered" in never.line
    )


@needs_core
def test_the_same_settings_for_any_number_of_threads() -> None:
    chosen = {
        replace(
            t.choose_settings(
                scene_of("soft_lights"),
                replace(BASE, threads=n, region=(8, 8, 40, 40)),
                t.Target("LEVELS", 64.0),
            ).settings,
            threads=0,
        )
        for n in (1, 3)
    }
    assert len(chosen) == 1


def test_what_is_no_matter_of_accuracy_stays_and_hard_shadows_stay_hard() -> None:
    base = replace(
        BASE,
        backend="NUMPY",
        light_samples=1,
        filter_width=0.0,
        passes=frozenset({"Depth"}),
        region=(8, 8, 28, 28),
    )
    forecast = t.choose_settings(scene_of("soft_lights"), base, t.Target("LEVELS", 200.0))
    changed = {
        "samples": forecast.settings.samples,
        "error_threshold": forecast.settings.error_threshold,
    }
    assert forecast.settings == replace(base, **changed)


def test_stopping_and_targets_that_are_not_sound() -> None:
    scene = scene_of("soft_lights")
    assert (
        t.choose_settings(
            scene, replace(BASE, backend="NUMPY"), t.Target("RMSE", 0.1), should_stop=lambda: True
        )
        is None
    )
    for target in (
        t.Target("COLOUR", 1.0),
        t.Target("RMSE", 0.0),
        t.Target("LEVELS", float("nan")),
    ):
        with pytest.raises(engine.SceneError, match="target"):
            t.choose_settings(scene, BASE, target)


@needs_core
def test_pilot_and_check_look_at_different_squares_and_at_small_things() -> None:
    """A frame that is empty but for a thing of a few pixels: squares that lie evenly would
    miss it.
    """
    scene = replace(
        scene_of("flat_and_smooth"),
        camera=replace(SCENES["flat_and_smooth"]().camera, resolution=(480, 270)),
    )
    look = t.choose_settings(scene, BASE, t.Target("LEVELS", 60.0)).look
    lone = np.zeros_like(look.apart)
    lone[123, 321] = 1.0
    look = replace(look, apart=lone)
    pilot, check = look.squares(is_check=False), look.squares(is_check=True)
    seen = np.zeros((270, 480), int)
    for x0, y0, x1, y1 in pilot + check:
        assert 0 <= x0 < x1 <= 480 and 0 <= y0 < y1 <= 270
        seen[y0:y1, x0:x1] += 1
    assert (
        set(pilot) < set(check)
        and len(check) == 2 * len(pilot)
        and seen.max() == 2
        and (seen > 0).sum() == area(check)
    )
    assert any(x0 <= 321 < x1 and y0 <= 123 < y1 for x0, y0, x1, y1 in pilot)


@needs_core
def test_pixels_of_the_squares_stand_for_those_of_the_frame_with_as_much_to_do() -> None:
    """The squares lie where there is most to do, a twentieth of the frame here, which is to count
    for no more than that.
    """
    look = t.choose_settings(scene_of("flat_and_smooth"), BASE, t.Target("RMSE", 0.2)).look
    busy = np.zeros_like(look.apart)
    busy[:, -5:] = 1.0
    look = replace(look, apart=busy)
    crops = look.squares(is_check=False)
    here, weights = (
        np.concatenate([crop.ravel() for crop in look.cut(busy, crops)]),
        look.weights(crops),
    )
    assert here.mean() > 2 * busy.mean()
    assert weights[here == 1].sum() == pytest.approx(busy.sum())
    assert weights.sum() == pytest.approx(busy.size)
