"""Glint's Blinn-Phong node in the shader editor's Add menu and in the material tab.

The list of shaders behind the material tab's Surface button is Blender's own, of built-in types
only: so the panel has a button.
"""

from __future__ import annotations

import bpy

from ..export.materials.graph import BLINN_PHONG, is_blinn_phong, kind_of, node_tree, output_of
from .nodes import NAME, OUTPUT, WIDTH, add_blinn_phong, blinn_phong_group

_COLORS = ("Base Color", "Color", "Diffuse")
_HEIGHT = 300
"""Units of a node editor in which a Blinn-Phong node and some space have room, one above the
other.
"""


class GLINT_OT_add_blinn_phong(bpy.types.Operator):
    """Add the textbook's surface: ambient, diffuse and specular coefficients, exponent and mirror.
    Cycles and Eevee show a likeness
    """

    bl_idname = "node.glint_add_blinn_phong"
    bl_label = "Add Blinn-Phong"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        tree = getattr(context.space_data, "edit_tree", None)
        return tree is not None and tree.bl_idname == "ShaderNodeTree" and not is_blinn_phong(tree)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Under the mouse, which then carries it."""
        group = f"bpy.data.node_groups[{blinn_phong_group().name!r}]"
        settings = [
            {"name": "node_tree", "value": group},
            {"name": "width", "value": repr(WIDTH)},
        ]
        return bpy.ops.node.add_node(
            "INVOKE_DEFAULT", type="ShaderNodeGroup", use_transform=True, settings=settings
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        add_blinn_phong(context.space_data.edit_tree)
        return {"FINISHED"}


class GLINT_OT_use_blinn_phong(bpy.types.Operator):
    """Make the textbook's Blinn-Phong the surface of this material, in the colour that it has. The
    shader before it stays, unlinked
    """

    bl_idname = "material.glint_use_blinn_phong"
    bl_label = "Use Blinn-Phong"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return (
            context.material is not None
            and context.material.library is None
            and not _wears_it(context.material)
        )

    def execute(self, context: bpy.types.Context) -> set[str]:
        use_blinn_phong(context.material)
        return {"FINISHED"}


def use_blinn_phong(material: bpy.types.Material) -> bpy.types.Node:
    """The node, as the surface of a material, with the colour, transparency and light of the shader
    before it where it has such inputs.
    """
    if node_tree(material) is None:
        material.use_nodes = True
    tree = material.node_tree
    output = output_of(tree) or tree.nodes.new("ShaderNodeOutputMaterial")
    before = _shader_behind(output)
    node = add_blinn_phong(tree)
    if before is None:
        node.location = output.location.x - 240, output.location.y
    else:  # nobody knows how tall that one is
        node.location = before.location.x, before.location.y + _HEIGHT
        _take_over(tree, before, node)
    tree.links.new(node.outputs[OUTPUT], output.inputs["Surface"])
    return node


def _shader_behind(output: bpy.types.Node) -> bpy.types.Node | None:
    links = output.inputs["Surface"].links
    return links[0].from_node if links else None


def _wears_it(material: bpy.types.Material) -> bool:
    tree = node_tree(material)
    output = output_of(tree) if tree is not None else None
    before = _shader_behind(output) if output is not None else None
    return before is not None and kind_of(before) == BLINN_PHONG


def _take_over(tree: bpy.types.NodeTree, before: bpy.types.Node, node: bpy.types.Node) -> None:
    color = next((before.inputs[name] for name in _COLORS if name in before.inputs), None)
    for name, given in (
        ("Ambient", color),
        ("Diffuse", color),
        ("Alpha", before.inputs.get("Alpha")),
    ):
        if given is None:
            continue
        node.inputs[name].default_value = given.default_value
        for link in given.links:
            tree.links.new(link.from_socket, node.inputs[name])


def _draw_menu_entry(self: bpy.types.Menu, context: bpy.types.Context) -> None:
    """In Add → Shader of the shader editor."""
    if context.engine == "GLINT":
        self.layout.operator_context = "INVOKE_DEFAULT"
        self.layout.operator(GLINT_OT_add_blinn_phong.bl_idname, text=NAME)


def draw_button(layout: bpy.types.UILayout, material: bpy.types.Material) -> None:
    """In the panel of a material's surface."""
    if not _wears_it(material):
        layout.operator(GLINT_OT_use_blinn_phong.bl_idname, icon="MATERIAL")


_CLASSES = (GLINT_OT_add_blinn_phong, GLINT_OT_use_blinn_phong)


_register, _unregister = bpy.utils.register_classes_factory(_CLASSES)


def register() -> None:
    _register()
    bpy.types.NODE_MT_category_shader_shader.append(_draw_menu_entry)


def unregister() -> None:
    bpy.types.NODE_MT_category_shader_shader.remove(_draw_menu_entry)
    _unregister()
