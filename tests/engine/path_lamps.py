"""Lamps and skies as the path tracer has them: a random point of a lamp, what a ray sees of it, and
the sky's light along a ray.

Written from the physics that semantics/lights.md states, and from nothing of `lights.py`. Letters:
x shaded point, c centre of the lamp, q point on it, P its power, L its radiance, d distance, z
cosine at the lamp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from glint.engine.evaluation.sky import radiance
from glint.engine.evaluation.textures import Image
from glint.engine.linear.columns import basis_around, dot, length, pick, unit
from glint.engine.scene import Light, Scene

Array = np.ndarray

NO_CONE = np.pi / 2 - 5e-5
"""Half angles of an area lamp's spread from which on it shines all before it."""


@dataclass(frozen=True, eq=False)
class Drawn:
    """A random point of a lamp, one for each of n points. direction: (3, n) unit, towards it.

    distance: (n,), infinite for a sun.  light: (3, n) L over π and over the density of such points,
    a steradian.
    """

    direction: Array
    distance: Array
    light: Array


class Lamp:
    """A POINT, SPOT, SUN or AREA light of PHYSICAL illumination, relative to the eye (3,)."""

    def __init__(self, light: Light, eye: Array) -> None:
        frame = np.asarray(light.world_from_light, np.float64)
        self.light = light
        self.center = (frame[:, 3] - eye)[:, None]
        self.axis = unit(-frame[:, 2:3])
        self.right, self.up = light.size_x / 2 * frame[:, :1], light.size_y / 2 * frame[:, 1:2]
        self.power = light.strength * np.array(light.color, np.float64)[:, None]

    def draw(self, x: Array, random: np.random.Generator) -> Drawn:
        """A point for each of the points x (3, n)."""
        u, v = random.random((2, x.shape[1]))
        if self.light.kind == "SUN":
            return self._sun(x, u, v)
        if self.light.kind == "AREA":
            return self._area(x, u, v)
        if not self.light.radius:
            return self._to(x, np.repeat(self.center, x.shape[1], 1), 1 / (4 * np.pi**2))
        return self._disc(x, u, v) if self.light.soft_falloff else self._ball(x, u, v)

    def _to(self, x: Array, q: Array, share: Array | float) -> Drawn:
        """The points q (3, n). share: L z over π and over their density by area, for P = 1."""
        d = length(q - x)
        direction = unit(q - x)
        light = self.power * share * self._share(direction)
        return Drawn(direction, d, np.where(d > 0, light / np.where(d > 0, d * d, 1.0), 0.0))

    def _share(self, direction: Array) -> Array:
        """(n,) what of its radiance leaves against unit directions to it."""
        z = -dot(direction, self.axis)
        if self.light.kind == "SPOT":
            edge = np.cos(self.light.spot_size / 2)
            width = max((1 - edge) * self.light.spot_blend, 1e-12)
            t = np.clip((z - edge) / width, 0.0, 1.0)
            return t * t * (3 - 2 * t)
        half = min(self.light.spread, np.pi) / 2
        if self.light.kind != "AREA" or half >= NO_CONE:
            return np.ones_like(z)
        tangent = np.sqrt(np.maximum(1 - z * z, 0.0)) / np.maximum(z, 1e-12)
        return np.maximum(np.tan(half) - tangent, 0.0) / (np.tan(half) - half)

    def _sun(self, x: Array, u: Array, v: Array) -> Drawn:
        """Even in the cone that it fills; its light falls as if all were in the middle."""
        cosine = 1 - u * self._versine
        direction = around(np.repeat(-self.axis, x.shape[1], 1), cosine, v)
        light = self.power * np.ones_like(u) * 2 / (2 - self._versine) / np.pi
        return Drawn(direction, np.full_like(u, np.inf), light)

    @property
    def _versine(self) -> float:
        return 2 * float(np.sin(self.light.angle / 4)) ** 2

    def _area(self, x: Array, u: Array, v: Array) -> Drawn:
        """Even over it: L is P over π and its area."""
        a, b = (2 * u - 1, 2 * v - 1) if self.light.shape == "RECTANGLE" else _disc(u, v)
        q = self.center + a * self.right + b * self.up
        z = -dot(unit(q - x), self.axis)
        return self._to(x, q, np.maximum(z, 0.0) / np.pi**2)

    def _disc(self, x: Array, u: Array, v: Array) -> Drawn:
        """Even over the disc that faces x: L is P over 4 π² r²."""
        towards = unit(self.center - x)
        first, second = basis_around(towards)
        a, b = _disc(u, v)
        q = self.center + self.light.radius * (a * first + b * second)
        return self._to(x, q, np.maximum(dot(unit(q - x), towards), 0.0) / (4 * np.pi**2))

    def _ball(self, x: Array, u: Array, v: Array) -> Drawn:
        """Even over the half that faces x, over all of it from inside: L is P over 4 π² r²."""
        out = around(np.repeat(np.eye(3)[:, 2:], x.shape[1], 1), 2 * u - 1, v)
        away = x - self.center
        is_inside = length(away) < self.light.radius
        out = out * np.where(~is_inside & (dot(out, away) < 0), -1.0, 1.0)
        q = self.center + self.light.radius * out
        z = -dot(out, unit(q - x))
        given = np.where(is_inside, 2 * np.abs(z), np.maximum(z, 0.0))
        return self._to(x, q, given * 2 / (4 * np.pi**2))

    # --- seen

    def seen(self, o: Array, d: Array) -> tuple[Array, Array]:
        """t (n,) at which rays o + t d, d unit, meet its shape, infinite for a sun and NaN for a
        miss, and its radiance (3, n) there.
        """
        light = self.light
        with np.errstate(divide="ignore", invalid="ignore"):
            if light.kind == "SUN":
                off = d + self.axis
                t = np.where(dot(off, off) / 2 <= self._versine, np.inf, np.nan)
                size = np.pi * np.sin(light.angle / 2) ** 2
            elif light.kind == "AREA":
                t, size = self._meets_area(o, d), np.pi * self._size
            else:
                t, size = self._meets_ball(o, d), 4 * np.pi**2 * light.radius**2
        return t, self.power / size * self._share(d)

    @property
    def has_shape(self) -> bool:
        """Whether there is anything to see."""
        light = self.light
        if light.kind == "AREA":
            return self._size > 0
        return (light.angle if light.kind == "SUN" else light.radius) > 0

    def is_seen(self, kind: str) -> bool:
        """Whether "camera", "mirror" or "transmission" rays see it."""
        return self.has_shape and bool(getattr(self.light, f"visible_{kind}", False))

    @property
    def _size(self) -> float:
        round_ = np.pi / 4 if self.light.shape == "ELLIPSE" else 1.0
        return self.light.size_x * self.light.size_y * round_

    def _meets_area(self, o: Array, d: Array) -> Array:
        facing = dot(d, self.axis)
        t = dot(self.center - o, self.axis) / facing
        off = o + t * d - self.center
        a, b = (dot(off, side) / dot(side, side) for side in (self.right, self.up))
        is_round = self.light.shape == "ELLIPSE"
        inside = a * a + b * b <= 1 if is_round else np.maximum(np.abs(a), np.abs(b)) <= 1
        return np.where(inside & (facing < 0), t, np.nan)

    def _meets_ball(self, o: Array, d: Array) -> Array:
        to, r = self.center - o, self.light.radius
        middle = dot(to, d)
        off = to - middle * d
        root = np.sqrt(r * r - dot(off, off))
        return np.where(dot(to, to) > r * r, middle - root, middle + root)


