"""Which GNU C library a shared library needs, as its own table of symbol versions says: what a
wheel's manylinux tag must promise.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator

import tree

_VERSIONS_NEEDED = 0x6FFFFFFE
"""Type of the section .gnu.version_r."""
_RELATIVE_RELOCATIONS = {"GLIBC_ABI_DT_RELR": (2, 36)}
"""What is asked of the loader by name, and the first version that knows it."""


def needed(library: bytes) -> tuple[int, int]:
    """The oldest GNU C library with all symbols that a 64-bit little-endian ELF library asks for.
    Raises SetupError where it asks for versions of other libraries, which no machine need have.
    """
    found = [(2, 5)]
    for name in versions_needed(library):
        plain = re.fullmatch(r"GLIBC_(\d+)\.(\d+)(\.\d+)?", name)
        if not plain and name not in _RELATIVE_RELOCATIONS:
            raise tree.SetupError(
                f"the core needs {name}, which a machine with the GNU C library may lack: link it "
                "statically"
            )
        found.append((int(plain[1]), int(plain[2])) if plain else _RELATIVE_RELOCATIONS[name])
    return max(found)


def versions_needed(library: bytes) -> list[str]:
    """Names such as GLIBC_2.17."""
    (table,), (size, count) = (
        struct.unpack_from("<Q", library, 0x28),
        struct.unpack_from("<HH", library, 0x3A),
    )
    sections = [struct.unpack_from("<IIQQQQII", library, table + k * size) for k in range(count)]
    names: list[str] = []
    for _, kind, _, _, start, _, link, entries in sections:
        if kind == _VERSIONS_NEEDED:
            names += _names(library, start, entries, strings=sections[link][4])
    return names


def _names(library: bytes, start: int, entries: int, strings: int) -> Iterator[str]:
    """Of the section at `start`: a list of libraries with a list of versions each."""
    for _ in range(entries):
        _, count, _, first, after = struct.unpack_from("<HHIII", library, start)
        version = start + first
        for _ in range(count):
            _, _, _, name, following = struct.unpack_from("<IHHII", library, version)
            yield library[strings + name : library.index(b"\0", strings + name)].decode()
            version += following
        start += after
