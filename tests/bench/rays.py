"""Glint beside Embree on the same rays: rates, builds, memory; tables, a plot and the numbers as
JSON.

    python tests/bench/rays.py [--quick] [--meshes NAME …] [--size 1024] [--rounds 5] [--threads 2]
    [--out out/rays]

Builds engine/core with its benchmark (into build/bench; needs Embree 3 or 4 with headers, Debian:
libembree-dev), dumps Blender's and the shared scenes' meshes, and runs
engine/core/bench/embree_bench on each in a process of its own. `--program` takes a built one,
`--reuse` keeps the reports that are there. Scenes that are absent are named, not passed over.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

import core_program
import ray_tables
from ray_meshes import MESHES, SCENES

GENERATED = {
    "icosphere_5k": "icosphere:4",
    "bumpy_70k": "bumpy:132x264",
    "bumpy_2M": "bumpy:708x1414",
    "instances_10k": "instances:10000",
    "instances_3": "copies:3",
}
"""Made by the program itself: name → its --mesh."""
QUICK = ("icosphere_5k", "suzanne_16k", "living_room", "bumpy_70k", "instances_10k")
SECONDS_ALLOWED = 1800
NEEDS_EMBREE = (
    "It needs Embree 3 or 4 with its headers and CMake files (Debian and Ubuntu: "
    "apt-get install libembree-dev)."
)


def main() -> int:
    options = parse_arguments()
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    program = (
        Path(options.program)
        if options.program
        else core_program.build("embree_bench", NEEDS_EMBREE)
    )
    if options.dump:
        return max(dump(name, out) is None for name in options.meshes if name in MESHES)
    reports, failed = {}, False
    for name in options.meshes:
        report = measure(program, name, out, options)
        failed |= report is None
        if report:
            reports[name] = report
    if not reports:
        return 1
    text = "\n\n".join(
        [
            "one thread, million rays a second\n" + ray_tables.rates_table(reports, 1),
            ray_tables.summary_table(reports),
            ray_tables.builds_table(reports),
        ]
    )
    print("\n" + text)
    (out / "rays.txt").write_text(text + "\n")
    (out / "rays.json").write_text(json.dumps(reports, indent=1))
    (out / "rays.svg").write_text(ray_tables.plot(reports))
    print(f"\nsee {out / 'rays.txt'}, {out / 'rays.json'} and {out / 'rays.svg'}")
    return int(failed)


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    everything = [*GENERATED, *MESHES]
    parser.add_argument(
        "--quick", action="store_true", help="five meshes, 512², one thread, three rounds"
    )
    parser.add_argument(
        "--meshes", nargs="+", choices=everything, metavar="NAME", help=", ".join(everything)
    )
    parser.add_argument("--size", type=int)
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--program", help="a built embree_bench")
    parser.add_argument("--reuse", action="store_true", help="keep the reports of an earlier run")
    parser.add_argument("--dump", action="store_true", help="only dump the meshes into --out")
    parser.add_argument("--out", default="out/rays")
    options = parser.parse_args()
    for name, quick, full in (
        ("meshes", list(QUICK), everything),
        ("size", 512, 1024),
        ("rounds", 3, 5),
        ("threads", 1, 2),
    ):
        if getattr(options, name) is None:
            setattr(options, name, quick if options.quick else full)
    return options


def measure(program: Path, name: str, out: Path, options) -> dict | None:
    """The report of one mesh; None, with the reason printed, when there is none."""
    saved = out / f"{name}.json"
    if options.reuse and saved.exists():
        return json.loads(saved.read_text())
    source = GENERATED.get(name) or dump(name, out)
    if source is None:
        return None
    numbers = [
        "--size",
        str(options.size),
        "--rounds",
        str(options.rounds),
        "--threads",
        str(options.threads),
    ]
    command = [str(program), "--mesh", str(source), "--json", str(saved), *numbers]
    print(f"{name}: {' '.join(command)}", flush=True)
    saved.unlink(missing_ok=True)
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS_ALLOWED)
    except subprocess.TimeoutExpired:
        print(f"{name}: FAILED, more than {SECONDS_ALLOWED} s")
        return None
    if done.returncode:
        print(f"{name}: FAILED, exit code {done.returncode}: {done.stderr[-500:]}")
        return None
    return json.loads(saved.read_text())


def dump(name: str, out: Path) -> Path | None:
    """The mesh's file, made in a process of its own when it is not there; None, with the reason
    printed, when it cannot be.
    """
    path = out / f"{name}.rays"
    source = MESHES[name][0]
    if path.exists():
        return path
    if isinstance(source, str) and not (SCENES / source).exists():
        print(f"{name}: FAILED, {SCENES / source} is not there")
        return None
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("ray_meshes.py")), name, str(path)],
        capture_output=True,
        text=True,
    )
    if done.returncode:
        print(f"{name}: FAILED, Blender did not dump it:\n{done.stderr[-1000:]}")
        return None
    return path


if __name__ == "__main__":
    sys.exit(main())
