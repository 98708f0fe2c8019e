"""The Blinn-Phong node of earlier versions, a class of its own: known so that files with it open,
and turned into today's group.

Files are carried over when they are opened, and what was appended since when they are saved; linked
materials stay as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ..export.materials.graph import FORMER_NODE, node_tree
from .nodes import OUTPUT, add_blinn_phong

_STAYS = bpy.app.version < (4, 5, 0)
"""Blender 4.2 crashes when it frees a scene that was evaluated with nodes whose class was
unregistered since (the copies for evaluation keep a pointer to it). So there the class outlives the
extension until Blender is left, and serves an extension that comes back.
"""


class GlintBlinnPhongNode(bpy.types.ShaderNodeCustomGroup):
    bl_idname = FORMER_NODE
    bl_label = "Blinn-Phong"


def _trees() -> Iterator[bpy.types.NodeTree]:
    """The shader trees of this file that may hold a Blinn-Phong node."""
    for block in (*bpy.data.materials, *bpy.data.node_groups):
        tree = block if isinstance(block, bpy.types.NodeTree) else node_tree(block)
        if tree is not None and block.library is None:
            yield tree


@bpy.app.handlers.persistent
def carry_over(*_: Any) -> None:
    """Puts marked groups where this file has nodes of the former class."""
    for tree in _trees():
        for node in [node for node in tree.nodes if node.bl_idname == FORMER_NODE]:
            _replace(tree, node)


def _replace(tree: bpy.types.NodeTree, old: bpy.types.Node) -> None:
    new = add_blinn_phong(tree)
    for name in (
        "parent",
        "location",
        "width",
        "label",
        "hide",
        "mute",
        "use_custom_color",
        "color",
        "select",
    ):
        setattr(new, name, getattr(old, name))
    for socket in old.inputs:
        if socket.name in new.inputs:
            new.inputs[socket.name].default_value = socket.default_value
    links = [
        (link.from_socket, link.to_socket)
        for link in tree.links
        if old in (link.from_node, link.to_node)
    ]
    for start, end in links:
        tree.links.new(
            new.outputs[OUTPUT] if start.node == old else start,
            new.inputs[end.name] if end.node == old else end,
        )
    name = old.name
    for curve in _curves(tree.animation_data):
        curve.data_path = curve.data_path.replace(f'nodes["{name}"]', f'nodes["{new.name}"]')
    was_active = tree.nodes.active == old
    tree.nodes.remove(old)
    new.name = name  # Blender turns the curves' paths with it.
    if was_active:
        tree.nodes.active = new


def _curves(animation: Any) -> list[Any]:
    """Drivers and the curves of the action; from 5.0 on these lie in an action's layers alone."""
    if animation is None:
        return []
    action, curves = animation.action, list(animation.drivers)
    if action is not None and bpy.app.version < (5, 0, 0):
        curves += action.fcurves
    elif action is not None:
        curves += [
            curve
            for layer in action.layers
            for strip in layer.strips
            for bag in strip.channelbags
            for curve in bag.fcurves
        ]
    return curves


_HANDLERS = (bpy.app.handlers.load_post, bpy.app.handlers.save_pre)


def register() -> None:
    if not (_STAYS and bpy.types.Node.bl_rna_get_subclass_py(FORMER_NODE)):
        bpy.utils.register_class(GlintBlinnPhongNode)
    for handlers in _HANDLERS:
        handlers.append(carry_over)


def unregister() -> None:
    for handlers in _HANDLERS:
        handlers.remove(carry_over)
    if not _STAYS:
        bpy.utils.unregister_class(GlintBlinnPhongNode)
