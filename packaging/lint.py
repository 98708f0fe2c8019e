"""`make lint`: ruff's rules and format over the Python of the tree, clang-format over the C++."""

from __future__ import annotations

import argparse
import subprocess

import environment
import tree


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    programs = environment.prepare(parser.parse_args().bpy).venv / "bin"
    sources = [path for path in tree.CORE.rglob("*") if path.suffix in (".h", ".cpp")]
    checks = (
        [programs / "ruff", "check", "."],
        [programs / "ruff", "format", "--check", "."],
        [programs / "clang-format", "--dry-run", "--Werror", *sorted(sources)],
    )
    return max(
        subprocess.run([str(word) for word in check], cwd=tree.ROOT).returncode for check in checks
    )


if __name__ == "__main__":
    tree.main(main)
