"""A job on two Slurm workers of one core each beside one serial render on the same two cores.

    python tests/bench/farm.py [--frames 24] [--per-task 2] [--samples 64] [--width 640]

The demo scene, whose knot turns. A third of the way into the job one worker is killed as by a power
cut (Slurm's daemon, its task, Blender) and started again; Slurm puts its task back into the queue.
At the end every frame is verified by its stamp, and the hashes of pixels are those of the serial
render. Needs Debian's munge, slurm-client, slurmctld, slurmd, and the core (`make bench ARGS=farm`
builds it).
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "blender")]

from blender_process import REGISTER_TREE  # noqa: E402
from farm_shot import Shot  # noqa: E402
from glint_tree import BYTECODE  # noqa: E402
from slurm_farm import missing_programs, slurm_farm, wait_for  # noqa: E402

SCENE = """
from glint.operators.demo_scene import build_demo_scene
bpy.ops.wm.read_homefile(use_factory_startup=True)
build_demo_scene()
scene = bpy.context.scene
scene.render.engine = "GLINT"
scene.render.resolution_percentage = 100
scene.render.resolution_x, scene.render.resolution_y = WIDTH, WIDTH * 9 // 16
scene.glint.final.samples, scene.glint.final.error_threshold = SAMPLES, 0
image = scene.render.image_settings
if hasattr(image, "media_type"):
    image.media_type = "IMAGE"
