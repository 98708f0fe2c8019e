"""Ray queries in float64 NumPy: any rays against any geometry."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from ..evaluation.geometry import KINDS, ULPS, Geometry, gather
from ..evaluation.placements import primitive_count
from ..scene import Scene
from ..scene.ray_batch import RayBatch
from .cancellation import Cancellation
from .rays import IncoherentRays
from .surface import spot_at
from .visibility import NOTHING, Visibility

Array = np.ndarray

CHUNK = 1 << 15  # rays that are answered together
GIANT = 1e18
"""Triangles that reach farther than this many times the size of the scene are left out and counted:
squares of their coordinates are beyond float32. (The core keeps them.)
"""
ANY = "any"
"""The kind of ray that sees what any kind sees."""


class ReferenceQueries:
    """Geometry in the reference's tree. bounds: (2, 3) world box.  stats: counts, and seconds of
    the build.
    """

    def __init__(self, scene: Scene) -> None:
        began = perf_counter()
        self._middle, self._scale = _anchor(gather(scene, np.zeros(3)))
        geometry = _without_giants(gather(_anchored(scene, self._middle, self._scale), np.zeros(3)))
        flags = [flag for kind in KINDS if (flag := geometry.visible[kind]) is not None]
        geometry.visible[ANY] = np.logical_or.reduce(flags) if len(flags) == len(KINDS) else None
        self._visibility = Visibility(
            geometry, np.ones(geometry.count, bool), Cancellation(lambda: False)
        )
        # Everything lies within a ball round the origin: rays from farther away start where they
        # enter it, as float32 boxes need.
        self._reach = 2 * geometry.reach
        tree = self._visibility.tree if geometry.count else None
        given = sum(
            len(group.world_from_object) * primitive_count(scene.geometries[group.geometry])
            for group in scene.instances
        )
        self.bounds = _bounds(geometry) / self._scale + self._middle
        counts = {
            "instances": len(geometry.placements.block),
            "primitives": geometry.count,
            "dropped": given - geometry.count,
        }
        counts |= {
            "bytes": tree.bytes if tree else 0,
            "nodes": sum(level.shape[2] for level in tree.levels) if tree else 0,
        }
        self.stats = {name: float(value) for name, value in counts.items()} | {
            "build": perf_counter() - began
        }

    def closest(self, batch: RayBatch) -> tuple[Array, Array, Array, Array, Array]:
        """t, instance, primitive, u, v of `accelerator.Hits`."""
        t, instance, primitive = (
            np.full(batch.size, np.inf, batch.origins.dtype),
            np.full(batch.size, -1, np.int32),
            np.full(batch.size, -1, np.int32),
        )
        u, v = np.zeros(batch.size, np.float32), np.zeros(batch.size, np.float32)
        for rays, scaled, along, skipped in self._chunks(batch):
            found = self._visibility.closest(scaled, batch.visibility or ANY)
            hit = np.flatnonzero(found.primitive != NOTHING)
            spot = spot_at(self._visibility.geometry, scaled, hit, found.primitive[hit])
            rays = rays[hit]
            with np.errstate(over="ignore"):  # beyond float32 reads as infinite
                t[rays] = (found.depth[hit] + skipped[hit]) / along[hit]
            instance[rays], primitive[rays] = (
                self._visibility.geometry.row[spot.primitive],
                spot.local,
            )
            u[rays], v[rays] = spot.weights[1:]
        return t, instance, primitive, u, v

    def occluded(self, batch: RayBatch) -> Array:
        """(size,) bool."""
        return self.closest(batch)[1] >= 0

    def _chunks(self, batch: RayBatch):
        """Rays that can hit, in chunks: their places, themselves in the tracer's units, how long
        their directions are, and how far from the origin they start.
        """
        arrays = [
            np.broadcast_to(array, (batch.size, *array.shape[1:]))
            for array in (batch.origins, batch.directions, batch.t_min, batch.t_max)
        ]
        for begin in range(0, batch.size, CHUNK):
            o, d, low, high = (array[begin : begin + CHUNK].astype(np.float64) for array in arrays)
            with np.errstate(invalid="ignore", over="ignore"):
                o = ((o - self._middle) * self._scale).T
                span = np.abs(d).sum(1)
                sound = (
                    np.isfinite(o).all(0)
                    & (span >= 1e-150)
                    & (span <= 1e150)
                    & (low < np.inf)
                    & (high > 0)
                )
            rays = np.flatnonzero(sound)
            yield (
                begin + rays,
                *self._scaled(o[:, rays], d[rays].T, np.maximum(low[rays], 0), high[rays]),
            )

    def _scaled(
        self, o: Array, d: Array, low: Array, high: Array
    ) -> tuple[IncoherentRays, Array, Array]:
        largest = np.abs(d).max(0, initial=0)
        length = np.sqrt(((d / largest) ** 2).sum(0)) * largest
        d, along = d / length, length * self._scale
        with np.errstate(over="ignore", invalid="ignore"):
            # before the ball, though rounded
            nearest = -(o * d).sum(0) * (1 - ULPS) - self._reach * np.sqrt(3)
            skipped = np.maximum(np.where(nearest < np.inf, nearest, 0), 0)
            near, far = low * along - skipped, high * along - skipped
            start = o + skipped * d
        start = np.where(np.isfinite(start).all(0), start, 0)
        return IncoherentRays.of(start, d, np.maximum(near, 0), far), along, skipped


def _without_giants(geometry: Geometry) -> Geometry:
    """Leaves out triangles that reach beyond GIANT; squares of what is left stay within float32."""
    points = np.where(np.abs(geometry.points) <= GIANT, geometry.points, np.inf)
    small = np.isfinite(points).all(0)[geometry.triangles].all(0)
    if small.all():
        return geometry
    points[:, ~np.isfinite(points).all(0)] = 0
    keep = np.concatenate([small, np.ones(geometry.count - geometry.triangle_count, bool)])
    visible = {
        kind: None if flags is None else flags[keep] for kind, flags in geometry.visible.items()
    }
    reach = max(
        (float(np.abs(a).max()) for a in (points, geometry.lower, geometry.upper) if a.size),
        default=0.0,
    )
    kept = {name: getattr(geometry, name)[keep] for name in ("number", "row", "material")}
    return replace(
        geometry,
        points=points,
        triangles=geometry.triangles[:, small],
        visible=visible,
        reach=reach,
        **kept,
    )


def _bounds(geometry: Geometry) -> Array:
    """(2, 3) box of the gathered geometry."""
    low = np.concatenate([geometry.points, geometry.lower], 1).min(1, initial=np.inf)
    high = np.concatenate([geometry.points, geometry.upper], 1).max(1, initial=-np.inf)
    return np.stack([low, high])


def _anchor(geometry: Geometry) -> tuple[Array, float]:
    """The middle of the geometry, and the power of two that brings half of it within 1. Medians: a
    stray vertex at 1e38 moves neither.
    """
    points = np.concatenate([geometry.points, geometry.lower / 2 + geometry.upper / 2], 1)
    if not points.size:
        return np.zeros(3), 1.0
    middle = np.median(points, 1)
    far = np.abs(points - middle[:, None]).max(0)
    size = np.median(far) or far.max()
    return middle, float(2.0 ** -np.clip(np.floor(np.log2(size)), -200, 200)) if size > 0 else 1.0


def _anchored(scene: Scene, middle: Array, scale: float) -> Scene:
    """The scene about that middle, at that scale."""

    def moved(matrix: Array) -> Array:
        result = matrix * scale
        result[:, :, 3] = (matrix[:, :, 3] - middle) * scale
        return result

    return replace(
        scene,
        instances=tuple(
            replace(g, world_from_object=moved(g.world_from_object)) for g in scene.instances
        ),
    )
