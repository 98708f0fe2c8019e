"""The light that the atmosphere scatters, as Cycles' physical skies have it.

Images of the sky have ROWS by COLUMNS texels of CIE XYZ: columns go round once, from the side
opposite the sun; row r of height 2 r / ROWS - 1 = l is of the elevation sign(l) l² π / 2. Lengths
and densities are in each model's own unit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

Array = np.ndarray
ROWS, COLUMNS = 256, 512


@dataclass(frozen=True)
class Air:
    """What the sky depends on. elevation: of the sun, radians; altitude: of the viewer, metres;
    densities as shares of the usual. multiple: light is scattered more than once.
    """

    elevation: float
    altitude: float
    air: float
    aerosol: float
    ozone: float
    multiple: bool

    @property
    def densities(self) -> Array:
        return np.array([self.air, self.aerosol, self.ozone])


@lru_cache(maxsize=4)
def sky(air: Air) -> Array:
    """(ROWS, COLUMNS, 3) XYZ."""
    half = _multiple(air) if air.multiple else _single(air)
    return np.concatenate([half, half[:, ::-1]], 1)


@lru_cache(maxsize=16)
def disc(air: Air, size: float) -> tuple[Array, Array]:
    """XYZ of the lowest and the highest point of the sun's disc of that angular diameter."""
    solid_angle = 2 * math.pi * (1 - math.cos(size / 2))
    ends = np.array([air.elevation - size / 2, air.elevation + size / 2])
    if not air.multiple and ends[1] <= 0:
        return np.zeros(3), np.zeros(3)
    found = _disc_multiple(air, ends) if air.multiple else _disc_single(air, np.maximum(ends, 0.0))
    return found[0] / solid_angle, found[1] / solid_angle


def horizon(altitude: float) -> float:
    """Elevation above which the earth does not hide the sun."""
    return math.asin(_EARTH / (_EARTH + altitude / 1000)) - math.pi / 2


# --- one scattering: Nishita et al., "Display of the earth taking into account atmospheric
# scattering" (1993), in metres
# --------------------------------------------------------------------------------------------------

_RADIUS, _TOP, _STEPS = 6360e3, 6420e3, 32
_SUN_LIGHT = np.array(
    [1.45756829855592995, 1.56596305559738380, 1.65148449067670455, 1.71496242737209315]
    + [1.75797983805020541, 1.78256407885924539, 1.79095108475838560, 1.78541550133410665]
    + [1.76815554864306845, 1.74122069647250410, 1.70647127164943679, 1.66556087452739887]
    + [1.61993437242451854, 1.57083597368892081, 1.51932335059305479, 1.46628494965214395]
    + [1.41245852740172451, 1.35844961970384093, 1.30474913844739282, 1.25174963272610818]
    + [1.19975998755420621]
)
"""W/(m² nm) above the atmosphere, from 380 to 780 nm, every 20 nm, as what follows."""
_RAYLEIGH = np.array(
    [5.424820087636473e-05, 4.418549866505454e-05, 3.635151910165377e-05, 3.017929012024763e-05]
    + [2.526320226989157e-05, 2.130859310621843e-05, 1.809838025320633e-05, 1.547057129129042e-05]
    + [1.330284977336850e-05, 1.150184784075764e-05, 9.99557429990163e-06, 8.72799973630707e-06]
    + [7.65513700977967e-06, 6.74217203751443e-06, 5.96134125832052e-06, 5.29034598065810e-06]
    + [4.71115687557433e-06, 4.20910481110487e-06, 3.77218381260133e-06, 3.39051255477280e-06]
    + [3.05591531679811e-06]
)
_OZONE = np.array(
    [3.25126849861e-09, 5.85395365047e-09, 1.977191155085e-08, 7.309568762914e-08]
    + [2.0084561514287e-07, 4.0383958096161e-07, 6.3551335912363e-07, 9.6707041180970e-07]
    + [1.54797400424410e-06, 2.09038647223331e-06, 2.46128056164565e-06, 2.73551299461512e-06]
    + [2.15125863128643e-06, 1.59051840791988e-06, 1.12356197979857e-06, 7.3527551487574e-07]
    + [4.6450130357806e-07, 3.3096079921048e-07, 2.2512612292678e-07, 1.4879129266490e-07]
    + [1.6828623364192e-07]
)
_MIE = 2e-5
_OBSERVER = 20.0 * np.array(
    [
        (0.001368, 3.9e-05, 0.006450001), (0.01431, 0.000396, 0.06785001),
        (0.13438, 0.004, 0.6456), (0.34828, 0.023, 1.74706), (0.2908, 0.06, 1.6692),
        (0.09564, 0.13902, 0.8129501), (0.0049, 0.323, 0.272), (0.06327, 0.71, 0.07824999),
        (0.2904, 0.954, 0.0203), (0.5945, 0.995, 0.0039), (0.9163, 0.87, 0.001650001),
        (1.0622, 0.631, 0.0008), (0.8544499, 0.381, 0.00019), (0.4479, 0.175, 2e-05),
        (0.1649, 0.061, 0.0), (0.04677, 0.017, 0.0), (0.01135916, 0.004102, 0.0),
        (0.002899327, 0.001047, 0.0), (0.0006900786, 0.0002492, 0.0),
        (0.0001661505, 6e-05, 0.0), (4.150994e-05, 1.499e-05, 0.0),
    ]
)  # fmt: skip
_NODES, _WEIGHTS = np.polynomial.laguerre.laggauss(8)
_LAGUERRE = 25.0
"""Optical depths are Gauss-Laguerre sums, whose nodes are scaled by this into the atmosphere."""


