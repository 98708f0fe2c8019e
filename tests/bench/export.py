"""How long the export takes: a million triangles, and a hundred thousand instances by geometry
nodes.

    python tests/bench/export.py

Processor time, the least of five exports; Blender works the mesh's normals and triangles out anew
before each.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import sys
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "blender")]

import glint_tree  # noqa: E402, F401  (the tree as the package `glint`)


def main() -> None:
    import bpy

    for name, build in (("1 M triangles", grid), ("100 k instances", instances)):
        bpy.ops.wm.read_homefile(use_factory_startup=True)
        change = build()
        seconds = []
        for k in range(5):
            change(k)
            bpy.context.view_layer.update()
            seconds.append(export_seconds())
        print(f"{name:16} {min(seconds) * 1e3:6.0f} ms")


def export_seconds() -> float:
    import bpy

    from glint.addon.export import export_scene

    depsgraph = bpy.context.evaluated_depsgraph_get()
    before = time.process_time()
    export_scene(depsgraph)
    return time.process_time() - before


def grid():
    import bpy

    bpy.ops.mesh.primitive_grid_add(x_subdivisions=708, y_subdivisions=708, size=2)
    mesh = bpy.context.object.data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))

    def change(k: int) -> None:
        mesh.vertices[0].co.x = k
        mesh.update()

    return change


def instances():
    from test_export_instances import scatter

    scatter(100_000)
    return lambda k: None


if __name__ == "__main__":
    main()
