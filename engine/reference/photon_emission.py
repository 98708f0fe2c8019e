"""From where photons leave lamps, towards what is specular (semantics/photons.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.geometry import Geometry
from ..linear.columns import basis_around, dot, length, transform, unit
from ..sampling import concentric_disc
from ..scene import Instances, Scene, Spheres, Strands
from ..settings import Settings
from .lights import LightPoint, Source, in_cone

Array = np.ndarray

MOST_CASTERS = 64
"""Of placements, then of what they are instances of."""
PLACES = 16
"""On lamps with an extent."""
PLANE = (0.7548776662466927, 0.5698402909980532)
SPACE = 0.8191725133961645
"""Steps of Kronecker's sequences, by the roots of x^(d + 1) = x + 1, for two and three of them
(Roberts 2018, The unreasonable effectiveness of quasirandom sequences).
"""
_UP = np.array([[0.0], [0.0], [1.0]])


@dataclass(frozen=True, eq=False)
class Caster:
    """What mirrors or refracts sharply: rows [first, last) of the placements, in a ball round
    `center` (3,), relative to the eye. beyond: farther from there nothing of the scene is.
    """

    first: int
    last: int
    center: Array
    radius: float
    beyond: float

    def has(self, row: Array) -> Array:
        """(n,) bool: rows of the placements."""
        return (row >= self.first) & (row < self.last)


@dataclass(frozen=True, eq=False)
class Emitted:
    """n photons on their way from a lamp: origin, direction and place on it (3, n), and what share
    of the lamp's colour, an area, their flux over pi is, (n,). choice: (n,) in [0, 1), by which
    they are mirrored or refracted. near: (n,) from where on along their rays they meet things.
    """

    origin: Array
    direction: Array
    near: Array
    at: Array
    share: Array
    choice: Array


@dataclass(frozen=True, eq=False)
class Beam:
    """The photons that one of some places on a lamp sends towards a caster."""

    source: Source
    caster: Caster
    place: int
    places: int
    count: int = 0

    @property
    def shines(self) -> bool:
        """Whether its photons may leave: the lamp shines there."""
        source = self.source
        if not throws_photons(source) or not source.light.lights_gloss:
            return False
        if source.light.kind != "AREA":
            return True
        to = self.caster.center[:, None] - source.position
        return bool(dot(to, source.axis)[0] > -self.caster.radius)

    @property
    def power(self) -> float:
        """About how much light goes to the caster."""
        source, r = self.source, self.caster.radius
        red, green, blue = np.abs(source.color)
        color = (red + green + blue) / 3
        if source.light.kind == "SUN":
            return float(color * np.pi * r * r)
        distance = length(self.caster.center[:, None] - source.position)
        cone = 2 * np.pi * _versine(r + source.light.radius, distance)[0]
        return float(color * cone / (4 * np.pi))

    def photons(self, number: Array) -> Emitted:
        """Those of these numbers (n,) among its own."""
        number = self.place * self.count + number
        along, on = _on_disc(number), _on_disc(np.array([self.place]))
        each = 1.0 / (float(self.count) * self.places)
        choice = _kronecker(number, SPACE)
        if self.source.light.kind == "SUN":
            return self._endless(along, on, each, choice)
        return self._near(along, on, each, choice)

    def _endless(self, along: LightPoint, on: LightPoint, each: float, choice: Array) -> Emitted:
        """Parallel ones through the disc of the caster's ball."""
        source, r = self.source, self.caster.radius
        center = self.caster.center[:, None]
        d = np.repeat(in_cone(source.axis, np.array([source.versine]), on), len(choice), 1)
        first, second = basis_around(d)
        x, y = along.disc
        origin = center + r * (x * first + y * second)
        share = np.full(len(choice), each * r * r * 2 / (2 - source.versine))
        near = np.full(len(choice), -self.caster.beyond)
        return Emitted(origin, d, near, np.zeros_like(d), share, choice)

    def _near(self, along: LightPoint, on: LightPoint, each: float, choice: Array) -> Emitted:
        """Those over the cone that the caster's ball fills."""
        source, light = self.source, self.source.light
        at, wide = source.position, self.caster.radius
        if light.kind == "AREA":
            a, b = on.disc if light.shape == "ELLIPSE" else on.square
            at = at + a * source.right + b * source.up
        else:
            wide += light.radius
        to = self.caster.center[:, None] - at
        versine = _versine(wide, length(to))
        d = in_cone(unit(to) if to.any() else _UP, versine, along)
        at = np.repeat(at, len(choice), 1)
        facing: Array = np.ones(len(choice))
        if light.kind == "AREA":
            facing = 4 * np.maximum(dot(d, source.axis), 0.0)
        elif light.radius > 0:  # of a ball all rays of a direction pass a disc across it
            first, second = basis_around(d)
            x, y = on.disc
            at = at + light.radius * (x * first + y * second)
        with np.errstate(divide="ignore", invalid="ignore"):
            shown = source.along(-d) * (2 * np.pi * versine) / (4 * np.pi * np.pi)
        share = np.where(facing > 0, each * facing * shown, 0.0)
        return Emitted(at, d, np.zeros(len(choice)), at, share, choice)


def throws_photons(source: Source) -> bool:
    """Whether photons bring the light of this lamp that mirrors throw."""
    return source.light.kind in ("POINT", "SPOT", "SUN", "AREA")


