"""Nodes that read the shaded point: coordinates, geometry, attributes, images, the view."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ....engine.program.graph import Value
from ....engine.program.operations_input import Shift
from ....engine.program.operations_vector import VectorMeasure
from ..images.images import FIRST, Images
from ..materials.graph import socket_named
from ..materials.terms import GREY
from .mapping import texture_mapped
from .objects import INSTANCER_GENERATED, INSTANCER_UV, property_of_object
from .projections import on_ball, on_box, on_tiles, on_tube
from .reader import (
    HAIR,
    ISLAND,
    LACKS,
    POINTINESS,
    READERS,
    TANGENT,
    UNDISPLACED_NORMAL,
    UNDISPLACED_TANGENT,
    NodeInputs,
    Outputs,
)
from .tangents import radial_tangent

ACTIVE_COLOR = "(active colour)"
"""Attribute name that stands for a mesh's active colour attribute."""
_VERTEX_COLOR = "vertex_color"
"""What Attribute nodes call that."""
NO_IMAGE = "An image texture without an image is magenta in {}: choose an image"


def _texture_coordinate(view: NodeInputs) -> Outputs:
    position = view.apply("object_position", shift=0)[0]
    if view.node.object is not None:
        position = _in_space_of(view, view.node.object)
    makers = {
        "Generated": view.reader.generated,
        "Normal": lambda: view.apply("object_normal")[0],
        "UV": lambda: view.apply("uv", attribute="", shift=0)[0],
        "Object": lambda: position,
        "Camera": lambda: view.apply("camera_position", shift=0)[0],
        "Window": lambda: view.apply("window", shift=0)[0],
        "Reflection": lambda: view.apply("reflection")[0],
    }
    if view.node.from_instancer:
        makers["Generated"] = lambda: _of_instance(view, INSTANCER_GENERATED)
        makers["UV"] = lambda: _of_instance(view, INSTANCER_UV)
    return view.used(makers)


def _number(view: NodeInputs, name: str) -> Value:
    return view.apply("attribute", attribute=name, shift=0)[1]


def _of_instance(view: NodeInputs, name: str) -> Value:
    return view.apply("instance_value", attribute=name)[0]


def _in_space_of(view: NodeInputs, other: Any) -> Value:
    """The point in another object's space."""
    matrix = [list(row) for row in other.matrix_world.inverted_safe()]
    graph = view.reader.graph
    total = graph.constant([row[3] for row in matrix[:3]])
    parts = view.apply("separate_xyz", view.apply("position", shift=0)[0])
    for k, part in enumerate(parts):
        column = graph.constant([row[k] for row in matrix[:3]])
        total = view.apply("scaled_sum", column, part, total)[0]
    return total


def _uv_map(view: NodeInputs) -> Outputs | None:
    if view.node.from_instancer:
        return {"UV": _of_instance(view, INSTANCER_UV)}
    return {"UV": view.apply("uv", attribute=view.node.uv_map, shift=0)[0]}


def _geometry(view: NodeInputs) -> Outputs:
    return view.used(
        {
            "Position": lambda: view.apply("position", shift=0)[0],
            "Normal": view.reader.normal,
            "True Normal": lambda: view.apply("face_normal")[0],
            "Incoming": lambda: view.apply("incoming")[0],
            "Backfacing": lambda: view.apply("backfacing")[0],
            "Parametric": lambda: _parametric(view),
            "Tangent": lambda: radial_tangent(view, "Z"),
            "Pointiness": lambda: _number(view, POINTINESS),
            "Random Per Island": lambda: _number(view, ISLAND),
        }
    )


def _parametric(view: NodeInputs) -> Value:
    weights = view.apply("barycentric", shift=0)[0]
    return view.apply("product", weights, view.reader.graph.constant((1.0, 1.0, 0.0)))[0]


def _wireframe(view: NodeInputs) -> Outputs:
    do = view.math
    apart = view.apply("edge_distance", shift=0)[0]
    half = do("MULTIPLY", view.value("Size"), 0.5)
    half = do("MULTIPLY", half, _pixel_width(view)) if view.node.use_pixel_size else half
    line = do("LESS_THAN", apart, half)
    return {"Fac": line, "Factor": line}


def _pixel_width(view: NodeInputs) -> Value:
    """What a pixel spans at the point, as the mean of two steps in the face's plane as they are
    seen, as in Cycles.
    """
    do, incoming, widths = view.math, view.apply("incoming")[0], []
    for axis in (Shift.FIRST, Shift.SECOND):
        step = view.apply("pixel_step", axis=int(axis))[0]
        along = view.apply("vector_measure", step, incoming, measure=VectorMeasure.DOT_PRODUCT)[0]
        across = view.apply("scaled_sum", incoming, do("MULTIPLY", along, -1.0), step)[0]
        widths.append(view.apply("vector_length", across)[0])
    return do("MULTIPLY", do("ADD", *widths), 5.0)  # a step is a tenth of a pixel


