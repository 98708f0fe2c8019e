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

from ..evaluation.sky import radiance
from ..evaluation.textures import Image
from ..program.program import Program
from ..sampling import chosen, concentric_disc, dome_points, tabled
from ..scene import Light, Texture
from .same import Same

Array = np.ndarray

LEAST_ROWS, MOST_ROWS = 128, 512
"""Of a map: as many as the largest image has, which is reduced where it has more."""
BAND = 1 << 20
"""Texels that are reduced at once."""
UNIFORM = 0.1
"""Share of the directions that do not follow the radiance, so that none counts too much."""
IRRADIANCE_ROWS = 64
"""Of the table of irradiance by the normal: linear in between, it is off by 3e-4 of the largest."""
MOST_IRRADIANCE_ROWS = 64
"""Of the map that it is summed up from."""
PART = 0.5497004779019703
"""Of two kinds of directions, how far along a number of theirs goes: one over the cube of the
plastic number, beside the two of `dome_points`.
"""
MATT = np.sqrt(2) * np.pi
"""One over the density, a steradian, of directions as dense as their cosine: the root of the mean
square over them.
"""
ROUNDED = 1e-13
"""Of the largest sum by Fourier transforms: what is less may be what rounding left of 0."""
LARGEST = 1e30
"""Radiance saturates here, far below float32's largest."""


def directions(rows: int, columns: int) -> Array:
    """(3, rows columns) unit vectors to the middles of a map's cells, row after row."""
    elevation = np.pi * ((np.arange(rows) + 0.5) / rows - 0.5)
    azimuth = 2 * np.pi * (0.5 - (np.arange(columns) + 0.5) / columns)
    return _unit(elevation[:, None], azimuth).reshape(3, -1)


