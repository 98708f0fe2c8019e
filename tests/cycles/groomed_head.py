"""A head of hair as grooming artists make it: node groups that Blender ships with, one after the
other, on the monkey.
"""

from __future__ import annotations

from pathlib import Path

import cycles_reference as cycles
import small_scenes as build
from cycles_reference import bpy

LIBRARY = "procedural_hair_node_assets.blend"
GROOM: tuple[tuple[str, dict], ...] = (
    ("Generate Hair Curves", {"Hair Length": 0.45, "Control Points": 8, "Density": 60.0}),
    ("Interpolate Hair Curves", {"Density": 2500.0, "Interpolation Guides": 3}),
    ("Trim Hair Curves", {"Replace Length": False, "Length Factor": 0.9, "Random Offset": 0.2}),
    ("Clump Hair Curves", {"Factor": 0.6, "Tip Spread": 0.02, "Guide Distance": 0.12}),
    ("Curl Hair Curves", {"Factor": 0.7, "Radius": 0.02, "Frequency": 5.0, "Subdivision": 2}),
    ("Hair Curves Noise", {"Distance": 0.03, "Scale": 3.0}),
    ("Frizz Hair Curves", {"Distance": 0.008}),
    ("Set Hair Curve Profile", {"Radius": 0.004, "Shape": 0.4}),
)


def library() -> Path | None:
    """Blender's own assets of hair; None where it comes without."""
    assets = Path(bpy.utils.system_resource("DATAFILES")) / "assets"
    return next(iter(sorted(assets.rglob(LIBRARY))), None)


def groomed_head(width: int, height: int):
    """The scene, the head and its hair, before a camera in the sun."""
    scene = cycles.empty_scene(width, height)
    bpy.ops.mesh.primitive_monkey_add()
    head = bpy.context.object
    head.data.materials.append(build.lambert((0.6, 0.4, 0.3)))
    head.modifiers.new("Subdivide", "SUBSURF").render_levels = 1
    curves = bpy.data.hair_curves.new("Hair")
    curves.surface, curves.surface_uv_map = head, head.data.uv_layers[0].name
    hair = build.add(scene, "Hair", curves)
    hair.parent = head
    brown = build.lambert((0.25, 0.12, 0.05))
    curves.materials.append(brown)
    names = [name for name, _ in GROOM]
    with bpy.data.libraries.load(str(library())) as (_, here):
        here.node_groups = list(names)
    groups = {group.name: group for group in here.node_groups}
    for name, values in GROOM:
        modifier = hair.modifiers.new(name, "NODES")
        modifier.node_group = groups[name]
        given = dict(values)
        for item in groups[name].interface.items_tree:
            if item.item_type != "SOCKET" or item.in_out != "INPUT":
                continue
            if item.socket_type == "NodeSocketObject":
                modifier[item.identifier] = head
            elif item.socket_type == "NodeSocketMaterial":
                modifier[item.identifier] = brown
            elif item.name == "Surface UV Map":
                modifier[f"{item.identifier}_use_attribute"] = True
                modifier[f"{item.identifier}_attribute_name"] = curves.surface_uv_map
            elif item.name in given:
                modifier[item.identifier] = given.pop(item.name)
        assert not given, (name, given)
    build.add_camera(scene, (1.6, -5.0, 1.4), (0, 0, 0.1), lens=60)
    build.add_light(scene, "SUN", (2.0, -3.0, 4.0), energy=3.0, angle=0.0)
    scene.cycles_curves.shape = "THICK"
    bpy.context.view_layer.update()
    return scene, head, hair
