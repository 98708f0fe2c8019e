"""Whether what a node holds beside its inputs can be read: its own numbers, its ramp, its curves
and its texture's mapping.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import bpy

UNSOUND = (
    "Node '{}' has settings that are not finite: the socket's default takes its place in {}; set "
    "them anew"
)
LARGEST = 3.4028234663852886e38
"""Of float32: what Blender makes of an infinite number where it can keep none."""
_MAPPED = ("translation", "rotation", "scale")


def is_sound(node: Any) -> bool:
    """Whether all numbers that a node holds beside its inputs are finite."""
    return all(abs(x) < LARGEST for value in _held(node) for x in _numbers(value))


def _held(node: Any) -> Iterator[Any]:
    yield from (getattr(node, name) for name in _own(node.bl_idname, type(node)))
    yield from (
        getattr(node.texture_mapping, n) for n in _MAPPED if hasattr(node, "texture_mapping")
    )
    ramp, curves = getattr(node, "color_ramp", None), getattr(node, "mapping", None)
    for element in ramp.elements if ramp is not None else ():
        yield from (element.position, element.color)
    for curve in getattr(curves, "curves", ()):
        yield from (point.location for point in curve.points)
    if node.bl_idname == "ShaderNodeNormal":  # its direction is kept in its output
        yield node.outputs[0].default_value


@functools.cache
def _own(_name: str, kind: type) -> tuple[str, ...]:
    """The numbers that nodes of a kind have and others have not."""
    common = {p.identifier for p in bpy.types.ShaderNode.bl_rna.properties}
    return tuple(
        p.identifier
        for p in kind.bl_rna.properties
        if p.type == "FLOAT" and p.identifier not in common
    )


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, float):
        yield value
    elif hasattr(value, "__len__") and not isinstance(value, str):
        yield from value
