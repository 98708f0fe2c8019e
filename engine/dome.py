"""Light from all around: the radiance of a world's program over the directions, and the directions
from which a DOME light shines, chosen by importance (Pharr, Jakob, Humphreys, Physically Based
Rendering, section 12.5; Veach 1997).

A map is (h, w, 3) float32 radiance, equirectangular: column i spans the azimuths from
2π(1/2 - i/w) down to 2π(1/2 - (i + 1)/w), counted from +x towards +y, row 0 ends at -z. This is how
Blender lays out environment images, bottom row first.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .program.program import Program
from .sampling import concentric_disc, dome_points
from .scene import Light, Texture

Array = np.ndarray

MOST_ROWS = 512
"""Of a map: images of more are reduced."""
LEAST_ROWS = 128
"""Of a map of a program without images."""
UNIFORM = 0.1
"""Share of the directions that do not follow the radiance, so that none counts too much."""
LARGEST = 1e30
"""Radiance saturates here, far below float32's largest."""


def directions(rows: int) -> Array:
    """(3, 2 rows²) unit vectors to the middles of a map's cells, row after row."""
    elevation = np.pi * ((np.arange(rows) + 0.5) / rows - 0.5)
    azimuth = 2 * np.pi * (0.5 - (np.arange(2 * rows) + 0.5) / (2 * rows))
    across = np.cos(elevation)[:, None]
    cells = np.broadcast_arrays(
        across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)[:, None]
    )
    return np.stack(cells).reshape(3, -1)