def _single(air: Air) -> Array:
    """(ROWS, COLUMNS / 2, 3); below the horizon it fades."""
    half = ROWS // 2
    latitude = math.pi / 2 * (np.arange(ROWS) / half - 1) ** 2
    upper = _scattered_once(air, latitude[half:], np.arange(COLUMNS // 2))
    fade = np.clip(1 - 2.5 * np.sin(latitude[:half]), 0, None) ** 3
    return np.concatenate([upper[:1] * fade[:, None, None], upper])


def _scattered_once(air: Air, latitude: Array, column: Array) -> Array:
    longitude = 2 * math.pi / COLUMNS * column - math.pi
    ray = _direction(latitude[:, None], longitude[None])  # (3, rows, columns)
    sun = _direction(np.array(air.elevation), np.array(0.0))[:, None, None]
    start = np.array([0, 0, _RADIUS + np.clip(air.altitude, 1, 59999)])[:, None, None]
    step = _to_top(start, ray) / _STEPS
    mu = (ray * sun).sum(0)
    phases = (_rayleigh_phase(mu), _mie_phase(mu))
    depth, total = np.zeros((3, *mu.shape)), np.zeros((*mu.shape, 3))
    for k in range(_STEPS):
        at = start + (k + 0.5) * step * ray
        density = air.densities[:, None, None] * _densities(_height(at))
        depth = depth + step * density
        lit = ~_in_shadow(at, sun)
        through = depth + air.densities[:, None, None] * _depth(at, sun)
        spectrum = np.exp(-_extinction(through)) * _SUN_LIGHT
        spectrum *= (phases[0] * density[0])[..., None] * _RAYLEIGH + (
            phases[1] * density[1] * _MIE
        )[..., None]
        total += (spectrum @ _OBSERVER) * (step * lit)[..., None]
    return total


def _direction(latitude: Array, longitude: Array) -> Array:
    flat = np.cos(latitude)
    up = np.broadcast_to(np.sin(latitude), np.broadcast(latitude, longitude).shape)
    return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), up])


def _height(at: Array) -> Array:
    return np.sqrt((at * at).sum(0)) - _RADIUS


def _to_top(start: Array, ray: Array) -> Array:
    """How far it is to the end of the atmosphere."""
    b = (start * ray).sum(0)
    return -b + np.sqrt(b * b - (start * start).sum(0) + _TOP**2)


def _in_shadow(at: Array, sun: Array) -> Array:
    b = (at * sun).sum(0)
    return (sun[2] < 0) & (b * b - (at * at).sum(0) + _RADIUS**2 >= 0)


def _densities(height: Array) -> Array:
    ozone = np.maximum(1 - np.abs(height - 25e3) / 15e3, 0)
    return np.stack([np.exp(-height / 8e3), np.exp(-height / 1.2e3), ozone])


def _depth(start: Array, ray: Array) -> Array:
    """(3, ...) optical depths to the end of the atmosphere."""
    length = _to_top(start, ray)
    weights = _WEIGHTS * np.exp(_NODES) / _LAGUERRE
    parts = (
        weight * _densities(_height(start + node / _LAGUERRE * length * ray))
        for node, weight in zip(_NODES, weights, strict=True)
    )
    return length * sum(parts)


def _extinction(depth: Array) -> Array:
    """(..., 21)."""
    rayleigh, mie, ozone = (part[..., None] for part in depth)
    return rayleigh * _RAYLEIGH + 1.11 * _MIE * mie + ozone * _OZONE


def _rayleigh_phase(mu: Array) -> Array:
    return 3 / (16 * math.pi) * (1 + mu * mu)


