"""Writes `engine/native/core_types.py` from the structures and enums of the core's C header.

Usage: python packaging/core_types.py
A test compares the file with what this makes.
"""

from __future__ import annotations

import re
from itertools import groupby
from math import prod
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HEADER = ROOT / "engine/core/include/glint.h"
TARGET = ROOT / "engine/native/core_types.py"
WIDTH = 100

_HEAD = '''"""Made by packaging/core_types.py from core/include/glint.h, which says what it means.

Constants have lost the prefixes of their enum. Pointers are plain addresses (c_size_t), so that
tables can be NumPy arrays.
"""

from __future__ import annotations

from ctypes import Structure, c_double, c_int32, c_size_t, c_uint32, c_uint64
from enum import IntEnum
from typing import Any

ABI_VERSION = {version}


def _each(kind: Any, names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names.split()]
'''


def core_types(header: str) -> str:
    """The module's text."""
    text = re.sub(r"/\*.*?\*/", "", header, flags=re.S)
    text = re.sub(r"union\s*{\s*(\w+ \w+)[^}]*}", r"\1", text)  # one name for all
    version = re.search(r"#define GLINT_ABI_VERSION (\d+)", text).group(1)
    parts = [_HEAD.format(version=version)]
    parts += [_enum(*found) for found in re.findall(r"enum Glint(\w+) {(.*?)}", text, re.S)]
    structures = re.findall(r"typedef struct Glint(\w+) {(.*?)} Glint", text, re.S)
    parts += [_structure(name, body) for name, body in structures if not name.endswith("F64")]
    return "\n\n".join(parts)


def _enum(name: str, body: str) -> str:
    """Constants lose GLINT_ and, at either end, the first word of their enum; a number of constants
    (COUNT) is left out.
    """
    word = re.match(r"[A-Z][a-z]*", name).group().upper()
    lines, value = [f"class {name}(IntEnum):"], -1
    for item in filter(None, map(str.strip, body.split(","))):
        constant, _, given = item.partition(" = ")
        value = int(given) if given else value + 1
        short = re.sub(rf"^{word}_|_{word}$", "", constant.removeprefix("GLINT_"))
        lines += [f"    {short} = {value}"] if short != "COUNT" else []
    return "\n".join(lines) + "\n"


def _structure(name: str, body: str) -> str:
    """Of a pair for two precisions, whose addresses point at other numbers, one stands for both."""
    name = name.removesuffix("F32").removesuffix("Data")
    lines = [f"class {name}Data(Structure):", "    _fields_ = ["]
    fields = [field for declaration in body.split(";") for field in _fields(declaration.strip())]
    for kind, group in groupby(fields, lambda field: field[1]):
        lines += _lines(kind, [field for field, _ in group])
    return "\n".join([*lines, "    ]"]) + "\n"


def _fields(declaration: str) -> list[tuple[str, str]]:
    """(name, ctypes type) of `const double* a` or `uint32_t a, b[4]`."""
    if not declaration:
        return []
    kind, pointer, names = re.fullmatch(r"(?:const )?(\w+)(\*?) (.*)", declaration, re.S).groups()
    fields = []
    for item in names.split(","):
        name, sizes = re.fullmatch(r"\s*(\w+)((?:\[\d+\])*)", item).groups()
        count = prod(map(int, re.findall(r"\d+", sizes)))
        fields.append((name, "c_size_t" if pointer else _type(kind) + f" * {count}" * bool(sizes)))
    return fields


def _type(kind: str) -> str:
    if kind.startswith("Glint"):
        return f"{kind.removeprefix('Glint')}Data"
    return f"c_{kind.removesuffix('_t')}"


def _lines(kind: str, names: list[str]) -> list[str]:
    lines = [""]
    for name in names:
        longer = f"{lines[-1]} {name}".strip()
        if len(f'        *_each({kind}, "{longer}"),') > WIDTH:
            lines.append(name)
        else:
            lines[-1] = longer
    return [f'        *_each({kind}, "{line}"),' for line in lines]


if __name__ == "__main__":
    TARGET.write_text(core_types(HEADER.read_text()))
