"""What can be said of placed geometry before a ray is traced: what is squashed to a line, and
whether the camera faces anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from ...engine import affine_inverse, determinant, pixel_bounds_of_box
from ...engine.scene import (
    EVERYTHING,
    Camera,
    Geometry,
    Instances,
    Material,
    Scene,
    Spheres,
    Strands,
)
from .camera import inverse_axes
from .report import Report

_NEARLY_SINGULAR = 1e-6
"""Share of the largest entry's cube below which a determinant is worth a singular value
decomposition.
"""

_FEW = 1000
"""Points of a geometry, about, that are tried before all of them are."""

_FIRST = 16
"""Geometries of which single points are tried before boxes are."""


def without_collapsed(instances: tuple[Instances, ...], report: Report) -> tuple[Instances, ...]:
    """Without the placements that are no surface any more, nor at any key of their motion: matrices
    of rank 0 or 1 squash everything to a line or a point.
    """
    kept = []
    matrices = [block.world_from_object for block in instances]
    surfaces = are_surfaces(np.concatenate([np.zeros((0, 3, 4)), *matrices]))
    if surfaces.all():
        return instances
    ends = np.cumsum([len(rows) for rows in matrices], dtype=np.intp)
    for block, surface in zip(instances, np.split(surfaces, ends[:-1]), strict=False):
        if block.motion is not None and not surface.all():
            surface = surface | np.any([are_surfaces(key) for key in block.motion], 0)
        if not surface.all():
            report.note(
                "Objects whose scale leaves no surface (0, or vastly unequal) are left out: {}; "
                "scale two axes alike",
                block.name,
            )
            block = replace(
                block,
                world_from_object=block.world_from_object[surface],
                values={name: rows[surface] for name, rows in block.values.items()},
                motion=block.motion[:, surface] if block.motion is not None else None,
            )
        if surface.any():
            kept.append(block)
    return tuple(kept)


def are_surfaces(matrices: np.ndarray) -> np.ndarray:
    """(n,) bool: which of these placements (n, 3, 4) `without_collapsed` leaves."""
    return _ranks(matrices[:, :, :3]) >= 2


def without_unplaced(
    instances: tuple[Instances, ...], count: int
) -> tuple[tuple[Instances, ...], list[int]]:
    """The instances with their geometries numbered anew, without those of `count` that none of
    them has, and the old numbers of those that are left.
    """
    placed = {block.geometry for block in instances}
    if len(placed) == count:
        return instances, list(range(count))
    kept = sorted(placed)
    numbers = {old: new for new, old in enumerate(kept)}
    return tuple(replace(b, geometry=numbers[b.geometry]) for b in instances), kept


def note_placed(scene: Scene, camera_name: str, report: Report) -> None:
    """Say what of the things of a scene is not shown as it is."""
    instances, materials = scene.instances, scene.materials
    note_empty_view(scene.camera, scene.geometries, instances, report, camera_name)
    note_catchers(instances, materials, report)
    note_linked_glow(instances, materials, report)
    note_media(instances, materials, report)
    note_hair_shaders(instances, scene.geometries, materials, report)


def note_catchers(
    instances: tuple[Instances, ...], materials: Sequence[Material], report: Report
) -> None:
    """Say which materials of shadow catchers do what a catcher does not show."""
    for block in instances:
        if not block.catcher or block.holdout:
            continue
        kinds = {kind for k in block.materials for kind in _kinds(materials[k])}
        if not kinds.isdisjoint({"MIRROR", "REFRACTION"}):
            report.note(
                "Shadow catchers show no reflections, and nothing through glass: {}; render what "
                "they mirror in a view layer of its own",
                block.name,
            )
        if "EMISSION" in kinds:
            report.note("Shadow catchers that glow light nothing: {}; put a lamp there", block.name)


def _kinds(material: Material) -> set[str]:
    """Of its lobes; EMISSION where its medium glows."""
    glows = material.medium is not None and material.medium.emits
    return {lobe.kind for lobe in material.lobes} | ({"EMISSION"} if glows else set())


def note_linked_glow(
    instances: tuple[Instances, ...], materials: Sequence[Material], report: Report
) -> None:
    """Say what of the light links of what glows is not in mirrors and glass."""
    linked = [block for block in instances if block.receivers != EVERYTHING]
    if not linked:
        return
    kinds = list(map(_kinds, materials))
    worn = {k for block in instances for k in block.materials}
    mirrors = any(not kinds[k].isdisjoint({"MIRROR", "REFRACTION"}) for k in worn)
    for block in linked if mirrors else ():
        shown = block.visible_mirror or block.visible_transmission
        if shown and any("EMISSION" in kinds[k] for k in block.materials):
            report.note(
                "Mirrors and glass show what glows also where its light linking leaves them out: "
                "{}; turn off Glossy and Transmission in its Ray Visibility to hide it from all",
                block.name,
            )


def note_media(
    instances: tuple[Instances, ...], materials: tuple[Material, ...], report: Report
) -> None:
    """Say which things have several media inside, of which the first fills all of them."""
    if len({material.medium for material in materials} - {None}) < 2:
        return
    for block in instances:
        media = {materials[k].medium for k in block.materials} - {None}
        if len(media) > 1:
            report.note(
                "Several volumes in one object are not rendered: the first of its materials that "
                "has one fills all of {}; make parts of it objects of their own",
                block.name,
            )


def note_hair_shaders(
    instances: tuple[Instances, ...],
    geometries: tuple[Geometry, ...],
    materials: tuple[Material, ...],
    report: Report,
) -> None:
    """Say which things have faces with shaders of hair."""
    hairy = [any(lobe.fibre_output >= 0 for lobe in material.lobes) for material in materials]
    if not any(hairy):
        return
    for block in instances:
        geometry = geometries[block.geometry]
        if isinstance(geometry, Strands) or not any(hairy[k] for k in block.materials):
            continue
        slots = geometry.material_slots
        worn = (0,) if slots is None else np.unique(slots)
        if any(hairy[block.materials[min(int(k), len(block.materials) - 1)]] for k in worn):
            report.note(
                "Hair shaders are matt under a highlight on what is no strand: {} shows no light "
                "that passes through",
                block.name,
            )


def _ranks(linear: np.ndarray) -> np.ndarray:
    """(k,) of the (k, 3, 3) matrices, by the SVD (notes, section 6.5) where the determinant leaves
    a doubt.
    """
    size = np.abs(linear).max((1, 2))
    unit = linear / np.where(size > 0, size, 1.0)[:, None, None]
    doubtful = np.abs(determinant(unit)) < _NEARLY_SINGULAR
    ranks = np.full(len(linear), 3)
    if doubtful.any():
        placement = np.concatenate([unit[doubtful], np.zeros((doubtful.sum(), 3, 1))], 2)
        ranks[doubtful] = affine_inverse(placement).rank
    return ranks


def note_empty_view(
    camera: Camera,
    geometries: tuple[Geometry, ...],
    instances: tuple[Instances, ...],
    report: Report,
    name: str,
) -> None:
    """Say so when the box round everything that the camera, called `name`, may see projects beside
    the frame (notes, section 7.5). Through a lens things beside the frame may be seen, and in a
    panorama nothing has to be ahead.
    """
    if camera.lens is not None or camera.eye is not None or camera.kind == "PANORAMA":
        return
    seen = (
        (geometries[block.geometry], block.world_from_object)
        for block in instances
        if block.visible_camera
    )
    seen = ((geometry, matrices) for geometry, matrices in seen if len(_points(geometry)))
    first = list(islice(seen, _FIRST))
    if any(
        shows_a_point(geometry, matrix, camera)
        for geometry, matrices in first
        for matrix in _some(matrices, 2)
    ):
        return
    seen = [*first, *seen]
    # Where the box round a few vertices reaches the frame, the box round all of them does.
    if seen and not (_may_be_seen(seen, camera, _FEW) or _may_be_seen(seen, camera, None)):
        report.note(
            "The camera ({}) sees no object: all of them are beside the frame, behind it or "
            "outside its clip distances",
            name,
        )


def _points(geometry: Geometry) -> np.ndarray:
    return geometry.centers if isinstance(geometry, Spheres) else geometry.vertices


def shows_a_point(geometry: Geometry, world_from_object: np.ndarray, camera: Camera) -> bool:
    """Whether one of a few vertices or centres is in the frame: so the usual scene is told in a
    tenth of the time that boxes take.
    """
    with np.errstate(invalid="ignore"):
        placed = (
            _some(_points(geometry), _FEW).astype(np.float64) @ world_from_object[:, :3].T
            + world_from_object[:, 3]
        )
        x, y, z = (
            inverse_axes(camera.world_from_camera[:, :3])
            @ (placed - camera.world_from_camera[:, 3]).T
        )
        left, right, bottom, top = camera.window
        width = np.where(z < 0, -z, np.nan) if camera.kind == "PERSPECTIVE" else 1.0
        inside = (x - left * width) * (x - right * width) <= 0
        inside &= (y - bottom * width) * (y - top * width) <= 0
        return bool((inside & (-z >= camera.clip_start) & (-z <= camera.clip_end)).any())


def _some(points: np.ndarray, count: int) -> np.ndarray:
    """About `count` of (k, …) points or placements, evenly picked."""
    return points[:: max(1, len(points) // count)]


def _may_be_seen(
    placed: list[tuple[Geometry, np.ndarray]], camera: Camera, count: int | None
) -> bool:
    """Whether the box round `count` points of each geometry, or round all for None, reaches the
    frame.
    """
    boxes = np.array([_world_box(geometry, matrices, count) for geometry, matrices in placed])
    return pixel_bounds_of_box(boxes[:, 0].min(0), boxes[:, 1].max(0), camera) is not None


def _world_box(geometry: Geometry, matrices: np.ndarray, count: int | None) -> np.ndarray:
    """(2, 3): low and high corner of all placements of one geometry; NaN where a vertex is, which
    counts as everywhere.
    """
    points = _points(geometry)
    low, high = _extent(points if count is None else _some(points, count))
    if isinstance(geometry, Spheres | Strands):
        low, high = low - geometry.radii.max(), high + geometry.radii.max()
    with np.errstate(invalid="ignore"):
        middle, half = (low + high) / 2, (high - low) / 2
        center = matrices[:, :, :3] @ middle + matrices[:, :, 3]
        reach = np.abs(matrices[:, :, :3]) @ half
        return np.stack([(center - reach).min(0), (center + reach).max(0)])


def _extent(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Componentwise smallest and largest of (k, 3) float32, as float64; in rows of 1000 points,
    which NumPy reduces 50 times faster.
    """
    long = len(points) // 1000 * 1000
    rows = points[:long].reshape(-1, 3000)
    low = np.concatenate([rows.min(0).reshape(-1, 3), points[long:]]) if long else points
    high = np.concatenate([rows.max(0).reshape(-1, 3), points[long:]]) if long else points
    return low.min(0).astype(np.float64), high.max(0).astype(np.float64)
