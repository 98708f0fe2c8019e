"""Renews the hashes and pictures of the reference renders, if the pictures are right.

    python tests/engine/renew_references.py [--unchecked]

Runs the checks against Cycles and the float64 reference, and that all instruction sets and threads
give the same bits, first; when one fails nothing is renewed. --unchecked leaves that out, for work
in progress. Says what has changed and by how much, and leaves old, new and difference in --out:
look at them before committing.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CHECKS = (
    "tests/cycles",
    "tests/engine/test_core_against_reference.py",
    "tests/engine/test_watertight.py",
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="without the checks against Cycles and the float64 reference",
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=ROOT / "out" / "references",
        help="where old, new and difference go",
    )
    options = parser.parse_args()
    sys.path[:0] = [str(HERE.parent), str(HERE)]
    import glint_tree  # noqa: F401  (makes the tree importable as `glint`)
    import reference_renders
    from glint.engine.native import binding

    if binding.load_error():
        print(f"the native core does not load: {binding.load_error()}")
        return 1
    failed = [] if options.unchecked else [check for check in CHECKS if not passes(check)]
    if failed:
        print(f"nothing was renewed: {', '.join(failed)} failed")
        return 1
    print("\n".join(reference_renders.renew(options.out) or ["nothing has changed"]))
    return 0


def passes(check: str) -> bool:
    """Whether the tests of a path pass in this very tree; a path without tests does not."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", "not slow", check]
    return subprocess.run(command, cwd=ROOT, check=False).returncode == 0


if __name__ == "__main__":
    sys.exit(main())
