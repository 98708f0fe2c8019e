"""`make lint`: ruff's rules and format over the Python of the tree, and the width of the C++."""

from __future__ import annotations

import argparse
import subprocess

import environment
import tree


def main() -> int:
    return max(python_problems(), wide_lines())


def python_problems() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    ruff = environment.prepare(parser.parse_args().bpy).venv / "bin" / "ruff"
    checks = (["check"], ["format", "--check"])
    return max(subprocess.run([str(ruff), *check, "."], cwd=tree.ROOT).returncode for check in checks)


def wide_lines() -> int:
    """Names the lines of C and C++ that are wider than Python's may be. Returns whether there are any."""
    width = tree.settings()["tool"]["ruff"]["line-length"]
    sources = sorted(path for path in tree.CORE.rglob("*") if path.suffix in (".h", ".cpp"))
    lines = [(path, number, line) for path in sources for number, line in enumerate(path.read_text("utf-8").splitlines(), 1)]
    wide = [f"{path.relative_to(tree.ROOT)}:{number}: {len(line)} characters" for path, number, line in lines if len(line) > width]
    print("\n".join(wide or ["C++: no line is too wide"]))
    return int(bool(wide))


if __name__ == "__main__":
    tree.main(main)
