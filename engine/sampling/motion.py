"""Where cameras and objects that move stand at each sample (semantics/camera.md, motion.md)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..scene import (
    Attribute,
    Camera,
    Geometry,
    Instances,
    Light,
    Mesh,
    Polygons,
    Scene,
    Spheres,
    Strands,
)
from .lens import BLOCK
from .patterns import shared_shutter_times, shutter_times

Array = np.ndarray

_RIGID = 1e-6
"""How far a turn from one key to the next may be off orthonormal."""
_STEPS = 40
"""Of Newton's iteration: far more than matrices need whose axes differ in length by 10 ** 6."""
_FLAT = 1e-6
"""Volume, of axes as long as 1 together, up to which a body counts as flat: what rounding to
float32 leaves of a flat one that is turned.
"""
_NEARLY_ALIKE = 0.9995
"""Cosine of half the angle between two turns, from which on the way between them is a chord, as in
Cycles.
"""


def is_moving(scene: Scene) -> bool:
    """Whether anything but the camera moves."""
    return (
        any(getattr(g, "motion", None) is not None for g in scene.geometries)
        or any(block.motion is not None for block in scene.instances)
        or any(light.motion is not None for light in scene.lights)
    )


def sample_times(scene: Scene, samples: int) -> Array:
    """(BLOCK², samples) float64 in (0, 1): when each sample is taken, by pixel of a block, as often
    as the shutter is open. Where more than the camera moves all pixels share times.
    """
    if is_moving(scene):
        shared = shared_shutter_times(samples, scene.camera.lens is not None)
        times = np.repeat(shared[None], BLOCK * BLOCK, axis=0)
    else:
        times = shutter_times(BLOCK, samples)
    shutter = scene.camera.shutter
    return times if shutter is None else _where_open(np.asarray(shutter, np.float64), times)


def _where_open(opening: Array, shares: Array) -> Array:
    """The times before which these shares of the light come in."""
    light = np.concatenate([[0.0], np.cumsum((opening[1:] + opening[:-1]) / 2)])
    times = np.linspace(0.0, 1.0, len(opening))
    return np.interp(shares, light / light[-1], times)


def moment(scene: Scene, time: float) -> Scene:
    """What stands there at one time of the shutter's, 0 to 1. The camera keeps its motion; what
    stands still is the very same value.
    """
    return Moments(scene).at(time)


