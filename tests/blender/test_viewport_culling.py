"""What Simplify leaves out of 3D views: through the camera what it leaves out of renders."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

from export_support import link, quad, scene  # noqa: F401
from glint.addon.export import export_scene
from glint.addon.export.sync.incremental import NO_CAMERA, LiveExport
from glint.addon.viewport.view import culling_of

SPACE = SimpleNamespace(use_local_camera=False)
LOOKING = {
    "camera": SimpleNamespace(view_perspective="CAMERA"),
    "free": SimpleNamespace(view_perspective="PERSP"),
}


@pytest.fixture
def row(scene):  # noqa: F811
    """Squares before the camera, beside its frame, and far away, all of which may be culled."""
    camera = link(bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye")))
    scene.camera = camera
    for name, place in (("ahead", (0, 0, -5)), ("beside", (30, 0, -5)), ("far", (0, 0, -50))):
        thing = quad(name)
        thing.location = place
        thing.cycles.use_camera_cull = name != "far"
        thing.cycles.use_distance_cull = name == "far"
    scene.render.use_simplify = True
    scene.cycles.use_camera_cull = scene.cycles.use_distance_cull = True
    scene.cycles.distance_cull_margin = 20.0
    bpy.context.view_layer.update()
    return scene


def shown(live: LiveExport, looking: str) -> tuple[set[str], tuple[str, ...]]:
    """What a view shows after Blender's updates, and what of culling it tells."""

    def hear(_scene, depsgraph) -> None:
        live.apply_updates(depsgraph)

    bpy.app.handlers.depsgraph_update_post.append(hear)
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_post.remove(hear)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    culling = culling_of(SPACE, LOOKING[looking], depsgraph)
    found = live.scene(depsgraph, NO_CAMERA, culling=culling)
    notes = tuple(note for note in live.notes(culling=culling) if "culling" in note)
    return {block.name for block in found.instances}, notes


def test_views_through_the_camera_show_what_the_render_does(row):
    live = LiveExport()
    names, notes = shown(live, "camera")
    rendered = export_scene(bpy.context.evaluated_depsgraph_get()).scene
    assert names == {block.name for block in rendered.instances} == {"ahead"}
    assert notes == ()
    everything, notes = shown(live, "free")
    assert everything == {"ahead", "beside", "far"}
    assert len(notes) == 1 and "this one shows all objects" in notes[0]
    row.render.use_multiview = True
    assert shown(live, "camera") == (everything, ())


def test_what_comes_into_view_is_there(row):
    """And what leaves it is not, as things move, and the camera; meshes that were there are not
    read again.
    """
    live = LiveExport()
    shown(live, "camera")
    bpy.data.objects["ahead"].location = (0, 40, -5)
    assert shown(live, "camera")[0] == set()
    bpy.data.objects["ahead"].location = (0, 0, -5)
    assert shown(live, "camera")[0] == {"ahead"}
    bpy.data.objects["beside"].location = (1, 0, -5)
    assert shown(live, "camera")[0] == {"ahead", "beside"}
    assert live.work["meshes"] == 1
    bpy.data.objects["far"].location = (0, 0, -5)
    bpy.data.objects["ahead"].location = (0, 40, -5)
    assert shown(live, "camera")[0] == {"beside", "far"}
    row.camera.rotation_euler = (0, 3.0, 0)
    assert shown(live, "camera")[0] == {"far"}
    row.camera.rotation_euler = (0, 0, 0)
    row.cycles.distance_cull_margin = 1.0
    row.update_tag()
    assert shown(live, "camera")[0] == {"beside"}


def test_equal_views_are_told_apart_by_what_they_cull(row):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    first, same = (culling_of(SPACE, LOOKING["camera"], depsgraph) for _ in range(2))
    assert first == same and hash(first) == hash(same)
    assert culling_of(SPACE, LOOKING["free"], depsgraph) is None
    row.camera.location.x = 1.0
    bpy.context.view_layer.update()
    moved = culling_of(SPACE, LOOKING["camera"], bpy.context.evaluated_depsgraph_get())
    assert moved is not None and moved != first
