"""Node trees of Blender become expressions: links, groups, conversions, and broken trees."""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest

from glint.addon.export.materials.graph import SHADER_FOR_VALUE, Place
from glint.addon.export.shader_nodes import READERS, TreeReader
from glint.addon.export.shader_nodes.reader import CIRCLE, NOT_FINITE
from glint.engine.program.execute.operations import apply
from glint.engine.program.graph import Graph, Value
from glint.engine.program.program import compile_program, instructions

REC709 = np.array([0.2126, 0.7152, 0.0722])


class Tree:
    """A material's node tree with one Diffuse BSDF, whose Color, Roughness and Normal are read."""

    def __init__(self):
        material = bpy.data.materials.new("M")
        if bpy.app.version < (5, 0, 0):
            material.use_nodes = True
        self.nodes, self.links = material.node_tree.nodes, material.node_tree.links
        self.nodes.clear()
        self.shader = self.nodes.new("ShaderNodeBsdfDiffuse")
        self.notes: list[str] = []

    def node(self, kind, **inputs):
        node = self.nodes.new(kind)
        for name, value in inputs.items():
            node.inputs[name].default_value = value
        return node

    def rgb(self, *color):
        node = self.nodes.new("ShaderNodeRGB")
        node.outputs[0].default_value = (*color, 1.0)
        return node

    def read(self, name) -> Value:
        self.graph = Graph(apply)
        reader = TreeReader(self.graph, None, self.notes.append)
        return reader.value(Place(self.shader.inputs[name]))


@pytest.fixture
def tree():
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return Tree()


def approx(*numbers):
    return pytest.approx(numbers, rel=1e-6)


def group(inside, inputs=(), kind="NodeSocketColor"):
    """A node group with one output; inside(tree, group's input node) gives the socket for it."""
    made = bpy.data.node_groups.new("G", "ShaderNodeTree")
    for name, socket in inputs:
        made.interface.new_socket(name, in_out="INPUT", socket_type=socket)
    made.interface.new_socket("Out", in_out="OUTPUT", socket_type=kind)
    entry, end = made.nodes.new("NodeGroupInput"), made.nodes.new("NodeGroupOutput")
    made.links.new(inside(made, entry), end.inputs[0])
    return made


def test_a_colour_becomes_a_number_by_luminance_and_a_vector_by_its_mean(tree):
    tree.links.new(tree.rgb(1.0, 0.5, 0.25).outputs[0], tree.shader.inputs["Roughness"])
    assert tree.read("Roughness").constant == approx(REC709 @ [1.0, 0.5, 0.25])

    vector = tree.node("ShaderNodeCombineXYZ", X=1.0, Y=0.5, Z=0.25)
    tree.links.new(vector.outputs[0], tree.shader.inputs["Roughness"])
    assert tree.read("Roughness").constant == approx(1.75 / 3)


def test_a_number_fills_a_colour_and_a_vector_becomes_one_unchanged(tree):
    value = tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 0.25
    tree.links.new(value.outputs[0], tree.shader.inputs["Color"])
    assert tree.read("Color").constant == approx(0.25, 0.25, 0.25)

    vector = tree.node("ShaderNodeCombineXYZ", X=1.0, Y=0.5, Z=0.25)
    tree.links.new(vector.outputs[0], tree.shader.inputs["Color"])
    assert tree.read("Color").constant == approx(1.0, 0.5, 0.25)


def test_values_convert_at_the_edge_of_a_group(tree):
    """A vector through a number's socket is grey inside; from Blender 5.0 on a colour of an RGB
    node is not.
    """
    made = group(lambda _, entry: entry.outputs[0], [("In", "NodeSocketFloat")])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = made
    vector = tree.nodes.new("ShaderNodeCombineXYZ")
    for socket, value in zip(vector.inputs, (1.0, 0.5, 0.3), strict=True):
        socket.default_value = value
    tree.links.new(vector.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], tree.shader.inputs["Color"])
    assert tree.read("Color").constant == approx(0.6, 0.6, 0.6)

    tree.links.new(tree.rgb(1.0, 0.5, 0.25).outputs[0], node.inputs[0])
    grey = REC709 @ [1.0, 0.5, 0.25]
    wanted = (1.0, 0.5, 0.25) if bpy.app.version >= (5, 0, 0) else (grey, grey, grey)
    assert tree.read("Color").constant == approx(*wanted)


