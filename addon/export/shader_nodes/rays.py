"""Nodes that look round the point: programs ask the scene for rays."""

from __future__ import annotations

from typing import Any

from ....engine.program.graph import Value
from ....engine.program.operations_rays import MOST_ASKED
from ..materials.terms import GREY
from .normals import given_normal
from .reader import READERS, VECTOR_TYPES, NodeInputs, Outputs, TreeReader

_BEVEL_RAYS = 4
"""For each of a bevel's Samples: with fewer normals jump where all pixels' next ray finds an
edge.
"""


def without_rays(
    reader: TreeReader, name: str, arguments: tuple[Value, ...]
) -> tuple[Value, ...] | None:
    """What an operation gives where there is no scene; None where it asks for no rays."""
    zero, nowhere = (reader.graph.constant(x) for x in (0.0, (0.0, 0.0, 0.0)))
    if name == "ambient_occlusion":
        return (reader.graph.constant(1.0),)
    if name == "bevel":
        return reader.apply("normal")
    if name == "raycast_attribute":
        return nowhere, zero
    return (zero, zero, arguments[2], nowhere, nowhere) if name == "raycast" else None


def _ambient_occlusion(view: NodeInputs) -> Outputs:
    """A Distance of 0 that nothing varies stands for the world's, as in Cycles."""
    distance = view.value("Distance")
    (open_share,) = view.apply(
        "ambient_occlusion",
        distance,
        given_normal(view),
        samples=view.node.samples,
        inside=view.node.inside,
        only_local=view.node.only_local,
        of_world=distance.constant == (0.0,),
    )
    color = view.apply("product", view.value("Color"), view.vector_of(open_share))[0]
    return {"Color": color, "AO": open_share}


def _bevel(view: NodeInputs) -> Outputs:
    """A Normal that comes in is bent by as much as the mesh's is."""
    samples = min(_BEVEL_RAYS * view.node.samples, MOST_ASKED)
    bent = view.apply("bevel", view.value("Radius"), samples=samples)[0]
    if not view.is_linked("Normal"):
        return {"Normal": bent}
    minus, one = (view.reader.graph.constant(x) for x in (-1.0, 1.0))
    turn = view.apply("scaled_sum", view.apply("normal")[0], minus, bent)[0]
    total = view.apply("scaled_sum", turn, one, view.value("Normal"))[0]
    return {"Normal": view.apply("vector_normalized", total)[0]}


def _raycast(view: NodeInputs) -> Outputs:
    """From the point along its normal where nothing else is linked, as in Cycles."""
    own = view.apply("position", shift=0)[0]
    position = view.value("Position") if view.is_linked("Position") else own
    is_linked = view.is_linked("Direction")
    direction = view.value("Direction") if is_linked else view.reader.normal()
    ray = (position, direction, view.value("Length"))
    how = {"only_local": view.node.only_local, "from_point": position is own}
    found = view.apply("raycast", *ray, **how)
    names = ("Is Hit", "Self Hit", "Hit Distance", "Hit Position", "Hit Normal")
    outputs = dict(zip(names, found, strict=True))
    for socket in view.node.inputs:
        if socket.type == "STRING":
            outputs |= _sampled(view, socket, ray, how)
    return outputs


def _sampled(view: NodeInputs, named: Any, ray: tuple[Value, ...], how: dict) -> Outputs:
    """The outputs for the attribute whose name an input holds, as an Attribute node reads it."""
    identifier = named.identifier.replace("Value_", "Attribute_")
    if named.is_linked:
        view.reader.note(
            "The name of an attribute that node 'Raycast' reads is linked in {}: it is not read "
            "and 0; write the name into the node"
        )
    name = "" if named.is_linked else named.default_value
    outputs: Outputs = {}
    for socket in view.node.outputs:
        if not (socket.is_linked and socket.identifier in (identifier, f"{identifier}_Alpha")):
            continue
        is_wide, is_color = socket.type in VECTOR_TYPES, socket.identifier == identifier
        if not name:
            value = view.reader.graph.constant((0.0, 0.0, 0.0) if is_wide else 0.0)
        elif is_color:
            attribute = name if is_wide else GREY + name
            value = view.apply("raycast_attribute", *ray, attribute=attribute, **how)[0]
            value = value if is_wide else view.apply("separate_xyz", value)[0]
        else:
            value = view.apply("raycast_attribute", *ray, attribute=name, **how)[1]
        outputs[socket.identifier] = value
    return outputs


READERS.update(
    {
        "ShaderNodeAmbientOcclusion": _ambient_occlusion,
        "ShaderNodeBevel": _bevel,
        "ShaderNodeRaycast": _raycast,
    }
)
