"""Nodes that look round the point: programs ask the scene for rays."""

from __future__ import annotations

from .normals import given_normal
from .reader import READERS, NodeInputs, Outputs

NOTHING_NEAR: dict[str, tuple[tuple | float, ...]] = {"ambient_occlusion": (1.0,)}
"""What operations that ask for rays give where there is no scene."""


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


READERS["ShaderNodeAmbientOcclusion"] = _ambient_occlusion