def _mie_phase(mu: Array) -> Array:
    g, squared = 0.76, 0.76**2
    down = 8 * math.pi * (2 + squared) * (1 + squared - 2 * g * mu) ** 1.5
    return 3 * (1 - squared) * (1 + mu * mu) / down


def _disc_single(air: Air, elevations: Array) -> Array:
    """(2, 3) XYZ times the solid angle; ozone counts for nothing here."""
    start = np.array([0, 0, _RADIUS + np.clip(air.altitude, 1, 59999)])[:, None]
    depth = _depth(start, _direction(elevations, np.zeros(2)))
    seen = np.array([air.air, air.aerosol, 0.0])[:, None] * depth
    return (np.exp(-_extinction(seen)) * _SUN_LIGHT) @ _OBSERVER


# --- many scatterings: Hillaire, "A scalable and production ready sky and atmosphere rendering
# technique" (2020), in kilometres
# --------------------------------------------------------------------------------------------------

_EARTH, _THICK, _MARCH = 6371.0, 100.0, 64
_SUN4 = np.array([1.679, 1.828, 1.986, 1.307])
"""Of 630, 560, 490 and 430 nm, as what follows."""
_MOLECULES = np.array([6.605e-3, 1.067e-2, 1.842e-2, 3.156e-2])
_OZONE4 = 334.5 * np.array([3.472e-25, 3.914e-25, 1.349e-25, 11.03e-27])
_ABSORBED = np.array([2.8722e-24, 4.6168e-24, 7.9706e-24, 1.3578e-23])
_SCATTERED = np.array([1.5908e-22, 1.7711e-22, 2.0942e-22, 2.4033e-22])
_AEROSOL, _AEROSOL_LEAST, _AEROSOL_SCALE = 1.3681e20, 2e6, 0.73
_AGAIN = 0.02 * np.array([0.217, 0.347, 0.594, 1.0])
_ALBEDO = 0.3
_XYZ = np.array(
    [
        [53.386917738564668, 43.904844466369358, 1.6137278251608962, 20.762668673810577],
        [22.981337506691025, 71.347795700053394, 18.422960591455485, 2.3614213523314369],
        [-3.663162907346e-07, 0.102506867965741, 31.742921188390806, 110.48009643252140],
    ]
)
_ACROSS, _UP = 256, 64
"""Of the table of transmittances: cosines of the sun, heights."""


