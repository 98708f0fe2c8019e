"""Explain Pixel: click on a pixel in the viewport or the image editor; its rays are told with the notes' terms in numbers.

Blender reads the operators' annotations as they are, so this module must not make them strings.
"""

from typing import TYPE_CHECKING

import bpy
from bpy.props import IntProperty

from ..addon import viewport
from ..engine import PixelExplainer, Scene, SceneError, Settings, explanation_lines
from ..engine.fingerprint import value_fingerprint
from .scene_copy import read_job

if TYPE_CHECKING:
    from ..engine import Ray

_explained: list[str] = []
"""The last explanation of this session, line by line."""

_ready: dict[str, PixelExplainer] = {}
"""The explainer of the last scene by the fingerprint of all it depends on: further clicks need no new tree."""

_TABS = 4
"""Spaces of the text that one level of the panel stands for, at most."""


def explain_render(scene: bpy.types.Scene, view_layer: str, x: int, y: int) -> "Ray":
    """The rays of pixel (x, y) of the full frame of a final render, from the bottom left. Raises RuntimeError where Blender cannot render
    the scene, SceneError for a pixel outside."""
    job = read_job(scene, view_layer)
    return _explainer(job.scene, job.settings).pixel(x, y)


def explain_view(region: bpy.types.Region, x: int, y: int) -> "Ray":
    """The rays under a point of a 3D view in Rendered shading. Raises RuntimeError where Glint shows nothing there."""
    picked = viewport.pixel_at(region, x, y)
    if picked is None:
        raise RuntimeError("Glint shows nothing here: turn to Rendered shading and click inside the picture")
    return _explainer(picked.scene, picked.settings).pixel(*picked.pixel)


def _explainer(scene: Scene, settings: Settings) -> PixelExplainer:
    key = value_fingerprint((scene, settings))
    if key not in _ready:
        made = PixelExplainer(scene, settings)
        _ready.clear()
        _ready[key] = made
    return _ready[key]


class GLINT_OT_explain_pixel(bpy.types.Operator):
    """Click on a pixel: its rays with hit points, normals, every light's terms, shadows and their blockers, mirrors and refraction"""

    bl_idname = "glint.explain_pixel"
    bl_label = "Explain Pixel"

    x: IntProperty(name="X", description="In a 3D view a point of the region; in an image editor a pixel of the picture", default=0)
    y: IntProperty(name="Y", description="From the bottom", default=0)

    @classmethod
    def poll(cls, context):
        return context.engine == "GLINT" and context.area is not None and context.area.type in ("VIEW_3D", "IMAGE_EDITOR")

    def invoke(self, context, event):
        context.window.cursor_modal_set("EYEDROPPER")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type in ("ESC", "RIGHTMOUSE"):
            context.window.cursor_modal_restore()
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"RUNNING_MODAL"}
        context.window.cursor_modal_restore()
        region = next((region for region in context.area.regions if region.type == "WINDOW"), None)
        self.x, self.y = _point(context, region, event.mouse_x - region.x, event.mouse_y - region.y)
        result = self.execute(context)
        if result == {"FINISHED"}:
            context.window_manager.popup_menu(_draw_popup, title="Explain Pixel", icon="EYEDROPPER")
        return result

    def execute(self, context):
        try:
            _explained[:] = explanation_lines(_explain(context, self.x, self.y))
        except (RuntimeError, SceneError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        for area in context.screen.areas:
            area.tag_redraw()
        return {"FINISHED"}


class GLINT_OT_copy_explanation(bpy.types.Operator):
    """Copy the explanation of the last pixel to the clipboard"""

    bl_idname = "glint.copy_explanation"
    bl_label = "Copy as Text"

    @classmethod
    def poll(cls, context):
        return bool(_explained)

    def execute(self, context):
        context.window_manager.clipboard = "\n".join(_explained)
        return {"FINISHED"}


def _explain(context: bpy.types.Context, x: int, y: int) -> "Ray":
    if context.area.type == "IMAGE_EDITOR":
        return explain_render(context.scene, context.view_layer.name, x, y)
    region = next(region for region in context.area.regions if region.type == "WINDOW")
    return explain_view(context.region if context.region and context.region.type == "WINDOW" else region, x, y)


def _point(context: bpy.types.Context, region: bpy.types.Region, x: int, y: int) -> tuple[int, int]:
    """What the operator's properties are for a point of a region."""
    if context.area.type == "VIEW_3D":
        return x, y
    u, v = region.view2d.region_to_view(x, y)
    image = context.space_data.image
    width, height = image.size if image is not None and image.size[0] > 0 else (1, 1)
    return int(u * width), int(v * height)


def _draw_lines(layout: bpy.types.UILayout) -> None:
    column = layout.column(align=True)
    for line in _explained:
        text = line.lstrip(" ")
        column.label(text=" " * min(len(line) - len(text), 4 * _TABS) + text)


def _draw_popup(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    _draw_lines(self.layout)
    self.layout.operator(GLINT_OT_copy_explanation.bl_idname, icon="COPYDOWN")


class _ExplainPanel:
    bl_label = "Explain Pixel"
    bl_region_type = "UI"
    bl_category = "Glint"

    @classmethod
    def poll(cls, context):
        return context.engine == "GLINT"

    def draw(self, context):
        row = self.layout.row(align=True)
        row.operator(GLINT_OT_explain_pixel.bl_idname, icon="EYEDROPPER")
        row.operator(GLINT_OT_copy_explanation.bl_idname, text="", icon="COPYDOWN")
        _draw_lines(self.layout)


class GLINT_VIEW3D_PT_explain_pixel(_ExplainPanel, bpy.types.Panel):
    bl_space_type = "VIEW_3D"


class GLINT_IMAGE_PT_explain_pixel(_ExplainPanel, bpy.types.Panel):
    bl_space_type = "IMAGE_EDITOR"


_CLASSES = (GLINT_OT_explain_pixel, GLINT_OT_copy_explanation, GLINT_VIEW3D_PT_explain_pixel, GLINT_IMAGE_PT_explain_pixel)

register, unregister = bpy.utils.register_classes_factory(_CLASSES)
