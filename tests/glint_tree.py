"""Loads the working tree as the package `glint`, whatever its folder is called, so that tests
import what Blender would.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BYTECODE = {
    "PYTHONDONTWRITEBYTECODE": "",
    "PYTHONPYCACHEPREFIX": str(ROOT / "build" / "bytecode"),
}
"""Variables for programs that import the tree, as packaging/tree.py has them for what starts
tests.
"""

if "glint" not in sys.modules:
    _spec = importlib.util.spec_from_file_location(
        "glint", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)]
    )
    sys.modules["glint"] = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(sys.modules["glint"])
