"""Openings through which rooms see the sky, found by rays: rectangles on which the light of a DOME
light may be sampled (portals; Bitterli, Wyman, Pharr 2015, Portal-masked environment map sampling).

Where the sky is seen through a window, directions that all pixels share each throw the window's
outline onto the walls. Points of the window, which all pixels share, do not.

Letters: o origins of rays, d directions, n normals, c centre of a rectangle, u v its half sides.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..accelerator import Accelerator, Hits
from ..sampling import chosen, concentric_disc, dome_points, tabled
from ..scene import Instances, Light, Material, Mesh, Openings, Scene
from .enclosures import joined
from .same import Same

Array = np.ndarray

PROBES, PLACES, TRIANGLES = 1024, 256, 1 << 12
"""Points on surfaces at which sky is looked for, on so many placements at most, of each on so many
triangles that lie evenly among all.
"""
FIRST, THEN = 32, 256
"""Rays from each side of a point, and from those that see some sky."""
MOST_ENCLOSED = 256
"""Sides of points that send the second ones."""
LARGEST_SHARE = 0.4
"""Of the cosine-weighted directions those see the sky in that are in a room."""
LINES = 1024
"""Of the rays that reach the sky, which planes are chosen by."""
STEPS, CELLS = 48, 64
"""Planes across rooms for each of their main directions; cells of a plane as wide as the rooms."""
NORMALS, ALIKE = 5, 0.9986
"""Main directions, and the cosine within which they are the same."""
MOST = 12
"""Openings."""
FEWEST = 0.02
"""Share of the lines that an opening takes at least."""
DENSEST = 0.25
"""Of the lines over the area of the plane's best opening its others have at least."""
WIDEST, FAR = 1.5, 0.4
"""Solid angle, steradian, in which at least this share of its lines see what counts as an opening:
most may begin in the reveals of a window in a thick wall.
"""
ENOUGH = 0.5
"""Share of the lines that openings must take, else the sky is seen everywhere."""
MOST_PASSED = 4
"""See-through surfaces in a row that rays pass."""
SNAPPED = 32
"""Rectangles grow to steps of about so many to their sides: what moves in a room seldom changes
them.
"""


@dataclass(frozen=True, eq=False)
class _Lines:
    """m rays that reach the sky. o, d: (3, m), d unit."""

    o: Array
    d: Array

    def __len__(self) -> int:
        return self.o.shape[1]

    def take(self, index: Array) -> _Lines:
        return _Lines(self.o[:, index], self.d[:, index])


def openings(scene: Scene) -> Openings | None:
    """Where the surfaces of a scene leave rooms open to the sky; None where they do nowhere, or
    everywhere. They do not depend on lights or the camera.
    """
    if not scene.instances:
        return None
    return _found(Same(scene, *scene.geometries, *scene.instances, *scene.materials))


def opened(light: Light, scene: Scene) -> Light:
    """A DOME light with the openings of a scene unless it has some; the same object for the same of
    both.
    """
    found = openings(scene) if light.openings is None else None
    return light if found is None else _opened(light, found)


@functools.lru_cache(maxsize=4)
def _opened(light: Light, found: Openings) -> Light:
    return replace(light, openings=found)


def opening_table(found: Openings, samples: int, each: int) -> tuple[Array, Array]:
    """Points on openings of which each of `samples` samples of a pixel takes `each`: on which
    opening each is, (n,) int, and where, (n, 2), from -1 to 1 along its half sides.
    """
    a, b = dome_points(tabled(samples, each)).T
    number, inside = chosen(found.shares, a)
    # well within: queries have to find each point in its rectangle
    return number, (1 - 1e-9) * (2 * np.stack([inside, b], 1) - 1)


def points_on(found: Openings, number: Array, place: Array) -> Array:
    """(n, 3) the world's points at rows of an `opening_table`."""
    a, b = place.T[:, :, None]
    return found.centers[number] + a * found.right[number] + b * found.up[number]


def density(found: Openings, x: Array, d: Array) -> Array:
    """(m,) how densely, a steradian, points on openings lie in the unit directions d (3, m) from
    the points x (3, m), both in the world.
    """
    total = np.zeros(d.shape[1])
    rows = zip(found.centers, found.right, found.up, found.normals, found.shares, strict=True)
    for center, right, up, normal, share in rows:
        z, to = normal @ d, center[:, None] - x
        some = z > 0
        t = np.where(some, normal @ to, 0.0) / np.where(some, z, 1.0)
        off = t * d - to
        r2, u2 = right @ right, up @ up
        here = some & (t > 0) & (np.abs(right @ off) <= r2) & (np.abs(up @ off) <= u2)
        area = 4 * np.sqrt(r2 * u2)
        total += np.where(here, share * t * t / (area * np.where(some, z, 1.0)), 0.0)
    return total


