"""Loads the working tree as the package `glint`, whatever its folder is called, so that tests
import what Blender would.

Leaves without Blender's own clean-up: bpy 4.2 crashes in it once a class was registered or certain
modifiers were evaluated, and 4.5 was seen to hang, which would turn a passed run into a failed one.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from pathlib import Path

import pytest

_STATUS: list[int] = []
ROOT = Path(__file__).resolve().parent.parent


def _load_package() -> None:
    if "glint" in sys.modules:
        return
    spec = importlib.util.spec_from_file_location(
        "glint", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    module = importlib.util.module_from_spec(spec)
    sys.modules["glint"] = module
    spec.loader.exec_module(module)


_load_package()


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    _STATUS.append(int(exitstatus))


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    if _STATUS and "bpy" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_STATUS[-1])
