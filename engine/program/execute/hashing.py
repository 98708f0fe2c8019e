"""Jenkins' lookup3 hashes as Cycles uses them (util/hash.h): of uint32 and of the bits of float32.

Words are uint32 arrays of any one shape; sums and differences wrap modulo 2^32.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

_SEED = 0xDEADBEEF + 13


def _turn(word: np.ndarray, bits: int) -> np.ndarray:
    """`word` rotated left by `bits`."""
    return (word << np.uint32(bits)) | (word >> np.uint32(32 - bits))


def _mix(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, ...]:
    for bits in (4, 6, 8, 16, 19, 4):
        a = (a - c) ^ _turn(c, bits)
        c = c + b
        a, b, c = b, c, a
    return a, b, c


def _final(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    for bits in (14, 11, 25, 16, 4, 14, 24):
        c = (c ^ b) - _turn(b, bits)
        a, b, c = b, c, a
    return b


def hash_words(*words: np.ndarray) -> np.ndarray:
    """Hash (uint32) of one to four uint32 words of one shape."""
    start = np.uint32((_SEED + 4 * len(words)) & 0xFFFFFFFF)
    a = b = c = np.full(np.shape(words[0]), start, np.uint32)
    a = a + words[0]
    if len(words) > 1:
        b = b + words[1]
    if len(words) > 2:
        c = c + words[2]
    if len(words) > 3:
        a, b, c = _mix(a, b, c)
        a = a + words[3]
    return _final(a, b, c)


def hash_integers(*values: np.ndarray) -> np.ndarray:
    """Hash (uint32) of one to four whole numbers (float64 or int64), modulo 2^32."""
    return hash_words(*(np.asarray(v).astype(np.int64).astype(np.uint32) for v in values))


def hash_numbers(*values: ArrayLike) -> np.ndarray:
    """Hash in [0, 1] (float64) of one to four numbers, by their bits as float32."""
    words = [
        np.ascontiguousarray(v, np.float32).view(np.uint32) for v in np.broadcast_arrays(*values)
    ]
    # Cycles rounds the word to float32 and multiplies by 1 / 2^32.
    return hash_words(*words).astype(np.float32).astype(np.float64) / 2.0**32


def hash_color(*values: np.ndarray) -> np.ndarray:
    """Three hashes (3, n) in [0, 1] of one to four numbers (n,), the first that of hash_numbers."""
    first = hash_numbers(*values)
    if len(values) == 4:
        x, y, z, w = values
        return np.stack([first, hash_numbers(z, x, w, y), hash_numbers(w, z, y, x)])
    return np.stack([first, hash_numbers(*values, 1.0), hash_numbers(*values, 2.0)])
