"""Projections of Image Texture nodes: where a vector reads the image, in the terms of Cycles.

Ball and tube span the vectors' cube from 0 to 1, seen from its centre. The box lays the image on
the three planes of the vector's axes; the normal in the object's space says how much of each.
"""

from __future__ import annotations

import math
from itertools import pairwise

from ....engine.program.graph import Value
from ..images.images import FIRST, TILES_IN_A_ROW
from .reader import Arithmetic, NodeInputs


def on_ball(view: NodeInputs, vector: Value) -> Value:
    """Longitude and latitude; the corner of the image at the centre of the ball."""
    do = view.math
    x, y, z = _from_centre(view, vector)
    across = do("SQRT", do("MULTIPLY_ADD", x, x, do("MULTIPLY", y, y)))
    inside = do("GREATER_THAN", do("ADD", across, do("ABSOLUTE", z)), 0.0)
    # Cycles gives the axis the longitude 0 where the ball elsewhere has 0.5 ahead of it.
    off_axis = do("GREATER_THAN", across, 0.0)
    u = do("MULTIPLY_ADD", do("ARCTAN2", x, y), -0.5 / math.pi, 0.5)
    v = do("MULTIPLY_ADD", do("ARCTAN2", z, across), 1 / math.pi, 0.5)
    return do.plane(do("MULTIPLY", u, off_axis), do("MULTIPLY", v, inside))


def on_tube(view: NodeInputs, vector: Value) -> Value:
    """Longitude and height; the corner of the image on the axis."""
    do = view.math
    x, y, z = _from_centre(view, vector)
    off_axis = do("GREATER_THAN", do("MAXIMUM", do("ABSOLUTE", x), do("ABSOLUTE", y)), 0.0)
    u = do("MULTIPLY_ADD", do("ARCTAN2", x, y), -0.5 / math.pi, 0.5)
    v = do("MULTIPLY_ADD", z, 0.5, 0.5)
    return do.plane(do("MULTIPLY", u, off_axis), do("MULTIPLY", v, off_axis))


def _from_centre(view: NodeInputs, vector: Value) -> tuple[Value, ...]:
    """The vector's numbers from -1 to 1 where they were from 0 to 1."""
    do = view.math
    return tuple(do("MULTIPLY_ADD", x, 2.0, -1.0) for x in view.apply("separate_xyz", vector))


def on_box(view: NodeInputs, vector: Value, texture: int) -> tuple[Value, Value]:
    """Colour and alpha of the image on the planes x, y and z, by the weights of the normal."""
    do = view.math
    x, y, z = view.apply("separate_xyz", vector)
    normal = view.apply("separate_xyz", view.apply("object_normal")[0])
    weights = box_weights(do, normal, float(view.node.projection_blend))
    x_ahead, y_ahead = (do("SUBTRACT", 1.0, number) for number in (x, y))
    # The image is never seen from behind: it is turned over with the side of the plane.
    planes = (
        (_either(do, do("LESS_THAN", normal[0], 0.0), y_ahead, y), z),
        (_either(do, do("GREATER_THAN", normal[1], 0.0), x_ahead, x), z),
        (_either(do, do("GREATER_THAN", normal[2], 0.0), y_ahead, y), x),
    )
    color, alpha = view.reader.graph.constant((0.0, 0.0, 0.0)), do.number(0.0)
    for weight, (u, v) in zip(weights, planes, strict=True):
        seen, opacity = view.apply("image", do.plane(u, v), texture=texture)
        color = view.apply("scaled_sum", seen, weight, color)[0]
        alpha = do("MULTIPLY_ADD", opacity, weight, alpha)
    return color, alpha


def on_tiles(view: NodeInputs, where: Value, textures: dict[int, int]) -> tuple[Value, Value]:
    """Colour and alpha of a tiled image, whose textures are given by the tiles' numbers; magenta
    where it has no tile.

    Tiles end at whole numbers toward 0, as in Cycles: just below 0 the first one goes on.
    """
    do = view.math
    u, v, _ = view.apply("separate_xyz", where)
    column, row = do("TRUNC", u), do("TRUNC", v)
    inside = do.plane(do("SUBTRACT", u, column), do("SUBTRACT", v, row))
    color, alpha = view.reader.graph.constant((0.0, 0.0, 0.0)), do.number(0.0)
    left = do.number(1.0)
    for number, texture in textures.items():
        above, across = divmod(number - FIRST, TILES_IN_A_ROW)
        in_row = do("COMPARE", row, float(above), 0.5)
        here = do("MULTIPLY", do("COMPARE", column, float(across), 0.5), in_row)
        seen, opacity = view.apply("image", inside, texture=texture)
        color = view.apply("scaled_sum", seen, here, color)[0]
        alpha = do("MULTIPLY_ADD", opacity, here, alpha)
        left = do("SUBTRACT", left, here)
    missing = view.reader.graph.constant((1.0, 0.0, 1.0))
    return view.apply("scaled_sum", missing, left, color)[0], do("ADD", alpha, left)


def _either(do: Arithmetic, is_first: Value, first: Value, second: Value) -> Value:
    """first where is_first is 1, second where it is 0."""
    return do("MULTIPLY_ADD", is_first, do("SUBTRACT", first, second), second)


def box_weights(do: Arithmetic, normal: tuple[Value, ...], blend: float) -> list[Value]:
    """How much each of the three planes is seen.

    The normal's absolute numbers are places in a triangle: one plane alone at each corner, a mix of
    two along the edges between them, of three in the middle. blend in [0, 1] widens the mixes.
    """
    sizes = [do("ABSOLUTE", x) for x in normal]
    whole = do("ADD", do("ADD", sizes[0], sizes[1]), sizes[2])
    parts = [do("DIVIDE", size, whole) for size in sizes]
    limit = 0.5 * (1.0 + blend)
    alone = [_is_alone(do, parts, k, limit) for k in range(3)]
    left = do("SUBTRACT", do("SUBTRACT", do("SUBTRACT", 1.0, alone[0]), alone[1]), alone[2])
    if blend <= 0.0:
        return [do("ADD", alone[0], left), alone[1], alone[2]]
    weights = alone
    for first, second in (*pairwise(range(3)), (0, 2)):
        both = do("ADD", parts[first], parts[second])
        third = parts[3 - first - second]
        here = do("MULTIPLY", left, do("LESS_THAN", third, do("MULTIPLY", both, 1.0 - limit)))
        left = do("SUBTRACT", left, here)
        share = do("SUBTRACT", do("DIVIDE", parts[first], both), 0.5 * (1.0 - blend))
        share = do("DIVIDE", share, blend, clamp=1)
        weights[first] = do("MULTIPLY_ADD", here, share, weights[first])
        weights[second] = do("MULTIPLY_ADD", here, do("SUBTRACT", 1.0, share), weights[second])
    steep, shift = (2.0 - limit) / (2.0 * limit - 1.0), (limit - 1.0) / (2.0 * limit - 1.0)
    middle = [do("MULTIPLY_ADD", part, steep, shift) for part in parts]
    return [do("MULTIPLY_ADD", left, m, w) for m, w in zip(middle, weights, strict=True)]


def _is_alone(do: Arithmetic, parts: list[Value], k: int, limit: float) -> Value:
    """1 where plane k outweighs both others, else 0."""
    least = [
        do("GREATER_THAN", parts[k], do("MULTIPLY", do("ADD", parts[k], parts[other]), limit))
        for other in range(3)
        if other != k
    ]
    return do("MULTIPLY", *least)
