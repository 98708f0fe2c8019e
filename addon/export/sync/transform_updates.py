"""Objects that moved and lamps that changed, in a scene that is known: then nothing else has to be
walked over.

Blender lists every object whose transform was evaluated anew, those that follow another by
parenting or constraints as well. What is animated it lists as shaded anew in every frame, since any
of an object's settings may be.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ....engine.scene import EVERYTHING, Instances, Light, Scene
from ..geometry.displacing import Displaced
from ..instances import ExportedObject, VisitedObjects, flags_of
from ..light_links import blockers_of, receivers_of
from ..lights import Lights
from ..placing import without_collapsed
from ..properties import sound, value_of
from ..report import Report

_SAY_NOTHING = ("ACTION", "CAMERA")
"""What these do to things is told as updates of the things; a scene's camera is read by itself."""
_BARE = {"EMPTY", "ARMATURE", "CAMERA", "LATTICE", "SPEAKER", "LIGHT_PROBE"}
"""Kinds of objects that show nothing unless they instance."""


@dataclass
class _Place:
    """Numbers of an object's groups and lights in the scene."""

    instances: list[int] = field(default_factory=list)
    lights: list[int] = field(default_factory=list)


class SceneIndex:
    """A scene, and where in it the things are that stand there by themselves, once each."""

    def __init__(
        self,
        scene: Scene,
        visited: VisitedObjects,
        sources: tuple = (),
        report: Report | None = None,
        displaced: Mapping[int, Displaced] = MappingProxyType({}),
    ) -> None:
        """sources: what the scene's materials were made from, for whoever makes them anew.  report:
        of all but them.  displaced: as `Export` has it.
        """
        self.scene, self.sources, self.report, self._visited = (
            scene,
            sources,
            report or Report(),
            visited,
        )
        self.displaced = displaced
        self._places: dict[int, _Place | None] = {}
        self._links_glow = any(
            block.receivers & block.blockers != EVERYTHING for block in scene.instances
        )

    def place_instances(self, thing: ExportedObject, number: int | None) -> None:
        """The group of a thing; None for a thing that is not in the scene as it is."""
        self._place(thing, number, lambda place: place.instances)

    def place_light(self, thing: ExportedObject, number: int | None) -> None:
        self._place(thing, number, lambda place: place.lights)

    def _place(self, thing: ExportedObject, number: int | None, numbers: Any) -> None:
        place = self._places.setdefault(thing.uid, _Place())
        if (
            number is None
            or place is None
            or len(thing.matrices) != 1
            or thing.uid in self._visited.instancing
        ):
            self._places[thing.uid] = None
        else:
            numbers(place).append(number)

    def follow(self, updates: list[Any], depsgraph: Any, images: Any) -> bool:
        """Takes `depsgraph.updates` into the scene; False, with the scene as it was, where more
        changed than these numbers tell, or nothing at all is said.

        images: for lamps with nodes.
        """
        instances, lights = list(self.scene.instances), list(self.scene.lights)
        lamps = {update.id.data for update in updates if _is_lamp(update)}
        told = [
            update
            for update in updates
            if not (update.id.id_type == "LIGHT" and update.id in lamps)
        ]
        heard = [update for update in told if update.id.id_type not in _SAY_NOTHING]
        if told and not heard:
            return True
        told = heard
        if not told or self._is_linked(told):
            return False
        if not all(self._apply(update, instances, lights, depsgraph, images) for update in told):
            return False
        self.scene = replace(self.scene, instances=tuple(instances), lights=tuple(lights))
        return True

    def _is_linked(self, updates: list[Any]) -> bool:
        """Whether lights light but some objects, or have shadows of some, or begin to: any edit may
        change which.
        """
        linked = self._links_glow or any(
            light.receivers & light.blockers != EVERYTHING for light in self.scene.lights
        )
        return linked or any(
            of(update.id.original) is not None
            for update in updates
            if update.id.id_type == "OBJECT"
            for of in (receivers_of, blockers_of)
        )

    def stands(self, updates: list[Any], depsgraph: Any) -> bool:
        """Whether objects of which these updates say only that they are shaded anew are seen as
        before.
        """
        things = [update.id for update in updates if update.id.id_type == "OBJECT"]
        return not self._is_linked(updates) and all(
            self._stands(thing, depsgraph) for thing in things
        )

    def _stands(self, thing: Any, depsgraph: Any) -> bool:
        uid = thing.original.session_uid
        if uid not in self._places:
            return self._shows_nothing(thing, depsgraph)
        place = self._places[uid]
        if place is None or place.lights:
            return False
        groups = [self.scene.instances[number] for number in place.instances]
        # Materials may read what an edit of the object changed.
        return not any(g.values for g in groups) and self._is_seen_as(groups, thing, depsgraph)

    def _shows_nothing(self, thing: Any, depsgraph: Any) -> bool:
        """Whether something that has no number is not seen, as before."""
        uid = thing.original.session_uid
        if uid in self._visited.instancing:
            return False
        if _is_hidden(thing, depsgraph):
            return uid not in self._visited.rendering
        return thing.type in _BARE and thing.instance_type == "NONE"

    def _is_seen_as(self, groups: list[Instances], thing: Any, depsgraph: Any) -> bool:
        """Whether a thing is seen as these, which are it."""
        if _is_hidden(thing, depsgraph) or thing.instance_type != "NONE":
            return False
        report = Report()
        flags = flags_of(thing, thing, depsgraph.view_layer, report)
        if report.mentions(thing.name) or self.report.mentions(thing.name):
            return False  # what is said of it may be another thing now
        now = (thing.pass_index, *flags[:4], *flags[7:])
        return all(
            now
            == (
                g.object_index,
                g.visible_camera,
                g.visible_mirror,
                g.visible_shadow,
                g.holdout,
                g.catcher,
                g.visible_transmission,
                g.visible_diffuse,
                g.visible_media,
                (g.geometry_offset, g.shading_offset),
            )
            for g in groups
        )

    def _is_only_looked_through(self, camera: Any) -> bool:
        uid = camera.original.session_uid
        return uid not in self._places and uid not in self._visited.instancing

    def _apply(
        self,
        update: Any,
        instances: list[Instances],
        lights: list[Light],
        depsgraph: Any,
        images: Any,
    ) -> bool:
        """Whether all that the update tells is in the lists now."""
        changed = update.id
        if changed.id_type != "OBJECT":
            return False
        uid = changed.original.session_uid
        if changed.type == "CAMERA":
            return self._is_only_looked_through(changed)
        if uid not in self._places:
            return self._shows_nothing(changed, depsgraph)
        place = self._places[uid]
        if place is None:
            return False
        if _is_lamp(update):
            if _is_hidden(changed, depsgraph):
                return False
        elif update.is_updated_geometry or not (
            update.is_updated_transform or update.is_updated_shading
        ):
            return False
        groups = [instances[number] for number in place.instances]
        if update.is_updated_shading and not (
            _is_lamp(update) or self._is_seen_as(groups, changed, depsgraph)
        ):
            return False
        matrix = np.array(changed.matrix_world, np.float64)[None, :3]
        return (
            _revalue(place.instances, changed, instances, depsgraph)
            and _move(place.instances, matrix, instances)
            and _relight(
                place.lights, changed, matrix, lights, depsgraph.view_layer, images, self.report
            )
        )


