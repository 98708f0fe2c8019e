"""Openings through which rooms see the sky, found by rays: rectangles on which the light of a DOME
light may be sampled (portals; Bitterli, Wyman, Pharr 2015, Portal-masked environment map sampling).

Where the sky is seen through a window, directions that all pixels share each throw the window's
outline onto the walls. Points of the window, which all pixels share, do not.

Letters: o origins of rays, d directions, x points, n normals, c centre of a rectangle, u v its half
sides.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..accelerator import Accelerator
from ..sampling import chosen, dome_points, tabled
from ..scene import Instances, Light, Mesh, Openings, Scene
from .same import Same

Array = np.ndarray
Row = tuple[Array, Array, Array, Array]
"""c, u, v, and the normal to the side of the sky."""

PROBES, PLACES, TRIANGLES = 256, 64, 1 << 10
"""Points on surfaces at which sky is looked for, on so many placements at most, of each on so many
triangles that lie evenly among all.
"""
FIRST, MOST_ENCLOSED = 16, 128
"""Rays from each side of a point, and sides that see some sky, of which rooms are known."""
RAYS = 1 << 13, 1 << 15
"""From places in rooms; the second ones where few of the first reach the sky."""
LARGEST_SHARE = 0.4
"""Of the cosine-weighted directions those see the sky in that are in a room."""
LINES = 512
"""Rays to the sky that planes are chosen by."""
STEPS, CELLS = 48, 32
"""Planes across rooms for each of their main directions; cells of a plane as wide as the rooms."""
NORMALS, ALIKE = 5, 0.9986
"""Main directions, and the cosine within which they are the same."""
MOST = 12
"""Openings."""
FEWEST = 0.02
"""Share of the lines that an opening takes at least."""
WIDEST = 1 / 8
"""Share of the sphere in which places in rooms see the sky, and half of its lines an opening: what
is wider directions on all sides find.
"""
ENOUGH = 0.5
"""Share of the lines that openings must take, else the sky is seen everywhere."""
SNAPPED = 32
"""Rectangles grow to steps of about so many to their sides: what moves in a room seldom changes
them.
"""


def openings(scene: Scene) -> Openings | None:
    """Where the meshes of a scene leave rooms open to the sky; None where they do nowhere, or
    everywhere. They do not depend on lights or the camera.
    """
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
def _found(same: Same[Scene]) -> Openings | None:
    meshes, blocks = _solid(same.value)
    x, n = _probes(meshes, blocks)
    if not x.size:
        return None
    with Accelerator(meshes, blocks, quick=True) as surfaces:
        if not np.isfinite(surfaces.bounds).all():
            return None
        origin = surfaces.bounds.mean(0)[:, None]
        o, d, n = _lines(surfaces, x - origin, n, origin)
    rows = _rectangles(o, d, n) if o.size else []
    if not rows:
        return None
    c, u, v, n, share = (np.array(column) for column in zip(*rows, strict=True))
    return Openings(c + origin.T, u, v, n, share / share.sum())


def _solid(scene: Scene) -> tuple[list[Mesh], list[Instances]]:
    """Bare meshes of the triangles that let no light through, each with a block of its places: as
    few as differ, for a file of 50 000 objects has as many blocks.
    """
    clear = [any(lobe.kind == "TRANSPARENT" for lobe in m.lobes) for m in scene.materials]
    placed: dict[tuple[int, tuple[int, ...]], list[Array]] = {}
    for block in scene.instances:
        if block.visible_shadow:
            key = block.geometry, tuple(block.materials)
            if key not in placed:
                placed[key] = []
            placed[key].append(block.world_from_object)
    meshes: list[Mesh] = []
    blocks: list[Instances] = []
    for (number, materials), places in placed.items():
        mesh = scene.geometries[number]
        if not isinstance(mesh, Mesh):
            continue
        triangles, passed = mesh.triangles, np.array([clear[k] for k in materials], bool)
        if passed.any():
            slots = np.zeros(1, int) if mesh.material_slots is None else mesh.material_slots
            solid = ~passed[np.minimum(slots, len(passed) - 1)]
            solid = np.flatnonzero(np.broadcast_to(solid, len(triangles)))
            triangles = triangles.take(solid, 0)
        if len(triangles):
            blocks.append(Instances(mesh.name, len(meshes), np.concatenate(places), ()))
            meshes.append(Mesh(mesh.name, mesh.vertices, triangles))
    return meshes, blocks


def _probes(meshes: list[Mesh], blocks: list[Instances]) -> tuple[Array, Array]:
    """Points and unit normals (3, m), even by area on each of some placements."""
    ends = np.cumsum([len(block.world_from_object) for block in blocks], dtype=np.intp)
    count = int(ends[-1]) if len(ends) else 0
    numbers = np.unique(np.linspace(0, count - 1, min(count, PLACES)).astype(np.intp))
    found = [np.zeros((2, 0, 3))]
    for number in numbers.tolist():
        at = int(np.searchsorted(ends, number, "right"))
        mesh, matrix = meshes[blocks[at].geometry], blocks[at].world_from_object[number - ends[at]]
        found.append(_on(mesh, matrix, max(PROBES // len(numbers), 1), number))
    return tuple(np.concatenate(found, 1).transpose(0, 2, 1))


def _on(mesh: Mesh, matrix: Array, count: int, seed: int) -> Array:
    """Points and unit normals (2, m, 3), m <= count, of a mesh placed by a (3, 4) matrix."""
    triangles = mesh.triangles[:: -(-len(mesh.triangles) // TRIANGLES)]
    corners = mesh.vertices[triangles].astype(np.float64) @ matrix[:, :3].T + matrix[:, 3]
    with np.errstate(over="ignore", invalid="ignore"):
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.sqrt((across * across).sum(1))
    total = np.cumsum(np.where(np.isfinite(area), area, 0.0))
    if not total[-1] > 0:
        return np.zeros((2, 0, 3))
    u = (np.arange(count) + _turn(seed)) / count
    k = np.minimum(np.searchsorted(total, u * total[-1], "right"), len(total) - 1)
    k = k[area[k] > 0]
    a, b = dome_points(count)[: len(k)].T
    root = np.sqrt(a)
    weights = np.stack([1 - root, root * (1 - b), root * b], 1)
    return np.stack([(weights[:, :, None] * corners[k]).sum(1), across[k] / area[k][:, None]])


def _turn(number: Array | int) -> Array | float:
    """From 0 to 1, far apart for numbers that follow each other."""
    return number * 0.6180339887498949 % 1


def _lines(surfaces: Accelerator, x: Array, n: Array, origin: Array) -> tuple[Array, ...]:
    """Rays o d (3, m) that reach the sky from rooms, which are on the ways between those points
    that see little of it and what is round them; and the normals of these points. All count
    from the origin.
    """
    x, n = np.concatenate([x, x], 1), np.concatenate([n, -n], 1)
    o = np.tile(x + 16 * 2.0**-24 * np.abs(x).max() * n, FIRST)
    d = n[:, None] + _to_all_sides(FIRST, x.shape[1])
    d = (d / np.sqrt((d * d).sum(0))).reshape(3, -1)
    t = surfaces.closest((o + origin).T, d.T).t.reshape(FIRST, -1)
    share = np.isinf(t).mean(0)
    some = np.flatnonzero((share > 0) & (share <= LARGEST_SHARE))
    some = some[:: max(-(-len(some) // MOST_ENCLOSED), 1)]
    inside = np.flatnonzero(np.isfinite(t) & np.isin(np.arange(t.shape[1]), some))
    # even by volume, as the point sees it
    o = o[:, inside] + np.cbrt(_turn(np.arange(len(inside)))) * t.flat[inside] * d[:, inside]
    if not len(inside):
        return o, o, n
    for rays in RAYS:
        to = _to_all_sides(rays // len(inside) + 1, len(inside)).reshape(3, -1)
        starts = np.tile(o, to.shape[1] // len(inside))
        free = ~surfaces.occluded((starts + origin).T, to.T).reshape(-1, len(inside))
        wide = free.mean() > WIDEST
        # what is seen from next to a window does not count for more
        free &= np.cumsum(free, axis=0) <= LINES // len(inside) + 1
        free = free.ravel()
        if wide or 2 * free.sum() >= LINES:
            break
    return starts[:, free & ~wide], to[:, free & ~wide], n[:, some]


def _to_all_sides(count: int, points: int) -> Array:
    """(3, count, points) unit vectors, evenly spread for each of the points."""
    a, b = dome_points(count).T[:, :, None]
    turn = 2 * np.pi * (b + _turn(np.arange(points)))
    z, r = 1 - 2 * a, 2 * np.sqrt(a - a * a)
    return np.stack(np.broadcast_arrays(r * np.cos(turn), r * np.sin(turn), z))


def _rectangles(o: Array, d: Array, n: Array) -> list[tuple[Array, ...]]:
    """Of each opening a `Row`, and the share of the lines that pass it."""
    frames, size, few = _frames(n), float(np.ptp(o, axis=1).max() / CELLS), FEWEST * o.shape[1]
    rows: list[tuple[Array, ...]] = []
    count = o.shape[1]
    while len(rows) < MOST and o.shape[1] > few and size > 0:
        best = max((_narrowest(o, d, frame, size) for frame in frames), key=lambda one: one[0])
        taken = np.zeros(o.shape[1], bool)
        for row, through in _parts(o, d, size, few, *best[1:]):
            rows.append((*row, through.sum()))
            taken |= through
        if not taken.any():
            break
        o, d = o[:, ~taken], d[:, ~taken]
    return rows if o.shape[1] <= (1 - ENOUGH) * count else []


def _frames(normals: Array) -> list[Array]:
    """(3, 3) orthonormal rows u, v, n for the directions n that most of the normals (3, m) have."""
    found: list[Array] = []
    alike = np.abs(normals.T @ normals) > ALIKE
    free = np.ones(normals.shape[1], bool)
    while free.any() and len(found) < NORMALS:
        best = int(np.argmax(np.where(free, alike[:, free].sum(1), -1)))
        found.append(normals[:, best])
        free &= ~alike[best]
    found += list(np.eye(3))[: max(3 - len(found), 0)]
    frames = []
    for n in found:
        beside = min(found, key=lambda other: abs(float(n @ other)))
        u = beside - (n @ beside) * n
        u /= np.sqrt(u @ u)
        frames.append(np.stack([u, np.cross(n, u), n]))
    return frames


def _narrowest(o: Array, d: Array, frame: Array, size: float) -> tuple[float, Array, float, float]:
    """Of planes across n and the lines towards n or against it, where the square of how many pass
    is greatest over the area, in cells of this size, on which they do: how well that separates
    them, the frame, the plane's place and the side.
    """
    few = np.linspace(0, o.shape[1] - 1, min(o.shape[1], LINES)).astype(int)
    o, d = frame @ o[:, few], frame @ d[:, few]
    low, high = o[2].min(), o[2].max()
    margin = 0.05 * (high - low)
    at = np.linspace(low - margin, high + margin, STEPS)
    uv, met = _meeting(o, d, at)
    # farther apart than the table is wide counts as near: by then the area is large anyway
    cell = np.floor(np.clip(uv / size, -1e6, 1e6)).astype(np.int64) % (2 * CELLS)
    plane, line = np.nonzero(met)
    side = (d[2, line] < 0).astype(int)
    filled = np.zeros((2, STEPS, 2 * CELLS, 2 * CELLS), bool)
    filled[side, plane, cell[0, plane, line], cell[1, plane, line]] = True
    count = np.zeros((2, STEPS))
    np.add.at(count, (side, plane), 1.0)
    score = count**2 / np.maximum(filled.sum((2, 3)), 1)
    score[count < FEWEST * len(few)] = 0
    best = int(score.argmax())
    return float(score.flat[best]), frame, float(at[best % STEPS]), 1.0 - 2.0 * (best // STEPS)


def _meeting(o: Array, d: Array, at: Array) -> tuple[Array, Array]:
    """Where m lines meet s planes, (2, s, m), and whether they do, (s, m)."""
    along = np.abs(d[2]) > 0.05
    t = (at[:, None] - o[2]) / np.where(along, d[2], 1.0)
    return o[:2, None] + t * d[:2, None], along & (t > 0)


def _parts(
    o: Array, d: Array, size: float, fewest: float, frame: Array, at: float, side: float
) -> Iterator[tuple[Row, Array]]:
    """The rectangles of a plane that so many lines or more pass, farther apart than this size, and
    which do, (m,) bool.
    """
    o, d = frame @ o, frame @ d
    (u, v), (met,) = _meeting(o, d, np.array([at]))
    uv = np.concatenate([u, v])
    for part in _apart(uv, np.flatnonzero(met & (side * d[2] > 0)), size, fewest):
        low, high = uv[:, part].min(1), uv[:, part].max(1)
        step = 2.0 ** np.ceil(np.log2(np.maximum((high - low).max(), 1e-300) / SNAPPED))
        low, high = np.floor(low / step) * step, np.ceil(high / step) * step
        half, middle = (high - low) / 2, (high + low) / 2
        to = np.vstack([uv[:, part], np.full(len(part), at)]) - o[:, part]
        square = (to * to).sum(0)
        solid = 4 * half.prod() * np.abs(to[2]) / np.sqrt(square) / square
        if np.median(solid) <= WIDEST * 4 * np.pi:
            through = np.zeros(o.shape[1], bool)
            through[part] = True
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
