"""Instructions per ray and kind of ray, counted by callgrind, against the recorded ones: a
regression shows on a noisy machine.

    python tests/bench/instructions.py [--record] [--program build/bench/bench/ray_counts]

Runs engine/core/bench/ray_counts (built when not given) on its fixed mesh under `valgrind
--tool=callgrind`, with GLINT_ISA=avx2 because valgrind knows no AVX-512. Exit code 1 when a count
is more than 5 % above instructions.json; --record renews that file. Counts are those of one
compiler: with another one the table is printed, and nothing is judged. Without valgrind there is
nothing to do but say so.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

import core_program
from ray_tables import table

RECORDED = Path(__file__).with_name("instructions.json")
KINDS = ("primary", "camera", "shadow", "shadow_from_light", "mirror", "diffuse", "build")
GROWTH_ALLOWED = 0.05


@dataclass(frozen=True)
class Counts:
    """Instructions per item of each kind of work, and the compiler that made the program."""

    compiler: str
    per_item: dict[str, float]


def main() -> int:
    found = measure(__doc__, RECORDED, "ray_counts", KINDS)
    if not found:
        return 0
    measured, recorded, renewed = found
    print(counts_table(measured.per_item, recorded.per_item))
    if renewed:
        return 0
    if measured.compiler != recorded.compiler:
        print(
            f"not judged: recorded with compiler {recorded.compiler!r}, this is "
            f"{measured.compiler!r}"
        )
        return 0
    worse = grown(measured.per_item, recorded.per_item)
    print("\n".join(worse) or "no count grew by more than 5 %")
    return int(bool(worse))


def measure(
    description: str, file: Path, program: str, kinds: tuple[str, ...]
) -> tuple[Counts, Counts, bool] | None:
    """Reads the command line. Counts now, counts in `file`, whether these were renewed; None, and a
    line that says so, without valgrind.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--record", action="store_true", help=f"renew {file.name}")
    parser.add_argument("--program", help=f"a built {program}")
    options = parser.parse_args()
    valgrind = shutil.which("valgrind")
    if not valgrind:
        print("skipped, valgrind is not installed (Debian and Ubuntu: apt-get install valgrind)")
        return None
    built = options.program or str(core_program.build(program))
    counted = {kind: count(valgrind, built, kind) for kind in kinds}
    measured = Counts(counted[kinds[0]][1], {kind: value for kind, (value, _) in counted.items()})
    recorded = Counts(**json.loads(file.read_text())) if file.exists() else Counts("", {})
    if options.record:
        file.write_text(json.dumps(asdict(measured), indent=1) + "\n")
        print(f"recorded in {file.name}")
    return measured, recorded, options.record


def count(valgrind: str, program: str, kind: str) -> tuple[float, str]:
    """Instructions per ray (build: per triangle), and the compiler's version."""
    with tempfile.TemporaryDirectory() as folder:
        tool = [
            valgrind,
            "--tool=callgrind",
            "--toggle-collect=glint_counted_region",
            f"--callgrind-out-file={folder}/counts",
        ]
        environment = {**os.environ, "GLINT_ISA": "avx2"}
        done = subprocess.run(
            [*tool, program, kind], capture_output=True, text=True, env=environment
        )
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or not found:
        raise SystemExit(
            f"{kind} failed under valgrind:\n{done.stdout[-1000:]}{done.stderr[-2000:]}"
        )
    items, compiler = done.stdout.strip().split(" ", 1)
    return round(int(found[1]) / int(items), 2), compiler


def grown(measured: dict[str, float], recorded: dict[str, float]) -> list[str]:
    """A line per kind that grew by more than is allowed, or that was never recorded."""
    lines = []
    for kind, value in measured.items():
        if kind not in recorded:
            lines.append(f"{kind}: not recorded (--record does)")
        elif value > (1 + GROWTH_ALLOWED) * recorded[kind]:
            lines.append(
                f"{kind}: {value:.0f} instructions, recorded {recorded[kind]:.0f}: "
                f"{100 * (value / recorded[kind] - 1):+.1f} %"
            )
    return lines


def counts_table(measured: dict[str, float], recorded: dict[str, float]) -> str:
    rows = [("instructions per ray (build: per triangle)", "now", "recorded", "change")]
    for kind, value in measured.items():
        known = recorded.get(kind)
        rows.append(
            (
                kind,
                f"{value:.0f}",
                f"{known:.0f}" if known else "-",
                f"{100 * (value / known - 1):+.1f} %" if known else "-",
            )
        )
    return table(rows)


if __name__ == "__main__":
    sys.exit(main())
