"""Panels of the tab View Layer."""

from __future__ import annotations

import bpy
from bl_ui.properties_view_layer import (
    VIEWLAYER_PT_layer_passes_aov,
    VIEWLAYER_PT_layer_passes_lightgroups,
)

from ... import engine
from ..render import result
from .panel import EnginePanel, draw_if_known, draw_reason, draw_wide


class _LayerPanel(EnginePanel):
    bl_context = "view_layer"


class _PassPanel(_LayerPanel):
    bl_parent_id = "GLINT_VIEWLAYER_PT_passes"


class GLINT_VIEWLAYER_PT_passes(_LayerPanel, bpy.types.Panel):
    bl_label = "Passes"

    def draw(self, context):
        pass


class GLINT_VIEWLAYER_PT_data(_PassPanel, bpy.types.Panel):
    bl_label = "Data"

    def draw(self, context):
        column, layer = self.column, context.view_layer
        include = column.column(heading="Include", align=True)
        for name in ("z", "mist", "position", "normal"):
            include.prop(layer, f"use_pass_{name}")
        blurs = context.scene.render.use_motion_blur
        vector = include.row(align=True)
        vector.active = not blurs
        vector.prop(layer, "use_pass_vector")
        reason = "Vector is empty with Motion Blur"
        draw_reason(include, blurs and layer.use_pass_vector, reason)
        include.prop(layer, "use_pass_uv")
        cycles = getattr(layer, "cycles", None)
        draw_if_known(include, cycles, result.DENOISING, text="Denoising Data")
        indices = column.column(heading="Indexes", align=True)
        indices.prop(layer, "use_pass_object_index")
        indices.prop(layer, "use_pass_material_index")


class GLINT_VIEWLAYER_PT_light(_PassPanel, bpy.types.Panel):
    bl_label = "Light"

    def draw(self, context):
        column, layer = self.column, context.view_layer
        cycles = getattr(layer, "cycles", None)
        for surface in ("Diffuse", "Glossy", "Transmission"):
            light = column.column(heading=surface, align=True)
            for what in ("Direct", "Indirect", "Color"):
                light.prop(layer, result.LIGHT_SWITCHES[f"{surface} {what}"], text=what)
        volume = column.column(heading="Volume", align=True)
        for what in ("Direct", "Indirect"):
            draw_if_known(volume, cycles, result.CYCLES_SWITCHES[f"Volume {what}"], text=what)
        other = column.column(heading="Other", align=True)
        other.prop(layer, "use_pass_emit", text="Emission")
        other.prop(layer, "use_pass_environment")
        catcher = result.CYCLES_SWITCHES[engine.CATCHER]
        draw_if_known(other, cycles, catcher, text="Shadow Catcher")
        # its whole name would be cut
        occlusion = column.column(heading="Ambient", align=True)
        occlusion.prop(layer, "use_pass_ambient_occlusion", text="Occlusion")
        if layer.use_pass_ambient_occlusion and context.scene.world is not None:
            column.prop(context.scene.world.light_settings, "distance", text="Distance")


class GLINT_VIEWLAYER_PT_parts(_PassPanel, bpy.types.Panel):
    bl_label = "Parts"
    switches = result.PART_SWITCHES

    def draw(self, context):
        include = self.column.column(heading="Include", align=True)
        for switch in self.switches.values():
            include.prop(context.view_layer.glint, switch)


class GLINT_VIEWLAYER_PT_health(_PassPanel, bpy.types.Panel):
    bl_label = "Health"
    switches = result.HEALTH_SWITCHES
    draw = GLINT_VIEWLAYER_PT_parts.draw


class GLINT_VIEWLAYER_PT_cryptomatte(_PassPanel, bpy.types.Panel):
    bl_label = "Cryptomatte"

    def draw(self, context):
        column, layer = self.column, context.view_layer
        include = column.column(heading="Include", align=True)
        switches = [result.BLENDER_SWITCHES[name] for name in engine.CRYPTOMATTES]
        for switch in switches:
            include.prop(layer, switch, text=switch.rpartition("_")[2].title())
        levels = column.column()
        levels.active = any(getattr(layer, switch) for switch in switches)
        levels.prop(layer, "pass_cryptomatte_depth", text="Levels")


class GLINT_VIEWLAYER_PT_aov(_PassPanel, bpy.types.Panel):
    bl_label = "Shader AOV"
    draw = VIEWLAYER_PT_layer_passes_aov.draw


class GLINT_VIEWLAYER_PT_light_groups(_PassPanel, bpy.types.Panel):
    bl_label = "Light Groups"
    draw = VIEWLAYER_PT_layer_passes_lightgroups.draw


class GLINT_VIEWLAYER_PT_filter(_LayerPanel, bpy.types.Panel):
    bl_label = "Filter"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, layer = self.column, context.view_layer
        include = column.column(heading="Include", align=True)
        include.prop(layer, "use_sky", text="Environment")
        include.prop(layer, "use_solid", text="Surfaces")
        include.prop(layer, "use_strand", text="Curves")
        blur = column.column(heading="Use", align=True)
        blur.active = context.scene.render.use_motion_blur
        blur.prop(layer, "use_motion_blur", text="Motion Blur")
        draw_reason(column, not blur.active, "Motion Blur is off in Render properties")


class GLINT_VIEWLAYER_PT_override(_LayerPanel, bpy.types.Panel):
    bl_label = "Override"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, layer = self.column, context.view_layer
        for name in ("material_override", "world_override"):
            if hasattr(layer, name):  # the world's came with Blender 4.3
                draw_wide(column, layer, name)
        column.prop(layer, "samples")


CLASSES = (
    GLINT_VIEWLAYER_PT_passes,
    GLINT_VIEWLAYER_PT_data,
    GLINT_VIEWLAYER_PT_light,
    GLINT_VIEWLAYER_PT_parts,
    GLINT_VIEWLAYER_PT_health,
    GLINT_VIEWLAYER_PT_cryptomatte,
    GLINT_VIEWLAYER_PT_aov,
    GLINT_VIEWLAYER_PT_light_groups,
    GLINT_VIEWLAYER_PT_filter,
    GLINT_VIEWLAYER_PT_override,
)
"""In the order of Cycles'."""
