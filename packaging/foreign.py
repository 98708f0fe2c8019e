"""Runs builds of the core on machines other than this one: Linux for arm64 under `qemu-user`,
Windows for x64 under Wine.

Two things are run: the core's own tests, and a tape of what the reference renders ask of the core
(tests/engine/core_tape.py), played to the very library of the wheel; its pictures must have the
bits of those that this machine's core draws.
"""

from __future__ import annotations

import argparse
import json
import os
import platform as host
import re
import shutil
import sys
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import core_wheel
import environment
import extension_zips
import tree
import wheels

FOLDER = tree.BUILD / "foreign"
TAPE, PICTURES = FOLDER / "reference.tape", FOLDER / "reference.pictures"
ISAS = ("sse42", "avx2", "avx512")
STAGES = "avx2"
"""The set of stages that is built: each takes minutes, and what the others show of a platform one
does. Traversal has all instruction sets.
"""
TESTS = {"accel_tests": (), "core_tests": (), "fuzz": ("1000", "60")}
"""The core's test programs and their arguments, as engine/core/tests/CMakeLists.txt has them."""


class CannotRun(tree.SetupError):
    """This machine has nothing to run such programs with; the message says what it would take."""


@dataclass(frozen=True)
class Runner:
    """How programs of a platform are started here."""

    command: tuple[str, ...] = ()
    variables: dict[str, str] = field(default_factory=dict)

    def run(self, folder: Path, program: str, *arguments: str, **variables: str) -> str:
        """The output of a program of `folder`, in that folder. Raises SetupError where it fails."""
        environ = {**os.environ, **self.variables, **variables, "LD_LIBRARY_PATH": str(folder)}
        return tree.call(
            [*self.command, f"./{program}", *arguments],
            "The build does not do on its machine what it does on this one.",
            cwd=folder,
            env=environ,
        )


