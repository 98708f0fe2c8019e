"""The table of the extremes: extreme | Cycles' wrong pixels | Glint's wrong pixels.

    python tests/extremes/table.py [ROWS.json] [--all]

Without ROWS.json all tests here are run first, slow ones too. Prints Markdown: one line for each
extreme with the cases that were worst for Cycles and for Glint, or with --all a line for every
case.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
JSON_VARIABLE = "GLINT_EXTREMES_JSON"
TITLES = {
    "N3": "Everything moved away from the origin, to 1e7",
    "N4": "Convex and flat things under a low sun, to 1e6 from the origin",
    "N5": "Everything scaled by 1e-6 to 1e15",
    "N6": "Faces without area, NaN, infinite, 3e38 and denormal vertices",
    "N7": "Objects scaled by 1e±6, mirrored, sheared, flattened",
    "N8": "Sun at up to 89.9999° from the zenith",
    "N9": "Lamp on a surface, 1e-6 above, at a corner, inside",
    "N10": "Where a cube meets the floor, seen 1 to 1e-4 across",
    "N11": "Coarse smooth balls: acne",
    "N12": "Field of view 0.01° to 179.9°, shift 100, parallel 1e-6 to 1e6, clip 1e-6 to 1e30, "
    "scaled cameras",
    "N13": "2 and 100 faces in the same place",
    "N14": "Highlights of exponent 0 to 1e9",
    "N16": "Mean of a million samples",
}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "rows", nargs="?", type=Path, help="what GLINT_EXTREMES_JSON of an earlier run holds"
    )
    parser.add_argument("--all", action="store_true", help="every case")
    options = parser.parse_args()
    rows = json.loads(options.rows.read_text()) if options.rows else measured()
    print("\n".join(every_case(rows) if options.all else summary(rows)))
    return 1 if any(row["glint"] for row in rows) else 0


def measured() -> list[dict]:
    """The rows of a run of all tests here; the program ends with its exit code when they fail."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.json"
        command = [sys.executable, "-m", "pytest", "-q", str(HERE)]
        run = subprocess.run(
            command, env={**os.environ, JSON_VARIABLE: str(path)}, stdout=sys.stderr
        )
        if run.returncode or not path.exists():
            raise SystemExit(run.returncode or 1)
        return json.loads(path.read_text())


def summary(rows: list[dict]) -> list[str]:
    """A line for each extreme."""
    lines = ["| extreme | cases | Cycles: wrong pixels, worst case | Glint |", "|---|---|---|---|"]
    for extreme, title in TITLES.items():
        mine = [row for row in rows if row["extreme"] == extreme]
        if mine:
            worst = max(mine, key=lambda row: row["cycles"] / row["pixels"])
            cycles = (
                f"{worst['cycles']} of {worst['pixels']} ({worst['case']})"
                if worst["cycles"]
                else "0"
            )
            lines.append(
                f"| {title} | {len(mine)} | {cycles} | {max(row['glint'] for row in mine)} |"
            )
    return lines


def every_case(rows: list[dict]) -> list[str]:
    """A line for each case, with the largest relative error of pixels that are not wrong."""
    lines = [
        "| id | case | pixels | Cycles: wrong | Glint: wrong | Cycles: error of the others | Glint "
        "|",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        errors = f"{row['cycles_error']:.1e} | {row['glint_error']:.1e}"
        lines.append(
            f"| {row['extreme']} | {row['case']} | {row['pixels']} | {row['cycles']} | "
            f"{row['glint']} | {errors} |"
        )
    return lines


if __name__ == "__main__":
    sys.exit(main())
