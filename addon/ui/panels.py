"""What the user sees: Blender's own panels where they fit, and ours for sampling, passes, lights,
visibility and statistics.

Blender marks the panels that any renderer needs (output, dimensions, camera, scene, view layers,
colour management, …) with the engine BLENDER_RENDER; we join those, as Blender's own engine add-ons
do, except the ones that we replace or that would change nothing. From Eevee we borrow the material
slots and their preview and depth of field: they show data that Glint reads too.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
from bl_ui.properties_grease_pencil_common import GreasePencilSimplifyPanel

from ..render import statistics
from . import data_panels, view_layer_panels
from .lines import draw_text
from .panel import CHOICES, ENGINE, EnginePanel, SettingPanel, draw_if_known, draw_reason, draw_wide
from .presets import GLINT_PT_presets
from .properties import LIGHT_GROUP, OF_RAYS, OF_SAMPLES

_REPLACED_OR_WITHOUT_EFFECT = {
    "DATA_PT_falloff_curve",
    "DATA_PT_light",
    "DATA_PT_lightprobe",
    "DATA_PT_lightprobe_display",
    "DATA_PT_lightprobe_parallax",
    "DATA_PT_lightprobe_visibility",
    "DATA_PT_spot",
    "DATA_PT_volume_render",
    "NODE_DATA_PT_light",
    "NODE_DATA_PT_spot",
    "OBJECT_PT_visibility",
    "RENDER_PT_simplify",
    "RENDER_PT_simplify_greasepencil",
    "RENDER_PT_simplify_render",
    "RENDER_PT_simplify_viewport",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
}
_BORROWED_FROM_EEVEE = {
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "MATERIAL_PT_preview",
}


def _draw_pass(layout: bpy.types.UILayout, context: bpy.types.Context, **look: str) -> None:
    """What Rendered shading shows."""
    settings = context.scene.glint
    layout.prop(settings, "viewport_pass", **look)
    if settings.viewport_pass == LIGHT_GROUP:
        layout.prop_search(
            settings, "viewport_light_group", context.view_layer, "lightgroups", **look
        )


class GLINT_RENDER_PT_sampling(EnginePanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw_header_preset(self, context):
        GLINT_PT_presets.draw_panel_header(self.layout)

    def draw(self, context):
        column = self.column
        settings = context.scene.glint
        draw_wide(column, settings.final, "illumination", pixels=CHOICES)
        physical = column.column()
        physical.active = settings.final.illumination == "PHYSICAL"
        draw_reason(column, not physical.active, "Classic illumination has none of these")
        draw_wide(physical, settings.final, "world_light", pixels=CHOICES)
        draw_wide(physical, settings.final, "use_mesh_light", pixels=CHOICES)
        draw_wide(column, settings, "target", pixels=CHOICES)
        if settings.target != "NONE":
            error = "target_levels" if settings.target == "LEVELS" else "target_rmse"
            draw_wide(column, settings, error, pixels=CHOICES)


class _SamplingPanel(EnginePanel):
    bl_parent_id = "GLINT_RENDER_PT_sampling"
    names = OF_SAMPLES

    def draw(self, context):
        group = getattr(context.scene.glint, self.group)
        column = self.column
        for name in self.names:
            draw_wide(_with_reason(context, column, name), group, name)


def _with_reason(context, column, name):
    """Where the setting is drawn: greyed, with the reason, where it does nothing."""
    if name != "visibility_samples":
        return column
    part, final = column.column(), context.scene.glint.final
    part.active = final.illumination == "PHYSICAL" and final.soft_light == "RESOLVED"
    reason = "Visibility Samples need Soft Light Resolved, and Physical illumination"
    draw_reason(column, not part.active, reason)
    return part


class GLINT_RENDER_PT_sampling_final(_SamplingPanel, bpy.types.Panel):
    bl_label = "Render"
    group = "final"

    def draw(self, context):
        has_target = context.scene.glint.target != "NONE"
        draw_reason(self.layout, has_target, "Quality Target finds the first two")
        column = self.column
        found, chosen = column.column(), column.column()
        found.active = not has_target
        for number, name in enumerate(self.names):
            part = found if number < 2 else _with_reason(context, chosen, name)
            draw_wide(part, context.scene.glint.final, name)


class GLINT_RENDER_PT_sampling_viewport(_SamplingPanel, bpy.types.Panel):
    bl_label = "Viewport"
    group = "viewport"

    def draw(self, context):
        _SamplingPanel.draw(self, context)
        _draw_pass(self.column, context)


class GLINT_RENDER_PT_light_paths(EnginePanel, bpy.types.Panel):
    bl_label = "Light Paths"

    def draw(self, context):
        column, final = self.column, context.scene.glint.final
        is_physical, bounces = final.illumination == "PHYSICAL", final.max_bounces
        physical = column.column()
        physical.active = is_physical
        draw_reason(column, not is_physical, "Classic illumination has none of these")
        draw_wide(physical, final, "soft_light", pixels=CHOICES)
        draw_wide(physical, final, "diffuse_bounces")
        volumes = physical.column()
        volumes.active = final.diffuse_bounces > 0
        bounces_light = is_physical and final.diffuse_bounces > 0
        draw_wide(volumes, final, "volume_bounces")
        reflections = physical.column()
        reflections.active = bounces > 0
        draw_wide(reflections, final, "reflections", pixels=CHOICES)
        draw_wide(column, final, "use_subsurface", pixels=CHOICES)
        caustics = column.column(heading="Caustics", align=True)
        reflective = caustics.column(align=True)
        reflective.active = bounces_light
        reflective.prop(final, "use_reflective_caustics", text="Reflective")
        caustics.prop(final, "use_refractive_caustics", text="Refractive")
        throws = final.reflective_caustics == "ON" or final.refractive_caustics == "ON"
        photons = column.column()
        photons.active = bounces_light and throws and bounces > 0
        draw_wide(photons, final, "photons")
        draw_wide(column, final, "clamp_indirect")
        reason = "Rough Reflections need Bounces of Render"
        draw_reason(column, is_physical and bounces == 0, reason)
        thrown = (
            "Volume Bounces and Reflective Caustics need Diffuse Bounces and Physical illumination"
        )
        draw_reason(column, not bounces_light, thrown)
        needs = "Photons need Bounces of Render, Diffuse Bounces and Caustics"
        draw_reason(column, is_physical and not photons.active, needs)


class _PathsPanel(_SamplingPanel):
    bl_parent_id = "GLINT_RENDER_PT_light_paths"
    names = OF_RAYS


class GLINT_RENDER_PT_light_paths_viewport(_PathsPanel, bpy.types.Panel):
    bl_label = "Viewport"
    group = "viewport"


class GLINT_RENDER_PT_light_paths_render(_PathsPanel, bpy.types.Panel):
    bl_label = "Render"
    group = "final"


class _CyclesPanel(EnginePanel):
    """A setting of the scene that Cycles keeps and Glint reads."""

    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.scene, "cycles")


class GLINT_RENDER_PT_volumes(_CyclesPanel, bpy.types.Panel):
    bl_label = "Volumes"

    def draw(self, context):
        draw_if_known(self.column, context.scene.cycles, "volume_step_rate", text="Step Rate")


class GLINT_RENDER_PT_curves(_CyclesPanel, bpy.types.Panel):
    bl_label = "Curves"

    def draw(self, context):
        self.column.prop(context.scene.cycles_curves, "shape", text="Shape")


class _SwitchedPanel(EnginePanel):
    """With a setting of the render in its head that turns it on."""

    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, self.switch, text="")


class GLINT_RENDER_PT_simplify(_SwitchedPanel, bpy.types.Panel):
    bl_label = "Simplify"
    switch = "use_simplify"

    def draw(self, context):
        pass


class _SimplifyPanel(EnginePanel):
    bl_parent_id = "GLINT_RENDER_PT_simplify"

    def draw(self, context):
        render = context.scene.render
        self.layout.active = render.use_simplify
        column = self.column
        draw_wide(column, render, f"simplify_subdivision{self.suffix}", "Max Subdivision")
        draw_wide(column, render, f"simplify_child_particles{self.suffix}", "Child Particles")


class GLINT_RENDER_PT_simplify_viewport(_SimplifyPanel, bpy.types.Panel):
    bl_label = "Viewport"
    suffix = ""


class GLINT_RENDER_PT_simplify_render(_SimplifyPanel, bpy.types.Panel):
    bl_label = "Render"
    suffix = "_render"


class GLINT_RENDER_PT_simplify_culling(_CyclesPanel, bpy.types.Panel):
    bl_label = "Culling"
    bl_parent_id = "GLINT_RENDER_PT_simplify"

    def draw(self, context):
        settings = context.scene.cycles
        self.layout.active = context.scene.render.use_simplify
        for kind in ("camera", "distance"):
            row = self.column.row(heading=kind.title())
            row.prop(settings, f"use_{kind}_cull", text="")
            margin = row.column()
            margin.active = getattr(settings, f"use_{kind}_cull")
            margin.prop(settings, f"{kind}_cull_margin", text="")


class GLINT_RENDER_PT_simplify_grease_pencil(
    EnginePanel, GreasePencilSimplifyPanel, bpy.types.Panel
):
    bl_label = "Grease Pencil"
    bl_parent_id = "GLINT_RENDER_PT_simplify"
    bl_options = {"DEFAULT_CLOSED"}


class GLINT_RENDER_PT_motion_blur(_SwitchedPanel, bpy.types.Panel):
    bl_label = "Motion Blur"
    switch = "use_motion_blur"

    def draw(self, context):
        render, column = context.scene.render, self.animated_column
        column.active = render.use_motion_blur
        column.prop(render, "motion_blur_position", text="Position")
        column.prop(render, "motion_blur_shutter", text="Shutter")
        column.template_curve_mapping(render, "motion_blur_shutter_curve")


class GLINT_RENDER_PT_film(EnginePanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.column.prop(context.scene.render, "film_transparent", text="Transparent")


class GLINT_RENDER_PT_pixel_filter(EnginePanel, bpy.types.Panel):
    bl_label = "Pixel Filter"
    bl_parent_id = "GLINT_RENDER_PT_film"

    def draw(self, context):
        self.column.prop(context.scene.render, "filter_size", text="Width")


class GLINT_RENDER_PT_performance(EnginePanel, bpy.types.Panel):
    bl_label = "Performance"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = self.column
        group = context.scene.glint.final
        column.prop(group, "backend")
        native = column.column()
        native.active = group.backend == "NATIVE"
        draw_reason(column, not native.active, "Of the native tracer alone")
        native.prop(group, "acceleration")
        native.prop(group, "threads")


class GLINT_RENDER_PT_performance_final(SettingPanel, bpy.types.Panel):
    bl_label = "Final Render"
    bl_parent_id = "GLINT_RENDER_PT_performance"
    name, called = "use_persistent_data", "Persistent Data"


class GLINT_RENDER_PT_performance_viewport(SettingPanel, bpy.types.Panel):
    bl_label = "Viewport"
    bl_parent_id = "GLINT_RENDER_PT_performance"
    name, called = "preview_pixel_size", "Pixel Size"


class GLINT_RENDER_PT_statistics(EnginePanel, bpy.types.Panel):
    bl_label = "Statistics"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        last = statistics.of_last_render(context.scene.name)
        if statistics.of_views(context.scene.name) or (last and last.notes):
            self.layout.label(icon="ERROR")

    def draw(self, context):
        last = statistics.of_last_render(context.scene.name)
        views = [
            note
            for note in statistics.of_views(context.scene.name)
            if not (last and note in last.notes)
        ]
        for title, notes in (
            ("Warnings of the last render", last.notes if last else ()),
            ("Warnings of the 3D views", views),
        ):
            if notes:
                self.layout.label(text=title, icon="ERROR")
                draw_text(self.layout.column(align=True), notes, context.region, "• ")
        for title, lines in (
            last.sections.items() if last else (("Nothing has been rendered yet", ()),)
        ):
            column = self.layout.column(align=True)
            column.label(text=title)
            draw_text(column, lines, context.region)


class _ShadingPanel:
    """Of the popover of the 3D view's header."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_parent_id = "VIEW3D_PT_shading"

    @classmethod
    def poll(cls, context):
        return context.engine == ENGINE and context.space_data.shading.type == "RENDERED"


