"""What few of a pixel's rays find that rough surfaces reflect: no dots, and little light lost."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from glint.engine import Settings, render
from glint.engine.scene import Input, Instances, Lobe, Material, Scene
from test_reflections import BACKENDS, FLOOR, LAMP, above, metal, paint, square

UNLIMITED = 1e4
"""Glow of the floor beside which what it reflects is little, and so all shown."""
WIDE, NARROW = 40.0, 200.0  # exponents
RARE = 0.05
"""How wide a strip is that few of a pixel's rays find, before a NARROW lobe."""
WEAK = 0.05
"""What gloss gives back that is no metal's."""


def floor_below(
    strip: float, glow: float, exponent: float, size: tuple[int, int], strength: float
) -> Scene:
    """A dull floor that glows, and what it reflects: a lit strip above it, so wide, and as much
    wider and longer as the lobe is than a NARROW one.
    """
    wider = np.sqrt((NARROW + 2) / (exponent + 2))
    x, y, z = wider * strip / 2, wider * 0.4, 1.6
    above_it = square((-x, -y, z), (-x, y, z), (x, y, z), (x, -y, z))
    floor = Material(
        "floor", (*metal(exponent, strength).lobes, Lobe("EMISSION", (Input((glow,) * 3),)))
    )
    lamp = replace(LAMP, world_from_light=np.c_[np.eye(3), (0.0, 0.0, 0.8)], strength=400.0)
    return Scene(
        replace(above(size, 0.4), clip_start=1.0),  # past the strip
        (FLOOR, above_it),
        tuple(Instances(f"{k}", k, np.eye(3, 4)[None], (k,)) for k in range(2)),
        (floor, paint(0.8, 0.6, 0.4)),
        (),
        (lamp,),
    )


def reflected(
    strip: float,
    glow: float,
    exponent: float = WIDE,
    size: tuple[int, int] = (16, 16),
    strength: float = WEAK,
    **more,
) -> np.ndarray:
    """(h, w) what the floor reflects, in red."""
    plan = {"samples": 64, "filter_width": 0.0, "max_bounces": 2, "reflections": "ALL"}
    settings = Settings(**plan | {"mesh_light": "OFF", "passes": frozenset({"Mirror"})} | more)
    film = render(floor_below(strip, glow, exponent, size, strength), settings)
    return film.passes["Mirror"][..., 0].astype(np.float64)


@pytest.mark.parametrize("exponent", [WIDE, NARROW])
def test_what_few_rays_find_is_no_dot(exponent: float) -> None:
    """Pixels that show more than those around them by a third of the floor's own light."""
    glow = 0.1 * WEAK

    def dots(picture: np.ndarray) -> int:
        around = picture.reshape(8, 4, 8, 4).mean((1, 3))
        return (picture - around.repeat(4, 0).repeat(4, 1) > 0.3 * glow).sum()

    all_of_it, shown = (reflected(0.004, g, exponent, (32, 32)) for g in (UNLIMITED, glow))
    assert dots(all_of_it) > 200
    assert dots(shown) < 0.2 * dots(all_of_it)


@pytest.mark.parametrize("exponent", [WIDE, NARROW])
def test_what_many_rays_find_is_shown(exponent: float) -> None:
    """Also where a pixel shows nothing else. Of the rest more samples show ever more."""
    assert 0.99 < share(1.0, exponent) <= 1 + 1e-6
    lost = [1 - share(RARE, exponent, samples=n) for n in (64, 256, 1024, 4096)]
    assert lost[0] > 0.3
    assert all(more < 0.5 * less for less, more in pairwise(lost))


def share(strip: float, exponent: float, **more) -> float:
    """How much is shown of what a floor that shows nothing else reflects."""
    shown, all_of_it = (reflected(strip, g, exponent, **more) for g in (0.0, UNLIMITED))
    return shown.mean() / all_of_it.mean()


@pytest.mark.parametrize("exponent", [WIDE, NARROW])
def test_metals_show_what_few_rays_find(exponent: float) -> None:
    """As they show little else."""
    assert 0.9 < share(0.05, exponent, strength=1.0) <= 1 + 1e-6
    assert share(0.2, exponent, strength=1.0) > 0.998


@pytest.mark.parametrize("exponent", [WIDE, NARROW])
def test_both_tracers_limit_the_same(exponent: float) -> None:
    """Of an odd frame."""
    for threshold in (0.0, 4.0):  # then some pixels stop early
        plan = {"exponent": exponent, "size": (13, 7), "error_threshold": threshold}
        for plan["strength"] in (WEAK, 0.2):  # and what is limited less
            core, reference = (reflected(RARE, 0.02 * WEAK, backend=b, **plan) for b in BACKENDS)
            assert (core < 0.8 * reflected(RARE, UNLIMITED, **plan)).any()
            np.testing.assert_allclose(core, reference, rtol=1e-4, atol=1e-5 * WEAK)


def test_the_bits_are_the_same_for_threads_and_regions() -> None:
    for more in ({}, {"error_threshold": 1.0}):
        plan = {"strip": 0.02, "glow": 0.1 * WEAK, "size": (37, 34)} | more
        whole = reflected(**plan, threads=1)
        np.testing.assert_array_equal(whole, reflected(**plan, threads=3))
        part = reflected(**plan, region=(5, 7, 36, 20))
        np.testing.assert_array_equal(part, whole[7:20, 5:36])
