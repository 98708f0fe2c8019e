"""Attributes that geometry nodes give to instances, which Attribute nodes of the type Instancer
read.

Blender tells of an instance the numbers by which it was made (`persistent_id`, the innermost
first): the place of an object in a collection, the id of an instance in a geometry set, and so on
inwards.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .geometry.meshes import sound, values_as_color, values_of
from .report import Report

_NO_ID = 2**31 - 1
"""What Blender pads the numbers of an instance with."""


class InstanceAttributes:
    """Looks attributes up by instance. Holds evaluated objects: for one export."""

    def __init__(self, depsgraph: Any, report: Report) -> None:
        self._report = report
        self._ids = np.zeros((len(depsgraph.object_instances), 8), np.int32)
        if len(self._ids):
            depsgraph.object_instances.foreach_get("persistent_id", self._ids.reshape(-1))

    def overlay(self, name: str, instancer: Any, numbers: np.ndarray, values: np.ndarray) -> None:
        """Put the attribute `name` over `values`, (k, 4) float32, of the instances with these
        (k,) numbers in the iteration of the depsgraph, where they have it; of nested instances the
        innermost that has. instancer: the evaluated object that the iteration calls their parent.
        """
        ids = self._ids[numbers]
        depths = (ids != _NO_ID).sum(1)
        for depth in np.unique(depths):
            rows = np.flatnonzero(depths == depth)
            path = ids[rows, :depth][:, ::-1]  # the outermost first
            self._of_object(name, instancer, path, rows, values)

    def _of_object(
        self, name: str, thing: Any, path: np.ndarray, rows: np.ndarray, values: np.ndarray
    ) -> None:
        """Of what `thing` instances, by the numbers on the path (k, depth) to each."""
        if path.shape[1] == 0:
            return
        if thing.instance_type == "COLLECTION" and thing.instance_collection is not None:
            members = thing.instance_collection.all_objects
            for number in np.unique(path[:, 0]):
                chosen = path[:, 0] == number
                if 0 <= number < len(members):
                    self._of_object(
                        name, members[int(number)], path[chosen, 1:], rows[chosen], values
                    )
        elif not _has_nodes(thing):
            return
        elif not hasattr(thing, "evaluated_geometry"):
            self._report.note(
                "This Blender does not tell attributes of instances: {} show none; use Blender 4.5 "
                "or later, or Realize Instances",
                thing.name,
            )
        else:
            self._of_set(name, thing.name, _geometry_of(thing), path, rows, values)

    def _of_set(
        self,
        name: str,
        home: str,
        geometry: Any,
        path: np.ndarray,
        rows: np.ndarray,
        values: np.ndarray,
    ) -> None:
        """Of the instances in a geometry set, and of those in them. home: whose set it is."""
        points = geometry.instances_pointcloud() if geometry is not None else None
        if points is None or path.shape[1] == 0:
            return
        at = _found(path[:, 0], _unique_ids(points))
        references = geometry.instance_references()
        index = points.attributes[".reference_index"]
        reference = np.empty(len(index.data), np.int32)
        index.data.foreach_get("value", reference)
        for number in np.unique(reference[at[at >= 0]]):
            inner = references[number] if 0 <= number < len(references) else None
            chosen = np.flatnonzero((at >= 0) & (reference[at] == number))
            if path.shape[1] == 1 and type(inner).__name__ != "Object":
                continue  # a part of the set itself
            attribute = points.attributes.get(name)
            found = values_of(attribute) if attribute is not None else None
            if found is not None:
                found = sound(found, name, home, self._report)
                values[rows[chosen]] = values_as_color(found, grey=False)[at[chosen]]
            deeper = path[chosen, 1:], rows[chosen], values
            if type(inner).__name__ == "GeometrySet":
                self._of_set(name, home, inner, *deeper)
            elif type(inner).__name__ == "Object":
                self._of_object(name, inner, *deeper)


def _has_nodes(thing: Any) -> bool:
    return any(modifier.type == "NODES" for modifier in thing.modifiers)


def _geometry_of(thing: Any) -> Any:
    """Its geometry set; None of what has none."""
    try:
        return thing.evaluated_geometry()
    except (RuntimeError, TypeError):
        return None


def _unique_ids(points: Any) -> np.ndarray:
    """(n,) int64: the number by which Blender calls each instance of a set: its id, where it has
    one, else its place. What repeats an id gets another, here none of int32.
    """
    attribute = points.attributes.get("id")
    if attribute is None or attribute.data_type != "INT":
        return np.arange(len(points.points), dtype=np.int64)
    ids = np.empty(len(attribute.data), np.int32)
    attribute.data.foreach_get("value", ids)
    first = np.zeros(len(ids), bool)
    first[np.unique(ids, return_index=True)[1]] = True
    return np.where(first, ids.astype(np.int64), 2**40 + np.arange(len(ids)))


def _found(wanted: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """(k,) intp: where each wanted id is among (n,) ids, which are all different. What Blender
    numbered anew stands, in its order, for those that repeat an id; -1 where there is nothing left.
    """
    order = np.argsort(ids, kind="stable")
    place = np.minimum(np.searchsorted(ids[order], wanted), len(ids) - 1)
    at = np.where(ids[order][place] == wanted, order[place], -1) if len(ids) else wanted * 0 - 1
    lost = at < 0
    if lost.any():
        repeats = np.flatnonzero(ids >= 2**40)
        new, first, inverse = np.unique(wanted[lost], return_index=True, return_inverse=True)
        rank = np.empty(len(new), np.intp)
        rank[np.argsort(first)] = np.arange(len(new))
        at[lost] = np.append(repeats, np.full(len(new), -1))[rank][inverse]
    return at