class Moments:
    """A scene at many times: how matrices turn from one key to the next is found once."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._ways: dict[tuple[str, int, int], _Way] = {}

    def at(self, time: float) -> Scene:
        """As `moment`."""
        scene = self._scene
        return replace(
            scene,
            geometries=tuple(_shape(g, time) for g in scene.geometries),
            instances=tuple(self._placed(k, time) for k in range(len(scene.instances))),
            lights=tuple(self._lamp(k, time) for k in range(len(scene.lights))),
        )

    def _placed(self, number: int, time: float) -> Instances:
        block = self._scene.instances[number]
        if block.motion is None:
            return block
        frames = self._between("instances", number, block.motion, time)
        return replace(block, world_from_object=frames, motion=None)

    def _lamp(self, number: int, time: float) -> Light:
        light = self._scene.lights[number]
        if light.motion is None:
            return light
        frame = self._between("lights", number, light.motion[:, None], time)[0]
        return replace(light, world_from_light=frame, motion=None)

    def _between(self, kind: str, number: int, keys: Array, time: float) -> Array:
        k, share = _key_before(keys, time)
        way = self._ways.get((kind, number, k))
        if way is None:
            way = self._ways[kind, number, k] = _Way(keys[k], keys[k + 1])
        return way.at(share)


def camera_frames(camera: Camera, times: Array) -> Array:
    """(BLOCK², samples, 3, 4) float64 world_from_camera of each sample by pixel of a block, row by
    row.  times: (BLOCK², samples) of the shutter's.
    """
    keys = np.asarray(camera.motion, np.float64)
    place = times.ravel() * (len(keys) - 1)
    first = np.minimum(place.astype(np.intp), len(keys) - 2)
    frames = np.empty((times.size, 3, 4))
    for k in range(len(keys) - 1):
        chosen = first == k
        frames[chosen] = _between(keys[k], keys[k + 1], place[chosen] - k)
    return frames.reshape(*times.shape, 3, 4)


def _between(a: Array, b: Array, share: Array) -> Array:
    """(n, 3, 4) from a to b, (3, 4) each: places on a line; axes turn evenly about one line, or go
    straight where they do more than turn.
    """
    t = share[:, None, None]
    straight = a + t * (b - a)
    turn = np.linalg.solve(a[:, :3], b[:, :3])
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.trace(turn) < -1 + _RIGID:
        return straight
    across = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine = np.linalg.norm(across) / 2
    angle = np.arctan2(sine, (np.trace(turn) - 1) / 2)
    x, y, z = across / (2 * sine) if sine > 0 else np.zeros(3)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turned = np.eye(3) + np.sin(t * angle) * skew + (1 - np.cos(t * angle)) * (skew @ skew)
    return np.concatenate([a[:, :3] @ turned, straight[:, :, 3:]], 2)


# --- what moves


def _shape(geometry: Geometry, time: float) -> Geometry:
    if isinstance(geometry, Polygons) or geometry.motion is None:
        return geometry
    places = _on_a_line(geometry.motion, time).astype(np.float32)
    if isinstance(geometry, Mesh):
        return _mesh(geometry, places, time)
    return _round(geometry, places, time)


def _mesh(geometry: Mesh, places: Array, time: float) -> Mesh:
    normals = geometry.normals
    if normals is not None and geometry.normal_motion is not None:
        values = _on_a_line(geometry.normal_motion, time)
        size = np.sqrt((values * values).sum(-1, keepdims=True))
        unit = values / np.where(size > 0, size, 1.0)
        normals = replace(normals, values=unit.astype(np.float32))
    return replace(geometry, vertices=places, normals=normals, motion=None, normal_motion=None)


def _round(geometry: Spheres | Strands, places: Array, time: float) -> Spheres | Strands:
    radii = geometry.radii
    if geometry.radius_motion is not None:
        radii = _on_a_line(geometry.radius_motion, time).astype(np.float32)
    still = replace(geometry, radii=radii, motion=None, radius_motion=None)
    if isinstance(still, Spheres):
        return replace(still, centers=places)
    attributes = tuple(_values(attribute, time) for attribute in still.attributes)
    return replace(still, vertices=places, attributes=attributes)


def _values(attribute: Attribute, time: float) -> Attribute:
    if attribute.motion is None:
        return attribute
    values = _on_a_line(attribute.motion, time).astype(np.float32)
    return replace(attribute, values=values, motion=None)


def _keys_at(keys: Array, time: float) -> tuple[Array, Array, float]:
    """The keys before and after a time, and how far it is between them."""
    k, share = _key_before(keys, time)
    return keys[k], keys[k + 1], share


def _key_before(keys: Array, time: float) -> tuple[int, float]:
    """The number of the key before a time, and how far that is to the next."""
    place = time * (len(keys) - 1)
    k = min(int(place), len(keys) - 2)
    return k, place - k


def _on_a_line(keys: Array, time: float) -> Array:
    """float64 between the two keys at a time."""
    a, b, share = _keys_at(keys, time)
    a = a.astype(np.float64)
    return a + share * (b - a)


def between_placements(a: Array, b: Array, share: float) -> Array:
    """(n, 3, 4) a share of the way from a to b, (n, 3, 4) each: places and what stretches go
    straight, turns evenly (Shoemake, Duff 1992, Matrix animation and polar decomposition).
    Straight all of it where one is mirrored and the other not. Rows that do not change keep their
    bits.
    """
    return _Way(a, b).at(share)


class _Way:
    """From placements a to b, as `between_placements` goes."""

    def __init__(self, a: Array, b: Array) -> None:
        self._a, self._b = a, b
        alike = _mirrored(a[:, :, :3]) == _mirrored(b[:, :, :3])
        bends = alike & (a[:, :, :3] != b[:, :, :3]).any((1, 2))
        self._rows = rows = np.flatnonzero(bends & np.isfinite(b - a).all((1, 2)))
        ends = [m[rows, :, :3] for m in (a, b)]
        turns = _both_turned(ends) if len(rows) else ends
        self._stretches = [
            _product(np.swapaxes(r, 1, 2), m) for r, m in zip(turns, ends, strict=True)
        ]
        self._turns = [_quaternions(r) for r in turns]

    def at(self, share: float) -> Array:
        straight = self._a + share * (self._b - self._a)
        if not len(self._rows):
            return straight
        (first, second), (from_, to) = self._stretches, self._turns
        turned = _matrices(_slerp(from_, to, share))
        straight[self._rows, :, :3] = _product(turned, first + share * (second - first))
        return straight


def _product(a: Array, b: Array) -> Array:
    """(n, 3, 3) a b, in one order of sums on every machine."""
    return (
        a[:, :, 0, None] * b[:, None, 0]
        + a[:, :, 1, None] * b[:, None, 1]
        + a[:, :, 2, None] * b[:, None, 2]
    )


def _cofactors(m: Array) -> Array:
    x, y, z = (m[:, k] for k in range(3))
    return np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], 1)


def _determinants(m: Array) -> Array:
    terms = m[:, 0, :3] * np.cross(m[:, 1, :3], m[:, 2, :3])
    return terms[:, 0] + terms[:, 1] + terms[:, 2]


def _size(m: Array) -> Array:
    """(n, 1, 1) Frobenius norms."""
    return np.sqrt((m * m).sum((1, 2), keepdims=True))


def _volumes(m: Array) -> Array:
    """(n,) determinants of m, (n, 3, 3), made as large as 1."""
    size = _size(m)
    return _determinants(m / np.where(size > 0, size, 1.0))


def _mirrored(m: Array) -> Array:
    """(n,) bool; what is flat is not: rounding alone says which side of it is which."""
    return _volumes(m) < -_FLAT


def _turns(m: Array) -> Array:
    """(n, 3, 3) the turns of the polar decomposition of m, (n, 3, 3); of mirrored ones that of -m.
    What is flattened to a plane turns as the plane does. Higham's scaled Newton iteration (1986).
    """
    size = _size(m)
    r = m / np.where(size > 0, size, 1.0)
    r = np.where(_mirrored(m)[:, None, None], -r, r)
    # along the normal of a plane, where nothing is left to say which way it goes
    across = _cofactors(r)
    flat = np.abs(_volumes(m))[:, None, None] <= _FLAT
    r = np.where(flat, r + across / np.where(_size(across) > 0, _size(across), 1.0), r)
    for _ in range(_STEPS):
        inverse = _cofactors(r)
        volume = _determinants(r)[:, None, None]
        inverse = inverse / np.where(volume != 0, volume, 1.0)
        scale = np.sqrt(_size(inverse) / _size(r))
        following = 0.5 * (scale * r + inverse / np.where(scale > 0, scale, 1.0))
        if np.abs(following - r).max() <= 4e-16:
            break
        r = following
    return r


def _both_turned(ends: list[Array]) -> list[Array]:
    """The turns of both ends of ways; where less than a plane is left of one it turns as the
    other, and not at all where neither says.
    """
    lost = [_is_line(m) for m in ends]
    whole = [np.where(no[:, None, None], np.eye(3), m) for no, m in zip(lost, ends, strict=True)]
    turns = [_turns(m) for m in whole]
    return [
        np.where(no[:, None, None], other, own)
        for no, own, other in zip(lost, turns, reversed(turns), strict=True)
    ]


def _is_line(m: Array) -> Array:
    """(n,) bool: squashed to a line or a point."""
    return ~_cofactors(m / np.where(_size(m) > 0, _size(m), 1.0)).any((1, 2))


def _quaternions(r: Array) -> Array:
    """(n, 4) unit w, x, y, z of turns (n, 3, 3): from the column of the largest of four (Shepperd
    1978).
    """
    xx, yy, zz = r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], 1)
    x, y, z = r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]
    xy, xz, yz = r[:, 0, 1] + r[:, 1, 0], r[:, 0, 2] + r[:, 2, 0], r[:, 1, 2] + r[:, 2, 1]
    products = np.stack(
        [
            np.stack([squares[:, 0], x, y, z], 1),
            np.stack([x, squares[:, 1], xy, xz], 1),
            np.stack([y, xy, squares[:, 2], yz], 1),
            np.stack([z, xz, yz, squares[:, 3]], 1),
        ],
        1,
    )
    q = products[np.arange(len(r)), squares.argmax(1)]
    return q / np.sqrt((q * q).sum(1, keepdims=True))


def _slerp(a: Array, b: Array, share: float) -> Array:
    """(n, 4) unit, the shorter way."""
    cosine = (a * b).sum(1, keepdims=True)
    b, cosine = np.where(cosine < 0, -b, b), np.minimum(np.abs(cosine), 1.0)
    angle = np.arccos(cosine)
    sine = np.where(cosine > _NEARLY_ALIKE, 1.0, np.sin(angle))
    bent = (np.sin((1 - share) * angle) * a + np.sin(share * angle) * b) / sine
    q = np.where(cosine > _NEARLY_ALIKE, a + share * (b - a), bent)
    return q / np.sqrt((q * q).sum(1, keepdims=True))


def _matrices(q: Array) -> Array:
    """(n, 3, 3) turns of unit quaternions (n, 4)."""
    w, x, y, z = q.T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, 1) for row in rows], 1)
