"""Operations on vectors (3, n) and numbers (n,), float64. Vector Math, Mapping and Vector Rotate as
Cycles (svm/math_util.h, mapping_util.h, vector_rotate.h).
"""

from __future__ import annotations

import numpy as np

from ...linear.columns import cross, dot, length, unit
from ..operations_vector import MappingType, VectorMeasure, VectorOperation
from .arithmetic import safe_divide, safe_modulo, safe_power, sign, snapped, wrap


def combine_xyz(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(x, y, z))


def separate_xyz(vector: np.ndarray) -> tuple[np.ndarray, ...]:
    return tuple(vector)


def vector_average(vector: np.ndarray) -> np.ndarray:
    """A vector as a number."""
    return (vector[0] + vector[1] + vector[2]) / 3


def vector_length(vector: np.ndarray) -> np.ndarray:
    """Scaled by the largest part, so that no square overflows or vanishes."""
    largest = np.abs(vector).max(0)
    scaled = vector / np.where(largest > 0, largest, 1.0)
    return largest * np.sqrt((scaled * scaled).sum(0))


def vector_normalized(vector: np.ndarray) -> np.ndarray:
    return unit(vector)


def scaled_sum(a: np.ndarray, factor: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a * factor + b


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a * b


def bounded(vector: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.fmin(np.fmax(vector, low), high)


def vector_math(
    a: np.ndarray, b: np.ndarray, c: np.ndarray, scale: np.ndarray, *, operation: int
) -> np.ndarray:
    """VectorOperation `operation`, channel by channel where it is one on numbers."""
    return _VECTOR_MATH[VectorOperation(operation)](a, b, c, scale)


def vector_measure(a: np.ndarray, b: np.ndarray, *, measure: int) -> np.ndarray:
    if measure == VectorMeasure.DOT_PRODUCT:
        return dot(a, b)
    return length(a - b if measure == VectorMeasure.DISTANCE else a)


def mapping(
    vector: np.ndarray,
    location: np.ndarray,
    sine: np.ndarray,
    cosine: np.ndarray,
    scale: np.ndarray,
    *,
    mapping_type: int,
) -> np.ndarray:
    rotation = _euler(sine, cosine)
    if mapping_type == MappingType.TEXTURE:
        return safe_divide(_turned_back(rotation, vector - location), scale)
    if mapping_type == MappingType.NORMAL:
        return unit(_turned(rotation, safe_divide(vector, scale)))
    turned = _turned(rotation, vector * scale)
    return turned + location if mapping_type == MappingType.POINT else turned


def rotate_euler(
    vector: np.ndarray, center: np.ndarray, sine: np.ndarray, cosine: np.ndarray, *, invert: int
) -> np.ndarray:
    turn = _turned_back if invert else _turned
    return turn(_euler(sine, cosine), vector - center) + center


def rotate_around_axis(
    vector: np.ndarray,
    center: np.ndarray,
    axis: np.ndarray,
    sine: np.ndarray,
    cosine: np.ndarray,
) -> np.ndarray:
    """Rodrigues' formula."""
    along, arm = unit(axis), vector - center
    turned = cosine * arm + sine * cross(along, arm) + ((1 - cosine) * dot(along, arm)) * along
    return np.where((axis == 0).all(0), vector, turned + center)


def _project(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return safe_divide(dot(a, b), dot(b, b)) * b


def _reflect(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    n = unit(b)
    return a - 2 * dot(a, n) * n


def _refract(a: np.ndarray, b: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """0 where the direction is reflected totally."""
    n = unit(b)
    along = dot(n, a)
    k = 1 - eta * eta * (1 - along * along)
    return np.where(k < 0, 0.0, eta * a - (eta * along + np.sqrt(np.fmax(k, 0.0))) * n)


def _euler(sine: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Rotations (3, 3, n) about X, then Y, then Z."""
    (sx, sy, sz), (cx, cy, cz) = sine, cosine
    return np.array(
        [
            [cy * cz, sy * sx * cz - cx * sz, sy * cx * cz + sx * sz],
            [cy * sz, sy * sx * sz + cx * cz, sy * cx * sz - sx * cz],
            [-sy, cy * sx, cy * cx],
        ]
    )


def _turned(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return np.stack([dot(row, vector) for row in rotation])


def _turned_back(rotation: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return np.stack([dot(rotation[:, column], vector) for column in range(3)])


_V = VectorOperation
_VECTOR_MATH = {
    _V.ADD: lambda a, b, c, s: a + b,
    _V.SUBTRACT: lambda a, b, c, s: a - b,
    _V.MULTIPLY: lambda a, b, c, s: a * b,
    _V.DIVIDE: lambda a, b, c, s: safe_divide(a, b),
    _V.MULTIPLY_ADD: lambda a, b, c, s: a * b + c,
    _V.CROSS_PRODUCT: lambda a, b, c, s: cross(a, b),
    _V.PROJECT: lambda a, b, c, s: _project(a, b),
    _V.REFLECT: lambda a, b, c, s: _reflect(a, b),
    _V.REFRACT: lambda a, b, c, s: _refract(a, b, s),
    _V.FACEFORWARD: lambda a, b, c, s: np.where(dot(c, b) < 0, a, -a),
    _V.SCALE: lambda a, b, c, s: a * s,
    _V.NORMALIZE: lambda a, b, c, s: unit(a),
    _V.ABSOLUTE: lambda a, b, c, s: np.abs(a),
    _V.POWER: lambda a, b, c, s: safe_power(a, b),
    _V.SIGN: lambda a, b, c, s: sign(a),
    _V.MINIMUM: lambda a, b, c, s: np.fmin(a, b),
    _V.MAXIMUM: lambda a, b, c, s: np.fmax(a, b),
    _V.ROUND: lambda a, b, c, s: np.floor(a + 0.5),
    _V.FLOOR: lambda a, b, c, s: np.floor(a),
    _V.CEIL: lambda a, b, c, s: np.ceil(a),
    _V.FRACTION: lambda a, b, c, s: a - np.floor(a),
    _V.MODULO: lambda a, b, c, s: safe_modulo(a, b),
    _V.WRAP: lambda a, b, c, s: wrap(a, b, c),
    _V.SNAP: lambda a, b, c, s: snapped(a, b),
    _V.SINE: lambda a, b, c, s: np.sin(a),
    _V.COSINE: lambda a, b, c, s: np.cos(a),
    _V.TANGENT: lambda a, b, c, s: np.tan(a),
}
