"""The native core of Glint: one shared library behind a flat C ABI, found with `library_path`."""

from __future__ import annotations

import sys
from pathlib import Path

__all__ = ["library_path"]

_NAMES = {"win32": "glint_core.dll", "darwin": "libglint_core.dylib"}


def library_path() -> Path:
    """The core's shared library, to be loaded with ctypes. Raises FileNotFoundError when this
    package was installed without it.
    """
    path = Path(__file__).resolve().parent / _NAMES.get(sys.platform, "libglint_core.so")
    if not path.is_file():
        raise FileNotFoundError(f"the native core is not where it should be: {path}")
    return path
