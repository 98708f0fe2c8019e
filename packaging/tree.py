"""What every packaging script shares: where things are, what pyproject.toml says, and how a failure
is told.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
DIST = ROOT / "dist"
CORE = ROOT / "engine" / "core"

_BUILT = {".pyc", ".so", ".o"}


class SetupError(Exception):
    """Something that the person at the keyboard can put right; the message says how."""


@dataclass(frozen=True)
class Blender:
    """An embedded Blender. version: of the bpy wheel. python: "3.11". venv: its virtual
    environment.
    """

    version: str
    python: str
    venv: Path

    @property
    def interpreter(self) -> Path:
        return self.venv / "bin" / "python"

    @property
    def resources(self) -> Path:
        """Folder that stands for the user's Blender settings, so that the real ones are never
        touched.
        """
        return BUILD / f"blender-{self.version}"

    @property
    def bare_resources(self) -> Path:
        """Blender's user folder for tests and tools, which run the tree itself: no extension, and
        so no other core, is there.
        """
        return BUILD / f"bare-{self.version}"

    @property
    def bpy(self) -> Path:
        return self.venv / "lib" / f"python{self.python}" / "site-packages" / "bpy"


def bytecode_variables() -> dict[str, str]:
    """For a Python that runs the tree: it is compiled once, and its folders stay clean."""
    return {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(BUILD / "bytecode")}


def settings() -> dict:
    """pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text())


def manifest() -> dict:
    """blender_manifest.toml."""
    return tomllib.loads((ROOT / "blender_manifest.toml").read_text())


def source_date() -> int:
    """Seconds since 1970 that stand for the time of building, so that the same sources give the
    same bits: $SOURCE_DATE_EPOCH, else 1980, where the time of zips begins.
    """
    return int(os.environ.get("SOURCE_DATE_EPOCH", "315532800"))


def blender(wanted: str = "") -> Blender:
    """The Blender that BPY= names: "" for the default, "4.2" or "4.2.x" for the pinned one of a
    series, "4.2.23" for exactly that.
    """
    table = settings()["tool"]["glint"]
    wanted = wanted or table["default"]
    series = ".".join(wanted.split(".")[:2])
    if series not in table["bpy"]:
        raise SetupError(
            f"BPY={wanted} is not supported. Choose one of: "
            f"{', '.join(f'{name}.x' for name in table['bpy'])}."
        )
    pinned = table["bpy"][series]
    version = pinned["version"] if wanted in (series, f"{series}.x") else wanted
    default = table["bpy"][table["default"]]["version"]
    venv = ROOT / (".venv" if version == default else f".venv-{version}")
    return Blender(version, pinned["python"], venv)


def fingerprint(paths: Iterable[Path], extra: str = "") -> str:
    """Hash of the files (folders are walked; build products are left out) and of `extra`."""
    digest = hashlib.sha256(extra.encode())
    for path in sorted(file for top in paths for file in _files(top)):
        digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _files(top: Path) -> Iterator[Path]:
    if top.is_file():
        yield top
        return
    for path in top.rglob("*"):
        if path.is_file() and path.suffix not in _BUILT and "__pycache__" not in path.parts:
            yield path


def is_current(stamp: Path, mark: str) -> bool:
    """Whether the step that wrote `stamp` was done for exactly this `mark`."""
    return stamp.is_file() and stamp.read_text() == mark


def write_stamp(stamp: Path, mark: str) -> None:
    stamp.parent.mkdir(parents=True, exist_ok=True)
    stamp.write_text(mark)


@contextlib.contextmanager
def step(text: str) -> Iterator[None]:
    """Say what is being done and how long it took."""
    print(f"glint: {text} …", flush=True)
    start = time.perf_counter()
    yield
    print(f"glint: … done in {time.perf_counter() - start:.1f} s", flush=True)


def call(command: list, remedy: str, **options) -> str:
    """Run a command quietly; when it fails, raise SetupError with the end of its output and the
    remedy.
    """
    done = subprocess.run(
        [str(part) for part in command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **options,
    )
    if done.returncode != 0:
        tail = "\n".join(done.stdout.splitlines()[-40:])
        raise SetupError(
            f"{tail}\n\n{Path(str(command[0])).name} failed with exit code {done.returncode}. "
            f"{remedy}"
        )
    return done.stdout


def main(body: Callable[[], int | None]) -> None:
    """Run a script's body; a SetupError becomes its message and exit code 1, Ctrl-C one line and
    exit code 130, as in a shell.
    """
    try:
        sys.exit(body() or 0)
    except SetupError as failure:
        print(f"glint: {failure}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("glint: interrupted", file=sys.stderr)
        sys.exit(130)
