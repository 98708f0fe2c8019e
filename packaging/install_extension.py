"""Installs an extension zip as a user would, into a folder of settings of its own. Runs in bpy or `blender -b`, where
BLENDER_USER_RESOURCES already names that folder."""

from __future__ import annotations

from pathlib import Path

import tree


def install(zip_path: Path, resources: Path) -> None:
    """Install and enable the zip; only enables it when exactly this one is there already. Raises Failure."""
    import bpy

    mark = tree.fingerprint([zip_path])
    stamp = resources / "glint-installed"
    if tree.is_current(stamp, mark):
        bpy.ops.preferences.addon_enable(module="bl_ext.user_default.glint")
    else:
        bpy.ops.extensions.package_install_files(
            filepath=str(zip_path), repo="user_default", enable_on_install=True, overwrite=True
        )
        bpy.ops.wm.save_userpref()
        tree.write_stamp(stamp, mark)
    if "bl_ext.user_default.glint" not in bpy.context.preferences.addons:
        raise tree.Failure(f"Blender did not enable the extension of {zip_path}; its messages are above.")