@functools.lru_cache(maxsize=2)
def _found(same: Same) -> Openings | None:
    scene = same.scene
    point, normal = _probes(scene)
    if not len(point):
        return None
    few = replace(scene, instances=joined(scene.instances))
    with Accelerator(few.geometries, few.instances) as surfaces:
        if not np.isfinite(surfaces.bounds).all():
            return None
        origin = surfaces.bounds.mean(0)
        sky = _Sky(few, surfaces, origin)
        lines, enclosed = _lines(sky, (point - origin).T, normal.T)
    if lines is None or enclosed is None:
        return None
    rows = _rectangles(lines, enclosed)
    if not rows:
        return None
    c, u, v, n, share = (np.array(column) for column in zip(*rows, strict=True))
    return Openings(c + origin, u, v, n, share / share.sum())


def _probes(scene: Scene) -> tuple[Array, Array]:
    """Points and unit normals (m, 3) on the meshes, even by area on each of some placements."""
    ends = np.cumsum([len(block.world_from_object) for block in scene.instances])
    numbers = np.unique(np.linspace(0, ends[-1] - 1, min(int(ends[-1]), PLACES)).astype(np.intp))
    each = max(PROBES // len(numbers), 1)
    points, normals = [], []
    for number, b in zip(numbers, np.searchsorted(ends, numbers, "right"), strict=True):
        block = scene.instances[b]
        mesh = scene.geometries[block.geometry]
        if isinstance(mesh, Mesh) and len(mesh.triangles) and block.visible_shadow:
            matrix = np.asarray(block.world_from_object[number - ends[b]], np.float64)
            x, n = _on(mesh, matrix, each, int(number))
            points.append(x)
            normals.append(n)
    if not points:
        return np.zeros((0, 3)), np.zeros((0, 3))
    return np.concatenate(points), np.concatenate(normals)


def _on(mesh: Mesh, matrix: Array, count: int, seed: int) -> tuple[Array, Array]:
    """Points and unit normals (m, 3), m <= count, of a mesh placed by a (3, 4) matrix."""
    step = -(-len(mesh.triangles) // TRIANGLES)
    corners = mesh.vertices[mesh.triangles[::step]].astype(np.float64)
    corners = corners @ matrix[:, :3].T + matrix[:, 3]
    with np.errstate(over="ignore", invalid="ignore"):
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.sqrt((across * across).sum(1))
    area = np.where(np.isfinite(area), area, 0.0)
    total = np.cumsum(area)
    if not total[-1] > 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    u = (np.arange(count) + (seed * 0.6180339887498949) % 1) / count
    k = np.minimum(np.searchsorted(total, u * total[-1], "right"), len(total) - 1)
    k = k[area[k] > 0]
    a, b = (dome_points(count)[: len(k)]).T
    root = np.sqrt(a)
    weights = np.stack([1 - root, root * (1 - b), root * b], 1)
    return (weights[:, :, None] * corners[k]).sum(1), across[k] / area[k][:, None]


class _Sky:
    """Which rays reach it. Points count from an origin."""

    def __init__(self, scene: Scene, surfaces: Accelerator, origin: Array) -> None:
        self._surfaces, self._origin, self._scene = surfaces, origin, scene
        self._ends = np.cumsum([len(block.world_from_object) for block in scene.instances])
        self._clear = np.array([_lets_light_through(material) for material in scene.materials])
        self._blocks = scene.instances

    def reached(self, o: Array, d: Array) -> Array:
        """(m,) bool of rays from o in the directions d (3, m); what lets light through is passed as
        if it were not there.
        """
        start, t_min = (o + self._origin[:, None]).T, np.zeros(o.shape[1])
        result, left = np.zeros(len(start), bool), np.arange(len(start))
        for _ in range(MOST_PASSED + 1):
            hits = self._surfaces.closest(start[left], d.T[left], t_min[left], visibility="shadow")
            result[left[hits.instance < 0]] = True
            passed = self._passed(hits)
            t_min[left[passed]] = hits.t[passed] * (1 + 1e-6)
            left = left[passed]
            if not len(left):
                break
        return result

    def _passed(self, hits: Hits) -> Array:
        """Which of them met what lets light through."""
        met = np.flatnonzero(hits.instance >= 0)
        if not self._clear.any():
            return met[:0]
        number = np.searchsorted(self._ends, hits.instance[met], "right")
        through = np.zeros(len(met), bool)
        for b in np.unique(number):
            here = number == b
            through[here] = self._through(self._blocks[b], hits.primitive[met[here]])
        return met[through]

    def _through(self, block: Instances, primitive: Array) -> Array | bool:
        if not block.materials:
            return False
        materials = np.asarray(block.materials)
        slots = self._scene.geometries[block.geometry].material_slots
        slot = 0 if slots is None else np.minimum(slots[primitive], len(materials) - 1)
        return self._clear[materials[slot]]


def _lets_light_through(material: Material) -> bool:
    return any(lobe.kind == "TRANSPARENT" for lobe in material.lobes)


def _lines(sky: _Sky, point: Array, normal: Array) -> tuple[_Lines | None, _Lines | None]:
    """Rays that reach the sky from points (3, m) that see little of it; these and their normals."""
    x, n = np.concatenate([point, point], 1), np.concatenate([normal, -normal], 1)
    o, d = _around(x, n, FIRST)
    share = sky.reached(o, d).reshape(FIRST, -1).mean(0)
    some = np.flatnonzero((share > 0) & (share <= LARGEST_SHARE))
    if not len(some):
        return None, None
    some = some[np.unique(np.linspace(0, len(some) - 1, min(len(some), MOST_ENCLOSED)).astype(int))]
    x, n = x[:, some], n[:, some]
    o, d = _around(x, n, THEN)
    reached = sky.reached(o, d).reshape(THEN, -1)
    enclosed = reached.mean(0) <= LARGEST_SHARE
    index = np.flatnonzero((reached & enclosed).ravel())
    if not len(index):
        return None, None
    return _Lines(o, d).take(index), _Lines(x[:, enclosed], n[:, enclosed])


def _around(x: Array, n: Array, count: int) -> tuple[Array, Array]:
    """Origins and directions (3, count m), as densely as the cosine to the normals n (3, m), of
    the same shares of the hemisphere, turned for each point.
    """
    from ..reference.vectors import basis_around

    a, b = concentric_disc(2 * dome_points(count) - 1).T
    turn = 2 * np.pi * ((np.arange(x.shape[1]) * 0.6180339887498949) % 1)
    first, second = basis_around(n)
    along = np.cos(turn) * first + np.sin(turn) * second
    aside = np.cos(turn) * second - np.sin(turn) * first
    up = np.sqrt(np.maximum(0.0, 1 - a * a - b * b))
    d = (
        a[:, None] * along[:, None] + b[:, None] * aside[:, None] + up[:, None] * n[:, None]
    ).reshape(3, -1)
    o = x + 16 * 2.0**-24 * np.abs(x).max() * n
    return np.tile(o, count), d


def _rectangles(lines: _Lines, enclosed: _Lines) -> list[tuple[Array, Array, Array, Array, float]]:
    """c, u, v, the normal to the side of the sky, and the share of the lines, of each opening."""
    frames, size = _frames(enclosed.d), _cell(enclosed.o)
    left = np.arange(len(lines))
    rows: list[tuple[Array, Array, Array, Array, float]] = []
    while len(rows) < MOST and len(left) > FEWEST * len(lines):
        best = max(
            (
                found
                for frame in frames
                for found in _on_planes(lines.take(left), frame, enclosed.o)
            ),
            key=lambda found: found[0],
            default=None,
        )
        if best is None:
            break
        taken = np.zeros(len(left), bool)
        parts = [
            (row, through)
            for row, through in _parts(lines.take(left), size, FEWEST * len(lines), *best[1:])
        ]
        dense = [through.sum() / _area(row) for row, through in parts]
        for (row, through), each in zip(parts, dense, strict=True):
            # what leaves by another opening crosses the plane in few lines here and there
            if each >= DENSEST * max(dense):
                rows.append((*row, float(through.sum())))
                taken |= through
        if not taken.any():
            break
        left = left[~taken]
    if len(left) > (1 - ENOUGH) * len(lines):
        return []
    return rows


def _area(row: tuple[Array, Array, Array, Array]) -> float:
    _, u, v, _ = row
    return float(max(np.sqrt((u @ u) * (v @ v)), 1e-300))


def _frames(normals: Array) -> list[Array]:
    """(3, 3) orthonormal rows u, v, n for the directions n that most of the normals (3, m) have."""
    found: list[Array] = []
    alike = np.abs(normals.T @ normals) > ALIKE
    free = np.ones(normals.shape[1], bool)
    while free.any() and len(found) < NORMALS:
        best = int(np.argmax(np.where(free, alike[:, free].sum(1), -1)))
        found.append(normals[:, best])
        free &= ~alike[best]
    for axis in np.eye(3):
        if len(found) < 3:
            found.append(axis)
    frames = []
    for n in found:
        beside = min(found, key=lambda other: abs(float(n @ other)))
        u = beside - (n @ beside) * n
        u /= np.sqrt(u @ u)
        frames.append(np.stack([u, np.cross(n, u), n]))
    return frames


def _on_planes(
    lines: _Lines, frame: Array, points: Array
) -> Iterator[tuple[float, Array, float, float]]:
    """How well planes across n separate the lines, those towards n and those against it: the square
    of how many pass over the area on which they do. The frame, the plane's place and the side.
    """
    few = lines.take(np.linspace(0, len(lines) - 1, min(len(lines), LINES)).astype(int))
    o, d = frame @ few.o, frame @ few.d
    heights = frame[2] @ points
    low, high = heights.min(), heights.max()
    margin, size = 0.02 * (high - low), _cell(points)
    if not size > 0:
        return  # all in one place, as where a single point is enclosed
    for at in np.linspace(low - margin, high + margin, STEPS):
        for side in (1.0, -1.0):
            uv = _meeting(o, d, at, side)[0]
            if len(uv.T) < FEWEST * len(few):
                continue
            cells = np.floor(np.clip(uv / size, -1e6, 1e6)).astype(np.int64)
            occupied = len(np.unique(cells[0] * (1 << 22) + cells[1]))
            yield len(uv.T) ** 2 / occupied, frame, float(at), side


def _cell(points: Array) -> float:
    return float((points.max(1) - points.min(1)).max() / CELLS)


def _meeting(o: Array, d: Array, at: float, side: float) -> tuple[Array, Array]:
    """(2, k) where the lines that go to that side meet a plane, and which these are, (k,)."""
    towards = side * d[2] > 0.05
    t = np.where(towards, at - o[2], -1.0) / np.where(towards, d[2], 1.0)
    index = np.flatnonzero(towards & (t > 0))
    return o[:2, index] + t[index] * d[:2, index], index


def _parts(
    lines: _Lines, size: float, fewest: float, frame: Array, at: float, side: float
) -> Iterator[tuple[tuple[Array, Array, Array, Array], Array]]:
    """The rectangles of a plane that so many lines or more pass, apart by more than two cells of
    this size, and which do, (m,) bool.
    """
    o, d = frame @ lines.o, frame @ lines.d
    uv, index = _meeting(o, d, at, side)
    for part in _apart(uv, np.arange(len(index)), 2 * size, fewest):
        low, high = uv[:, part].min(1), uv[:, part].max(1)
        step = 2.0 ** np.ceil(np.log2(np.maximum((high - low).max(), 1e-300) / SNAPPED))
        low, high = np.floor(low / step) * step, np.ceil(high / step) * step
        half, middle = (high - low) / 2, (high + low) / 2
        to = np.vstack([uv[:, part], np.full(len(part), at)]) - o[:, index[part]]
        square = (to * to).sum(0)
        solid = 4 * half.prod() * np.abs(to[2]) / np.sqrt(square) / square
        if np.quantile(solid, FAR) > WIDEST:
            continue
        through = np.zeros(len(lines), bool)
        through[index[part]] = True
        c = frame.T @ np.append(middle, at)
        yield (c, half[0] * frame[0], half[1] * frame[1], side * frame[2]), through


def _apart(uv: Array, part: Array, gap: float, fewest: float) -> Iterator[Array]:
    """Groups of so many points or more between which there is no gap along either axis."""
    if len(part) < fewest:
        return
    for axis in (0, 1):
        order = part[np.argsort(uv[axis, part], kind="stable")]
        cuts = np.flatnonzero(np.diff(uv[axis, order]) > gap) + 1
        if len(cuts):
            for some in np.split(order, cuts):
                yield from _apart(uv, some, gap, fewest)
            return
    yield part
