"""Hashes of pictures, settings and scenes, so that two renders can be told to be the same without
keeping both.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from itertools import chain
from typing import Any

import numpy as np

from ..film import EFFORTS
from ..native.core_types import ABI_VERSION
from ..settings import Settings
from .universal_hash import BLOCK_BYTES, condensed

_WITHOUT_EFFECT = ("threads",)
"""Settings that never change a bit of a picture."""


def picture_fingerprint(passes: Mapping[str, np.ndarray]) -> str:
    """SHA-256 in hexadecimal of every pass's name, shape and the `condensed` bytes of its float32
    bits, in the order of their names, but for `film.EFFORTS`. -0 differs from 0, and NaNs by their
    bits: the same fingerprint means the same bits.
    """
    digest = hashlib.sha256()
    for name in sorted(passes.keys() - set(EFFORTS)):
        picture = np.asarray(passes[name], np.float32)
        digest.update(f"{name} {picture.shape}".encode())
        digest.update(condensed(picture))
    return digest.hexdigest()


def value_fingerprint(value: Any) -> str:
    """SHA-256 in hexadecimal of a scene, or of any value made of dataclasses, tuples, mappings,
    arrays and plain values.
    """
    digest = hashlib.sha256()
    for piece in _pieces(value):
        digest.update(piece)
    return digest.hexdigest()


def settings_text(settings: Settings) -> str:
    """The settings that a picture depends on, as JSON with sorted keys."""
    values = {
        field.name: getattr(settings, field.name)
        for field in fields(settings)
        if field.name not in _WITHOUT_EFFECT
    }
    return json.dumps(
        {
            name: sorted(value) if isinstance(value, frozenset) else value
            for name, value in values.items()
        },
        sort_keys=True,
    )


def tracer_text(backend: str) -> str:
    """The tracer that a backend names, and the version of what its pictures depend on."""
    return "NumPy" if backend == "NUMPY" else f"core interface {ABI_VERSION}"


_PLAIN = frozenset({str, int, float, bool, type(None)})


def _pieces(value: Any) -> Iterator[bytes | memoryview]:
    """What is hashed. Every value is led by its kind and size, so that no two values run
    together.
    """
    if isinstance(value, np.ndarray):
        yield f"array {value.dtype.str} {value.shape}".encode()
        yield condensed(value)
    elif is_dataclass(value):
        yield from _columns([value])
    elif isinstance(value, (tuple, list)):
        yield from _list_pieces(value)
    elif isinstance(value, (frozenset, set)):
        yield b"set"
        yield from _pieces(sorted(value))
    elif isinstance(value, Mapping):
        yield b"mapping"
        yield from _pieces(list(value.keys()))
        yield from _pieces(list(value.values()))
    else:
        yield f"{type(value).__name__} {value!r};".encode()


def _list_pieces(values: Sequence[Any]) -> Iterator[bytes | memoryview]:
    """Where a scene has 50 000 objects, its lists are long and of one kind: they are hashed field
    by field, plain values in one go.
    """
    kinds = set(map(type, values))
    if kinds <= _PLAIN:
        yield f"plain {len(values)} {list(values)!r};".encode()
    elif kinds == {tuple} and set(map(type, chain.from_iterable(values))) <= _PLAIN:
        yield f"plain tuples {len(values)} {list(values)!r};".encode()
    elif len(kinds) == 1 and is_dataclass(next(iter(kinds))):
        yield from _columns(values)
    elif kinds == {np.ndarray} and len({(v.dtype.str, v.shape) for v in values}) == 1:
        yield f"arrays {len(values)}".encode()
        yield from _stack_pieces(values)
    elif kinds == {dict} and not any(values):
        yield f"mappings {len(values)} without anything".encode()
    else:
        yield f"list {len(values)}".encode()
        for value in values:
            yield from _pieces(value)


def _stack_pieces(arrays: Sequence[np.ndarray]) -> Iterator[bytes | memoryview]:
    """The pieces of np.stack(arrays), which have one dtype and shape. Arrays of whole blocks, as
    images are, are not copied: sixteen images of 4096 x 4096 pixels take a gigabyte.
    """
    first = arrays[0]
    if first.nbytes == 0 or first.nbytes % BLOCK_BYTES:
        yield from _pieces(np.stack(arrays))
        return
    yield f"array {first.dtype.str} {(len(arrays), *first.shape)}".encode()
    for array in arrays:
        yield condensed(array)


def _columns(values: Sequence[Any]) -> Iterator[bytes | memoryview]:
    """Of dataclasses of one kind."""
    yield f"{type(values[0]).__name__} {len(values)}".encode()
    for field in fields(values[0]):
        yield from _pieces([getattr(value, field.name) for value in values])
