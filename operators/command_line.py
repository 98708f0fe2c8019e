"""`blender --command glint …`: what this installation can do, and a scene measured, compared with
Cycles, or verified without windows.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import bpy

from .. import engine
from ..addon.render.stamp import manifest
from ..engine.analysis.trade import SIDE, SQUARES
from ..engine.analysis.trade_tunables import TUNABLES
from . import compare_cycles, farm, farm_jobs, measure_scene
from .opened import open_blend, unrun
from .pictures import write_whole
from .scene_copy import rendered_for
from .tiles import Grid
from .verify import verify, verify_all

_INTERRUPTED = 130
"""Exit code after Ctrl-C, as in a shell."""
_commands: list = []


def information() -> list[tuple[str, str]]:
    """(what, value) pairs about the installation."""
    return [
        ("version", manifest()["version"]),
        ("edition", "full" if manifest().get("wheels") else "pure Python"),
        ("blender", bpy.app.version_string),
        ("tracers", " ".join(engine.available_backends())),
        ("core", engine.native_error() or "ready"),
    ]


def run(arguments: list[str]) -> int:
    """The command's body; returns the exit code: 0 for success, 1 for a difference or a failure, 2
    for what cannot be answered, 130 after Ctrl-C.
    """
    # argparse takes -2-0 for an option, but nothing that begins with a space
    options = _parser().parse_args([re.sub(r"^(?=-\d+[-,:])", " ", word) for word in arguments])
    try:
        return options.act(options)
    except (RuntimeError, ValueError, OSError, MemoryError) as error:
        sys.stderr.write(f"glint {options.action}: {' '.join(str(error).split())}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write(f"glint {options.action}: interrupted\n")
        return _INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="blender --command glint", description="Glint from the command line"
    )
    actions = parser.add_subparsers(dest="action", required=True)
    info = actions.add_parser("info", help="version, edition and the tracers that can run here")
    info.set_defaults(act=_info)
    _add_measure(actions.add_parser("measure", help="what each setting costs and loses on a scene"))
    _add_compare(
        actions.add_parser("compare", help="a scene in Glint and in Cycles with matched settings")
    )
    _add_target(
        actions.add_parser(
            "target",
            help="render a scene for a target error, and tell what was predicted and reached",
        )
    )
    _add_frames(
        actions.add_parser(
            "frames",
            help="draw frames that are not there yet, each whole or not at all; exit code 1 where "
            "--check finds one that is not the scene's",
        )
    )
    _add_merge(actions.add_parser("merge", help="make frames of tiles that were drawn apart"))
    _add_job(actions.add_parser("job", help="write a job for a render farm"))
    verify = actions.add_parser(
        "verify",
        help="render a stamped picture again; exit code 0 if it is the same, 1 if not, 2 if it has "
        "no stamp",
    )
    verify.add_argument(
        "picture",
        type=Path,
        help="EXR or PNG file that a render wrote, or a folder of them: prints a table",
    )
    verify.add_argument(
        "file", type=Path, nargs="?", help=".blend file; the one that the picture names if left out"
    )
    _add_scripts(verify)
    verify.set_defaults(act=_verify)
    return parser


def _count(text: str) -> int:
    """A whole number of things that there must be at least one of."""
    if not (text.isdecimal() and int(text) >= 1):
        raise argparse.ArgumentTypeError(f"{text}: use a whole number, 1 or more")
    return int(text)


def _error(text: str) -> float:
    """How wrong a picture may be."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{text}: use a number above 0")
    return value


def _add_scripts(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scripts",
        action="store_true",
        help="run scripts and drivers of the .blend file, which you trust",
    )


def _add_measure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, help=".blend file")
    parser.add_argument("--json", type=Path, help="file for the whole table")
    parser.add_argument("--plot", type=Path, help="PNG file for time against error")
    for tunable in TUNABLES:
        option = f"--{tunable.name.replace('_', '-')}"
        parser.add_argument(
            option,
            type=tunable.kind,
            nargs="+",
            metavar=None if tunable.kind is str else "N",
            choices=tunable.values if tunable.kind is str else None,
            help=f"values of {tunable.name} to try",
        )
    parser.add_argument("--reference-samples", type=_count, default=1024, metavar="N")
    parser.add_argument(
        "--reference-seconds",
        type=float,
        default=60.0,
        metavar="S",
        help="longest time for a float64 reference",
    )
    parser.add_argument(
        "--repeats",
        type=_count,
        default=5,
        metavar="N",
        help="renders per setting, of which the fastest counts",
    )
    parser.add_argument(
        "--squares",
        type=_count,
        default=SQUARES,
        metavar="N",
        help="parts of the frame to render; more are more certain",
    )
    parser.add_argument(
        "--side", type=_count, default=SIDE, metavar="PIXELS", help="across each square"
    )
    _add_scripts(parser)
    parser.set_defaults(act=_measure)


