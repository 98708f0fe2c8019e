"""Geometries to the core's structures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import SceneError
from ..scene import Attribute, Geometry, Mesh, Polygons, Spheres, Strands
from . import core_types
from .packer import Packer, Part, address, number, table_of


class PackedGeometry:
    """A geometry's row, whose attributes are counted from 0, and theirs."""

    def __init__(self, geometry: Geometry, names: dict[str, int]) -> None:
        packer = Packer(names=names)
        self.row = _geometry(packer, geometry)
        self.attributes, self.lent = packer.attributes, packer.lent


def patched_geometries(
    geometries: tuple[Geometry, ...], before: Part, fresh: dict[int, PackedGeometry]
) -> Part:
    """The tables with other rows for geometries that have as many attributes as those in their
    places had.
    """
    tables = {name: table.copy() for name, table in before.tables.items()}
    lent = list(before.lent)
    for k, packed in fresh.items():
        first = int(tables["geometries"]["first_attribute"][k])
        tables["geometries"][k] = packed.row
        tables["geometries"]["first_attribute"][k] = first
        tables["attributes"][first : first + len(packed.attributes)] = table_of(
            core_types.AttributeData, packed.attributes
        )
        lent[k] = packed.lent
    return Part(geometries, tables, lent)


def _geometry(packer: Packer, geometry: Geometry) -> tuple:
    packs: dict[type, Callable[[Packer, Any], dict[str, Any]]]
    packs = {Mesh: _mesh, Spheres: _spheres, Polygons: _polygons, Strands: _strands}
    if type(geometry) not in packs:
        raise SceneError(f"{type(geometry).__name__} is no geometry")
    values: dict[str, Any]
    values = dict.fromkeys((name for name, *_ in core_types.GeometryData._fields_), 0)
    values.update(normals=_NO_ATTRIBUTE, first_attribute=len(packer.attributes))
    values.update(packs[type(geometry)](packer, geometry))
    slots, what = (values["primitive_count"],), f"{geometry.name}: material_slots"
    values["material_slots"] = packer.optional(geometry.material_slots, np.uint16, slots, what)
    return tuple(values.values())


_NO_ATTRIBUTE = (0, 0, 0, 0, 0, 0)


def _mesh(packer: Packer, mesh: Mesh) -> dict[str, Any]:
    vertices = packer.lend(mesh.vertices, np.float32, (None, 3), f"{mesh.name}: vertices")
    triangles = packer.lend(mesh.triangles, np.uint32, (None, 3), f"{mesh.name}: triangles")
    corners = packer.optional(mesh.corners, np.uint32, triangles.shape, f"{mesh.name}: corners")
    normals = _NO_ATTRIBUTE if mesh.normals is None else _attribute(packer, mesh, mesh.normals)
    packer.attributes.extend([_attribute(packer, mesh, attribute) for attribute in mesh.attributes])
    return {
        "vertices": address(vertices),
        "triangles": address(triangles),
        "corners": corners,
        "vertex_count": len(vertices),
        "primitive_count": len(triangles),
        "normals": normals,
        "attribute_count": len(mesh.attributes),
        "kind": core_types.GeometryKind.MESH,
    }


def _attribute(packer: Packer, mesh: Mesh | Strands | Spheres, attribute: Attribute) -> tuple:
    values = packer.lend(
        attribute.values, np.float32, (None, None), f"{mesh.name}: attribute {attribute.name!r}"
    )
    domain = number(attribute.domain, core_types.Domain, "attribute domain")
    return (address(values), len(values), packer.name(attribute.name), domain, values.shape[1], 0)


def _spheres(packer: Packer, spheres: Spheres) -> dict[str, Any]:
    centers = packer.lend(spheres.centers, np.float32, (None, 3), f"{spheres.name}: centers")
    radii = packer.lend(spheres.radii, np.float32, (len(centers),), f"{spheres.name}: radii")
    packer.attributes.extend([_attribute(packer, spheres, a) for a in spheres.attributes])
    count = len(centers)
    return {
        "vertices": address(centers),
        "radii": address(radii),
        "vertex_count": count,
        "primitive_count": count,
        "attribute_count": len(spheres.attributes),
        "kind": core_types.GeometryKind.SPHERES,
    }


def _strands(packer: Packer, strands: Strands) -> dict[str, Any]:
    vertices = packer.lend(strands.vertices, np.float32, (None, 3), f"{strands.name}: vertices")
    radii = packer.lend(strands.radii, np.float32, (len(vertices),), f"{strands.name}: radii")
    starts = packer.lend(strands.starts, np.uint32, (None,), f"{strands.name}: starts")
    packer.attributes.extend([_attribute(packer, strands, a) for a in strands.attributes])
    ends = None
    if strands.attributes:
        ends = packer.lend(strands.ends, np.uint32, (len(starts), 3), f"{strands.name}: ends")
    return {
        "vertices": address(vertices),
        "triangles": 0 if ends is None else address(ends),
        "radii": address(radii),
        "indices": address(starts),
        "vertex_count": len(vertices),
        "primitive_count": len(starts),
        "index_count": len(starts),
        "attribute_count": len(strands.attributes),
        "kind": core_types.GeometryKind.STRANDS,
    }


def _polygons(packer: Packer, polygons: Polygons) -> dict[str, Any]:
    vertices = packer.lend(polygons.vertices, np.float32, (None, 3), f"{polygons.name}: vertices")
    offsets = packer.lend(polygons.offsets, np.uint32, (None,), f"{polygons.name}: offsets")
    indices = packer.lend(polygons.indices, np.uint32, (None,), f"{polygons.name}: indices")
    if len(offsets) < 1:
        raise SceneError(f"{polygons.name}: offsets is empty, it starts with 0")
    return {
        "vertices": address(vertices),
        "offsets": address(offsets),
        "indices": address(indices),
        "vertex_count": len(vertices),
        "primitive_count": len(offsets) - 1,
        "index_count": len(indices),
        "kind": core_types.GeometryKind.POLYGONS,
    }
