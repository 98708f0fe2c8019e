"""Cryptomatte's ids: a name's hash, the float that stands for it in a picture, and the manifest
that leads back to the name (Friedman and Jones 2015, version 1.2.0 of the specification).
"""

from __future__ import annotations

import functools
import json
import struct
from collections.abc import Iterable

from .scene import Scene

_WORD = 0xFFFFFFFF


def name_hash(name: str) -> int:
    """MurmurHash3_x86_32 (Appleby, public domain), seed 0, of the name's UTF-8 bytes."""
    data = name.encode("utf-8", "surrogateescape")
    state, whole = 0, len(data) & ~3
    for (word,) in struct.iter_unpack("<I", data[:whole]):
        state = _turned(state ^ _mixed(word), 13) * 5 + 0xE6546B64 & _WORD
    state ^= _mixed(int.from_bytes(data[whole:], "little"))
    state ^= len(data)
    state = (state ^ state >> 16) * 0x85EBCA6B & _WORD
    state = (state ^ state >> 13) * 0xC2B2AE35 & _WORD
    return state ^ state >> 16


@functools.lru_cache(maxsize=1 << 16)
def id_bits(name: str) -> int:
    """The bits of the float32 that a name has in pictures: its hash with an exponent that is
    neither the least nor the largest, so that it is finite and no denormal.
    """
    value = name_hash(name)
    exponent = min(max(value >> 23 & 0xFF, 1), 254)
    return value & 0x807FFFFF | exponent << 23


def id_of(name: str) -> float:
    """That float32, exact."""
    return struct.unpack("<f", struct.pack("<I", id_bits(name)))[0]


def manifest(names: Iterable[str]) -> str:
    """JSON: each name with its hash as eight hexadecimal digits."""
    unique = dict.fromkeys(names)
    return json.dumps(
        {name: f"{name_hash(name):08x}" for name in unique},
        separators=(",", ":"),
        ensure_ascii=False,
    )


def crypto_metadata(title: str, names: str) -> dict[str, str]:
    """Metadata of a file that has the passes `title`00, 01 …; names: their manifest."""
    prefix = f"cryptomatte/{name_hash(title):08x}"[:-1] + "/"
    return {
        prefix + "name": title,
        prefix + "hash": "MurmurHash3_32",
        prefix + "conversion": "uint32_to_float32",
        prefix + "manifest": names,
    }


def manifests(scene: Scene) -> dict[str, str]:
    """The manifest of each Cryptomatte pass of a scene."""
    return {
        "Crypto Object": manifest(block.name for block in scene.instances),
        "Crypto Material": manifest(material.name for material in scene.materials),
        "Crypto Asset": manifest(block.asset or block.name for block in scene.instances),
    }


def _mixed(word: int) -> int:
    return _turned(word * 0xCC9E2D51 & _WORD, 15) * 0x1B873593 & _WORD


def _turned(word: int, bits: int) -> int:
    return (word << bits | word >> 32 - bits) & _WORD
