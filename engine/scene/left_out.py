"""What the core leaves out of a scene, in sentences that name the things and what to do about
them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields

import numpy as np

from ..program.program import Program
from .model import Array, Scene
from .model_geometry import Geometry, Instances, Polygons, Spheres, Strands
from .model_lights import Light

NAMES = 3
"""As many things of a kind are named."""

_BLOCK = 1 << 16
"""Faces that are looked at in one go: most broken meshes are found without reading them to their
end.
"""

_THIN = 1e-12
"""Of the product of two lengths: an area below is none."""


def sentences(scene: Scene, stats: Mapping[str, float]) -> Iterator[str]:
    """One for each kind of thing that `Film.stats` counts as dropped. Looks for names only where
    there are some.
    """
    if count := int(stats["dropped primitives"]):
        yield (
            f"{count} faces, spheres, strands or polygons{_of(_bad_geometry(scene))} have no "
            "extent or a coordinate that is not finite, and are "
            "left out: repair the mesh (Mesh > Clean Up in edit mode)"
        )
    if count := int(stats["dropped instances"]):
        yield (
            f"{count} instances{_of(_bad_instances(scene))} have a matrix that is not finite or "
            "leaves no surface (scales of 0, "
            "or vastly unequal), and are left out: scale two axes alike"
        )
    if count := int(stats["dropped lights"]):
        names = (light.name for light in scene.lights if not _finite(light))
        yield (
            f"{count} lights{_of(names)} have a number that is not finite, and are left out: "
            "set "
            "it anew"
        )


def _of(names: Iterator[str]) -> str:
    """Such as " of 'A', 'B', 'C' and 2 more": each name once; empty where nobody is known."""
    unique = [*dict.fromkeys(names)]
    shown = ", ".join(repr(name) for name in unique[:NAMES])
    more = f" and {len(unique) - NAMES} more" if len(unique) > NAMES else ""
    return f" of {shown}{more}" if unique else ""


def _bad_geometry(scene: Scene) -> Iterator[str]:
    """Names of what has such a primitive, or else of what is flattened: its faces may stand on edge
    then.
    """
    used = {block.geometry for block in scene.instances}
    bad = {number for number in used if _has_bad(scene.geometries[number])}
    for block in scene.instances:
        if block.geometry in bad or (not bad and _flattens(block)):
            yield block.name


def _flattens(block: Instances) -> bool:
    with np.errstate(invalid="ignore"):
        x, y, z = _unit_columns(block)
    return bool((np.abs(np.sum(x * np.cross(y, z), 1)) <= _THIN).any())


def _unit_columns(block: Instances) -> list[Array]:
    """Three (k, 3), as long as their largest component is 1; or 0."""
    m = np.asarray(block.world_from_object, np.float64)
    return [_scaled(m[:, :, k]) for k in range(3)]


def _scaled(v: Array) -> Array:
    size = np.abs(v).max(1, keepdims=True)
    return v / np.where(size > 0, size, 1)


def _has_bad(geometry: Geometry) -> bool:
    if isinstance(geometry, Spheres):
        return not (
            np.isfinite(geometry.centers).all()
            and (np.isfinite(geometry.radii) & (geometry.radii > 0)).all()
        )
    if isinstance(geometry, Strands):
        return not sound_segments(geometry).all()
    if isinstance(geometry, Polygons):
        return bool(_flat_polygons(geometry).any())
    blocks = (
        geometry.triangles[first : first + _BLOCK]
        for first in range(0, len(geometry.triangles), _BLOCK)
    )
    return any(_flat(geometry.vertices[block].astype(np.float64)).any() for block in blocks)


def sound_segments(strands: Strands) -> Array:
    """(n,) bool: finite, and with a radius at one end at least."""
    radii = strands.radii
    with np.errstate(invalid="ignore"):
        good = np.isfinite(strands.vertices).all(1) & np.isfinite(radii) & (radii >= 0)
    first = strands.starts.astype(np.intp)
    return good[first] & good[first + 1] & ((radii[first] > 0) | (radii[first + 1] > 0))


def _flat(triangles: Array) -> Array:
    """(n,) bool: no area worth the name, or a corner that is not finite, of (n, 3, 3) float64."""
    with np.errstate(over="ignore", invalid="ignore"):
        a, b = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        return ~_spans(a, b)


def _flat_polygons(polygons: Polygons) -> Array:
    """(p,) bool, likewise, by Newell's normals."""
    first = polygons.offsets[:-1].astype(np.intp)
    corners = polygons.vertices[polygons.indices].astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        # 0 at the first corner
        arms = corners - np.repeat(corners[first], np.diff(polygons.offsets.astype(np.intp)), 0)
        turns = np.cross(arms, np.roll(arms, -1, 0))
        size = np.maximum.reduceat(np.abs(arms).max(1), first)
        return ~(np.abs(np.add.reduceat(turns, first)).max(1) > _THIN * size**2)


def _spans(a: Array, b: Array) -> Array:
    """(n,) bool: whether two (n, 3) vectors span an area. False for NaN."""
    return np.abs(np.cross(_scaled(a), _scaled(b))).max(1) > _THIN


def _bad_instances(scene: Scene) -> Iterator[str]:
    for block in scene.instances:
        with np.errstate(over="ignore", invalid="ignore"):
            x, y, z = _unit_columns(block)
            sound = np.isfinite(block.world_from_object).all((1, 2)) & (
                _spans(x, y) | _spans(y, z) | _spans(z, x)
            )
        if not sound.all():
            yield block.name


def _finite(light: Light) -> bool:
    values = (getattr(light, field.name) for field in fields(light) if field.name != "textures")
    return all(
        np.isfinite(value).all() for value in values if not isinstance(value, str | Program | None)
    )
