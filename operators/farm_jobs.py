"""Jobs for render farms: descriptions of which worker draws what, that programs of others run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from .farm import frame_numbers
from .tiles import Grid


def job_template(
    blend: Path, text: str, chunk: int, folder: Path, place: Path, grid: Grid | None = None
) -> dict[str, Any]:
    """The template of Open Job Description that draws these frames into a folder, several at a
    time, and then looks at all of them. place: of the template; only paths below its folder can be
    defaults there. grid: of tiles that are drawn apart and then merged.
    """
    numbers = frame_numbers(text)
    tiles = f" in {grid} tiles" if grid else ""
    chunks = {
        "name": "Frames",
        "type": "CHUNK[INT]",
        "range": "{{Param.Frames}}",
        "chunks": {
            "defaultTaskCount": "{{Param.FramesPerTask}}",
            "rangeConstraint": "NONCONTIGUOUS",
        },
    }
    some, each = "{{Task.Param.Frames}}", "{{Task.Param.Tile}}"
    if grid:
        tile = {"name": "Tile", "type": "INT", "range": f"1-{grid.count}"}
        given = ["--tiles", str(grid)]
        steps = [
            _step("Tiles", _glint("frames", some, *given, "--tile", each), [chunks, tile]),
            _step("Frames", _glint("merge", some, *given), [chunks], after="Tiles"),
        ]
    else:
        steps = [_step("Frames", _glint("frames", some), [chunks])]
    check = _glint("frames", "{{Param.Frames}}", "--check")
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": f"{blend.stem[:40]}, {len(numbers)} frames{tiles}",
        "parameterDefinitions": [
            _path("Scene", "FILE", "IN", blend, place),
            _path("Out", "DIRECTORY", "OUT", folder, place),
            {"name": "Frames", "type": "STRING", "default": text},
            {"name": "FramesPerTask", "type": "INT", "default": chunk, "minValue": 1},
            {"name": "Blender", "type": "STRING", "default": bpy.app.binary_path or "blender"},
        ],
        "steps": [*steps, _step("Check", check, after="Frames")],
    }


def _glint(action: str, *words: str) -> list[str]:
    where = ["--out", "{{Param.Out}}"]
    return ["-b", "--command", "glint", action, "{{Param.Scene}}", *words, *where]


def _step(
    name: str, arguments: list[str], space: list[dict[str, Any]] | None = None, after: str = ""
) -> dict[str, Any]:
    run = {"command": "{{Param.Blender}}", "args": arguments}
    return {
        "name": name,
        **({"dependencies": [{"dependsOn": after}]} if after else {}),
        **({"parameterSpace": {"taskParameterDefinitions": space}} if space else {}),
        "script": {"actions": {"onRun": run}},
    }


def _path(name: str, kind: str, flow: str, path: Path, place: Path) -> dict[str, str]:
    told = {"name": name, "type": "PATH", "objectType": kind, "dataFlow": flow}
    top = place.resolve().parent
    if path.resolve().is_relative_to(top):
        told["default"] = path.resolve().relative_to(top).as_posix()
    return told


def without_default(template: dict[str, Any], values: dict[str, Path]) -> list[str]:
    """What has to be given on the command line of `openjd run`."""
    given = [told["name"] for told in template["parameterDefinitions"] if "default" not in told]
    return [word for name in given for word in ("-p", f"{name}={values[name].resolve()}")]
