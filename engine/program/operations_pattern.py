"""Pattern textures: checker, gradient, magic, brick and Gabor, as Cycles (kernel/svm)."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, sockets


class GradientType(IntEnum):
    """Blender's identifiers of the Gradient Texture's shapes."""

    LINEAR = 0
    QUADRATIC = 1
    EASING = 2
    DIAGONAL = 3
    RADIAL = 4
    QUADRATIC_SPHERE = 5
    SPHERICAL = 6


PATTERNS = (
    Operation(
        "checker_texture",
        sockets(color="vector", factor="number"),
        sockets(vector="vector", color1="vector", color2="vector", scale="number"),
        formula="color1 and 1, or color2 and 0, in cubes of vector scale by turns",
    ),
    Operation(
        "gradient_texture",
        sockets(color="vector", factor="number"),
        sockets(vector="vector"),
        (("gradient_type", GradientType),),
        "gradient_type of vector, held in [0, 1]",
    ),
    Operation(
        "magic_texture",
        sockets(color="vector", factor="number"),
        sockets(vector="vector", scale="number", distortion="number"),
        (("depth", range(11)),),
        "sines of vector scale, put into sines depth times; factor is the mean of the channels",
    ),
    Operation(
        "brick_texture",
        sockets(color="vector", factor="number"),
        sockets(
            vector="vector",
            color1="vector",
            color2="vector",
            mortar="vector",
            scale="number",
            mortar_size="number",
            mortar_smooth="number",
            bias="number",
            brick_width="number",
            row_height="number",
            offset="number",
            squash="number",
        ),
        (("offset_frequency", range(100)), ("squash_frequency", range(100))),
        "bricks in x and y of vector scale, each a mixture of color1 and color2, and mortar, where "
        "factor is 1; every offset_frequency-th row is shifted, every squash_frequency-th "
        "has bricks of another width",
    ),
    Operation(
        "gabor_texture",
        sockets(value="number", phase="number", intensity="number"),
        sockets(
            vector="vector",
            scale="number",
            frequency="number",
            anisotropy="number",
            orientation_2d="number",
            orientation_3d="vector",
        ),
        (("dimensions", range(2, 4)),),
        "Gabor noise at vector scale, of waves along the orientation, a share 1 - anisotropy of it "
        "random; the value brought to [0, 1], phase in [0, 1] of a turn",
    ),
)
