"""`make manual`: the manual as HTML in out/manual, by MkDocs. A dead link or anchor fails it."""

from __future__ import annotations

import argparse
import subprocess

import environment
import tree


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    python = environment.prepare(parser.parse_args().bpy).interpreter
    command = [str(python), "-m", "mkdocs", "build", "--strict", "--quiet"]
    code = subprocess.run(command, cwd=tree.ROOT).returncode
    if code == 0:
        print(f"The manual is {tree.ROOT / 'out' / 'manual' / 'index.html'}")
    return code


if __name__ == "__main__":
    tree.main(main)
