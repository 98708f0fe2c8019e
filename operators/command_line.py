"""`blender --command glint info`: what this installation can do."""

from __future__ import annotations

import argparse
import sys
import tomllib
from pathlib import Path

import bpy

from .. import engine

_commands: list = []


def information() -> list[tuple[str, str]]:
    """(what, value) pairs about the installation."""
    manifest = tomllib.loads((Path(__file__).parent.parent / "blender_manifest.toml").read_text(encoding="utf-8"))
    return [
        ("version", manifest["version"]),
        ("edition", "full" if manifest.get("wheels") else "pure Python"),
        ("blender", bpy.app.version_string),
        ("tracers", " ".join(engine.available_backends())),
        ("core", engine.native_error() or "ready"),
    ]


def run(arguments: list[str]) -> int:
    """The command's body; returns the exit code."""
    parser = argparse.ArgumentParser(prog="blender --command glint", description="Glint from the command line")
    parser.add_argument("action", choices=["info"], help="info: version, edition and the tracers that can run here")
    parser.parse_args(arguments)
    for name, value in information():
        sys.stdout.write(f"{name:10}{value}\n")
    return 0


def register() -> None:
    _commands.append(bpy.utils.register_cli_command("glint", run))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
