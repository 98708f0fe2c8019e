"""The surfaces that queries of an `Accelerator` met, worked out as pictures have them, without the
rest of their scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING

import numpy as np

from ..accelerator import Hits
from ..program.program import instructions
from ..program.table import BY_NAME
from ..scene import (
    Attribute,
    Camera,
    Geometry,
    Instances,
    Material,
    Mesh,
    Polygons,
    Scene,
    Spheres,
    Strands,
)

if TYPE_CHECKING:
    from ..reference.coefficients import Coefficients
    from ..reference.surface import Surface

Array = np.ndarray

TOGETHER = 1 << 16
"""Placements times what is met on them, in one block."""


_LIKENESS = attrgetter(
    "geometry",
    "visible_camera",
    "visible_mirror",
    "visible_shadow",
    "visible_transmission",
    "visible_diffuse",
    "light_set",
    "catcher",
    "shading_offset",
)
"""Of blocks: what says whether and how light meets them, but for materials and values."""


def joined(instances: Sequence[Instances]) -> tuple[Instances, ...]:
    """The same placements in as few blocks as differ in more than what passes tell: each where its
    first one is. A file of 50 000 objects has as many blocks.
    """
    alike: dict[tuple, list[Instances]] = {}
    for block in instances:
        key = (_LIKENESS(block), tuple(block.materials), frozenset(block.values))
        alike.setdefault(key, []).append(block)
    return tuple(
        replace(
            blocks[0],
            world_from_object=np.concatenate([b.world_from_object for b in blocks]),
            values={
                name: np.concatenate([b.values[name] for b in blocks]) for name in blocks[0].values
            },
            motion=None,
        )
        for blocks in alike.values()
    )


def met_surfaces(
    scene: Scene, origin: Array, o: Array, d: Array, hits: Hits
) -> tuple[Array, Surface, Coefficients, Array, Array]:
    """Which of the rays from o in the directions d (3, n) met something, (m,), the surface there,
    its lobes, its light_set (m,) and whether it is a shadow catcher, (m,) bool. o and the surface
    count from the origin (3,), which is the camera of programs.
    """
    from ..reference.attributes import Attributes
    from ..reference.cancellation import Cancellation
    from ..reference.geometry import gather
    from ..reference.materials import Shader
    from ..reference.rays import IncoherentRays
    from ..reference.surface import surface_at
    from ..reference.terminator import lowered
    from ..reference.vectors import dot

    hit = np.flatnonzero(hits.instance >= 0)
    placement, row = np.unique(hits.instance[hit], return_inverse=True)
    some, row, local = _only(scene, origin, placement, row, hits.primitive[hit])
    geometry, cancellation = gather(some, origin), Cancellation(lambda: False)
    # primitives are numbered anew, and those that cannot be drawn have no number
    keys = geometry.row.astype(np.int64) << 32 | geometry.primitive_of(np.arange(geometry.count))
    order = np.argsort(keys, kind="stable")
    wanted = row.astype(np.int64) << 32 | local
    at = np.minimum(np.searchsorted(keys[order], wanted), max(len(keys) - 1, 0))
    known = np.flatnonzero(keys[order][at] == wanted) if len(keys) else np.zeros(0, np.intp)
    hit, primitive = hit[known], order[at[known]] if len(keys) else at[known]
    rays = IncoherentRays.of(o[:, hit], d[:, hit], np.zeros(len(hit)), np.full(len(hit), np.inf))
    attributes = Attributes(some)
    depth = hits.t[hit].astype(np.float64)
    surface = surface_at(
        geometry, attributes, rays, np.arange(len(hit)), primitive, depth, cancellation
    )
    shader = Shader(some, attributes, geometry)
    block_of = geometry.placements.block
    block = block_of[surface.row]
    sets = np.array([block.light_set for block in some.instances], np.intp)[block]
    caught = np.array([block.catcher for block in some.instances], bool)[block]
    lobes = shader.coefficients(surface, "scattered")
    if any(_knows_its_ray(material) for material in some.materials):
        towards_light = shader.coefficients(surface, "shadow")
        lobes = replace(lobes, transparent=towards_light.transparent)
    hair = [isinstance(some.geometries[block.geometry], Strands) for block in some.instances]
    # strands stand closer together than points can tell apart: they would be specks
    varnished = np.maximum(lobes.ambient - lobes.translucent, 0.0)
    matt = lobes.diffuse + lobes.thrown_on(surface)
    given = np.where(_is_varnished(some, surface), varnished, matt)
    given = given * lowered(surface.lowering, dot(surface.n, surface.v))
    is_hair = np.array(hair, bool)[block]
    lobes = replace(
        lobes,
        diffuse=np.where(is_hair, 0.0, given),
        translucent=np.where(is_hair, 0.0, lobes.translucent),
    )
    return hit, surface, lobes, sets, caught


def _is_varnished(scene: Scene, surface: Surface) -> Array:
    """(m,) bool: where rough gloss lies on something matt. It throws light on as well, if to other
    sides; AMBIENT lobes of such materials say how much both do for light from one direction.
    """
    varnished = [
        any((x.is_glossy and x.fresnel) or x.kind == "TOON_SPECULAR" for x in material.lobes)
        and any(lobe.kind == "AMBIENT" for lobe in material.lobes)
        for material in scene.materials
    ]
    return np.array(varnished, bool)[surface.material]


def _knows_its_ray(material: Material) -> bool:
    """Whether it may let other rays pass when they go towards a light."""
    program = material.program
    return program is not None and any(
        step.operation is BY_NAME["light_path"] for step in instructions(program)
    )


def _only(
    scene: Scene, origin: Array, placements: Array, row: Array, primitive: Array
) -> tuple[Scene, Array, Array]:
    """The scene of the placements (k,) with none but the primitives (m,) of the placements in rows
    `row` (m,) of these and some that they stand beside; the new row of each, and its new number.
    """
    ends = np.cumsum([len(block.world_from_object) for block in scene.instances])
    new_row, local = np.zeros(len(row), np.intp), np.zeros(len(primitive), np.intp)
    geometries: list[Geometry] = []
    instances: list[Instances] = []
    rows = 0
    order = np.argsort(row, kind="stable")
    bounds = np.searchsorted(row[order], np.arange(len(placements) + 1))
    blocks = np.searchsorted(ends, placements, "right")
    for first, end in _parts(blocks, bounds):
        mine = order[bounds[first] : bounds[end]]
        kept, local[mine] = np.unique(primitive[mine], return_inverse=True)
        new_row[mine] = rows + row[mine] - first
        block = scene.instances[blocks[first]]
        at = placements[first:end] - (ends[blocks[first]] - len(block.world_from_object))
        values = {name: given[at] for name, given in block.values.items()}
        matrices = block.world_from_object[at]
        instances.append(
            replace(
                block,
                geometry=len(geometries),
                world_from_object=matrices,
                values=values,
                motion=None,
            )
        )
        geometries.append(_some(scene.geometries[block.geometry], kept))
        rows += end - first
    camera = Camera(
        "PERSPECTIVE", np.column_stack([np.eye(3), origin]), (-1.0, 1.0, -1.0, 1.0), (1, 1)
    )
    some = replace(
        scene, camera=camera, geometries=tuple(geometries), instances=tuple(instances), lights=()
    )
    return some, new_row, local


def _parts(blocks: Array, bounds: Array) -> Iterator[tuple[int, int]]:
    """From which to which placement one block of instances holds them: they are of the same block,
    and as each shows the primitives that any of them needs, not so many that these are many more
    than are needed. blocks: (k,) of each placement, rising.  bounds: (k + 1,) of what each needs.
    """
    first = 0
    while first < len(blocks):
        end = int(np.searchsorted(blocks, blocks[first], "right"))
        while end - first > 1 and (end - first) * (bounds[end] - bounds[first]) > TOGETHER:
            end = first + (end - first) // 2
        yield first, end
        first = end


def _some(geometry: Geometry, kept: Array) -> Geometry:
    """The primitives `kept` (k,) of a geometry."""
    slots = geometry.material_slots
    slots = None if slots is None else slots[kept]
    if isinstance(geometry, Spheres):
        return replace(
            geometry,
            centers=geometry.centers[kept],
            radii=geometry.radii[kept],
            material_slots=slots,
            attributes=tuple(replace(a, values=a.values[kept]) for a in geometry.attributes),
        )
    if isinstance(geometry, Strands):
        return _some_segments(geometry, kept, slots)
    if isinstance(geometry, Polygons):
        rows = [geometry.indices[geometry.offsets[k] : geometry.offsets[k + 1]] for k in kept]
        used, index = np.unique(np.concatenate(rows), return_inverse=True)
        offsets = np.concatenate([[0], np.cumsum([len(r) for r in rows])]).astype(np.uint32)
        return replace(
            geometry,
            vertices=geometry.vertices[used],
            offsets=offsets,
            indices=index.astype(np.uint32),
            material_slots=slots,
        )
    return _some_triangles(geometry, kept, slots)


def _some_segments(strands: Strands, kept: Array, slots: Array | None) -> Strands:
    """Each with two vertices of its own: it ends at the row after the one where it begins."""
    points = strands.ends[kept][:, :2].ravel()
    rows = {"POINT": points, "FACE": kept}
    return replace(
        strands,
        vertices=strands.vertices[points],
        radii=strands.radii[points],
        starts=2 * np.arange(len(kept), dtype=np.uint32),
        material_slots=slots,
        attributes=tuple(replace(a, values=a.values[rows[a.domain]]) for a in strands.attributes),
    )


def _some_triangles(mesh: Mesh, kept: Array, slots: Array | None) -> Mesh:
    vertices, triangles = np.unique(mesh.triangles[kept], return_inverse=True)
    corner_rows, corners = np.unique(
        (mesh.triangles if mesh.corners is None else mesh.corners)[kept], return_inverse=True
    )
    rows = {"POINT": vertices, "CORNER": corner_rows, "FACE": kept}

    def some(attribute: Attribute) -> Attribute:
        return replace(attribute, values=attribute.values[rows[attribute.domain]])

    return replace(
        mesh,
        vertices=mesh.vertices[vertices],
        triangles=triangles.reshape(-1, 3).astype(np.uint32),
        corners=None if mesh.corners is None else corners.reshape(-1, 3).astype(np.uint32),
        material_slots=slots,
        normals=None if mesh.normals is None else some(mesh.normals),
        attributes=tuple(map(some, mesh.attributes)),
    )
