"""Files that commands open, and what of them Blender would run or add to a picture."""

from __future__ import annotations

from pathlib import Path

import bpy


def open_blend(path: Path, *, scripts: bool | None) -> None:
    """Open a .blend file in place of the one that is open. scripts: whether its scripts and drivers
    run; None: as Blender is set. Raises RuntimeError with Blender's message.
    """
    asked = {} if scripts is None else {"use_scripts": scripts}
    bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False, **asked)


def unrun() -> list[str]:
    """A line about a script or driver of the opened file that did not run; none where all did."""
    if not bpy.app.autoexec_fail:
        return []
    return [
        f"the file's {bpy.app.autoexec_fail_message} did not run, nor others of its kind: add "
        "--scripts where you trust the file"
    ]


def composites(scene: bpy.types.Scene) -> bool:
    """Whether a render of the scene runs compositor nodes."""
    if not scene.render.use_compositing:
        return False
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group is not None
    return scene.use_nodes and scene.node_tree is not None


def has_strips(scene: bpy.types.Scene) -> bool:
    """Whether a render of the scene renders strips in its place."""
    editor = scene.sequence_editor
    if editor is None or not scene.render.use_sequencer:
        return False
    strips = editor.strips if hasattr(editor, "strips") else editor.sequences
    return any(strip.type != "SOUND" and not strip.mute for strip in strips)
