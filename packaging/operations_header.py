"""Writes the core's list of program operations from `engine/program/table.py`.

Usage: python packaging/operations_header.py
A test compares the file with what this makes.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
MOST_CHECKED = 48
"""Settings below have a character of their own in the list, from 0 on."""
TARGET = ROOT / "engine/core/src/program/operations.inc"


def header(operations) -> str:
    """GLINT_OPERATION(name, widths of outputs, widths of arguments, settings, whether it
    reads a surface) lines. Settings are
    said by what they refer to, a an attribute, i an image, t a table, or by the largest number that
    they may be, counted in characters from 0 on; - is any.
    """
    lines = ["// Made by packaging/operations_header.py from engine/program/table.py."]
    for operation in operations:
        outputs, arguments = (
            "".join(str(int(kind)) for _, kind in part)
            for part in (operation.outputs, operation.arguments)
        )
        lines.append(
            f'GLINT_OPERATION({operation.name}, "{outputs}", "{arguments}", '
            f'"{_letters(operation)}", {str(operation.reads_surface).lower()})'
        )
    return "\n".join(lines) + "\n"


def _letters(operation) -> str:
    return "".join(_letter(choices) for _, choices in operation.settings)


def _letter(choices) -> str:
    references = {"attributes": "a", "textures": "i", "tables": "t"}
    value = getattr(choices, "value", None)
    if isinstance(value, str):
        return references[value]
    most = int(max(choices))
    return chr(ord("0") + most) if most < MOST_CHECKED else "-"


def main() -> None:
    sys.path.insert(0, str(ROOT))
    from engine.program.table import OPERATIONS

    TARGET.write_text(header(OPERATIONS))


if __name__ == "__main__":
    main()