class _Standing(NamedTuple):
    """As an instance of the depsgraph that stands by itself."""

    object: Any
    instance_object: Any = None
    parent: Any = None
    is_instance: bool = False
    particle_system: Any = None


def _is_hidden(thing: Any, depsgraph: Any) -> bool:
    """Whether its own switch hides it, of which Blender says only that it is shaded anew."""
    return thing.hide_render if depsgraph.mode == "RENDER" else thing.hide_viewport


def _is_lamp(update: Any) -> bool:
    return update.id.id_type == "OBJECT" and update.id.type == "LIGHT"


def _revalue(numbers: list[int], thing: Any, instances: list[Instances], depsgraph: Any) -> bool:
    """What materials read of a thing; False where that is not finite, or not of its own."""
    for number in numbers:
        names = instances[number].values
        if names and thing.type != "MESH":
            return False  # curves are met as meshes that are gone by now
        layer, scene = depsgraph.view_layer_eval, depsgraph.scene_eval
        values = {name: value_of(name, _Standing(thing), layer, scene) for name in names}
        if any(value != sound(value) for value in values.values()):
            return False
        if names:
            rows = {name: np.array([value], np.float32) for name, value in values.items()}
            instances[number] = replace(instances[number], values=rows)
    return True


def _move(numbers: list[int], matrix: np.ndarray, instances: list[Instances]) -> bool:
    """False for a matrix that leaves nothing of a surface."""
    if not np.isfinite(matrix).all():
        return False
    for number in numbers:
        instances[number] = replace(instances[number], world_from_object=matrix)
    moved = tuple(instances[number] for number in numbers)
    return len(without_collapsed(moved, Report())) == len(moved)


def _relight(
    numbers: list[int],
    lamp: Any,
    matrix: np.ndarray,
    lights: list[Light],
    view_layer: Any,
    images: Any,
    report: Report,
) -> bool:
    """False where the lamp is not one light any more, or something is or was said of it in
    `report`.
    """
    for number in numbers:
        own = Report()
        flags = flags_of(lamp, lamp, view_layer, own)
        made = Lights(images, own)
        made.add(lamp.name, lamp.data, matrix, flags, lights[number].light_group)
        if len(made.lights) != 1 or own.notes() or report.mentions(lamp.name):
            return False
        lights[number] = made.lights[0]
    return True
