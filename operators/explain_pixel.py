"""Explain Pixel: click on a pixel in the viewport or the image editor; its rays are told with the
notes' terms in numbers.

Blender reads the operators' annotations as they are, so this module must not make them strings.
"""

from contextlib import suppress

import bpy
from bpy.props import IntProperty

from ..addon import viewport
from ..addon.ui.lines import draw_text
from ..engine import PixelExplainer, Ray, Scene, SceneError, Settings, explanation_lines
from ..engine.analysis.fingerprint import value_fingerprint
from .editors import in_editor
from .scene_copy import read_job

_explained: list[str] = []
"""The last explanation of this session, line by line."""

_DRAWN = 0.2
"""Seconds after which Blender has drawn a sidebar."""

_ready: dict[str, PixelExplainer] = {}
"""The explainer of the last scene by the fingerprint of all it depends on: further clicks need no
new tree.
"""

TEXT = "Explain Pixel"
"""Name of the text that an explanation becomes when somebody wants it as one."""


def explain_render(scene: bpy.types.Scene, view_layer: str, x: int, y: int) -> "Ray":
    """The rays of pixel (x, y) of the full frame of a final render, from the bottom left. Raises
    RuntimeError where Blender cannot render the scene, SceneError for a pixel outside.
    """
    job = read_job(scene, view_layer)
    return _explainer(job.scene, job.settings).pixel(x, y)


def explain_view(region: bpy.types.Region, x: int, y: int) -> "Ray":
    """The rays under a point of a 3D view in Rendered shading. Raises RuntimeError where Glint
    shows nothing there.
    """
    picked = viewport.pixel_at(region, x, y)
    if picked is None:
        raise RuntimeError(
            "Glint shows nothing here: turn to Rendered shading and click inside the picture"
        )
    return _explainer(picked.scene, picked.settings).pixel(*picked.pixel)


def _explainer(scene: Scene, settings: Settings) -> PixelExplainer:
    key = value_fingerprint((scene, settings))
    if key not in _ready:
        made = PixelExplainer(scene, settings)
        _ready.clear()
        _ready[key] = made
    return _ready[key]


class GLINT_OT_explain_pixel(bpy.types.Operator):
    """Click on a pixel to learn what lights it and what blocks its lights. The answer stands in the
    sidebar, tab Glint
    """

    bl_idname = "glint.explain_pixel"
    bl_label = "Explain Pixel"

    x: IntProperty(
        name="X",
        description="In a 3D view a point of the region; in an image editor a pixel of the picture",
        default=0,
    )
    y: IntProperty(name="Y", description="From the bottom", default=0)

    @classmethod
    def poll(cls, context):
        return (
            context.engine == "GLINT"
            and context.area is not None
            and context.area.type in ("VIEW_3D", "IMAGE_EDITOR")
        )

    def invoke(self, context, event):
        self._pressed = False
        context.window.cursor_modal_set("EYEDROPPER")
        context.workspace.status_text_set("Click on a pixel to explain it (Esc leaves)")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """The click ends with its release: what is shown before would take the release for a click
        of its own.
        """
        if event.type in ("ESC", "RIGHTMOUSE"):
            self._leave(context)
            return {"CANCELLED"}
        if event.type != "LEFTMOUSE" or not self._pressed or event.value != "RELEASE":
            self._pressed = self._pressed or (event.type == "LEFTMOUSE" and event.value == "PRESS")
            return {"RUNNING_MODAL"}
        self._leave(context)
        region = next(region for region in context.area.regions if region.type == "WINDOW")
        self.x, self.y = _point(context, region, event.mouse_x - region.x, event.mouse_y - region.y)
        result = self.execute(context)
        if result == {"FINISHED"}:
            _open_sidebar(context.area)
            self.report({"INFO"}, _explained[0])
        return result

    def cancel(self, context):
        """Blender itself ends the operator: a file is loaded, a window closes."""
        self._leave(context)

    def _leave(self, context: bpy.types.Context) -> None:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)

    def execute(self, context):
        try:
            _explained[:] = explanation_lines(_explain(context, self.x, self.y))
        except (RuntimeError, SceneError) as error:
            self.report({"ERROR"}, " ".join(str(error).split()))
            return {"CANCELLED"}
        for area in context.screen.areas:
            area.tag_redraw()
        return {"FINISHED"}