def test_separate_takes_the_part_that_is_linked(tree):
    parts = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(tree.rgb(0.1, 0.2, 0.3).outputs[0], parts.inputs[0])
    tree.links.new(parts.outputs["Y"], tree.shader.inputs["Roughness"])
    assert tree.read("Roughness").constant == approx(0.2)


def test_a_muted_node_passes_its_input_on_and_without_one_counts_as_unlinked(tree):
    node = tree.nodes.new("ShaderNodeRGBToBW")
    tree.links.new(tree.rgb(1.0, 0.0, 0.0).outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], tree.shader.inputs["Roughness"])
    node.mute = True
    assert tree.read("Roughness").constant == approx(REC709[0])

    value = tree.rgb(1.0, 1.0, 1.0)
    value.mute = True
    tree.links.new(value.outputs[0], tree.shader.inputs["Color"])
    tree.shader.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    assert tree.read("Color").constant == approx(0.1, 0.2, 0.3)


def test_an_unlinked_socket_gives_its_default_and_nan_counts_as_nought(tree):
    tree.shader.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    assert tree.read("Color").constant == approx(0.1, 0.2, 0.3)
    assert tree.notes == []

    tree.shader.inputs["Color"].default_value = (math.nan, 0.2, 0.3, 1.0)
    assert tree.read("Color").constant == approx(0.0, 0.2, 0.3)
    assert tree.notes == [NOT_FINITE]


def test_an_unknown_node_gives_the_default_and_a_note(tree):
    tree.shader.inputs["Roughness"].default_value = 0.75
    tree.links.new(
        tree.nodes.new("ShaderNodeShaderToRGB").outputs["Alpha"], tree.shader.inputs["Roughness"]
    )
    assert tree.read("Roughness").constant == (0.75,)
    assert len(tree.notes) == 1
    assert "Shader to RGB" in tree.notes[0]


def test_an_output_that_is_not_made_gives_the_default_and_a_note(tree, monkeypatch):
    """As one that a later Blender adds."""
    monkeypatch.setitem(READERS, "ShaderNodeParticleInfo", lambda view: {})
    tree.shader.inputs["Roughness"].default_value = 0.75
    tree.links.new(
        tree.nodes.new("ShaderNodeParticleInfo").outputs["Age"], tree.shader.inputs["Roughness"]
    )
    assert tree.read("Roughness").constant == (0.75,)
    assert tree.notes == ["'Age' of Particle Info is not supported: {} take a constant"]


def test_links_in_a_circle_end_with_a_note(tree):
    first, second = tree.node("ShaderNodeCombineXYZ", X=0.5), tree.nodes.new("ShaderNodeCombineXYZ")
    tree.links.new(first.outputs[0], second.inputs["X"])
    tree.links.new(second.outputs[0], first.inputs["Y"])
    tree.links.new(second.outputs[0], tree.shader.inputs["Color"])
    assert np.isfinite(tree.read("Color").constant).all()
    assert CIRCLE in tree.notes


def test_a_link_to_a_socket_that_the_settings_hide_is_no_circle(tree):
    """Blender calls it invalid, as it does those that close a circle."""
    node = tree.node("ShaderNodeMath", Value=0.25)
    node.operation = "MULTIPLY_ADD"
    tree.links.new(tree.rgb(1.0, 1.0, 1.0).outputs[0], node.inputs[2])
    tree.links.new(node.outputs[0], tree.shader.inputs["Roughness"])
    node.operation = "ABSOLUTE"
    assert tree.read("Roughness").constant == (0.25,)
    assert tree.notes == []


def test_a_shader_where_a_value_is_wanted_counts_for_nothing_and_is_told(tree):
    tree.shader.inputs["Roughness"].default_value = 0.25
    glows = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(glows.outputs[0], tree.shader.inputs["Roughness"])
    assert tree.read("Roughness").constant == (0.25,)
    assert tree.notes == [SHADER_FOR_VALUE.format("Diffuse BSDF", "{}")]


