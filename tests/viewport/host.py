"""Starts a Blender with a window on a virtual screen, and watches its memory from outside."""

from __future__ import annotations

import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from blender_process import Blender, Run, finish

HERE = Path(__file__).parent
_PAGE = 4096 / 1e6
_SIZE = (900, 560)


@dataclass(frozen=True)
class WindowRun:
    """How a program with a window ended. memory: (time.monotonic(), the same inside, megabytes
    held) twenty times a second.
    """

    run: Run
    memory: list[tuple[float, float]]


def run_in_window(
    blender: Blender,
    script: str,
    *arguments: object,
    timeout: float,
    size: tuple[int, int] = _SIZE,
    flags: tuple[str, ...] = (),
) -> WindowRun:
    """Run a script of this folder in a window of `size` pixels, its first argument being Blender's
    folder. flags: of Blender's command line.
    """
    for source in HERE.glob("*.py"):
        shutil.copy(source, blender.folder)
    host, program = blender.program[:-1], blender.program[-1]
    with _screen(host, size) as display:
        command = [
            *host,
            "env",
            f"DISPLAY=:{display}",
            "LIBGL_ALWAYS_SOFTWARE=1",
            program,
            "--factory-startup",
            *flags,
        ]
        command += [
            "--window-geometry",
            "0",
            "0",
            *map(str, size),
            "-P",
            blender.inside(blender.folder / script),
        ]
        process = blender.launch(
            [*command, "--", blender.inside(blender.folder), *map(str, arguments)]
        )
        memory: list[tuple[float, float]] = []
        watcher = threading.Thread(target=_watch, args=(process, memory), daemon=True)
        watcher.start()
        run = finish(process, timeout)
        watcher.join()
    return WindowRun(run, memory)


@contextmanager
def _screen(host: list[str], size: tuple[int, int]) -> Iterator[int]:
    """A virtual one a little larger than a window; gives the number of its display."""
    process = subprocess.Popen(
        [*host, "Xvfb", "-displayfd", "1", "-screen", "0", f"{size[0] + 380}x{size[1] + 240}x24"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        yield int(process.stdout.readline())
    finally:
        process.terminate()
        process.wait()


def _watch(process: subprocess.Popen[str], memory: list[tuple[float, float]]) -> None:
    """`chroot` and `env` become the program that they start, so the process's number stays."""
    statm = Path(f"/proc/{process.pid}/statm")
    while process.poll() is None:
        try:
            pages = int(statm.read_text().split()[1])
        except (OSError, IndexError):
            return
        memory.append((time.monotonic(), pages * _PAGE))
        time.sleep(0.05)