class _OfExplanation:
    @classmethod
    def poll(cls, context):
        return bool(_explained)


class GLINT_OT_copy_explanation(_OfExplanation, bpy.types.Operator):
    """Copy the explanation of the last pixel to the clipboard"""

    bl_idname = "glint.copy_explanation"
    bl_label = "Copy to Clipboard"

    def execute(self, context):
        context.window_manager.clipboard = "\n".join(_explained)
        return {"FINISHED"}


class GLINT_OT_explanation_as_text(_OfExplanation, bpy.types.Operator):
    """Put the explanation of the last pixel into a text block, and that into a text editor: the one
    that is open, or a new window
    """

    bl_idname = "glint.explanation_as_text"
    bl_label = "Open as Text"

    def execute(self, context):
        text = bpy.data.texts.get(TEXT) or bpy.data.texts.new(TEXT)
        text.from_string("\n".join([*_explained, ""]))
        in_editor("TEXT_EDITOR", context, _put_text)
        return {"FINISHED"}


def _put_text(area: bpy.types.Area) -> None:
    editor = area.spaces.active
    editor.text, editor.top, editor.show_word_wrap = bpy.data.texts.get(TEXT), 0, True


def _open_sidebar(area: bpy.types.Area) -> None:
    """With the tab that has the answer, which a sidebar has only when it was drawn."""
    area.spaces.active.show_region_ui = True
    address = area.as_pointer()
    bpy.app.timers.register(lambda: _turn_to_answer(address), first_interval=_DRAWN)


def _turn_to_answer(address: int) -> None:
    """Of the area at this address, if it is still there."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.as_pointer() == address:
                sidebar = next(region for region in area.regions if region.type == "UI")
                # where the user has closed the sidebar again, it has no tabs
                with suppress(TypeError):
                    sidebar.active_panel_category = _ExplainPanel.bl_category
                sidebar.tag_redraw()


def _explain(context: bpy.types.Context, x: int, y: int) -> "Ray":
    if context.area.type == "IMAGE_EDITOR":
        return explain_render(context.scene, context.view_layer.name, x, y)
    region = next(region for region in context.area.regions if region.type == "WINDOW")
    return explain_view(
        context.region if context.region and context.region.type == "WINDOW" else region, x, y
    )


def _point(context: bpy.types.Context, region: bpy.types.Region, x: int, y: int) -> tuple[int, int]:
    """What the operator's properties are for a point of a region."""
    if context.area.type == "VIEW_3D":
        return x, y
    u, v = region.view2d.region_to_view(x, y)
    image = context.space_data.image
    width, height = image.size if image is not None and image.size[0] > 0 else (1, 1)
    return int(u * width), int(v * height)


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
        row.operator(GLINT_OT_explanation_as_text.bl_idname, text="", icon="TEXT")
        row.operator(GLINT_OT_copy_explanation.bl_idname, text="", icon="COPYDOWN")
        if _explained:
            draw_text(self.layout.box().column(align=True), _explained[:1], context.region)
            draw_text(self.layout.column(align=True), _explained[1:], context.region)


class GLINT_VIEW3D_PT_explain_pixel(_ExplainPanel, bpy.types.Panel):
    bl_space_type = "VIEW_3D"


class GLINT_IMAGE_PT_explain_pixel(_ExplainPanel, bpy.types.Panel):
    bl_space_type = "IMAGE_EDITOR"


_CLASSES = (
    GLINT_OT_explain_pixel,
    GLINT_OT_copy_explanation,
    GLINT_OT_explanation_as_text,
    GLINT_VIEW3D_PT_explain_pixel,
    GLINT_IMAGE_PT_explain_pixel,
)

register, unregister = bpy.utils.register_classes_factory(_CLASSES)
