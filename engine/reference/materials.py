"""Materials as the notes' coefficients at points of the surface: k_a, k_d, k_s and the rest, each
the product of a lobe's factors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..scene import Input, Lobe, Material, Scene
from .attributes import Attributes
from .surface import Spot, Surface
from .textures import Image
from .vectors import add_at, dot, pick

Array = np.ndarray

_WHITE = (Input((0.8, 0.8, 0.8)),)
DEFAULT = Material("default", (Lobe("DIFFUSE", _WHITE), Lobe("AMBIENT", _WHITE)))
"""What faces without any material look like."""

_SUMMED = {
    "AMBIENT": "ambient",
    "DIFFUSE": "diffuse",
    "EMISSION": "emission",
    "TRANSPARENT": "transparent",
}


@dataclass(frozen=True, eq=False)
class Term:
    """A lobe that needs a ray or a highlight, at m of the points: index (m,), k (3, m)."""

    index: Array
    k: Array
    lobe: Lobe


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Sums (3, n) of the lobes of n points, and the terms that cannot be summed."""

    ambient: Array
    diffuse: Array
    emission: Array
    transparent: Array
    highlights: list[Term]
    mirrors: list[Term]
    refractions: list[Term]


class Shader:
    """Evaluates the materials of a scene."""

    def __init__(self, scene: Scene, attributes: Attributes):
        self._materials = (*scene.materials, DEFAULT)  # index -1 is the default
        self._attributes = attributes
        self._images = [Image(t) for t in scene.textures]

    def is_transparent(self, material: Array) -> Array:
        """(n,) bool: has a TRANSPARENT lobe."""
        return np.array(
            [any(lobe.kind == "TRANSPARENT" for lobe in m.lobes) for m in self._materials]
        )[material]

    def pass_index(self, material: Array) -> Array:
        """(n,) Blender's material index; 0 for the default one."""
        return np.array([m.index for m in self._materials])[material]

    def coefficients(self, surface: Surface) -> Coefficients:
        """All lobes at each point."""
        shape = (3, len(surface.primitive))
        sums = {name: np.zeros(shape) for name in _SUMMED.values()}
        terms: dict[str, list[Term]] = {"SPECULAR": [], "MIRROR": [], "REFRACTION": []}

        def add(lobe: Lobe, index: Array, k: Array) -> None:
            if lobe.exponent > 0 and lobe.kind in ("AMBIENT", "DIFFUSE"):
                k = (
                    k
                    * (1 - np.clip(dot(pick(surface.n, index), pick(surface.v, index)), 0.0, 1.0))
                    ** lobe.exponent
                )
            if lobe.kind in _SUMMED:
                add_at(sums[_SUMMED[lobe.kind]], index, k)
            else:
                terms[lobe.kind].append(Term(index, k, lobe))

        self._each_lobe(surface, add)
        return Coefficients(
            **sums,
            highlights=terms["SPECULAR"],
            mirrors=terms["MIRROR"],
            refractions=terms["REFRACTION"],
        )

    def transmittance(self, spot: Spot) -> Array:
        """(n, 3): what passes straight through, the clamped sum of the TRANSPARENT lobes."""
        total = np.zeros((len(spot.primitive), 3))

        def add(lobe: Lobe, index: Array, k: Array) -> None:
            total[index] += k.T

        self._each_lobe(spot, add, ("TRANSPARENT",))
        return np.clip(total, 0.0, 1.0)

    def _each_lobe(
        self, spot: Spot, add: Callable[[Lobe, Array, Array], None], kinds: tuple[str, ...] = ()
    ) -> None:
        for material in np.unique(spot.material):
            index = np.flatnonzero(spot.material == material)
            for lobe in self._materials[material].lobes:
                if not kinds or lobe.kind in kinds:
                    add(lobe, index, self._product(lobe, spot, index))

    def _product(self, lobe: Lobe, spot: Spot, index: Array) -> Array:
        """(3, m) or (3, 1): k of the lobe at the points `index`."""
        k = np.ones((3, 1))
        for factor in lobe.factors:
            k = k * self._factor(factor, spot, index)
        return k

    def _factor(self, factor: Input, spot: Spot, index: Array) -> Array:
        value = np.array(factor.value, np.float64)[:, None]
        if factor.texture >= 0:
            value = value * self._texture(factor, spot, index)
        if factor.attribute:
            color = self._attributes.color(factor.attribute).at(
                spot.geometry[index], spot.local[index], pick(spot.weights, index)
            )
            value = value * (color[3:4] if factor.attribute_channel == "ALPHA" else color[:3])
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
        rgba = self._images[factor.texture].read(a * u + b * v + c, d * u + e * v + f)
        if factor.channel == "COLOR":
            return rgba[:3]
        return rgba[3:4] if factor.channel == "ALPHA" else (rgba[:1] + rgba[1:2] + rgba[2:3]) / 3
