"""How much of what is round a strand other strands hide: so much of the light that left one strand
meets others.

A mass of hair is a grid of cells, each with the area that its strands have across a ray; optical
depths add up from cell to cell in 26 directions.
"""

from __future__ import annotations

import itertools

import numpy as np

from ....engine.scene import Strands

CELLS = 48
"""Cells along the longest side, at most."""
RADII = 8.0
"""Of a strand a cell is wide, at least: strands do not enclose themselves."""
_PIECES = 8
"""Of a segment, which may be longer than a cell."""
_DIRECTIONS = [d for d in itertools.product((-1, 0, 1), repeat=3) if any(d)]


BACK, BROAD = 3.0, 1.25
"""Powers of the enclosure E that light between strands is times: what comes back, and what leaves
them behind. Fitted with what these are times (docs/decisions/0047-hair-lobes.md).
"""


def light_between(strands: Strands) -> np.ndarray:
    """(v, 4): E to those powers, E and 1."""
    found = enclosure(strands)
    return np.column_stack([found**BACK, found**BROAD, found, np.ones(len(found))])


def enclosure(strands: Strands) -> np.ndarray:
    """(v,) float64 from 0, nothing is near, to 1: of light that leaves a vertex evenly in all
    directions what meets other strands of these. Vertices that are not finite have 0.
    """
    x, r = strands.vertices.astype(np.float64), strands.radii.astype(np.float64)
    sound = (np.abs(x) < 1e15).all(1) & (np.abs(r) < 1e15)
    first = strands.starts.astype(np.intp)
    first = first[sound[first] & sound[first + 1]]
    a, along = x[first], x[first + 1] - x[first]
    length = np.sqrt((along**2).sum(1))
    area = (r[first] + r[first + 1]) * length
    if not area.sum() > 0:
        return np.zeros(len(x))
    low = np.minimum(a, a + along).min(0)
    size = np.maximum(a, a + along).max(0) - low
    radius = area.sum() / (2 * length.sum())
    cell = max(size.max() / CELLS, RADII * radius)
    shape = tuple(np.ceil(size / cell).astype(np.intp) + 2)
    grid = _Grid(low - cell / 2, cell, shape)
    crossed = grid.crossed_area(a, along, length, area)
    shown = np.zeros(shape)
    total = 0.0
    for d in _DIRECTIONS:
        step = float(np.sqrt(np.dot(d, d)))
        depth = _depths(grid.density(crossed, d) * (step * cell), d)
        shown += np.exp(-np.maximum(depth - radius / cell, 0.0)) / step
        total += 1 / step
    found = np.zeros(len(x))
    found[sound] = 1 - grid.read(shown / total, x[sound])
    return np.clip(found, 0.0, 1.0)


class _Grid:
    """Cells of one size; those at the rim have nothing in them."""

    def __init__(self, origin: np.ndarray, cell: float, shape: tuple[int, ...]) -> None:
        self._origin, self._cell, self._shape = origin, cell, shape

    def crossed_area(
        self, a: np.ndarray, along: np.ndarray, length: np.ndarray, area: np.ndarray
    ) -> np.ndarray:
        """(7, cells) area of strands over a cell's volume, and the same times t t^T."""
        pieces = min(int(np.ceil(length.max() / self._cell)), _PIECES)
        t = along / np.where(length > 0, length, 1.0)[:, None]
        rows = [area, *(area * t[:, i] * t[:, j] for i in range(3) for j in range(i, 3))]
        total = np.zeros((7, int(np.prod(self._shape))))
        for piece in range(pieces):
            place = self._place(a + ((piece + 0.5) / pieces) * along) + 0.5
            cells = np.ravel_multi_index(tuple(place.astype(np.intp).T), self._shape)
            for row, weights in zip(total, rows, strict=True):
                row += np.bincount(cells, weights, len(row))
        return (total / (pieces * self._cell**3)).reshape(7, *self._shape)

    def density(self, crossed: np.ndarray, d: tuple[int, ...]) -> np.ndarray:
        """Of a ray along d, over a length: the root of the mean square of the sines stands for
        their mean.
        """
        unit = np.array(d) / np.sqrt(np.dot(d, d))
        pairs = [(i, j) for i in range(3) for j in range(i, 3)]
        along = sum(
            (1 if i == j else 2) * unit[i] * unit[j] * crossed[1 + k]
            for k, (i, j) in enumerate(pairs)
        )
        return np.sqrt(np.maximum(crossed[0] * (crossed[0] - along), 0.0))

    def read(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(n,) of the cells' values at (n, 3) places, straight between the cells' middles."""
        place = np.clip(self._place(x), 0, np.array(self._shape) - 1.001)
        base = place.astype(np.intp)
        share = place - base
        found = np.zeros(len(x))
        for corner in itertools.product((0, 1), repeat=3):
            weight = np.where(corner, share, 1 - share).prod(1)
            found += weight * values[tuple((base + corner).T)]
        return found

    def _place(self, x: np.ndarray) -> np.ndarray:
        """Places in cells, whole at their middles."""
        return (x - self._origin) / self._cell


def _depths(crossed: np.ndarray, d: tuple[int, ...]) -> np.ndarray:
    """Depth from each cell's middle on along d, through cells of these depths."""
    axis = next(k for k, step in enumerate(d) if step)
    values = np.moveaxis(crossed, axis, 0)
    aside = tuple(step for k, step in enumerate(d) if k != axis)
    total = np.zeros_like(values)
    order = range(len(values) - 1, -1, -1) if d[axis] > 0 else range(len(values))
    before = None
    for k in order:
        total[k] = values[k] / 2
        if before is not None:
            total[k] += _moved(total[before] + values[before] / 2, aside)
        before = k
    return np.moveaxis(total, 0, axis)


def _moved(values: np.ndarray, aside: tuple[int, ...]) -> np.ndarray:
    """Each place has what lies that far on; 0 beyond the border."""
    found = np.zeros_like(values)
    here, there = zip(*(_SHIFTED[step] for step in aside), strict=True)
    found[here] = values[there]
    return found


_SHIFTED = {
    -1: (slice(1, None), slice(0, -1)),
    0: (slice(None), slice(None)),
    1: (slice(0, -1), slice(1, None)),
}
"""Where values go, and where they come from."""
