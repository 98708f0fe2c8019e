"""Shadows (notes, section 4.16): the share of a light sample's light that reaches the shaded
points.

Rays to a light's point that all share are coherent (all go through it), rays to a point of the sun
are parallel: both are traced from the light's side as a rasterisation. Rays to a point of their own
go through the tree.
"""

from __future__ import annotations

import copy
from collections import Counter
from dataclasses import replace

import numpy as np

from ..evaluation.attributes import Attributes
from ..evaluation.geometry import ULPS
from ..evaluation.surface import Surface
from ..linear.columns import dot, length, pick, transform, unit
from .lights import LightSample, Source
from .materials import Shader
from .media import Media
from .rays import CoherentRays, Frame, IncoherentRays, Rays
from .surface import spot_at, surface_at
from .terminator import start_towards
from .visibility import Hits, Passed, Visibility

Array = np.ndarray

MOST_BENT = 0.2
"""By how much the optical momentum of light across its way may change that still comes straight: as
thin lenses and uneven panes bend it, and balls and bottles do not.
"""
ALIKE = 1e-6
"""Of products of indices that come to 1."""


class Shadows:
    """Shadow rays through one geometry. rays: where they are counted."""

    def __init__(
        self,
        visibility: Visibility,
        shader: Shader,
        attributes: Attributes,
        rays: Counter[str],
        media: Media,
    ):
        self._visibility, self._geometry, self._shader = visibility, visibility.geometry, shader
        self._attributes, self._rays, self._media = attributes, rays, media
        self._seen = visibility.geometry.visible["shadow"]
        self._blockers: Array | None = None
        self._kind = "shadow"
        self._bends = False

    def mirrors_differ(self, source: Source) -> bool:
        """Whether mirrors show some things that rays to samples of a light do not meet, or the
        other way.
        """
        geometry = self._geometry
        return geometry.mirrors_differ or (source.light.kind == "DOME" and geometry.diffuse_differs)

    def cast_by(self, blockers: Array) -> Shadows:
        """Those of some rows of the placements alone, (r,) bool."""
        result = copy.copy(self)
        result._blockers = blockers
        result._seen = self._of_blockers(blockers, self._seen)
        result._media = self._media.of(blockers)
        return result

    def of_lamp(self) -> Shadows:
        """Those of what is no sky: what a body bends does not arrive."""
        result = copy.copy(self)
        result._bends = True
        return result

    def _of_blockers(self, blockers: Array, seen: Array | None) -> Array:
        mine = blockers[self._geometry.row]
        return mine if seen is None else mine & seen

    def met_by(self, kind: str) -> Shadows:
        """Those of what rays of a kind meet; media stay."""
        if kind == "shadow":
            return self
        result = copy.copy(self)
        result._seen, result._kind = self._geometry.visible[kind], f"shadow {kind}"
        if self._blockers is not None:
            result._seen = self._of_blockers(self._blockers, result._seen)
        return result

    def first_met(self, rays: IncoherentRays) -> Hits:
        """What stands first in the way of each ray, whether light passes it or not."""
        return self._visibility.closest_of(rays, self._seen)

    def towards(
        self, surface: Surface, seen: Array, sample: LightSample, through: Array | None = None
    ) -> Array:
        """S (m, 3) for the points `seen` (m,) of the surface, which the sample lights. through:
        (m,) how far the rays begin on their way, behind fibres that they pass.
        """
        self._rays["shadow"] += len(seen)
        start = self._start(surface, seen, sample)
        if through is not None:
            if sample.end is not None:
                through = np.minimum(through, length(sample.end - start) / 2)
            start = start + through * sample.direction
        shadows = self.met_by(sample.met_by)
        return shadows.from_points(start, sample, counted=True)

    def along(self, rays: IncoherentRays, far: Array) -> Array:
        """(3, n) what gets along rays up to far (n,), short of what is there."""
        self._rays["shadow"] += len(rays)
        o, d = rays.lines(np.arange(len(rays)))
        margin = ULPS * np.maximum(np.abs(o).max(0), np.abs(o + far * d).max(0))
        return self._blocked(replace(rays, far=far - margin)).T

    def near(self, surface: Surface, direction: Array, reach: float) -> Array:
        """(3, n) what is open over all points of the surface in the unit directions (3, n), as far
        as `reach`.
        """
        n = len(surface)
        self._rays["shadow"] += n
        sample = LightSample(direction, np.ones(n), None, np.zeros(n))
        start, ends = (
            self._start(surface, np.arange(n), sample),
            (np.zeros(n), np.full(n, 1.0 * reach)),
        )
        rays = IncoherentRays.of(start, direction, *ends)
        passed = self._blocked(rays).T
        if self._media:
            passed = passed * self._media.passed(self._media.spans(rays, "shadow", ends[1]), *ends)
        return passed

    def from_points(self, start: Array, sample: LightSample, counted: bool = False) -> Array:
        """The same for points (3, m) where nothing is. counted: whether the rays are already."""
        self._rays["shadow"] += 0 if counted else start.shape[1]
        passed = self._between(start, sample)
        return passed * self._through_media(start, sample) if self._media else passed

    def _start(self, surface: Surface, seen: Array, sample: LightSample) -> Array:
        """(3, m) clear of the surface, on the light's side."""
        start = start_towards(surface, seen, sample.direction)
        g, offset = pick(surface.g, seen), surface.offset[seen]
        end = sample.end
        beside = np.where(dot(g, sample.direction if end is None else end - start) < 0, -1.0, 1.0)
        reach = offset if end is None else offset + ULPS * np.abs(end).max(0)
        return start + (beside * reach) * g

    def _through_media(self, start: Array, sample: LightSample) -> Array:
        """(m, 3) what media on the way to the light let through."""
        n = start.shape[1]
        way = np.full(n, np.inf)
        direction = np.broadcast_to(sample.direction, start.shape)
        if sample.end is not None:
            way = length(sample.end - start)
            direction = unit(sample.end - start)
        rays = IncoherentRays.of(start, direction, np.zeros(n), way)
        return self._media.passed(self._media.spans(rays, "shadow", way), rays.near, way).T

    def _between(self, start: Array, sample: LightSample) -> Array:
        """(m, 3) what surfaces between the points and the light let through."""
        end, m = sample.end, start.shape[1]
        if end is None and (sample.direction == sample.direction[:, :1]).all():
            return self._parallel(start, sample.direction[:, 0])
        if end is None:
            return self._blocked(
                IncoherentRays.of(start, sample.direction, np.zeros(m), np.full(m, np.inf))
            )
        if sample.leaves:
            return self._each(start, np.broadcast_to(end, start.shape), sample.short)
        if end.shape[1] == 1:
            return self._through(start, end[:, 0], sample.short)
        return self._each(start, end, sample.short)

    def _blocked(self, rays: Rays) -> Array:
        found = self._visibility.blocked(rays, self._transmittance, self._seen)
        return arriving(found, self._bends)

    def _transmittance(self, rays: Rays, ray: Array, primitive: Array, depth: Array) -> Passed:
        if not self._shader.reads_surfaces:
            spot = spot_at(self._geometry, rays, ray, primitive)
            return Passed(self._shader.transmittance(spot, self._kind), np.zeros((len(ray), 3)))
        from_light = isinstance(rays, CoherentRays) and rays.frame.perspective
        surface = surface_at(
            self._geometry,
            self._attributes,
            rays,
            ray,
            primitive,
            depth,
            self._visibility.cancellation,
            backwards=from_light,
        )
        o, d = rays.lines(ray)
        left = o + (rays.far if from_light else rays.near)[ray] * d
        surface = replace(surface, far=length(surface.x - left))
        passed = self._shader.transmittance(surface, self._kind)
        return Passed(passed, bent(surface, passed[:, 3]))

    def _parallel(self, start: Array, direction: Array) -> Array:
        matrix = parallel_frame(direction)
        frame = Frame.of(self._geometry, matrix, np.zeros(3), perspective=False)
        u, v, z = transform(matrix, start)
        return self._blocked(CoherentRays(frame, u, v, z, np.full(len(z), np.inf)))

    def _through(self, start: Array, light: Array, short: float) -> Array:
        """Six sets of rays from the light, one for each side of a cube round it."""
        arm = start - light[:, None]
        axis = np.abs(arm).argmax(0)
        side = 2 * axis + (np.take_along_axis(arm, axis[None], 0)[0] < 0)
        result = np.ones((len(side), 3))
        near = short * np.abs(light).max()
        for face in range(6):
            mine = np.flatnonzero(side == face)
            if len(mine):
                matrix = cube_frame(face)
                x, y, z = transform(matrix, pick(arm, mine))
                frame = Frame.of(self._geometry, matrix, light, perspective=True)
                seen = np.flatnonzero(z > 0)
                x, y, z = x[seen], y[seen], z[seen]
                result[mine[seen]] = self._blocked(
                    CoherentRays(frame, x / z, y / z, np.full(len(z), near), z)
                )
        return result

    def _each(self, start: Array, end: Array, short: float) -> Array:
        arm = end - start
        far = length(arm)
        safe = np.where(far > 0, far, 1.0)
        margin = short * np.abs(end).max(0)
        direction = np.where(far > 0, arm / safe, np.array([[0.0], [0.0], [1.0]]))
        return self._blocked(IncoherentRays.of(start, direction, np.zeros(len(far)), far - margin))


