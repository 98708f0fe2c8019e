"""The Voronoi Texture node."""

from __future__ import annotations

from ....engine.program.operations_voronoi import VoronoiFeature, VoronoiMetric
from .reader import READERS, NodeInputs, Outputs, texture_vector

_NUMBERS = {
    "W": 0.0,
    "Scale": 5.0,
    "Detail": 0.0,
    "Roughness": 0.5,
    "Lacunarity": 2.0,
    "Smoothness": 1.0,
    "Exponent": 0.5,
    "Randomness": 1.0,
}


def _voronoi(view: NodeInputs) -> Outputs:
    node, graph = view.node, view.reader.graph
    dimensions = int(node.voronoi_dimensions[0])
    is_line = dimensions == 1
    point = graph.constant((0.0, 0.0, 0.0)) if is_line else texture_vector(view)
    numbers = (
        view.value(name) if name in node.inputs else graph.constant(otherwise)
        for name, otherwise in _NUMBERS.items()
    )
    outputs = view.apply(
        "voronoi_texture",
        point,
        *numbers,
        dimensions=dimensions,
        feature=VoronoiFeature[node.feature],
        metric=VoronoiMetric[node.distance],
        normalize=int(getattr(node, "normalize", False)),
    )
    return dict(zip(("Distance", "Color", "Position", "W", "Radius"), outputs, strict=True))


READERS["ShaderNodeTexVoronoi"] = _voronoi
