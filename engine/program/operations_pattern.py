"""Pattern textures: checker, gradient, wave, magic, brick and Gabor, as Cycles (kernel/svm)."""

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


class WaveType(IntEnum):
    """Blender's identifiers of straight and round waves."""

    BANDS = 0
    RINGS = 1


class WaveDirection(IntEnum):
    """Axis of bands and rings; the last one is diagonal for bands, spherical for rings."""

    X = 0
    Y = 1
    Z = 2
    ALL = 3


class WaveProfile(IntEnum):
    """Blender's identifiers of the shapes of one wave."""

    SIN = 0
    SAW = 1
    TRI = 2


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
        "wave_texture",
        sockets(color="vector", factor="number"),
        sockets(
            vector="vector",
            scale="number",
            distortion="number",
            detail="number",
            detail_scale="number",
            detail_roughness="number",
            phase="number",
        ),
        (("wave_type", WaveType), ("direction", WaveDirection), ("profile", WaveProfile)),
        "profile of 20 times the way along direction, or across it for rings, at vector scale, "
        "plus phase, plus distortion times noise in [-1, 1]",
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
