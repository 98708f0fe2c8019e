"""`make test-blenders`: the tests that talk to Blender, in every bpy of the matrix and in a whole
program where one can be had.

The default one runs in `make test`; 5.2 runs where a Python 3.13 is at hand. What is marked `once`
in these folders asks nothing of Blender that differs between its versions, and `make test` has seen
it.
"""

from __future__ import annotations

import argparse
import os
import subprocess

import environment
import run_tests
import tree

TESTS = (
    "tests/packaging",
    "tests/blender",
    "tests/cycles/test_cycles_voronoi.py",
    "tests/cycles/test_cycles_procedural_textures.py",
)
"""The last two: patterns of textures, which Blender changes from version to version."""
CHOSEN = ("-m", "not slow and not once")
DEBIAN = tree.ROOT / ".cache" / "debian-trixie"
CANNOT = 77


def main() -> int:
    """One line per Blender at the end; fails when any of them did."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--oldest", action="store_true", help="no other bpy, and no whole program")
    others = [x for x in tree.settings()["tool"]["glint"]["bpy"] if not _is_default(x)]
    oldest = parser.parse_args().oldest
    chosen = sorted(others)[:1] if oldest else others
    results = {f"bpy {series}": _series(series) for series in chosen}
    if not oldest:
        results["Debian's blender"] = _debian()
    print("\n".join(f"glint: {name:17} {result}" for name, result in results.items()), flush=True)
    return int(any(result.startswith("failed") for result in results.values()))


def _is_default(series: str) -> bool:
    return series == tree.settings()["tool"]["glint"]["default"]


def _series(series: str) -> str:
    print(f"glint: === Blender {series} ===", flush=True)
    blender = tree.blender(series)
    try:
        environment.find_python(blender.python)
    except tree.SetupError as failure:
        return f"left out: {failure}"
    try:
        return _verdict(run_tests.run(series, [*run_tests.PARALLEL, *CHOSEN, *TESTS]))
    except tree.SetupError as failure:
        return f"failed: {failure}"


def _debian() -> str:
    """A whole program: installed zips, exit codes of `blender -b`, the command line."""
    print("glint: === Debian's Blender ===", flush=True)
    made = subprocess.run(
        [str(tree.ROOT / "packaging" / "debian_blender.sh"), str(DEBIAN)],
        stdout=subprocess.PIPE,
        text=True,
    )
    if made.returncode == CANNOT:
        return f"left out: {made.stdout.splitlines()[-1]}"
    if made.returncode != 0:
        return f"failed: debian_blender.sh ended with {made.returncode}"
    program = {"GLINT_BLENDER": f"chroot {DEBIAN} blender", "GLINT_BLENDER_ROOT": str(DEBIAN)}
    os.environ.update(program)
    return _verdict(run_tests.run("", [*CHOSEN, "tests/packaging"]))


def _verdict(code: int) -> str:
    return "passed" if code == 0 else f"failed: pytest ended with {code}"


if __name__ == "__main__":
    tree.main(main)