def find_casters(scene: Scene, geometry: Geometry, settings: Settings) -> list[Caster]:
    """What there is in the scene of sharp mirrors and glass."""
    placements = geometry.placements
    casting = [_is_caster(scene, settings, block) for block in scene.instances]
    casters = []
    for row in np.flatnonzero(placements.rank >= 2):
        if casting[placements.block[row]]:
            caster = _ball_round(scene, geometry, int(row))
            casters += [caster] if caster is not None else []
    if len(casters) > MOST_CASTERS:
        block = placements.block
        casters = _fewer(casters, lambda a, b: block[a.first] == block[b.first])
    if len(casters) > MOST_CASTERS:
        casters = _fewer(casters, lambda a, b: True)
    return casters


def find_beams(sources: Iterable[Source], casters: list[Caster], photons: int) -> list[Beam]:
    """All photons of a picture, beam by beam."""
    beams, total = [], 0.0
    for source in sources:
        for caster in casters:
            beam = Beam(source, caster, 0, PLACES if source.is_extended else 1)
            if beam.shines and beam.power > 0:
                beams += [replace(beam, place=place) for place in range(beam.places)]
                total += np.sqrt(beam.power)
    shares = [np.sqrt(beam.power) / (total * beam.places) for beam in beams]
    counts = [int(np.ceil(photons * share)) for share in shares]
    return [replace(beam, count=count) for beam, count in zip(beams, counts, strict=True)]


def _is_caster(scene: Scene, settings: Settings, block: Instances) -> bool:
    if not block.visible_shadow or isinstance(scene.geometries[block.geometry], Strands):
        return False
    return any(_is_sharp(scene, settings, k) for k in block.materials if k >= 0)


def _is_sharp(scene: Scene, settings: Settings, material: int) -> bool:
    lobes = scene.materials[material].lobes
    mirrors = any(lobe.kind == "MIRROR" for lobe in lobes)
    if settings.reflective_caustics == "ON" and mirrors:
        return True
    refracts = any(lobe.kind == "REFRACTION" for lobe in lobes)
    rough = any(lobe.is_rough_glass for lobe in lobes)
    return settings.refractive_caustics == "ON" and refracts and not rough


def _ball_round(scene: Scene, geometry: Geometry, row: int) -> Caster | None:
    """About the middle of the box round it, of corners and of spheres with their radii."""
    placements = geometry.placements
    thing = scene.geometries[placements.geometry[row]]
    is_round = isinstance(thing, Spheres)
    points = np.asarray(thing.centers if is_round else thing.vertices, np.float64)
    radii = np.asarray(thing.radii, np.float64) if is_round else np.zeros(len(points))
    sound = np.isfinite(points).all(1) & np.isfinite(radii)
    if not sound.any():
        return None
    matrix = placements.world_from_object[row]
    at = transform(matrix, points[sound].T) + matrix[:, 3:]
    r = radii[sound] * _larger_scale(matrix)
    low, high = (at - r).min(1), (at + r).max(1)
    center = 0.5 * (low + high)
    radius = (length(at - center[:, None]) + r).max()
    beyond = 2 * (np.abs(center).max() + radius + geometry.reach)
    return Caster(row, row + 1, center, float(radius), float(beyond))


def _larger_scale(matrix: Array) -> float:
    """At least by how much a matrix lengthens anything; just that where its columns are across each
    other.
    """
    columns = matrix[:, :3]
    size = np.abs(columns.T @ columns)
    return float(np.sqrt(size.sum(1).max()))


def _fewer(casters: list[Caster], same: Callable[[Caster, Caster], bool]) -> list[Caster]:
    """Neighbours in the list that are the same as one."""
    fewer: list[Caster] = []
    for caster in casters:
        if fewer and same(fewer[-1], caster):
            fewer[-1] = _merged(fewer[-1], caster)
        else:
            fewer.append(caster)
    return fewer


def _merged(a: Caster, b: Caster) -> Caster:
    """A caster of several placements is a ball round theirs."""
    to = b.center - a.center
    distance = float(length(to[:, None])[0])
    first, last = min(a.first, b.first), max(a.last, b.last)
    whole = replace(a, first=first, last=last, beyond=a.beyond + b.beyond)
    if distance + b.radius <= a.radius:
        return whole
    if distance + a.radius <= b.radius:
        return replace(whole, center=b.center, radius=b.radius)
    radius = 0.5 * (distance + a.radius + b.radius)
    return replace(whole, center=a.center + (radius - a.radius) / distance * to, radius=radius)


def _kronecker(number: Array, step: float) -> Array:
    """The fraction of 1/2 + i times a step."""
    at = 0.5 + number * step
    return at - np.floor(at)


def _on_disc(number: Array) -> LightPoint:
    """Points (2, n) of the square [-1, 1]² and the unit disc (Shirley, Chiu 1997)."""
    square = 2 * np.stack([_kronecker(number, step) for step in PLANE]) - 1
    return LightPoint(square, concentric_disc(square.T).T)


def _versine(r: float, distance: Array) -> Array:
    """(n,) the cone that a ball of radius r fills, seen from these distances, as 1 - cos of its
    half angle: all directions from inside.
    """
    outside = distance > r
    sine2 = np.square(r / np.where(outside, distance, 1.0))
    return np.where(outside, sine2 / (1 + np.sqrt(np.maximum(1 - sine2, 0.0))), 2.0)
