"""Writes the core's list of program operations from `engine/program/table.py`.

Usage: python packaging/operations_header.py
A test compares the file with what this makes.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "engine/core/src/program/operations.inc"


def header(operations) -> str:
    """GLINT_OPERATION(name, widths of outputs, widths of arguments, settings) lines. Settings are
    said by what they refer to: a an attribute, i an image, t a table, - nothing.
    """
    lines = ["// Made by packaging/operations_header.py from engine/program/table.py."]
    for operation in operations:
        outputs, arguments = (
            "".join(str(int(kind)) for _, kind in part)
            for part in (operation.outputs, operation.arguments)
        )
        lines.append(
            f'GLINT_OPERATION({operation.name}, "{outputs}", "{arguments}", '
            f'"{_letters(operation)}")'
        )
    return "\n".join(lines) + "\n"


def _letters(operation) -> str:
    letters = {"attributes": "a", "textures": "i", "tables": "t"}
    values = (getattr(choices, "value", None) for _, choices in operation.settings)
    return "".join(letters.get(value, "-") if isinstance(value, str) else "-" for value in values)


def main() -> None:
    sys.path.insert(0, str(ROOT))
    from engine.program.table import OPERATIONS

    TARGET.write_text(header(OPERATIONS))


if __name__ == "__main__":
    main()
