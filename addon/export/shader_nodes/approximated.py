"""Nodes that would look round the point: what they give where nothing is near, with a note."""

from __future__ import annotations

from .reader import READERS, NodeInputs, Outputs


def _bevel(view: NodeInputs) -> Outputs:
    """Edges stay sharp."""
    view.reader.note("Node 'Bevel' leaves edges sharp in {}: use a Bevel modifier")
    given = view.value("Normal") if view.is_linked("Normal") else view.reader.normal()
    return {"Normal": given}


def _raycast(view: NodeInputs) -> Outputs:
    """Nothing is met."""
    view.reader.note("Node 'Raycast' meets nothing in {}: bake it to an image")
    zero, nowhere = (view.reader.graph.constant(x) for x in (0.0, (0.0, 0.0, 0.0)))
    numbers = dict.fromkeys(("Is Hit", "Self Hit", "Hit Distance"), zero)
    return {**numbers, "Hit Position": nowhere, "Hit Normal": nowhere}


def _point_info(view: NodeInputs) -> Outputs:
    """What is no point of a cloud has zeros in Cycles too."""
    outputs: Outputs = {}
    for name, nothing in (("Position", (0.0, 0.0, 0.0)), ("Radius", 0.0), ("Random", 0.0)):
        outputs[name] = view.left_out(name, nothing)
    return outputs


READERS.update(
    {
        "ShaderNodeBevel": _bevel,
        "ShaderNodeRaycast": _raycast,
        "ShaderNodePointInfo": _point_info,
    }
)
