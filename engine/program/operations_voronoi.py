"""Voronoi textures."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, sockets
from .operations_noise import OCTAVES


class VoronoiFeature(IntEnum):
    """Blender's identifiers of what is computed of the cells."""

    F1 = 0
    F2 = 1
    SMOOTH_F1 = 2
    DISTANCE_TO_EDGE = 3
    N_SPHERE_RADIUS = 4


class VoronoiMetric(IntEnum):
    """Blender's identifiers of distances."""

    EUCLIDEAN = 0
    MANHATTAN = 1
    CHEBYCHEV = 2
    MINKOWSKI = 3


class CellHash(IntEnum):
    """How the points of cells are chosen: PCG since Blender 5.0, Jenkins' lookup3 before."""

    PCG = 0
    JENKINS = 1


class CellOrder(IntEnum):
    """What F1 compares of Minkowski's distances: the sums under the root since Blender 4.5, which
    fall as distances grow where the exponent is below 0; distances before.
    """

    SUM = 0
    DISTANCE = 1


VORONOIS = (
    Operation(
        "voronoi_texture",
        sockets(distance="number", color="vector", position="vector", w="number", radius="number"),
        sockets(
            vector="vector",
            w="number",
            **OCTAVES,
            smoothness="number",
            exponent="number",
            randomness="number",
        ),
        (
            ("dimensions", range(1, 5)),
            ("feature", VoronoiFeature),
            ("metric", VoronoiMetric),
            ("normalize", range(2)),
            ("cell_hash", CellHash),
            ("cell_order", CellOrder),
        ),
        "the nearest points of a jittered grid (Worley 1996), octaves of them added up",
    ),
)
