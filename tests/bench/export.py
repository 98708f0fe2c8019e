"""How long the export takes: a million triangles, a hundred thousand instances by geometry nodes,
two thousand lamps, a hundred thousand smooth curves, and four images of 4096 × 4096 pixels.

    python tests/bench/export.py

Processor time, the least of five exports; Blender works the mesh's normals and triangles out anew
before each.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS), str(TESTS / "blender")]

import glint_tree  # noqa: E402, F401  (the tree as the package `glint`)


def main() -> None:
    import bpy

    for name, build in (
        ("1 M triangles", grid),
        ("100 k instances", instances),
        ("2000 lamps", lamps),
        ("100 k curves", curves),
        ("4 images of 4k", images),
    ):
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


def lamps():
    import bpy

    for k in range(2000):
        data = bpy.data.lights.new("lamp", "POINT")
        lamp = bpy.data.objects.new("lamp", data)
        lamp.location = k % 40, k // 40, 1
        bpy.context.scene.collection.objects.link(lamp)
    return lambda k: None


def curves():
    import bpy
    import numpy as np

    roots = np.random.default_rng(1).uniform(-4, 4, (100_000, 1, 3))
    points = roots + [[0, 0, 0], [0.03, 0, 0.15], [0.03, 0.03, 0.3]]
    data = bpy.data.hair_curves.new("meadow")
    data.add_curves([3] * len(roots))
    data.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("meadow", data))
    return lambda k: None


def images():
    """Noise in three channels of bytes."""
    import bpy
    import numpy as np

    folder, rng = Path(tempfile.mkdtemp()), np.random.default_rng(1)
    material = bpy.data.materials.new("images")
    material.use_nodes = True
    tree = material.node_tree
    shader = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    for name in ("Base Color", "Roughness", "Metallic", "IOR"):
        made = bpy.data.images.new(name, 4096, 4096)
        pixels = np.ones((4096, 4096, 4), np.float32)
        pixels[..., :3] = np.kron(rng.random((256, 256, 1)), np.ones((16, 16, 3)))
        made.pixels.foreach_set(pixels.ravel())
        made.filepath_raw, made.file_format = str(folder / f"{name}.png"), "PNG"
        made.save()
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = bpy.data.images.load(made.filepath_raw)
        tree.links.new(node.outputs["Color"], shader.inputs[name])
    bpy.context.object.data.materials.clear()
    bpy.context.object.data.materials.append(material)
    return lambda k: None


if __name__ == "__main__":
    main()
