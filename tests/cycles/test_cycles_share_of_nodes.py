"""How many combinations of node and settings agree with Cycles within 1e-4 at every pixel: the
figure that the tests of each kind of node, which allow for jumps, do not tell. Relative above 1.
"""

from __future__ import annotations

import sys

import numpy as np
import pytest

import test_cycles_color_nodes as colors
import test_cycles_math_nodes as numbers
import test_cycles_procedural_textures as patterns
import test_cycles_vector_nodes as vectors
import test_cycles_voronoi as voronoi
from node_tiles import compared

CLOSE = 1e-4
SHARE = 0.95

pytestmark = pytest.mark.slow


def of_trees(builds: list) -> list[float]:
    return [error(seen, expected) for seen, expected in zip(*compared(builds), strict=True)]


def of_patterns() -> list[float]:
    cases = patterns.all_cases()
    shown = zip(cases, *patterns.render(cases), strict=True)
    return [error(seen, patterns.expected(case, positions)) for case, seen, positions in shown]


def error(seen: np.ndarray, expected: np.ndarray) -> float:
    scale = np.maximum(np.abs(expected), 1.0)
    apart = np.where(np.isfinite(expected), np.abs(seen - expected) / scale, 0.0)
    return float(apart.max())


def test_most_combinations_are_those_of_cycles() -> None:
    worst = {
        "numbers": of_trees([build for _, build in numbers.CASES]),
        "vectors": of_trees([build for _, build in vectors.CASES]),
        "colours": of_trees(list(colors.CASES.values())),
        "Voronoi": of_trees(list(voronoi.CASES.values())),
        "patterns": of_patterns(),
    }
    for kind, errors in worst.items():
        close = sum(error <= CLOSE for error in errors)
        sys.stdout.write(f"{kind}: {close} of {len(errors)}, at most {max(errors):.1e}\n")
    everything = [error for errors in worst.values() for error in errors]
    assert np.mean(np.array(everything) <= CLOSE) >= SHARE
