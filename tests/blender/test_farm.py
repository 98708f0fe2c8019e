"""Frames of a farm: drawn once, whole or not at all, and handed out by an Open Job Description
template that `openjd` itself runs.
"""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("bpy")
import bpy

from farm_shot import COMPOSITED, PROGRAM, Shot
from glint.operators import command_line, farm

WITHOUT_TEXTURE = """
material = cube.data.materials[0]
material.use_nodes = True
node = material.node_tree.nodes.new("ShaderNodeTexImage")
picture = bpy.data.images.new("wood", 4, 4)
picture.filepath_raw, picture.file_format = str(FOLDER / "wood.png"), "PNG"
picture.save()
node.image = bpy.data.images.load(str(FOLDER / "wood.png"))
shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
(FOLDER / "wood.png").unlink()
"""


@pytest.fixture
def shot(tmp_path: Path) -> Shot:
    return Shot(tmp_path)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("7", [7]),
        ("1-4", [1, 2, 3, 4]),
        ("1-9:4,2", [1, 2, 5, 9]),
        ("-2-0, 5", [-2, -1, 0, 5]),
        ("3-3,3", [3]),
    ],
)
def test_a_range_of_frames(text, numbers):
    assert farm.frame_numbers(text) == numbers


@pytest.mark.parametrize("text", ["", "a", "1..4", "4-1", "1-4:0", "1-", "1-99999999", "1.5"])
def test_what_is_no_range_of_frames(text):
    with pytest.raises(ValueError, match="frames"):
        farm.frame_numbers(text)


@pytest.mark.parametrize("stem", ["*", "a**b", "[a]", "a?"])
def test_only_what_workers_left_of_the_frame_goes(tmp_path, stem):
    """Names of files are no patterns."""
    others = tmp_path / ".other_0001.host-1.png"
    left = tmp_path / f".{stem}_0001.host-1.png"
    for path in (others, left):
        path.touch()
    frame = tmp_path / f"{stem}_0001.png"
    with farm._hidden(frame) as part:
        part.write_bytes(b"frame")
    assert sorted(tmp_path.iterdir()) == sorted([frame, others])


@pytest.mark.parametrize("engine", ["openjd", "slurm", "flamenco"])
@pytest.mark.parametrize("name", ["a\nb\x07\u2028.blend", "a\udcff.blend", "**.blend"])
def test_a_job_for_a_file_of_any_name(tmp_path, engine, name):
    """Open Job Description refuses control characters in names; scripts hold a path's bytes."""
    blend, place = tmp_path / name, tmp_path / "job"
    blend.touch()
    words = ["--engine", engine, "--frames", "1-5", "--out", str(tmp_path / "out")]
    assert command_line.run(["job", str(blend), *words, "--template", str(place)]) == 0
    if engine == "openjd":
        assert json.loads(place.read_text())["name"].isprintable()
    elif engine == "slurm":
        assert os.fsencode(str(blend)) in place.read_bytes()


@pytest.mark.parametrize("grid", [[], ["--tiles", "2x1"]])
@pytest.mark.parametrize("engine", ["openjd", "slurm"])
def test_all_commands_of_a_job_run_scripts_or_none(tmp_path, engine, grid):
    blend, place = tmp_path / "a.blend", tmp_path / "job"
    blend.touch()
    words = ["--engine", engine, "--frames", "1-5", "--out", str(tmp_path / "out"), *grid]
    counts = []
    for trusted in ([], ["--scripts"]):
        words += trusted
        assert command_line.run(["job", str(blend), *words, "--template", str(place)]) == 0
        counts.append(place.read_text().count("--scripts"))
    commands = place.read_text().count('"-b"' if engine == "openjd" else '"$blender" -b')
    assert counts == [0, commands] and commands


def test_a_full_disk_leaves_no_job_and_the_one_before(tmp_path, monkeypatch, capsys):
    blend, place = tmp_path / "a.blend", tmp_path / "job.sh"
    blend.touch()
    place.write_text("before")
    monkeypatch.setattr(Path, "write_bytes", _full_disk)
    monkeypatch.setattr(Path, "write_text", _full_disk)
    words = ["--engine", "slurm", "--frames", "1-5", "--out", str(tmp_path / "out")]
    assert command_line.run(["job", str(blend), *words, "--template", str(place)]) == 2
    assert "No space left" in capsys.readouterr().err
    assert place.read_text() == "before" and sorted(tmp_path.iterdir()) == [blend, place]


def _full_disk(path: Path, *_: object, **__: object) -> None:
    path.open("w").close()
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


