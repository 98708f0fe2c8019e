"""The memory of this process, as the system counts it: scene, trees, pictures, images and
Blender's own.
"""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

_MEGABYTE = float(1 << 20)
"""Bytes of one, as Blender's header and Cycles count them."""


class RenderMemory:
    """What this process holds while a picture is rendered; each part of the render looks."""

    def __init__(self) -> None:
        now, self._before = process_megabytes()
        self._most = now

    def look(self) -> tuple[float, float]:
        """What it holds now, and the most since this began: the system's own figure where that has
        grown, else what was seen.
        """
        now, most = process_megabytes()
        self._most = max(self._most, now, most if most > self._before else 0.0)
        return now, self._most


def process_megabytes() -> tuple[float, float]:
    """What is resident now, and the most that was since the process began. (0, 0) where the system
    does not say.
    """
    try:
        if sys.platform == "win32":
            return _windows()
        return _unix()
    except (OSError, ValueError, ImportError, AttributeError):
        return 0.0, 0.0


def _unix() -> tuple[float, float]:
    """Where there is no /proc, as on macOS, the most stands for what is resident now."""
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / _MEGABYTE
    statm = Path("/proc/self/statm")
    if not statm.exists():
        return most, most
    now = int(statm.read_text().split()[1]) * resource.getpagesize() / _MEGABYTE
    return now, max(now, most)


class _Counters(ctypes.Structure):
    """PROCESS_MEMORY_COUNTERS of Windows."""

    _fields_ = (
        ("size", ctypes.c_uint32),
        ("page_faults", ctypes.c_uint32),
        ("most", ctypes.c_size_t),
        ("now", ctypes.c_size_t),
        ("pools_and_page_file", ctypes.c_size_t * 6),
    )


def _windows() -> tuple[float, float]:
    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    kernel.GetCurrentProcess.restype = ctypes.c_void_p
    ask = kernel.K32GetProcessMemoryInfo
    ask.argtypes = [ctypes.c_void_p, ctypes.POINTER(_Counters), ctypes.c_uint32]
    found = _Counters(ctypes.sizeof(_Counters))
    if not ask(kernel.GetCurrentProcess(), ctypes.byref(found), found.size):
        raise ctypes.WinError(ctypes.get_last_error())
    return found.now / _MEGABYTE, found.most / _MEGABYTE
