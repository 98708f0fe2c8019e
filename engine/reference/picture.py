"""The picture as it grows: parts of the colour per wave, sums over the samples, passes at the
end.
"""

from __future__ import annotations

import numpy as np

from ..film import PARTS, PASSES, empty_value

Array = np.ndarray

HEALTH = ("Error", "Samples", "Cost", "Fallbacks")
"""Passes that grow with every sample and belong to no part."""
DATA = tuple(name for name in PASSES if name != "Combined" and name not in (*PARTS, *HEALTH))
LARGEST = float(np.finfo(np.float32).max)


class Tile:
    """One sample of n pixels. parts: (3, n) per part that anything was added to.  lost: (n,) alpha.
    cost: (n,) rays. softly_lit, cut: (n,) bool, whether a light of more than one sample reached
    them, and whether their horizon cuts one. data: (channels, n) for the passes named.  wanted:
    (n,) bool, pixels whose data is still to come.
    """

    def __init__(self, count: int, data: frozenset[str]):
        self._count = count
        self.parts: dict[str, Array] = {}
        self.lost, self.cost = np.zeros(count), np.zeros(count)
        self.softly_lit, self.cut = np.zeros(count, bool), np.zeros(count, bool)
        self.data = {name: np.full((PASSES[name], count), empty_value(name)) for name in data}
        self.wanted = np.full(count, bool(data))

    def add(self, part: str, pixel: Array, values: Array) -> None:
        """values (3, m) to pixels (m,), in their order: a pixel's sum does not depend on its
        neighbours.
        """
        if part not in self.parts:
            self.parts[part] = np.zeros((3, self._count))
        for total, value in zip(self.parts[part], values, strict=True):
            total += np.bincount(pixel, value, self._count)

    def lose(self, pixel: Array, weight: Array) -> None:
        """Alpha that is lost with the weights (3, m)."""
        self.lost += np.bincount(pixel, (weight[0] + weight[1] + weight[2]) / 3, len(self.lost))

    def color(self) -> Array:
        """(3, n) the sum of the parts."""
        total = np.zeros((3, self._count))
        for name in PARTS:
            if name in self.parts:
                total += self.parts[name]
        return total

    def charge(self, pixel: Array) -> None:
        """Rays traced for pixels (m,)."""
        self.cost += np.bincount(pixel, minlength=self._count)

    def record(self, pixel: Array, **data: Array) -> None:
        """Data passes by name ("Object_Index" for "Object Index"), (channels, m) each."""
        self.wanted[pixel] = False
        for name in self.data.keys() - {"Gap"}:
            self.data[name][:, pixel] = data[name.replace(" ", "_")]


class Picture:
    """Sums over samples of the passes that are asked for, float64, (channels, pixels)."""

    def __init__(self, width: int, height: int, passes: frozenset[str]):
        self._shape, self._passes = (height, width), passes
        count = width * height
        self._parts = {name: np.zeros((3, count)) for name in PARTS if name in passes}
        self._color, self._lost = np.zeros((3, count)), np.zeros(count)
        self._data = {name: np.zeros((PASSES[name], count)) for name in DATA if name in passes}
        self.samples, self._cost = np.zeros(count), np.zeros(count)

    def keep(self, here: slice | Array, tile: Tile) -> None:
        """Adds a finished tile, of these pixels."""
        self._color[:, here] += tile.color()
        self._lost[here] += tile.lost
        self._cost[here] += tile.cost
        self.samples[here] += 1
        for name, total in self._parts.items():
            if name in tile.parts:
                total[:, here] += tile.parts[name]
        for name, values in tile.data.items():
            self._data[name][:, here] = values

    def color_and_loss(self) -> Array:
        """(4, pixels) mean so far of the colour and of the alpha lost."""
        return np.concatenate([self._color, self._lost[None]]) / np.maximum(self.samples, 1)

    def means(self) -> dict[str, Array]:
        """The passes so far, float64, (channels, pixels); pixels without a sample are black and
        transparent.
        """
        samples = np.maximum(self.samples, 1)
        alpha = np.where(self.samples > 0, 1 - self._lost / samples, 0.0)
        color = {"Combined": np.concatenate([self._color / samples, alpha[None]])}
        health = {
            "Samples": self.samples[None],
            "Cost": self._cost[None],
            "Fallbacks": np.zeros_like(self._cost[None]),
        }
        chosen = {name: values for name, values in health.items() if name in self._passes}
        return (
            color
            | {name: total / samples for name, total in self._parts.items()}
            | self._data
            | chosen
        )

    def images(self, passes: dict[str, Array], shown: tuple[slice, slice]) -> dict[str, Array]:
        """Passes (c, pixels) as float32 images of the rows and columns that are shown."""
        return {name: self._image(values, shown) for name, values in passes.items()}

    def _image(self, values: Array, shown: tuple[slice, slice]) -> Array:
        """(c, pixels) -> (h, w, c) float32, saturated."""
        image = np.clip(values, -LARGEST, LARGEST).astype(np.float32)
        return np.ascontiguousarray(image.T.reshape(*self._shape, len(values))[shown])
