"""Materials' programs and factors at points of surfaces, and the light that these give of
themselves.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..linear.columns import add_at, pick
from ..program.execute.colors import rgb_to_bw
from ..program.execute.run import run
from ..scene import Input, Lobe, Material, Scene
from .attributes import Attributes
from .geometry import Geometry
from .points import Queries, SurfacePoints, Surroundings
from .surface import Spot, Surface
from .textures import Image

Array = np.ndarray

_WHITE = (Input((0.8, 0.8, 0.8)),)
DEFAULT = Material("default", (Lobe("DIFFUSE", _WHITE), Lobe("AMBIENT", _WHITE)))
"""What faces without any material look like."""


class MaterialPoints:
    """The materials of a scene, to be evaluated at points."""

    def __init__(self, scene: Scene, attributes: Attributes, geometry: Geometry) -> None:
        self.materials = (*scene.materials, DEFAULT)  # index -1 is the default
        self._attributes = attributes
        self.images = [Image(t) for t in scene.textures]
        self._around = Surroundings(attributes, self.images, geometry, scene.camera)

    def emission(self, surface: Surface, kind: str) -> Array:
        """(3, n) radiance of the EMISSION lobes. kind: of the rays that meet the surface, as
        `points.light_path` has it.
        """
        total = np.zeros((3, len(surface)))
        for material, index in self._by_material(surface):
            outputs = self._outputs(material, surface, index, kind, None)
            for lobe in material.lobes:
                if lobe.kind == "EMISSION":
                    add_at(total, index, self._product(lobe, surface, index, outputs))
        return total

    def _by_material(self, spot: Spot) -> Iterator[tuple[Material, Array]]:
        """Materials, and which points have them."""
        for number in np.unique(spot.material):
            yield self.materials[number], np.flatnonzero(spot.material == number)

    def _outputs(
        self,
        material: Material,
        spot: Spot,
        index: Array,
        kind: str,
        queries: Queries | None,
    ) -> list[Array]:
        """Of the material's program, (3, m) each; none without one."""
        if material.program is None:
            return []
        points = SurfacePoints(self._around, spot, index, kind, queries)
        return run(material.program, points, len(index))

    def _product(self, lobe: Lobe, spot: Spot, index: Array, outputs: list[Array]) -> Array:
        """(3, m) or (3, 1): k of the lobe at the points `index`."""
        k = np.ones((3, 1))
        for factor in lobe.factors:
            k = k * self._factor(factor, spot, index, outputs)
        return k

    def _factor(self, factor: Input, spot: Spot, index: Array, outputs: list[Array]) -> Array:
        value = np.array(factor.value, np.float64)[:, None]
        if factor.texture >= 0:
            value = value * self._texture(factor, spot, index)
        if factor.attribute:
            color = self._attributes.color(factor.attribute).at(
                spot.geometry[index], spot.local[index], pick(spot.weights, index)
            )
            value = value * _channel(color, factor.attribute_channel)
        if factor.output >= 0:
            value = value * outputs[factor.output]
            value = np.where(np.isfinite(value), value, 0.0)
        if not factor.is_plain:
            value = np.clip(
                value + np.array(factor.offset, np.float64)[:, None], factor.low, factor.high
            )
        return 1.0 - value if factor.complement else value

    def _texture(self, factor: Input, spot: Spot, index: Array) -> Array:
        u, v = self._attributes.uv(factor.uv).at(
            spot.geometry[index], spot.local[index], pick(spot.weights, index)
        )
        (a, b, c), (d, e, f) = factor.uv_transform
        rgba = self.images[factor.texture].read(a * u + b * v + c, d * u + e * v + f)
        return _channel(rgba, factor.channel)


def _channel(rgba: Array, channel: str) -> Array:
    """(3, m) or (1, m) of a colour (4, m)."""
    if channel == "COLOR":
        return rgba[:3]
    return rgba[3:4] if channel == "ALPHA" else rgb_to_bw(rgba)[None]
