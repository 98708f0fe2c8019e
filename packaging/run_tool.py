"""Runs one of the tree's own scripts (bench, contact sheet) in the prepared environment."""

from __future__ import annotations

import argparse
import os
import subprocess

import core_wheel
import environment
import tree


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    parser.add_argument("script")
    parser.add_argument("arguments", nargs=argparse.REMAINDER)
    options = parser.parse_args()
    blender = environment.prepare(options.bpy)
    core_wheel.install(blender)
    blender.bare_resources.mkdir(parents=True, exist_ok=True)
    variables = {
        **os.environ,
        **tree.bytecode_variables(),
        "BLENDER_USER_RESOURCES": str(blender.bare_resources),
    }
    command = [str(blender.interpreter), str(tree.ROOT / options.script), *options.arguments]
    return subprocess.run(command, cwd=tree.ROOT, env=variables).returncode


if __name__ == "__main__":
    tree.main(main)
