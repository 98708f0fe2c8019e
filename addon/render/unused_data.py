"""What a scene holds that its picture does not need, and that was therefore not read: for the
statistics.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import bpy
import numpy as np

from ... import engine
from ..export.materials.terms import GREY
from ..export.shader_nodes.inputs import ACTIVE_COLOR

SHOWN = 4
"""Names that a line spells out before it counts the rest."""


def unused_data(depsgraph: bpy.types.Depsgraph, scene: engine.Scene) -> dict[str, str]:
    """Kind → names of what nothing reads, each with how often. About 2 µs for each object and mesh
    of the scene.

    Names are compared over the whole scene: a map that one of two meshes is read by counts as
    skipped once.
    """
    offered: dict[str, Counter] = {
        "UV maps": Counter(),
        "colour attributes": Counter(),
        "images": Counter(),
        "materials": Counter(),
    }
    reads_active = any(
        a.name.endswith(ACTIVE_COLOR)
        for g in scene.geometries
        for a in getattr(g, "attributes", ())
    )
    for block in depsgraph.ids:
        if isinstance(block, bpy.types.Mesh):
            offered["UV maps"].update(block.uv_layers.keys())
            active = block.color_attributes.render_color_index if reads_active else -1
            offered["colour attributes"].update(
                name for k, name in enumerate(block.color_attributes.keys()) if k != active
            )
        elif isinstance(block, bpy.types.Image):
            offered["images"][block.name] += 1
        elif isinstance(block, bpy.types.Material):
            offered["materials"][block.name] += 1
    read = _read(scene)
    rest = {kind: names - read[kind] for kind, names in offered.items()}
    rest["hidden objects"] = Counter(_hidden(depsgraph))
    return {kind: _listed(names) for kind, names in rest.items() if names}


def _read(scene: engine.Scene) -> dict[str, Counter]:
    """Kind → names that the exported scene holds."""
    attributes = [
        attribute
        for geometry in scene.geometries
        for attribute in getattr(geometry, "attributes", ())
    ]
    return {
        "UV maps": Counter(a.name for a in attributes if a.values.shape[1] == 2),
        "colour attributes": Counter(
            a.name.removeprefix(GREY) for a in attributes if a.values.shape[1] == 4
        ),
        "images": Counter({texture.name for texture in scene.textures}),
        "materials": Counter({material.name for material in scene.materials}),
    }


def _hidden(depsgraph: bpy.types.Depsgraph) -> Iterable[str]:
    """Names of the scene's objects that do not render."""
    objects = depsgraph.scene.objects
    flags = np.zeros(len(objects), bool)
    objects.foreach_get("hide_render", flags)
    return [objects[int(number)].name for number in np.flatnonzero(flags)]


def _listed(names: Counter) -> str:
    """'A' (3), 'B' and 7 more."""
    texts = [f"'{name}'" + (f" ({count})" if count > 1 else "") for name, count in names.items()]
    shown = ", ".join(texts[:SHOWN])
    return f"{shown} and {len(texts) - SHOWN} more" if len(texts) > SHOWN else shown
