"""What makes geometries, and where they stand, unfit to render."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .checks import (
    Found,
    array,
    at_least,
    below,
    finite_array,
    handle,
    holds,
    key_values,
    one_of,
    whole,
)
from .light_problems import links
from .model import Scene
from .model_geometry import (
    CORNER,
    FACE,
    MOST_SETS,
    POINT,
    Attribute,
    Instances,
    Mesh,
    Polygons,
    Spheres,
    Strands,
)


def geometry_problems(geometry: Any) -> Found:
    checks: dict[type, Callable[[Any], Found]] = {
        Mesh: _mesh,
        Spheres: _spheres,
        Polygons: _polygons,
        Strands: _strands,
    }
    yield from next(check for kind, check in checks.items() if isinstance(geometry, kind))(geometry)


def _mesh(mesh: Mesh) -> Found:
    shapes = [
        *array("vertices", mesh.vertices, np.float32, (None, 3)),
        *array("triangles", mesh.triangles, np.uint32, (None, 3)),
    ]
    yield from shapes
    if shapes:
        return
    yield from below("triangles", mesh.triangles, len(mesh.vertices), "vertices")
    yield from _slots(mesh.material_slots, len(mesh.triangles), "triangle")
    if mesh.corners is not None:
        yield from array("corners", mesh.corners, np.uint32, mesh.triangles.shape)
    yield from _attributes(mesh)
    if mesh.motion is not None:
        yield from key_values("motion", mesh.motion, np.float32, mesh.vertices.shape)
    if mesh.normal_motion is not None:
        if mesh.motion is None or not isinstance(mesh.normals, Attribute):
            yield "normal_motion is there without motion or normals: give both, or None"
            return
        yield from key_values(
            "normal_motion", mesh.normal_motion, np.float32, mesh.normals.values.shape
        )


def _slots(slots: np.ndarray | None, count: int, primitive: str) -> Found:
    if slots is None:
        return
    for text in array("material_slots", slots, np.uint16, (count,)):
        yield f"{text}, one for each {primitive}"


def _attributes(mesh: Mesh) -> Found:
    rows = {POINT: len(mesh.vertices), CORNER: _corner_rows(mesh), FACE: len(mesh.triangles)}
    strangers = [*holds("attributes", mesh.attributes, (Attribute,))]
    strangers += holds("normals", () if mesh.normals is None else (mesh.normals,), (Attribute,))
    yield from strangers
    if strangers:
        return
    if mesh.normals is not None:
        yield from one_of("the domain of normals", mesh.normals.domain, (POINT, CORNER))
        yield from _attribute("normals", mesh.normals, rows, (3,))
    yield from _named(mesh.attributes, rows)


def _named(attributes: tuple[Attribute, ...], rows: Mapping[str, int | None]) -> Found:
    names = [attribute.name for attribute in attributes]
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"has several attributes called {name!r}: give each a name of its own"
    for attribute in attributes:
        yield from _attribute(f"attribute {attribute.name!r}", attribute, rows, (2, 3, 4))


def _corner_rows(mesh: Mesh) -> int | None:
    """How many rows a CORNER attribute must have at least; None without usable corners."""
    corners = mesh.corners
    if corners is None or not isinstance(corners, np.ndarray) or corners.dtype != np.uint32:
        return None
    return int(corners.max()) + 1 if corners.size else 0


def _attribute(
    name: str, attribute: Attribute, rows: Mapping[str, int | None], columns: tuple[int, ...]
) -> Found:
    shapes = [
        *one_of(f"the domain of {name}", attribute.domain, tuple(rows)),
        *array(name, attribute.values, np.float32, (None, None)),
    ]
    yield from shapes
    if shapes:
        return
    count, width = attribute.values.shape
    if width not in columns:
        yield f"{name} has {width} columns: use {' or '.join(map(str, columns))}"
    needed = rows[attribute.domain]
    if needed is None:
        yield f"{name} is on corners and the mesh has none: give Mesh.corners"
    elif count != needed and (attribute.domain != CORNER or count < needed):
        yield f"{name} has {count} rows on {attribute.domain}: use {needed}"
    yield from finite_array(name, attribute.values)


def _spheres(spheres: Spheres) -> Found:
    shapes = [*array("centers", spheres.centers, np.float32, (None, 3))]
    yield from shapes
    if shapes:
        return
    count = len(spheres.centers)
    yield from _radii(spheres.radii, count)
    yield from _slots(spheres.material_slots, count, "sphere")
    strangers = [*holds("attributes", spheres.attributes, (Attribute,))]
    yield from strangers or _named(spheres.attributes, {FACE: count})
    yield from _moving(spheres, spheres.centers.shape)


def _radii(radii: np.ndarray, count: int) -> Found:
    yield from array("radii", radii, np.float32, (count,))
    if isinstance(radii, np.ndarray) and np.any(radii < 0):
        yield "radii has a negative value: use 0 or more"


def _strands(strands: Strands) -> Found:
    shapes = [
        *array("vertices", strands.vertices, np.float32, (None, 3)),
        *array("starts", strands.starts, np.uint32, (None,)),
    ]
    yield from shapes
    if shapes:
        return
    count = len(strands.vertices)
    yield from _radii(strands.radii, count)
    yield from below("starts", strands.starts, max(count - 1, 0), "vertices before the last")
    yield from _slots(strands.material_slots, len(strands.starts), "segment")
    rows = {POINT: count, FACE: len(strands.starts)}
    strangers = [*holds("attributes", strands.attributes, (Attribute,))]
    yield from strangers
    yield from () if strangers else _named(strands.attributes, rows)
    for attribute in () if strangers else strands.attributes:
        if attribute.motion is not None:
            name = f"motion of attribute {attribute.name!r}"
            found = [*key_values(name, attribute.motion, np.float32, attribute.values.shape)]
            yield from found or finite_array(name, attribute.motion)
    yield from _moving(strands, strands.vertices.shape)


def _moving(geometry: Spheres | Strands, shape: tuple[int, ...]) -> Found:
    if geometry.motion is not None:
        yield from key_values("motion", geometry.motion, np.float32, shape)
    if geometry.radius_motion is not None:
        if geometry.motion is None:
            yield "radius_motion is there without motion: give both, or None"
        yield from key_values("radius_motion", geometry.radius_motion, np.float32, shape[:1])


def _polygons(polygons: Polygons) -> Found:
    shapes = [
        *array("vertices", polygons.vertices, np.float32, (None, 3)),
        *array("offsets", polygons.offsets, np.uint32, (None,)),
        *array("indices", polygons.indices, np.uint32, (None,)),
    ]
    yield from shapes
    if shapes:
        return
    yield from _offsets(polygons.offsets, len(polygons.indices))
    yield from below("indices", polygons.indices, len(polygons.vertices), "vertices")
    yield from _slots(polygons.material_slots, max(len(polygons.offsets) - 1, 0), "polygon")


def _offsets(offsets: np.ndarray, count: int) -> Found:
    if len(offsets) == 0 or offsets[0] != 0 or offsets[-1] != count:
        yield f"offsets runs not from 0 to the {count} indices: start at 0 and end there"
        return
    corners = np.diff(offsets.astype(np.int64))
    if np.any(corners < 0):
        yield f"offsets falls after polygon {int(np.argmax(corners < 0))}: keep it rising"
    elif np.any(corners < 3):
        k = int(np.argmax(corners < 3))
        yield f"polygon {k} has {corners[k]} corners: use at least 3"


def worth_asking(groups: Sequence[Instances]) -> Sequence[Instances]:
    """All of them; but where all matrices are sound, one of those that differ in names and matrices
    alone. A file of 50 000 objects has as many groups, and to ask each takes longer than to trace
    them.
    """
    if {getattr(group.world_from_object, "dtype", None) for group in groups} != {
        np.dtype(np.float64)
    }:
        return groups
    if {group.world_from_object.shape[1:] for group in groups} != {(3, 4)} or {
        type(group.materials) for group in groups
    } != {tuple}:
        return groups
    if not np.isfinite(np.concatenate([group.world_from_object for group in groups])).all():
        return groups
    return list({_kind(group): group for group in reversed(groups)}.values())[::-1]


def _kind(group: Instances) -> tuple:
    """What `instance_problems` looks at but for the matrices, with the types: 1.0 equals 1 and is
    no index.
    """
    links = group.receivers, group.blockers
    offsets = group.geometry_offset, group.shading_offset
    numbers = group.geometry, group.object_index, group.light_set, *links
    values = (*numbers, *offsets, *group.materials)
    special = group.values or group.motion is not None
    return values, tuple(map(type, values)), id(group) if special else 0


def instance_problems(scene: Scene, instances: Instances) -> Found:
    yield from handle("geometry", instances.geometry, len(scene.geometries), "geometries")
    shapes = [*array("world_from_object", instances.world_from_object, np.float64, (None, 3, 4))]
    yield from shapes or finite_array("world_from_object", instances.world_from_object)
    if instances.motion is not None and not shapes:
        yield from key_values(
            "motion", instances.motion, np.float64, instances.world_from_object.shape
        )
    if not isinstance(instances.materials, (tuple, list, np.ndarray)):
        yield f"materials is {instances.materials!r}: use a tuple of whole numbers"
        return
    for material in instances.materials:
        yield from handle("a material", material, len(scene.materials), "materials")
    yield from whole("object_index", instances.object_index)
    yield from handle("light_set", instances.light_set, MOST_SETS, "sets")
    yield from links(instances)
    yield from at_least("geometry_offset", instances.geometry_offset, 0.0)
    yield from at_least("shading_offset", instances.shading_offset, 0.0, 1.0)
    for name, values in instances.values.items():
        found = [*array(f"value {name!r}", values, np.float32, (None, 4))]
        yield from found or finite_array(f"value {name!r}", values)
        if not found and not shapes and len(values) != len(instances.world_from_object):
            yield (
                f"value {name!r} has {len(values)} rows: use {len(instances.world_from_object)}, "
                "one a placement"
            )
