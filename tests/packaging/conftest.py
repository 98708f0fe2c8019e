"""Fixtures of the packaging tests: the two zips, and a Blender with one of them installed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from blender_process import ROOT, Blender

sys.path.insert(0, str(ROOT / "packaging"))

import extension_zips
import tree

INSTALL = """
import sys
bpy.ops.extensions.package_install_files(filepath=sys.argv[-1], repo="user_default", enable_on_install=True, overwrite=True)
bpy.ops.wm.save_userpref()
answer(sorted(bpy.context.preferences.addons.keys()))
"""

ENABLE = """
import sys
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.glint")
# The environment of the tests has the core too: only what the extension brought may be found.
sys.path[:] = [path for path in sys.path if str(FOLDER) in path or not (pathlib.Path(path) / "glint_core").is_dir()]
"""


def pack(edition: str) -> Path:
    """The zip of an edition in dist/, made when out of date."""
    import bpy

    blender = tree.blender(".".join(map(str, bpy.app.version)))
    return {"full": extension_zips.full_zip, "python": extension_zips.python_zip}[edition](blender)


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Blender]:
    """Edition → a Blender in which that zip is installed, as a user would."""
    made: dict[str, Blender] = {}

    def install(edition: str) -> Blender:
        if edition not in made:
            blender = Blender(tmp_path_factory.mktemp(edition))
            zip_path = blender.folder / "glint.zip"
            zip_path.write_bytes(pack(edition).read_bytes())
            run = blender.run(INSTALL, "--", blender.inside(zip_path))
            assert run.returncode == 0, run.output
            assert "bl_ext.user_default.glint" in run.answer, run.output
            made[edition] = blender
        return made[edition]

    return install