def radiance_map(program: Program, textures: Sequence[Texture]) -> Array:
    """The map of a world's light, as rays that bounce see it."""
    from .reference.sky import radiance
    from .reference.textures import Image

    used = {k: textures[k] for k in program.textures}
    rows = max((texture.pixels.shape[0] for texture in used.values()), default=0)
    rows = min(rows, MOST_ROWS) or LEAST_ROWS
    images = {k: Image(_reduced(texture, rows)) for k, texture in used.items()}
    blocks = [
        radiance(program, images, part, "mirror")
        for part in np.array_split(directions(rows), max(rows // 64, 1), axis=1)
    ]
    values = np.concatenate(blocks, 1).T.reshape(rows, 2 * rows, 3)
    return np.clip(values, -LARGEST, LARGEST).astype(np.float32)


def _reduced(texture: Texture, rows: int) -> Texture:
    """The texture with as many texels to a side averaged as leave it about `rows` rows."""
    from .reference.textures import Image

    by = texture.pixels.shape[0] // rows
    if by < 2:
        return texture
    rgba = Image(texture).texels()
    height, width = (size // by * by for size in rgba.shape[:2])
    blocks = rgba[:height, :width].reshape(height // by, by, width // by, by, 4)
    return replace(texture, pixels=blocks.mean((1, 3)).astype(np.float32), encoding="LINEAR")


def cell_shares(rows: int, columns: int) -> Array:
    """(rows, 1, 1) the share of all directions that a cell fills; their sum over a map is 1."""
    edges = np.sin(np.pi * (np.arange(rows + 1) / rows - 0.5))
    return np.diff(edges)[:, None, None] / (2 * columns)


@dataclass(frozen=True, eq=False)
class DomeTable:
    """What tracers know of a DOME light.

    along: (n, 3) the first n directions towards it, unit, in the scene's axes. light: (n, 4) of
    each its intensity, radiance over π and over the density of directions, and one over that
    density, steradians: where m directions are taken each stands for a share 1/m.
    points: (n, 2) of the unit disc, for directions drawn from highlights.
    cells: (h, w, 4) float32 the same four where a direction of the light's own axes meets the map:
    radiance over π, times the light's colour and strength, and one over the density.
    axes: (3, 3) of the light in the scene, as columns.
    """

    along: Array
    light: Array
    points: Array
    cells: Array
    axes: Array

    def seen(self, direction: Array) -> tuple[Array, Array]:
        """Radiance over π (3, n) and one over the density (n,) in the directions (3, n)."""
        rows, columns = self.cells.shape[:2]
        x, y, z = self.axes.T @ direction
        around = 0.5 - np.arctan2(y, x) / (2 * np.pi)
        upward = 0.5 + np.arctan2(z, np.sqrt(x * x + y * y)) / np.pi
        column = np.clip(np.floor(around * columns), 0, columns - 1).astype(np.intp)
        row = np.clip(np.floor(upward * rows), 0, rows - 1).astype(np.intp)
        cell = self.cells[row, column].astype(np.float64)
        return cell[:, :3].T, cell[:, 3]


def dome_table(light: Light, count: int) -> DomeTable:
    """What tracers know of a DOME light of which they take `count` directions."""
    cells, along, where = _drawn(_Same(light.radiance), count)
    with np.errstate(over="ignore"):
        color = np.clip(np.array(light.color, np.float64) * light.strength, -LARGEST, LARGEST)
        tinted = np.clip(cells * np.append(color / np.pi, 1.0), -LARGEST, LARGEST)
    tinted = tinted.astype(np.float32)
    spread = tinted[..., 3].astype(np.float64)[where]
    given = tinted[..., :3].astype(np.float64)[where] * spread[:, None]
    axes = np.array(light.world_from_light, np.float64)[:, :3]
    disc = concentric_disc(2 * dome_points(count) - 1)
    return DomeTable(along @ axes.T, np.column_stack([given, spread]), disc, tinted, axes)


class _Same:
    """An array as a key: equal to itself alone, and kept as long as the key is."""

    def __init__(self, values: Array) -> None:
        self.values = values

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.values is self.values

    def __hash__(self) -> int:
        return id(self.values)


@functools.lru_cache(maxsize=4)
def _drawn(same: _Same, count: int) -> tuple[Array, Array, tuple[Array, Array]]:
    """Cells (h, w, 4), radiance and one over the density; `count` directions (count, 3) in the
    map's axes; rows and columns of the cells that these meet.
    """
    values = np.asarray(same.values, np.float64)
    rows, columns = values.shape[:2]
    share = np.broadcast_to(cell_shares(rows, columns)[..., 0], (rows, columns))
    weight = np.abs(values).mean(2) * share
    total = weight.sum()
    weight = (1 - UNIFORM) * weight / total + UNIFORM * share if total > 0 else share
    along, where = _draw(weight, dome_points(count))
    spread = 4 * np.pi * share / weight
    return np.concatenate([values, spread[..., None]], 2), along, where


def _draw(weight: Array, points: Array) -> tuple[Array, tuple[Array, Array]]:
    """Directions (n, 3) at the points (n, 2) of the unit square, in cells chosen by their weights
    (h, w), and even within a cell.
    """
    rows, columns = weight.shape
    edges = np.sin(np.pi * (np.arange(rows + 1) / rows - 0.5))
    row, inside = _inverse(weight.sum(1), points[:, 1])
    column, beside = np.empty(len(points), np.intp), np.empty(len(points))
    for k in np.unique(row):
        here = row == k
        column[here], beside[here] = _inverse(weight[k], points[here, 0])
    up = edges[row] + inside * np.diff(edges)[row]
    azimuth = 2 * np.pi * (0.5 - (column + beside) / columns)
    across = np.sqrt(np.maximum(0.0, 1 - up * up))
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), up], 1), (row, column)


def _inverse(weights: Array, u: Array) -> tuple[Array, Array]:
    """Which of the weights (m,), laid end to end, the shares u (n,) of their sum fall into, and
    where in them, from 0 to 1.
    """
    ends = np.concatenate([[0.0], np.cumsum(weights)])
    at = u * ends[-1]
    index = np.clip(np.searchsorted(ends, at, "right") - 1, 0, len(weights) - 1)
    inside = (at - ends[index]) / np.where(weights[index] > 0, weights[index], 1.0)
    return index, np.clip(inside, 0.0, 1.0)
