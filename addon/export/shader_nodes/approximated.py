"""Nodes that read what there is not: what they give instead, with a note."""

from __future__ import annotations

from .reader import READERS, NodeInputs, Outputs


def _point_info(view: NodeInputs) -> Outputs:
    """What is no point of a cloud has zeros in Cycles too."""
    outputs: Outputs = {}
    for name, nothing in (("Position", (0.0, 0.0, 0.0)), ("Radius", 0.0), ("Random", 0.0)):
        outputs[name] = view.left_out(name, nothing)
    return outputs


READERS.update(
    {
        "ShaderNodePointInfo": _point_info,
    }
)
