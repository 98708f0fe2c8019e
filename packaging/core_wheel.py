"""Builds the native core as a wheel and installs it into an environment; does neither when nothing
changed.
"""

from __future__ import annotations

import argparse
import os
import platform
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import environment
import glibc
import tree

WHEELS = tree.BUILD / "wheels"


def build(blender: tree.Blender) -> Path:
    """The wheel of the core, built when its sources have changed. Raises SetupError with the end of
    the compiler's output.
    """
    mark = _mark()
    stamp = WHEELS / "stamp"
    if not (tree.is_current(stamp, mark) and _wheels()):
        environment.check_compiler()
        for old in _wheels():
            old.unlink()
        with tree.step("building the native core"):
            pip_wheel(blender, WHEELS)
            _tag(blender, _wheels()[0])
        tree.write_stamp(stamp, mark)
    return _wheels()[0]


def install(blender: tree.Blender) -> Path:
    """Build the wheel and see to it that the environment has exactly this one."""
    wheel = build(blender)
    stamp = blender.venv / "glint-core-stamp"
    if not tree.is_current(stamp, _mark()):
        words = ["--no-deps", "--force-reinstall", wheel]
        environment.pip_install(blender, words, "Remove the environment and call make again.")
        tree.write_stamp(stamp, _mark())
    return wheel


def _mark() -> str:
    sources = [
        Path(__file__),
        Path(glibc.__file__),
        tree.CORE,
        tree.ROOT / "pyproject.toml",
        tree.ROOT / "blender_manifest.toml",
    ]
    return tree.fingerprint(sources, extra=f"{platform.machine()} {os.environ.get('CXX', '')}")


def _tag(blender: tree.Blender, wheel: Path) -> None:
    """Name a wheel that was built on Linux after the oldest C library that it runs with."""
    if sys.platform != "linux":
        return
    major, minor = glibc.needed(library_of(wheel))
    retag(blender, wheel, f"manylinux_{major}_{minor}_{platform.machine()}")


def library_of(wheel: Path, name: str = "libglint_core.so") -> bytes:
    """The shared library in a wheel of the core. Raises SetupError where it holds none."""
    with zipfile.ZipFile(wheel) as packed:
        if f"glint_core/{name}" not in packed.namelist():
            raise tree.SetupError(f"{wheel.name} does not hold {name}.")
        return packed.read(f"glint_core/{name}")


def retag(blender: tree.Blender, wheel: Path, tag: str) -> None:
    """Give a wheel the name of another platform."""
    command = [blender.interpreter, "-m", "wheel", "tags", "--remove", "--platform-tag", tag, wheel]
    environ = {**os.environ, **_timeless()}
    tree.call(command, "The wheel cannot be renamed.", cwd=wheel.parent, env=environ)


def _timeless() -> dict[str, str]:
    """What keeps the time of building out of a wheel."""
    return {"SOURCE_DATE_EPOCH": str(tree.source_date())}


def _wheels() -> list[Path]:
    return sorted(WHEELS.glob("glint_core-*.whl"))


def pip_wheel(
    blender: tree.Blender,
    folder: Path,
    variables: dict[str, str] | None = None,
    options: Sequence[object] = (),
) -> None:
    """Run pip wheel on the tree with these environment variables besides the usual ones; the wheel
    lands in `folder`.
    """
    command = [
        blender.interpreter,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--disable-pip-version-check",
        "--no-deps",
        "--no-build-isolation",
    ]
    path = os.pathsep.join([str(blender.interpreter.parent), os.environ.get("PATH", "")])
    cores = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count() or 1))
    remedy = "The core needs a C++20 compiler: GCC 12 or Clang 14, or later."
    more = {"PATH": path, "CMAKE_BUILD_PARALLEL_LEVEL": cores, **(variables or {})}
    environ = {**os.environ, **_timeless(), **more}
    tree.call([*command, *options, "--wheel-dir", folder, tree.ROOT], remedy, env=environ)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    wheel = install(environment.prepare(parser.parse_args().bpy))
    print(f"glint: the core is {wheel.relative_to(tree.ROOT)}")


if __name__ == "__main__":
    tree.main(main)
