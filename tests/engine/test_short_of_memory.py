"""Memory and threads that cannot be had: an error that names what and the remedy, never a hang."""

import subprocess
import sys
from pathlib import Path

import pytest

from native_tools import needs_core

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="limits a process with setrlimit, as Linux has it"
)

TESTS = Path(__file__).resolve().parent.parent
STACK = 1 << 29
"""Bytes of a thread's stack, in a process that may have no further thread but some memory."""
PRELUDE = f"""
import resource, sys
sys.path[:0] = [{str(TESTS)!r}, {str(TESTS / "engine")!r}]
import numpy as np
import glint_tree
from engine_scenes import hard_lights
from glint import engine
from glint.engine import live

def leave(megabytes):
    used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + megabytes * 1_000_000, resource.RLIM_INFINITY))

def told(action):
    try:
        print(action() or "done")
    except Exception as error:
        print(f"{{type(error).__name__}}: {{error}}")

"""


def _lines(program: str, stack: int = 0) -> list[str]:
    """What a program prints in a process of its own."""
    limit = (
        f"import os, resource, sys\nresource.setrlimit(resource.RLIMIT_STACK, ({stack}, -1))\n"
        if stack
        else "import os, sys\n"
    )
    start = limit + "os.execv(sys.executable, [sys.executable, '-c', sys.argv[1]])"
    done = subprocess.run(
        [sys.executable, "-c", start, PRELUDE + program], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    return done.stdout.splitlines()


def test_products_of_matrices_when_memory_is_short() -> None:
    """NumPy's OpenBLAS spins for ever in its first product where it cannot have 32 MB."""
    program = (
        "leave(8)\ntold(lambda: np.linalg.det(np.eye(3)) + (np.eye(3) @ np.ones((3, 40))).sum())"
    )
    assert _lines(program) == ["121.0"]


@needs_core
def test_threads_that_do_not_start() -> None:
    program = """
scene, settings = hard_lights(), engine.Settings(samples=2, backend="NATIVE")
engine.render(scene, settings)
leave(300)
told(lambda: engine.render(scene, settings) and None)
render = live.LiveRender()
for _ in range(2):
    render.start([engine.Task(scene, settings)])
    print(render.busy, render.error)
"""
    refused = (
        "the system starts no further thread: close programs, or let a user have more of them "
        "(ulimit -u)"
    )
    assert _lines(program, STACK) == [f"MemoryError: {refused}"] + 2 * [f"False {refused}"]


def test_threads_that_die_before_their_first_line() -> None:
    """As where memory runs out when one begins; threading.Thread.start then waits for ever."""
    program = """
import _thread, threading
scene = hard_lights()
start = _thread.start_new_thread
_thread.start_new_thread = threading._start_new_thread = lambda *_: 1
from types import SimpleNamespace
from glint.engine import futures
from glint.engine.analysis.fingerprint import value_fingerprint

def stamped():
    from glint.addon.render.stamp import Stamping
    with Stamping(scene) as stamping:
        stamping.begin_pixels(SimpleNamespace(passes={"Combined": np.zeros((4, 4, 4))}))
        fields = stamping.fields(engine.Settings(), 1)
    return fields["geometry"] == value_fingerprint(scene)

told(stamped)
told(lambda: futures.parallel_map(abs, [-1, 2, -3]))
told(lambda: futures.parallel_map(abs, ["x"]))

futures._LONGEST_START = 0.0
render, task = live.LiveRender(), engine.Task(scene, engine.Settings(samples=1))
render.start([task])
print(render.busy, render.wait(lambda wave: True, 9.0), render.error)
thread = futures.Thread(print)
print(thread.is_alive(), thread.is_lost)
_thread.start_new_thread = start
render.start([task])
futures._LONGEST_START = 20.0
print(render.wait(lambda wave: wave.final, 30.0), render.error)
"""
    assert _lines(program) == [
        "True", "[1, 2, 3]", "TypeError: bad operand type for abs(): 'str'",
        "False False the system starts no further thread: close programs, or let a user have more "
        "of them (ulimit -u)", "False True", "True None"
    ]  # fmt: skip


@needs_core
def test_a_picture_that_does_not_fit() -> None:
    """With some memory the sums cannot be had, with more the tracer's own arrays or the picture:
    each names what, and the remedy.
    """
    program = """
from dataclasses import replace
scene, settings = hard_lights(), engine.Settings(samples=2, threads=1, backend="NATIVE")
engine.render(scene, settings)
scene = replace(scene, camera=replace(scene.camera, resolution=(300, 300)))
for megabytes in range(5, 200):
    leave(megabytes)
    try:
        engine.render(scene, replace(settings, passes=frozenset(engine.PASSES) - {"Combined"}))
        break
    except MemoryError as error:
        print(f"MemoryError: {error}")
        if "do not fit" in str(error):
            break
"""
    lines = _lines(program)
    assert len(set(lines)) > 1
    for line in lines:
        assert line.startswith("MemoryError: the core ran out of memory: ") and "; use " in line
