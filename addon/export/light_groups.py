"""Light groups of a view layer: names, and which of them a thing's light is of."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from .report import Report

MOST = 64
"""Groups that the engine tells apart."""


class Members(NamedTuple):
    """names: of the groups. inside: names of things with their group's. world: the group's of the
    world.
    """

    names: tuple[str, ...] = ()
    inside: tuple[tuple[str, str], ...] = ()
    world: str = ""


NO_MEMBERS = Members()


class LightGroups:
    """Those of one view layer, none where nobody asks."""

    def __init__(self, names: tuple[str, ...] = ()) -> None:
        self.names = names
        self._numbers = {name: number for number, name in enumerate(names)}

    @classmethod
    def of(cls, view_layer: Any, report: Report | None = None) -> LightGroups:
        """The first groups of a view layer; the others are told."""
        names = [group.name for group in view_layer.lightgroups]
        for name in names[MOST:]:
            if report is not None:
                report.note(
                    f"A view layer has the passes of at most {MOST} light groups: "
                    "{} have none; move them to another view layer",
                    name,
                )
        return cls(tuple(names[:MOST]))

    def members(self, world: Any, things: Iterable[Any]) -> Members:
        """Equal as long as the same things, and the world (None for none), are in the same groups;
        no update tells of these.
        """
        inside = [(thing.name_full, thing.lightgroup) for thing in things if thing.lightgroup]
        return Members(self.names, tuple(inside), world.lightgroup if world is not None else "")

    def number(self, thing: Any) -> int:
        """Of the group that an object's or a world's own light is in; -1 for none, and for one that
        the view layer has not. Evaluated ones are not told of a new group at once.
        """
        if not self.names or thing is None:
            return -1
        return self._numbers.get(thing.original.lightgroup, -1)