def arriving(found: Passed, is_lamps: bool) -> Array:
    """(m, 3) what of light arrives straight. is_lamps: and not from all of the sky."""
    narrowed, bent = found.passed[:, 3:], np.square(found.bent).sum(1) > MOST_BENT**2
    passed = found.passed[:, :3] * np.minimum(narrowed, 1.0)
    if not is_lamps:
        return passed
    return np.where((np.abs(narrowed - 1) < ALIKE) & bent[:, None], 0.0, passed)


def bent(surface: Surface, narrowed: Array) -> Array:
    """(m, 3) by how much the optical momentum of light that goes straight on changes across its
    way: along the normal alone, so that what enters by one side of a pane and leaves by the other
    adds up to nothing. narrowed: (m,) as of `Shader.transmittance`.
    """
    g, v = surface.g, surface.v  # smooth normals of a pane would make it a lens
    cosine = dot(g, v)
    square = np.where(surface.outside, narrowed, 1 / narrowed)
    size = np.sqrt(np.maximum(square - 1 + cosine * cosine, 0.0)) - cosine
    return (np.where(surface.outside, -size, size) * (g - cosine * v)).T


def cube_frame(face: int) -> Array:
    """(3, 3) that turns side `face` of a cube (+x −x +y −y +z −z) to +z by exchanging and mirroring
    axes.
    """
    axis, sign = face // 2, 1.0 - 2.0 * (face % 2)
    matrix = np.zeros((3, 3))
    matrix[0, (axis + 1) % 3] = matrix[1, (axis + 2) % 3] = 1.0
    matrix[2, axis] = sign
    return matrix


def parallel_frame(direction: Array) -> Array:
    """(3, 3) that shears the world so that `direction` runs along +z (Woop's shear with a common
    direction).
    """
    axis = int(np.abs(direction).argmax())
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((3, 3))
    matrix[0, i] = matrix[1, j] = 1.0
    matrix[0, axis], matrix[1, axis] = (
        -direction[i] / direction[axis],
        -direction[j] / direction[axis],
    )
    matrix[2, axis] = np.copysign(1.0, direction[axis])
    return matrix
