"""Tests import the working tree as `glint` (glint_tree.py).

pytest leaves without Blender's own clean-up: bpy 4.2 crashes in it once a class was registered or
certain modifiers were evaluated, and 4.5 was seen to hang, which would turn a passed run into a
failed one.
"""

from __future__ import annotations

import os
import sys

import pytest

import glint_tree  # noqa: F401

_STATUS: list[int] = []


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    _STATUS.append(int(exitstatus))


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    if _STATUS and "bpy" in sys.modules:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_STATUS[-1])
