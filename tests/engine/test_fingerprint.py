"""Fingerprints: equal values give equal ones, and every change gives another."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

import engine_scenes as scenes
from glint.engine import Scene, Settings
from glint.engine.analysis.fingerprint import picture_fingerprint, settings_text, value_fingerprint
from glint.engine.analysis.universal_hash import block_sums, condensed
from glint.engine.native import binding
from native_tools import needs_core


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


def test_a_large_picture_is_known_by_each_of_its_bits():
    combined = np.arange(600_001, dtype=np.float32).reshape(1, -1, 1)
    known = {picture_fingerprint({"Combined": combined})}
    for place in (0, 1023, 1024, 300_000, 599_999, 600_000):
        for change in (np.nextafter(combined.flat[place], np.float32(np.inf)), -1 - place):
            other = combined.copy()
            other.flat[place] = change
            known.add(picture_fingerprint({"Combined": other}))
    swapped, turned = combined.copy(), combined.copy()
    swapped.flat[[7, 519]] = combined.flat[[519, 7]]  # the two of one product
    turned.flat[[5, 6]] *= -1  # signs: the uppermost bits, which sums alone would lose
    known |= {picture_fingerprint({"Combined": picture}) for picture in (swapped, turned)}
    assert len(known) == 1 + 12 + 2


def exact_sums(words):
    """NH by its formula, in whole numbers."""

    def key(number):
        z = (number + 1) * 0x9E3779B97F4A7C15 % 2**64
        z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ z >> 27) * 0x94D049BB133111EB % 2**64
        return (z ^ z >> 31) >> 32

    keys = [key(number) for number in range(1024 + 4)]
    words = [int(word) for word in words] + [0] * (-len(words) % 1024)
    blocks = [words[first : first + 1024] for first in range(0, len(words), 1024)]
    return [
        [
            sum(
                (block[k] + keys[k + shift])
                % 2**32
                * ((block[512 + k] + keys[512 + k + shift]) % 2**32)
                for k in range(512)
            )
            % 2**64
            for shift in range(4)
        ]
        for block in blocks
    ]


@needs_core
@pytest.mark.parametrize("count", [1, 1023, 1024, 1025, 4096 + 512])
def test_sums_of_blocks_are_those_of_whole_numbers(count):
    words = np.random.default_rng(count).integers(0, 2**32, count, dtype=np.uint32)
    words[::5] = 2**32 - 1
    sums = np.empty((-(-count // 1024), 4), np.uint64)
    binding.library().glint_universal_hash(words.ctypes.data, count, sums.ctypes.data)
    assert sums.tolist() == block_sums(words).tolist() == exact_sums(words)


def test_bytes_after_the_last_word_count():
    values = np.zeros(5003, np.uint8)
    other = values.copy()
    other[-1] = 1
    assert condensed(values) != condensed(other) and len(condensed(values)) < 100


def test_settings_without_threads():
    base = Settings(passes=frozenset({"Depth", "Normal"}))
    assert settings_text(replace(base, threads=7)) == settings_text(base)
    assert settings_text(replace(base, samples=17)) != settings_text(base)
    assert json.loads(settings_text(base))["passes"] == ["Depth", "Normal"]


@pytest.mark.parametrize("words", [1024, 2048, 1023])
def test_arrays_of_one_shape_are_hashed_as_if_stacked(monkeypatch, words):
    """So that stamps stay the same; without a copy where they are whole blocks, as images are."""
    arrays = list(np.random.default_rng(words).random((3, words, 1), np.float32))
    stacked = np.stack(arrays)
    if words % 1024 == 0:
        monkeypatch.delattr(np, "stack")
    wanted = hashlib.sha256(f"arrays 3array <f4 (3, {words}, 1)".encode() + condensed(stacked))
    assert value_fingerprint(arrays) == wanted.hexdigest()
