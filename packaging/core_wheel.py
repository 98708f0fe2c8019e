"""Builds the native core as a wheel and installs it into an environment; does neither when nothing changed."""

from __future__ import annotations

import argparse
import os
import platform
from collections.abc import Sequence
from pathlib import Path

import environment
import tree

WHEELS = tree.BUILD / "wheels"


def build(blender: tree.Blender) -> Path:
    """The wheel of the core, built when its sources have changed. Raises SetupError with the end of the compiler's output."""
    mark = _mark()
    stamp = WHEELS / "stamp"
    if not (tree.is_current(stamp, mark) and _wheels()):
        environment.check_compiler()
        for old in _wheels():
            old.unlink()
        with tree.step("building the native core"):
            pip_wheel(blender, WHEELS)
        tree.write_stamp(stamp, mark)
    return _wheels()[0]


def install(blender: tree.Blender) -> Path:
    """Build the wheel and see to it that the environment has exactly this one."""
    wheel = build(blender)
    stamp = blender.venv / "glint-core-stamp"
    if not tree.is_current(stamp, _mark()):
        command = [blender.interpreter, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "--force-reinstall"]
        tree.call([*command, wheel], "Remove the environment and call make again.")
        tree.write_stamp(stamp, _mark())
    return wheel


def _mark() -> str:
    sources = [tree.CORE, tree.ROOT / "pyproject.toml", tree.ROOT / "blender_manifest.toml"]
    return tree.fingerprint(sources, extra=f"{platform.machine()} {os.environ.get('CXX', '')}")


def _wheels() -> list[Path]:
    return sorted(WHEELS.glob("glint_core-*.whl"))


def pip_wheel(blender: tree.Blender, folder: Path, variables: dict[str, str] | None = None, options: Sequence[object] = ()) -> None:
    """Run pip wheel on the tree with these environment variables besides the usual ones; the wheel lands in `folder`."""
    command = [blender.interpreter, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--no-build-isolation"]
    path = os.pathsep.join([str(blender.interpreter.parent), os.environ.get("PATH", "")])
    cores = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count() or 1))
    remedy = "The core needs a C++20 compiler: GCC 12 or Clang 14, or later."
    environ = {**os.environ, "PATH": path, "CMAKE_BUILD_PARALLEL_LEVEL": cores, **(variables or {})}
    tree.call([*command, *options, "--wheel-dir", folder, tree.ROOT], remedy, env=environ)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    wheel = install(environment.prepare(parser.parse_args().bpy))
    print(f"glint: the core is {wheel.relative_to(tree.ROOT)}")


if __name__ == "__main__":
    tree.main(main)
