"""Noise textures."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, sockets


class NoiseType(IntEnum):
    """Blender's identifiers of ways of adding octaves, numbered as in Cycles."""

    MULTIFRACTAL = 0
    FBM = 1
    HYBRID_MULTIFRACTAL = 2
    RIDGED_MULTIFRACTAL = 3
    HETERO_TERRAIN = 4


OCTAVES = dict.fromkeys(("scale", "detail", "roughness", "lacunarity"), "number")
"""Sockets of textures that are added up at ever smaller scales."""
_DIMENSIONS = ("dimensions", range(1, 5))

NOISES = (
    Operation(
        "white_noise",
        sockets(value="number", color="vector"),
        sockets(vector="vector", w="number"),
        (_DIMENSIONS,),
        "hashes of the float32 bits of w, xy, xyz or xyzw",
    ),
    Operation(
        "noise_texture",
        sockets(value="number", color="vector"),
        sockets(
            vector="vector",
            w="number",
            **OCTAVES,
            offset="number",
            gain="number",
            distortion="number",
        ),
        (_DIMENSIONS, ("noise_type", NoiseType), ("normalize", range(2))),
        "octaves of Perlin noise",
    ),
)
