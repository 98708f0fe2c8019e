"""The soak's own watch: a hang is no work."""

import shutil
import sys

from blender_process import ROOT, Blender, Run

sys.path.insert(0, str(ROOT / "tests" / "viewport"))

import soaking


def test_a_step_that_hangs_ends_blender_with_its_stack(tmp_path):
    blender = Blender(tmp_path)
    shutil.copy(ROOT / "tests" / "viewport" / "in_window.py", blender.folder)
    run = blender.run(
        """
import os, sys, time
sys.path.insert(0, str(FOLDER))
import in_window

def hanging_edit():
    time.sleep(60)

def scenario():
    yield 0.0
    hanging_edit()

in_window.STILL = 0.5
player = in_window._Player(scenario(), None)
while True:
    player.tick()
""",
        timeout=30,
    )
    assert run.returncode == 1
    assert "Timeout (0:00:00.500000)!" in run.output and "in hanging_edit" in run.output


def test_a_hang_is_judged_like_a_crash():
    hang = Run(
        1, "step 7 add in OBJECT\nTimeout (0:01:00)!\nThread 0x1 (most recent call first):\n"
    )
    assert soaking._crashed(hang) and soaking._end(hang.output, 0)[:2] == (7, "add")
    assert (
        soaking._crashed(Run(-11, ""))
        and not soaking._crashed(Run(1, "Traceback"))
        and not soaking._crashed(Run(0, soaking._HANG))
    )
