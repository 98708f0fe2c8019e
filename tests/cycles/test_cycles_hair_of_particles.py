"""Hair of particles beside Cycles: what strands cover in final renders, and where instances carry
them, curves too.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from test_cycles_hair import SIZE, near_edges, strand_field


def furry_ball():
    """Particle hair with children on a ball, which hides what is behind."""
    scene = cycles.empty_scene(*SIZE)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
    ball = bpy.context.object
    ball.scale, ball.rotation_euler = (1.0, 1.2, 0.9), (0.3, 0.2, 0.1)
    bpy.ops.object.particle_system_add()
    hair = ball.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length, hair.render_type = "HAIR", 150, 0.6, "PATH"
    hair.child_type, hair.rendered_child_count, hair.child_percent = "INTERPOLATED", 8, 3
    hair.radius_scale, hair.roughness_2 = 0.03, 0.08
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0, -5, 1.2), (1.34, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.cycles_curves.shape = "THICK"
    return scene


class _Exported(bpy.types.RenderEngine):
    """Keeps the film that Glint traces of what a final render is given: its count of children."""

    bl_idname, bl_label, bl_use_preview = "GLINT_TEST_HAIR", "Hair", False

    def update(self, data, depsgraph):
        from glint.addon.export import export_scene
        from glint.engine import Settings, render

        scene = export_scene(depsgraph).scene
        settings = Settings(samples=1, passes=frozenset({"Depth"}))
        type(self).segments = sum(len(getattr(g, "starts", ())) for g in scene.geometries)
        type(self).depth = render(scene, settings).passes["Depth"][..., 0]

    def render(self, depsgraph):
        pass


def check_final_cover(scene) -> None:
    """A final render sees the same things at the same depths as Cycles."""
    truth = cycles.render_cycles(scene)["Depth"]
    bpy.utils.register_class(_Exported)
    try:
        scene.render.engine = _Exported.bl_idname
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(_Exported)
    mine = _Exported.depth
    covered, seen = truth < 1e5, mine < 1e5
    other = (covered != seen) | (covered & seen & (np.abs(truth - mine) > 0.02))
    clear = ~(near_edges(np.where(covered, truth, 1e5)) | near_edges(np.where(seen, mine, 1e5)))
    assert 0.1 < covered.mean() < 0.9
    assert (other & clear).mean() <= 0.01
    assert (covered != seen).mean() <= 0.015


def test_a_furry_ball_covers_the_same_pixels():
    """With the render's children, which are more than the viewport's."""
    check_final_cover(furry_ball())
    assert _Exported.segments > 150 * 8 * 4


def carried_by_collections(thing) -> None:
    """Three turned instances of a collection, one of them mirrored and flattened."""
    scene, inside = bpy.context.scene, bpy.data.collections.new("Inside")
    inside.objects.link(thing)
    for k in range(3):
        carrier = bpy.data.objects.new("Carrier", None)
        carrier.instance_type, carrier.instance_collection = "COLLECTION", inside
        carrier.location, carrier.rotation_euler = (1.3 * k - 1.3, 0, 0.2 * k), (0, 0, k)
        carrier.scale = (1, 1, 1) if k < 2 else (-1, 1, 0.7)
        scene.collection.objects.link(carrier)


def carried_by_vertices(thing) -> None:
    """At the vertices of a mesh."""
    data = bpy.data.meshes.new("Carrier")
    data.from_pydata([(-1.2, 0, 0), (0, 0, 0.3), (1.2, 0, 0)], [], [])
    carrier = bpy.data.objects.new("Carrier", data)
    bpy.context.scene.collection.objects.link(carrier)
    bpy.context.scene.collection.objects.link(thing)
    thing.parent, carrier.instance_type = carrier, "VERTS"


@pytest.mark.parametrize("carry", [carried_by_collections, carried_by_vertices])
@pytest.mark.parametrize("kind", ["curves", "particles"])
def test_instances_carry_their_hair(kind, carry):
    if kind == "curves":
        scene, thing = strand_field(60, 6, 0.02, spread=0.3)
    else:
        scene = furry_ball()
        (thing,) = (one for one in scene.objects if one.type == "MESH")
        thing.scale, thing.particle_systems[0].settings.count = (0.3, 0.36, 0.27), 40
    for collection in thing.users_collection:
        collection.objects.unlink(thing)
    carry(thing)
    check_final_cover(scene)
