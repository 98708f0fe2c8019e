"""The bounds of what float rounds in traversal (core/src/bvh/traverse/error_bounds.h), proved by
Gappa from the scripts of `error_bounds`: what these prove is added up here.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from string import Template

import pytest

SCRIPTS = Path(__file__).with_name("error_bounds")
HEADER = SCRIPTS.parents[2] / "engine/core/src/bvh/traverse/error_bounds.h"
U = 2.0**-24

needs_gappa = pytest.mark.skipif(
    shutil.which("gappa") is None, reason="Gappa is not installed (Debian: apt-get install gappa)"
)


def is_proved(name: str, **numbers: float) -> bool:
    """Whether Gappa proves a script with these numbers in it."""
    script = Template((SCRIPTS / f"{name}.gappa").read_text(encoding="utf-8"))
    text = script.substitute({key: value.hex() for key, value in numbers.items()})
    done = subprocess.run(["gappa"], input=text, capture_output=True, text=True, check=False)
    assert "syntax" not in done.stderr, done.stderr
    return done.returncode == 0


def constant(name: str) -> float:
    """A constant of the core, in float."""
    found = re.search(rf"\b{name} = (0x[0-9a-f.]+p-?\d+)f?\b", HEADER.read_text(encoding="utf-8"))
    assert found, name
    return float.fromhex(found[1])


@needs_gappa
def test_corners_seen_in_float() -> None:
    """The product with the slope is off by 4.04 u, the difference to the origin by 2.03 u, their
    difference by u more; products of edge functions need u of the extent.
    """
    assert is_proved("corner")
    product, difference = float.fromhex("0x4.08p-24"), float.fromhex("0x2.06p-24")
    assert constant("kSeenAlong") >= (product + difference) * (1 + 2 * U)
    assert constant("kSeenAcross") >= (difference + U) * (1 + 2 * U) + U


@needs_gappa
@pytest.mark.parametrize("exponent", [-60, -24, -20, -10, 0, 10, 60])
def test_edge_functions(exponent: int) -> None:
    """edge_margin, where corners are `d` off and the extent is 1, which both may be larger by what
    single precision displaces.
    """
    d = 2.0**exponent
    margin = 4 * (1 + 4 * (d + U)) * (d + U)
    assert is_proved("edges", d=d, margin=margin * (1 - 8 * U))
    assert not is_proved("edges", d=d, margin=1.9 * d * d if d > 1 else 3.9 * d)


@needs_gappa
@pytest.mark.parametrize(("least", "most"), [(1.0, 1.25), (1.25, 1.5), (1.5, 1.75), (1.75, 2.0)])
def test_depths(least: float, most: float) -> None:
    """What sums of weighted depths round, and 2.03 u of the depths themselves, is less than
    kSumMargin.
    """
    room = constant("kSumMargin") - float.fromhex("0x2.06p-24")
    assert is_proved("depth", least=least, most=most, margin=room)
    assert not is_proved("depth", least=least, most=most, margin=U)


@needs_gappa
def test_slopes_of_beams() -> None:
    """A beam's slopes are off by 4.03 u, corners by 10 u of slope and depth and 5 u of the place
    across: the difference to the apex by 2.03 u of the depth and of what is `across` before the
    shear, the middle's product and the place by u of the place across each.
    """
    assert is_proved("slope")
    slope, difference = float.fromhex("0x4.04p-24"), float.fromhex("0x2.06p-24")
    assert (slope + 2 * difference) * (1 + 4 * U) <= 10 * U
    assert (difference + 2 * U) * (1 + 4 * U) <= 5 * U


@needs_gappa
def test_planes_that_packets_cross() -> None:
    """What a crossing with a box's plane is off by across is less than boxes have room for; the
    inverse slope is off by u for the slope and u of its own.
    """
    crossing = float.fromhex("0xe.1p-24")
    assert is_proved("box", inverse=2.01 * U, margin=crossing)
    assert not is_proved("box", inverse=2.01 * U, margin=13 * U)
    assert crossing <= constant("kBoxMargin") * (1 - 8 * U)


@needs_gappa
def test_depths_of_beams() -> None:
    """A plane's normal, its distance's products and what 1 / depth rounds are within what
    `see_triangles` allows: 25 u of the longest edge's cube for three components of the normal,
    4.25 u of the depth for a corner and two roundings, and 8 u of the terms.
    """
    normal, rest = float.fromhex("0x8.01p-24"), float.fromhex("0x6.02p-24")
    assert is_proved("normal", margin=normal)
    assert not is_proved("normal", margin=7.5 * U)
    assert is_proved("plane", margin=rest)
    assert not is_proved("plane", margin=5 * U)
    cubes, depths = beam_bounds()
    assert 3 * normal * (1 + 8 * U) <= cubes
    assert (float.fromhex("0x2.06p-24") + 2.01 * U) * (1 + 8 * U) <= depths
    assert rest * (1 + 8 * U) <= 8 * U


def beam_bounds() -> tuple[float, float]:
    """The two constants of `bent`, in the header of beams."""
    text = HEADER.with_name("kernel_beam_triangles.h").read_text(encoding="utf-8")
    found = re.search(
        r"splat\((0x[0-9a-f.]+p-\d+)f\) \* deepest,\s+splat\((0x[0-9a-f.]+p-\d+)f\) \* longest_3",
        text,
    )
    assert found
    return float.fromhex(found[2]), float.fromhex(found[1])
