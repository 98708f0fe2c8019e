"""Noise and Wave Textures with random settings beside Cycles: they differ by what single precision
rounds of coordinates, which octave after octave makes larger, and by no more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from node_tiles import add, compared, compared_with_rounding

RANGES = {
    "Scale": (0.2, 9.0),
    "Detail": (2.0, 12.0),
    "Roughness": (-0.2, 1.0),
    "Lacunarity": (0.5, 4.0),
    "Distortion": (-3.0, 6.0),
    "Detail Scale": (0.2, 4.0),
    "Detail Roughness": (-0.3, 1.0),
    "Phase Offset": (-6.0, 6.0),
    "Offset": (-1.0, 2.0),
    "Gain": (0.0, 3.0),
    "W": (-5.0, 5.0),
}
"""Of what the inputs get; linked numbers go beyond what sockets take."""
MENUS = {
    "ShaderNodeTexNoise": ("noise_dimensions", "noise_type"),
    "ShaderNodeTexWave": ("wave_type", "bands_direction", "rings_direction", "wave_profile"),
}
TREES = 32


def along(tree, position, slope: float, start: float):
    """A number that goes with the position's x."""
    x = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs[0]
    given = {"Value": x, "Value_001": slope, "Value_002": start}
    return add(tree, "ShaderNodeMath", given, operation="MULTIPLY_ADD").outputs[0]


def varied(kind: str, random: np.random.Generator) -> Callable[[Any, Any], Any]:
    """A texture of random settings, whose inputs all go with the position, some of them little."""

    def build(tree, position):
        node = tree.nodes.new(kind)
        for menu in MENUS[kind]:
            items = node.bl_rna.properties[menu].enum_items
            setattr(node, menu, items[random.integers(len(items))].identifier)
        for socket in (s for s in node.inputs if s.enabled):
            if socket.name == "Vector":
                tree.links.new(position, socket)
                continue
            low, high = RANGES[socket.name]
            slope = 1.0 if socket.name == "W" else (high - low) * random.choice((1e-3, 0.05))
            number = along(tree, position, slope, random.uniform(low, high))
            tree.links.new(number, socket)
        return node.outputs[0]

    return build


@pytest.mark.parametrize("kind", MENUS)
def test_textures_differ_by_rounding(kind):
    random = np.random.default_rng(12)
    seen, expected, moved = compared_with_rounding([varied(kind, random) for _ in range(TREES)], 4)
    error = np.abs(seen - expected).max(-1)
    assert np.median(error) < 5e-5
    largest = np.sort(error.max(1) / (moved.max(1) + 2e-5))
    assert largest[-1] < 40 and np.median(largest) < 4, largest[-4:]


def test_linked_numbers_of_waves_go_beyond_their_sockets():
    """Octaves from -1 on, and roughnesses of either sign."""

    def wave(name: str, value: float):
        def build(tree, position):
            given = {"Vector": position, "Scale": 2.0, "Distortion": 3.0, "Detail": 3.5}
            node = add(tree, "ShaderNodeTexWave", given)
            number = tree.nodes.new("ShaderNodeValue")
            number.outputs[0].default_value = value
            tree.links.new(number.outputs[0], node.inputs[name])
            return node.outputs[0]

        return build

    cases = [("Detail Roughness", x) for x in (-1.5, -0.5, -0.05, 2.0)]
    cases += [("Detail", x) for x in (-0.9, -0.5, -0.05, 0.0)]
    seen, expected = compared([wave(*case) for case in cases])
    assert np.abs(seen - expected).max() < 2e-5
