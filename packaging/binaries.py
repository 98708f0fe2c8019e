"""What a library of the core shows and asks for, read off the file: its machine, what it exports,
which libraries it loads, the oldest system that it says it runs on, its signature.

    python packaging/binaries.py PLATFORM LIBRARY

prints a line for everything that is wrong. It needs lief (pyproject.toml's group `wheels`).
"""

from __future__ import annotations

import hashlib
import re
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import glibc
import tree

OLDEST_GLIBC = (2, 28)
OLDEST_MACOS = [11, 0, 0]

# What comes with every system of the kind. Windows has the libraries of its C runtime since 10.
_LIBRARIES = {
    "linux": r"lib(c|m|dl|rt|pthread)\.so\.\d|ld-linux[-\w]*\.so\.\d",
    "windows": r"(api-ms-win-crt-[-\w]+|kernel32|ntdll|advapi32)\.dll",
    "macos": r"/usr/lib/libSystem\.B\.dylib",
}
_MACHINES = {
    "linux-x64": "X86_64",
    "linux-arm64": "AARCH64",
    "windows-x64": "AMD64",
    "windows-arm64": "ARM64",
    "macos-x64": "X86_64",
    "macos-arm64": "ARM64",
}
# Zig's linker shows its own marks of a library's beginning besides.
_MARKS = {"__mh_dylib_header", "___dso_handle"}


def look(blender: tree.Blender, platform: str, library: Path) -> list[str]:
    """`problems` of a file, found in the environment that has lief. Raises SetupError where it
    cannot be read at all.
    """
    command = [str(part) for part in (blender.interpreter, __file__, platform, library)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise tree.SetupError(f"{library.name} cannot be read: {done.stderr}")
    return done.stdout.splitlines()


def problems(platform: str, library: bytes) -> list[str]:
    """Everything about a library of the core that would surprise a machine of this platform."""
    import lief

    system = platform.split("-")[0]
    binary = lief.parse(library)
    if isinstance(binary, lief.MachO.FatBinary):
        binary = binary.at(0)
    return [
        *_wrong_machine(platform, binary),
        *_wrong_exports(system, binary),
        *_wrong_libraries(system, binary),
        *_paths(library),
        *{"linux": _elf, "windows": _pe, "macos": _macho}[system](binary, library),
    ]


def declared() -> set[str]:
    """The functions of glint.h."""
    header = (tree.CORE / "include" / "glint.h").read_text()
    return set(re.findall(r"^GLINT_API\s[^;(]*?\b(glint_\w+)\(", header, re.M))


def _wrong_machine(platform: str, binary) -> Iterator[str]:
    header = binary.header
    found = next(
        getattr(header, name)
        for name in ("machine_type", "machine", "cpu_type")
        if hasattr(header, name)
    )
    if found.name != _MACHINES[platform]:
        yield f"it is for {found.name}"


def _wrong_exports(system: str, binary) -> Iterator[str]:
    if system == "macos":
        names = {symbol.name for symbol in binary.exported_symbols} - _MARKS
        names = {name.removeprefix("_") for name in names}
    else:
        names = {function.name for function in binary.exported_functions}
    for name in sorted(declared() - names):
        yield f"it does not export {name}"
    for name in sorted(names - declared()):
        yield f"it exports {name}"


def _wrong_libraries(system: str, binary) -> Iterator[str]:
    if system == "macos":
        names = [item.name for item in binary.libraries if "ID" not in item.command.name]
    else:
        names = list(binary.libraries)
    for name in names:
        if not re.fullmatch(_LIBRARIES[system], name, re.IGNORECASE):
            yield f"it loads {name}"


def _paths(library: bytes) -> Iterator[str]:
    """Places of the machine that built it: they would make other bits elsewhere."""
    for place in (tree.ROOT, Path.home()):
        if str(place).encode() + b"/" in library:
            yield f"it names {place}"


def _elf(binary, library: bytes) -> Iterator[str]:
    needed = glibc.needed(library)
    if needed > OLDEST_GLIBC:
        yield f"it needs the GNU C library {needed}"


def _pe(binary, library: bytes) -> Iterator[str]:
    kinds = {entry.type.name for entry in binary.debug}
    if kinds - {"REPRO"}:
        yield f"it has debug entries {', '.join(sorted(kinds))}"
    if "REPRO" not in kinds and binary.header.time_date_stamps:
        yield "it tells when it was built"


def _macho(binary, library: bytes) -> Iterator[str]:
    names = [item.name for item in binary.libraries if "ID" in item.command.name]
    if names != ["@rpath/libglint_core.dylib"]:
        yield f"its own name is {', '.join(names)}"
    if binary.header.file_type.name != "DYLIB":
        yield f"it is a {binary.header.file_type.name}"
    version = binary.build_version
    if version.platform.name != "MACOS" or list(version.minos) > OLDEST_MACOS:
        yield f"it is for {version.platform.name} {version.minos}"
    if binary.has_code_signature:
        signature = binary.code_signature
        yield from _signature(library, signature.data_offset, signature.data_size)
    elif binary.header.cpu_type.name == "ARM64":
        yield "it has no signature, without which macOS on arm64 loads nothing"


_ADHOC, _SHA256 = 0x2, 2
_EMBEDDED, _DIRECTORY = 0xFADE0CC0, 0xFADE0C02


def _signature(library: bytes, start: int, size: int) -> Iterator[str]:
    """An ad-hoc signature is a table of the hashes of all pages before it (Apple's
    cs_blobs.h)."""
    blob = library[start : start + size]
    magic, _, count = struct.unpack_from(">III", blob)
    offsets = [struct.unpack_from(">II", blob, 12 + 8 * k)[1] for k in range(count)]
    [at] = [at for at in offsets if struct.unpack_from(">I", blob, at)[0] == _DIRECTORY]
    _, _, _, flags, hashes, _, _, pages, limit = struct.unpack_from(">9I", blob, at)
    kind, page_bits = blob[at + 37], blob[at + 39]
    if magic != _EMBEDDED or not flags & _ADHOC or kind != _SHA256 or limit != start:
        yield "its signature is not an ad-hoc one of the whole file"
        return
    page = 1 << page_bits
    for k in range(pages):
        told = blob[at + hashes + 32 * k : at + hashes + 32 * (k + 1)]
        if told != hashlib.sha256(library[k * page : min((k + 1) * page, limit)]).digest():
            yield f"its signature has another hash of page {k}"


if __name__ == "__main__":
    for problem in problems(sys.argv[1], Path(sys.argv[2]).read_bytes()):
        print(problem)
