"""Light that goes into a surface and comes out of it elsewhere, by Christensen and Burley's profile
(2015, Approximate Reflectance Profiles for Efficient Subsurface Scattering): where it comes out is
found along rays through the object (King, Kulla, Conty, Fajardo 2013, BSSRDF importance sampling).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from ..evaluation.panorama import step_size
from ..evaluation.surface import Surface
from ..linear.columns import across_normals, dot, length, pick
from ..program.execute.rays import Asked, Met
from .coefficients import Coefficients
from .paths import COLUMNS, Interaction, Paths, joined
from .paths import met as met_by
from .rays import IncoherentRays
from .scene_queries import SceneQueries
from .stage import Stage
from .surface import surface_at

Array = np.ndarray

REACH = 16.6
"""Of the largest radius d, how far from a point its light comes out: all but 0.3 % of it."""
SHARES = (1.0, 0.5, 0.5)
"""Rays of a sample along the normal and the two axes across it."""
LEAST = 1 / 64
"""Of a ring's light, that counts."""
_HALVINGS = 60


def within(r: Array, d: Array) -> Array:
    """The share of the profile of radius d that is within the distance r of its point."""
    e = np.exp(-r / (3 * d))
    return 1 - (e * e * e + 3 * e) / 4


@dataclass(frozen=True, eq=False)
class Profile:
    """That of n points. d: (3, n), 1 where a channel has none. on: (3, n) bool."""

    d: Array
    on: Array

    @property
    def reach(self) -> Array:
        """(n,)"""
        return REACH * np.where(self.on, self.d, 0.0).max(0)

    def take(self, index: Array) -> Profile:
        """Those of some points."""
        return Profile(pick(self.d, index), pick(self.on, index))

    def _whole(self) -> Array:
        return within(self.reach, self.d)

    def mean(self, r: Array) -> Array:
        """(n,) the share of the light within r, the mean of the channels."""
        share = within(r, self.d) / self._whole()
        return np.where(self.on, share, 0.0).sum(0) / self.on.sum(0)

    def radius(self, share: Array) -> Array:
        """(n,) within which that share of the light comes out."""
        low, high = np.zeros_like(share), self.reach
        for _ in range(_HALVINGS):
            r = (low + high) / 2
            inside = self.mean(r) < share
            low, high = np.where(inside, r, low), np.where(inside, high, r)
        return (low + high) / 2

    def ring(self, low: Array, high: Array) -> Array:
        """(3, n) how much of each channel comes out between two radii, over what does of all."""
        share = np.where(self.on, within(high, self.d) - within(low, self.d), 0.0) / self._whole()
        return share / (self.mean(high) - self.mean(low))

    def fall(self, near: Array, far: Array) -> Array:
        """(3, n) how dense the profile is at a distance over how dense it is nearer, round a ring
        of that radius each; 0 of channels that have none.
        """
        e = np.exp(-near * 2 / (3 * self.d)), np.exp(-far * 2 / (3 * self.d))
        return np.where(self.on, np.exp((near - far) / (3 * self.d)) * (1 + e[1]) / (1 + e[0]), 0.0)


def entering(stage: Stage, at: Interaction) -> tuple[Interaction, Interaction | None]:
    """The points without what of their light comes out elsewhere, and those that have some with it:
    `below` what they give back so.
    """
    lobes = at.coefficients
    if lobes.below is None or lobes.radius is None:
        return at, None
    matt = replace(at, coefficients=replace(lobes, below=None))
    if not stage.scatters_below(at.paths):
        return matt, None
    given = at.weight * lobes.below
    on = (given != 0) & np.isfinite(given) & (lobes.radius >= _least_radius(stage, at.surface.x))
    on &= at.surface.primitive < stage.geometry.first_rod
    here = np.flatnonzero(on.any(0))
    if not len(here):
        return matt, None
    below = np.where(on, lobes.below, 0.0)
    rest = replace(at, coefficients=replace(lobes, diffuse=lobes.diffuse - below, below=below))
    none = np.zeros((3, len(here)))
    entered = Coefficients(none, none, none, none, none, none, [], [], [], [], [])
    entered = replace(entered, below=pick(below, here), radius=pick(lobes.radius, here))
    some = Interaction(at.paths, at.hit[here], at.surface.take(here), entered)
    return rest, some


def _least_radius(stage: Stage, x: Array) -> Array | float:
    """(n,) a twentieth of what a pixel in the middle of the picture spans so far away: what is
    narrower is not seen.
    """
    camera = stage.scene.camera
    if camera.kind == "PANORAMA":
        return step_size(camera) / 2 * length(x)
    left, right = camera.window[:2]
    axis = np.sqrt((np.asarray(camera.world_from_camera, np.float64)[:, 0] ** 2).sum())
    pixel = 0.05 * axis * (right - left) / camera.resolution[0]
    return pixel if camera.kind == "ORTHOGRAPHIC" else pixel * length(x)


