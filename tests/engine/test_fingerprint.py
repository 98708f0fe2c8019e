"""Fingerprints: equal values give equal ones, and every change gives another."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import engine_scenes as scenes
from glint.engine import Scene, Settings
from glint.engine.analysis.fingerprint import picture_fingerprint, settings_text, value_fingerprint


def make_scene() -> Scene:
    lamp = scenes.light("POINT")
    placed = (scenes.s.Instances("box", 0, scenes.at(), (0,)),)
    return Scene(
        scenes.camera(),
        (scenes.box_mesh(),),
        placed,
        (scenes.surface(specular=0.5),),
        lights=(lamp,),
    )


def nudged(array):
    """A copy whose last value is the next float."""
    copy = np.array(array)
    copy.flat[-1] = np.nextafter(copy.flat[-1], np.inf, dtype=copy.dtype)
    return copy


def test_a_scene_made_twice_has_one_fingerprint():
    assert value_fingerprint(make_scene()) == value_fingerprint(make_scene())


@pytest.mark.parametrize(
    "change",
    [
        lambda s: replace(
            s, camera=replace(s.camera, world_from_camera=nudged(s.camera.world_from_camera))
        ),
        lambda s: replace(
            s, geometries=(replace(s.geometries[0], vertices=nudged(s.geometries[0].vertices)),)
        ),
        lambda s: replace(s, instances=(replace(s.instances[0], visible_shadow=False),)),
        lambda s: replace(s, materials=(replace(s.materials[0], lobes=s.materials[0].lobes[:1]),)),
        lambda s: replace(
            s, materials=(replace(s.materials[0], lobes=s.materials[0].lobes[::-1]),)
        ),
        lambda s: replace(s, lights=()),
        lambda s: replace(s, lights=(replace(s.lights[0], strength=400.00000000000006),)),
        lambda s: replace(s, world=replace(s.world, transparent=True)),
    ],
)
def test_every_change_of_a_scene_is_seen(change):
    scene = make_scene()
    assert value_fingerprint(change(scene)) != value_fingerprint(scene)


def test_values_do_not_run_together():
    pairs = [
        (("ab", "c"), ("a", "bc")),
        ((1, (2, 3)), ((1, 2), 3)),
        ((1,), (1.0,)),
        ((None,), ("None",)),
        ((), ((),)),
    ]
    pairs += [
        ((np.zeros(2, np.float32),), (np.zeros(1, np.float64),)),
        ((np.zeros((2, 3)),), (np.zeros((3, 2)),)),
    ]
    for one, other in pairs:
        assert value_fingerprint(one) != value_fingerprint(other)


def test_a_picture_is_known_by_its_bits():
    passes = {"Combined": np.ones((2, 3, 4), np.float32), "Depth": np.ones((2, 3, 1), np.float32)}
    known = picture_fingerprint(passes)
    assert picture_fingerprint(dict(reversed(passes.items()))) == known
    assert picture_fingerprint({**passes, "Depth": nudged(passes["Depth"])}) != known
    assert picture_fingerprint({"Combined": passes["Combined"]}) != known
    assert picture_fingerprint({**passes, "Depth": passes["Depth"].reshape(3, 2, 1)}) != known
    assert picture_fingerprint({"Depth": np.float32([[0.0]])}) != picture_fingerprint(
        {"Depth": np.float32([[-0.0]])}
    )


def test_a_large_picture_is_known_however_many_threads_look_at_it():
    passes = {
        "Combined": np.arange(600_000, dtype=np.float32).reshape(300, 500, 4),
        "Depth": np.ones((300, 500, 1), np.float32),
    }
    known = picture_fingerprint(passes)
    with ThreadPoolExecutor(3) as threads:
        assert picture_fingerprint(passes, threads.map) == known
    for place in (0, 300_000, 599_999):
        other = passes["Combined"].copy()
        other.flat[place] += 1
        assert picture_fingerprint({**passes, "Combined": other}) != known


def test_settings_without_threads():
    base = Settings(passes=frozenset({"Depth", "Normal"}))
    assert settings_text(replace(base, threads=7)) == settings_text(base)
    assert settings_text(replace(base, samples=17)) != settings_text(base)
    assert json.loads(settings_text(base))["passes"] == ["Depth", "Normal"]
