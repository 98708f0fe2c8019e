"""Hashes of large arrays: what SHA-256 then has to go through is a 128th of them."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from ..native import binding
from ..native.core_types import Hash
from ..native.packer import address

Array = np.ndarray

BLOCK_BYTES = 4 * Hash.BLOCK
"""Size of a block. What `condensed` gives of arrays of whole blocks, one after the other, is what
it gives of them joined.
"""


def condensed(values: Array) -> bytes:
    """Bytes that say which the array's are: those of less than a block (4 KiB) themselves; of more,
    the sums of every block (`block_sums`) and what follows the last whole word. Of arrays of one
    size that differ, all sums of a block are the same by a chance of 2^-128.
    """
    flat = np.ascontiguousarray(values).reshape(-1).view(np.uint8)
    if flat.size < BLOCK_BYTES:
        return flat.tobytes()
    whole = flat.size - flat.size % 4
    return _sums(flat[:whole].view(np.uint32)).tobytes() + flat[whole:].tobytes()


def _sums(words: Array) -> Array:
    """As `block_sums`, by the core where it loads."""
    core = _core_function()
    if core is None:
        return block_sums(words)
    sums = np.empty((-(-words.size // Hash.BLOCK), Hash.SUMS), np.uint64)
    core(address(words), words.size, address(sums))
    return sums


@functools.cache
def _core_function() -> Callable[..., None] | None:
    """Looked for once: finding the core takes longer than hashing a small mesh."""
    return None if binding.load_error() else binding.library().glint_universal_hash


def block_sums(words: Array) -> Array:
    """(blocks, 4) uint64 of (n,) uint32 words, the last block as if zeros followed: NH, the
    universal hash of UMAC (Black, Halevi, Krawczyk, Krovetz and Rogaway 1999, UMAC: Fast and secure
    message authentication), the sum of products of words that lie half a block apart, each with a
    key added, modulo 2^64; four times, the keys shifted by one (Toeplitz).
    """
    half = Hash.BLOCK // 2
    padded = np.zeros((-(-words.size // Hash.BLOCK), Hash.BLOCK), np.uint32)
    padded.reshape(-1)[: words.size] = words
    sums = np.empty((len(padded), Hash.SUMS), np.uint64)
    for number in range(Hash.SUMS):
        keyed = padded + _keys()[number : number + Hash.BLOCK]
        sums[:, number] = (keyed[:, :half].astype(np.uint64) * keyed[:, half:]).sum(axis=1)
    return sums


@functools.cache
def _keys() -> Array:
    """The upper halves of SplitMix64's first numbers (Steele, Lea and Flood 2014, Fast splittable
    pseudorandom number generators), begun at 0.
    """
    z = np.arange(1, Hash.BLOCK + Hash.SUMS + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return ((z ^ (z >> np.uint64(31))) >> np.uint64(32)).astype(np.uint32)
