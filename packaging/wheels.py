"""Cross-builds the core's wheels for six platforms with Zig's Clang, and packs the extension for
each.

The first time, Zig compiles its C++ library for each platform: some minutes. The wheels land in
build/wheels/<platform>, the zips in dist. Nothing is run here (`make release` does: foreign.py).
"""

from __future__ import annotations

import argparse
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import binaries
import core_wheel
import environment
import extension_zips
import tree

TOOLCHAIN = tree.CORE / "zig.cmake"
BUILDS = tree.BUILD / "zig"


@dataclass(frozen=True)
class Target:
    """zig: Zig's name. system, processor: CMake's. tag: of the wheel. library: what the wheel must
    hold.
    """

    zig: str
    system: str
    processor: str
    tag: str
    library: str


PLATFORMS = {
    "linux-x64": Target(
        "x86_64-linux-gnu.2.17", "Linux", "x86_64", "manylinux_2_17_x86_64", "libglint_core.so"
    ),
    "linux-arm64": Target(
        "aarch64-linux-gnu.2.17", "Linux", "aarch64", "manylinux_2_17_aarch64", "libglint_core.so"
    ),
    "windows-x64": Target("x86_64-windows-gnu", "Windows", "AMD64", "win_amd64", "glint_core.dll"),
    "windows-arm64": Target(
        "aarch64-windows-gnu", "Windows", "ARM64", "win_arm64", "glint_core.dll"
    ),
    "macos-x64": Target(
        "x86_64-macos.11.0", "Darwin", "x86_64", "macosx_11_0_x86_64", "libglint_core.dylib"
    ),
    "macos-arm64": Target(
        "aarch64-macos.11.0", "Darwin", "arm64", "macosx_11_0_arm64", "libglint_core.dylib"
    ),
}


def install_tools(blender: tree.Blender) -> None:
    """Zig and what reads its libraries, into the environment; only here are they needed."""
    requirements = tree.settings()["dependency-groups"]["wheels"]
    stamp = blender.venv / "glint-wheels-stamp"
    if not tree.is_current(stamp, "\n".join(requirements)):
        remedy = "The package registry must have these packages for this machine."
        environment.pip_install(blender, requirements, remedy)
        tree.write_stamp(stamp, "\n".join(requirements))


def build(blender: tree.Blender, platform: str, stages: str = "") -> Path:
    """The wheel of one platform, with these of the core's GLINT_STAGES alone where some are named.
    Raises SetupError with the end of the compiler's output, or when the wheel lacks its library.
    """
    target = PLATFORMS[platform]
    folder = core_wheel.WHEELS / platform
    shutil.rmtree(folder, ignore_errors=True)
    with tree.step(f"building the core for {platform}"):
        core_wheel.pip_wheel(
            blender,
            folder,
            variables(blender, target, stages),
            ["--config-settings", f"build-dir={BUILDS / platform}"],
        )
    [wheel] = folder.glob("*.whl")
    library = folder / target.library
    library.write_bytes(core_wheel.library_of(wheel, target.library))
    wrong = binaries.look(blender, platform, library)
    if wrong:
        raise tree.SetupError(f"the library for {platform}: {'; '.join(wrong)}")
    core_wheel.retag(blender, wheel, target.tag)
    [wheel] = folder.glob("*.whl")
    return wheel


def variables(blender: tree.Blender, target: Target, stages: str = "") -> dict[str, str]:
    """What engine/core/zig.cmake reads."""
    arguments = [f"-DCMAKE_TOOLCHAIN_FILE={TOOLCHAIN}"]
    arguments += [f"-DGLINT_STAGES={stages}"] if stages else []
    return {
        "GLINT_ZIG_PYTHON": str(blender.interpreter),
        "GLINT_ZIG_TARGET": target.zig,
        "GLINT_ZIG_SYSTEM": target.system,
        "GLINT_ZIG_PROCESSOR": target.processor,
        "CMAKE_ARGS": " ".join(arguments),
    }


def build_tests(blender: tree.Blender, platform: str, programs: list[str]) -> Path:
    """The core's C++ tests, in the folder where the wheel was built, whose objects they share; the
    folder of the programs.
    """
    target, folder = PLATFORMS[platform], BUILDS / platform
    tools = os.pathsep.join([str(blender.interpreter.parent), os.environ.get("PATH", "")])
    options = {"env": {**os.environ, **variables(blender, target), "PATH": tools}}
    settings = ["-DSKBUILD=", "-DGLINT_BUILD_TESTS=ON", "-DCMAKE_BUILD_TYPE=Release"]
    settings += ["-DCMAKE_EXE_LINKER_FLAGS=-fPIC"]  # so that Zig's libraries need not be made anew
    with tree.step(f"building the core's tests for {platform}"):
        tree.call(
            ["cmake", "-S", tree.CORE, "-B", folder, "-G", "Ninja", *settings],
            "CMake could not prepare the tests.",
            **options,
        )
        tree.call(
            ["cmake", "--build", folder, "--target", *programs],
            "The tests do not compile.",
            **options,
        )
    return folder / "tests"


def build_player(blender: tree.Blender, platform: str, folder: Path) -> str:
    """The program that plays tapes to a library of the core (engine/core/tests/player.cpp), into
    `folder`; its name there.
    """
    target, name = PLATFORMS[platform], "player"
    name += ".exe" if target.system == "Windows" else ""
    command = [blender.interpreter, "-m", "ziglang", "c++", "-target", target.zig, "-std=c++20"]
    # Zig makes its libraries anew for other options than those of the core.
    flags = ["-fno-sanitize=all", "-fPIC", "-O3", "-DNDEBUG", "-Wl,-s"]
    libraries = ["-ldl"] if target.system == "Linux" else []
    tree.call(
        [*command, *flags, "-I", tree.CORE / "include", tree.CORE / "tests" / "player.cpp"]
        + [*libraries, "-o", folder / name],
        "The player of tapes does not compile.",
    )
    return name


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    parser.add_argument("--only", nargs="*", choices=sorted(PLATFORMS), help="these platforms")
    options = parser.parse_args()
    blender = environment.prepare(options.bpy)
    install_tools(blender)
    for platform in options.only or PLATFORMS:
        wheel = build(blender, platform)
        path = extension_zips.pack_platform(blender, platform, wheel)
        print(
            f"glint: {wheel.relative_to(tree.ROOT)} and {path.relative_to(tree.ROOT)} "
            f"({path.stat().st_size / 1e6:.2f} MB)",
            flush=True,
        )


if __name__ == "__main__":
    tree.main(main)
