"""Operations that ask the scene for rays: what a program reads of what is round the point."""

from __future__ import annotations

from .operations import Operation, sockets

MOST_ASKED = 128
"""Rays of a point and sample."""
_YES = range(2)

RAYS = (
    Operation(
        "ambient_occlusion",
        sockets(value="number"),
        sockets(distance="number", normal="vector"),
        (
            ("samples", range(1, MOST_ASKED + 1)),
            ("inside", _YES),
            ("only_local", _YES),
            ("of_world", _YES),
        ),
        "the share of `samples` directions round normal, or with inside round -normal, as dense as "
        "the cosine, in which nothing is nearer than distance, of_world than the world's "
        "occlusion_distance; only_local: of the point's own object. 1 where no rays can be asked",
        reads_point=True,
    ),
)
"""None is traced where a program runs that has no scene, or for rays to lights: these give what
is said for that.
"""
ASKING = frozenset(operation.name for operation in RAYS)