image.file_format = "OPEN_EXR"
turning = next(o for o in scene.objects if "knot" in o.name.lower())
turning.keyframe_insert("rotation_euler", frame=1)
turning.rotation_euler.z += 3.0
turning.keyframe_insert("rotation_euler", frame=FRAMES)
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "shot.blend"))
"""

COUNTING = """#!/bin/bash
here=$(dirname "$0")
echo "begin $(date +%s.%N) ${SLURMD_NODENAME:-} ${SLURM_ARRAY_TASK_ID:-} $6" >> "$here/tasks"
"$here/drawing" "$@"
code=$?
echo "end $(date +%s.%N) ${SLURMD_NODENAME:-} ${SLURM_ARRAY_TASK_ID:-} $6" >> "$here/tasks"
times >> "$here/times"
exit $code
"""
"""Draws, and writes down when it began and ended, and the seconds of CPU that it took."""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=24)
    parser.add_argument("--per-task", type=int, default=2)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--width", type=int, default=640)
    options = parser.parse_args()
    if missing_programs():
        print(f"farm.py: {', '.join(missing_programs())} are missing", file=sys.stderr)
        return 1
    from glint import engine

    if engine.native_error():
        print(f"farm.py: {engine.native_error()} (make bench ARGS=farm)", file=sys.stderr)
        return 1
    os.environ |= BYTECODE
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])
    with tempfile.TemporaryDirectory() as folder:
        shot = Shot(Path(folder))
        made = shot.blender.run(
            REGISTER_TREE
            + f"FRAMES, SAMPLES, WIDTH = {options.frames}, {options.samples}, {options.width}\n"
            + SCENE
        )
        assert made.returncode == 0, made.output
        numbers = f"1-{options.frames}"
        print(f"load before: {os.getloadavg()[0]:.2f}", flush=True)
        shot.program.rename(shot.folder / "drawing")
        shot.program.write_text(COUNTING)
        shot.program.chmod(0o755)
        serial = _serial(shot, numbers)
        serial_cpu = _cpu_seconds(shot)
        print(f"serial: {serial:.1f} s ({serial_cpu:.1f} s of CPU)", flush=True)
        farm, lost = _farm(shot, numbers, options.per_task, serial_cpu / options.frames)
        farm_cpu = _cpu_seconds(shot) - serial_cpu + lost
        print(f"two workers, one killed: {farm:.1f} s ({farm_cpu:.1f} s of CPU)")
        print(f"the killed task had taken {lost:.1f} s of CPU")
        print("\n".join(_timeline(shot)))
        checked = shot.frames(numbers, "--check")
        print(checked.output.splitlines()[-1])
        assert checked.returncode == 0, checked.output
        same = _hashes(shot.folder / "serial") == _hashes(shot.out)
        more, more_cpu = farm / serial - 1, farm_cpu / serial_cpu - 1
        print(f"over the serial render: {100 * more:+.1f} % ({100 * more_cpu:+.1f} % of CPU)")
        print(f"hashes of all {options.frames} frames: {'the same' if same else 'DIFFERENT'}")
        print(f"load after: {os.getloadavg()[0]:.2f}")
        return 0 if same else 1


def _serial(shot: Shot, numbers: str) -> float:
    blend = str(shot.folder / "shot.blend")
    words = ["frames", blend, numbers, "--threads", "2", "--out", str(shot.folder / "serial")]
    start = time.perf_counter()
    run = shot.blender.start(shot.command(*words), timeout=7200)
    assert run.returncode == 0, run.output
    return time.perf_counter() - start


def _farm(shot: Shot, numbers: str, per_task: int, of_a_frame: float) -> tuple[float, float]:
    """Seconds until the last frame is there, and seconds of CPU that the killed task had taken."""
    words = ["--engine", "slurm", "--frames", numbers, "--per-task", str(per_task)]
    blend = str(shot.folder / "shot.blend")
    made = shot.glint("job", blend, *words, "--out", str(shot.out))
    assert made.returncode == 0, made.output
    script = str(shot.folder / "shot.slurm.sh")
    wanted = len(list((shot.folder / "serial").iterdir()))
    with slurm_farm(2) as farm:
        farm.variables |= {"BLENDER": str(shot.program)}
        farm.slurm("sbatch", "--wait", "--wrap=true")  # farms are up when a job comes
        (shot.folder / "tasks").unlink()
        start = time.perf_counter()
        farm.slurm("sbatch", "--parsable", script)
        wait_for(lambda: len(shot.names) >= wanted // 3, "a third of the frames", 7200)
        middle = lambda: of_a_frame < 2 * farm.cpu_seconds("w2") < 2 * of_a_frame  # noqa: E731
        wait_for(middle, "the middle of a frame", 7200, every=0.2)
        lost = farm.cpu_seconds("w2")
        farm.restart_worker("w2")
        farm.wait_for_end(7200)
        seconds = time.perf_counter() - start
        assert farm.restarts() == 1, "the killed task goes back into the queue"
    return seconds, lost


def _timeline(shot: Shot) -> list[str]:
    """A line for each task of the farm: seconds since the first began, worker, number, frames."""
    rows = [line.split() for line in (shot.folder / "tasks").read_text().splitlines()]
    first, told = float(rows[0][1]), []
    for place, (what, begin, worker, *task) in enumerate(rows):
        if what == "begin":
            after = next((row for row in rows[place + 1 :] if row[2] == worker), None)
            ended = after is not None and after[0] == "end"
            end = f"{float(after[1]) - first:6.1f}" if ended else "killed"
            told.append(f"{float(begin) - first:7.1f} to {end}  " + "  ".join([worker, *task]))
    return told


def _cpu_seconds(shot: Shot) -> float:
    """Of all programs that ended by themselves."""
    said = (shot.folder / "times").read_text()
    return sum(60 * int(m) + float(s) for m, s in re.findall(r"(\d+)m([\d.]+)s", said))


def _hashes(folder: Path) -> dict[str, str]:
    """Name of a frame → hash of its pixels."""
    from glint.operators.pictures import header_texts

    return {
        path.name: next(v for k, v in header_texts(path).items() if k.endswith(".pixels"))
        for path in sorted(folder.iterdir())
    }


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (AssertionError, TimeoutError, subprocess.SubprocessError) as error:
        sys.exit(f"farm.py: {error}")
