"""Operations that read the shaded point."""

from __future__ import annotations

from .operations import Operation, Reference, sockets

INPUTS = (
    Operation(
        "attribute",
        sockets(vector="vector", alpha="number"),
        settings=(("attribute", Reference.ATTRIBUTE),),
        formula="the mesh's attribute: its first three channels, missing ones 0, and the fourth, "
        "1 where there is none; zeros where the mesh lacks it",
        reads_point=True,
    ),
    Operation(
        "uv",
        sockets(vector="vector"),
        settings=(("attribute", Reference.ATTRIBUTE),),
        formula="(u, v, 0) of a UV map, the active one where the name is empty",
        reads_point=True,
    ),
    Operation(
        "image",
        sockets(color="vector", alpha="number"),
        sockets(vector="vector"),
        (("texture", Reference.TEXTURE),),
        "the texture at x, y of vector",
        reads_point=True,
    ),
)
