"""Presets of how to render: each gives all settings of Sampling and Light Paths, so that what was
there before has no part in the picture.
"""

from __future__ import annotations

from typing import Any

import bpy

from ...engine.settings import OFFERED
from .properties import OF_LIGHT, OF_RAYS, OF_SAMPLES

NAMES = (*OF_LIGHT, *OF_SAMPLES, *OF_RAYS)
"""What a preset sets; what is not in its own settings is as it is to begin with."""
PRESETS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "PREVIEW": (
        "Preview",
        "For a look at light and form: few samples, no light from wall to wall",
        {
            "samples": 8,
            "error_threshold": 8.0,
            "reflections": "METALS",
            "diffuse_bounces": 0,
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
        },
    ),
    "TEXTBOOK": (
        "Textbook",
        "For lessons: the formula as it stands, a ray through each pixel's centre, hard shadows "
        "from a lamp's centre, one reflection",
        {
            "illumination": "CLASSIC",
            "samples": 1,
            "error_threshold": 0.0,
            "light_samples": 1,
            "lamp_shadows": 0,
            "max_bounces": 1,
            "cutoff": 0.0,
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


class GLINT_MT_presets(bpy.types.Menu):
    bl_label = "Presets"

    def draw(self, context: bpy.types.Context) -> None:
        for name, (label, _, _) in PRESETS.items():
            self.layout.operator(GLINT_OT_preset.bl_idname, text=label).preset = name


_CLASSES = (GLINT_OT_preset, GLINT_MT_presets)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