def runner(platform: str) -> Runner:
    """Raises CannotRun. Installs the Debian packages it needs where it may."""
    if platform == extension_zips.blender_platform():
        return Runner()
    if platform == "linux-arm64" and sys.platform == "linux":
        emulator = _program("qemu-aarch64", "qemu-user")
        root = Path("/usr/aarch64-linux-gnu")
        if not root.is_dir():
            _install("libc6-arm64-cross")
        return Runner((emulator, "-L", str(root)))
    if platform == "windows-x64" and extension_zips.blender_platform() == "linux-x64":
        prefix = FOLDER / "wine"
        prefix.mkdir(parents=True, exist_ok=True)
        wine = _program("wine64", "wine64", Path("/usr/lib/wine/wine64"))
        return Runner((wine,), {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all"})
    raise CannotRun(f"nothing on {host.system()} {host.machine()} runs programs for {platform}")


def _program(name: str, package: str, *elsewhere: Path) -> str:
    def found() -> str | None:
        return shutil.which(name) or next((str(path) for path in elsewhere if path.exists()), None)

    if not found():
        _install(package)
    return found() or name


def _install(package: str) -> None:
    if not shutil.which("apt-get") or os.geteuid() != 0:
        raise CannotRun(
            f"{package} is not installed (Debian and Ubuntu: apt-get install {package})"
        )
    command = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", package]
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    try:
        tree.call(["apt-get", "update", "-qq"], "Debian's servers must be in reach.", env=quiet)
        tree.call(command, "Debian's servers must be in reach.", env=quiet)
    except tree.SetupError as failure:
        raise CannotRun(f"{package} cannot be installed: {failure}") from failure


def run_tests(blender: tree.Blender, platform: str, wheel: Path) -> str:
    """The core's C++ tests, those of its interface on the library of the wheel; says how many."""
    start, folder = runner(platform), _folder_with(platform, wheel)
    built = wheels.build_tests(blender, platform, list(TESTS))
    said = []
    for name, arguments in TESTS.items():
        program = name + _suffix(platform)
        shutil.copy2(built / program, folder / program)
        said.append(start.run(folder, program, *arguments))
    count = sum(int(found) for text in said for found in re.findall(r"^(\d+) tests, 0", text, re.M))
    return f"{count} tests, {TESTS['fuzz'][0]} inputs of the fuzzer"


def play(blender: tree.Blender, platform: str, wheel: Path) -> str:
    """The reference renders by the library of the wheel, once for each instruction set; says which
    those were. Raises SetupError where one has other bits.
    """
    start, folder = runner(platform), _folder_with(platform, wheel)
    program = wheels.build_player(blender, platform, folder)
    shutil.copy2(TAPE, folder)
    ran = set()
    for isa in ISAS if platform.endswith("x64") else ("",):
        wanted = {"GLINT_ISA": isa} if isa else {}
        library = wheels.PLATFORMS[platform].library
        said = start.run(folder, program, f"./{library}", TAPE.name, "pictures", **wanted)
        ran.add(said.split()[-1])
        wrong = differing(folder / "pictures")
        if wrong:
            raise tree.SetupError(
                f"{platform}, {said.split()[-1]}: other bits than here in {', '.join(wrong)}"
            )
    return ", ".join(sorted(ran))


def record(blender: tree.Blender) -> int:
    """Put the reference renders on tape with this machine's core, whose bits must be the kept ones.
    The number of scenes.
    """
    core_wheel.install(blender)
    FOLDER.mkdir(parents=True, exist_ok=True)
    script = tree.ROOT / "tests" / "engine" / "core_tape.py"
    tree.call(
        [blender.interpreter, script, TAPE, PICTURES],
        "This machine's core must draw the reference renders first (make test).",
        env={**os.environ, "BLENDER_USER_RESOURCES": str(blender.bare_resources)},
    )
    return len({scene for scene, *_ in _index()})


def _index() -> list[tuple[str, int, int]]:
    """Scene, pass and size of each picture."""
    return json.loads(PICTURES.with_suffix(".json").read_text())


def differing(pictures: Path) -> list[str]:
    """Scenes and numbers of passes in which these pictures are not this machine's."""
    here, there, index = PICTURES.read_bytes(), pictures.read_bytes(), _index()
    ends = [0]
    for _, _, size in index:
        ends.append(ends[-1] + 4 * size)
    wrong = [
        f"{scene} (pass {number})"
        for (scene, number, _), (a, b) in zip(index, pairwise(ends), strict=True)
        if here[a:b] != there[a:b]
    ]
    return wrong + (["the number of pictures"] if len(here) != len(there) else [])


def _folder_with(platform: str, wheel: Path) -> Path:
    """A folder for programs of the platform, with the library out of the wheel."""
    folder, library = FOLDER / platform, wheels.PLATFORMS[platform].library
    folder.mkdir(parents=True, exist_ok=True)
    (folder / library).write_bytes(core_wheel.library_of(wheel, library))
    return folder


def _suffix(platform: str) -> str:
    return ".exe" if platform.startswith("windows") else ""


def main() -> None:
    """Build one platform's library, look at it, and let it draw the reference renders."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    parser.add_argument("platform", choices=sorted(wheels.PLATFORMS))
    parser.add_argument("--tests", action="store_true", help="the core's own tests as well")
    options = parser.parse_args()
    blender = environment.prepare(options.bpy)
    wheels.install_tools(blender)
    try:
        runner(options.platform)
    except CannotRun as reason:
        print(f"glint: {options.platform} left out: {reason}")
        return
    wheel = wheels.build(blender, options.platform, STAGES)
    scenes = record(blender)
    with tree.step(f"drawing the reference renders with the library for {options.platform}"):
        sets = play(blender, options.platform, wheel)
    print(f"glint: {scenes} reference renders have the bits of this machine's ({sets})")
    if options.tests:
        print(f"glint: {run_tests(blender, options.platform, wheel)} passed")


if __name__ == "__main__":
    tree.main(main)
