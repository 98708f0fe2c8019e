"""Operations on vectors (3, n) and numbers (n,), float64."""

from __future__ import annotations

import numpy as np


def combine_xyz(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.stack(np.broadcast_arrays(x, y, z))


def separate_xyz(vector: np.ndarray) -> tuple[np.ndarray, ...]:
    return tuple(vector)


def vector_average(vector: np.ndarray) -> np.ndarray:
    """A vector as a number."""
    return (vector[0] + vector[1] + vector[2]) / 3


def scaled_sum(a: np.ndarray, factor: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a * factor + b


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a * b


def bounded(vector: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.fmin(np.fmax(vector, low), high)
