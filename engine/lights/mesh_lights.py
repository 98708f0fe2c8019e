"""Surfaces that glow as a light: their triangles, and points on them by importance, the same for
all pixels of a sample (Shirley, Wang, Zimmermann 1996; Keller 1997).
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..evaluation.attributes import Attributes
from ..evaluation.geometry import gather
from ..evaluation.materials import MaterialPoints
from ..evaluation.surface import Spot, Surface
from ..program.program import instructions, without_the_rest
from ..sampling import chosen, concentric_disc, dome_points, tabled
from ..scene import Camera, Emitters, Instances, Light, Material, Mesh, Scene
from .dome import LARGEST
from .same import Same

Array = np.ndarray

ROUND = 64
"""Spheres up to which each is a polyhedron of 320 faces, above of 80."""
INWARD = 0.1
"""Density of the points in a sphere beside those on it."""
MOST_PARTS = 32
"""To a side of a triangle whose emission varies."""
PARTS = 1 << 14
"""Into about so many triangles those are cut whose emission varies."""
MERGED = 64
"""Samples of a pixel. A point is nowhere seen from nearer than the radius of the disc that it
stands for among theirs: the surface does not end in dots where it meets another.
"""
LONG = 4.5
"""Square of the longest side over the area: 4 of half a square, 2.3 of an even triangle."""
PIECES = 1 << 10
"""Triangles with less than such a share of the power stay whole, however long."""
MARGIN = 2.0**-10
"""Points keep off the edges of triangles, where the inner side of one is seen past its neighbour.
"""


_NOTHING = Mesh("", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))


def camera_at(eye: Array) -> Camera:
    """Any camera there."""
    frame = np.column_stack([np.eye(3), eye])
    return Camera("PERSPECTIVE", frame, (-1.0, 1.0, -1.0, 1.0), (1, 1))


def mesh_lights(scene: Scene) -> tuple[Light, ...]:
    """The MESH lights of all surfaces of a scene that glow, one for those that light the same
    things, in the shadows of the same.
    """
    glowing = {k for k, material in enumerate(scene.materials) if _glows(material)}
    blocks = [
        block
        for block in (scene.instances if glowing else ())
        if not (block.catcher or glowing.isdisjoint(block.materials))
    ]
    return _lights(_what_glows(scene, blocks)) if blocks else ()


def _glows(material: Material) -> bool:
    return any(lobe.kind == "EMISSION" for lobe in material.lobes)


def _what_glows(scene: Scene, blocks: list[Instances]) -> Same[Scene]:
    """The blocks alone, as a key of those things on which their MESH lights depend."""
    used = {block.geometry for block in blocks}
    geometries = [g if k in used else _NOTHING for k, g in enumerate(scene.geometries)]
    alone = replace(scene, geometries=tuple(geometries), instances=tuple(blocks), lights=())
    glowing = {k: scene.materials[k] for block in blocks for k in block.materials}
    varied = any(_varies(material) for material in glowing.values())
    return Same(
        alone,
        *blocks,
        *(scene.geometries[block.geometry] for block in blocks),
        *glowing.values(),
        *(scene.textures if varied else ()),
    )


@functools.lru_cache(maxsize=2)
def _lights(same: Same[Scene]) -> tuple[Light, ...]:
    scene = same.value
    lights = (_light(replace(scene, instances=tuple(b))) for b in linked_blocks(scene.instances))
    return tuple(light for light in lights if light is not None)


def linked_blocks(blocks: Iterable[Instances]) -> Iterable[list[Instances]]:
    """The blocks in groups of what lights the same things, in the shadows of the same."""
    linked: dict[tuple[int, ...], list[Instances]] = {}
    for block in blocks:
        lit = block.visible_diffuse, block.visible_mirror, block.visible_media
        linked.setdefault((block.receivers, block.blockers, *lit), []).append(block)
    return linked.values()


def _light(scene: Scene) -> Light | None:
    """Of all that glows in a scene; None where nothing does."""
    # near what glows: sums of large and small coordinates lose the small ones' last digits
    block = scene.instances[0]
    first = np.array(block.world_from_object[0, :, 3], np.float64)
    found = _found(scene, first)
    if found is None:
        return None
    light, shift = box_light("Glowing surfaces", "MESH", found.corners.reshape(-1, 3), first)
    light = linked_as(light, block)
    return replace(light, emitters=replace(found, corners=found.corners - shift))


def box_light(name: str, kind: str, points: Array, origin: Array) -> tuple[Light, Array]:
    """A light that fills the box round points (n, 3), and where its middle is; both are counted
    from the origin.
    """
    low, high = points.min(0), points.max(0)
    size, middle = high - low, origin + (low + high) / 2
    light = Light(
        name,
        kind,
        np.column_stack([np.eye(3), middle]),
        size_x=float(size[0]),
        size_y=float(size[1]),
        radius=float(size[2]) / 2,
    )
    return light, middle - origin


def linked_as(light: Light, block: Instances) -> Light:
    """The light of what of a block glows: it lights what sees and is linked to that."""
    return replace(
        light,
        receivers=block.receivers,
        blockers=block.blockers,
        lights_matt=block.visible_diffuse,
        lights_gloss=block.visible_mirror,
        lights_media=block.visible_media,
    )


def _found(scene: Scene, origin: Array) -> Emitters | None:
    """All that glows, counted from the origin, None where nothing does."""
    parts = list(_Surfaces(replace(scene, camera=camera_at(origin)), origin).parts())
    if not parts:
        return None
    columns = ((p.corners, p.front, p.back, p.weight, p.light_group) for p in parts)
    corners, front, back, weight, group = map(np.concatenate, zip(*columns, strict=True))
    with np.errstate(over="ignore", invalid="ignore"):
        front, back = (np.clip(side, -LARGEST, LARGEST) for side in (front, back))
        weight = weight * (np.abs(front) + np.abs(back)).mean(1)
        found = Emitters(corners, front, back, weight, group).take(np.flatnonzero(weight > 0))
        given = found.weight * found.areas
    good = np.flatnonzero((given > 0) & np.isfinite(given))
    return found.take(good) if len(good) else None


def _varies(material: Material) -> bool:
    factors = (f for lobe in material.lobes if lobe.kind == "EMISSION" for f in lobe.factors)
    return any(f.texture >= 0 or f.attribute or f.output >= 0 for f in factors)


def _glow_of(material: Material) -> Material:
    """Its EMISSION lobes, with what they need of its program."""
    lobes = tuple(lobe for lobe in material.lobes if lobe.kind == "EMISSION")
    read = {f.output for lobe in lobes for f in lobe.factors if f.output >= 0}
    program = without_the_rest(material.program, read) if material.program and read else None
    return replace(material, lobes=lobes, program=program)


_OF_BOTH_SIDES = ("attribute", "uv", "position", "instance_value", "image")
"""What programs read of a point that is the same seen from either side."""


def _is_alike(glow: Material) -> bool:
    """Whether what `_glow_of` gives glows to both sides alike."""
    steps = instructions(glow.program) if glow.program is not None else ()
    operations = (step.operation for step in steps)
    return all(not of.reads_point or of.name in _OF_BOTH_SIDES for of in operations)


def _parts(material: Material, triangles: int) -> int:
    """To a side of each of so many triangles of a material."""
    return int(np.clip(np.sqrt(PARTS / triangles), 1, MOST_PARTS)) if _varies(material) else 1


class _Surfaces:
    """What glows of a scene whose coordinates count from an origin."""

    def __init__(self, scene: Scene, origin: Array) -> None:
        self._materials, self._geometry = scene.materials, gather(scene, origin)
        glow = replace(scene, materials=tuple(map(_glow_of, scene.materials)))
        self._glow = MaterialPoints(glow, Attributes(scene), self._geometry)

    def parts(self) -> Iterator[Emitters]:
        """Of each material; weights are but for the radiance, and `Polygons` are left out."""
        g = self._geometry
        for number in np.unique(g.material):
            if number < 0 or not _glows(self._materials[number]):
                continue
            primitive = np.flatnonzero(g.material == number)
            flat = primitive[primitive < g.triangle_count]
            if len(flat):
                yield self._of_triangles(number, flat)
            balls = primitive[len(flat) :] - g.triangle_count
            balls = balls[balls < g.ball_count]
            if len(balls):
                yield from self._of_balls(number, balls)

    def _of_triangles(self, number: int, primitive: Array) -> Emitters:
        """Of a material, each cut into parts² alike."""
        parts, sides = _parts(self._materials[number], len(primitive)), self._geometry.triangles
        corners = np.stack([self._geometry.points[:, side[primitive]].T for side in sides], 1)
        cells = _cells(parts)
        pieces = np.einsum("kcw,twx->tkcx", cells, corners).reshape(-1, 3, 3)
        index = np.repeat(primitive, parts * parts)
        return self._part(number, index, np.tile(cells.mean(1), (len(primitive), 1)), pieces)

    def _of_balls(self, number: int, balls: Array) -> Iterator[Emitters]:
        """Spheres of a material as polyhedra: one round them that glows outward with their power,
        one in them that glows inward with their radiance and has few points, as most are seen from
        outside.
        """
        g = self._geometry
        matrices = g.placements.world_from_object[g.balls.row[balls]][:, :, :3]
        matrices = g.balls.radius[balls, None, None] * matrices
        for outward in (True, False):
            unit, share = _polyhedron(2 if len(balls) <= ROUND else 1, outward)
            pieces = np.einsum("nxy,kcy->nkcx", matrices, unit)
            pieces = (pieces + g.balls.center_world[:, balls].T[:, None, None]).reshape(-1, 3, 3)
            index = np.repeat(balls + g.triangle_count, len(unit))
            part = self._part(number, index, np.tile((1.0, 0.0, 0.0), (len(index), 1)), pieces)
            nothing = np.zeros_like(part.front)
            if outward:
                yield replace(part, front=share * part.front, back=nothing)
            else:
                yield replace(part, front=nothing, weight=INWARD * part.weight)

    def _part(self, number: int, primitive: Array, weights: Array, pieces: Array) -> Emitters:
        """The triangles `pieces` (n, 3, 3), counter-clockwise in their object, parts of primitives
        (n,) of a material at the weights (n, 3) of their corners.
        """
        g = self._geometry
        mirrored = g.placements.mirror[g.row[primitive]] < 0
        pieces = np.where(mirrored[:, None, None], pieces[:, ::-1], pieces)
        x = pieces.mean(1).T
        normals = Emitters(pieces, x, x, x, x).normals.T
        front = self._radiance(primitive, weights, x, normals, True)
        back = front
        if not _is_alike(_glow_of(self._materials[number])):
            back = self._radiance(primitive, weights, x, -normals, False)
        blocks = g.placements.instances
        groups = np.array([block.light_group for block in blocks], np.intp)
        group = groups[g.placements.block[g.row[primitive]]]
        return Emitters(pieces, front, back, np.ones(len(pieces)), group)

    def _radiance(
        self, primitive: Array, weights: Array, x: Array, g: Array, is_outside: bool
    ) -> Array:
        """(n, 3) at the points x (3, n), seen straight, against the normals g (3, n)."""
        zeros = np.zeros(len(primitive))
        surface = Surface(
            **vars(Spot.of(self._geometry, primitive, weights.T)),
            row=self._geometry.row[primitive],
            x=x,
            g=g,
            n=g,
            v=g,
            start=x,
            outside=np.full(len(primitive), is_outside),
            offset=zeros,
            mesh_n=g,
            unbent=np.zeros_like(g),
            bump=zeros,
            far=zeros,
            grazing=zeros,
            lowering=zeros + 1,
            past=np.stack([zeros + 1, zeros, zeros, zeros]),
        )
        return self._glow.emission(surface, "scattered").T


def _cells(parts: int) -> Array:
    """(parts², 3, 3) barycentric weights of the corners of as many alike triangles in one."""
    cells = []
    for i in range(parts):
        for j in range(parts - i):
            cells.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < parts - 1:
                cells.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    uv = np.array(cells, np.float64) / parts
    return np.concatenate([1 - uv.sum(2, keepdims=True), uv], 2)


@functools.cache
def _polyhedron(level: int, outside: bool) -> tuple[Array, float]:
    """(20 · 4^level, 3, 3) triangles, counter-clockwise seen from outside, round the unit sphere or
    in it, and its area over theirs.
    """
    g = (1 + np.sqrt(5)) / 2
    points = np.array(
        [(s * a, t * b, 0) for a, b in ((1, g),) for s in (-1, 1) for t in (-1, 1)], np.float64
    )
    points = np.concatenate([np.roll(points, k, 1) for k in range(3)])
    near = np.linalg.norm(points[:, None] - points, axis=2) < 2.5
    faces = [
        (i, j, k)
        for i in range(12)
        for j in range(i + 1, 12)
        for k in range(j + 1, 12)
        if near[i, j] and near[j, k] and near[i, k]
    ]
    corners = points[np.array(faces)]
    for _ in range(level):
        corners = np.einsum("kcw,twx->tkcx", _cells(2), corners).reshape(-1, 3, 3)
        corners /= np.linalg.norm(corners, axis=2, keepdims=True)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (across * corners[:, 0]).sum(1) < 0
    corners[inward] = corners[inward][:, ::-1]
    size = np.linalg.norm(across, axis=1)
    scale = 1 / (np.abs((across * corners[:, 0]).sum(1)) / size).min() if outside else 1.0
    return scale * corners, float(4 * np.pi / (scale**2 * size.sum() / 2))


def _pieces(emitters: Emitters) -> tuple[Array, Array, Array]:
    """Corners (k, 3, 3) of compact triangles, long ones cut across their longest sides, of which
    triangle each is part, and its share of the power. They lie along a curve: points even along
    that are even in space.
    """
    corners, index = emitters.corners, np.arange(len(emitters.corners))
    share = emitters.areas / emitters.spreads
    while len(long := np.flatnonzero((share > 1 / PIECES) & _is_long(corners))):
        a, b, c = np.moveaxis(_longest_first(corners[long]), 1, 0)
        middle = (a + b) / 2
        halves = np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)
        corners = np.concatenate([np.delete(corners, long, 0), *halves])
        index = np.concatenate([np.delete(index, long), index[long], index[long]])
        share = np.concatenate([np.delete(share, long), share[long] / 2, share[long] / 2])
    order = along_a_curve(corners.mean(1))
    return corners[order], index[order], share[order]


def _sides(corners: Array) -> Array:
    """(3, n) squares of the lengths from a to b, b to c, c to a."""
    return (np.diff(corners, axis=1, append=corners[:, :1]) ** 2).sum(2).T


def _is_long(corners: Array) -> Array:
    """(n,) bool: longer than half a square; not for what has no area."""
    a, b, c = np.moveaxis(corners, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return (_sides(corners).max(0) > LONG * area) & (area > 0)


def _longest_first(corners: Array) -> Array:
    """Triangles (n, 3, 3) turned so that the first two corners are farthest apart."""
    turn = (_sides(corners).argmax(0)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(corners, turn[..., None], 1)


def along_a_curve(x: Array) -> Array:
    """The order of points (n, 3) along Morton's curve through their bounds: neighbours in space are
    neighbours in it.
    """
    return np.argsort(curve_codes(x), kind="stable")


def curve_codes(x: Array) -> Array:
    """(n,) uint64: where along that curve the points lie."""
    low = x.min(0)
    high = x.max(0)
    size = (high - low).max()
    cells = ((x - low) / (size if size > 0 else 1.0) * ((1 << 20) - 1)).astype(np.uint64)
    code = np.zeros(len(x), np.uint64)
    for bit in range(20):
        for axis in range(3):
            digit = cells[:, axis] >> np.uint64(bit) & np.uint64(1)
            code |= digit << np.uint64(3 * bit + axis)
    return code


@dataclass(frozen=True, eq=False)
class MeshTable:
    """Points on a MESH light: k of them.

    point, normal: (k, 3) in the light's axes.  front, back: (k, 3) radiance.  spread: (k,) one over
    their density by area.  reach: (k,) the longest sides of their triangles.  disc: (k, 2) of the
    unit disc.  each: how many a sample of a pixel takes.  light_group: (k,) int, -1 for none.
    """

    point: Array
    normal: Array
    front: Array
    back: Array
    spread: Array
    reach: Array
    disc: Array
    each: int
    light_group: Array

    def first(self, count: int) -> MeshTable:
        """The first `count` of the points of each sample."""
        kept = np.arange(len(self.point)) % self.each < count
        columns = {k: column[kept] for k, column in vars(self).items() if np.ndim(column)}
        return replace(self, **columns, each=count)


def merged(spread: Array | float, each: int, samples: int = MERGED) -> Array | float:
    """The square of the distance from which a point of a light is seen at least: the radius of the
    disc that it stands for among those of so many samples of a pixel.
    """
    return spread / (samples * each * np.pi)


def mesh_table(light: Light, samples: int, each: int) -> MeshTable:
    """What tracers know of a MESH light of which each of `samples` samples of a pixel takes `each`
    points: those of as many whole samples as `MOST_TABLED` allows, after which they begin again.
    """
    emitters = light.emitters
    assert emitters is not None
    count = tabled(samples, each)
    u = dome_points(count)
    pieces, whole, weight = _pieces(emitters)
    piece, along = chosen(weight, u[:, 0])
    corners, index = pieces[piece], whole[piece]
    x, y = (MARGIN + (1 - 2 * MARGIN) * at for at in (along, u[:, 1]))
    point = np.einsum("kc,kcx->kx", _in_triangle(x, y), corners)
    return MeshTable(
        point,
        emitters.normals[index],
        emitters.front[index],
        emitters.back[index],
        emitters.spreads[index],
        emitters.reaches[index],
        concentric_disc(2 * u - 1),
        each,
        emitters.light_group[index],
    )


def _in_triangle(x: Array, y: Array) -> Array:
    """(k, 3) barycentric weights of points of the unit square; neighbours stay near (Heitz 2019,
    A low-distortion map between triangle and square).
    """
    above = y > x
    b = np.where(above, x / 2, x - y / 2)
    c = np.where(above, y - x / 2, y / 2)
    return np.stack([1 - b - c, b, c], 1)
