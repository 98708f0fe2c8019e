"""Operations on vectors."""

from __future__ import annotations

from .operations import Operation, sockets

VECTORS = (
    Operation(
        "combine_xyz",
        sockets(vector="vector"),
        sockets(x="number", y="number", z="number"),
        formula="(x, y, z)",
    ),
    Operation(
        "separate_xyz",
        sockets(x="number", y="number", z="number"),
        sockets(vector="vector"),
        formula="x, y and z of vector",
    ),
    Operation(
        "vector_average",
        sockets(value="number"),
        sockets(vector="vector"),
        formula="(x + y + z) / 3: how a vector becomes a number",
    ),
    Operation(
        "vector_length",
        sockets(value="number"),
        sockets(vector="vector"),
        formula="the Euclidean length",
    ),
    Operation(
        "vector_normalized",
        sockets(vector="vector"),
        sockets(vector="vector"),
        formula="vector divided by its length; 0 where that is 0",
    ),
    Operation(
        "scaled_sum",
        sockets(vector="vector"),
        sockets(a="vector", factor="number", b="vector"),
        formula="a factor + b",
    ),
    Operation(
        "product",
        sockets(vector="vector"),
        sockets(a="vector", b="vector"),
        formula="a b, channel by channel",
    ),
    Operation(
        "bounded",
        sockets(vector="vector"),
        sockets(vector="vector", low="vector", high="vector"),
        formula="min(max(vector, low), high), channel by channel",
    ),
)
