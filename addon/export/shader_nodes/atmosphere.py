"""The Sky Texture."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ....engine.program.graph import Value
from ....engine.scene import Texture
from ..images.colorspace import rgb_from_xyz, working_space
from ..skies import Air, disc, horizon, sky
from .hosek import over_preetham
from .reader import READERS, NodeInputs, Outputs, texture_vector
from .sky import SkyReader, Sun
from .spectra import at_least_black

_SCATTERING = {"NISHITA": False, "SINGLE_SCATTERING": False, "MULTIPLE_SCATTERING": True}
_HIGHEST = math.pi / 2 - 0.001


def _sky(view: NodeInputs) -> Outputs:
    kind = view.node.sky_type
    if kind == "HOSEK_WILKIE":
        found = _hosek(view)
    elif kind in _SCATTERING:
        found = _scattered(view, _SCATTERING[kind])
    else:
        found = _preetham(view, view.node.turbidity)
    return {"Color": at_least_black(view, found)}


def _hosek(view: NodeInputs) -> Value:
    """Preetham's sky, as bright as theirs (2012) is on the whole."""
    view.reader.note(
        "The Hosek / Wilkie sky of {} has the spread of Preetham's; choose another for its own"
    )
    node, most = view.node, math.pi / 2
    turbidity = min(max(node.turbidity, 2.0), 10.0)
    x, y, z = node.sun_direction
    elevation = max(0.0, min(most, math.atan2(z, math.hypot(x, y))))
    over = over_preetham(turbidity, elevation, min(max(node.ground_albedo, 0.0), 1.0))
    return view.apply("product", _preetham(view, turbidity), view.reader.graph.constant(over))[0]


def sun_of(node: Any) -> tuple[float, float]:
    """Elevation up to a right angle and rotation of a sun that may go on over the zenith."""
    elevation = math.remainder(node.sun_elevation, 2 * math.pi)
    if abs(elevation) < math.pi / 2:
        return elevation, node.sun_rotation
    return math.copysign(math.pi, elevation) - elevation, node.sun_rotation + math.pi


def _scattered(view: NodeInputs, multiple: bool) -> Value:
    node, do = view.node, view.math
    elevation, rotation = sun_of(node)
    aerosol = getattr(node, "aerosol_density", None)
    aerosol = node.dust_density if aerosol is None else aerosol
    densities = (node.air_density, aerosol, node.ozone_density)
    air = Air(elevation, node.altitude, *densities, multiple)
    direction = texture_vector(view)
    x, y, z = view.apply("separate_xyz", direction)
    height = do("SUBTRACT", math.pi / 2, do("ARCCOSINE", z))
    u = do("MULTIPLY_ADD", do("ARCTAN2", y, x), -0.5 / math.pi, -0.25 - rotation / (2 * math.pi))
    root = do("SQRT", do("MULTIPLY", do("ABSOLUTE", height), 2 / math.pi))
    v = do("MULTIPLY_ADD", do("MULTIPLY", root, do("SIGN", height)), 0.5, 0.5)
    where = do.plane(do("FRACT", u), v)
    texture = view.reader.images.made(("SKY", air, working_space()), lambda: _texture(air))
    seen = view.apply("image", where, texture=texture)[0]
    flat = math.cos(elevation)
    to_sun = (flat * math.sin(rotation), flat * math.cos(rotation), math.sin(elevation))
    if not (node.sun_disc and _is_shown(view, direction, Sun(to_sun, node.sun_size))):
        return seen
    return _with_disc(view, seen, air, direction, (height, to_sun))


def _is_shown(view: NodeInputs, direction: Value, sun: Sun) -> bool:
    """Whether the disc is in the picture that is read, of which a world hears."""
    reader = view.reader
    if not isinstance(reader, SkyReader):
        return True
    if direction is not reader.generated():
        reader.note("The sun's disc in {} may light too little: turn the sun, not the vector")
    elif reader.suns is not None:
        reader.suns.append(sun)
    else:
        return False
    return True


def _texture(air: Air) -> Texture:
    values = sky(air) @ rgb_from_xyz().T
    pixels = np.ones((*values.shape[:2], 4), np.float32)
    pixels[..., :3] = values
    return Texture("sky", pixels, extension="EXTEND")


