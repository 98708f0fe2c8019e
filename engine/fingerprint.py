"""Hashes of pictures, settings and scenes, so that two renders can be told to be the same without keeping both."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import chain, islice
from typing import Any

import numpy as np

from .core_types import ABI_VERSION
from .film import EFFORTS
from .settings import Settings

_WITHOUT_EFFECT = ("threads",)
"""Settings that never change a bit of a picture."""


_BLOCK = 1 << 20
"""Bytes of a picture that are hashed in one piece."""


def picture_fingerprint(passes: Mapping[str, np.ndarray], each: Callable[..., Iterable[bytes]] = map) -> str:
    """SHA-256 in hexadecimal of every pass's name, shape and the SHA-256 of each MiB of its float32 bits, in the order of their names, but
    for `film.EFFORTS`. -0 differs from 0, and NaNs by their bits: the same fingerprint means the same bits.

    each: `map`, or that of an executor, whose threads then hash side by side.
    """
    pictures = {name: np.ascontiguousarray(passes[name], np.float32) for name in sorted(passes.keys() - set(EFFORTS))}
    blocks = {name: _blocks(picture) for name, picture in pictures.items()}
    hashes = each(_sha256, chain.from_iterable(blocks.values()))
    digest = hashlib.sha256()
    for name, picture in pictures.items():
        digest.update(f"{name} {picture.shape}".encode())
        for block in islice(hashes, len(blocks[name])):
            digest.update(block)
    return digest.hexdigest()


def _blocks(picture: np.ndarray) -> list[memoryview]:
    whole = memoryview(picture).cast("B")
    return [whole[first : first + _BLOCK] for first in range(0, len(whole), _BLOCK)]


def _sha256(block: memoryview) -> bytes:
    return hashlib.sha256(block).digest()


_PLAIN = (str, int, bool, float)


def value_fingerprint(value: Any) -> str:
    """SHA-256 in hexadecimal of a scene, or of any value made of dataclasses, tuples, mappings, arrays and plain values."""
    digest = hashlib.sha256()
    _feed(digest, value)
    return digest.hexdigest()


def settings_text(settings: Settings) -> str:
    """The settings that a picture depends on, as JSON with sorted keys."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings) if field.name not in _WITHOUT_EFFECT}
    return json.dumps({name: sorted(value) if isinstance(value, frozenset) else value for name, value in values.items()}, sort_keys=True)


def tracer_text(backend: str) -> str:
    """The tracer that a backend names, and the version of what its pictures depend on."""
    return "NumPy" if backend == "NUMPY" else f"core interface {ABI_VERSION}"


def _feed(digest: Any, value: Any) -> None:
    """Every value is led by its kind and size, so that no two values run together."""
    kind = type(value)
    if kind in _PLAIN:
        digest.update(f"{kind.__name__} {value!r};".encode())
    elif isinstance(value, np.ndarray):
        digest.update(f"array {value.dtype.str} {value.shape}".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif is_dataclass(value):
        _feed_all(digest, kind.__name__, [getattr(value, name) for name in _names(kind)])
    elif isinstance(value, (tuple, list)):
        _feed_all(digest, "list", value)
    elif isinstance(value, (frozenset, set)):
        _feed_all(digest, "set", sorted(value))
    elif isinstance(value, Mapping):
        _feed_all(digest, "mapping", [part for pair in value.items() for part in pair])
    else:
        digest.update(f"{kind.__name__} {value!r};".encode())


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _feed_all(digest: Any, kind: str, values: Any) -> None:
    digest.update(f"{kind} {len(values)}".encode())
    for value in values:
        _feed(digest, value)
