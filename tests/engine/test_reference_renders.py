"""The core draws the very bits of the reference renders."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import reference_renders as references
from engine_scenes import SCENES
from glint.engine.scene.problems import scene_problems
from glint.engine.settings import BUILDS
from native_tools import needs_core

RENEW = "if that is what the picture should be, tests/engine/renew_references.py renews them"


@needs_core
@pytest.mark.parametrize("name", SCENES)
def test_reference_render(name: str, tmp_path: Path) -> None:
    changes = references.difference(name, references.draw(name), tmp_path)
    assert not changes, f"{changes}; {RENEW}"


@needs_core
@pytest.mark.parametrize("acceleration", BUILDS)
@pytest.mark.parametrize("name", SCENES)
def test_trees_change_no_bit(name: str, acceleration: str) -> None:
    passes = references.draw(name, replace(references.SETTINGS, acceleration=acceleration))
    assert references.hashes_of(passes) == references.kept_hashes()[name]


def test_hashes_and_pictures_go_together() -> None:
    """Every scene has both, and the kept pictures have the kept hashes."""
    hashes = references.kept_hashes()
    assert set(hashes) == set(SCENES) == {path.stem for path in references.PICTURES.glob("*.exr")}
    for name, kept in hashes.items():
        picture = references.kept_picture(name)
        assert references.hashes_of({"Combined": picture})["Combined"] == kept["Combined"], name


def test_kept_pictures_are_small() -> None:
    assert sum(path.stat().st_size for path in references.PICTURES.iterdir()) < 2_000_000


@needs_core
def test_a_single_bit_is_seen_and_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = next(iter(SCENES))
    passes = references.draw(name)
    monkeypatch.setattr(references, "kept_hashes", lambda: {name: references.hashes_of(passes)})
    monkeypatch.setattr(references, "kept_picture", lambda _: passes["Combined"])
    assert references.difference(name, passes, tmp_path) == ""
    changed = {key: array.copy() for key, array in passes.items()}
    changed["Combined"][3, 5, 1] = np.nextafter(changed["Combined"][3, 5, 1], np.float32(9))
    changed["Depth"][0, 0, 0] += 1
    text = references.difference(name, changed, tmp_path)
    assert "other bits in Combined, Depth" in text and "differs in 1 of 3072 pixels" in text
    found = references.read_exr(tmp_path / f"{name}_now.exr")
    assert np.array_equal(found.view(np.uint32), changed["Combined"].view(np.uint32))


def test_rounding_leaves_no_long_float() -> None:
    """What goes into a reference render has float32's digits, so that NumPy's last bits do not
    matter.
    """
    scene = references.rounded(SCENES["soft_lights"]())
    for light in scene.lights:
        assert light.strength == np.float32(light.strength)
        assert np.array_equal(light.world_from_light, light.world_from_light.astype(np.float32))
    assert scene_problems(scene) == []
