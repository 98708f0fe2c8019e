"""Installs an extension zip as a user would, into a folder of settings of its own. Runs in bpy or
`blender -b`, where BLENDER_USER_RESOURCES already names that folder.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import tree

MODULE = "bl_ext.user_default.glint"


def make_way(zip_path: Path, resources: Path) -> None:
    """Empty the folder unless this very zip is installed there: Blender keeps an old wheel when the
    version is the same.
    """
    if not tree.is_current(_stamp(resources), tree.fingerprint([zip_path])):
        shutil.rmtree(resources, ignore_errors=True)
    resources.mkdir(parents=True, exist_ok=True)


def install(zip_path: Path) -> None:
    """Install and enable the zip; only enable it when this very one is there already. Raises
    SetupError.
    """
    import bpy

    resources = Path(os.environ["BLENDER_USER_RESOURCES"])
    mark = tree.fingerprint([zip_path])
    if tree.is_current(_stamp(resources), mark):
        bpy.ops.preferences.addon_enable(module=MODULE)
    else:
        options = {"repo": "user_default", "enable_on_install": True, "overwrite": True}
        bpy.ops.extensions.package_install_files(filepath=str(zip_path), **options)
        bpy.ops.wm.save_userpref()
        tree.write_stamp(_stamp(resources), mark)
    if MODULE not in bpy.context.preferences.addons:
        raise tree.SetupError(
            f"Blender did not enable the extension of {zip_path}; its messages are above."
        )


def _stamp(resources: Path) -> Path:
    return resources / "glint-installed"
