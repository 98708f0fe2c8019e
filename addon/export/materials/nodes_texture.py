"""Image, attribute and coordinate nodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....engine.scene import Input
from ..shader_nodes.inputs import attribute_name, image_texture, is_opaque_without, tiles_of
from ..shader_nodes.mapping import is_plain
from .evaluator import COLOR_NODES, VECTOR_NODES, Coordinates, NodeView
from .terms import GREY, Sum, from_input


def _image_texture(view: NodeView, output: Any) -> Sum | None:
    """A texture factor, where it lies flat in a UV map. Where only the colour is used it is times
    alpha, as in Cycles; where alpha is used too, they are kept apart.
    """
    place = view.input("Vector")
    coordinates = view.evaluator.coordinates(place) if place else Coordinates("")
    is_flat = view.node.projection == "FLAT" and is_plain(view.node.texture_mapping)
    if coordinates is None or not is_flat or tiles_of(view.node):
        return None
    return from_input(
        Input(
            texture=image_texture(view.node, view.evaluator.images, view.note),
            uv=coordinates.uv,
            uv_transform=coordinates.matrix[:2],
            channel="ALPHA" if output.name == "Alpha" else "COLOR",
        )
    )


def _attribute(view: NodeView, output: Any) -> Sum | None:
    """Geometry attributes as a factor; the numbers Fac and Alpha too."""
    name = attribute_name(view.node)
    if name is None or (output.name == "Alpha" and is_opaque_without(view.node)):
        return None
    if output.name == "Alpha":
        return from_input(Input(attribute=name, attribute_channel="ALPHA"))
    return from_input(Input(attribute=GREY + name if output.name in ("Fac", "Factor") else name))


COLOR_NODES["ShaderNodeTexImage"] = _image_texture
COLOR_NODES["ShaderNodeVertexColor"] = _attribute
COLOR_NODES["ShaderNodeAttribute"] = _attribute


def _uv_map(view: NodeView, output: Any) -> Coordinates | None:
    return Coordinates(view.node.uv_map) if not view.node.from_instancer else None


def _texture_coordinate(view: NodeView, output: Any) -> Coordinates | None:
    return Coordinates("") if output.name == "UV" and not view.node.from_instancer else None


def _attribute_vector(view: NodeView, output: Any) -> Coordinates | None:
    name = attribute_name(view.node)
    return Coordinates(name) if name and output.name in ("Vector", "Color") else None


def _mapping(view: NodeView, output: Any) -> Coordinates | None:
    """Scale, rotation (XYZ Euler) and translation of an affine vector; TEXTURE is the inverse of
    POINT.
    """
    kind = view.node.vector_type
    location, rotation, scaling = (view.vector(name) for name in ("Location", "Rotation", "Scale"))
    inner = view.evaluator.coordinates(view.input("Vector"))
    if inner is None or None in (location, rotation, scaling) or kind == "NORMAL":
        return None
    offset = np.array(
        [[0, 0, x] for x in (location if kind != "VECTOR" else (0, 0, 0))], np.float64
    )
    turn, size = euler_matrix(rotation), np.array(scaling)
    if kind == "TEXTURE":
        inverse = np.divide(1.0, size, out=np.zeros(3), where=size != 0)
        return inner.with_array(inverse[:, None] * (turn.T @ (inner.array - offset)))
    return inner.with_array(turn @ (size[:, None] * inner.array) + offset)


def euler_matrix(angles: tuple[float, float, float]) -> np.ndarray:
    """(3, 3): rotation about x, then y, then z (Blender's XYZ order), radians."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(a), math.sin(a)) for a in angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


VECTOR_NODES["ShaderNodeUVMap"] = _uv_map
VECTOR_NODES["ShaderNodeTexCoord"] = _texture_coordinate
VECTOR_NODES["ShaderNodeAttribute"] = _attribute_vector
VECTOR_NODES["ShaderNodeMapping"] = _mapping
