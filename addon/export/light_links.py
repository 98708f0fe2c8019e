"""Light and shadow linking: which objects a light lights, and which cast shadows in it (Blender's
panels of these names), as sets of objects.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from ...engine.scene import EVERYTHING, MOST_SETS
from .report import Report


def receivers_of(light: Any) -> Any:
    """The collection of what an original object lights, None for all."""
    linking = getattr(light, "light_linking", None)
    return linking.receiver_collection if linking is not None else None


def blockers_of(light: Any) -> Any:
    """The collection of what casts shadows in an original object's light, None for all."""
    linking = getattr(light, "light_linking", None)
    return linking.blocker_collection if linking is not None else None


def rendered_objects(depsgraph: Any) -> Iterator[Any]:
    """The original objects of a view layer and those of the scene's background sets."""
    yield from depsgraph.view_layer.objects
    background = depsgraph.scene.background_set
    while background is not None:
        yield from background.objects
        background = background.background_set


class LightLinks:
    """The sets of objects that a picture shows. Objects that the same lights reach, and that shade
    the same ones, are one set.
    """

    def __init__(self, objects: Iterable[Any], report: Report) -> None:
        """objects: originals."""
        objects = list(objects)
        self._linked = _linked(objects)
        found = (collection for pair in self._linked.values() for collection in pair)
        members = {c.session_uid: _Members(c) for c in found if c is not None}
        self._rows = {uid: row for row, uid in enumerate(members)}
        self._sets: dict[int, int] = {}
        self._kinds: dict[tuple[bool, ...], int] = {(True,) * len(members): 0}
        for thing in objects if members else ():
            kind = tuple(m.has(thing.session_uid) for m in members.values())
            if kind not in self._kinds and len(self._kinds) == MOST_SETS:
                report.note(
                    "Light linking knows {} sets of objects that the same lights reach: all lights "
                    "reach {}, which cast shadows in all",
                    MOST_SETS,
                    thing.name,
                )
                continue
            self._sets[thing.session_uid] = self._kinds.setdefault(kind, len(self._kinds))

    def set_of(self, thing: Any) -> int:
        """Of an original object, or of the one that places it."""
        return self._sets.get(thing.session_uid, 0) if self._sets else 0

    def lit_by(self, thing: Any) -> int:
        """The sets that an original object lights, a bit each."""
        return self._sets_in(thing, 0)

    def shaded_by(self, thing: Any) -> int:
        """The sets that cast shadows in an original object's light, a bit each."""
        return self._sets_in(thing, 1)

    def _sets_in(self, thing: Any, which: int) -> int:
        if not self._linked or thing.session_uid not in self._linked:
            return EVERYTHING
        collection = self._linked[thing.session_uid][which]
        if collection is None:
            return EVERYTHING
        row = self._rows[collection.session_uid]
        return sum(1 << number for kind, number in self._kinds.items() if kind[row])


def _linked(objects: Iterable[Any]) -> dict[int, tuple[Any, Any]]:
    """Of those that light but some, or have shadows of some, the two collections by session uid:
    asked for once each, as there may be many.
    """
    linked = {}
    for thing in objects:
        linking = getattr(thing, "light_linking", None)
        if linking is None:
            continue
        receivers, blockers = linking.receiver_collection, linking.blocker_collection
        if receivers is not None or blockers is not None:
            linked[thing.session_uid] = receivers, blockers
    return linked


class _Members:
    """The objects of a collection: those that are in it, or all but those that it excludes where it
    includes none.
    """

    def __init__(self, collection: Any) -> None:
        self._included: set[int] = set()
        self._excluded: set[int] = set()
        for thing, place in zip(collection.objects, collection.collection_objects, strict=True):
            self._add((thing,), place)
        for child, place in zip(collection.children, collection.collection_children, strict=True):
            self._add(child.all_objects, place)

    def _add(self, things: Iterable[Any], place: Any) -> None:
        is_in = place.light_linking.link_state == "INCLUDE"
        (self._included if is_in else self._excluded).update(t.session_uid for t in things)

    def has(self, uid: int) -> bool:
        return uid not in self._excluded and (not self._included or uid in self._included)
