"""Presets of how to render: each gives all settings of Sampling and Light Paths, so that what was
there before has no part in the picture.
"""

from __future__ import annotations

from typing import Any

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel

from ...engine.settings import OFFERED
from .properties import OF_LIGHT, OF_RAYS, OF_SAMPLES

NAMES = (*OF_LIGHT, *OF_SAMPLES, *OF_RAYS)
"""What a preset sets; what is not in its own settings is as it is to begin with."""
_OF_TARGET = ("target", "target_levels", "target_rmse")
_FOLDER = "glint/sampling"
"""Of the user's own presets, among Blender's."""
PRESETS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "PREVIEW": (
        "Preview",
        "For a look at light and form: few samples, light goes from wall to wall once",
        {
            "samples": 4,
            "reflections": "METALS",
            "diffuse_bounces": 1,
            "max_bounces": 4,
            "cutoff": 0.01,
            "volume_samples": 2,
        },
    ),
    "FINAL": ("Final", "For most pictures: what Glint begins with", {}),
    "EXACT": (
        "Exact",
        "For pictures that others are compared with: all samples to all pixels, a shadow ray to "
        "each lamp, every surface reflects, no ray is cut off. Takes many times as long",
        {
            "samples": 256,
            "error_threshold": 0.0,
            "light_samples": 8,
            "lamp_shadows": 0,
            "volume_samples": 16,
            "reflections": "ALL",
            "diffuse_bounces": 8,
            "max_bounces": 32,
            "cutoff": 0.0,
            "clamp_indirect": 0.0,
        },
    ),
    "TEXTBOOK": (
        "Textbook",
        "For lessons: the formula as it stands, a ray through each pixel's centre, hard shadows "
        "from a lamp's centre, one reflection",
        {
            "illumination": "CLASSIC",
            "soft_light": "SHARED",
            "samples": 1,
            "error_threshold": 0.0,
            "visibility_samples": 1,
            "light_samples": 1,
            "lamp_shadows": 0,
            "max_bounces": 1,
            "cutoff": 0.0,
            "clamp_indirect": 0.0,
        },
    ),
}
"""Name -> label, tooltip, and the settings that are its own."""


def apply(group: bpy.types.PropertyGroup, preset: str) -> None:
    """Give a group of render settings those of a preset."""
    own = PRESETS[preset][2]
    for name in NAMES:
        setattr(group, name, own.get(name, getattr(OFFERED, name)))


class GLINT_OT_preset(bpy.types.Operator):
    """Set all of Sampling and Light Paths of the final render"""

    bl_idname = "glint.preset"
    bl_label = "Use Preset"
    bl_options = {"REGISTER", "UNDO"}

    # An annotation, which Blender reads as it is: this module's are strings otherwise.
    __annotations__ = {
        "preset": bpy.props.EnumProperty(
            name="Preset",
            description="What the picture is for",
            items=[(name, label, tooltip) for name, (label, tooltip, _) in PRESETS.items()],
            default="FINAL",
        )
    }

    @classmethod
    def description(cls, context: bpy.types.Context, properties: Any) -> str:
        return PRESETS[properties.preset][1]

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.glint
        apply(settings.final, self.preset)
        settings.target = "NONE"
        return {"FINISHED"}


class GLINT_OT_preset_add(AddPresetBase, bpy.types.Operator):
    """Keep the present Sampling and Light Paths of the final render as a preset, or remove one"""

    bl_idname = "glint.preset_add"
    bl_label = "Add or Remove Preset"
    preset_menu = "GLINT_PT_presets"
    preset_subdir = _FOLDER
    # whole paths: names that `preset_defines` gives are lost in Blender 4.3 with Python 3.13
    preset_values = tuple(
        f"bpy.context.scene.glint.{name}"
        for name in (*(f"final.{name}" for name in NAMES), *_OF_TARGET)
    )


class GLINT_PT_presets(PresetPanel, bpy.types.Panel):
    """Glint's own presets, and below them the user's."""

    bl_label = "Presets"
    preset_subdir = _FOLDER
    preset_operator = "script.execute_preset"
    preset_add_operator = GLINT_OT_preset_add.bl_idname
    COMPAT_ENGINES = {"GLINT"}

    def draw(self, context: bpy.types.Context) -> None:
        column = self.layout.column(align=True)
        column.emboss = "PULLDOWN_MENU"
        for name, (label, _, _) in PRESETS.items():
            column.operator(GLINT_OT_preset.bl_idname, text=label).preset = name
        PresetPanel.draw(self, context)


_CLASSES = (GLINT_OT_preset, GLINT_OT_preset_add, GLINT_PT_presets)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
