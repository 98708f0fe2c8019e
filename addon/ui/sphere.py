"""True spheres: meshes with a mark, which other engines and the other shadings of the viewport show
as the meshes that they are.
"""

from __future__ import annotations

import bpy

from ..export.geometry.shapes import SPHERE_MARK, mark_sphere
from .panel import EnginePanel


class GLINT_OT_add_sphere(bpy.types.Operator):
    """Add a fine, smooth UV sphere that Glint renders as a true sphere, without facets at any
    distance
    """

    bl_idname = "mesh.glint_add_sphere"
    bl_label = "True Sphere"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32)
        mesh = context.object.data
        mesh.shade_smooth()
        mark_sphere(mesh)
        return {"FINISHED"}


class GLINT_MESH_PT_sphere(EnginePanel, bpy.types.Panel):
    bl_label = "Glint"
    bl_context = "data"
    about = "mesh"

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.enabled = not context.mesh.is_editmode
        self.layout.prop(context.mesh, "glint_sphere")


def _draw_menu_entry(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    if context.engine == "GLINT":
        self.layout.operator(GLINT_OT_add_sphere.bl_idname, icon="MESH_UVSPHERE")


_CLASSES = (GLINT_OT_add_sphere, GLINT_MESH_PT_sphere)


_register, _unregister = bpy.utils.register_classes_factory(_CLASSES)


def register() -> None:
    _register()
    # Kept as an attribute of the mesh, which modifiers, copies and other files keep as well.
    bpy.types.Mesh.glint_sphere = bpy.props.BoolProperty(
        name="True Sphere",
        description="Glint renders the sphere round this mesh, whose vertices must lie on it; "
        "other engines show the mesh",
        get=lambda mesh: SPHERE_MARK in mesh.attributes,
        set=mark_sphere,
    )
    bpy.types.VIEW3D_MT_mesh_add.append(_draw_menu_entry)


def unregister() -> None:
    bpy.types.VIEW3D_MT_mesh_add.remove(_draw_menu_entry)
    del bpy.types.Mesh.glint_sphere
    _unregister()
