"""Materials that were edited, in a scene that is known: then they alone are read anew.

Blender lists everything that uses such a material as shaded anew, as it does with an object whose
visibility changed: its flags tell.
"""

from __future__ import annotations

from typing import Any

from ..materials.graph import node_tree

_USERS = {"OBJECT", "MESH", "CURVE", "META", "POINTCLOUD"}


def edited_materials(updates: list[Any]) -> dict[int, Any]:
    """Session uid → evaluated material of `depsgraph.updates`; empty where these tell of more than
    materials and what uses them.
    """
    materials: dict[int, Any] = {}
    trees: set[int] = set()
    for update in updates:
        block, kind = update.id, update.id.id_type
        if kind == "MATERIAL":
            materials[block.original.session_uid] = block
        elif kind == "NODETREE":
            trees.add(block.original.as_pointer())
        elif kind not in _USERS or update.is_updated_geometry or update.is_updated_transform:
            return {}
    own = {
        tree.as_pointer()
        for tree in (node_tree(material.original) for material in materials.values())
        if tree is not None
    }
    return materials if trees <= own else {}
