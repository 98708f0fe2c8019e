"""What rays meet of things that enclose media, before there is a render."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..accelerator import Accelerator
from ..evaluation.geometry import Geometry
from ..evaluation.media import Rays
from ..scene import Geometry as AnyGeometry
from ..scene import Instances

Array = np.ndarray

MOST_LAYERS = 256
"""Of an enclosure on one ray: so many surfaces are sought at most."""
BEYOND = 1 + 2.0**-40
"""Of the way to a surface, from where the next one is sought."""


def joined(instances: Sequence[Instances]) -> tuple[Instances, ...]:
    """The same placements in as few blocks as differ in what they are filled with: a file of 50 000
    objects has as many blocks.
    """
    alike: dict[tuple, list[Instances]] = {}
    for block in instances:
        key = block.geometry, tuple(block.materials), frozenset(block.values)
        alike.setdefault(key, []).append(block)
    return tuple(
        replace(
            blocks[0],
            world_from_object=np.concatenate([b.world_from_object for b in blocks]),
            values={
                name: np.concatenate([b.values[name] for b in blocks]) for name in blocks[0].values
            },
            motion=None,
        )
        for blocks in alike.values()
    )


class Surfaces:
    """What encloses media, met by the queries of an `Accelerator`: one for each block, so that no
    surface hides another one that lies in it.
    """

    def __init__(
        self,
        geometries: Sequence[AnyGeometry],
        instances: Sequence[Instances],
        geometry: Geometry,
        origin: Array,
    ) -> None:
        self._origin = origin
        self._blocks = [
            (len(b.world_from_object), Accelerator([geometries[b.geometry]], [_alone(b)]))
            for b in instances
        ]
        primitive = geometry.primitive_of(np.arange(geometry.count))
        keys = geometry.row.astype(np.int64) << 32 | primitive
        self._order = np.argsort(keys, kind="stable")
        self._keys = keys[self._order]

    def crossings(self, rays: Rays, seen: Array) -> tuple[Array, Array, Array]:
        """Rays, primitives and depths (m,) of all meetings with the primitives (p,) bool."""
        o, d = rays.lines(np.arange(len(rays)))
        o, d = (o + self._origin[:, None]).T, np.ascontiguousarray(d.T)
        found = [(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))]
        row = 0
        for rows, surfaces in self._blocks:
            found += self._of_block(surfaces, o, d, rays.near, row)
            row += rows
        ray, primitive, depth = (np.concatenate(column) for column in zip(*found, strict=True))
        some = np.flatnonzero(seen[primitive])
        return ray[some], primitive[some], depth[some]

    def _of_block(self, surfaces: Accelerator, o: Array, d: Array, near: Array, row: int) -> list:
        ray, near, found = np.arange(len(o)), near.copy(), []
        for _ in range(MOST_LAYERS):
            hits = surfaces.closest(o[ray], d[ray], t_min=near[ray], visibility="shadow")
            met = np.flatnonzero(hits.instance >= 0)
            ray = ray[met]
            if not len(ray):
                break
            near[ray] = hits.t[met] * BEYOND
            wanted = (hits.instance[met].astype(np.int64) + row) << 32 | hits.primitive[met]
            at = np.minimum(np.searchsorted(self._keys, wanted), len(self._keys) - 1)
            known = np.flatnonzero(self._keys[at] == wanted)
            found.append((ray[known], self._order[at[known]], hits.t[met][known]))
        return found


def _alone(block: Instances) -> Instances:
    """The block where its geometry is the only one."""
    return replace(block, geometry=0, materials=(0,) * len(block.materials))
