"""Lights, those that the tracers make too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..program.program import Program
from .model_geometry import EVERYTHING
from .model_surfaces import Texture

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Emitters:
    """m triangles, each of one radiance on a side.

    corners: (m, 3, 3) float64, in the light's axes, counter-clockwise seen from outside.
    front, back: (m, 3) radiance of the outer side and the inner one.  weight: (m,) how densely, by
    area, points lie on them, but for a factor.  light_group: (m,) int, as of `Instances`.
    """

    corners: Array
    front: Array
    back: Array
    weight: Array
    light_group: Array

    @cached_property
    def areas(self) -> Array:
        """(m,)"""
        return np.linalg.norm(self._across, axis=1) / 2

    @cached_property
    def normals(self) -> Array:
        """(m, 3) unit, outward; 0 where a triangle has no area."""
        size = np.linalg.norm(self._across, axis=1)[:, None]
        return self._across / np.where(size > 0, size, 1.0)

    @cached_property
    def _across(self) -> Array:
        a, b, c = np.moveaxis(self.corners, 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def reaches(self) -> Array:
        """(m,) lengths of the longest sides."""
        sides = np.diff(self.corners, axis=1, append=self.corners[:, :1])
        return np.linalg.norm(sides, axis=2).max(1)

    @cached_property
    def spreads(self) -> Array:
        """(m,) one over the density, by area, of the points on each."""
        return np.vdot(self.weight, self.areas) / self.weight

    def take(self, index: Array) -> Emitters:
        """Those at these places."""
        columns = self.corners, self.front, self.back, self.weight, self.light_group
        return Emitters(*(column[index] for column in columns))


@dataclass(frozen=True, eq=False)
class Rods:
    """m pieces of lines through media that glow, each of one brightness.

    ends: (m, 2, 3) float64, in the light's axes.  emission: (m, 3) radiance that the medium gives a
    world unit.  section: (m,) area across it that a piece stands for.  weight: (m,) how densely, by
    volume, points lie on it, but for a factor.  light_group: (m,) int, as of `Instances`.
    """

    ends: Array
    emission: Array
    section: Array
    weight: Array
    light_group: Array

    @staticmethod
    def together(parts: Sequence[Rods]) -> Rods:
        """All of them."""
        return Rods(*(np.concatenate([getattr(p, name) for p in parts]) for name in _OF_RODS))

    @cached_property
    def volumes(self) -> Array:
        """(m,)"""
        return np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1) * self.section

    @cached_property
    def spreads(self) -> Array:
        """(m,) one over the density, by volume, of the points on each."""
        return np.vdot(self.weight, self.volumes) / self.weight

    def take(self, index: Array) -> Rods:
        """Those at these places."""
        return Rods(*(getattr(self, name)[index] for name in _OF_RODS))

    def cut(self, parts: Array) -> Rods:
        """Each in so many (m,) of one length."""
        index = np.repeat(np.arange(len(parts)), parts)
        number = np.arange(len(index)) - np.repeat(np.cumsum(parts) - parts, parts)
        whole = self.take(index)
        first, way = whole.ends[:, :1], whole.ends[:, 1:] - whole.ends[:, :1]
        share = np.stack([number, number + 1], 1) / parts[index, None]
        return replace(whole, ends=first + share[..., None] * way)


_OF_RODS = ("ends", "emission", "section", "weight", "light_group")


@dataclass(frozen=True, eq=False)
class Openings:
    """k rectangles through which rooms see the sky.

    centers: (k, 3) float64, world. right, up: (k, 3) half of their sides, across each other.
    normals: (k, 3) unit, to the side of the sky.  shares: (k,) of the points on them, sum 1.
    """

    centers: Array
    right: Array
    up: Array
    normals: Array
    shares: Array

    def told(self, axes: Array, eye: Array) -> Openings:
        """In a frame of orthonormal columns, as seen from an eye."""
        c, u, v, n = (x @ axes for x in (self.centers - eye, self.right, self.up, self.normals))
        return Openings(c, u, v, n, self.shares)


LIGHTS = ("POINT", "SUN", "SPOT", "AREA", "DOME", "MESH", "MEDIUM")


LIGHT_SHAPES = ("RECTANGLE", "ELLIPSE")


@dataclass(frozen=True, eq=False)
class Light:
    """A light. kind: POINT, SUN, SPOT, AREA, DOME, which shines from all around, or MESH, which
    `lights.lit.lit_scene` makes of surfaces that glow, or MEDIUM, of media that glow.

    world_from_light: (3, 4) float64, orthonormal columns; the light shines along -z. color: RGB;
    strength: Blender's number (watts; W/m² for SUN) with exposure applied, may be negative. radius:
    of POINT and SPOT, world units; soft_falloff: the radius is a disc that faces the shaded point
    instead of a sphere. angle: full angle of the SUN. spot_size: full cone angle, spot_blend: 0-1.
    shape: RECTANGLE or ELLIPSE, size_x, size_y: full extents of an AREA light along its x and y,
    world units; spread: full angle of the cone that it shines in. cast_shadow: False lights through
    everything. visible_*: the light's own shape is seen by those rays. lights_matt, lights_gloss,
    lights_media: whether DIFFUSE, SHEEN, TRANSLUCENT and FIBRE_DIFFUSE lobes get its light, other
    lobes, and media. program: its first output, a vector, is what the colour is times at each point
    of the light that is seen from a lit one, None for 1; it reads no attributes, and a DOME has
    none. textures: what it refers to. radiance: of a DOME, times color and strength: (h, w, 3)
    float32 in the light's axes, equirectangular as `engine.lights.dome` says. emitters: of a MESH,
    whose bounds are size_x, size_y and twice the radius along the light's axes, round its origin.
    rods: of a MEDIUM one, the same. openings: of a DOME, points on which are samples of it too: the
    user's portals, else `lights.lit.lit_scene` finds them. receivers: a bit for each light_set of
    the instances that it lights, blockers: of those that cast shadows in it. motion: (k, 3, 4)
    float64, k >= 2, world_from_light at even times while the shutter is open; None for one that
    stands still, and of a DOME, MESH or MEDIUM one. light_group: of `Scene.light_groups`, -1 for
    none; emitters and rods have their own.
    """

    name: str
    kind: str
    world_from_light: Array
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    strength: float = 1.0
    radius: float = 0.0
    soft_falloff: bool = False
    angle: float = 0.0
    spot_size: float = np.pi / 4
    spot_blend: float = 0.0
    shape: str = "RECTANGLE"
    size_x: float = 0.0
    size_y: float = 0.0
    spread: float = np.pi
    cast_shadow: bool = True
    visible_camera: bool = False
    visible_mirror: bool = False
    visible_transmission: bool = False
    program: Program | None = None
    textures: tuple[Texture, ...] = ()
    radiance: Array | None = None
    emitters: Emitters | None = None
    rods: Rods | None = None
    openings: Openings | None = None
    receivers: int = EVERYTHING
    blockers: int = EVERYTHING
    motion: Array | None = None
    light_group: int = -1
    lights_matt: bool = True
    lights_gloss: bool = True
    lights_media: bool = True