def _with_disc(
    view: NodeInputs, seen: Value, air: Air, direction: Value, place: tuple[Value, tuple]
) -> Value:
    """The sky with the sun's disc, darker toward its limb."""
    node, do, constant = view.node, view.math, view.reader.graph.constant
    height, sun = place
    minus = constant(tuple(-x for x in sun))
    apart = view.apply("scaled_sum", minus, do.number(1.0), direction)[0]
    angle = do("ARCSINE", do("MULTIPLY", view.apply("vector_length", apart)[0], 0.5))
    part = do("MULTIPLY", angle, 4 / node.sun_size)
    inside = do(
        "MULTIPLY", do("LESS_THAN", part, 1.0), do("GREATER_THAN", height, horizon(node.altitude))
    )
    limb = do("SQRT", do("SUBTRACT", 1.0, do("MULTIPLY", part, part)))
    bright = do("MULTIPLY", inside, do("MULTIPLY_ADD", limb, 0.6, 0.4))
    way = do("MULTIPLY_ADD", do("SUBTRACT", height, air.elevation), 1 / node.sun_size, 0.5)
    low, high = (node.sun_intensity * rgb_from_xyz() @ end for end in disc(air, node.sun_size))
    color = view.apply("scaled_sum", constant(high - low), way, constant(low))[0]
    return view.apply("scaled_sum", color, bright, seen)[0]


def _preetham(view: NodeInputs, turbidity: float) -> Value:
    """Preetham, Shirley and Smits, "A practical analytic model for daylight" (1999)."""
    do = view.math
    sun = np.array(view.node.sun_direction, float)
    sun = sun / (np.sqrt((sun * sun).sum()) or 1.0)
    polar, around = math.acos(max(-1.0, min(1.0, sun[2]))), math.atan2(sun[0], sun[1])
    x, y, z = view.apply("separate_xyz", texture_vector(view))
    theta = do("ARCCOSINE", z)
    turn = do("COSINE", do("SUBTRACT", do("ARCTAN2", x, y), around))
    across = do("MULTIPLY", do("MULTIPLY", do("SINE", theta), math.sin(polar)), turn)
    cosine = do("MULTIPLY_ADD", do("COSINE", theta), math.cos(polar), across)
    gamma = do("ARCCOSINE", cosine)
    up = do("COSINE", do("MINIMUM", theta, _HIGHEST))
    zenith = _zenith(polar, turbidity)
    parts = [
        do("MULTIPLY", _perez(view, row, up, gamma), value / _perez_at(row, polar))
        for value, row in zip(zenith, _distributions(turbidity), strict=True)
    ]
    bright, first, second = parts
    scale = do("DIVIDE", bright, second)
    rest = do("SUBTRACT", do("SUBTRACT", 1.0, first), second)
    xyz = (do("MULTIPLY", first, scale), bright, do("MULTIPLY", rest, scale))
    total = view.reader.graph.constant((0.0, 0.0, 0.0))
    for column, part in zip(rgb_from_xyz().T, xyz, strict=True):
        total = view.apply("scaled_sum", view.reader.graph.constant(column), part, total)[0]
    return total


def _distributions(t: float) -> tuple[tuple[float, ...], ...]:
    """Perez' five numbers of Y, x and y."""
    return (
        (0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771,
         -0.0670 * t + 0.3703),
        (-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989,
         -0.0033 * t + 0.0452),
        (-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537,
         -0.0109 * t + 0.0529),
    )  # fmt: skip


def _zenith(s: float, t: float) -> tuple[float, float, float]:
    """Y, x and y straight above."""
    bright = (4.0453 * t - 4.9710) * math.tan((4 / 9 - t / 120) * (math.pi - 2 * s))
    powers = np.array([s**3, s**2, s, 1.0])
    x = np.array([[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394],
                  [0.11693, -0.21196, 0.06052, 0.25886]])  # fmt: skip
    y = np.array([[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516],
                  [0.15346, -0.26756, 0.06670, 0.26688]])  # fmt: skip
    turbid = np.array([t * t, t, 1.0])
    return 0.06 * (bright - 0.2155 * t + 2.4192), *(float(turbid @ m @ powers) for m in (x, y))


def _perez_at(row: tuple[float, ...], gamma: float) -> float:
    """At the zenith."""
    a, b, c, d, e = row
    return (1 + a * math.exp(b)) * (1 + c * math.exp(d * gamma) + e * math.cos(gamma) ** 2)


def _perez(view: NodeInputs, row: tuple[float, ...], up: Value, gamma: Value) -> Value:
    do = view.math
    a, b, c, d, e = row
    first = do("MULTIPLY_ADD", do("EXPONENT", do("DIVIDE", b, up)), a, 1.0)
    cosine = do("COSINE", gamma)
    rest = do("MULTIPLY_ADD", do("MULTIPLY", cosine, cosine), e, 1.0)
    return do(
        "MULTIPLY", first, do("MULTIPLY_ADD", do("EXPONENT", do("MULTIPLY", gamma, d)), c, rest)
    )


READERS["ShaderNodeTexSky"] = _sky
