"""Packs the extension: the full edition with the core's wheel, and the pure-Python one; both
checked by Blender's own validator.
"""

from __future__ import annotations

import argparse
import json
import platform
import shutil
import sys
import time
import zipfile
from pathlib import Path

import core_wheel
import environment
import tree

# What goes into a zip at all; blender_manifest.toml's exclude patterns then apply to it.
# The documents are all there, as README links to them and they link to each other.
PACKED = (
    "__init__.py",
    "LICENSE",
    "README.md",
    "CHANGELOG.md",
    "ARCHITECTURE.md",
    "demo.png",
    "docs",
    "addon",
    "engine",
    "operators",
)
LEFT_OUT = ("__pycache__", "*.pyc", "core")

_MACHINES = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64", "arm64": "arm64"}
_SYSTEMS = {"linux": "linux", "darwin": "macos", "win32": "windows"}


def blender_platform() -> str:
    """This machine as Blender's manifests name it: "linux-x64", "macos-arm64", …"""
    return f"{_SYSTEMS[sys.platform]}-{_MACHINES[platform.machine().lower()]}"


def full_zip(blender: tree.Blender) -> Path:
    """dist/glint-<version>-<platform>.zip, with the core's wheel."""
    return pack_platform(blender, blender_platform(), core_wheel.build(blender))


def pack_platform(blender: tree.Blender, platform: str, wheel: Path) -> Path:
    """dist/glint-<version>-<platform>.zip with a wheel that was built for it; platform:
    "linux-x64", "macos-arm64", …
    """
    return _pack(blender, platform, wheel)


def python_zip(blender: tree.Blender) -> Path:
    """dist/glint-<version>-python.zip, in which the NumPy tracer renders."""
    return _pack(blender, "python", None)


def split_zips(blender: tree.Blender, wheels: dict[str, Path], folder: Path) -> list[Path]:
    """A zip for each platform with its wheel, which Blender's builder makes out of one folder with
    all of them; into `folder`.
    """
    stage = _stage("all", wheels)
    folder.mkdir(parents=True, exist_ok=True)
    options = ("--source-dir", stage, "--output-dir", folder, "--split-platforms")
    blender_extension(blender, "build", *options)
    version = tree.manifest()["version"]
    zips = [folder / f"glint-{version}-{name.replace('-', '_')}.zip" for name in wheels]
    for path in zips:
        same_bits(path)
        blender_extension(blender, "validate", path)
    return zips


def _pack(blender: tree.Blender, edition: str, wheel: Path | None) -> Path:
    target = tree.DIST / f"glint-{tree.manifest()['version']}-{edition.replace('-', '_')}.zip"
    stamp = tree.BUILD / "stage" / f"{edition}-stamp"
    mark = _mark(wheel)
    if not (target.is_file() and tree.is_current(stamp, mark)):
        stage = _stage(edition, {edition: wheel} if wheel else {})
        target.parent.mkdir(exist_ok=True)
        blender_extension(blender, "build", "--source-dir", stage, "--output-filepath", target)
        same_bits(target)
        blender_extension(blender, "validate", target)
        tree.write_stamp(stamp, mark)
    return target


def _mark(wheel: Path | None) -> str:
    sources = [
        tree.ROOT / name
        for name in (*PACKED, "blender_manifest.toml")
        if (tree.ROOT / name).exists()
    ]
    return tree.fingerprint([*sources, Path(__file__), *([wheel] if wheel else [])])


def _stage(edition: str, wheels: dict[str, Path]) -> Path:
    """A folder with what the zip will hold. wheels: of each platform; none: the pure-Python
    edition.
    """
    stage = tree.BUILD / "stage" / edition
    shutil.rmtree(stage, ignore_errors=True)
    stage.mkdir(parents=True)
    for name in PACKED:
        source = tree.ROOT / name
        if source.is_dir():
            shutil.copytree(source, stage / name, ignore=shutil.ignore_patterns(*LEFT_OUT))
        else:
            shutil.copy2(source, stage / name)
    (stage / "blender_manifest.toml").write_text(_manifest_text(wheels))
    for wheel in wheels.values():
        (stage / "wheels").mkdir(exist_ok=True)
        shutil.copy2(wheel, stage / "wheels")
    return stage


def _manifest_text(wheels: dict[str, Path]) -> str:
    """The manifest; a full edition's names its platforms and its wheels (top-level keys, so before
    the first table).
    """
    text = (tree.ROOT / "blender_manifest.toml").read_text()
    if not wheels:
        return text
    head, tables = text.split("\n[", 1)
    files = [f"./wheels/{wheel.name}" for wheel in wheels.values()]
    lists = f"platforms = {json.dumps(list(wheels))}\nwheels = {json.dumps(files)}"
    return f"{head}\n{lists}\n\n[{tables}"


def same_bits(path: Path) -> None:
    """Write a zip again so that the same contents give the same bits: in the order of the names,
    with one time, without whose the files are.
    """
    with zipfile.ZipFile(path) as packed:
        entries = [(info, packed.read(info)) for info in packed.infolist() if not info.is_dir()]
    when = time.gmtime(tree.source_date())[:6]
    again = path.with_name(f".{path.name}")
    with zipfile.ZipFile(again, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        for old, content in sorted(entries, key=lambda entry: entry[0].filename):
            info = zipfile.ZipInfo(old.filename, when)
            info.compress_type, info.external_attr = old.compress_type, 0o644 << 16
            packed.writestr(info, content)
    again.replace(path)


def blender_extension(blender: tree.Blender, *arguments: object) -> None:
    """Blender's own extension tool; it runs in plain Python."""
    tools = sorted(blender.bpy.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    tree.call(
        [blender.interpreter, tools[0], *arguments], "Blender's extension tool rejects the package."
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    blender = environment.prepare(parser.parse_args().bpy)
    for path in (full_zip(blender), python_zip(blender)):
        print(f"glint: {path.relative_to(tree.ROOT)} ({path.stat().st_size / 1e6:.2f} MB)")


if __name__ == "__main__":
    tree.main(main)
