"""Settings at the API boundary: the same refusals from both tracers, and numbers of any kind that
are as good.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine_scenes import SCENES
from glint import engine
from glint.engine.settings import DECLARED, OFFERED

SOFT = SCENES["soft_lights"]()
SOFT = replace(SOFT, camera=replace(SOFT.camera, resolution=(8, 6)))

FAULTS = {
    "samples is 1.5: use a whole number": {"samples": 1.5},
    "samples is '4': use a whole number": {"samples": "4"},
    "light_samples is True: use a whole number": {"light_samples": True},
    "max_bounces is None: use a whole number": {"max_bounces": None},
    "threads is 1.5: use a whole number": {"threads": 1.5},
    "cutoff is None: use a number": {"cutoff": None},
    "filter_width is 'wide': use a number": {"filter_width": "wide"},
    "samples is 0: use at least 1": {"samples": 0},
    "light_samples is 0: use at least 1": {"light_samples": 0},
    "error_threshold is 256.0: use 0 (off) or up to 255 levels": {"error_threshold": 256.0},
    "max_bounces is 65: use 0 to 64": {"max_bounces": 65},
    "cutoff is nan: use 0 (off) to 1": {"cutoff": float("nan")},
    "threads is -1: use 0 (all cores) or more": {"threads": -1},
    "filter_width is inf: use 0 to 100 pixels": {"filter_width": float("inf")},
    "illumination 'DARK' is not one of PHYSICAL, CLASSIC": {"illumination": "DARK"},
    "acceleration 'WARP' is not one of AUTO, FAST, BALANCED, FINE": {"acceleration": "WARP"},
    "passes is 'Depth': use a set of names": {"passes": "Depth"},
    "no such pass: Heat, Light": {"passes": frozenset({"Light", "Depth", "Heat"})},
    "region is (0, 0, 0, 0): use whole numbers": {"region": (0, 0, 0, 0)},
    "region is (-1, 0, 4, 4): use whole numbers": {"region": (-1, 0, 4, 4)},
    "region is (0, 0, 4): use whole numbers": {"region": (0, 0, 4)},
    "region is (0.5, 0, 4, 4): use whole numbers": {"region": (0.5, 0, 4, 4)},
    "region (0, 0, 9, 6) reaches beyond the frame of 8 by 6 pixels": {"region": (0, 0, 9, 6)},
}


@pytest.mark.parametrize("backend", engine.available_backends())
@pytest.mark.parametrize("text", FAULTS)
def test_a_fault_is_named(backend: str, text: str) -> None:
    with pytest.raises(engine.SceneError) as caught:
        engine.render(SOFT, engine.Settings(**{"samples": 1, "backend": backend} | FAULTS[text]))
    assert text in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize("backend", engine.available_backends())
def test_numbers_as_numpy_counts_and_passes_in_a_list(backend: str) -> None:
    plain = engine.Settings(
        samples=2,
        light_samples=3,
        backend=backend,
        passes=frozenset({"Depth"}),
        region=(0, 0, 4, 4),
    )
    same = replace(
        plain,
        samples=np.int64(2),
        light_samples=np.uint8(3),
        threads=np.int32(0),
        passes=["Depth"],
        region=[0, 0, 4, 4],
    )
    first, second = engine.render(SOFT, plain), engine.render(SOFT, same)
    assert set(first.passes) == set(second.passes) == {"Combined", "Depth"}
    assert all(np.array_equal(first.passes[name], second.passes[name]) for name in first.passes)


MANUAL = (Path(__file__).parents[2] / "docs/manual/settings.md").read_text()


@pytest.mark.parametrize("name", [name for name in DECLARED if DECLARED[name].label])
def test_the_manual_has_a_row_for_a_setting(name: str) -> None:
    """Its label, every choice, and what it is to begin with."""
    declared = DECLARED[name]
    (row,) = re.findall(rf"^\| {re.escape(declared.label)} \|.*", MANUAL, re.M)
    assert all(f"*{label}*" in row for _, label, _ in declared.choices)
    if not declared.choices and name != "threads":
        assert re.search(rf"\b{getattr(OFFERED, name):g},?( all,)? to begin with", row)


@pytest.mark.parametrize("name", DECLARED)
def test_what_is_offered_is_within_the_range(name: str) -> None:
    declared = DECLARED[name]
    assert not engine.Settings().problems() and not OFFERED.problems()
    if declared.label and not declared.choices:
        top = declared.high if declared.typed is None else declared.typed
        assert declared.low <= getattr(OFFERED, name) <= top < float("inf")
        assert declared.slider is None or declared.slider <= top
