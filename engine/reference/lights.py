"""Lights as samples: from where, and how brightly, a point is lit (notes, sections 4.11, 4.15 and
4.16).

Letters: x shaded point, c centre of the light, l unit direction to the light, q point on the light,
d distance, z cosine at the light, n samples per light.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.geometry import ULPS
from ..linear.columns import basis_around, dot, length, pick, unit
from ..scene import Light
from .area_lights import between, half_spread, seen_rectangle
from .emission import Emission

Array = np.ndarray

HUGE = 1e100
"""Intensities saturate here, far beyond any float32, so that products stay finite."""


@dataclass(frozen=True, eq=False)
class LightPoint:
    """Where on the light: (a, b) in the square [-1, 1]², (x, y) in the unit disc."""

    square: Array
    disc: Array


CENTER = LightPoint(np.zeros(2), np.zeros(2))


@dataclass(frozen=True, eq=False)
class LightSample:
    """One sample of a light as n points see it.

    direction: (3, n) l.  intensity: (n,), to be multiplied with the light's colour.
    end: where the shadow segment ends: (3, 1) a point common to all, (3, n) a point for each, or
    None for never. spread: (n,) one over how densely, a steradian, samples fall there; 0 for a
    light of no extent.  color: (3, 1) or (3, n) instead of the light's, None for that.  inner:
    (n,) bool where it is the inner side of a surface; such light does not reach faces that turn
    away from it, as the outside of the same body. None for nowhere.  short: by how much of the
    end's coordinates the segments are shorter, for what the light is part of.  group: (1,) or (n,)
    light groups instead of the light's, None for that.  counts: whether it tells how much of a sky
    is hidden.  leaves: whether points may lie on what segments leave on the
    other side, so that these begin there and not at the light.  met_by: whose visibility rays of
    surfaces obey; of those drawn from lobes that of mirrors.  whole: (n,) spread, seen from as near
    as it is; None where nobody asks.  to_matt: (n,) intensity for what is matt, None for the same.
    """

    direction: Array
    intensity: Array
    end: Array | None
    spread: Array
    color: Array | None = None
    inner: Array | None = None
    short: float = ULPS
    group: Array | None = None
    counts: bool = True
    leaves: bool = False
    met_by: str = "shadow"
    whole: Array | None = None
    to_matt: Array | None = None

    @property
    def drawn(self) -> bool:
        return self.met_by == "mirror"

    def cosine(self, n: Array) -> Array:
        """(k,) n·l of points with the normals n (3, k)."""
        return dot(n, self.direction)

    def reaches(self, g: Array, n: Array, through: Array | bool = False) -> Array:
        """(k,) bool: points with the normals g, n (3, k), whatever stands between. through: (k,)
        bool, those that light from behind reaches too.
        """
        cosine = self.cosine(n)
        behind = through & (cosine < 0) if through is not False else False
        reached = ((cosine > 0) | behind) & (self.intensity != 0)
        return (
            reached
            if self.inner is None
            else reached & ~(self.inner & (dot(g, self.direction) <= 0))
        )

    def taken(self, index: Array) -> LightSample:
        """As the points at these places see it."""

        def some(values: Array | None) -> Array | None:
            return values if values is None or values.shape[-1] == 1 else values[..., index]

        return replace(
            self,
            direction=pick(self.direction, index),
            intensity=self.intensity[index],
            end=some(self.end),
            spread=self.spread[index],
            color=some(self.color),
            inner=None if self.inner is None else self.inner[index],
            group=some(self.group),
            whole=some(self.whole),
            to_matt=some(self.to_matt),
        )

    def light_of(self, source: Source) -> Array:
        """(3, n) intensity times colour."""
        return self._color(source) * self.intensity

    def matt_light_of(self, source: Source) -> Array:
        """(3, n) the same for what is matt."""
        return self._color(source) * (self.intensity if self.to_matt is None else self.to_matt)

    def _color(self, source: Source) -> Array:
        return source.color[:, None] if self.color is None else self.color

    def group_of(self, source: Source) -> Array | int:
        """(1,), (n,) or one number: light groups, -1 for none."""
        return source.light.light_group if self.group is None else self.group


class Source:
    """A light relative to the camera. color: (3,) c, saturated.  position: (3, 1).  axis: (3, 1)
    along which it shines.
    """

    def __init__(self, light: Light, eye: Array, physical: bool, emission: Emission | None = None):
        """emission: what the light's program gives; None without one."""
        frame = np.asarray(light.world_from_light, np.float64)
        self.light = light
        self.physical = physical
        self.emission = emission
        self.half_spread = half_spread(light)
        self.position = (frame[:, 3] - eye)[:, None]
        self.axis = unit(-frame[:, 2:3])
        self.right, self.up = light.size_x / 2 * frame[:, 0:1], light.size_y / 2 * frame[:, 1:2]
        with np.errstate(over="ignore"):
            self.color = np.clip(np.array(light.color, np.float64) * light.strength, -HUGE, HUGE)

    @property
    def is_extended(self) -> bool:
        """Whether it has an extent to sample."""
        light = self.light
        if light.kind in ("DOME", "MESH", "BOUNCED", "MEDIUM"):
            return True
        if light.kind == "AREA":
            return light.size_x > 0 or light.size_y > 0
        return light.angle > 0 if light.kind == "SUN" else light.radius > 0

    def sample_count(self, light_samples: int) -> int:
        """n: how many samples it takes."""
        return light_samples if self.is_extended else 1

    has_highlights = True
    draws = 1.0
    """Directions that highlights draw for each sample."""
    points: Sequence[LightPoint] | None = None
    """Where it has points of its own, of all samples of a pixel."""

    def numbers(self, sample: int, n: int) -> range:
        """Of its n samples, among those of all samples of a pixel; where its own points are fewer,
        they begin again.
        """
        first = (sample % (len(self.points) // n) if self.points is not None else sample) * n
        return range(first, first + n)

    def surface_numbers(self, sample: int, n: int) -> Sequence[int]:
        """The same for surfaces, which may take more than points of media do."""
        return self.numbers(sample, n)

    def on_lobes(self, matt: Array, gloss: Array) -> tuple[Array, Array]:
        """Of what matt lobes and others would give back, what they do."""
        return matt * self.light.lights_matt, gloss * self.light.lights_gloss

    def drawn_at(self, number: int, point: LightPoint) -> LightPoint | None:
        """Where in the lobes of highlights a direction is drawn beside sample `number` of all
        samples of a pixel, which is at `point`; None for nowhere.
        """
        return point

    def is_soft(self, light_samples: int) -> bool:
        """Whether pixels that it reaches take more samples before they may stop."""
        return self.sample_count(light_samples) > 1

    def is_cut(self, x: Array, n: Array) -> Array:
        """(k,) bool whether the horizon of points, the plane through x (3, k) across n (3, k), cuts
        the light's shape, and the light shines that way.
        """
        light, to = self.light, self.position - x
        if light.kind == "SUN":
            return dot(n, self.axis) ** 2 < np.sin(min(light.angle, np.pi) / 2) ** 2
        if light.kind != "AREA":
            return dot(n, to) ** 2 < light.radius**2
        a, b = np.abs(dot(n, self.right)), np.abs(dot(n, self.up))
        reach2 = (a + b) ** 2 if light.shape == "RECTANGLE" else a * a + b * b
        return (dot(to, self.axis) < 0) & (dot(n, to) ** 2 < reach2)

    def place(self, point: LightPoint) -> Array | None:
        """(3, 1) where it, or its point, is; None where it is all around or endlessly far."""
        return None if self.light.kind in ("SUN", "DOME") else self.position

    def seen_from(
        self, x: Array, n: Array, numbers: Sequence[int], count: int
    ) -> Callable[[LightPoint], LightSample]:
        """How points x (3, k) of surfaces with the normals n (3, k) see each of the points with
        these numbers, of `count` in a sample of a pixel.
        """
        return lambda point: self.sample(x, point, count)

    def sample(self, x: Array, point: LightPoint, n: int) -> LightSample:
        """How the points x (3, k) see the sample at `point`, one of n; n = 1 is the light's centre,
        as if it had no extent.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.light.kind == "SUN":
                sample = self._sun(x, point, n)
            elif self.light.kind == "AREA":
                sample = self._spotted(self._area(x, point, n))
            elif n == 1:
                sample = self._spotted(self._center(x))
            else:
                sample = self._spotted(
                    self._disc(x, point, n)
                    if self.light.soft_falloff
                    else self._sphere(x, point, n),
                    x,
                )
        return self._colored(x, sample)

    def _colored(self, x: Array, sample: LightSample) -> LightSample:
        """With the colour that the light's program gives it."""
        if self.emission is None:
            return sample
        share = self.emission.seen(self, x, sample.direction, sample.end, "shadow")
        return replace(sample, color=self.color[:, None] * share)

    def sample_at(self, x: Array, direction: Array, n: int) -> LightSample:
        """The sample of n > 1 that the points x (3, k) would see in the directions (3, k); of no
        intensity where these miss the light.
        """
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            if self.light.kind == "SUN":
                sample, missed = (
                    self._endless(direction, n),
                    _half_square(direction + self.axis) > self.versine,
                )
            elif self.light.kind == "AREA":
                sample, missed = self._area_at(x, direction, n)
                sample = self._spotted(sample)
            else:
                sample, missed = (
                    self._disc_at(x, direction, n)
                    if self.light.soft_falloff
                    else self._sphere_at(x, direction, n)
                )
                sample = self._spotted(sample, x)
        hit = replace(sample, intensity=np.where(missed, 0.0, sample.intensity))
        return self._colored(x, hit)

    @property
    def versine(self) -> float:
        """1 − cos of the sun's half angle."""
        return 2 * np.sin(self.light.angle / 4) ** 2

    @property
    def area(self) -> float:
        """Of the shape, as seen straight."""
        light = self.light
        if light.kind != "AREA":
            return np.pi * light.radius**2
        return light.size_x * light.size_y * (1 if light.shape == "RECTANGLE" else np.pi / 4)

    def least_exponent(self, x: Array) -> Array:
        """(k,) exponents p of the highlights at the points x that are narrower than the light:
        those whose solid angle 8π / (p + 1), seen straight, is less than about area / (d² + area /
        2π).
        """
        if self.light.kind == "SUN":
            return np.full(x.shape[1], 4 / self.versine - 1)
        to = self.position - x
        return (
            8 * np.pi / self.area * dot(to, to) + 3
            if self.area > 0
            else np.full(x.shape[1], np.inf)
        )

    def fall_off(self, d: Array, n: int) -> Array:
        """1 / (4π² d² n) when PHYSICAL, 1 / n when CLASSIC; 0 where the point is the light."""
        intensity = (
            np.minimum(1 / (4 * np.pi**2 * d * d), HUGE) if self.physical else np.ones_like(d)
        )
        return np.where(d > 0, intensity / n, 0.0)

    def _center(self, x: Array) -> LightSample:
        to = self.position - x
        return LightSample(
            unit(to), self.fall_off(length(to), 1), self.position, np.zeros(x.shape[1])
        )

    def _sphere(self, x: Array, point: LightPoint, n: int) -> LightSample:
        """Uniform in the cone that the sphere subtends; the segment ends on the sphere."""
        axis, versine = self._cone(x)
        return self._sphere_at(x, in_cone(axis, versine, point), n)[0]

    def _cone(self, x: Array) -> tuple[Array, Array]:
        """Axis and 1 − cos of the half angle of the cone that the sphere subtends: from inside, all
        directions.
        """
        to, r = self.position - x, self.light.radius
        d = length(to)
        sine2 = np.where(d > r, (r / d) ** 2, 1.0)
        axis = np.where(d > 0, unit(to), np.array([[0.0], [0.0], [1.0]]))
        return axis, np.where(d > r, sine2 / (1 + np.sqrt(1 - sine2)), 2.0)

    def _sphere_at(self, x: Array, direction: Array, n: int) -> tuple[LightSample, Array]:
        to, r, (axis, versine) = self.position - x, self.light.radius, self._cone(x)
        d, middle = length(to), dot(to, direction)
        off = to - middle * direction
        root = np.sqrt(np.maximum(0.0, r * r - dot(off, off)))
        end = x + np.where(d > r, middle - root, middle + root) * direction
        if self.physical:
            outside = self.fall_off(d, n) * 2 / (2 - versine)
            intensity = np.where(d > r, outside, 4 * self.fall_off(np.full_like(d, r), n))
        else:
            intensity = np.full_like(d, 1 / n)
        sample = LightSample(direction, intensity, end, 2 * np.pi * versine)
        return sample, _half_square(direction - axis) > versine

    def _disc(self, x: Array, point: LightPoint, n: int) -> LightSample:
        """Uniform on the disc of the light's radius that faces x."""
        towards = unit(self.position - x)
        first, second = basis_around(towards)
        q = self.position + self.light.radius * (point.disc[0] * first + point.disc[1] * second)
        return self._disc_to(x, towards, q, unit(q - x), n)

    def _disc_to(self, x: Array, towards: Array, q: Array, direction: Array, n: int) -> LightSample:
        to, z = q - x, np.maximum(0.0, dot(direction, towards))
        share = z if self.physical else 1.0
        return LightSample(
            direction, self.fall_off(length(to), n) * share, q, self.area * z / dot(to, to)
        )

    def _disc_at(self, x: Array, direction: Array, n: int) -> tuple[LightSample, Array]:
        to = self.position - x
        towards = unit(to)
        t = length(to) / dot(direction, towards)
        q = x + t * direction
        off = q - self.position
        return self._disc_to(x, towards, q, direction, n), ~(
            (t > 0) & (dot(off, off) <= self.light.radius**2)
        )

    def along(self, direction: Array) -> Array:
        """(k,) what of a spot's or an area light's radiance leaves against unit directions."""
        if self.half_spread is not None:
            return between(self.half_spread, direction, self.axis, self.physical)
        z = -dot(direction, self.axis)
        return self.spot(z) if self.light.kind == "SPOT" else np.ones_like(z)

    def _spotted(self, sample: LightSample, x: Array | None = None) -> LightSample:
        """With the share of its cone. x: of points that may be inside a spotlight's ball."""
        if self.light.kind != "SPOT" and self.half_spread is None:
            return sample
        share = self.along(sample.direction)
        if x is not None:
            share = np.where(self.is_around(x), 1.0, share)
        return replace(sample, intensity=sample.intensity * share)

    def is_around(self, x: Array) -> Array:
        """(k,) bool: the points are inside a ball of light, which shines on them from all sides,
        whatever way a spotlight shines.
        """
        inside = length(self.position - x) <= self.light.radius
        return np.zeros_like(inside) if self.light.soft_falloff else inside

    def spot(self, z: Array) -> Array:
        """The spot's share at the cosine z from its axis: a smoothstep, or a step when it has no
        blend.
        """
        edge = np.cos(self.light.spot_size / 2)
        width = (1 - edge) * self.light.spot_blend
        if not width > 0:
            return np.where(z > edge, 1.0, 0.0)
        t = np.clip((z - edge) / width, 0.0, 1.0)
        return t * t * (3 - 2 * t)

    def _sun(self, x: Array, point: LightPoint, n: int) -> LightSample:
        direction = in_cone(-self.axis, np.array([self.versine]), point) if n > 1 else -self.axis
        return self._endless(np.repeat(direction, x.shape[1], 1), n)

    def _endless(self, direction: Array, n: int) -> LightSample:
        versine, some = self.versine if n > 1 else 0.0, np.ones(direction.shape[1])
        intensity = 2 / (2 - versine) / (np.pi * n) if self.physical else 1 / n
        return LightSample(direction, intensity * some, None, 2 * np.pi * versine * some)

    def _area(self, x: Array, point: LightPoint, n: int) -> LightSample:
        """Even over the area; over the solid angle where a rectangle of a PHYSICAL light is seen
        large.
        """
        a, b = (
            (point.square if self.light.shape == "RECTANGLE" else point.disc)
            if n > 1
            else (0.0, 0.0)
        )
        q = self.position + a * self.right + b * self.up
        even = self._area_to(x, q, unit(q - x), n)
        return (
            seen_rectangle(self, x, point.square, n, even) if n > 1 and self._may_be_large else even
        )

    @property
    def _may_be_large(self) -> bool:
        some = self.light.shape == "RECTANGLE" or self.half_spread is not None
        return self.physical and some and self.area > 0

    def _area_to(self, x: Array, q: Array, direction: Array, n: int) -> LightSample:
        to, z = q - x, -dot(direction, self.axis)
        share = 4 * z if self.physical else 1.0
        return LightSample(
            direction,
            np.where(z > 0, self.fall_off(length(to), n) * share, 0.0),
            q,
            self.area * z / dot(to, to),
        )

    def _area_at(self, x: Array, direction: Array, n: int) -> tuple[LightSample, Array]:
        t = dot(self.position - x, self.axis) / dot(direction, self.axis)
        q = x + t * direction
        a, b = (dot(q - self.position, side) / dot(side, side) for side in (self.right, self.up))
        hit = (
            (np.abs(a) <= 1) & (np.abs(b) <= 1)
            if self.light.shape == "RECTANGLE"
            else a * a + b * b <= 1
        )
        even = self._area_to(x, q, direction, n)
        sample = seen_rectangle(self, x, None, n, even) if self._may_be_large else even
        return sample, ~((t > 0) & hit)


def _half_square(a: Array) -> Array:
    """Of a difference of unit vectors: 1 − the cosine between them, however small."""
    return dot(a, a) / 2


def in_cone(axis: Array, versine: Array, point: LightPoint) -> Array:
    """(3, n) unit directions in the cone round `axis` with 1 − cos α = versine (n,), uniform in
    solid angle over the disc's points.
    """
    x, y = point.disc
    first, second = basis_around(axis)
    cosine = 1 - (x * x + y * y) * versine
    sine_by_radius = np.sqrt(np.maximum(0.0, versine * (1 + cosine)))
    return unit(cosine * axis + sine_by_radius * (x * first + y * second))
