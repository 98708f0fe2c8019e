"""Rays against spheres and polygons (notes, sections 4.7 and 4.9). Pairs are given as arrays: ray k
(o, d) against shape k.
"""

from __future__ import annotations

import numpy as np

from .geometry import Balls, Faces
from .vectors import dot, explode, pick, transform_each

Array = np.ndarray


def meet_ball(balls: Balls, index: Array, o: Array, d: Array) -> Array:
    """(2, m) parameters of both roots, nearer first, NaN where the ray misses.

    The ray is taken into the object, where the sphere is round; then Haines' form (Ray Tracing
    Gems, chapter 7): the discriminant from the distance of the centre to the ray, and the smaller
    root without cancellation.
    """
    inverse, radius = balls.object_from_world[index], balls.radius[index]
    f = transform_each(inverse, o - pick(balls.center_world, index))
    e = transform_each(inverse, d)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return _round_roots(f, e, radius)


def _round_roots(f: Array, e: Array, radius: Array) -> Array:
    a, b = dot(e, e), -dot(f, e)
    off = f + (b / a) * e
    discriminant = radius * radius - dot(off, off)
    q = b + np.copysign(np.sqrt(np.where(discriminant >= 0, a * discriminant, np.nan)), b)
    first, second = (dot(f, f) - radius * radius) / q, q / a
    return np.stack([np.minimum(first, second), np.maximum(first, second)])


def meet_face(faces: Faces, index: Array, o: Array, d: Array) -> Array:
    """(m,) parameter t = (p1 − o)·n / d·n of the polygon's plane where the odd-even rule says
    inside, NaN elsewhere.
    """
    n, first = pick(faces.normal, index), pick(faces.corners, faces.start[index])
    with np.errstate(divide="ignore", invalid="ignore"):
        t = dot(first - o, n) / dot(d, n)
    t = np.where(np.isfinite(t), t, np.nan)
    drop = np.abs(n).argmax(0)
    hit = o + t * d
    return np.where(_is_odd(faces, index, drop, hit), t, np.nan)


def _is_odd(faces: Faces, index: Array, drop: Array, hit: Array) -> Array:
    """Whether a ray along the first kept axis from `hit` crosses the boundary an odd number of
    times; `drop` is the axis left out.
    """
    sizes = np.diff(faces.start)[index]
    pair, place = explode(sizes)
    start = faces.start[index][pair]
    here, following = start + place, start + (place + 1) % sizes[pair]
    i, j = (drop[pair] + 1) % 3, (drop[pair] + 2) % 3
    au, av, bu, bv = (faces.corners[axis, k] for k in (here, following) for axis in (i, j))
    pu, pv = hit[i, pair], hit[j, pair]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = au + (pv - av) / (bv - av) * (bu - au)
    crosses = ((av > pv) != (bv > pv)) & (pu < crossing)
    return np.bincount(pair[crosses], minlength=len(index)) % 2 == 1