def test_three_hundred_nested_groups(tree):
    made = group(lambda _, entry: entry.outputs[0], [("In", "NodeSocketColor")])
    for _ in range(299):
        made = group(_nested(made), [("In", "NodeSocketColor")])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = made
    tree.links.new(tree.rgb(0.1, 0.2, 0.3).outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], tree.shader.inputs["Color"])
    assert tree.read("Color").constant == approx(0.1, 0.2, 0.3)
    assert tree.notes == []


def _nested(inner):
    def inside(made, entry):
        node = made.nodes.new("ShaderNodeGroup")
        node.node_tree = inner
        made.links.new(entry.outputs[0], node.inputs[0])
        return node.outputs[0]

    return inside


def test_a_thousand_nodes_in_a_row(tree):
    """More than Python may nest. Blender's own time for links grows with the square."""
    socket = tree.rgb(0.25, 0.25, 0.25).outputs[0]
    for _ in range(500):
        grey, vector = (
            tree.nodes.new("ShaderNodeRGBToBW"),
            tree.node("ShaderNodeCombineXYZ", Y=0.25, Z=0.25),
        )
        tree.links.new(socket, grey.inputs[0])
        tree.links.new(grey.outputs[0], vector.inputs["X"])
        socket = vector.outputs[0]
    tree.links.new(socket, tree.shader.inputs["Color"])
    assert tree.read("Color").constant == approx(0.25, 0.25, 0.25)
    assert tree.notes == []


def _sum_chain(made, entry, length):
    """The group's input plus its nodes' number, one at a time."""
    socket = entry.outputs[0]
    for _ in range(length):
        node = made.nodes.new("ShaderNodeMath")
        made.links.new(socket, node.inputs[0])
        node.inputs[1].default_value = 1.0
        socket = node.outputs[0]
    return socket


def test_five_thousand_nodes_become_as_many_instructions(tree):
    """In groups: Blender's own time for links grows with the square of a tree's nodes."""
    made = group(
        lambda made, entry: _sum_chain(made, entry, 50),
        [("In", "NodeSocketFloat")],
        "NodeSocketFloat",
    )
    socket = tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    for _ in range(100):
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = made
        tree.links.new(socket, node.inputs[0])
        socket = node.outputs[0]
    tree.links.new(socket, tree.shader.inputs["Roughness"])

    value = tree.read("Roughness")

    names = [step.operation.name for step in instructions(compile_program(tree.graph, [value]))]
    assert names == ["backfacing", *["math"] * 5000]
    assert tree.notes == []


def test_group_nodes_in_a_circle_end_with_a_note(tree):
    made = group(lambda made, entry: _sum_chain(made, entry, 2), [("In", "NodeSocketFloat")])
    first, second = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeGroup")
    first.node_tree = second.node_tree = made
    tree.links.new(first.outputs[0], second.inputs[0])
    tree.links.new(second.outputs[0], first.inputs[0])
    tree.links.new(second.outputs[0], tree.shader.inputs["Roughness"])
    assert np.isfinite(tree.read("Roughness").constant).all()
    assert CIRCLE in tree.notes


def test_muted_nodes_in_a_row_pass_a_value_on(tree):
    socket = tree.rgb(0.1, 0.2, 0.3).outputs[0]
    for _ in range(50):
        node = tree.nodes.new("ShaderNodeVectorMath")
        tree.links.new(socket, node.inputs[0])
        node.inputs[1].default_value = (1.0, 1.0, 1.0)
        node.mute = True
        socket = node.outputs[0]
    tree.links.new(socket, tree.shader.inputs["Color"])
    assert tree.read("Color").constant == approx(0.1, 0.2, 0.3)


def test_a_muted_link_counts_as_none(tree):
    tree.shader.inputs["Color"].default_value = (0.1, 0.2, 0.3, 1.0)
    link = tree.links.new(tree.rgb(1.0, 1.0, 1.0).outputs[0], tree.shader.inputs["Color"])
    link.is_muted = True
    assert tree.read("Color").constant == approx(0.1, 0.2, 0.3)
    assert tree.notes == []
