"""The picture as it grows: parts of the colour per wave, sums over the samples, passes at the end."""

from __future__ import annotations

import numpy as np

from ..film import NO_DEPTH, PARTS, PASSES, Film

Array = np.ndarray

DATA = tuple(name for name in PASSES if name != "Combined" and name not in PARTS)
LARGEST = float(np.finfo(np.float32).max)


class Tile:
    """One sample of n pixels. parts: (3, n) per part that anything was added to.  lost: (n,) alpha.
    data: (channels, n) for the passes named.  wanted: (n,) bool, pixels whose data is still to come."""

    def __init__(self, count: int, data: frozenset[str]):
        self._count = count
        self.parts: dict[str, Array] = {}
        self.lost = np.zeros(count)
        self.data = {name: np.full((PASSES[name], count), NO_DEPTH if name == "Depth" else 0.0) for name in data}
        self.wanted = np.full(count, bool(data))

    def add(self, part: str, pixel: Array, values: Array) -> None:
        """values (3, m) to pixels (m,), in their order: a pixel's sum does not depend on its neighbours."""
        if part not in self.parts:
            self.parts[part] = np.zeros((3, self._count))
        for total, value in zip(self.parts[part], values, strict=True):
            total += np.bincount(pixel, value, self._count)

    def lose(self, pixel: Array, weight: Array) -> None:
        """Alpha that is lost with the weights (3, m)."""
        self.lost += np.bincount(pixel, (weight[0] + weight[1] + weight[2]) / 3, len(self.lost))

    def record(self, pixel: Array, **data: Array) -> None:
        """Data passes by name ("Object_Index" for "Object Index"), (channels, m) each."""
        self.wanted[pixel] = False
        for name, values in self.data.items():
            values[:, pixel] = data[name.replace(" ", "_")]


class Picture:
    """Sums over samples of the passes that are asked for, float64, (channels, pixels)."""

    def __init__(self, width: int, height: int, passes: frozenset[str]):
        self._shape = (height, width)
        count = width * height
        self._parts = {name: np.zeros((3, count)) for name in PARTS if name in passes}
        self._color, self._lost = np.zeros((3, count)), np.zeros(count)
        self._data = {name: np.zeros((PASSES[name], count)) for name in DATA if name in passes}
        self._samples = np.zeros(count)

    def keep(self, first: int, tile: Tile) -> None:
        """Adds a finished tile of consecutive pixels."""
        here = slice(first, first + len(tile.lost))
        for name in PARTS:
            if name in tile.parts:
                self._color[:, here] += tile.parts[name]
        self._lost[here] += tile.lost
        self._samples[here] += 1
        for name, total in self._parts.items():
            if name in tile.parts:
                total[:, here] += tile.parts[name]
        for name, values in tile.data.items():
            self._data[name][:, here] = values

    def means(self) -> dict[str, Array]:
        """The passes so far, float64, (channels, pixels); pixels without a sample are black and transparent."""
        samples = np.maximum(self._samples, 1)
        alpha = np.where(self._samples > 0, 1 - self._lost / samples, 0.0)
        color = {"Combined": np.concatenate([self._color / samples, alpha[None]])}
        return color | {name: total / samples for name, total in self._parts.items()} | self._data

    def film(self, complete: bool, stats: dict[str, float], notes: tuple[str, ...]) -> Film:
        """The picture so far as float32 images."""
        shaped = {name: self._image(values) for name, values in self.means().items()}
        return Film(shaped, int(self._samples.min()), complete, dict(stats), notes)

    def _image(self, values: Array) -> Array:
        """(c, pixels) -> (h, w, c) float32, saturated."""
        image = np.clip(values, -LARGEST, LARGEST).astype(np.float32)
        return np.ascontiguousarray(image.T).reshape(*self._shape, len(values))
