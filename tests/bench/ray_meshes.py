"""Dumps a mesh for embree_bench: python ray_meshes.py NAME FILE. The names are the keys of MESHES.

The world-space triangles of everything that renders, moved and scaled so that their bounding box
has its centre at the origin and half its diagonal is 1. Layout of the file:
engine/core/bench/ray_sets.h.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SCENES = HERE.parents[2] / "shared" / "scenes"
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "cycles")]

LAMP = (-3.0, -1.5, 3.0)
OUTSIDE = ((1.9, -2.6, 1.3), (0.0, 0.0, 0.0), 0.3, LAMP)
"""Eye, target, half width of the picture at distance 1, point light."""
CLOSE = ((1.9, -2.6, 1.3), (0.0, 0.0, 0.0), 0.13, LAMP)
ROOM = ((-0.15, -0.1, 0.05), (1.0, 0.6, -0.1), 0.7, (0.1, 0.3, 0.05))
HALL = ((-0.15, -0.1, 0.05), (1.0, 0.6, -0.1), 0.7, (0.0, -0.2, 0.1))

# Name → (source, view). Source: a file of ../shared/scenes, or the subdivision level of Blender's
# monkey on a floor.
MESHES = {
    "suzanne_16k": (2, CLOSE),
    "suzanne_1M": (5, CLOSE),
    "living_room": ("living_room/living_room.blend", ROOM),
    "zdm2_level": ("zdm2_level/zdm2.blend", HALL),
    "occlusion_room": ("occlusion_room/room.blend", ROOM),
    "godot_ball": ("godot_ball/godot_ball.blend", OUTSIDE),
    "toy_car": ("ToyCar/ToyCar.gltf", OUTSIDE),
}


def dump(name: str, path: Path) -> None:
    source, view = MESHES[name]
    if isinstance(source, int):
        make_suzanne(source)
    else:
        from contact_scene import load_maker

        load_maker().load(str(SCENES / source))
    vertices, triangles = world_triangles()
    write(path, *normalised(vertices, triangles), view)


def make_suzanne(level: int) -> None:
    """The monkey, subdivided, on a floor four times its width."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_monkey_add()
    subdivision = bpy.context.object.modifiers.new("Subdivision", "SUBSURF")
    subdivision.levels = subdivision.render_levels = level
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=16, y_subdivisions=16, size=5, location=(0, 0, -1)
    )


def world_triangles() -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) float64 vertices and (m, 3) integer triangles of all meshes and instances."""
    import bpy

    points, corners, first = [], [], 0
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
        if item.object.type != "MESH" or (
            not item.is_instance and item.object.original.hide_render
        ):
            continue
        mesh = item.object.to_mesh()
        mesh.calc_loop_triangles()
        position, index = (
            np.empty(3 * len(mesh.vertices)),
            np.empty(3 * len(mesh.loop_triangles), np.int32),
        )
        mesh.vertices.foreach_get("co", position)
        mesh.loop_triangles.foreach_get("vertices", index)
        matrix = np.array(item.matrix_world)
        points.append(position.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
        corners.append(index.reshape(-1, 3) + first)
        first += len(points[-1])
        item.object.to_mesh_clear()
    return np.concatenate(points), np.concatenate(corners)


def normalised(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Finite triangles only, the bounding box round the origin with half its diagonal 1."""
    triangles = triangles[np.isfinite(vertices).all(1)[triangles].all(1)]
    used = vertices[np.unique(triangles)]
    low, high = used.min(0), used.max(0)
    return np.nan_to_num(
        (vertices - (low + high) / 2) / (np.linalg.norm(high - low) / 2)
    ), triangles


def write(path: Path, vertices: np.ndarray, triangles: np.ndarray, view) -> None:
    eye, target, half_width, light = view
    with path.open("wb") as file:
        file.write(b"GLINTRAY" + struct.pack("<QQ", len(vertices), len(triangles)))
        file.write(struct.pack("<13f", *eye, *target, 0.0, 0.0, 1.0, half_width, *light))
        file.write(vertices.astype("<f4").tobytes() + triangles.astype("<u4").tobytes())


if __name__ == "__main__":
    dump(sys.argv[1], Path(sys.argv[2]))
