"""The zips of this tree, and what a program starts with to install or enable one."""

from __future__ import annotations

import fcntl
import sys
from pathlib import Path

from blender_process import ROOT

sys.path.insert(0, str(ROOT / "packaging"))

import bill_of_materials
import extension_zips
import foreign
import manual
import messages
import release
import tree

__all__ = [
    "bill_of_materials",
    "extension_zips",
    "foreign",
    "manual",
    "messages",
    "release",
    "tree",
]
"""Scripts of packaging/, for the tests beside this file."""

INSTALL = """
import sys
bpy.ops.extensions.package_install_files(filepath=sys.argv[-1], repo="user_default", enable_on_install=True, overwrite=True)
bpy.ops.wm.save_userpref()
answer(sorted(bpy.context.preferences.addons.keys()))
"""  # noqa: E501 - a script for another Blender

ENABLE = """
import sys
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.glint")
# The environment of the tests has the core too: only what the extension brought may be found.
sys.path[:] = [path for path in sys.path if str(FOLDER) in path or not (pathlib.Path(path) / "glint_core").is_dir()]
"""  # noqa: E501 - a script for another Blender


def pack(edition: str) -> Path:
    """The zip of an edition in dist/, made when out of date, by one process at a time."""
    make = {"full": extension_zips.full_zip, "python": extension_zips.python_zip}[edition]
    tree.BUILD.mkdir(exist_ok=True)
    with (tree.BUILD / "pack.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return make(blender())


def make_repository(folder: Path) -> None:
    """Make a folder of zips an extension repository."""
    release.index(blender(), folder)


def blender() -> tree.Blender:
    import bpy

    return tree.blender(".".join(map(str, bpy.app.version)))
