"""Operations on vectors."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, sockets

VectorOperation = IntEnum(
    "VectorOperation",
    "ADD SUBTRACT MULTIPLY DIVIDE MULTIPLY_ADD CROSS_PRODUCT PROJECT REFLECT REFRACT FACEFORWARD "
    "SCALE NORMALIZE ABSOLUTE POWER SIGN MINIMUM MAXIMUM ROUND FLOOR CEIL FRACTION MODULO WRAP "
    "SNAP SINE COSINE TANGENT",
    start=0,
)
"""Blender's identifiers of the Vector Math node's operations that give a vector."""

VectorMeasure = IntEnum("VectorMeasure", "DOT_PRODUCT DISTANCE LENGTH", start=0)
"""Blender's identifiers of the Vector Math node's operations that give a number."""


class MappingType(IntEnum):
    """Blender's identifiers of the Mapping node's types."""

    POINT = 0
    TEXTURE = 1
    VECTOR = 2
    NORMAL = 3


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
    Operation(
        "vector_math",
        sockets(vector="vector"),
        sockets(a="vector", b="vector", c="vector", scale="number"),
        (("operation", VectorOperation),),
        "operation(a, b, c, scale); scale: the factor of SCALE, the ratio of indices of REFRACT",
    ),
    Operation(
        "vector_measure",
        sockets(value="number"),
        sockets(a="vector", b="vector"),
        (("measure", VectorMeasure),),
        "a · b, |a - b| or |a|",
    ),
    Operation(
        "mapping",
        sockets(vector="vector"),
        sockets(vector="vector", location="vector", sine="vector", cosine="vector", scale="vector"),
        (("mapping_type", MappingType),),
        "scaled, turned and moved; TEXTURE is the inverse, NORMAL divides by scale and normalizes. "
        "sine, cosine: of the three angles, turned about X first",
    ),
    Operation(
        "rotate_euler",
        sockets(vector="vector"),
        sockets(vector="vector", center="vector", sine="vector", cosine="vector"),
        (("invert", range(2)),),
        "vector turned about center by three angles, X first, or back; sine, cosine: of the angles",
    ),
    Operation(
        "rotate_around_axis",
        sockets(vector="vector"),
        sockets(vector="vector", center="vector", axis="vector", sine="number", cosine="number"),
        formula="vector turned about center around axis (any length, as it is where that is 0) by "
        "an angle; sine, cosine: of it",
    ),
)
