"""Panels of the tabs of a scene's things: lights, objects, materials, the world."""

from __future__ import annotations

from typing import Any

import bpy
from bl_ui.properties_object import OBJECT_PT_visibility
from bl_ui.properties_world import EEVEE_WORLD_PT_mist
from bpy.app.translations import contexts
from bpy_extras.node_utils import find_node_input

from ..export.geometry.volumes import openvdb
from ..export.materials.graph import node_tree, output_of
from .node_menu import draw_button
from .panel import EnginePanel, SettingPanel, draw_if_known, draw_reason, draw_wide

_DEFORMS = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
_SEEN = {*_DEFORMS, "CURVES", "POINTCLOUD", "VOLUME", "LIGHT"}
"""Objects that rays see or that give light, beside instances of collections."""
_MOVES = {*_DEFORMS, "EMPTY", "LIGHT", "POINTCLOUD"}
"""Objects that motion blur has settings of."""


class GLINT_LIGHT_PT_light(EnginePanel, bpy.types.Panel):
    bl_label = "Light"
    bl_context = "data"
    about = "light"

    def draw(self, context):
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = self.animated_column
        _draw_color(column, light)
        column.separator()
        for name in ("energy", "exposure", "normalize"):
            draw_if_known(column, light, name)
        column.separator()
        for name, text in _shape_of(light):
            column.prop(light, name, text=text)
        column.separator()
        column.prop(light, "use_shadow", text="Cast Shadow")


def _draw_color(column: bpy.types.UILayout, light: bpy.types.Light) -> None:
    if not hasattr(light, "use_temperature"):
        column.prop(light, "color")
        return
    row = column.row(heading="Temperature")
    row.prop(light, "use_temperature", text="")
    kelvins = row.row()
    kelvins.active = light.use_temperature
    kelvins.prop(light, "temperature", text="")
    column.prop(light, "color", text="Tint" if light.use_temperature else "Color")


def _shape_of(light: bpy.types.Light) -> tuple[tuple[str, str], ...]:
    """(property, label) pairs that say how large the light is and where it shines."""
    if light.type == "AREA":
        one_size = light.shape in {"SQUARE", "DISK"}
        return (
            ("shape", "Shape"),
            *((("size", "Size"),) if one_size else (("size", "Size X"), ("size_y", "Y"))),
        )
    radius = (("shadow_soft_size", "Radius"),)
    return {
        "POINT": (*radius, ("use_soft_falloff", "Soft Falloff")),
        "SPOT": (*radius, ("use_soft_falloff", "Soft Falloff")),
        "SUN": (("angle", "Angle"),),
    }[light.type]


class GLINT_LIGHT_PT_beam_shape(EnginePanel, bpy.types.Panel):
    bl_label = "Beam Shape"
    bl_parent_id = "GLINT_LIGHT_PT_light"
    bl_context = "data"
    about = "light"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light.type in {"SPOT", "AREA"}

    def draw(self, context):
        column, light = self.animated_column, context.light
        if light.type == "SPOT":
            column.prop(light, "spot_size", text="Angle")
            column.prop(light, "spot_blend", text="Blend")
            column.prop(light, "show_cone", text="Show Cone")
            return
        column.prop(light, "spread", text="Spread")


_PANORAMAS = {
    "FISHEYE_EQUIDISTANT": (("fisheye_fov", "Field of View"),),
    "FISHEYE_EQUISOLID": (("fisheye_lens", "Lens"), ("fisheye_fov", "Field of View")),
    "EQUIRECTANGULAR": (
        ("latitude_min", "Latitude Min"),
        ("latitude_max", "Max"),
        ("longitude_min", "Longitude Min"),
        ("longitude_max", "Max"),
    ),
    "FISHEYE_LENS_POLYNOMIAL": (
        ("fisheye_fov", "Field of View"),
        *((f"fisheye_polynomial_k{k}", f"K{k}") for k in range(5)),
    ),
    "CENTRAL_CYLINDRICAL": (
        ("central_cylindrical_range_v_min", "Height Min"),
        ("central_cylindrical_range_v_max", "Max"),
        ("central_cylindrical_range_u_min", "Longitude Min"),
        ("central_cylindrical_range_u_max", "Max"),
        ("central_cylindrical_radius", "Cylinder Radius"),
    ),
}
"""Panorama type -> its settings, and Cycles' words for them; Blender's own panel shows them with
Cycles alone.
"""


