"""Operations that ask the scene for rays: what a program reads of what is round the point."""

from __future__ import annotations

from .operations import Operation, Reference, sockets

MOST_ASKED = 128
"""Rays of a point and sample."""
_SAMPLES = ("samples", range(1, MOST_ASKED + 1))
_YES = range(2)
_RAY = sockets(position="vector", direction="vector", length="number")
_RAY_KIND = (("only_local", _YES), ("from_point", _YES))

RAYS = (
    Operation(
        "ambient_occlusion",
        sockets(value="number"),
        sockets(distance="number", normal="vector"),
        (
            _SAMPLES,
            ("inside", _YES),
            ("only_local", _YES),
            ("of_world", _YES),
        ),
        "the share of `samples` directions round normal, or with inside round -normal, as dense as "
        "the cosine, in which nothing is nearer than distance, of_world than the world's "
        "occlusion_distance; only_local: of the point's own object. 1 where no rays can be asked",
        reads_point=True,
    ),
    Operation(
        "bevel",
        sockets(normal="vector"),
        sockets(radius="number"),
        (_SAMPLES,),
        "the mean of the shading normals of the point's own object within radius, by (1 - distance "
        "/ radius)³, unit and turned to the viewer; the point's where no rays can be asked",
        reads_point=True,
    ),
    Operation(
        "raycast",
        sockets(hit="number", own="number", distance="number", position="vector", normal="vector"),
        _RAY,
        _RAY_KIND,
        "whether a ray from position, from_point from the shaded point, along direction meets "
        "anything within length times that, only_local the point's own object; whether that is the "
        "point's own, how often direction leads there, where it is, its shading normal, turned "
        "back. Without a hit, or where no rays can be asked, length and zeros",
        reads_point=True,
    ),
    Operation(
        "raycast_attribute",
        sockets(vector="vector", alpha="number"),
        _RAY,
        (*_RAY_KIND, ("attribute", Reference.ATTRIBUTE)),
        "what attribute gives where the ray of raycast ends: by a ray of its own; zeros without a "
        "hit, or where no rays can be asked",
        reads_point=True,
    ),
)
"""None is traced where a program runs that has no scene, or for rays to lights: these give what
is said for that.
"""
ASKING = frozenset(operation.name for operation in RAYS)
