"""Builds a program of engine/core/bench, in build/bench."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def build(target: str, remedy: str = "") -> Path:
    """The program, built in Release with the CMake beside this Python or on the path; SystemExit,
    with `remedy`, without such a target.
    """
    folder = ROOT / "build" / "bench"
    beside = Path(sys.executable).parent / "cmake"
    cmake = str(beside) if beside.exists() else "cmake"
    run(
        [
            cmake,
            "-S",
            str(ROOT / "engine" / "core"),
            "-B",
            str(folder),
            "-DCMAKE_BUILD_TYPE=Release",
        ]
    )
    if target not in run([cmake, "--build", str(folder), "--target", "help"]):
        raise SystemExit(f"engine/core has no {target} here. {remedy}")
    run([cmake, "--build", str(folder), "--target", target, "--parallel", "2"])
    return folder / "bench" / target


def run(command: list[str], **options) -> str:
    """Its output; SystemExit with the end of what it said when it fails."""
    done = subprocess.run(command, capture_output=True, text=True, **options)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} failed:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return done.stdout
