"""`make lint`: ruff's rules and format over the Python of the tree; clang-format over the C++, and
one statement a line there; mypy over the engine; the manual's page of messages.
"""

from __future__ import annotations

import argparse
import subprocess

import commas
import environment
import messages
import tree


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    programs = environment.prepare(parser.parse_args().bpy).venv / "bin"
    sources = sorted(path for path in tree.CORE.rglob("*") if path.suffix in (".h", ".cpp"))
    checks = (
        [programs / "ruff", "check", "."],
        [programs / "ruff", "format", "--check", "."],
        [programs / "python", "-m", "mypy"],
        [programs / "clang-format", "--dry-run", "--Werror", *sources],
    )
    joined = commas.problems(sources) + messages.problems()
    print(*joined, sep="\n", end="\n" if joined else "")
    codes = [
        subprocess.run([str(word) for word in check], cwd=tree.ROOT).returncode for check in checks
    ]
    return max(*codes, bool(joined))


if __name__ == "__main__":
    tree.main(main)
