"""The array script, run by Debian's Slurm on two workers: what is killed in the middle is drawn
again, and the job ends with every frame verified.
"""

from __future__ import annotations

import subprocess

import pytest

pytest.importorskip("bpy")
from farm_shot import PROGRAM, Shot
from glint.operators import farm_jobs
from glint.operators.pictures import header_texts
from glint.operators.tiles import Grid
from slurm_farm import missing_programs, slurm_farm, wait_for

needs_slurm = pytest.mark.skipif(
    bool(missing_programs()),
    reason=f"Slurm's {', '.join(missing_programs())} are missing (Debian: apt-get install munge "
    "slurm-client slurmctld slurmd)",
)

KILLED_ONCE = """
import signal
from pathlib import Path
from glint import engine
def killed(*arguments, render=engine.render, **options):
    mark = Path(sys.argv[0]).with_name("killed")
    if bpy.context.scene.frame_current == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return render(*arguments, **options)
engine.render = killed
"""
HELD_ONCE = """
import time
from pathlib import Path
from glint import engine
def held(*arguments, render=engine.render, **options):
    mark = Path(sys.argv[0]).with_name("held")
    if bpy.context.scene.frame_current == 14 and not mark.exists():
        mark.write_text(os.environ["SLURMD_NODENAME"])
        time.sleep(600)
    return render(*arguments, **options)
engine.render = held
"""


def _job(shot: Shot, *words: str) -> str:
    """Write the array script; gives its path."""
    blend = str(shot.folder / "shot.blend")
    made = shot.glint("job", blend, "--engine", "slurm", "--out", str(shot.out), *words)
    assert made.returncode == 0, made.output
    script = shot.folder / "shot.slurm.sh"
    assert f"bash {script}" in made.output
    return str(script)


@pytest.mark.slow
@needs_slurm
@pytest.mark.parametrize("tiles", [(), ("--tiles", "2x1")], ids=["frames", "tiles"])
def test_a_job_survives_a_killed_worker(tmp_path, tiles):
    shot = Shot(tmp_path)
    shot.make()
    serial = tmp_path / "serial"
    blend = str(tmp_path / "shot.blend")
    assert shot.glint("frames", blend, "1-3", "--out", str(serial)).returncode == 0
    _patch(shot, KILLED_ONCE)
    script = _job(shot, "--frames", "1-3", "--per-task", "2", *tiles)
    with slurm_farm(2) as farm:
        farm.variables["BLENDER"] = str(shot.program)
        check = farm.slurm("bash", script)
        farm.wait_for_end(120)
        said = farm.output()
        assert "the worker was killed (exit code 137)" in said, said
        assert "3 of 3 frames verified" in said, said
        assert farm.exit_codes(check) == {"0:0"}
        assert farm.restarts() == 1
    assert shot.names == ["shot_0001.exr", "shot_0002.exr", "shot_0003.exr"]
    for name in shot.names:
        assert _hash(shot.out / name) == _hash(serial / name)


def _patch(shot: Shot, text: str) -> None:
    """Runs a text before the program's command."""
    patched = PROGRAM.replace("exit_code = command", text + "exit_code = command")
    assert patched != PROGRAM
    shot.program.write_text(patched)


def _hash(path) -> str:
    return header_texts(path)["glint.ViewLayer.pixels"]


@pytest.mark.slow
@needs_slurm
def test_a_job_survives_a_worker_without_power(tmp_path):
    """24 frames; in the middle of one a machine is gone with all that it ran, and comes back. Slurm
    itself puts its task into the queue again. How long that takes: tests/bench/farm.py.
    """
    shot = Shot(tmp_path)
    shot.make()
    serial = tmp_path / "serial"
    blend = str(tmp_path / "shot.blend")
    assert shot.glint("frames", blend, "1-24", "--out", str(serial)).returncode == 0
    _patch(shot, HELD_ONCE)
    script = _job(shot, "--frames", "1-24", "--per-task", "4")
    held = tmp_path / "held"
    with slurm_farm(2) as farm:
        farm.variables["BLENDER"] = str(shot.program)
        check = farm.slurm("bash", script)
        wait_for(lambda: held.exists() and held.read_text(), "frame 14", 120)
        farm.restart_worker(held.read_text())
        farm.wait_for_end(300)
        assert farm.restarts() == 1
        assert farm.exit_codes(check) == {"0:0"} and "24 of 24 frames verified" in farm.output()
    assert shot.names == sorted(path.name for path in serial.iterdir())
    assert {_hash(shot.out / name) == _hash(serial / name) for name in shot.names} == {True}


@pytest.mark.slow
@needs_slurm
def test_what_cannot_be_drawn_fails_the_job(tmp_path):
    """Slurm hears of it: the task and the check end with other exit codes than 0."""
    shot = Shot(tmp_path)
    shot.make('image.file_format = "JPEG"\n')
    script = _job(shot, "--frames", "1")
    with slurm_farm(1) as farm:
        farm.variables["BLENDER"] = str(shot.program)
        check = farm.slurm("bash", script)
        farm.wait_for_end(60)
        assert farm.exit_codes(check) == {"2:0"}
        assert farm.output().count("keeps no stamp") == 2
    assert shot.names == []


def test_the_script_is_sound_for_any_path_and_many_frames(tmp_path):
    blend = tmp_path / "it's a $HOME `shot`.blend"
    text = farm_jobs.slurm_script(blend, "1-4, 9,20-30:5", 2, tmp_path / 'o"ut', Grid(2, 2))
    script = tmp_path / "job.sh"
    script.write_text(text)
    shown = 'printf "%s|" "$scene" "$out" "$frames" "${chunks[@]}" "$grid" "$tiles"; exit\n'
    script.write_text(text.replace("if [ -z", shown + "if [ -z", 1))
    read = subprocess.run(["bash", script], capture_output=True, text=True, check=True).stdout
    assert read.split("|")[:-1] == [
        str(blend),
        str(tmp_path / 'o"ut'),
        "1-4,9,20-30:5",
        *("1-2", "3-4", "9,20", "25,30"),
        "2x2",
        "4",
    ]
    assert "--array=0-15" in text
    with pytest.raises(ValueError, match="more frames"):
        farm_jobs.slurm_script(blend, "1-3000", 2, tmp_path)
