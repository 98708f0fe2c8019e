"""Glint Demo Scene, as its menu entry adds it."""

from blender_process import REGISTER_TREE, Blender


def test_it_is_seen_as_it_renders(tmp_path):
    """Through its camera, the frame in the middle of each 3D view."""
    run = Blender(tmp_path).run(
        REGISTER_TREE
        + """
bpy.ops.wm.read_homefile(use_factory_startup=True)
window = bpy.context.window_manager.windows[0]
spaces = [area.spaces.active for area in window.screen.areas if area.type == "VIEW_3D"]
for space in spaces:
    space.region_3d.view_camera_offset = (0.2, 0.1)
with bpy.context.temp_override(window=window, screen=window.screen):
    bpy.ops.glint.add_demo_scene()
views = [space.region_3d for space in spaces]
answer([window.scene.name, [[view.view_perspective, *view.view_camera_offset] for view in views]])
"""
    )
    name, views = run.answer
    assert name == "Glint Demo"
    assert views and all(view == ["CAMERA", 0.0, 0.0] for view in views)