class GLINT_VIEW3D_PT_shading_lighting(_ShadingPanel, bpy.types.Panel):
    bl_label = "Lighting"

    def draw(self, context):
        shading = context.space_data.shading
        column = self.layout.column()
        column.prop(shading, "use_scene_lights_render")
        column.prop(shading, "use_scene_world_render")
        if shading.use_scene_world_render:
            return
        choice = column.column()
        choice.scale_y = 0.6
        choice.template_icon_view(shading, "studio_light", scale_popup=3.0)
        column.prop(shading, "studiolight_intensity")
        column.prop(shading, "studiolight_background_alpha")


class GLINT_VIEW3D_PT_shading_render_pass(_ShadingPanel, bpy.types.Panel):
    bl_label = "Render Pass"

    def draw(self, context):
        _draw_pass(self.layout, context, text="")


def _blender_panels() -> Iterator[type]:
    """Blender's panels that stay visible with Glint."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        general = "BLENDER_RENDER" in engines and panel.__name__ not in _REPLACED_OR_WITHOUT_EFFECT
        if general or panel.__name__ in _BORROWED_FROM_EEVEE:
            yield panel


# Panels of one tab stand in this order, as those of Cycles do.
_CLASSES = (
    GLINT_RENDER_PT_sampling,
    GLINT_RENDER_PT_sampling_viewport,
    GLINT_RENDER_PT_sampling_final,
    GLINT_RENDER_PT_light_paths,
    GLINT_RENDER_PT_light_paths_viewport,
    GLINT_RENDER_PT_light_paths_render,
    GLINT_RENDER_PT_volumes,
    GLINT_RENDER_PT_curves,
    GLINT_RENDER_PT_simplify,
    GLINT_RENDER_PT_simplify_viewport,
    GLINT_RENDER_PT_simplify_render,
    GLINT_RENDER_PT_simplify_culling,
    GLINT_RENDER_PT_simplify_grease_pencil,
    GLINT_RENDER_PT_motion_blur,
    GLINT_RENDER_PT_film,
    GLINT_RENDER_PT_pixel_filter,
    GLINT_RENDER_PT_performance,
    GLINT_RENDER_PT_performance_final,
    GLINT_RENDER_PT_performance_viewport,
    GLINT_RENDER_PT_statistics,
    *view_layer_panels.CLASSES,
    *data_panels.CLASSES,
    GLINT_VIEW3D_PT_shading_lighting,
    GLINT_VIEW3D_PT_shading_render_pass,
)


@bpy.app.handlers.persistent
def _redraw_statistics(*_: Any) -> None:
    """After an animation Blender draws Properties editors only when the mouse comes by."""
    for manager in bpy.data.window_managers:
        for window in manager.windows:
            for area in window.screen.areas:
                if area.type == "PROPERTIES":
                    area.tag_redraw()


_ENDS = (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel)


_register, _unregister = bpy.utils.register_classes_factory(_CLASSES)


def register() -> None:
    for handlers in _ENDS:
        handlers.append(_redraw_statistics)
    _register()
    for panel in _blender_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    for handlers in _ENDS:
        handlers.remove(_redraw_statistics)
    for panel in _blender_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
    _unregister()
