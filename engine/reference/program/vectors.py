"""Operations on vectors (3, n) and numbers (n,), float64."""

from __future__ import annotations

import numpy as np

from ..vectors import unit


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
