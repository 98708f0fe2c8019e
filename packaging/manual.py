"""`make manual`: the manual as HTML in out/manual, by MkDocs. A dead link or anchor fails it."""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

import environment
import tree


def build(python: Path | str, root: Path) -> tuple[int, str]:
    """Exit code of MkDocs on the mkdocs.yml of a folder, and what it warned of. It must not be
    quiet: it counts no warnings then.
    """
    command = [str(python), "-m", "mkdocs", "build", "--strict"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    told = (done.stdout + done.stderr).splitlines()
    return done.returncode, "\n".join(line for line in told if not line.startswith("INFO"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    code, told = build(environment.prepare(parser.parse_args().bpy).interpreter, tree.ROOT)
    print(told or f"The manual is {tree.ROOT / 'out' / 'manual' / 'index.html'}")
    return code


if __name__ == "__main__":
    tree.main(main)
