"""File → New scene with Glint's demo in it."""

from __future__ import annotations

import bpy

from .after_previews import AfterPreviews
from .demo_scene import build_demo_scene

_WHOLE_FRAME = 0.0
"""Zoom at which a view shows all of a camera's frame and a little beside it."""


class GLINT_OT_add_demo_scene(AfterPreviews, bpy.types.Operator):
    """Add a new scene with Glint's demo: highlights, mirrors, hard and soft shadows, instances and
    a textured floor
    """

    bl_idname = "glint.add_demo_scene"
    bl_label = "Add Glint Demo Scene"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = bpy.data.scenes.new("Glint Demo")
        if context.window:
            context.window.scene = scene
        with context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            build_demo_scene()
        _look_through_camera(context.screen)
        return {"FINISHED"}


def _look_through_camera(screen: bpy.types.Screen | None) -> None:
    """In every 3D view of a screen, so that the scene is seen as it renders."""
    for area in screen.areas if screen is not None else ():
        if area.type == "VIEW_3D":
            view = area.spaces.active.region_3d
            view.view_perspective, view.view_camera_zoom = "CAMERA", _WHOLE_FRAME
            view.view_camera_offset = (0.0, 0.0)


def _draw_menu_entry(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    self.layout.operator(
        GLINT_OT_add_demo_scene.bl_idname, text="Glint Demo Scene", icon="SCENE_DATA"
    )


def register() -> None:
    bpy.utils.register_class(GLINT_OT_add_demo_scene)
    bpy.types.TOPBAR_MT_render.append(_draw_menu_entry)


def unregister() -> None:
    bpy.types.TOPBAR_MT_render.remove(_draw_menu_entry)
    bpy.utils.unregister_class(GLINT_OT_add_demo_scene)
