"""Jenkins' lookup3, by which Cycles makes random numbers of what has a number."""

from __future__ import annotations

import numpy as np

_WORD = 0xFFFFFFFF


def random_of(*words: np.ndarray) -> np.ndarray:
    """(n,) float32 from 0 to 1 of one to three arrays (n,) of uint32."""
    start = np.uint32((0xDEADBEEF + 13 + 4 * len(words)) & _WORD)
    a, b, c = (start + word for word in (*words, *(np.zeros_like(words[0]),) * (3 - len(words))))
    for bits in (14, 11, 25, 16, 4, 14, 24):
        c = (c ^ b) - (b << np.uint32(bits) | b >> np.uint32(32 - bits))
        a, b, c = b, c, a
    return as_random(b)


def as_random(words: np.ndarray) -> np.ndarray:
    """float32 from 0 to 1 of uint32."""
    return words.astype(np.float32) * np.float32(1 / _WORD)


def word_of(text: str) -> np.ndarray:
    """(1,) uint32 of a name."""
    word = 0
    for byte in text.encode():
        word = word * 37 + byte & _WORD
    return np.array([word], np.uint32)
