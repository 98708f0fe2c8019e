"""The demo scene: built by data alone, twice the same, and holding what it promises to show."""

import ast
import hashlib
from pathlib import Path

import numpy as np

import cycles_reference as cycles
from cycles_reference import bpy
from glint.operators import demo_scene


def build() -> None:
    cycles.empty_scene()
    demo_scene.build_demo_scene()


def fingerprint() -> str:
    """Of all evaluated vertices and matrices."""
    digest = hashlib.sha256()
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
        digest.update(np.array(item.matrix_world, np.float32).tobytes())
        if item.object.type == "MESH":
            points = np.empty(3 * len(item.object.data.vertices), np.float32)
            item.object.data.attributes["position"].data.foreach_get("vector", points)
            digest.update(points.tobytes())
    return digest.hexdigest()


def test_it_builds_always_the_same():
    build()
    first = fingerprint()
    build()
    assert fingerprint() == first


def test_it_shows_what_it_promises():
    build()
    kinds = [item.object.type for item in bpy.context.evaluated_depsgraph_get().object_instances]
    balls = [
        item.data
        for item in bpy.data.objects
        if item.type == "MESH" and "glint_sphere" in item.data.attributes
    ]
    assert len(balls) == 12
    assert all(
        len(ball.polygons) == 96 * 48 and all(polygon.use_smooth for polygon in ball.polygons)
        for ball in balls
    )
    assert {"MESH", "LIGHT", "CAMERA"} <= set(kinds)
    lights = {light.type for light in bpy.data.lights}
    assert lights == {"SUN", "AREA", "SPOT"}
    slabs = [item for item in bpy.data.objects if item.name.startswith("Slab")]
    assert len({item.data for item in slabs}) == 1
    assert len(slabs) == 20
    assert all(image.packed_file for image in bpy.data.images if image.name.startswith("Stage"))


def test_nothing_needs_a_context():
    """No bpy.ops anywhere in its source, and nothing random."""
    tree = ast.parse(Path(demo_scene.__file__).read_text())
    dotted = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
    assert not [name for name in dotted if name.startswith("bpy.ops") or "random" in name]


def test_it_renders():
    """In Cycles, at a fifth of the size: lit, not blown out, no empty corner of the picture."""
    build()
    bpy.context.scene.render.resolution_percentage = 20
    picture = cycles.render_cycles(bpy.context.scene, 8, bounces=2)["Combined"]
    assert picture.shape == (108, 192, 4)
    assert 0.05 < picture[..., :3].mean() < 0.6
    assert (picture[..., 3] == 1).all()
