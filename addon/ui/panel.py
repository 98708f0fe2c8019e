"""What all our panels share."""

from __future__ import annotations

import bpy

from ..render.render_engine import GlintRenderEngine
from .lines import draw_text

ENGINE = GlintRenderEngine.bl_idname


NUMBERS, CHOICES = 97, 74
"""Pixels of the names beside numbers, which need little room themselves, and beside menus, in an
editor that is too narrow for Blender's own two fifths.
"""
_LETTER = 6.2
"""Pixels of a letter of a name, rather many."""
_EDGES = 28
"""Pixels left and right of a panel's rows."""


class EnginePanel:
    """A panel of the Properties editor that is there with Glint alone."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}
    about = ""
    """What of the context the panel shows, such as "light"; without it there is no panel."""

    @classmethod
    def poll(cls, context):
        is_there = not cls.about or getattr(context, cls.about) is not None
        return context.engine in cls.COMPAT_ENGINES and is_there

    @property
    def column(self) -> bpy.types.UILayout:
        """A column in which names stand left and values right."""
        self.layout.use_property_decorate = False
        return self.animated_column

    @property
    def animated_column(self) -> bpy.types.UILayout:
        """The same with a dot for keyframes beside each value."""
        self.layout.use_property_split = True
        return self.layout.column()


class SettingPanel(EnginePanel):
    """One setting, which is called so here."""

    name = called = ""

    @classmethod
    def owner(cls, context):
        """What has the setting."""
        return context.scene.render

    def draw(self, context):
        self.column.prop(self.owner(context), self.name, text=self.called)


def draw_if_known(
    column: bpy.types.UILayout, owner: bpy.types.bpy_struct, name: str, **look: str
) -> None:
    """A light's exposure and normalize came with Blender 4.5, a view layer's world_override with
    4.3.
    """
    if hasattr(owner, name):
        column.prop(owner, name, **look)


def row_width(region: bpy.types.Region) -> float:
    """Pixels of a row in a panel, on a screen of scale 1."""
    return max(region.width / bpy.context.preferences.system.ui_scale - _EDGES, 1.0)


def draw_wide(
    column: bpy.types.UILayout,
    owner: bpy.types.bpy_struct,
    name: str,
    text: str = "",
    pixels: int = NUMBERS,
) -> None:
    """A setting whose name Blender would cut in a narrow editor: it gets as many pixels as it
    needs, or a line of its own where the value would have too little room.
    """
    text = text or owner.bl_rna.properties[name].name
    width = row_width(bpy.context.region)
    share = max(0.4, pixels / width, len(text) * _LETTER / width)
    if share > (0.66 if pixels == NUMBERS else 0.52):
        column.label(text=text)
        column.prop(owner, name, text="")
        return
    row = column.split(factor=share)
    row.use_property_split = False
    label = row.row()
    label.alignment = "RIGHT"
    label.label(text=text)
    row.prop(owner, name, text="")


def draw_reason(layout: bpy.types.UILayout, is_grey: bool, reason: str) -> None:
    """Where something beside this is greyed out, say why."""
    if is_grey:
        draw_text(layout.column(align=True), [reason], bpy.context.region, icon="INFO")