class GLINT_CAMERA_PT_panorama(EnginePanel, bpy.types.Panel):
    bl_label = "Panorama"
    bl_parent_id = "DATA_PT_lens"
    bl_context = "data"
    about = "camera"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.camera.type == "PANO"

    def draw(self, context):
        column, camera = self.column, context.camera
        owner = camera if hasattr(camera, "panorama_type") else getattr(camera, "cycles", None)
        kind = getattr(owner, "panorama_type", None)
        if kind is None:
            draw_reason(column, True, "The add-on of Cycles, which is off, keeps these settings")
            return
        draw_wide(column, owner, "panorama_type")
        for name, text in _PANORAMAS.get(kind, ()):
            draw_wide(column, owner, name, text)


class GLINT_VOLUME_PT_render(EnginePanel, bpy.types.Panel):
    bl_label = "Render"
    bl_context = "data"
    bl_options = {"DEFAULT_CLOSED"}
    about = "volume"

    def draw(self, context):
        is_read = openvdb() is not None
        draw_reason(self.layout, not is_read, "Needs the OpenVDB module of Blender 4.5")
        column = self.column
        column.active = is_read
        for name in ("space", "step_size", "clipping"):
            column.prop(context.volume.render, name)


class _ObjectPanel(EnginePanel):
    """A closed panel of an object's tab."""

    bl_context = about = "object"
    bl_options = {"DEFAULT_CLOSED"}


class _WorldPanel(EnginePanel):
    """A closed panel of the world's tab."""

    bl_context = about = "world"
    bl_options = {"DEFAULT_CLOSED"}


class _SeenPanel(_ObjectPanel):
    """Of objects that rays see or that give light."""

    @classmethod
    def poll(cls, context):
        thing = context.object
        is_seen = thing is not None and (thing.type in _SEEN or thing.instance_type == "COLLECTION")
        return is_seen and super().poll(context)


class GLINT_OBJECT_PT_visibility(_ObjectPanel, bpy.types.Panel):
    bl_label = "Visibility"

    def draw(self, context):
        OBJECT_PT_visibility.draw(self, context)
        # the end of it is the column Mask, which this goes on with
        if context.object.type not in {"LIGHT", "CAMERA"}:
            self.layout.column().prop(context.object, "is_shadow_catcher")