def _add_compare(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, help=".blend file")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help="folder for compare.png, compare.json and the EXR pictures",
    )
    parser.add_argument("--samples", type=_count, default=64, help="of Cycles")
    parser.add_argument(
        "--bounces", type=int, help="of mirrors and glass, in both; those of the scene if left out"
    )
    parser.add_argument(
        "--side", type=_count, default=512, help="pixels of the longer side at most"
    )
    parser.add_argument(
        "--direct-only", action="store_true", help="do not render Cycles with all light as well"
    )
    _add_scripts(parser)
    parser.set_defaults(act=_compare)


def _add_target(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, help=".blend file")
    asked = parser.add_mutually_exclusive_group(required=True)
    asked.add_argument(
        "--levels", type=_error, metavar="N", help="largest error on the display, in 8-bit levels"
    )
    asked.add_argument(
        "--rmse", type=_error, metavar="PERCENT", help="root mean square error of linear colour"
    )
    parser.add_argument("--out", type=Path, required=True, help="EXR file for the picture")
    parser.set_defaults(act=_target)


def _grid(text: str) -> Grid:
    """Tiles of a frame."""
    try:
        return Grid.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _add_which_frames(parser: argparse.ArgumentParser, tiles: str, *, required: bool) -> None:
    parser.add_argument("file", type=Path, help=".blend file")
    parser.add_argument("frames", help="such as 1-240, 1-240:2 or 1,5,9")
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--tiles", type=_grid, metavar="CxR", required=required, help=tiles)
    parser.add_argument(
        "--threads", type=int, default=0, metavar="N", help="to draw with; the file's if left out"
    )
    _add_scripts(parser)


def _add_frames(parser: argparse.ArgumentParser) -> None:
    _add_which_frames(parser, "columns and rows that a frame is cut into", required=False)
    parser.add_argument(
        "--tile", type=_count, metavar="K", help="the one to draw, from 1 at the bottom left"
    )
    parser.add_argument(
        "--check",
        action="store_true",
        help="draw nothing, say what is there; no script of the file runs but with --scripts",
    )
    parser.set_defaults(act=_frames)


def _add_merge(parser: argparse.ArgumentParser) -> None:
    _add_which_frames(parser, "columns and rows that the frames were cut into", required=True)
    parser.set_defaults(act=_merge)