@pytest.mark.slow
def test_a_job_runs_draws_what_lacks_and_nothing_twice(shot):
    """Run by the farm's own tool: five frames, two at a time, then all are looked at. One is lost
    and one cut off; the job run again draws these two.
    """
    shot.make()
    blend = str(shot.folder / "shot.blend")
    options = ["--engine", "openjd", "--frames", "1-5", "--per-task", "2", "--out", str(shot.out)]
    made = shot.glint("job", blend, *options)
    assert made.returncode == 0, made.output
    template = shot.folder / "shot.openjd.json"
    parameters = {
        told["name"]: told.get("default")
        for told in json.loads(template.read_text())["parameterDefinitions"]
    }
    assert (parameters["Scene"], parameters["Out"]) == ("shot.blend", "frames")
    first = _openjd(shot, template)
    assert first.count("drawn (was missing)") == 5 and "5 of 5 frames verified" in first
    assert "Chunks run: 4" in first, "2 + 2 + 1 frames and the check"
    assert shot.names == [f"shot_{k:04d}.exr" for k in range(1, 6)]
    whole = {name: (shot.out / name).read_bytes() for name in shot.names}
    (shot.out / "shot_0002.exr").unlink()
    (shot.out / "shot_0004.exr").write_bytes(whole["shot_0004.exr"][:-100])
    (shot.out / ".shot_0002.elsewhere-1.exr").write_bytes(b"of a worker that was killed")
    again = _openjd(shot, template)
    assert again.count(": there") == 3 and again.count("drawn (was") == 2, again
    assert "4: drawn (was" in again and "is not whole" in again
    assert "5 of 5 frames verified" in again
    assert shot.names == sorted(whole)
    for k in (1, 3, 5):
        assert (shot.out / f"shot_{k:04d}.exr").read_bytes() == whole[f"shot_{k:04d}.exr"]


def _openjd(shot: Shot, template: Path) -> str:
    command = [sys.executable, "-m", "openjd", "run", str(template)]
    options = ["--step", "Check", "--run-dependencies", "-p", f"Blender={shot.program}"]
    run = subprocess.run([*command, *options], capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


@pytest.mark.slow
def test_frames_of_another_scene_are_found_and_drawn_again(shot):
    shot.make()
    assert shot.frames("1-2").returncode == 0
    good = shot.frames("1-2", "--check")
    assert good.returncode == 0 and "2 of 2 frames verified" in good.output, good.output
    shot.make("cube.location.z = 0.25\ncube.keyframe_insert('location', frame=5)\n")
    bad = shot.frames("1-3", "--check")
    assert bad.returncode == 1, bad.output
    assert "     1  verified" in bad.output, "nothing has moved yet in the first frame"
    assert "     2  of another geometry" in bad.output and "     3  missing" in bad.output
    again = shot.frames("1-2")
    assert "frame 1: there" in again.output and "frame 2: drawn" in again.output
    shot.make("scene.glint.final.samples = 2\n")
    assert "     1  of another settings" in shot.frames("1", "--check").output


@pytest.mark.slow
def test_frames_before_zero(shot):
    shot.make()
    run = shot.frames("-1-0")
    assert run.returncode == 0 and "frame -1: drawn" in run.output, run.output
    assert shot.names == ["shot_-001.exr", "shot_0000.exr"]


@pytest.mark.slow
def test_a_look_at_frames_writes_nothing(shot):
    """Nodes that write files do so when a frame is drawn, not when it is looked at."""
    shot.make(COMPOSITED)
    assert shot.frames("1").returncode == 0
    written = sorted((shot.folder / "composited").iterdir())
    assert written, "the nodes are at work"
    for path in written:
        path.unlink()
    assert "1 of 1 frames verified" in shot.frames("1", "--check").output
    assert "frame 1: there" in shot.frames("1").output
    assert not list((shot.folder / "composited").iterdir())


@pytest.mark.slow
def test_frames_that_blender_makes_of_strips_are_refused(shot):
    """No stamp could tell what they were made of, and other scenes' compositors would run; a stamp
    that is there is not taken for good.
    """
    strips = "getattr(scene.sequence_editor_create(), %r).new_effect(%s)\n"
    options = 'name="strip", type="COLOR", channel=1, frame_start=1, '
    ends = "frame_end=9" if bpy.app.version < (5, 0, 0) else "length=9"
    name = "sequences" if bpy.app.version < (4, 4, 0) else "strips"
    shot.make(strips % (name, options + ends))
    drawn = shot.frames("1")
    assert drawn.returncode == 2 and "strips are rendered in its place" in drawn.output, (
        drawn.output
    )
    assert shot.names == []
    shot.out.mkdir(exist_ok=True)
    shot.make()
    assert shot.frames("1").returncode == 0
    shot.make(strips % (name, options + ends))
    checked = shot.frames("1", "--check")
    assert checked.returncode == 2 and "strips are rendered" in checked.output, checked.output


@pytest.mark.slow
def test_frames_of_another_version_of_glint_are_noticed(shot, tmp_path):
    """An upgrade in the middle of a job."""
    shot.make()
    assert shot.frames("1").returncode == 0
    newer = "from glint.addon.render import stamp\nstamp.manifest()['version'] = '9.9.9'\n"
    shot.program.write_text(PROGRAM.replace("assert sys", newer + "assert sys"))
    upgraded = shot.frames("1", "--check")
    assert upgraded.returncode == 1 and "of another tracer" in upgraded.output


@pytest.mark.slow
def test_a_missing_texture_ends_with_a_sentence_and_no_picture(shot):
    shot.make(WITHOUT_TEXTURE)
    run = shot.frames("1-2")
    assert run.returncode == 2, run.output
    assert "glint frames: frame 1: Image 'wood.png'" in run.output
    assert shot.names == []


@pytest.mark.slow
def test_a_full_disk_leaves_no_picture(shot):
    shot.make()
    full = (
        "import resource, signal, sys\nsys.dont_write_bytecode = True\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (900, resource.RLIM_INFINITY))\n"
    )
    shot.program.write_text(PROGRAM.replace("exit_code = command", full + "exit_code = command"))
    run = shot.frames("1")
    assert run.returncode == 2 and "is not whole" in run.output, run.output
    assert shot.names == []


@pytest.mark.slow
def test_a_killed_worker_leaves_no_frame_and_the_next_one_draws_it(shot):
    slow = "scene.glint.final.samples, scene.glint.final.error_threshold = 4096, 0\n"
    shot.make(slow + "scene.render.resolution_x = 200\n")
    blend = str(shot.folder / "shot.blend")
    words = ["frames", blend, "1", "--out", str(shot.out)]
    patched = PROGRAM.replace(
        "exit_code = command",
        "from glint.addon.render import final\ntrace = final._trace\n"
        "def tracing(*arguments):\n    os.write(1, b'TRACING\\n')\n    return trace(*arguments)\n"
        "final._trace = tracing\nexit_code = command",
    )
    assert patched != PROGRAM
    shot.program.write_text(patched)
    worker = shot.blender.launch(shot.command(*words))
    for line in worker.stdout:
        if "TRACING" in line:
            break
    time.sleep(0.3)
    worker.send_signal(signal.SIGKILL)
    assert worker.wait(60) == -signal.SIGKILL
    assert [name for name in shot.names if not name.startswith(".")] == []
    shot.make()
    shot.program.write_text(PROGRAM)
    run = shot.frames("1")
    assert run.returncode == 0 and shot.names == ["shot_0001.exr"], run.output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "said"),
    [
        ('image.file_format = "JPEG"\n', "keeps no stamp"),
        ("scene.view_layers[0].use = False\n", "none of its view layers"),
        ('scene.glint.target = "LEVELS"\n', "set Samples instead"),
    ],
)
def test_what_cannot_be_a_frame_is_refused(shot, more, said):
    shot.make(more)
    run = shot.frames("1")
    assert run.returncode == 2 and said in run.output, run.output
    assert shot.names == []


