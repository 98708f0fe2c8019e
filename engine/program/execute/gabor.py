"""Gabor Texture (Lagae and others 2009, Tavernier and others 2019, Tricard and others 2019), as
Cycles (kernel/svm/gabor.h).

Points are (d, n) float64; a phasor is complex128 (n,). Cells are hashed as float32.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from .hashing import hash_numbers

IMPULSES = 8
"""In each cell."""
INTEGRAL_OF_SQUARE = {2: 0.25, 3: 1.0 / (4.0 * np.sqrt(2.0))}
"""Of the kernel without its window, for high frequencies, by dimensions."""
SECOND_MOMENT = 0.5
"""Of the weights -1 and 1 as Cycles counts it."""


def gabor_texture(
    vector, scale, frequency, anisotropy, orientation_2d, orientation_3d, *, dimensions: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, phase and intensity, each (n,); vectors are (3, n), the other arguments (n,)."""
    isotropy = 1.0 - np.clip(anisotropy, 0.0, 1.0)
    frequency = np.maximum(frequency, 0.001)
    orientation = _unit(orientation_3d) if dimensions == 3 else orientation_2d
    phasor = _phasor((vector * scale)[:dimensions], frequency, isotropy, orientation)
    deviation = np.sqrt(IMPULSES * SECOND_MOMENT * INTEGRAL_OF_SQUARE[dimensions])
    most = 6.0 * deviation
    value = phasor.imag / most * 0.5 + 0.5
    phase = (np.arctan2(phasor.imag, phasor.real) + np.pi) / (2.0 * np.pi)
    return value, phase, np.sqrt(phasor.real**2 + phasor.imag**2) / most


def _unit(v: np.ndarray) -> np.ndarray:
    """The direction of vectors; (0, 0, 0), which is NaN in Cycles, stays."""
    largest = np.abs(v).max(axis=0)
    v = v / np.where(largest > 0.0, largest, 1.0)
    length = np.sqrt((v * v).sum(axis=0))
    return v / np.where(length > 0.0, length, 1.0)


def _phasor(p: np.ndarray, frequency, isotropy, orientation) -> np.ndarray:
    """Sum over the cells around the points, x fastest."""
    floor = np.floor(p)
    total = np.zeros(p.shape[1], complex)
    for reverse in product((-1.0, 0.0, 1.0), repeat=len(p)):
        offset = np.array(reverse[::-1])[:, None]
        cell, local = floor + offset, p - floor - offset
        for impulse in range(IMPULSES):
            total = total + _impulse(cell, local, impulse, frequency, isotropy, orientation)
    return total


def _impulse(cell, local, impulse: int, frequency, isotropy, orientation) -> np.ndarray:
    """Phasor of one impulse of a cell; `local` is the way from the cell to the points."""
    along, at, sign = ((*cell, 3.0 * impulse + k) for k in range(3))
    way = local - _random_center(at)
    squared = (way * way).sum(axis=0)
    envelope = np.exp(-np.pi * squared) * (0.5 + 0.5 * np.cos(np.pi * squared))
    direction = (
        _direction_2d(along, isotropy, orientation)
        if len(cell) == 2
        else _direction_3d(along, isotropy, orientation)
    )
    angle = 2.0 * np.pi * (way * (frequency * direction)).sum(axis=0)
    weight = np.where(hash_numbers(*sign) < 0.5, -envelope, envelope)
    return np.where(squared < 1.0, weight * np.cos(angle) + 1j * (weight * np.sin(angle)), 0.0)


def _random_center(seed: tuple) -> np.ndarray:
    """Point (d, n) in the unit cell."""
    if len(seed) == 3:
        x, y, z = seed
        return np.stack([hash_numbers(x, y, z), hash_numbers(z, x, y)])
    x, y, z, w = seed
    return np.stack([hash_numbers(x, y, z, w), hash_numbers(z, x, w, y), hash_numbers(w, z, y, x)])


def _direction_2d(seed: tuple, isotropy, orientation) -> np.ndarray:
    """Unit vectors (2, n): the orientation, turned by up to a quarter turn either way."""
    angle = orientation + (hash_numbers(*seed) - 0.5) * np.pi * isotropy
    return np.stack([np.cos(angle), np.sin(angle)])


def _direction_3d(seed: tuple, isotropy, orientation) -> np.ndarray:
    """Unit vectors (3, n): the orientation, whose angles grow by up to half a turn."""
    x, y, z, w = seed
    ox, oy, oz = orientation
    # Cycles takes arc cosines, which lose half of the digits near the axes.
    inclination = np.arctan2(np.sqrt(ox * ox + oy * oy), oz)
    inclination = inclination + hash_numbers(x, y, z, w) * np.pi * isotropy
    azimuth = np.arctan2(oy, ox) + hash_numbers(z, x, w, y) * np.pi * isotropy
    around = np.sin(inclination)
    turned = np.stack([around * np.cos(azimuth), around * np.sin(azimuth), np.cos(inclination)])
    return np.where(isotropy == 0.0, orientation, turned)
