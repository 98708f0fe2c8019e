"""Writes the table of closures, `engine/closures/table.py`, for the core and into
docs/semantics/lobes.md.

Usage: python packaging/closures_table.py
A test compares both with what this makes.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HEADER = ROOT / "engine/core/src/shading/closure/table.inc"
DOCUMENT = ROOT / "docs/semantics/lobes.md"
PLACES = 3


def header(closures) -> str:
    """Initialisers of ClosureRow, in the order of GlintLobeKind."""
    lines = ["// Made by packaging/closures_table.py from engine/closures/table.py."]
    for row in closures:
        places = ["{}"] * PLACES
        for p in row.parameters:
            places[p.place] = f'{{"{p.name}", {p.low:g}, {p.high:g}}}'
        flags = ", ".join(str(flag).lower() for flag in (row.passes, row.of_fibre))
        lines.append(f'{{"{row.name}", {{{", ".join(places)}}}, {row.columns}, {flags}}},')
    return "\n".join(lines) + "\n"


def document(closures) -> str:
    """The table's rows in Markdown."""
    lines = ["| lobe | parameters | counts as | besides |", "|---|---|---|---|"]
    for row in closures:
        parameters = ", ".join(
            f"{p.name} {p.low:g} to {p.high:g}" + (" (fixed)" if not p.varies else "")
            for p in row.parameters
        )
        normal = {"": "", "POINT": "the point's n", "OWN": "n may be its own"}[row.normal]
        flags = {"sends rays on": row.passes, "times (1 − n·v)^p": row.by_view}
        besides = ", ".join([*filter(None, [normal]), *(k for k, is_so in flags.items() if is_so)])
        cells = (row.name, parameters, row.counts.capitalize(), besides)
        lines.append("| " + " | ".join(cell or "–" for cell in cells) + " |")
    return "\n".join(lines) + "\n"


def documented(text: str, closures) -> str:
    """The page of lobes with the table as it is."""
    table = document(closures)
    first = table.splitlines()[0]
    return re.sub(re.escape(first) + r"\n(\|.*\n)+", lambda _: table, text)


def main() -> None:
    sys.path.insert(0, str(ROOT))
    from engine.closures.table import CLOSURES

    HEADER.write_text(header(CLOSURES.values()))
    DOCUMENT.write_text(documented(DOCUMENT.read_text(), CLOSURES.values()))


if __name__ == "__main__":
    main()