def _camera(view: NodeInputs) -> Outputs:
    position = view.apply("camera_position", shift=0)[0]
    depth = view.apply("separate_xyz", position)[2]
    length = view.apply("vector_length", position)[0]
    direction = view.apply("vector_normalized", position)[0]
    return {"View Vector": direction, "View Z Depth": depth, "View Distance": length}


def attribute_name(node: Any) -> str | None:
    """Which attribute of the mesh an Attribute or Color Attribute node reads; None where it reads
    something else, or nothing.
    """
    if getattr(node, "attribute_type", "GEOMETRY") != "GEOMETRY":
        return None
    name = getattr(node, "attribute_name", None)
    if name == _VERTEX_COLOR:
        return ACTIVE_COLOR
    if name in STANDARD:
        return None
    return (name if name is not None else (node.layer_name or ACTIVE_COLOR)) or None


def is_opaque_without(node: Any) -> bool:
    """Whether Alpha is 1 of what has no such attribute; that of Color Attribute nodes is 0."""
    return bool(node.bl_idname == "ShaderNodeAttribute")


def _attribute(view: NodeInputs) -> Outputs | None:
    if getattr(view.node, "attribute_type", "GEOMETRY") != "GEOMETRY":
        return property_of_object(view)
    name = attribute_name(view.node)
    if name is None:
        return _standard(view)
    color, alpha = view.apply("attribute", attribute=name, shift=0)
    if is_opaque_without(view.node) and view.is_used("Alpha"):
        alpha = view.math("ADD", alpha, _number(view, LACKS + name))
    outputs = {"Color": color, "Vector": color, "Alpha": alpha}
    if socket_named(view.node.outputs, "Fac") is not None:
        grey = view.apply("attribute", attribute=GREY + name, shift=0)[0]
        outputs["Fac"] = outputs["Factor"] = view.apply("separate_xyz", grey)[0]
    return outputs


def _standard(view: NodeInputs) -> Outputs:
    """Of a name in `STANDARD`, or of none, which is 0."""
    make = STANDARD.get(view.node.attribute_name, _nothing)
    color, grey = make(view)
    alpha = view.reader.graph.constant(1.0)
    return {"Color": color, "Vector": color, "Alpha": alpha, "Fac": grey, "Factor": grey}


def _nothing(view: NodeInputs) -> tuple[Value, Value]:
    return tuple(map(view.reader.graph.constant, ((0.0, 0.0, 0.0), 0.0)))


def _by_mean(view: NodeInputs, color: Value) -> tuple[Value, Value]:
    return color, view.apply("vector_average", color)[0]


def _spread(view: NodeInputs, number: Value) -> tuple[Value, Value]:
    return view.vector_of(number), number


def _tangent(view: NodeInputs, name: str) -> tuple[Value, Value]:
    return _by_mean(view, view.apply("attribute", attribute=name, shift=0)[0])


def _of_strand(view: NodeInputs, which: int) -> tuple[Value, Value]:
    """Intercept, length or the random number of a strand; 0 of what is none."""
    told = view.apply("attribute", attribute=HAIR, shift=0)[0]
    return _spread(view, view.apply("separate_xyz", told)[which])


def _uv(view: NodeInputs) -> tuple[Value, Value]:
    uv = view.apply("uv", attribute="", shift=0)[0]
    return uv, view.apply("separate_xyz", uv)[0]


STANDARD: dict[str, Callable[[NodeInputs], tuple[Value, Value]]] = {
    "N": lambda v: _by_mean(v, v.apply("attribute", attribute=UNDISPLACED_NORMAL, shift=0)[0]),
    "generated": lambda v: _by_mean(v, v.reader.generated()),
    "uv": _uv,
    "tangent": lambda v: _tangent(v, TANGENT),
    "pointiness": lambda v: _spread(v, _number(v, POINTINESS)),
    "random_per_island": lambda v: _spread(v, _number(v, ISLAND)),
    "curve_intercept": lambda v: _of_strand(v, 0),
    "curve_length": lambda v: _of_strand(v, 1),
    "curve_random": lambda v: _of_strand(v, 2),
}
"""Colour and number by names with which Attribute nodes reach what Cycles makes of every mesh and
strand, whatever attributes of its own have them.
"""
if bpy.app.version >= (5, 0, 0):
    STANDARD |= {
        "tangent_sign": lambda v: _spread(v, _number(v, TANGENT)),
        "undisplaced_tangent": lambda v: _tangent(v, UNDISPLACED_TANGENT),
        "undisplaced_tangent_sign": lambda v: _spread(v, _number(v, UNDISPLACED_TANGENT)),
    }


def tiles_of(node: Any) -> list[int]:
    """Numbers of the tiles of a node's image, none of one that is not tiled."""
    image = node.image
    is_tiled = image is not None and image.source == "TILED"
    return [tile.number for tile in image.tiles] if is_tiled else []


def image_texture(node: Any, images: Images, note: Callable[[str], None], tile: int = 0) -> int:
    """Index of an Image Texture node's texture; of a tiled image that of a tile. note: of its
    material.

    Where nothing reads the image's alpha, of this node or of one like it, its colour is times
    alpha, as in Cycles.
    """
    if node.image is None:
        note(NO_IMAGE)
    others = (
        other
        for other in node.id_data.nodes
        if other.bl_idname == node.bl_idname and other.image == node.image
    )
    alone = not any(x.outputs["Alpha"].is_linked and _is_alike(node, x) for x in others)
    how = node.extension, node.interpolation
    return images.texture(node.image, node.image_user, *how, alone, tile)


