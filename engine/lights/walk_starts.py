"""Where walks of light leave the lights of a scene: for each light points and directions, and what
surfaces that they meet get of it.

Letters: x point that is met, o origin, d direction, p density of directions a steradian, n walks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..sampling import chosen, concentric_disc, walk_points
from ..scene import EVERYTHING, Camera, Geometry, Light, Mesh, Openings, Scene, Spheres, Strands
from .dome import dome_table
from .glowing_media import medium_table
from .mesh_lights import mesh_table
from .openings import points_on

Array = np.ndarray

FEWEST = 64
"""Walks of a light at least, where there are not too many lights."""
PLACES = 64
"""Placements that light from afar is aimed at, each alike."""
WIDER = 2.0
"""As many walks are aimed at balls round a placement so much wider than the last, up to the whole
scene: ever fewer by area meet what is farther from all of them.
"""
MOST_WIDER = 16
THROUGH = 0.5
"""Of the walks of a sky or a sun, where rooms have openings to it."""
ROUNDED = 16 * 2.0**-24
"""Of coordinates: what single precision may move surfaces by, twice."""
HUGE = 1e100
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Start:
    """n walks of one light. origin, direction: (3, n), directions unit.  given: of points x (3, m)
    and the numbers (m,) of the walks that meet them, (3, m): the light that goes on from a white
    surface, radiance times area.  light_group: (n,) int, -1 for none.  receivers, blockers: as of
    the light.  shadowed: (n,) bool, those that meet what casts shadows until something scatters
    them, and not what diffuse rays see; None for all.
    """

    origin: Array
    direction: Array
    given: Callable[[Array, Array], Array]
    light_group: Array
    receivers: int = EVERYTHING
    blockers: int = EVERYTHING
    endless: bool = False
    shadowed: Array | None = None


def starts(scene: Scene, origin: Array, bounds: Array, count: int) -> Iterator[Start]:
    """Of all lights of a scene with surfaces in `bounds` (2, 3), about `count` walks together, each
    light in proportion to what it gives.
    """
    far = _Far(scene, origin, bounds)
    powers = np.array([light.lights_matt and _power(light, far) for light in scene.lights])
    powers = np.where(np.isfinite(powers), powers, 0.0)
    if not powers.any():
        return
    least = min(FEWEST, max(count // np.count_nonzero(powers), 1))
    found = next((light.openings for light in scene.lights if light.openings is not None), None)
    if found is not None:
        found = replace(found, centers=found.centers - origin)
    for light, power in zip(scene.lights, powers, strict=True):
        if power > 0:
            n = max(
                round(count * float(power / powers.max() / (powers / powers.max()).sum())), least
            )
            for start in _start(light, origin, far, n, found):
                yield replace(
                    start,
                    receivers=light.receivers,
                    blockers=light.blockers,
                    endless=light.kind in ("SUN", "DOME"),
                )


def _color(light: Light) -> Array:
    with np.errstate(over="ignore"):
        return np.clip(np.array(light.color, np.float64) * light.strength, -HUGE, HUGE)


def _power(light: Light, far: _Far) -> float:
    """Watts or so."""
    if light.kind == "MESH":
        e = light.emitters
        assert e is not None
        with np.errstate(over="ignore", invalid="ignore"):
            return float(np.pi * e.areas @ (np.abs(e.front) + np.abs(e.back)).mean(1))
    if light.kind == "MEDIUM":
        rods = light.rods
        assert rods is not None
        with np.errstate(over="ignore", invalid="ignore"):
            return float(4 * np.pi * rods.volumes @ np.abs(rods.emission).mean(1))
    given = float(np.abs(_color(light)).mean())
    if light.kind == "SUN":
        return given * far.section
    if light.kind == "DOME":
        assert light.radiance is not None
        rows = len(light.radiance)
        high = np.sin((np.arange(rows) + 0.5) * np.pi / rows)[:, None, None]
        mean = np.abs(light.radiance * high).mean() / high.mean()
        return given * 4 * np.pi * float(mean) * far.section
    spot = (1 - np.cos(light.spot_size / 2)) / 2
    return given * (spot if light.kind == "SPOT" else 1.0)


def _start(
    light: Light, origin: Array, far: _Far, n: int, openings: Openings | None
) -> Iterator[Start]:
    """n walks. openings: of rooms, which light from afar comes in by, counted from the origin."""
    if light.kind == "MESH":
        yield _from_mesh(light, origin, n)
    elif light.kind == "MEDIUM":
        yield _from_medium(light, origin, n)
    elif light.kind == "DOME":
        table = dome_table(light, n, 1)
        given = table.light[:, :3].T
        group = np.full(len(table.along), light.light_group)
        start = far.start(-table.along.T, lambda x, number: given[:, number], group, openings)
        yield replace(start, shadowed=table.shadowed)
    elif light.kind != "BOUNCED":
        yield _from_lamp(light, origin, far, n, openings)


def _from_mesh(light: Light, origin: Array, n: int) -> Start:
    table = mesh_table(light, n, 1)
    frame = np.asarray(light.world_from_light, np.float64)
    point = frame[:, :3] @ table.point.T + (frame[:, 3] - origin)[:, None]
    normal = frame[:, :3] @ table.normal.T
    front, back = np.abs(table.front).sum(1), np.abs(table.back).sum(1)
    both = np.where(front + back > 0, front + back, 1.0)
    outward = walk_points(n, 254)[: len(point.T), 0] * both < front
    radiance = np.where(
        outward[:, None],
        table.front * (both / np.where(front > 0, front, 1.0))[:, None],
        table.back * (both / np.where(back > 0, back, 1.0))[:, None],
    )
    given = (radiance * table.spread[:, None] / n).T
    normal = np.where(outward, 1.0, -1.0) * normal
    u = walk_points(n, 255)[: len(point.T)]
    clear = ROUNDED * (np.abs(point + origin[:, None]).max(0) + table.reach)
    return Start(
        point + clear * normal,
        cosine_around(normal, *u.T),
        lambda x, number: given[:, number],
        table.light_group,
    )


def _from_medium(light: Light, origin: Array, n: int) -> Start:
    table = medium_table(light, n, 1)
    frame = np.asarray(light.world_from_light, np.float64)
    point = frame[:, :3] @ table.point.T + (frame[:, 3] - origin)[:, None]
    given = (4 * table.front * table.spread[:, None] / n).T
    u = walk_points(n, 255)[: len(point.T)]
    up = np.repeat(np.array([[0.0], [0.0], [1.0]]), len(point.T), 1)
    return Start(
        point, _cone(up, -1.0, *u.T), lambda x, number: given[:, number], table.light_group
    )


def _from_lamp(light: Light, origin: Array, far: _Far, n: int, openings: Openings | None) -> Start:
    from ..reference.area_lights import around
    from ..reference.emission import Emission
    from ..reference.lights import CENTER, Source
    from ..reference.textures import Image
    from ..reference.vectors import dot

    emission = None
    if light.program is not None:
        emission = Emission([Image(t) for t in light.textures], _camera(origin))

    def given(o: Array, x: Array, area: Array | float) -> Array:
        """What n walks that stand for `area` each give on, over n; area is times the cosine."""
        source = Source(light, origin, True, emission)
        source.position = o
        sample = source.sample(x, CENTER, 1)
        with np.errstate(over="ignore", invalid="ignore"):
            return np.clip(sample.light_of(source) * (area / n), -HUGE, HUGE)

    u, v, group = walk_points(n, 254), walk_points(n, 255), np.full(n, light.light_group)
    whole = Source(light, origin, True)
    center, axis = whole.position, whole.axis
    if light.kind == "SUN":
        d = np.repeat(axis, n, 1)
        return far.start(d, lambda x, number: given(center, x, n), group, openings)
    if light.kind == "AREA":
        square = 2 * u - 1
        a, b = (square if light.shape == "RECTANGLE" else concentric_disc(square)).T
        o = center + a * whole.right + b * whole.up
        half = whole.half_spread
        axes = np.repeat(axis, n, 1)
        d = cosine_around(axes, *v.T) if half is None else around(axes, half, *v.T)
    else:
        edge = np.cos(light.spot_size / 2) if light.kind == "SPOT" else -1.0
        d = _cone(np.repeat(axis, n, 1), edge, *v.T)
        o = center + light.radius * _across(d, *concentric_disc(2 * walk_points(n, 253) - 1).T)

    def at(x: Array, number: Array) -> Array:
        to = x - o[:, number]
        square = dot(to, to)
        if light.kind == "AREA":
            z = np.maximum(dot(d[:, number], axis), 1e-12)
            share = np.maximum(whole.along(-d[:, number]), TINY)
            return given(o[:, number], x, square * np.pi / (z * share))
        # a disc that faces what it lights shines past it where it is seen large; a ball does not
        middle = dot(x - center, x - center)
        facing = light.radius**2 if light.soft_falloff else 0.0
        share = middle / np.maximum(middle + facing, TINY)
        return given(o[:, number], x, square * share * (2 * np.pi * (1 - edge)))

    return Start(o, d, at, group)


def _camera(origin: Array) -> Camera:
    frame = np.column_stack([np.eye(3), origin])
    return Camera("PERSPECTIVE", frame, (-1.0, 1.0, -1.0, 1.0), (1, 1))


def _across(n: Array, x: Array, y: Array) -> Array:
    """(3, m) the points (x, y) of discs across the unit vectors n (3, m)."""
    from ..reference.vectors import basis_around

    first, second = basis_around(n)
    return x * first + y * second


def cosine_around(n: Array, u: Array, v: Array) -> Array:
    """(3, m) unit, as densely as their cosine to the unit vectors n, at points of the square."""
    x, y = concentric_disc(2 * np.stack([u, v], 1) - 1).T
    return _across(n, x, y) + np.sqrt(np.maximum(0.0, 1 - x * x - y * y)) * n


def _cone(axis: Array, edge: float, u: Array, v: Array) -> Array:
    """(3, m) unit, even over the cone round the unit vectors `axis` whose cosine is above edge."""
    from ..reference.vectors import basis_around

    z = 1 - (1 - edge) * u
    across, turn = np.sqrt(np.maximum(0.0, 1 - z * z)), 2 * np.pi * v
    first, second = basis_around(axis)
    return across * (np.cos(turn) * first + np.sin(turn) * second) + z * axis


class _Far:
    """Parallel walks from outside a scene: aimed at placements, so that small things on a ground
    without end get their share, and at the whole. center, radius: (3, k), (k,) of the balls that
    they are aimed at, the whole first. section: of the whole.
    """

    def __init__(self, scene: Scene, origin: Array, bounds: Array) -> None:
        low, high = bounds - origin
        middle, reach = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
        rows, shares = [(*middle, reach)], [1.0]
        for *center, radius in _balls(scene, origin):
            wider: list[tuple[float, ...]] = []
            radius *= WIDER
            while 0 < radius < reach and len(wider) < MOST_WIDER:
                wider.append((*center, radius))
                radius *= WIDER
            rows += wider
            shares += [1 / max(len(wider), 1)] * len(wider)
        self.center, self.radius = np.array(rows)[:, :3].T, np.array(rows)[:, 3]
        self.section = np.pi * reach**2
        self._middle, self._reach = middle[:, None], reach
        self._shares = np.array(shares) / sum(shares)

    def start(
        self,
        d: Array,
        given: Callable[[Array, Array], Array],
        group: Array,
        openings: Openings | None = None,
    ) -> Start:
        """d: (3, n) unit.  given: as of `Start`, times area and cosine.  group: as there.
        openings: counted from the origin, through which half of the walks go that may.
        """
        from ..reference.vectors import basis_around, dot

        n = d.shape[1]
        u = walk_points(n, 253)[:, 0]
        inward = _inward(openings, d)
        through = np.where(inward.any(0), THROUGH, 0.0)
        aimed = u >= through
        which, _ = chosen(self._shares, (u - through) / (1 - through))
        square = 2 * walk_points(n, 252) - 1
        x, y = concentric_disc(square).T
        first, second = basis_around(d)
        at = self.center[:, which] + self.radius[which] * (x * first + y * second)
        density = np.zeros(n)
        if openings is not None:
            number = _chosen_each(inward, u / THROUGH)
            on = points_on(openings, number, square).T
            at = np.where(aimed, at, on)
            density += through * _crossing(openings, inward, at, d)
        for k, share in enumerate(self._shares):
            off = at - self.center[:, k : k + 1]
            off = off - dot(off, d) * d
            inside = dot(off, off) <= self.radius[k] ** 2 * (1 + 1e-9)
            share *= 1 - through
            density += np.where(inside, share / (np.pi * self.radius[k] ** 2), 0.0)
        outside = at - (dot(at - self._middle, d) + 1.5 * self._reach) * d
        area = 1 / (n * density)
        return Start(
            outside,
            d,
            lambda x, number: np.clip(given(x, number) * area[number], -HUGE, HUGE),
            group,
        )


def _inward(openings: Openings | None, d: Array) -> Array:
    """(k, n) how likely a walk in the direction d (3, n) goes through each opening: those that it
    passes from the sky's side.
    """
    if openings is None:
        return np.zeros((0, d.shape[1]))
    may = (openings.normals @ d < 0) * openings.shares[:, None]
    total = may.sum(0)
    return may / np.where(total > 0, total, 1.0)


def _chosen_each(shares: Array, u: Array) -> Array:
    """(n,) the row of the shares (k, n) that u (n,) falls into."""
    ends = np.cumsum(shares, 0)
    return np.minimum((u >= ends).sum(0), len(shares) - 1)


def _crossing(openings: Openings, inward: Array, at: Array, d: Array) -> Array:
    """(n,) how densely, by the area across them, walks through openings are where the lines at +
    t d are.
    """
    total = np.zeros(d.shape[1])
    rows = zip(openings.centers, openings.right, openings.up, openings.normals, inward, strict=True)
    for center, right, up, normal, share in rows:
        z = np.where(share > 0, normal @ d, -1.0)
        off = at - center[:, None]
        off = off - normal @ off / z * d
        r2, u2 = right @ right, up @ up
        edge = 1 + 1e-9
        inside = (np.abs(right @ off) <= r2 * edge) & (np.abs(up @ off) <= u2 * edge)
        total += np.where(inside, share / (4 * np.sqrt(r2 * u2) * -z), 0.0)
    return total


def _balls(scene: Scene, origin: Array) -> Iterator[tuple[float, float, float, float]]:
    """Middle and radius of the bounds of placements, of all or of some of many."""
    ends = np.cumsum([len(block.world_from_object) for block in scene.instances])
    numbers = np.arange(0, ends[-1], max(-(-int(ends[-1]) // PLACES), 1))
    blocks = np.searchsorted(ends, numbers, "right").tolist()
    corners = {b: _box(scene.geometries[scene.instances[b].geometry]) for b in set(blocks)}
    for number, b in zip(numbers, blocks, strict=True):
        matrix = scene.instances[b].world_from_object[number - ends[b]]
        at = matrix[:, :3] @ corners[b] + (matrix[:, 3] - origin)[:, None]
        if at.size and np.isfinite(at).all():
            low, high = at.min(1), at.max(1)
            yield (*((low + high) / 2), float(np.linalg.norm(high - low)) / 2)


def _box(geometry: Geometry) -> Array:
    """(3, 8) corners of the bounds, (3, 0) where there is nothing finite."""
    if isinstance(geometry, Spheres):
        low, high = (geometry.centers + s * geometry.radii[:, None] for s in (-1, 1))
    elif isinstance(geometry, Strands):
        low, high = (geometry.vertices + s * geometry.radii[:, None] for s in (-1, 1))
    elif isinstance(geometry, Mesh):
        low = high = geometry.vertices[np.unique(geometry.triangles)]
    else:
        low = high = geometry.vertices
    good = np.isfinite(low).all(1) & np.isfinite(high).all(1)
    if not good.any():
        return np.zeros((3, 0))
    ends = np.stack([low[good].min(0), high[good].max(0)]).astype(np.float64)
    return np.array(
        [[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    ).T