def _multiple(air: Air) -> Array:
    """(ROWS, COLUMNS / 2, 3)."""
    line = 2 * (np.arange(ROWS) + 0.5) / ROWS - 1
    elevation = (np.copysign(line * line, line) * math.pi / 2)[:, None]
    azimuth = (2 * math.pi * (np.arange(COLUMNS // 2) + 0.5) / COLUMNS)[None]
    ray = _direction(elevation, azimuth)
    start = _EARTH + float(np.clip(air.altitude, 1, 99999)) / 1000
    top, ground = _far(start, ray[2], _EARTH + _THICK), _far(start, ray[2], _EARTH)
    far, table = np.where(ground < 0, top, ground), _transmittances(air)
    # a few rows at a time stay in the processor's caches
    parts = [
        _scattered_often(air, table, start, ray[:, k : k + 8], far[k : k + 8])
        for k in range(0, ROWS, 8)
    ]
    return np.concatenate(parts) @ _XYZ.T


def _far(start: float, up: Array, radius: float) -> Array:
    """Where rays from that far from the earth's centre, of which `up` is the vertical part, meet
    the sphere first; -1 where they do not. Squares are rounded as Cycles rounds them, which shows
    near the ground.
    """
    single = np.square(start, dtype=np.float32), np.square(radius, dtype=np.float32)
    b, c = start * up, (single[0] - single[1]).astype(np.float64)
    d = b * b - c
    root = np.sqrt(np.maximum(d, 0))
    found = np.where(d > b * b, -b + root, -b - root)
    return np.where((d < 0) | ((c > 0) & (b > 0)), -1.0, found)


def _scattered_often(air: Air, table: Array, start: float, ray: Array, far: Array) -> Array:
    sun = np.array([-math.cos(air.elevation), 0.0, math.sin(air.elevation)])
    mu, step = -np.einsum("k,k...", sun, ray), far / _MARCH
    phases = _rayleigh_phase(mu)[..., None], _aerosol_phase(mu)[..., None]
    total, through = np.zeros((*mu.shape, 4)), np.ones((*mu.shape, 4))
    for k in range(_MARCH):
        at = ray * ((k + 0.5) * step)
        at[2] += start
        distance = np.sqrt((at * at).sum(0))
        cosine = np.einsum("k,k...", sun, at) / distance
        height = np.maximum(distance - _EARTH, 0)
        absorbed, aerosol, molecules = _coefficients(air, height)
        extinction = np.maximum(absorbed + aerosol + molecules, 1e-7)
        light = _looked_up(table, cosine, height / _THICK)
        again = _again(table, cosine, height / _THICK, distance)
        gained = _SUN4 * (
            molecules * (phases[0] * light + again) + aerosol * (phases[1] * light + again)
        )
        passed = np.exp(-step[..., None] * extinction)
        total += through * (gained - gained * passed) / extinction
        through *= passed
    return total


def _aerosol_phase(mu: Array) -> Array:
    g = 0.8
    return (1 - g * g) / (4 * math.pi * (1 + g * g + 2 * g * mu) ** 1.5)


def _coefficients(air: Air, height: Array) -> tuple[Array, Array, Array]:
    """(..., 4) each: what is absorbed, what aerosols scatter, what molecules scatter, a km."""
    height = np.asarray(height)[..., None]
    aerosol = air.aerosol * (_AEROSOL * np.exp(-height / _AEROSOL_SCALE) + _AEROSOL_LEAST)
    log = np.log(np.maximum(height, 1e-4))
    ozone = 3.78547397e20 * np.exp(-((log - 3.22261) ** 2) * 5.55555555 - log)
    absorbed = _ABSORBED * aerosol + air.ozone * _OZONE4 * ozone
    thin = np.exp(-0.07771971 * height**1.16364243)
    return absorbed, _SCATTERED * aerosol, air.air * _MOLECULES * thin


def _transmittance(air: Air, cosine: Array, height: Array) -> Array:
    """(..., 4) from heights, as shares of the atmosphere's, to its end."""
    start = _EARTH + height * _THICK
    sine = np.sqrt(np.maximum(1 - cosine * cosine, 0))
    step = np.maximum(_far(start, cosine, _EARTH + _THICK), 0) / _MARCH
    depth = np.zeros((*np.broadcast(cosine, height).shape, 4))
    for k in range(_MARCH):
        t = (k + 0.5) * step
        distance = np.sqrt((t * sine) ** 2 + (start + t * cosine) ** 2)
        parts = _coefficients(air, np.maximum(distance - _EARTH, 0))
        depth += sum(parts) * np.asarray(step)[..., None]
    return np.exp(-depth)


def _transmittances(air: Air) -> Array:
    """(_UP, _ACROSS, 4)."""
    cosine = np.linspace(-1, 1, _ACROSS)[None]
    return _transmittance(air, cosine, np.linspace(0, 1, _UP)[:, None])


def _looked_up(table: Array, cosine: Array, height: Array) -> Array:
    x = np.clip(cosine * 0.5 + 0.5, 0, 1) * (_ACROSS - 1)
    y = np.clip(height, 0, 1) * (_UP - 1)
    x, y = np.broadcast_arrays(x, y)
    column, row = x.astype(np.intp), y.astype(np.intp)
    across, up = (x - column)[..., None], (y - row)[..., None]
    right, above = np.minimum(column + 1, _ACROSS - 1), np.minimum(row + 1, _UP - 1)
    low = table[row, column] * (1 - across) + table[row, right] * across
    high = table[above, column] * (1 - across) + table[above, right] * across
    return low * (1 - up) + high * up


def _on_line(row: Array, place: Array) -> Array:
    """(..., 4) of a row (n, 4) at places from 0 to n - 1."""
    first = np.minimum(place.astype(np.intp), len(row) - 2)
    way = (place - first)[..., None]
    return row[first] * (1 - way) + row[first + 1] * way


def _again(table: Array, cosine: Array, height: Array, distance: Array) -> Array:
    """What comes from the ground and, by a fit, from the rest of the air."""
    share = _EARTH / distance
    angle = 2 * math.pi * (1 - np.sqrt(np.maximum(1 - share * share, 0)))
    above, below = table[:, -1], table[0]
    between = above[0] / _on_line(above, np.clip(height, 0, 1) * (_UP - 1))
    lit = _on_line(below, np.clip(cosine * 0.5 + 0.5, 0, 1) * (_ACROSS - 1))
    ground = lit * between * (angle * cosine)[..., None]
    fit = _AGAIN / (1 + 5 * np.exp(-17.92 * cosine))[..., None]
    return fit + _ALBEDO / (4 * math.pi**2) * ground


def _disc_multiple(air: Air, elevations: Array) -> Array:
    height = float(np.clip(air.altitude, 1, 99999)) / 1000 / _THICK
    return (_SUN4 * _transmittance(air, np.sin(elevations), np.full(2, height))) @ _XYZ.T
