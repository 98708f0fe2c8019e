"""The Voronoi Texture against Cycles: every feature, metric and dimension, random inputs."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine.program.operations_voronoi import VoronoiFeature, VoronoiMetric
from node_tiles import add, compared

RANDOM = np.random.default_rng(12)
OUTPUTS = {
    "F1": ("Distance", "Color", "Position"),
    "F2": ("Distance", "Color", "Position"),
    "SMOOTH_F1": ("Distance", "Color", "Position"),
    "DISTANCE_TO_EDGE": ("Distance",),
    "N_SPHERE_RADIUS": ("Radius",),
}


def number(low: float, high: float) -> float:
    return float(np.float32(RANDOM.uniform(low, high)))


def texture(
    dimensions: int, feature: str, metric: str, output: str, octaves: bool, exponent: float = 0.0
):
    """exponent: linked, where it is not 0: sockets hold none below 0."""
    inputs = {
        "Scale": number(0.6, 2.5),
        "Detail": 1.6 if octaves else 0.0,
        "Roughness": number(0.3, 0.8),
        "Lacunarity": number(1.4, 2.4),
        "Smoothness": number(0.2, 1.0),
        "Exponent": number(0.5, 2.5),
        "Randomness": number(0.5, 1.0),
    }

    def build(tree, position):
        parts = add(tree, "ShaderNodeSeparateXYZ", {"Vector": position}).outputs
        node = tree.nodes.new("ShaderNodeTexVoronoi")
        node.voronoi_dimensions, node.feature = f"{dimensions}D", feature
        node.distance, node.normalize = metric, octaves
        fed = {"Vector": position, "W": parts[0 if dimensions == 1 else 2]}
        for socket in node.inputs:
            if socket.identifier in fed:
                tree.links.new(fed[socket.identifier], socket)
            elif socket.identifier in inputs:
                socket.default_value = inputs[socket.identifier]
        if exponent:
            value = tree.nodes.new("ShaderNodeValue")
            value.outputs[0].default_value = exponent
            tree.links.new(value.outputs[0], node.inputs["Exponent"])
        return node.outputs["W" if (output, dimensions) == ("Position", 1) else output]

    return build


CASES = {
    f"{d}D {feature} {metric} {output} {octaves}": texture(d, feature, metric, output, octaves)
    for d in (1, 2, 3, 4)
    for feature in VoronoiFeature.__members__
    for metric in VoronoiMetric.__members__
    for output in OUTPUTS[feature]
    for octaves in (False, True)
    if metric == "EUCLIDEAN" or (d > 1 and feature not in ("DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"))
}
CASES |= {
    f"{d}D {feature} MINKOWSKI {exponent} {octaves}": texture(
        d, feature, "MINKOWSKI", "Distance", octaves, exponent
    )
    for d, feature, exponent, octaves in (
        (2, "F1", -1.5, False),
        (3, "F1", -0.7, True),
        (3, "F2", -2.5, True),
        (4, "SMOOTH_F1", -1.0, False),
    )
}


@pytest.fixture(scope="module")
def rendered():
    seen, expected = compared(list(CASES.values()))
    return dict(zip(CASES, zip(seen, expected, strict=True), strict=True))


@pytest.mark.parametrize("case", CASES)
def test_texture_is_cycles(case, rendered):
    """Up to 1e-4 but for the points between cells, of which rounding to float32 picks one."""
    seen, expected = rendered[case]
    error = np.abs(seen - expected).max(-1)
    assert np.mean(error > 1e-4) <= 0.02, f"{np.sort(error)[-5:]}"
