"""Cross-builds the core's wheels for six platforms with Zig's Clang, and packs the extension for
each.

The first time, Zig compiles its C++ library for each platform: some minutes. The wheels land in
build/wheels/<platform>, the zips in dist. Nothing is run for the foreign platforms here, but --test
has `qemu-aarch64` run the C++ tests of linux-arm64 (Debian: apt-get install qemu-user).
"""

from __future__ import annotations

import argparse
import os
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import core_wheel
import environment
import extension_zips
import glibc
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


_GLIBC = (2, 17)
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


def install_zig(blender: tree.Blender) -> None:
    """Zig, into the environment; only here is it needed."""
    requirements = tree.settings()["dependency-groups"]["wheels"]
    stamp = blender.venv / "glint-wheels-stamp"
    if not tree.is_current(stamp, "\n".join(requirements)):
        command = [
            blender.interpreter,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            *requirements,
        ]
        tree.call(command, "The package registry must have these packages for this machine.")
        tree.write_stamp(stamp, "\n".join(requirements))


def build(blender: tree.Blender, platform: str) -> Path:
    """The wheel of one platform. Raises SetupError with the end of the compiler's output, or when
    the wheel lacks its library.
    """
    target = PLATFORMS[platform]
    folder = core_wheel.WHEELS / platform
    shutil.rmtree(folder, ignore_errors=True)
    with tree.step(f"building the core for {platform}"):
        core_wheel.pip_wheel(
            blender,
            folder,
            variables(blender, target),
            ["--config-settings", f"build-dir={BUILDS / platform}"],
        )
    [wheel] = folder.glob("*.whl")
    library = core_wheel.library_of(wheel, target.library)
    if target.system == "Linux" and glibc.needed(library) > _GLIBC:
        raise tree.SetupError(
            f"{wheel.name} needs the GNU C library {glibc.needed(library)}, its name promises "
            f"{_GLIBC}."
        )
    core_wheel.retag(blender, wheel, target.tag)
    [wheel] = folder.glob("*.whl")
    return wheel


def variables(blender: tree.Blender, target: Target) -> dict[str, str]:
    """What engine/core/zig.cmake reads."""
    return {
        "GLINT_ZIG_PYTHON": str(blender.interpreter),
        "GLINT_ZIG_TARGET": target.zig,
        "GLINT_ZIG_SYSTEM": target.system,
        "GLINT_ZIG_PROCESSOR": target.processor,
        "CMAKE_ARGS": f"-DCMAKE_TOOLCHAIN_FILE={TOOLCHAIN}",
    }


def run_tests_emulated(blender: tree.Blender, platform: str = "linux-arm64") -> str:
    """Build the core's C++ tests for a foreign Linux and run them; returns their output. Needs
    qemu-user.
    """
    target = PLATFORMS[platform]
    # linked statically: no foreign libraries
    target = replace(target, zig=f"{target.processor}-linux-musl")
    emulator = shutil.which(f"qemu-{target.processor}")
    if not emulator:
        raise tree.SetupError(
            f"qemu-{target.processor} was not found (Debian and Ubuntu: apt-get install qemu-user)."
        )
    folder = BUILDS / f"{platform}-tests"
    tools = os.pathsep.join([str(blender.interpreter.parent), os.environ.get("PATH", "")])
    options = {"env": {**os.environ, **variables(blender, target), "PATH": tools}}
    settings = [
        "-DCMAKE_BUILD_TYPE=Release",
        "-DGLINT_BUILD_TESTS=ON",
        f"-DCMAKE_TOOLCHAIN_FILE={TOOLCHAIN}",
    ]
    tree.call(
        ["cmake", "-S", tree.CORE, "-B", folder, "-G", "Ninja", *settings],
        "CMake could not prepare the tests.",
        **options,
    )
    tree.call(
        ["cmake", "--build", folder, "--target", "accel_tests"],
        "The tests do not compile.",
        **options,
    )
    return tree.call(
        [emulator, folder / "tests" / "accel_tests"], "The kernel's tests fail on this platform."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    parser.add_argument("--only", nargs="*", choices=sorted(PLATFORMS), help="these platforms")
    parser.add_argument(
        "--test",
        action="store_true",
        help="run the kernel's tests for linux-arm64 under emulation instead",
    )
    options = parser.parse_args()
    blender = environment.prepare(options.bpy)
    install_zig(blender)
    if options.test:
        print(run_tests_emulated(blender))
        return
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
