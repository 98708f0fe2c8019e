"""Nodes that hold a value, and those that take vectors apart and put them together."""

from __future__ import annotations

from .luminance import luminance_of
from .reader import READERS, NodeInputs, Outputs


def _value(view: NodeInputs) -> Outputs:
    return {"Value": view.reader.default(view.node.outputs[0])}


def _rgb(view: NodeInputs) -> Outputs:
    return {"Color": view.reader.default(view.node.outputs[0])}


def _combine_xyz(view: NodeInputs) -> Outputs:
    return {"Vector": view.apply("combine_xyz", *(view.value(axis) for axis in "XYZ"))[0]}


def _separate_xyz(view: NodeInputs) -> Outputs:
    parts = view.apply("separate_xyz", view.value("Vector"))
    return dict(zip("XYZ", parts, strict=True))


def _rgb_to_bw(view: NodeInputs) -> Outputs:
    return {"Val": luminance_of(view.reader.graph, view.value("Color"))}


READERS.update(
    {
        "ShaderNodeValue": _value,
        "ShaderNodeRGB": _rgb,
        "ShaderNodeCombineXYZ": _combine_xyz,
        "ShaderNodeSeparateXYZ": _separate_xyz,
        "ShaderNodeRGBToBW": _rgb_to_bw,
    }
)
