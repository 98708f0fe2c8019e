"""Point clouds to true spheres, and what materials read of their points."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....engine.scene import FACE, Attribute, Spheres
from ..materials.required import RequiredAttributes
from ..report import Report
from ..shader_nodes.reader import GENERATED, LACKS, POINT_PLACE, POINT_SHAPE
from .hashing import random_of
from .meshes import GREY, sound, values_as_color, values_of

DEFAULT_RADIUS = 0.01
"""Blender's radius of points without one, object units."""


@dataclass(frozen=True, eq=False)
class PointSource:
    """Spheres with what was read of their points."""

    spheres: Spheres
    uv_maps: dict[str, Attribute] = field(default_factory=dict)
    attributes: dict[str, Attribute] = field(default_factory=dict)

    def finished(self) -> Spheres:
        """The spheres with the attributes they were asked for."""
        named = {**self.uv_maps, **self.attributes}
        return replace(self.spheres, attributes=tuple(named.values()))


def read_points(cloud: Any) -> PointSource | None:
    """An evaluated PointCloud data-block; None without points."""
    spheres = export_points(cloud)
    return None if spheres is None else PointSource(spheres)


def export_points(cloud: Any) -> Spheres | None:
    """An evaluated PointCloud data-block as spheres with material slot 0; None without points."""
    centers = np.empty((len(cloud.points), 3), np.float32)
    if len(centers) == 0:
        return None
    cloud.attributes["position"].data.foreach_get("vector", centers.reshape(-1))
    radii = np.full(len(centers), DEFAULT_RADIUS, np.float32)
    radius = cloud.attributes.get("radius")
    if radius is not None:
        radius.data.foreach_get("value", radii)
    return Spheres(cloud.name, centers, radii)


def read_point_attributes(
    cloud: Any, source: PointSource, required: RequiredAttributes, report: Report
) -> None:
    """Add what `required` names and `source` lacks, a row a point. Names that there are not are
    left out: they read as 0. One name stands for a map and a colour.
    """
    known = {**source.uv_maps, **source.attributes}
    for name in sorted((required.attributes | required.uv_maps) - known.keys()):
        values = _values(cloud, source.spheres, name, report)
        if values is not None:
            source.attributes[name] = Attribute(name, FACE, values)


def _values(cloud: Any, spheres: Spheres, name: str, report: Report) -> np.ndarray | None:
    if name in (GENERATED, POINT_PLACE):
        return values_as_color(_finite(spheres.centers), grey=False)
    if name == POINT_SHAPE:
        number = np.arange(len(spheres.radii), dtype=np.uint32)
        random = random_of(number, np.zeros_like(number))
        return values_as_color(_finite(np.column_stack([spheres.radii, random])), grey=False)
    if name.startswith(LACKS):
        lacks = _values(cloud, spheres, name.removeprefix(LACKS), report) is None
        return np.ones((len(spheres.radii), 4), np.float32) if lacks else None
    plain = name.removeprefix(GREY)
    attribute = cloud.attributes.get(plain) if plain else None
    values = values_of(attribute) if attribute is not None else None
    if values is None:
        return None
    values = sound(values, plain, cloud.name, report)
    return values_as_color(values, grey=name != plain)


def _finite(values: np.ndarray) -> np.ndarray:
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)