def _add_job(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", type=Path, help=".blend file")
    parser.add_argument(
        "--engine", choices=["openjd", "slurm", "flamenco"], required=True, help="of the farm"
    )
    parser.add_argument("--frames", required=True, help="such as 1-240, 1-240:2 or 1,5,9")
    parser.add_argument("--per-task", type=_count, default=10, metavar="N", help="frames of a task")
    parser.add_argument(
        "--tiles", type=_grid, metavar="CxR", help="columns and rows to cut each frame into"
    )
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")
    parser.add_argument(
        "--template", type=Path, help="file to write; beside the .blend file if left out"
    )
    _add_scripts(parser)
    parser.set_defaults(act=_job)


def _info(options: argparse.Namespace) -> int:
    for name, value in information():
        sys.stdout.write(f"{name:10}{value}\n")
    return 0


def _measure(options: argparse.Namespace) -> int:
    scene, view_layer = _open(options.file, scripts=options.scripts)
    values = {
        tunable.name: getattr(options, tunable.name)
        for tunable in TUNABLES
        if getattr(options, tunable.name)
    }
    settings = measure_scene.Options(
        values,
        options.reference_samples,
        options.reference_seconds,
        options.repeats,
        options.squares,
        options.side,
    )
    trade = measure_scene.measure_scene(scene, view_layer, settings, on_progress=_progress())
    sys.stderr.write("\n")
    measure_scene.write(trade, options.file.stem, options.json, options.plot)
    _tell(measure_scene.table(trade))
    return 0


def _compare(options: argparse.Namespace) -> int:
    scene, view_layer = _open(options.file, scripts=options.scripts)
    settings = compare_cycles.Options(
        options.samples, options.bounces, options.side, not options.direct_only
    )
    _tell(
        compare_cycles.report_lines(
            compare_cycles.compare_with_cycles(scene, view_layer, options.out, settings)
        )
    )
    return 0


def _target(options: argparse.Namespace) -> int:
    scene, view_layer = _open(options.file)
    target = ("LEVELS", options.levels) if options.levels is not None else ("RMSE", options.rmse)
    _tell([rendered_for(scene, view_layer, options.out, *target)])
    return 0


def _frames(options: argparse.Namespace) -> int:
    numbers = farm.frame_numbers(options.frames)
    if options.check:
        if options.tiles or options.tile:
            raise ValueError("--check looks at whole frames: leave out --tiles and --tile")
        scene, _ = _open(options.file, scripts=options.scripts)
        verdicts = []
        for is_good, line in farm.check_frames(scene, numbers, options.out):
            verdicts.append(is_good)
            _tell([line])
        _tell([f"{sum(verdicts)} of {len(verdicts)} frames verified"])
        return 0 if all(verdicts) else 1
    if (options.tiles is None) != (options.tile is None):
        raise ValueError("--tiles says how a frame is cut and --tile which part to draw: give both")
    scene = _open_for_frames(options)
    if options.tile is None:
        lines = farm.draw_frames(scene, numbers, options.out)
    else:
        lines = farm.draw_tiles(scene, numbers, options.out, options.tiles, options.tile)
    for line in lines:
        _tell([line])
    return 0


def _merge(options: argparse.Namespace) -> int:
    numbers = farm.frame_numbers(options.frames)
    scene = _open_for_frames(options)
    for line in farm.merge_frames(scene, numbers, options.out, options.tiles):
        _tell([line])
    return 0


def _open_for_frames(options: argparse.Namespace) -> bpy.types.Scene:
    scene, _ = _open(options.file, scripts=options.scripts or None)
    if options.threads > 0:
        scene.glint.final.threads = options.threads
    return scene


def _job(options: argparse.Namespace) -> int:
    if not options.file.is_file():
        raise ValueError(f"there is no file {options.file}")
    suffix = {"openjd": ".openjd.json", "slurm": ".slurm.sh", "flamenco": ".flamenco.js"}
    place = options.template or options.file.with_suffix(suffix[options.engine])
    frames = options.frames, options.per_task, options.out
    more = options.tiles, options.scripts
    if options.engine == "openjd":
        template = farm_jobs.job_template(options.file, *frames, place, *more)
        text = json.dumps(template, indent=2) + "\n"
        given = farm_jobs.without_default(template, {"Scene": options.file, "Out": options.out})
        run = ["openjd", "run", str(place), "--step", "Check", "--run-dependencies", *given]
        remedy = f"to run it on this machine: {shlex.join(run)}"
    elif options.engine == "slurm":
        text = farm_jobs.slurm_script(options.file, *frames, *more)
        remedy = f"to hand it to Slurm: {shlex.join(['bash', str(place)])}"
    else:
        text = farm_jobs.flamenco_job_type(*frames, *more)
        remedy = "put it into the folder scripts beside flamenco-manager and start that again"
    write_whole(place, text.encode(errors="surrogateescape"))
    _tell([f"wrote {place}; {remedy}"])
    return 0


def _verify(options: argparse.Namespace) -> int:
    if options.picture.is_dir():
        codes = []
        for code, row in verify_all(options.picture, options.file, scripts=options.scripts):
            codes.append(code)
            _tell([row])
        _tell([f"{codes.count(0)} of {len(codes)} pictures are the same"])
        return max(codes)
    verdict = verify(options.picture, options.file, scripts=options.scripts)
    _tell([*verdict.lines, "same" if verdict.same else "different"])
    return 0 if verdict.same else 1


def _open(path: Path, *, scripts: bool | None = None) -> tuple[bpy.types.Scene, str]:
    """Open a .blend file; gives its scene and the name of the active view layer. scripts: as
    `open_blend` has it; where it is False, what did not run is told on the error stream.
    """
    open_blend(path, scripts=scripts)
    if scripts is False:
        sys.stderr.write("".join(f"glint: {line}\n" for line in unrun()))
    return bpy.context.scene, bpy.context.view_layer.name


def _progress() -> Callable[[float], None]:
    """Shows a fraction on the error stream, each whole per cent once."""
    shown = ""

    def show(fraction: float) -> None:
        nonlocal shown
        text = f"\r{fraction:4.0%}"
        if text != shown:
            sys.stderr.write(text)
            sys.stderr.flush()
            shown = text

    return show


def _tell(lines: list[str]) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in lines))
    sys.stdout.flush()  # a worker that is killed has told how far it came


def register() -> None:
    _commands.append(bpy.utils.register_cli_command("glint", run))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
