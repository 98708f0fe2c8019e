"""Which passes of a view layer compositors take: the linked outputs of their Render Layers
nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

_BLENDERS = {"Image", "Alpha", "Freestyle", "Grease Pencil", "GreasePencil"}
"""Outputs that are no pass of the engine; 5.0 renamed one."""


def linked_outputs(scene: bpy.types.Scene, layer: str) -> dict[str, str]:
    """Names of passes of a view layer that a compositor of the file takes, and of the first node
    that takes each.
    """
    found: dict[str, str] = {}
    for tree in filter(None, map(_compositor, bpy.data.scenes)):
        for node in _render_layers(tree):
            if node.scene == scene and node.layer == layer:
                for output in node.outputs:
                    if any(not link.is_muted for link in output.links):
                        found.setdefault(output.name, node.name)
    return {name: node for name, node in found.items() if name not in _BLENDERS}


def runs_afterwards(scene: bpy.types.Scene) -> bool:
    """Whether people see something else than what the engine draws."""
    return _compositor(scene) is not None or any(_shown_strips(scene))


def _shown_strips(scene: bpy.types.Scene) -> Iterator[bool]:
    """Whether each strip of the sequencer is in the picture; a new scene has an editor without
    any.
    """
    editor = scene.sequence_editor if scene.render.use_sequencer else None
    if editor is not None:
        # called strips since Blender 4.4
        for strip in getattr(editor, "strips", None) or getattr(editor, "sequences", ()):
            yield strip.type != "SOUND" and not strip.mute


def _compositor(scene: bpy.types.Scene) -> Any:
    """The node tree that a render of the scene runs; None where it runs none."""
    if not scene.render.use_compositing:
        return None
    if hasattr(scene, "compositing_node_group"):
        return scene.compositing_node_group
    return scene.node_tree if scene.use_nodes else None


def _render_layers(tree: Any) -> Iterator[Any]:
    """The Render Layers nodes of a tree and of the groups in it."""
    for node in tree.nodes:
        if node.mute:
            continue
        if node.type == "R_LAYERS":
            yield node
        elif node.type == "GROUP" and node.node_tree is not None:
            yield from _render_layers(node.node_tree)
