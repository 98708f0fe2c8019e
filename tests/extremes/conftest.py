"""The table of the run: extreme, Cycles' wrong pixels, Glint's wrong pixels; printed at its end and
kept as JSON for table.py.

GLINT_EXTREMES_JSON=PATH in the environment says where; without it nothing is written.
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
JSON_VARIABLE = "GLINT_EXTREMES_JSON"
_ROWS = pytest.StashKey[list]()
sys.path.insert(0, str(HERE.parent / "cycles"))


@pytest.fixture
def rows(request: pytest.FixtureRequest) -> list:
    """The rows of the table so far; a test appends `measuring.Row`s."""
    return request.config.stash.setdefault(_ROWS, [])


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    found = config.stash.get(_ROWS, [])
    if not found:
        return
    from measuring import line_of

    terminalreporter.section("right at the extremes: wrong pixels")
    for row in found:
        terminalreporter.write_line(line_of(row))
    path = os.environ.get(JSON_VARIABLE)
    if path:
        Path(path).write_text(json.dumps([asdict(row) for row in found], indent=1))