def radiance_map(program: Program, textures: Sequence[Texture]) -> Array:
    """The map of a world's light, as rays from matt surfaces see it."""
    used = {k: textures[k] for k in program.textures}
    rows = max((texture.pixels.shape[0] for texture in used.values()), default=0)
    rows = min(max(rows, LEAST_ROWS), MOST_ROWS)
    images = {k: Image(_reduced(texture, rows)) for k, texture in used.items()}
    blocks = [
        radiance(program, images, part, "scattered")
        for part in np.array_split(directions(rows, 2 * rows), rows // 64, axis=1)
    ]
    values = np.concatenate(blocks, 1).T.reshape(rows, 2 * rows, 3)
    return within_range(values)


def radiance_along(
    program: Program,
    textures: Sequence[Texture],
    unit: Array,
    kind: str = "scattered",
    seen: tuple | None = None,
) -> Array:
    """(3, n) of a world's light from unit directions (3, n), as rays from matt surfaces, or of
    another kind, see it. seen: as `evaluation.sky.Sky` has it.
    """
    return radiance(program, {k: Image(textures[k]) for k in program.textures}, unit, kind, seen)


def within_range(values: Array) -> Array:
    """Radiance as float32, of which lights may add up many."""
    return np.clip(values, -LARGEST, LARGEST).astype(np.float32)


def _reduced(texture: Texture, rows: int) -> Texture:
    """The texture with as many texels to a side averaged as leave it about `rows` rows."""
    by = texture.pixels.shape[0] // rows
    if by < 2:
        return texture
    high, wide = texture.pixels.shape[:2]
    across = min(by, wide)
    height, width = high // by * by, wide // across * across
    step = max(BAND // (by * wide), 1) * by
    bands = []
    for first in range(0, height, step):
        part = replace(texture, pixels=texture.pixels[first : min(first + step, height), :width])
        rgba = Image(part).texels()
        blocks = rgba.reshape(len(rgba) // by, by, width // across, across, 4)
        bands.append(blocks.mean((1, 3)).astype(np.float32))
    return replace(texture, pixels=np.concatenate(bands), encoding="LINEAR")


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
    points: (n, 2) of the unit disc, for directions drawn from highlights.  shadowed: (n,) bool,
    whether rays of surfaces there meet what casts shadows, else what diffuse rays see.
    cells: (h, w, 4) float32 the same four where a direction of the light's own axes meets the map:
    radiance over π, times the light's colour and strength, and one over the density.
    axes: (3, 3) of the light in the scene, as columns.
    irradiance: (r, c, 3) float32, over π, of a surface that nothing hides it from: by its normal in
    the light's axes, equirectangular with rows from pole to pole and columns from azimuth π down,
    at the corners of the cells, the first column once more at the end; (1, 1, 3) where it is the
    same for all.
    """

    along: Array
    light: Array
    points: Array
    shadowed: Array
    cells: Array
    axes: Array
    irradiance: Array

    def unhidden(self, normal: Array) -> Array:
        """(3, n) the irradiance over π of surfaces with normals (3, n)."""
        rows, columns = (max(size - 1, 0) for size in self.irradiance.shape[:2])
        around, upward = self._place(normal)
        x, y = around * columns, upward * rows
        left = np.clip(np.floor(x), 0, max(columns - 1, 0)).astype(np.intp)
        low = np.clip(np.floor(y), 0, max(rows - 1, 0)).astype(np.intp)
        right, high = np.minimum(left + 1, columns), np.minimum(low + 1, rows)
        values = self.irradiance.astype(np.float64)
        a, b = (x - left)[:, None], (y - low)[:, None]
        below = values[low, left] + a * (values[low, right] - values[low, left])
        above = values[high, left] + a * (values[high, right] - values[high, left])
        return (below + b * (above - below)).T

    def _place(self, direction: Array) -> tuple[Array, Array]:
        """Where directions (3, n) are from left to right and from below upward, 0 to 1."""
        x, y, z = self.axes.T @ direction
        around = 0.5 - np.arctan2(y, x) / (2 * np.pi)
        return around, 0.5 + np.arctan2(z, np.sqrt(x * x + y * y)) / np.pi

    def seen(self, direction: Array) -> tuple[Array, Array]:
        """Radiance over π (3, n) and one over the density (n,) in the directions (3, n)."""
        rows, columns = self.cells.shape[:2]
        around, upward = self._place(direction)
        column = np.clip(np.floor(around * columns), 0, columns - 1).astype(np.intp)
        row = np.clip(np.floor(upward * rows), 0, rows - 1).astype(np.intp)
        cell = self.cells[row, column].astype(np.float64)
        return cell[:, :3].T, cell[:, 3]


def dome_table(light: Light, samples: int, each: int) -> DomeTable:
    """What tracers know of a DOME light of which each of `samples` samples of a pixel takes `each`
    directions: those of as many whole samples as `MOST_TABLED` allows, after which they begin
    again.
    """
    assert light.radiance is not None
    count, radiance = tabled(samples, each), Same(light.radiance, light.radiance)
    cells, along, where = _drawn(radiance, count)
    even = _irradiance(radiance)
    with np.errstate(over="ignore"):
        color = np.clip(np.array(light.color, np.float64) * light.strength, -LARGEST, LARGEST)
        tinted = np.clip(cells * np.append(color / np.pi, 1.0), -LARGEST, LARGEST)
    tinted = tinted.astype(np.float32)
    spread = tinted[..., 3].astype(np.float64)[where]
    given = tinted[..., :3].astype(np.float64)[where] * spread[:, None]
    axes = np.array(light.world_from_light, np.float64)[:, :3]
    disc = concentric_disc(2 * dome_points(count) - 1)
    return DomeTable(
        along @ axes.T,
        np.column_stack([given, spread]),
        disc,
        _shadowed(radiance, spread),
        tinted,
        axes,
        np.clip(even * color, -LARGEST, LARGEST).astype(np.float32),
    )


def _shadowed(radiance: Same[Array], spread: Array) -> Array:
    """(n,) bool: those of directions, one over whose density is `spread`, that stand for a sample
    of the sky, and not for one of a matt lobe, as Cycles weighs these by the squares of their
    densities; a sky of one colour it samples by lobes alone.
    """
    values = np.asarray(radiance.value).reshape(-1, 3)
    if (values == values[0]).all():
        return np.zeros(len(spread), bool)
    number = (np.arange(1, len(spread) + 1) * PART) % 1.0
    return number * (1 + (spread / MATT) ** 2) < 1.0


@functools.lru_cache(maxsize=4)
def _irradiance(same: Same[Array]) -> Array:
    """`DomeTable.irradiance` of a light of colour and strength 1, float64."""
    values = np.asarray(same.value, np.float64)
    if values.shape[:2] == (1, 1):
        return values
    coarse = _averaged(values, MOST_IRRADIANCE_ROWS)
    rows, columns = coarse.shape[:2]
    given = np.moveaxis(4 * coarse * cell_shares(rows, columns), 1, 2)
    each = -(-2 * IRRADIANCE_ROWS // columns)
    around = each * columns
    # the cosine depends on how far azimuths are apart: sums over these are circular convolutions
    apart = np.cos(2 * np.pi * (np.arange(around) - each / 2) / around)
    normal = np.pi * (np.arange(IRRADIANCE_ROWS + 1) / IRRADIANCE_ROWS - 0.5)[:, None]
    towards = np.pi * ((np.arange(rows) + 0.5) / rows - 0.5)
    upright, flat = np.sin(normal) * np.sin(towards), np.cos(normal) * np.cos(towards)
    cosine = np.maximum(upright[..., None] + flat[..., None] * apart, 0)
    spectrum = np.tile(np.fft.fft(given), each)[..., : around // 2 + 1]
    sums = np.fft.irfft(np.einsum("nrf,rcf->ncf", np.fft.rfft(cosine), spectrum), around)
    sums = np.where(np.abs(sums) > ROUNDED * np.abs(sums).max(), sums, 0.0)
    return np.moveaxis(np.concatenate([sums, sums[..., :1]], 2), 1, 2)


def _averaged(values: Array, most: int) -> Array:
    """A map of at most so many rows, each cell the mean over the solid angle of those within."""
    by = max(values.shape[0] // most, 1)
    if by == 1:
        return values
    rows, columns = (size // by * by for size in values.shape[:2])
    share = cell_shares(*values.shape[:2])
    shape = (rows // by, by, columns // by, by, -1)
    weighted = (values * share)[:rows, :columns].reshape(shape).sum((1, 3))
    return weighted / (by * share[:rows].reshape(rows // by, by, 1).sum(1)[:, None])


def _unit(elevation: Array, azimuth: Array) -> Array:
    """(3, …) unit vectors."""
    up, around = np.broadcast_arrays(elevation, azimuth)
    return np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])


@functools.lru_cache(maxsize=4)
def _drawn(same: Same[Array], count: int) -> tuple[Array, Array, tuple[Array, Array]]:
    """Cells (h, w, 4), radiance and one over the density; `count` directions (count, 3) in the
    map's axes; rows and columns of the cells that these meet.
    """
    values = np.asarray(same.value, np.float64)
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
    row, inside = chosen(weight.sum(1), points[:, 1])
    column, beside = np.empty(len(points), np.intp), np.empty(len(points))
    for k in np.unique(row):
        here = row == k
        column[here], beside[here] = chosen(weight[k], points[here, 0])
    up = edges[row] + inside * np.diff(edges)[row]
    azimuth = 2 * np.pi * (0.5 - (column + beside) / columns)
    across = np.sqrt(np.maximum(0.0, 1 - up * up))
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), up], 1), (row, column)
