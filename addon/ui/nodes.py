"""The Blinn-Phong shader node: an ordinary node group with a mark, whose sockets are the notes'
coefficients.

So it needs no extension to be opened, appended, duplicated or shown: Glint knows it by the mark
(`export.graph.is_blinn_phong`), reads the sockets by name (`SOCKETS`) and never looks inside.
Inside, for Cycles and Eevee, a Diffuse and two Glossy closures stand for the same surface: with α =
roughness², α² = 2.25/(p + 1.9) and F0 = k_s α²/0.26, which follows the one lobe of exponent p that
is nearest to GGX to 5 % in roughness (tests/cycles/fit_roughness.py measures it).
"""

from __future__ import annotations

import bpy

from ..export.materials.graph import BLINN_PHONG, MARK, is_blinn_phong

NAME = "Blinn-Phong"
OUTPUT = "BSDF"
WIDTH = 180
"""Of a new node, in which its sockets' names are whole."""
SOCKETS = (
    (
        "Ambient",
        "NodeSocketColor",
        (0.8, 0.8, 0.8, 1.0),
        "k_a: share of the world's ambient light that comes back",
    ),
    ("Diffuse", "NodeSocketColor", (0.8, 0.8, 0.8, 1.0), "k_d: Lambert's share of every light"),
    ("Specular", "NodeSocketColor", (0.5, 0.5, 0.5, 1.0), "k_s: brightness of the highlight"),
    ("Exponent", "NodeSocketFloat", 32.0, "p: the larger, the smaller the highlight"),
    (
        "Mirror",
        "NodeSocketColor",
        (0.0, 0.0, 0.0, 1.0),
        "k_m: share of what the mirror reflection sees",
    ),
    (
        "Emission",
        "NodeSocketColor",
        (0.0, 0.0, 0.0, 1.0),
        "Light that the surface itself sends to the viewer",
    ),
    ("Alpha", "NodeSocketFloat", 1.0, "1 covers what is behind, 0 is invisible"),
)
"""(name, socket type, default, description), in the order shown."""

_LIMITS = {"Exponent": (0.0, 1e9), "Alpha": (0.0, 1.0)}


def blinn_phong_group() -> bpy.types.NodeTree:
    """The file's own Blinn-Phong group, made where there is none. Groups of that name without the
    mark are somebody else's.
    """
    own = (
        tree
        for tree in bpy.data.node_groups
        if is_blinn_phong(tree) and tree.library is None and _is_whole(tree)
    )
    return next(own, None) or _make_group()


def _is_whole(tree: bpy.types.NodeTree) -> bool:
    """Whether nobody has taken a socket away."""
    names = {item.name for item in tree.interface.items_tree if item.item_type == "SOCKET"}
    return names >= {OUTPUT, *(name for name, *_ in SOCKETS)}


def add_blinn_phong(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """A new Blinn-Phong node in a shader node tree."""
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree, node.width = blinn_phong_group(), WIDTH
    return node


def _make_group() -> bpy.types.NodeTree:
    tree = bpy.data.node_groups.new(NAME, "ShaderNodeTree")
    for name, kind, default, description in SOCKETS:
        socket = tree.interface.new_socket(
            name, description=description, in_out="INPUT", socket_type=kind
        )
        if name in _LIMITS:
            socket.min_value, socket.max_value = _LIMITS[name]
        socket.default_value = default
    tree.interface.new_socket(OUTPUT, in_out="OUTPUT", socket_type="NodeSocketShader")
    _fill_group(tree)
    return tree


def _fill_group(tree: bpy.types.NodeTree) -> None:
    """Marks a tree with the sockets as Blinn-Phong, with mix(transparent, diffuse + highlight +
    mirror + emission, alpha) inside.

    Other engines have no ambient light of its own: 0 · ambient is in the sum because Blender greys
    out sockets that lead nowhere.
    """
    tree[MARK] = BLINN_PHONG
    tree.nodes.clear()
    given = tree.nodes.new("NodeGroupInput").outputs
    alpha_squared = _math(
        tree, "DIVIDE", 2.25, _math(tree, "ADD", given["Exponent"], 1.9), clamp=True
    )
    roughness = _math(tree, "POWER", alpha_squared, 0.25)
    f0 = _scaled(tree, given["Specular"], _math(tree, "DIVIDE", alpha_squared, 0.26))
    parts = [
        _closure(
            tree,
            "ShaderNodeBsdfDiffuse",
            Color=_plus_nothing(tree, given["Diffuse"], given["Ambient"]),
        ),
        _closure(tree, "ShaderNodeBsdfAnisotropic", Color=f0, Roughness=roughness),
        _closure(tree, "ShaderNodeBsdfAnisotropic", Color=given["Mirror"], Roughness=0.0),
        _closure(tree, "ShaderNodeEmission", Color=given["Emission"]),
    ]
    surface = parts[0]
    for part in parts[1:]:
        surface = _joined(tree, "ShaderNodeAddShader", (surface, part))
    clear = _closure(tree, "ShaderNodeBsdfTransparent")
    mixed = _joined(tree, "ShaderNodeMixShader", (given["Alpha"], clear, surface))
    tree.links.new(mixed, tree.nodes.new("NodeGroupOutput").inputs[OUTPUT])
    for column, node in enumerate(tree.nodes):
        node.location = (180 * (column - len(tree.nodes)), 0)


def _set(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, value: object) -> None:
    """Link a socket to another, or give it a constant."""
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    else:
        socket.default_value = value


def _math(
    tree: bpy.types.NodeTree, operation: str, a: object, b: object, clamp: bool = False
) -> bpy.types.NodeSocket:
    result = _computed(tree, "ShaderNodeMath", operation, {0: a, 1: b})
    result.node.use_clamp = clamp
    return result


def _scaled(
    tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, factor: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    return _computed(tree, "ShaderNodeVectorMath", "SCALE", {0: color, "Scale": factor})


def _plus_nothing(
    tree: bpy.types.NodeTree, color: bpy.types.NodeSocket, other: bpy.types.NodeSocket
) -> bpy.types.NodeSocket:
    """0 · other + color"""
    inputs = {0: other, 1: (0.0, 0.0, 0.0), 2: color}
    return _computed(tree, "ShaderNodeVectorMath", "MULTIPLY_ADD", inputs)


def _computed(
    tree: bpy.types.NodeTree, kind: str, operation: str, inputs: dict[int | str, object]
) -> bpy.types.NodeSocket:
    node = tree.nodes.new(kind)
    node.operation = operation
    for name, value in inputs.items():
        _set(tree, node.inputs[name], value)
    return node.outputs[0]


def _closure(tree: bpy.types.NodeTree, kind: str, **inputs: object) -> bpy.types.NodeSocket:
    node = tree.nodes.new(kind)
    if kind == "ShaderNodeBsdfAnisotropic":
        node.distribution = "GGX"
    for name, value in inputs.items():
        _set(tree, node.inputs[name], value)
    return node.outputs[0]


def _joined(tree: bpy.types.NodeTree, kind: str, values: tuple) -> bpy.types.NodeSocket:
    """A node that takes its inputs in order: Add Shader, Mix Shader."""
    node = tree.nodes.new(kind)
    for socket, value in zip(node.inputs, values, strict=True):
        _set(tree, socket, value)
    return node.outputs[0]
