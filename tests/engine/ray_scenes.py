"""Geometry and rays for ray queries over arrays."""

from __future__ import annotations

import numpy as np
import pytest

from glint import engine

BACKENDS = engine.available_backends()
SQUARE = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
HALVES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
DOWN = np.array([0.0, 0.0, -1.0])

both = pytest.mark.parametrize("backend", BACKENDS)


def random_rays(
    rng: np.random.Generator, count: int, spread: float = 3.0
) -> tuple[np.ndarray, np.ndarray]:
    """Most of them towards the unit ball, directions of any length."""
    origins = rng.normal(size=(count, 3)) * spread
    return origins, (rng.normal(size=(count, 3)) * 0.7 - origins) * rng.uniform(0.1, 10, (count, 1))


def at(*position: float, linear: np.ndarray | float = 1.0) -> np.ndarray:
    matrix = np.zeros((1, 3, 4))
    matrix[0, :, :3] = linear * np.eye(3) if np.isscalar(linear) else linear
    matrix[0, :, 3] = position
    return matrix
