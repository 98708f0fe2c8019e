"""Operations on colours, and those that read tables."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, Reference, sockets

BlendType = IntEnum(
    "BlendType",
    "MIX DARKEN MULTIPLY BURN LIGHTEN SCREEN DODGE ADD OVERLAY SOFT_LIGHT LINEAR_LIGHT DIFFERENCE "
    "EXCLUSION SUBTRACT DIVIDE HUE SATURATION COLOR VALUE",
    start=0,
)
"""Blender's identifiers of the Mix node's blend modes."""


class ColorMode(IntEnum):
    """Blender's identifiers of what Separate and Combine Color take colours apart into."""

    RGB = 0
    HSV = 1
    HSL = 2


class RangeType(IntEnum):
    """Blender's identifiers of how Map Range interpolates."""

    LINEAR = 0
    STEPPED = 1
    SMOOTHSTEP = 2
    SMOOTHERSTEP = 3


_COLOR = sockets(color="vector")

COLORS = (
    Operation(
        "rgb_to_bw",
        sockets(value="number"),
        _COLOR,
        formula="Rec. 709 luminance: how a colour becomes a number",
    ),
    Operation(
        "mix_color",
        _COLOR,
        sockets(factor="number", a="vector", b="vector"),
        (("blend_type", BlendType),),
        "a blended with b, by factor",
    ),
    Operation(
        "mix_vector",
        sockets(vector="vector"),
        sockets(factor="vector", a="vector", b="vector"),
        formula="(1 - factor) a + factor b, channel by channel",
    ),
    Operation(
        "mix_number",
        sockets(value="number"),
        sockets(factor="number", a="number", b="number"),
        formula="(1 - factor) a + factor b",
    ),
    Operation(
        "gamma",
        _COLOR,
        sockets(color="vector", gamma="number"),
        formula="color^gamma of positive channels, others as they are; 1 where gamma is 0",
    ),
    Operation(
        "bright_contrast",
        _COLOR,
        sockets(color="vector", bright="number", contrast="number"),
        formula="max((1 + contrast) color + bright - contrast / 2, 0)",
    ),
    Operation(
        "invert",
        _COLOR,
        sockets(factor="number", color="vector"),
        formula="factor (1 - color) + (1 - factor) color",
    ),
    Operation(
        "hue_saturation",
        _COLOR,
        sockets(hue="number", saturation="number", value="number", factor="number", color="vector"),
        formula="in HSV the hue turned by hue - 1/2, saturation and value scaled; mixed with color "
        "by factor, at least 0",
    ),
    Operation(
        "separate_color",
        sockets(first="number", second="number", third="number"),
        _COLOR,
        (("mode", ColorMode),),
        "the channels of color in mode",
    ),
    Operation(
        "combine_color",
        _COLOR,
        sockets(first="number", second="number", third="number"),
        (("mode", ColorMode),),
        "the colour whose channels in mode these are",
    ),
    Operation(
        "map_range",
        sockets(value="number"),
        sockets(
            value="number",
            from_min="number",
            from_max="number",
            to_min="number",
            to_max="number",
            steps="number",
        ),
        (("interpolation", RangeType),),
        "value from one range to another; 0 where the first is empty",
    ),
    Operation(
        "ramp",
        sockets(color="vector", alpha="number"),
        sockets(factor="number"),
        (("interpolates", range(2)), ("table", Reference.TABLE)),
        "the table's rows of red, green, blue and alpha, evenly over factors from 0 to 1",
    ),
    Operation(
        "lookup",
        sockets(first="number", second="number", third="number", fourth="number"),
        sockets(factor="number"),
        (("last", range(4)), ("table", Reference.TABLE)),
        "the table's columns up to number `last`, evenly over factors from 0 to 1 and straight in "
        "between; 0 beyond them",
    ),
    Operation(
        "curves",
        _COLOR,
        sockets(factor="number", color="vector"),
        (("extends", range(2)), ("table", Reference.TABLE)),
        "each channel by its own column of the table, whose first two numbers are where it begins "
        "and ends, beyond that going on straight if extends; mixed with color by factor",
    ),
    Operation(
        "piecewise",
        _COLOR,
        sockets(x="number"),
        (("table", Reference.TABLE),),
        "for each channel a / x + b + c x + d x² + e x³, of the last of the table's rows that "
        "begins at x or before, or the first: where it begins, and a to e of each channel",
    ),
)
