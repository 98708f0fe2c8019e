"""What the media of a scene leave of the light that walks carry (SEMANTICS.md, Media)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..accelerator import Accelerator
from ..scene import Camera, Instances, Material, Scene
from ..scene import Geometry as AnyGeometry

if TYPE_CHECKING:
    from ..reference.geometry import Geometry
    from ..reference.media import Media
    from ..reference.rays import Rays

Array = np.ndarray

COARSE = 2.0
"""Steps of walks in media that vary, over those of rays to lights."""
MOST_LAYERS = 256
"""Of an enclosure on one ray: so many surfaces are sought at most."""
BEYOND = 1 + 2.0**-40
"""Of the way to a surface, from where the next one is sought."""


def camera_at(eye: Array) -> Camera:
    """Any camera there."""
    frame = np.column_stack([np.eye(3), eye])
    return Camera("PERSPECTIVE", frame, (-1.0, 1.0, -1.0, 1.0), (1, 1))


def walk_media(scene: Scene, origin: Array) -> WalkMedia | None:
    """None where there are no media."""
    enclosing = tuple(block for block in scene.instances if scene.medium_of(block) is not None)
    if not enclosing and scene.world.medium is None:
        return None
    world = scene.world
    if world.medium is not None:
        world = replace(world, medium=replace(world.medium, step=COARSE * world.medium.step))
    alone = replace(
        scene,
        camera=camera_at(origin),
        world=world,
        materials=tuple(map(_coarse, scene.materials)),
        instances=enclosing,
        lights=(),
    )
    return WalkMedia(alone, origin)


def _coarse(material: Material) -> Material:
    medium = material.medium
    return (
        material
        if medium is None
        else replace(material, medium=replace(medium, step=COARSE * medium.step))
    )


class WalkMedia:
    """Of a scene of nothing but what encloses media. Points count from an origin."""

    def __init__(self, scene: Scene, origin: Array) -> None:
        from ..reference.attributes import Attributes
        from ..reference.geometry import gather
        from ..reference.media import Media

        surfaces = Surfaces(scene.geometries, scene.instances, gather(scene, origin), origin)
        self._media: Media = Media(scene, Attributes(scene), surfaces)

    def passed(self, x: Array, d: Array, way: Array) -> Array:
        """(3, n) what is left at points x (3, n) of light that came a way (n,) in the unit
        directions d (3, n).
        """
        from ..reference.rays import IncoherentRays

        near = np.zeros(len(way))
        rays = IncoherentRays.of(x, -d, near, way)
        return self._media.passed(self._media.spans(rays, "shadow", way), near, way)


class Surfaces:
    """What encloses media, as `Visibility` has it, met by the queries of an `Accelerator`: one for
    each block, so that no surface hides another one that lies in it.
    """

    def __init__(
        self,
        geometries: Sequence[AnyGeometry],
        instances: Sequence[Instances],
        geometry: Geometry,
        origin: Array,
    ) -> None:
        from ..reference.cancellation import Cancellation

        self.geometry, self.cancellation = geometry, Cancellation(lambda: False)
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