class GLINT_OBJECT_PT_ray_visibility(_SeenPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"
    bl_parent_id = "GLINT_OBJECT_PT_visibility"
    bl_options = set()

    def draw(self, context):
        column = self.animated_column
        for kind in ("Camera", "Diffuse", "Glossy", "Transmission", "Volume Scatter", "Shadow"):
            column.prop(context.object, f"visible_{kind.lower().replace(' ', '_')}", text=kind)
        reason = "Volume Scatter is for what gives light: volumes see the object whatever it says"
        draw_reason(self.layout, context.object.type != "LIGHT", reason)


class GLINT_OBJECT_PT_culling(_SeenPanel, bpy.types.Panel):
    bl_label = "Culling"
    bl_parent_id = "GLINT_OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context):
        return hasattr(context.object, "cycles") and super().poll(context)

    def draw(self, context):
        settings, simplify = context.object.cycles, context.scene.cycles
        is_on = context.scene.render.use_simplify
        for kind in ("camera", "distance"):
            row = self.column.row()
            row.active = is_on and getattr(simplify, f"use_{kind}_cull")
            row.prop(settings, f"use_{kind}_cull")
        reason = "Simplify in Render properties says whether and where objects are culled"
        draw_reason(self.layout, True, reason)


class GLINT_OBJECT_PT_shadow_terminator(_SeenPanel, bpy.types.Panel):
    bl_label = "Shadow Terminator"
    bl_parent_id = "OBJECT_PT_shading" if hasattr(bpy.types, "OBJECT_PT_shading") else ""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object.type != "LIGHT"

    def draw(self, context):
        owner, shading = context.object, "shadow_terminator_shading_offset"
        if not hasattr(owner, shading):
            owner, shading = getattr(owner, "cycles", None), "shadow_terminator_offset"
        if owner is not None:
            geometry, column = "shadow_terminator_geometry_offset", self.column
            draw_wide(column, owner, geometry, "Geometry Offset")
            draw_wide(column, owner, shading, "Shading Offset")


class GLINT_OBJECT_PT_motion_blur(_ObjectPanel, bpy.types.Panel):
    bl_label = "Motion Blur"

    @classmethod
    def poll(cls, context):
        moves = context.object is not None and context.object.type in _MOVES
        return moves and hasattr(context.object, "cycles") and super().poll(context)

    def draw_header(self, context):
        self.layout.active = context.scene.render.use_motion_blur
        self.layout.prop(context.object.cycles, "use_motion_blur", text="")

    def draw(self, context):
        settings, column = context.object.cycles, self.animated_column
        is_on = context.scene.render.use_motion_blur
        column.active = is_on and settings.use_motion_blur
        draw_reason(self.layout, not is_on, "Motion Blur is off in Render properties")
        column.prop(settings, "motion_steps", text="Steps")
        if context.object.type in _DEFORMS:
            column.prop(settings, "use_deform_motion", text="Deformation")


class _NodesPanel(EnginePanel):
    """What is linked to an input of the output node that Glint reads. Blender's own panels show
    that of Eevee's output, and stand before all of ours.
    """

    socket = bl_label = "Surface"
    without: tuple[str, ...] = ()
    """What is drawn without nodes."""

    @classmethod
    def poll(cls, context):
        owner = cls.owner(context)
        is_paint = getattr(owner, "grease_pencil", None)
        return super().poll(context) and owner is not None and not is_paint

    @classmethod
    def owner(cls, context):
        return getattr(context, "light" if cls.bl_context == "data" else cls.bl_context)

    def draw(self, context):
        layout, owner = self.layout, self.owner(context)
        tree = node_tree(owner)
        if tree is None:
            layout.prop(owner, "use_nodes", icon="NODETREE")
        layout.use_property_split = True
        if tree is None:
            for name in self.without:
                layout.prop(owner, name)
            return
        output = output_of(tree)
        socket = find_node_input(output, self.socket) if output is not None else None
        if socket is None:
            layout.label(text="No output node")
        else:
            layout.template_node_view(tree, output, socket)


class _MoreNodesPanel(_NodesPanel):
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and node_tree(cls.owner(context)) is not None


class GLINT_LIGHT_PT_nodes(_NodesPanel, bpy.types.Panel):
    bl_label = "Nodes"
    bl_context = "data"


class GLINT_MATERIAL_PT_surface(_NodesPanel, bpy.types.Panel):
    bl_context = "material"
    without = ("diffuse_color", "metallic", "roughness")

    def draw(self, context):
        draw_button(self.layout, context.material)
        _NodesPanel.draw(self, context)


class GLINT_MATERIAL_PT_volume(_MoreNodesPanel, bpy.types.Panel):
    socket = bl_label = "Volume"
    bl_translation_context = contexts.id_id  # no sound's
    bl_context = "material"


class GLINT_MATERIAL_PT_displacement(_MoreNodesPanel, bpy.types.Panel):
    socket = bl_label = "Displacement"
    bl_context = "material"


class GLINT_WORLD_PT_surface(_NodesPanel, bpy.types.Panel):
    bl_context = "world"
    without = ("color",)


class GLINT_WORLD_PT_volume(_MoreNodesPanel, bpy.types.Panel):
    socket = bl_label = "Volume"
    bl_translation_context = contexts.id_id  # no sound's
    bl_context = "world"


class GLINT_WORLD_PT_mist(_WorldPanel, bpy.types.Panel):
    bl_label = "Mist Pass"
    draw = EEVEE_WORLD_PT_mist.draw


class GLINT_MATERIAL_PT_settings(EnginePanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_context = "material"
    bl_options = {"DEFAULT_CLOSED"}
    about = "material"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and not context.material.grease_pencil

    def draw(self, context):
        self.column.prop(context.material, "pass_index")


class GLINT_MATERIAL_PT_settings_surface(EnginePanel, bpy.types.Panel):
    bl_label = "Surface"
    bl_context = "material"
    bl_parent_id = "GLINT_MATERIAL_PT_settings"

    def draw(self, context):
        column, material = self.column, context.material
        column.prop(material, "displacement_method", text="Displacement")
        # names in two parts: whole they would be cut
        shadows = column.column(heading="Transparent")
        shadows.prop(material, "use_transparent_shadow", text="Shadows")
        if hasattr(getattr(material, "cycles", None), "use_bump_map_correction"):
            bumps = column.column(heading="Bump Map")
            bumps.prop(material.cycles, "use_bump_map_correction", text="Correction")


class _VolumePanel(SettingPanel):
    """How far apart rays look at a volume that varies, as Cycles keeps it."""

    bl_label = "Volume"
    bl_translation_context = contexts.id_id

    @classmethod
    def owner(cls, context):
        return getattr(getattr(context, cls.bl_context), "cycles", None)

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(cls.owner(context), cls.name)


class GLINT_MATERIAL_PT_settings_volume(_VolumePanel, bpy.types.Panel):
    bl_context = "material"
    bl_parent_id = "GLINT_MATERIAL_PT_settings"
    name, called = "volume_step_rate", "Step Rate"


class GLINT_WORLD_PT_preview(_WorldPanel, bpy.types.Panel):
    bl_label = "Preview"

    def draw(self, context):
        self.layout.template_preview(context.world)


class GLINT_WORLD_PT_settings(_WorldPanel, bpy.types.Panel):
    bl_label = "Settings"

    def draw(self, context):
        pass


class GLINT_WORLD_PT_settings_volume(_VolumePanel, bpy.types.Panel):
    bl_context = "world"
    bl_parent_id = "GLINT_WORLD_PT_settings"
    name, called = "volume_step_size", "Step Size"


class GLINT_WORLD_PT_ray_visibility(_WorldPanel, bpy.types.Panel):
    bl_label = "Ray Visibility"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and hasattr(context.world, "cycles_visibility")

    def draw(self, context):
        column = self.column
        for name in ("camera", "diffuse", "glossy", "transmission", "scatter"):
            column.prop(context.world.cycles_visibility, name)


def _draw_light_group(layout: bpy.types.UILayout, owner: Any, layer: bpy.types.ViewLayer) -> None:
    """Which light group an object's or a world's light is in, and a button for one that the layer
    has not.
    """
    layout.use_property_split = True
    row = layout.row(align=True)
    row.use_property_decorate = False
    row.column(align=True).prop_search(
        owner, "lightgroup", layer, "lightgroups", text="Light Group", results_are_suggestions=True
    )
    more = row.column(align=True)
    more.enabled = bool(owner.lightgroup) and owner.lightgroup not in layer.lightgroups
    more.operator("scene.view_layer_add_lightgroup", icon="ADD", text="").name = owner.lightgroup


class GLINT_OBJECT_PT_light_group(_SeenPanel, bpy.types.Panel):
    bl_label = "Light Group"
    # before 4.3 the tab has no panel Shading for engines other than Cycles
    bl_parent_id = "OBJECT_PT_shading" if hasattr(bpy.types, "OBJECT_PT_shading") else ""

    def draw(self, context):
        _draw_light_group(self.layout, context.object, context.view_layer)


class GLINT_WORLD_PT_light_group(EnginePanel, bpy.types.Panel):
    bl_label = "Light Group"
    bl_context = "world"
    bl_parent_id = "GLINT_WORLD_PT_settings"

    def draw(self, context):
        _draw_light_group(self.layout, context.world, context.view_layer)


CLASSES = (
    GLINT_CAMERA_PT_panorama,
    GLINT_VOLUME_PT_render,
    GLINT_LIGHT_PT_light,
    GLINT_LIGHT_PT_beam_shape,
    GLINT_LIGHT_PT_nodes,
    GLINT_MATERIAL_PT_surface,
    GLINT_MATERIAL_PT_volume,
    GLINT_MATERIAL_PT_displacement,
    GLINT_MATERIAL_PT_settings,
    GLINT_MATERIAL_PT_settings_surface,
    GLINT_MATERIAL_PT_settings_volume,
    GLINT_OBJECT_PT_shadow_terminator,
    GLINT_OBJECT_PT_light_group,
    GLINT_OBJECT_PT_motion_blur,
    GLINT_OBJECT_PT_visibility,
    GLINT_OBJECT_PT_ray_visibility,
    GLINT_OBJECT_PT_culling,
    GLINT_WORLD_PT_preview,
    GLINT_WORLD_PT_surface,
    GLINT_WORLD_PT_volume,
    GLINT_WORLD_PT_mist,
    GLINT_WORLD_PT_ray_visibility,
    GLINT_WORLD_PT_settings,
    GLINT_WORLD_PT_settings_volume,
    GLINT_WORLD_PT_light_group,
)
"""In the order of Cycles': what draws as Blender's own panels is here as those come before all of
ours.
"""
