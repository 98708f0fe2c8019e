"""Makes the virtual environment with bpy that the make targets run in. Needs nothing but Python
3.11's standard library.

A second run finds its stamp and does nothing.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import tree

# What Debian and Ubuntu call the libraries that the bpy wheel needs from the system.
DEBIAN_PACKAGES = {
    "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libxkbcommon.so.0": "libxkbcommon0",
    "libSM.so.6": "libsm6",
    "libICE.so.6": "libice6",
    "libXext.so.6": "libxext6",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libgomp.so.1": "libgomp1",
}
# What Debian and Ubuntu call the farm that tests run; where it is missing they say so.
TEST_PACKAGES = ("munge", "slurm-client", "slurmctld", "slurmd")
CXX20_PROGRAM = (
    "#include <bit>\n#include <span>\nint main() { int a[2] = {1, 2}; return "
    "std::span(a).size() == 2 ? 0 : 1; }\n"
)


def prepare(wanted: str = "") -> tree.Blender:
    """The environment of this Blender, made when missing or out of date. Raises SetupError with the
    remedy.
    """
    blender = tree.blender(wanted)
    requirements = [f"bpy=={blender.version}", *tree.settings()["dependency-groups"]["dev"]]
    mark = "\n".join([blender.python, *requirements])
    stamp = blender.venv / "glint-stamp"
    if not tree.is_current(stamp, mark):
        check_compiler()
        _make_venv(blender)
        _install(blender, requirements)
        check_libraries(blender)
        tree.write_stamp(stamp, mark)
    return blender


def find_python(version: str) -> str:
    """Command of a Python of this minor version: this one, one on the path, or one of pyenv's."""
    for candidate in _python_candidates(version):
        if _runs(candidate, version):
            return candidate
    raise tree.SetupError(
        f"Python {version} was not found. Install it (Debian and Ubuntu: apt-get install "
        f"python{version} python{version}-venv; "
        f"elsewhere: pyenv install {version}) so that the command python{version} runs, then call "
        "make again."
    )


def _python_candidates(version: str) -> list[str]:
    candidates = [sys.executable, f"python{version}", "python3"]
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    return candidates + [
        str(path / "bin" / "python") for path in sorted(pyenv.glob(f"{version}.*"), reverse=True)
    ]


def _runs(command: str, version: str) -> bool:
    question = "import sys; print('%d.%d' % sys.version_info[:2])"
    try:
        done = subprocess.run([command, "-c", question], capture_output=True, text=True)
    except OSError:
        return False
    return done.returncode == 0 and done.stdout.strip() == version


def check_compiler() -> None:
    """Raise SetupError unless a C++20 compiler is at hand: $CXX, or the first of c++, g++,
    clang++.
    """
    remedy = (
        "Install one (Debian and Ubuntu: apt-get install g++; Fedora: dnf install gcc-c++), "
        "or name it: make CXX=clang++ …"
    )
    names = [os.environ["CXX"]] if os.environ.get("CXX") else ["c++", "g++", "clang++"]
    found = [name for name in names if shutil.which(name.split()[0])]
    if not found:
        raise tree.SetupError(
            f"There is no C++ compiler here (looked for {', '.join(names)}). {remedy}"
        )
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "probe.cpp"
        source.write_text(CXX20_PROGRAM)
        command = [*found[0].split(), "-std=c++20", str(source), "-o", str(Path(folder) / "probe")]
        tree.call(
            command,
            f"The compiler {found[0]} cannot build a C++20 program (GCC 12 or Clang 14 can). "
            f"{remedy}",
        )


def _make_venv(blender: tree.Blender) -> None:
    if _runs(str(blender.interpreter), blender.python):
        return
    python = find_python(blender.python)
    remedy = (
        "Debian and Ubuntu keep venv in a package of its own: apt-get install "
        f"python{blender.python}-venv"
    )
    with tree.step(f"making {blender.venv.name} with Python {blender.python}"):
        tree.call([python, "-m", "venv", "--clear", blender.venv], remedy)


def _install(blender: tree.Blender, requirements: list[str]) -> None:
    with tree.step(
        f"installing bpy {blender.version} and the tools of pyproject.toml (the first time "
        "downloads about 500 MB)"
    ):
        remedy = (
            f"The package registry must have bpy {blender.version} for {platform.system()} "
            f"{platform.machine()}."
        )
        pip_install(blender, requirements, remedy)


def pip_install(blender: tree.Blender, words: Sequence[str | Path], remedy: str) -> None:
    """Install packages, or files with options, into the environment."""
    command = [blender.interpreter, "-m", "pip", "install", "--quiet"]
    tree.call([*command, "--disable-pip-version-check", *words], remedy)


def check_libraries(blender: tree.Blender) -> None:
    """Raise SetupError when the system lacks a shared library that bpy is linked to (Linux)."""
    if sys.platform != "linux":
        return
    listing = tree.call(["ldd", blender.bpy / "__init__.so"], "ldd comes with the C library.")
    missing = sorted(set(re.findall(r"^\s*(\S+) => not found", listing, re.MULTILINE)))
    if missing:
        raise tree.SetupError(missing_libraries_message(missing))


def missing_libraries_message(missing: list[str]) -> str:
    """What to do about shared libraries that were not found."""
    packages = " ".join(DEBIAN_PACKAGES[name] for name in missing if name in DEBIAN_PACKAGES)
    others = [name for name in missing if name not in DEBIAN_PACKAGES]
    text = f"bpy needs shared libraries that this system lacks: {', '.join(missing)}."
    if packages:
        text += f" Debian and Ubuntu: apt-get install --no-install-recommends {packages}"
    if others:
        text += f" Find the packages that hold {', '.join(others)}."
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--bpy", default="", help='"4.2.x", "4.5.x", "5.0.x", "5.2.x", or an exact version'
    )
    parser.add_argument(
        "--list-debian-packages",
        action="store_true",
        help="print what bpy and the tests need from the system, and stop",
    )
    options = parser.parse_args()
    if options.list_debian_packages:
        print(" ".join([*DEBIAN_PACKAGES.values(), *TEST_PACKAGES]))
        return
    blender = prepare(options.bpy)
    print(f"glint: {blender.venv.name} is ready: bpy {blender.version}, Python {blender.python}")


if __name__ == "__main__":
    tree.main(main)