@pytest.mark.slow
@pytest.mark.parametrize("tile", [(), ("--tiles", "2x1", "--tile", "1")], ids=["frame", "tile"])
def test_workers_that_draw_the_same_are_all_content(shot, tile):
    """As where a farm takes a machine for lost that was only slow."""
    shot.make()
    words = ["frames", str(shot.folder / "shot.blend"), "1-2", "--out", str(shot.out), *tile]
    workers = [shot.blender.launch(shot.command(*words)) for _ in range(3)]
    said = [worker.communicate(timeout=120)[0] for worker in workers]
    assert [worker.returncode for worker in workers] == [0, 0, 0], said
    assert len(shot.names) == 2 and not any(name.startswith(".") for name in shot.names)


@pytest.mark.slow
def test_a_folder_is_verified_as_a_table(shot):
    """Every picture is rendered again: the same, different, or with what cannot be answered."""
    shot.make()
    assert shot.frames("1-3").returncode == 0
    blend = str(shot.folder / "shot.blend")
    good = shot.glint("verify", str(shot.out), blend)
    assert good.returncode == 0, good.output
    assert good.output.count("exr  same") == 3 and "3 of 3 pictures are the same" in good.output
    assert shot.frames("1", "--tiles", "2x1", "--tile", "2").returncode == 0
    (shot.out / "shot_0004.exr").write_bytes((shot.out / "shot_0001.exr").read_bytes()[:-100])
    shot.make("cube.location.z = 0.25\ncube.keyframe_insert('location', frame=5)\n")
    mixed = shot.glint("verify", str(shot.out), blend)
    assert mixed.returncode == 2, mixed.output
    rows = dict(line.split(None, 1) for line in mixed.output.splitlines() if ".exr  " in line)
    assert rows["shot_0001.exr"] == "same" and rows["shot_0002.exr"].startswith("different: file")
    assert "is not whole" in rows["shot_0004.exr"]
    empty = shot.glint("verify", str(shot.folder / "resources"), blend)
    assert empty.returncode == 2 and "no EXR or PNG pictures" in empty.output
