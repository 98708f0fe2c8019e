"""Where geometries stand, to the core's structures."""

from __future__ import annotations

import numpy as np

from ..cryptomatte import id_bits
from ..errors import SceneError
from ..scene import Instances
from . import core_types
from .packer import Packer, Part, table_of


def pack_instances(
    names: dict[str, int],
    how: frozenset[str],
    groups: tuple[Instances, ...],
    before: Part | None,
    changed: tuple[int, ...],
) -> Part:
    """One array of matrices and one of materials for all groups; a scene's only group lends its
    own.  how: the changed ones differ from those before.
    """
    if before is not None and how <= {"world_from_object"} and _fit(groups, before, changed):
        return _moved_instances(groups, before, changed)
    packer = Packer(names=names)
    matrices = [np.asarray(group.world_from_object) for group in groups]
    for group, rows in zip(groups, matrices, strict=True):
        if rows.ndim != 3 or rows.shape[1:] != (3, 4):
            raise SceneError(
                f"{group.name}: world_from_object has the shape {rows.shape}: (any, 3, 4) is needed"
            )
    joined = (
        matrices[0]
        if len(matrices) == 1
        else np.concatenate(matrices)
        if matrices
        else np.empty((0, 3, 4))
    )
    joined = packer.lend(joined, np.float64, (None, 3, 4), "world_from_object")
    slots = packer.lend(
        [number for group in groups for number in group.materials], np.uint32, (None,), "materials"
    )
    first_rows = np.cumsum([0] + [len(rows) for rows in matrices])
    first_slots = np.cumsum([0] + [len(group.materials) for group in groups])
    entries = [
        _group(*entry)
        for entry in zip(groups, first_rows, map(len, matrices), first_slots, strict=False)
    ]
    tables = {
        "instances": table_of(core_types.InstancesData, entries),
        "world_from_object": joined,
        "material_slots": slots,
        **_instance_values(packer, groups, first_rows),
    }
    return Part(groups, tables, packer.lent)


def _instance_values(
    packer: Packer, groups: tuple[Instances, ...], first_rows: np.ndarray
) -> dict[str, np.ndarray]:
    """Every name that some group gives a value, and its rows for all placements, zeros for those
    that have none.
    """
    used = list(dict.fromkeys(name for group in groups for name in group.values))
    values = np.zeros((len(used), first_rows[-1], 4), np.float32)
    for group, first in zip(groups, first_rows, strict=False):
        for name, rows in group.values.items():
            packer.lend(
                rows, np.float32, (len(group.world_from_object), 4), f"{group.name}: {name}"
            )
            values[used.index(name), first : first + len(rows)] = rows
    return {
        "instance_value_names": np.array([packer.name(name) for name in used], np.int32),
        "instance_values": values,
    }


def _fit(groups: tuple[Instances, ...], before: Part, changed: tuple[int, ...]) -> bool:
    """Whether as many rows were there before."""
    counts = before.tables["instances"]["row_count"]
    return all(np.shape(groups[k].world_from_object) == (counts[k], 3, 4) for k in changed)


def _moved_instances(groups: tuple[Instances, ...], before: Part, changed: tuple[int, ...]) -> Part:
    matrices = before.tables["world_from_object"].copy()
    first_rows = before.tables["instances"]["first_row"]
    for k in changed:
        first = int(first_rows[k])
        matrices[first : first + len(groups[k].world_from_object)] = groups[k].world_from_object
    return Part(groups, {**before.tables, "world_from_object": matrices}, before.lent)


_CAMERA, _MIRROR, _SHADOW, _HOLDOUT, _CATCHER, _TRANSMISSION, _DIFFUSE = (
    flag.value for flag in core_types.InstanceFlags
)


def _group(group: Instances, first_row: int, row_count: int, first_slot: int) -> tuple:
    flags = (
        _CAMERA * group.visible_camera
        | _MIRROR * group.visible_mirror
        | _SHADOW * group.visible_shadow
        | _TRANSMISSION * group.visible_transmission
        | _DIFFUSE * group.visible_diffuse
        | _HOLDOUT * group.holdout
        | _CATCHER * group.catcher
    )
    name = id_bits(group.name)
    return (
        first_row,
        row_count,
        group.geometry,
        flags,
        first_slot,
        len(group.materials),
        group.object_index,
        group.light_set,
        name,
        id_bits(group.asset) if group.asset else name,
        1 + group.light_group,
        0,
        group.geometry_offset,
        group.shading_offset,
    )
