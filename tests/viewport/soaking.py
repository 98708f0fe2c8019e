"""Soaks from outside. A crash or a hang that comes at the same step without Glint is Blender's own,
and the soak goes on behind it.
"""

from __future__ import annotations

import re
import signal
from dataclasses import dataclass, field

import host
from blender_process import Blender, Run

_STEP = re.compile(r"^step (\d+) (\w+)", re.MULTILINE)
_HANG = "Timeout (0:01:00)!"
"""How faulthandler begins what it says of a step that takes longer than `in_window.STILL`; the
threads' stacks follow.
"""
_LEAST = 20.0
"""Seconds that the last part lasts at least: it must come to its end."""


@dataclass
class Soak:
    """parts: what ran, in order; only the last one came to its end.  faults: of Blender itself."""

    parts: list[host.WindowRun] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def soak(blender: Blender, seconds: float, seed: int) -> Soak:
    """Random edits with Glint for so long. Fails where Blender crashes or hangs and does not with
    an engine that draws nothing.
    """
    result, first, left = Soak(), 0, seconds
    while True:
        part = _run(blender, "GLINT", seed, "--first", first, "--seconds", max(left, _LEAST))
        result.parts.append(part)
        if not _crashed(part.run):
            return result
        step, edit, reloaded = _end(part.run.output, first)
        control = _run(blender, "NOTHING", seed, "--first", reloaded, "--steps", step + 1).run
        assert _crashed(control) and _end(control.output, reloaded)[0] == step, (
            f"only with Glint:\n{part.run.output}\n{control.output}"
        )
        result.faults.append(
            f"Blender itself crashes or hangs at steps {reloaded} to {step} of seed {seed}, in "
            f"{edit}"
        )
        first, left = step + 1, left - (part.memory[-1][0] - part.memory[0][0])


def _run(blender: Blender, engine: str, seed: int, *arguments: object) -> host.WindowRun:
    return host.run_in_window(
        blender, "soak.py", "--engine", engine, "--seed", seed, *arguments, timeout=7200
    )


def _crashed(run: Run) -> bool:
    is_hang = run.returncode == 1 and _HANG in run.output
    return is_hang or run.returncode in (
        -signal.SIGSEGV,
        -signal.SIGABRT,
        128 + signal.SIGSEGV,
        128 + signal.SIGABRT,
    )


def _end(output: str, first: int) -> tuple[int, str, int]:
    """The last step, its edit, and the last step before it that opened the file anew, after which
    nothing of earlier steps is left.
    """
    steps = [(int(step), edit) for step, edit in _STEP.findall(output)]
    step, edit = steps[-1] if steps else (first, "the start")
    return (
        step,
        edit,
        max(
            (number for number, name in steps if name == "reload" and number < step), default=first
        ),
    )