def coming_out(
    stage: Stage, at: Interaction, queries: SceneQueries, row: Array
) -> Interaction | None:
    """Where the light of the points comes out, as white matt surfaces that rays meet which weigh as
    much as comes out there; None for nowhere. row: (6,) of `sampling.subsurface_points`.
    """
    lobes, surface = at.coefficients, at.surface
    assert lobes.below is not None and lobes.radius is not None
    on = lobes.below != 0
    profile = Profile(np.where(on, lobes.radius, 1.0), on)
    low, own, high, cosine, sine, across = np.tile(row[:, None], len(surface))
    r = profile.radius(own)
    given = at.weight * lobes.below * profile.ring(profile.radius(low), profile.radius(high))
    height = np.sqrt(np.maximum(profile.reach**2 - r * r, 0.0))
    axes = np.stack([surface.g, *across_normals(surface.g)])
    every, parts = np.arange(len(surface)), []
    for axis in (np.zeros(len(every), np.intp), across.astype(np.intp)):
        w, u, v = (axes[(axis + k) % 3, :, every].T for k in range(3))
        asked = Asked(surface.x + r * (cosine * u + sine * v) + height * w, -w, 2 * height)
        met = queries.crossings(surface, every, asked)
        part = _shares(met, axes, axis, surface.x, r, profile)
        weight = pick(given * _most(part, met.ray, lobes.below), met.ray) * part
        parts.append(_exits(stage, at, met, asked, part, weight, queries.sample))
    return _together([part for part in parts if len(part.hit)])


def _shares(met: Met, axes: Array, own: Array, x: Array, r: Array, profile: Profile) -> Array:
    """(3, k) what of the light of a ring comes out where its rays meet surfaces: each of the three
    axes has the whole of it, and they weigh by how well they see the surface (the power heuristic).
    own: (n,) which of them the rays are along. r: (n,) how far from the points they are.
    """
    way, r, own = met.surface.x - pick(x, met.ray), r[met.ray], own[met.ray]
    dense = np.stack(
        [
            share * np.abs(dot(pick(axis, met.ray), met.surface.g))
            for share, axis in zip(SHARES, axes, strict=True)
        ]
    )
    total = dense[0] ** 2 + dense[1] ** 2 + dense[2] ** 2
    part = np.divide(dense[own, np.arange(len(own))], total, out=np.zeros_like(r), where=total > 0)
    return part * profile.take(met.ray).fall(r, np.maximum(length(way), r))


def _most(part: Array, ray: Array, below: Array) -> Array:
    """(3, n) by how much less comes out along each ray than its parts (3, k) say, so that no more
    does than went in. below: (3, n) what is given back.
    """
    total = np.stack([np.bincount(ray, row, below.shape[1]) for row in part])
    most = np.maximum(1.0, 1.0 / np.maximum(np.abs(below), 1e-300))
    return np.where(total > most, most / np.where(total > 0, total, 1.0), 1.0)


def _exits(
    stage: Stage, at: Interaction, met: Met, asked: Asked, part: Array, weight: Array, sample: int
) -> Interaction:
    """The points, seen from the side that the light came from."""
    go = np.flatnonzero(weight.any(0) & np.isfinite(weight).all(0) & (part.max(0) >= LEAST))
    ray, primitive, depth = met.ray[go], met.surface.primitive[go], met.depth[go]
    turned = met.surface.outside[go] != at.surface.outside[ray]
    rays = IncoherentRays.of(
        pick(asked.start, ray), pick(asked.direction, ray), np.zeros(len(go)), asked.reach[ray]
    )
    place = (stage.geometry, stage.attributes, rays)
    surface = surface_at(*place, np.arange(len(go)), primitive, depth, stage.cancellation)
    behind = np.flatnonzero(turned)
    if len(behind):
        back = surface_at(
            *place, behind, primitive[behind], depth[behind], stage.cancellation, backwards=True
        )
        for field in fields(Surface):
            getattr(surface, field.name)[..., behind] = getattr(back, field.name)
    paths = _of_rays(at.paths, at.hit[ray], pick(weight, go))
    every = np.arange(len(go))
    surface = stage.shader.bent(met_by(paths, every, surface), paths.kind, stage.queries(sample))
    return _white(paths, surface)


def _of_rays(paths: Paths, ray: Array, weight: Array) -> Paths:
    """Rays with the past of these, with other weights."""
    none = np.zeros(len(ray))
    rays = IncoherentRays.of(*paths.rays.lines(ray), none, none + np.inf)
    past = {name: getattr(paths, name)[ray] for name in COLUMNS}
    return replace(paths, rays=rays, weight=weight, comes_out=True, **past)


def one_by_one(at: Interaction) -> Iterator[Interaction]:
    """Each of the points by itself."""
    for k in range(len(at.hit)):
        one = np.array([k])
        paths = _of_rays(at.paths, at.hit[one], pick(at.weight, one))
        yield _white(paths, at.surface.take(one))


def _white(paths: Paths, surface: Surface) -> Interaction:
    """What the rays meet as matt and white."""
    count = len(surface)
    none = np.zeros((3, count))
    lobes = Coefficients(none, none + 1, none, none, none, none, [], [], [], [], [])
    return Interaction(paths, np.arange(count), surface, lobes)


def _together(parts: list[Interaction]) -> Interaction | None:
    if not parts:
        return None
    surfaces = [part.surface for part in parts]
    surface = Surface(
        **{
            field.name: np.concatenate([getattr(some, field.name) for some in surfaces], -1)
            for field in fields(Surface)
        }
    )
    return _white(joined([part.paths for part in parts]), surface)
