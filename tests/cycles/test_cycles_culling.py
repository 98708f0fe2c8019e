"""What Simplify's culling leaves out, beside Cycles: which glowing objects light a sheet before the
camera.
"""

from __future__ import annotations

import numpy as np
import pytest

import cycles_reference as cycles
from cycles_reference import bpy
from glint.addon.export import export_scene
from glint.addon.export.culling import Culling
from glint.addon.export.keys import moved, read_pose
from glint.addon.export.report import Report

SEEN = {
    "perspective": {"shift_x": 0.2, "lens": 40.0, "clip_start": 0.5, "clip_end": 60.0},
    "parallel": {"type": "ORTHO", "ortho_scale": 5.0, "shift_y": -0.1},
    "border": {"lens": 30.0},
    "near clip": {"clip_start": 4.0, "clip_end": 30.0, "lens": 90.0},
}
CULLED = {
    "camera": {"use_camera_cull": True},
    "distance": {"use_distance_cull": True},
    "both": {"use_camera_cull": True, "use_distance_cull": True},
}


def sheet_and_boxes(seen: str, culled: str, count: int) -> tuple:
    """Boxes of all sizes round a camera, most of which may be culled in some way; the sheet is lit
    from either side.
    """
    scene = cycles.empty_scene(16, 8)
    rng = np.random.default_rng(len(seen) + 7 * len(culled))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (1, -2, 0.5), (1.3, 0.2, 0.4)
    scene.collection.objects.link(camera)
    scene.camera = camera
    for name, value in SEEN[seen].items():
        setattr(camera.data, name, value)
    bpy.context.view_layer.update()
    bpy.ops.mesh.primitive_plane_add(size=0.4)
    sheet = bpy.context.object
    sheet.matrix_world = camera.matrix_world.copy()
    at = np.array(camera.matrix_world)
    sheet.location = at[:3, 3] - 5 * at[:3, 2]
    matt = bpy.data.materials.new("Matt")
    cycles.use_nodes(matt)
    nodes, links = matt.node_tree.nodes, matt.node_tree.links
    nodes.clear()
    both = nodes.new("ShaderNodeAddShader")
    for k, shader in enumerate(("ShaderNodeBsdfDiffuse", "ShaderNodeBsdfTranslucent")):
        links.new(nodes.new(shader).outputs[0], both.inputs[k])
    links.new(both.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    sheet.data.materials.append(matt)
    glow = bpy.data.materials.new("Glow")
    cycles.use_nodes(glow)
    nodes, links = glow.node_tree.nodes, glow.node_tree.links
    nodes.clear()
    shader = nodes.new("ShaderNodeEmission")
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
    shader.inputs["Strength"].default_value = 50.0
    boxes = []
    for k in range(count):
        bpy.ops.mesh.primitive_cube_add(size=1)
        box = bpy.context.object
        box.name, box.visible_camera = f"Box {k}", False
        box.location = rng.uniform(-9, 9, 3)
        box.rotation_euler, box.scale = rng.uniform(-3, 3, 3), rng.uniform(0.3, 3, 3)
        box.cycles.use_camera_cull = k % 4 != 3
        box.cycles.use_distance_cull = k % 4 != 2
        box.data.materials.append(glow)
        boxes.append(box)
    scene.render.use_border = scene.render.use_crop_to_border = seen == "border"
    scene.render.border_min_x, scene.render.border_max_x = 0.45, 0.75
    scene.render.use_simplify = True
    scene.cycles.camera_cull_margin, scene.cycles.distance_cull_margin = 0.3, 7.0
    for name, value in CULLED[culled].items():
        setattr(scene.cycles, name, value)
    cycles.make_exact(scene, 16)
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    return scene, boxes


@pytest.mark.parametrize("seen", SEEN)
@pytest.mark.parametrize("culled", CULLED)
def test_the_same_boxes_are_left_out(seen, culled):
    scene, boxes = sheet_and_boxes(seen, culled, 24)
    found = export_scene(bpy.context.evaluated_depsgraph_get())
    mine = {block.name for block in found.scene.instances}
    assert not [note for note in found.notes if "ull" in note]
    theirs = set()
    for box in boxes:
        for other in boxes:
            other.hide_render = other is not box
        if cycles.render_passes(scene)["Combined"][..., :3].sum() > 0:
            theirs.add(box.name)
    names = {box.name for box in boxes}
    assert 3 <= len(theirs) <= len(boxes) - 3
    assert mine & names == theirs


def test_instances_are_culled_one_by_one():
    """Nothing of a geometry is in the scene of which no instance is left."""
    scene, (box,) = sheet_and_boxes("perspective", "distance", 1)
    made = bpy.data.collections.new("Made")
    made.objects.link(box)
    scene.collection.objects.unlink(box)
    box.location, box.cycles.use_distance_cull = (0, 0, 0), True
    for x in (0, 4, 40, 50):
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", made
        empty.location = (x, 0, 0)
        scene.collection.objects.link(empty)
    found = export_scene(bpy.context.evaluated_depsgraph_get()).scene
    at = [m[0, 3] for b in found.instances if b.name == box.name for m in b.world_from_object]
    assert sorted(at) == [0, 4]
    box.location, scene.cycles.distance_cull_margin = (0, 0, 30), 20.0
    scene.update_tag()
    found = export_scene(bpy.context.evaluated_depsgraph_get()).scene
    assert box.name not in [b.name for b in found.instances]
    assert len(found.geometries) == 1
    scene.cycles.distance_cull_margin = 0.0  # none, as in Cycles
    scene.update_tag()
    found = export_scene(bpy.context.evaluated_depsgraph_get()).scene
    assert len([b for b in found.instances if b.name == box.name]) == 4


def test_what_is_left_moves_while_the_shutter_is_open():
    scene, (box, _, _) = sheet_and_boxes("perspective", "distance", 3)
    made = bpy.data.collections.new("Made")
    made.objects.link(box)
    scene.collection.objects.unlink(box)
    box.location = (0, 0, 0)
    for x in (50, 4, 40, 0):
        empty = bpy.data.objects.new("Empty", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", made
        empty.location = (x, 0, 0)
        scene.collection.objects.link(empty)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = export_scene(depsgraph).scene
    culling = Culling.of(depsgraph.scene_eval, found.camera)
    here, before = read_pose(depsgraph, culling=culling), read_pose(depsgraph)
    box.location = (0, 0, 1)
    after = read_pose(bpy.context.evaluated_depsgraph_get())
    blurred = moved(found, here, [before, before, after], Report())
    ways = [b.motion for b in blurred.instances if b.name == box.name]
    assert sorted(way[0, 0, 0, 3] for way in ways) == [0, 4]
    assert all((way[2, 0, :, 3] - way[0, 0, :, 3] == [0, 0, 1]).all() for way in ways)
