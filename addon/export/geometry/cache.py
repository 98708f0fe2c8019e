"""Geometries as they were read, from one export to the next."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from ....engine.scene import Geometry
from ..materials.required import RequiredAttributes
from ..report import Report
from .meshes import MeshSource
from .points import PointSource
from .strands import StrandSource

Source = MeshSource | StrandSource | PointSource
Requirements = tuple[RequiredAttributes, ...]


class ShapeKey(NamedTuple):
    """Equal for the same shape. kind: what reads it.  of: all that tells it from others of the
    kind.
    """

    kind: str
    of: tuple


@dataclass
class Shape:
    """What was read of a geometry.

    geometry: as it was read first; None where there is nothing.  about: the uids of the objects
    that were met with it, of each of which Blender tells when its data change. The data of an
    original object may point at nothing after an undo.  states: with its attributes after each
    sequence of requirements.  report: of reading it.
    """

    geometry: Source | Geometry | None
    about: set[int] = field(default_factory=set)
    states: dict[Requirements, Source] = field(default_factory=dict)
    finished: dict[Requirements, Geometry] = field(default_factory=dict)
    report: Report = field(default_factory=Report)

    def read_attributes(
        self, before: Requirements, requirements: Requirements, read: Callable[[Source], None]
    ) -> None:
        """Has `read` add attributes to the state of `before`, then that of `requirements`."""
        if requirements not in self.states:
            source = self.states.get(before, self.geometry)
            own = {"uv_maps": dict(source.uv_maps), "attributes": dict(source.attributes)}
            self.states[requirements] = replace(source, **own)
            read(self.states[requirements])

    def as_required(self, requirements: Requirements) -> Geometry:
        """The geometry with the attributes of these requirements, the very same for the same."""
        if not isinstance(self.geometry, Source):
            return self.geometry
        if requirements not in self.finished:
            self.finished[requirements] = self.states.get(requirements, self.geometry).finished()
        return self.finished[requirements]


class ShapeCache:
    """The shapes that views met last."""

    def __init__(self) -> None:
        self._met: dict[tuple, dict[ShapeKey, Shape]] = {}

    def shape(self, key: ShapeKey) -> Shape | None:
        """As some view met it."""
        return next((met[key] for met in self._met.values() if key in met), None)

    def keep(self, asked: tuple, met: dict[ShapeKey, Shape]) -> None:
        """What a view met."""
        self._met[asked] = met

    def keep_views(self, asked: Iterable[tuple]) -> None:
        """Drop the shapes of views that are gone."""
        self._met = {key: self._met[key] for key in asked}

    def keep_about(self, there: set[int]) -> None:
        """Drop what is about anything else: its addresses may be those of others now."""
        for asked, met in self._met.items():
            self._met[asked] = {key: shape for key, shape in met.items() if shape.about <= there}

    def forget(self, changed: set[int]) -> None:
        """Drop what is about these objects."""
        for asked, met in self._met.items():
            self._met[asked] = {
                key: shape for key, shape in met.items() if not shape.about & changed
            }
