"""Rays against spheres, strands and polygons (notes, sections 4.7 and 4.9). Pairs are given as
arrays: ray k (o, d) against shape k.
"""

from __future__ import annotations

import numpy as np

from ..evaluation.geometry import Balls, Faces, Rods
from ..linear.columns import dot, explode, pick, transform_each

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


def meet_rod(rods: Rods, index: Array, o: Array, d: Array) -> Array:
    """(m,) parameter where the ray enters the convex hull of the spheres round both ends, NaN where
    it misses.

    The hull is both spheres and the cone between the circles in which it touches them: the first of
    the places where the ray enters one of these. Taken in the object, from the point of the ray
    nearest to the start.
    """
    inverse, radii = rods.object_from_world[index], rods.radii[:, index]
    f = transform_each(inverse, o - pick(rods.start_world, index))
    e, axis = transform_each(inverse, d), pick(rods.axis, index)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        begin = -dot(f, e) / dot(e, e)
        near = f + begin * e
        places = [
            _round_roots(near, e, radii[0])[0],
            _round_roots(near - axis, e, radii[1])[0],
            _enter_cone(near, e, axis, radii),
        ]
        first = np.fmin.reduce(places)
    return begin + first


def _enter_cone(f: Array, e: Array, axis: Array, radii: Array) -> Array:
    """(m,) parameter where f + t e, from the start of the axis, enters the cone between its two
    circles, NaN where it does not.

    With a sphere of radius r(s) = r0 - s sin α at s of the axis, the cone touches it in the plane
    z = s + r sin α, and z is sin α r0 + s cos² α. Its points are q (across the axis) with |q| cos α
    = r0 - z sin α.
    """
    length = np.sqrt(dot(axis, axis))
    u = axis / length
    sine = (radii[0] - radii[1]) / length
    square = (1 - sine) * (1 + sine)
    rise = dot(e, u)
    across = e - rise * u
    # from the ray's point nearest to the axis, so that q keeps its digits
    z = dot(f, u)
    shift = -dot(f - z * u, across) / dot(across, across)
    at = np.clip(z + shift * rise, 0, length)
    shift = np.where(rise != 0, (at - z) / rise, shift)
    f = f + shift * e
    z = dot(f, u)
    q = f - z * u
    rest = radii[0] - sine * z
    a = square * dot(across, across) - (sine * rise) ** 2
    b = square * dot(q, across) + sine * rise * rest
    c = square * dot(q, q) - rest * rest
    planes = np.stack([radii[0] * sine - z, length + radii[1] * sine - z]) / rise
    enter, leave = np.minimum(*planes), np.maximum(*planes)
    level = rise == 0
    inside = (radii[0] * sine <= z) & (z <= length + radii[1] * sine)
    enter, leave = np.where(level, -np.inf, enter), np.where(level, np.inf, leave)
    discriminant = b * b - a * c
    p = -(b + np.copysign(np.sqrt(np.maximum(discriminant, 0)), b))
    roots = np.stack([p / a, c / p])
    low, high = np.fmin(*roots), np.fmax(*roots)
    # a < 0: the ray is within both halves of the cone, and leaves one to enter the other
    met = np.where(
        a >= 0, np.maximum(low, enter), np.where(enter <= low, enter, np.maximum(high, enter))
    )
    good = (square > 0) & (met <= np.where(a >= 0, np.minimum(high, leave), leave))
    good &= (discriminant >= 0) & (~level | inside)
    return np.where(good, met + shift, np.nan)


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
