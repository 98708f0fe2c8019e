"""The Math and Clamp nodes against Cycles: every operation, random, whole and special inputs."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine.program.operations_math import MathOperation
from node_tiles import add, compared, greatest_difference

TOLERANCE = 1e-4
NUMBERS = (0.0, 1.0, -1.0, 0.5, 2.0, -2.5, 3.0)
RANDOM = np.random.default_rng(3)


def inputs(tree, position, kind: str) -> dict:
    """Of the three: all varying, all varying and whole, or one varying beside special numbers."""
    names = ("Value", "Value_001", "Value_002")
    if kind == "varying":
        parts = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs
        return dict(zip(names, parts, strict=True))
    if kind == "whole":
        parts = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs
        return {
            name: add(tree, "ShaderNodeMath", {"Value": part}, operation="FLOOR").outputs[0]
            for name, part in zip(names, parts, strict=True)
        }
    found = dict(zip(names, map(float, RANDOM.choice(NUMBERS, 3)), strict=True))
    varying = names[int(RANDOM.integers(2))]
    return found | {varying: add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs[0]}


def math_node(operation: str, kind: str, clamp: bool):
    return lambda tree, position: add(
        tree,
        "ShaderNodeMath",
        inputs(tree, position, kind),
        operation=operation,
        use_clamp=clamp,
    ).outputs[0]


def clamp_node(clamp_type: str, low: float, high: float):
    def build(tree, position):
        part = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs[0]
        arguments = {"Value": part, "Min": low, "Max": high}
        return add(tree, "ShaderNodeClamp", arguments, clamp_type=clamp_type).outputs[0]

    return build


KINDS = ("varying", "whole", "special", "special", "special")
MATH_CASES = [
    (operation.name, math_node(operation.name, kind, clamp))
    for operation in MathOperation
    for kind, clamp in (*((kind, False) for kind in KINDS), ("varying", True))
]
CLAMP_CASES = [
    (f"CLAMP {kind}", clamp_node(kind, low, high))
    for kind in ("MINMAX", "RANGE")
    for low, high in ((-0.5, 1.25), (1.25, -0.5))
]
CASES = MATH_CASES + CLAMP_CASES


@pytest.fixture(scope="module")
def pictures():
    return compared([build for _, build in CASES])


@pytest.mark.parametrize("name", [*MathOperation.__members__, "CLAMP MINMAX", "CLAMP RANGE"])
def test_number_node_is_that_of_cycles(pictures, name):
    for (case, _), seen, expected in zip(CASES, *pictures, strict=True):
        if case == name:
            assert greatest_difference(seen, expected) <= TOLERANCE
