"""Lights that rays see directly: spheres, the disc of a sun in the sky, rectangles and ellipses."""

from __future__ import annotations

import numpy as np

from ..linear.columns import dot, length
from .lights import HUGE, Source

Array = np.ndarray


def seen_radiance(
    source: Source, o: Array, d: Array, near: Array, depth: Array, kind: str
) -> Array:
    """(3, n): what rays o + t d (d need not be unit) of a kind, "camera" or "mirror", see of the
    light's shape with near < t < depth; infinite depth is the sky.
    """
    light = source.light
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = _MEETS[light.kind](source, o, d)
        reached = (t > near) & ((t < depth) | (np.isinf(t) & np.isinf(depth)))
        share = source.along(d / length(d))
        if light.kind == "SPOT":
            share = np.where(source.is_around(o), 1.0, share)
    radiance = np.where(reached, share, 0.0) * _radiance(source)[:, None]
    if source.emission is None:
        return radiance
    end = None if light.kind == "SUN" else _seen_point(source, o, d, np.where(reached, t, 0.0))
    return radiance * source.emission.seen(source, o, d / length(d), end, kind)


def distance_seen(source: Source, o: Array, d: Array) -> Array:
    """(n,) t at which rays o + t d meet the light's shape, 0 where they miss it."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = _MEETS[source.light.kind](source, o, d)
    return np.where(np.isnan(t), 0.0, t)


def _seen_point(source: Source, o: Array, d: Array, t: Array) -> Array:
    """(3, n) where the light's program is asked what rays see: a light of soft falloff is a disc
    there, that faces the ray's origin.
    """
    to = source.position - o
    if source.light.kind != "AREA" and source.light.soft_falloff:
        along = dot(d, to)
        t = np.where(along > 0, dot(to, to) / np.where(along > 0, along, 1.0), t)
    return o + t * d


def has_shape(source: Source) -> bool:
    """Whether there is anything to see: the world shows a DOME light, surfaces those of others."""
    return source.light.kind in _MEETS and _shape(source) > 0


def _shape(source: Source) -> float:
    """The s of radiance = c / s."""
    light = source.light
    if light.kind == "SUN":
        return np.pi * np.sin(light.angle / 2) ** 2
    if light.kind == "AREA":
        return (
            np.pi * light.size_x * light.size_y * (np.pi / 4 if light.shape == "ELLIPSE" else 1.0)
        )
    return 4 * np.pi**2 * light.radius**2


def _radiance(source: Source) -> Array:
    return np.clip(source.color / _shape(source), -HUGE, HUGE) if source.physical else source.color


def _meets_ball(source: Source, o: Array, d: Array) -> Array:
    """The first t > 0 on the sphere; NaN for a miss."""
    f = source.position - o
    a, b = dot(d, d), dot(f, d)
    off = f - (b / a) * d
    root = np.sqrt(source.light.radius**2 - dot(off, off)) / np.sqrt(a)
    return np.where(dot(f, f) > source.light.radius**2, b / a - root, b / a + root)


def _meets_sun(source: Source, _: Array, d: Array) -> Array:
    """Infinite within the disc, NaN outside."""
    off = d / length(d) + source.axis
    return np.where(dot(off, off) / 2 <= 2 * np.sin(source.light.angle / 4) ** 2, np.inf, np.nan)


def _meets_area(source: Source, o: Array, d: Array) -> Array:
    """t on the front of the rectangle or ellipse; NaN for a miss."""
    facing = dot(d, source.axis)
    t = dot(source.position - o, source.axis) / facing
    q = o + t * d - source.position
    a, b = (
        dot(q, source.right) / dot(source.right, source.right),
        dot(q, source.up) / dot(source.up, source.up),
    )
    inside = (
        (np.abs(a) <= 1) & (np.abs(b) <= 1)
        if source.light.shape == "RECTANGLE"
        else a * a + b * b <= 1
    )
    return np.where(inside & (facing < 0), t, np.nan)


_MEETS = {"AREA": _meets_area, "SUN": _meets_sun, "POINT": _meets_ball, "SPOT": _meets_ball}
