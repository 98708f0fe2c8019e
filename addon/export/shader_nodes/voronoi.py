"""The Voronoi Texture node."""

from __future__ import annotations

import bpy

from ....engine.program.operations_voronoi import CellHash, CellOrder, VoronoiFeature, VoronoiMetric
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
_CELL_HASH = CellHash.PCG if bpy.app.version >= (5, 0, 0) else CellHash.JENKINS
_CELL_ORDER = CellOrder.SUM if bpy.app.version >= (4, 5, 0) else CellOrder.DISTANCE
"""Patterns are those of the Blender that shows them."""


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
        cell_hash=_CELL_HASH,
        cell_order=_CELL_ORDER,
    )
    return dict(zip(("Distance", "Color", "Position", "W", "Radius"), outputs, strict=True))


READERS["ShaderNodeTexVoronoi"] = _voronoi
