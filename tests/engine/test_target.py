"""Settings from a target error: the prediction holds against the float64 tracer, on few rays, the same whoever asks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from engine_scenes import SCENES
from glint import engine
from glint.engine import target as t
from glint.engine.trade_crops import area, choose_crops
from native_tools import needs_core

SIZE = (96, 72)
BASE = engine.Settings(filter_width=1.5, light_samples=2)


def scene_of(name: str) -> engine.Scene:
    scene = SCENES[name]()
    return replace(scene, camera=replace(scene.camera, resolution=SIZE))


@needs_core
@pytest.mark.parametrize("target", [t.Target("LEVELS", 12.0), t.Target("RMSE", 0.02)], ids=lambda target: target.measure)
@pytest.mark.parametrize("name", ["flat_and_smooth", "soft_lights"])
def test_the_prediction_is_within_a_factor_of_two_of_the_true_error(name: str, target: t.Target) -> None:
    """The truth: the float64 tracer at 256 samples and, for what these miss, the core at 1024, whose settings differ in nothing else."""
    scene = scene_of(name)
    forecast = t.choose_settings(scene, BASE, target)
    film = engine.render(scene, forecast.settings)
    truth = engine.render(scene, replace(forecast.settings, samples=1024, error_threshold=0.0))
    strip = (0, 34, SIZE[0], 38)
    exact = engine.render(scene, replace(BASE, samples=1024, backend="NUMPY", region=strip))
    assert np.abs(exact.combined - truth.combined[34:38]).max() <= 1e-3 * np.abs(truth.combined).max()
    true = t.error_between(target.measure, [film.combined[..., :3]], [truth.combined[..., :3]])
    assert forecast.met
    assert forecast.error / 2 <= true <= forecast.error * 2
    reached = t.reached_error(scene, forecast, film)
    assert reached / 2 <= true <= reached * 2


@needs_core
def test_a_smaller_error_takes_more_rays_and_one_that_nothing_reaches_says_so() -> None:
    scene = scene_of("flat_and_smooth")
    coarse, fine = (t.choose_settings(scene, BASE, t.Target("RMSE", value)) for value in (0.1, 0.01))
    assert coarse.settings.samples < fine.settings.samples
    assert coarse.seconds < fine.seconds and fine.error <= 0.01 < coarse.error <= 0.1
    never = t.choose_settings(scene, BASE, t.Target("LEVELS", 1e-3))
    assert never.settings.samples == t.MOST_SAMPLES and not never.met and "best that is offered" in never.line


@needs_core
def test_the_same_settings_for_any_number_of_threads() -> None:
    chosen = {
        replace(t.choose_settings(scene_of("soft_lights"), replace(BASE, threads=n), t.Target("LEVELS", 16.0)).settings, threads=0)
        for n in (1, 3)
    }
    assert len(chosen) == 1


def test_what_is_no_matter_of_accuracy_stays_and_hard_shadows_stay_hard() -> None:
    base = replace(BASE, backend="NUMPY", light_samples=1, filter_width=0.0, passes=frozenset({"Depth"}), region=(8, 8, 40, 40))
    forecast = t.choose_settings(scene_of("soft_lights"), base, t.Target("LEVELS", 200.0))
    changed = {"samples": forecast.settings.samples, "error_threshold": forecast.settings.error_threshold}
    assert forecast.settings == replace(base, **changed)


def test_stopping_and_targets_that_are_not_sound() -> None:
    scene = scene_of("soft_lights")
    assert t.choose_settings(scene, replace(BASE, backend="NUMPY"), t.Target("RMSE", 0.1), should_stop=lambda: True) is None
    for target in (t.Target("COLOUR", 1.0), t.Target("RMSE", 0.0), t.Target("LEVELS", float("nan"))):
        with pytest.raises(engine.SceneError, match="target"):
            t.choose_settings(scene, BASE, target)


def test_pilot_and_check_look_at_different_squares() -> None:
    pilot, check = (choose_crops((480, 270), 16, 20, shift) for shift in (0.25, 0.75))
    seen = np.zeros((270, 480), int)
    for x0, y0, x1, y1 in pilot + check:
        assert x0 >= 0 and y0 >= 0 and x1 <= 480 and y1 <= 270
        seen[y0:y1, x0:x1] += 1
    assert seen.max() == 1 and seen.sum() == area(pilot) + area(check)
