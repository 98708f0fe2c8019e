"""Loads the working tree as the package `glint`, whatever its folder is called, so that tests import what Blender would."""

import importlib.util
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def _load_package() -> None:
    if "glint" in sys.modules:
        return
    spec = importlib.util.spec_from_file_location("glint", ROOT / "__init__.py", submodule_search_locations=[str(ROOT)])
    module = importlib.util.module_from_spec(spec)
    sys.modules["glint"] = module
    spec.loader.exec_module(module)


_load_package()
