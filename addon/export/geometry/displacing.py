"""Meshes as their materials displace them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....engine.displacement import Displacement, Place, displaced, normals_after
from ....engine.scene import CORNER, Mesh
from ..materials.displacing import wanted_of
from ..report import Report
from .meshes import MeshSource, flat_polygons, read_attributes, readable, vertex_normals_of

ODD = (
    "Displacements that are not finite, or go beyond 1e19, count as 0 ({}): look at the material's "
    "textures and its scale"
)


@dataclass(frozen=True, eq=False)
class Displaced:
    """How a mesh was displaced, for what it is at other times. offsets, turned: as
    `engine.displacement.Moved` has them; polygons: as `engine.displacement.displaced` takes them.
    """

    offsets: np.ndarray
    turned: np.ndarray
    polygons: np.ndarray | None

    def at(
        self, mesh: Mesh, vertices: np.ndarray, normals: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Vertices (v, 3) and the values of normals of the undisplaced mesh at another time,
        displaced alike. mesh: of the frame.
        """
        moved = (vertices + self.offsets).astype(np.float32)
        if normals is None:
            return moved, None
        then = replace(mesh, vertices=vertices)
        found = replace(mesh.normals, values=normals)
        return moved, normals_after(then, moved, found, self.turned, self.polygons).values


def displaced_source(
    data: Any,
    owner: Any,
    source: MeshSource,
    displacements: tuple[Displacement | None, ...],
    place: Place,
    report: Report,
) -> MeshSource:
    """The mesh with its vertices moved. displacements: of each material slot."""
    asking = replace(source, uv_maps={}, attributes={})
    with readable(data, owner) as mesh:
        read_attributes(mesh, asking, wanted_of(displacements), report)
        along = vertex_normals_of(mesh)
        normals = source.mesh.normals
        at_corners = normals is not None and normals.domain == CORNER
        polygons = flat_polygons(mesh, asking) if at_corners else None
    moved = displaced(asking.finished(), displacements, along, polygons, place)
    if moved.odd:
        report.note(ODD, data.name)
    return replace(
        source,
        mesh=replace(moved.mesh, corners=None, attributes=()),
        uv_maps={},
        attributes={},
        rest=source.mesh,
        displaced=Displaced(moved.offsets, moved.turned, polygons),
    )
