"""A tape of what Python asks of the core, played to the same core by a program without Python."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import core_tape
from blender_process import ROOT
from engine_scenes import SCENES
from glint.engine.native import binding, packer, packing
from native_tools import needs_core

COMPILER = shlex.split(os.environ.get("CXX", "c++"))
pytestmark = [
    needs_core,
    pytest.mark.skipif(not shutil.which(COMPILER[0]), reason="needs a C++ compiler: set CXX"),
]


@pytest.fixture(scope="module")
def player(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("player") / "player"
    source = ROOT / "engine" / "core" / "tests" / "player.cpp"
    include = ROOT / "engine" / "core" / "include"
    command = [*COMPILER, "-std=c++20", "-Wall", "-Wextra", "-Werror", "-I", include, source]
    subprocess.run([*command, "-o", made, "-ldl"], check=True)
    return made


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A tape of all reference renders and their pictures."""
    folder = tmp_path_factory.mktemp("tape")
    tape, pictures = folder / "tape", folder / "pictures"
    assert core_tape.record(list(SCENES), tape, pictures) == []
    return tape, pictures


def _play(player: Path, tape: Path) -> tuple[subprocess.CompletedProcess[str], bytes]:
    made, library = tape.with_name("played"), binding.library()._name
    command = [player, library, tape, made]
    run = subprocess.run(command, capture_output=True, text=True)
    return run, made.read_bytes()


def test_the_player_draws_what_was_recorded(player, recorded):
    tape, pictures = recorded
    run, played = _play(player, tape)
    assert run.returncode == 0, run.stderr
    assert played == pictures.read_bytes() and len(played) > 1_000_000


def test_another_number_on_the_tape_is_another_picture(player, recorded, tmp_path):
    """The tape is what is drawn: its first block's last vertex lies elsewhere."""
    tape, pictures = recorded
    words = np.fromfile(tape, "<u8")
    assert words[2] == core_tape.Operation.BLOCK
    floats = words[5 : 5 + int(words[3]) // 8].view("<f4")
    floats *= 1.5
    words.tofile(tmp_path / "tape")
    run, played = _play(player, tmp_path / "tape")
    assert run.returncode == 0, run.stderr
    assert len(played) == pictures.stat().st_size and played != pictures.read_bytes()


@pytest.mark.parametrize(("word", "said"), [(0, "no tape"), (1, "another version")])
def test_what_is_no_tape_for_this_core_is_refused(player, recorded, tmp_path, word, said):
    words = np.fromfile(recorded[0], "<u8")
    words[word] += 1
    words.tofile(tmp_path / "tape")
    run, _ = _play(player, tmp_path / "tape")
    assert run.returncode == 1 and said in run.stderr


def test_a_tape_that_ends_too_early_is_refused(player, recorded, tmp_path):
    content = recorded[0].read_bytes()
    (tmp_path / "tape").write_bytes(content[: len(content) // 2])
    run, _ = _play(player, tmp_path / "tape")
    assert run.returncode == 1 and "ends too early" in run.stderr


def test_the_recorder_leaves_the_packing_as_it_was(recorded):
    assert packing.address is packer.address
    assert binding.library.__name__ == "library"