def _disc(u: Array, v: Array) -> tuple[Array, Array]:
    """A point of the unit disc, even over it."""
    return np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(u) * np.sin(2 * np.pi * v)


def around(axis: Array, cosine: Array, v: Array) -> Array:
    """(3, n) unit vectors at an angle of these cosines to the axes (3, n), a share v of the way
    round them.
    """
    first, second = basis_around(axis)
    sine = np.sqrt(np.maximum(1 - cosine * cosine, 0.0))
    turn = 2 * np.pi * v
    return cosine * axis + sine * (np.cos(turn) * first + np.sin(turn) * second)


class Surroundings:
    """What rays see that meet nothing: the world's background, and for light that surfaces scatter
    the DOME lights.
    """

    def __init__(self, scene: Scene) -> None:
        self._world, self._camera = scene.world, scene.camera
        self._images = [Image(texture) for texture in scene.world.textures]
        self._domes = [light for light in scene.lights if light.kind == "DOME"]

    def seen(self, d: Array, kind: str) -> Array:
        """(3, n) radiance along unit directions (3, n). kind: "camera", "mirror" or
        "scattered".
        """
        if kind == "scattered":
            return sum((_of_dome(light, d) for light in self._domes), np.zeros_like(d))
        world = self._world
        if world.program is None:
            return np.broadcast_to(np.array(world.background, np.float64)[:, None], d.shape)
        axes = np.asarray(world.axes, np.float64)
        return radiance(world.program, self._images, axes.T @ d, kind, (self._camera, d))


def _of_dome(light: Light, d: Array) -> Array:
    """(3, n) of its map, whose cells are each of one radiance (`engine.lights.dome`)."""
    assert light.radiance is not None
    rows, columns = light.radiance.shape[:2]
    x, y, z = np.asarray(light.world_from_light, np.float64)[:, :3].T @ d
    across = 0.5 - np.arctan2(y, x) / (2 * np.pi)
    upward = 0.5 + np.arcsin(np.clip(z, -1.0, 1.0)) / np.pi
    i = np.minimum((across * columns).astype(np.intp), columns - 1)
    j = np.minimum((upward * rows).astype(np.intp), rows - 1)
    power = light.strength * np.array(light.color, np.float64)[:, None]
    return power * pick(light.radiance.reshape(-1, 3).T.astype(np.float64), j * columns + i)
