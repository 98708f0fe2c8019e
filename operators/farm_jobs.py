"""Jobs for render farms: descriptions of which worker draws what, that programs of others run."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import bpy

from .farm import frame_numbers
from .tiles import Grid


def job_template(
    blend: Path,
    text: str,
    chunk: int,
    folder: Path,
    place: Path,
    grid: Grid | None = None,
    scripts: bool = False,
) -> dict[str, Any]:
    """The template of Open Job Description that draws these frames into a folder, several at a
    time, and then looks at all of them. place: of the template; only paths below its folder can be
    defaults there. grid: of tiles that are drawn apart and then merged. scripts: whether
    all commands run the file's scripts and drivers.
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
    trusted = ["--scripts"] if scripts else []
    if grid:
        tile = {"name": "Tile", "type": "INT", "range": f"1-{grid.count}"}
        given = ["--tiles", str(grid), *trusted]
        steps = [
            _step("Tiles", _glint("frames", some, *given, "--tile", each), [chunks, tile]),
            _step("Frames", _glint("merge", some, *given), [chunks], after="Tiles"),
        ]
    else:
        steps = [_step("Frames", _glint("frames", some, *trusted), [chunks])]
    check = _glint("frames", "{{Param.Frames}}", "--check", *trusted)
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": f"{_printable(blend.stem)[:40]}, {len(numbers)} frames{tiles}",
        "parameterDefinitions": [
            _path("Scene", "FILE", "IN", blend, place),
            _path("Out", "DIRECTORY", "OUT", folder, place),
            {"name": "Frames", "type": "STRING", "default": text},
            {"name": "FramesPerTask", "type": "INT", "default": chunk, "minValue": 1},
            {"name": "Blender", "type": "STRING", "default": bpy.app.binary_path or "blender"},
        ],
        "steps": [*steps, _step("Check", check, after="Frames")],
    }


def _printable(name: str) -> str:
    """A file's name where control characters and bytes that are no text are refused."""
    return "".join(letter if letter.isprintable() else "_" for letter in name)


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


def slurm_script(
    blend: Path,
    text: str,
    chunk: int,
    folder: Path,
    grid: Grid | None = None,
    scripts: bool = False,
) -> str:
    """A Slurm array script that draws these frames, several at a time, for `sbatch`; started as a
    program it hands itself to `sbatch` for each stage, with its own arguments as options, and looks
    at all frames at the end. Raises ValueError for more tasks than Slurm takes.
    """
    numbers = frame_numbers(text)
    chunks = [numbers[first : first + chunk] for first in range(0, len(numbers), chunk)]
    tasks = len(chunks) * (grid.count if grid else 1)
    if tasks > _SLURM_TASKS:
        raise ValueError(
            f"{tasks} tasks are more than the {_SLURM_TASKS} that Slurm takes in an array: give "
            "each more frames (--per-task)"
        )
    return _SLURM.format(
        name=re.sub(r"[^\w.-]", "_", f"glint-{blend.stem[:40]}", flags=re.ASCII),
        last=tasks - 1,
        blender=shlex.quote(bpy.app.binary_path or "blender"),
        scene=shlex.quote(str(blend.resolve())),
        out=shlex.quote(str(folder.resolve())),
        frames=shlex.quote(text.replace(" ", "")),
        chunks=" ".join(_as_range(some) for some in chunks),
        grid=grid or "",
        tiles=grid.count if grid else 1,
        trusted=" --scripts" if scripts else "",
    )


_SLURM_TASKS = 1000
"""Array indices lie below MaxArraySize, which is 1001 where nobody has set it."""
_SLURM = """\
#!/bin/bash
# Frames for Glint. `bash THIS_FILE [options of sbatch]` draws them, merges tiles, and checks all at
# the end; `sbatch THIS_FILE` draws alone. Frames that are there as the scene gives them are kept.
#SBATCH --job-name={name}
#SBATCH --array=0-{last}
#SBATCH --requeue
#SBATCH --open-mode=append
set -u
blender="${{BLENDER:-}}"
[ -n "$blender" ] || blender={blender}
scene={scene}
out={out}
frames={frames}
chunks=({chunks})
grid={grid}
tiles={tiles}

if [ -z "${{SLURM_ARRAY_TASK_ID:-}}" ]; then
  last=$((${{#chunks[@]}} - 1))
  job=$(sbatch --parsable "$@" --export=ALL,GLINT_STAGE=draw "$0") || exit
  if [ -n "$grid" ]; then
    job=$(sbatch --parsable "$@" --export=ALL,GLINT_STAGE=merge --array="0-$last" \\
      --dependency="afterany:${{job%%;*}}" "$0") || exit
  fi
  exec sbatch --parsable "$@" --export=ALL,GLINT_STAGE=check --array=0 \\
    --dependency="afterany:${{job%%;*}}" "$0"
fi

task=$SLURM_ARRAY_TASK_ID
case ${{GLINT_STAGE:-draw}} in
  draw)
    words=(frames "$scene" "${{chunks[task / tiles]}}")
    [ -z "$grid" ] || words+=(--tiles "$grid" --tile $((task % tiles + 1)))
    ;;
  merge) words=(merge "$scene" "${{chunks[task]}}" --tiles "$grid") ;;
  check) words=(frames "$scene" "$frames" --check) ;;
esac
words+=(--out "$out"{trusted} --threads "${{SLURM_CPUS_ON_NODE:-0}}")
"$blender" -b --command glint "${{words[@]}}"
code=$?
# 128 and the number of the signal that ended Blender, but for Ctrl-C
if [ $code -gt 128 ] && [ $code -ne 130 ] && [ "${{SLURM_RESTART_COUNT:-0}}" -lt 3 ]; then
  echo "glint: the worker was killed (exit code $code); its task goes back into the queue"
  scontrol requeue "$SLURM_JOB_ID"
fi
exit $code
"""


def _as_range(numbers: list[int]) -> str:
    """[1, 2, 3, 7] → "1-3,7"."""
    parts: list[list[int]] = []
    for number in numbers:
        if parts and number == parts[-1][-1] + 1:
            parts[-1][1:] = [number]
        else:
            parts.append([number])
    return ",".join("-".join(map(str, part)) for part in parts)


def flamenco_job_type(
    text: str, chunk: int, folder: Path, grid: Grid | None = None, scripts: bool = False
) -> str:
    """A job compiler script of Flamenco, whose settings begin as these."""
    given = {
        "frames": _as_range(frame_numbers(text)),
        "chunk_size": chunk,
        "columns": grid.columns if grid else 1,
        "rows": grid.rows if grid else 1,
        "out": str(folder.resolve()),
        "scripts": scripts,
    }
    script = Path(__file__).with_name("flamenco_job_type.js").read_text(encoding="utf-8")
    return f"const GIVEN = {json.dumps(given)};\n\n{script}"