def _is_alike(node: Any, other: Any) -> bool:
    """Whether Cycles takes two Image Texture nodes of one image for one."""
    one, two = (
        [(x.extension, x.interpolation, x.projection, x.projection_blend)]
        + [link.from_socket for link in x.inputs["Vector"].links]
        for x in (node, other)
    )
    return one == two


def _image(view: NodeInputs) -> Outputs:
    uv = view.apply("uv", attribute="", shift=0)[0]
    where = view.value("Vector") if view.is_linked("Vector") else uv
    color, alpha = _projected(view, texture_mapped(view, where))
    return {"Color": color, "Alpha": alpha}


def _projected(view: NodeInputs, where: Value) -> tuple[Value, ...]:
    """Colour and alpha of an image by the node's projection of a vector. The box never leaves the
    first tile.
    """
    tiles = tiles_of(view.node)
    textures = {
        tile: image_texture(view.node, view.reader.images, view.reader.note, tile)
        for tile in ([FIRST] if view.node.projection == "BOX" and tiles else tiles or [0])
    }
    first = next(iter(textures.values()))
    if view.node.projection == "BOX":
        return on_box(view, where, first)
    if view.node.projection == "SPHERE":
        where = on_ball(view, where)
    elif view.node.projection == "TUBE":
        where = on_tube(view, where)
    return on_tiles(view, where, textures) if tiles else view.apply("image", where, texture=first)


def _fresnel(view: NodeInputs) -> Outputs:
    value = view.apply("fresnel", view.value("IOR"), _normal(view))[0]
    return {"Fac": value, "Factor": value}


def _layer_weight(view: NodeInputs) -> Outputs:
    fresnel, facing = view.apply("layer_weight", view.value("Blend"), _normal(view))
    return {"Fresnel": fresnel, "Facing": facing}


def _normal(view: NodeInputs) -> Value:
    """The input Normal, or the shading normal where nothing comes in."""
    return view.value("Normal") if view.is_linked("Normal") else view.reader.normal()


def _light_path(view: NodeInputs) -> Outputs:
    """Light that is scattered comes from points here, so no ray that is traced is a diffuse one,
    but what these points and other tables hold is seen by such.
    """
    camera, shadow, bounced, scattered = view.apply("light_path")
    direct = view.math("SUBTRACT", 1.0, view.math("ADD", bounced, scattered))
    zero, length = view.reader.graph.constant(0.0), view.reader.ray_length()
    return {
        "Is Camera Ray": camera,
        "Is Shadow Ray": view.math("MULTIPLY", shadow, direct),
        "Is Diffuse Ray": scattered,
        "Is Glossy Ray": bounced,
        "Is Singular Ray": bounced,
        "Is Volume Scatter Ray": zero,
        "Ray Length": length if length is not None else view.left_out("Ray Length", 0.0),
        "Diffuse Depth": scattered,
        "Portal Depth": zero,
        **_ray_depths(view, bounced, scattered),
    }


def _ray_depths(view: NodeInputs, bounced: Value, scattered: Value) -> Outputs:
    known, reflected = view.reader.ray_depth(), view.math("ADD", bounced, scattered)
    if known is None:
        for name in ("Ray Depth", "Glossy Depth"):
            if view.is_used(name):
                view.reader.note(
                    f"'{name}' of {view.node.bl_label} counts one bounce at most in {{}}: use "
                    "another output"
                )
        names = ("Transparent Depth", "Transmission Depth", "Is Transmission Ray")
        constants = {name: view.left_out(name, 0.0) for name in names}
        return {
            **constants,
            "Is Reflection Ray": reflected,
            "Ray Depth": view.math("ADD", reflected, 1.0),  # Cycles counts the ray to a light
            "Glossy Depth": bounced,
        }
    depth, straight, refractions, refracted = known
    mirrored = view.math("SUBTRACT", depth, refractions)
    return {
        "Ray Depth": depth,
        "Glossy Depth": view.math("SUBTRACT", mirrored, scattered),
        "Transparent Depth": straight,
        "Transmission Depth": refractions,
        "Is Transmission Ray": refracted,
        "Is Reflection Ray": view.math("SUBTRACT", reflected, refracted),
    }


READERS.update(
    {
        "ShaderNodeTexCoord": _texture_coordinate,
        "ShaderNodeUVMap": _uv_map,
        "ShaderNodeNewGeometry": _geometry,
        "ShaderNodeCameraData": _camera,
        "ShaderNodeAttribute": _attribute,
        "ShaderNodeVertexColor": _attribute,
        "ShaderNodeTexImage": _image,
        "ShaderNodeWireframe": _wireframe,
        "ShaderNodeFresnel": _fresnel,
        "ShaderNodeLayerWeight": _layer_weight,
        "ShaderNodeLightPath": _light_path,
    }
)
