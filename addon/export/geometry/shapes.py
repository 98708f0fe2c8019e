"""Meshes that are marked to true spheres."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....engine.scene import Spheres
from ..report import Report
from .meshes import MeshSource, read_mesh, readable, vertices_of

SPHERE_MARK = "glint_sphere"
"""An attribute of meshes that stand for one true sphere, true on all of their faces. Custom
properties are lost in modifiers.
"""
_ROUND = 0.01
"""How far vertices of a marked mesh may lie below the sphere, of its radius."""


def mark_sphere(mesh: Any, on: bool = True) -> None:
    """Makes a mesh data-block stand for a true sphere, or for itself. Not in edit mode, where
    Blender sets no attributes.
    """
    mark = mesh.attributes.get(SPHERE_MARK)
    if mark is not None:
        mesh.attributes.remove(mark)
    if on:
        mark = mesh.attributes.new(SPHERE_MARK, "BOOLEAN", "FACE")
        mark.data.foreach_set("value", np.ones(len(mesh.polygons), bool))
    mesh.update_tag()


def read_shape(data: Any, owner: Any, report: Report) -> MeshSource | Spheres | None:
    """An evaluated mesh of an object: a sphere where all of its faces are marked; None without
    faces.
    """
    with readable(data, owner) as mesh:
        return marked_sphere(mesh, report) or read_mesh(mesh, report)


def marked_sphere(mesh: Any, report: Report) -> Spheres | None:
    """The sphere that an evaluated mesh stands for; None where it stands for itself."""
    return _sphere_round(mesh, report) if _is_marked(mesh) else None


def _is_marked(mesh: Any) -> bool:
    mark = mesh.attributes.get(SPHERE_MARK)
    if mark is None or (mark.data_type, mark.domain) != ("BOOLEAN", "FACE"):
        return False
    values = np.zeros(len(mark.data), bool)
    mark.data.foreach_get("value", values)
    return len(values) > 0 and bool(values.all())


def _sphere_round(mesh: Any, report: Report) -> Spheres | None:
    """The sphere through a mesh's vertices round the middle of their box; None, and a note, where
    they lie on none.
    """
    vertices = vertices_of(mesh).astype(np.float64)
    center = (vertices.min(0) + vertices.max(0)) / 2
    with np.errstate(all="ignore"):
        distances = np.sqrt(((vertices - center) ** 2).sum(1))
    radius = np.float32(distances.max())
    if not (np.isfinite(radius) and radius > 0 and distances.min() >= (1 - _ROUND) * radius):
        report.note(
            "Meshes marked as true spheres whose vertices lie on no sphere are rendered as they "
            "are: {}",
            mesh.name,
        )
        return None
    return Spheres(mesh.name, center[None].astype(np.float32), np.array([radius], np.float32))
