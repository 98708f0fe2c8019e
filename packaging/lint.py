"""`make lint`: ruff's rules and format over the Python of the tree."""

from __future__ import annotations

import argparse
import subprocess

import environment
import tree


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    ruff = environment.prepare(parser.parse_args().bpy).venv / "bin" / "ruff"
    checks = (["check"], ["format", "--check"])
    return max(subprocess.run([str(ruff), *check, "."], cwd=tree.ROOT).returncode for check in checks)


if __name__ == "__main__":
    tree.main(main)
