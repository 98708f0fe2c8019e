"""Operations on colours."""

from __future__ import annotations

from .operations import Operation, sockets

COLORS = (
    Operation(
        "rgb_to_bw",
        sockets(value="number"),
        sockets(color="vector"),
        formula="Rec. 709 luminance: how a colour becomes a number",
    ),
)
