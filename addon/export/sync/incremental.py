"""The export again and again: what has not changed since the last time is not read again, and the
scene is the same as if it had been.

Blender says what changed (`depsgraph.updates`); arrays of meshes, compiled materials, decoded
images and the world's mean colours are kept. Where only objects moved or lamps changed, these alone
are read (`moves`). Else the walk over the instances and the lights is done anew: it takes ten
microseconds an object.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import bpy
import numpy as np

from ....engine.scene import Camera, Scene, SceneDelta, settled
from ..cache import ExportCache, WorldKey
from ..collector import Collector
from ..culling import Culling, culls
from ..export import world_of
from ..geometry.displacing import Displaced
from ..images import moving
from ..images.images import Images
from ..instances import VisitedObjects, walk
from ..light_groups import NO_MEMBERS, LightGroups, Members
from ..materials.aovs import Aov, note_world
from ..materials.materials import Materials
from ..materials.nodes_volume import with_step_rate
from ..materials.required import RequiredAttributes
from ..missing import note_missing
from ..report import Report
from ..unsupported import note_scene
from ..world import Sky, export_world, with_light_group, with_pass_settings
from .changes import Changes
from .material_updates import edited_materials
from .transform_updates import SceneIndex

WORK = ("walks", "meshes", "materials", "worlds")
"""What `LiveExport.work` counts."""
NO_CAMERA = Camera("PERSPECTIVE", np.eye(4)[:3], (-1.0, 1.0, -1.0, 1.0), (1, 1))
"""Stands in scenes until a view brings its own."""


class Asked(NamedTuple):
    """What a view wants of meshes, what it shows (`shown_in`), light groups, what Simplify leaves
    out of it; the rest as for `export_scene`.
    """

    required: RequiredAttributes
    shown: tuple
    groups: Members
    culling: Culling | None
    aovs: tuple[Aov, ...]
    keeps_collapsed: bool


class LiveExport:
    """The scene of one depsgraph, kept up to date. Nothing of Blender's is held between calls."""

    def __init__(self) -> None:
        self._cache = ExportCache()
        self._layer = ""
        self._frame: tuple[int, float] | None = None
        self._indices: dict[Asked, SceneIndex] = {}
        self._given: dict[Asked, Scene] = {}
        self._deltas: dict[Asked, SceneDelta] = {}

    def update(
        self,
        depsgraph: Any,
        camera: Camera,
        *,
        passes: frozenset[str] = frozenset(),
        space: Any = None,
    ) -> Scene:
        """The scene now: `apply_updates` and `scene`."""
        self.apply_updates(depsgraph)
        return self.scene(depsgraph, camera, passes=passes, space=space)

    def apply_updates(self, depsgraph: Any) -> None:
        """Take in `depsgraph.updates`, which must tell all that changed since the last call."""
        updates = depsgraph.updates[:]
        self._cache.work.clear()
        self._cache.images.frame = depsgraph.scene_eval.frame_current
        self._cache.shapes.keep_views(self._indices)
        self._given = {a: given for a, given in self._given.items() if a in self._indices}
        self._deltas = {}
        self._take_layer(depsgraph)
        # What moves may come into view.
        self._indices = {a: index for a, index in self._indices.items() if a.culling is None}
        turns = self._turns_images(depsgraph.scene_eval)
        if turns:
            self._indices = {}
        edited = edited_materials(updates)
        if edited:
            self._keep(lambda index: index.stands(updates, depsgraph))
            shading = [u for u in updates if u.id.id_type in ("MATERIAL", "NODETREE")]
            self._cache.forget(Changes.of(shading))
            self._keep(lambda index: self._update_materials(index, edited, depsgraph.scene_eval))
        else:
            if not updates:  # as Blender 4.2 does where an image of a lamp was painted
                self._cache.images.forget_memory()
            images = Images(Report(), cache=self._cache.images)
            self._keep(lambda index: index.follow(updates, depsgraph, images))
            self._cache.forget(Changes.of(updates))
        if turns:
            self._cache.forget_moving_images()
        self._frame = _frame_of(depsgraph.scene_eval)

    def _take_layer(self, depsgraph: Any) -> None:
        """Of another view layer than before Blender tells all that it evaluates anew; what only the
        other layers have is gone.
        """
        if depsgraph.view_layer.name == self._layer:
            return
        self._layer, self._indices = depsgraph.view_layer.name, {}
        self._cache.shapes.keep_about({block.original.session_uid for block in depsgraph.ids})

    def _keep(self, is_wanted: Callable[[SceneIndex], bool]) -> None:
        self._indices = {asked: index for asked, index in self._indices.items() if is_wanted(index)}

    def _update_materials(self, index: SceneIndex, edited: dict[int, Any], scene: Any) -> bool:
        """Takes edited materials, by session uid, into an index; False where they read other
        things of meshes than before.
        """
        materials = Materials(self._cache)
        for key, before in index.sources:
            now = materials.numbered(key, edited.get(key.uid) if key.volume is None else None)
            if now is None or not now.asks_as(before):
                return False
        new, textures = materials.joined()
        index.scene, index.sources = (
            replace(index.scene, materials=with_step_rate(new, scene), textures=textures),
            materials.sources,
        )
        return True

    def scene(self, depsgraph: Any, camera: Camera, **view: Any) -> Scene:
        """The scene as of the updates that were applied. What several views ask for is walked over
        once for all that see the same.  view: as for `_asked`.
        """
        asked = _asked(**view)
        if asked not in self._indices:
            space = view.get("space")
            self._indices[asked] = self._walked(depsgraph, asked, space, asked.required)
        index, before = self._indices[asked], self._given.get(asked)
        if before is not None and asked not in self._deltas:
            index.scene, self._deltas[asked] = settled(before, index.scene)
        self._given[asked] = index.scene
        return replace(index.scene, camera=camera)

    def delta(self, **view: Any) -> SceneDelta | None:
        """How the scene that `scene` gave last for the same view differs from the one that it gave
        before what was heard last; None where there is none.  view: as for `scene`.
        """
        return self._deltas.get(_asked(**view))

    def notes(self, **view: Any) -> tuple[str, ...]:
        """What could not be exported as it is, of the scene that `scene` gave last for the same
        view.
        """
        index, report = self._indices[_asked(**view)], Report()
        for part in (index.report, *(compiled.report for _, compiled in index.sources)):
            report.add(part)
        return report.notes()

    def displaced(self, **view: Any) -> Mapping[int, Displaced]:
        """How meshes of the scene that `scene` gave last for the same view were displaced, by their
        numbers.
        """
        return self._indices[_asked(**view)].displaced

    def _walked(
        self, depsgraph: Any, asked: Asked, space: Any, required: RequiredAttributes
    ) -> SceneIndex:
        """Walks again where rays of materials read what they meet, which is known only then."""
        report, visited = Report(), VisitedObjects()
        self._cache.work["walks"] += 1
        groups = LightGroups(asked.groups.names)
        collector = Collector(depsgraph, required, report, self._cache, groups, aovs=asked.aovs)
        things = walk(
            depsgraph,
            collector.meet,
            report,
            lambda thing: space is None or thing.visible_in_viewport_get(space),
            visited,
            collector.meet_hair,
            asked.culling,
        )
        self._cache.shapes.keep(asked, collector.met)
        everywhere = required | collector.materials.sampled
        if everywhere != required:
            return self._walked(depsgraph, asked, space, everywhere)
        note_scene(depsgraph.scene_eval, report)
        if asked.culling is None and culls(depsgraph.scene_eval):
            report.note(
                "Camera and distance culling is for renders and views through the camera: this one "
                "shows all objects; hide in it what makes it slow"
            )
        note_missing(depsgraph, report)
        world = world_of(depsgraph, depsgraph.scene_eval)
        note_world(world, asked.aovs, report)
        sky = with_light_group(self._sky(depsgraph, report), groups.number(world))
        scene = collector.scene(NO_CAMERA, things, sky, keeps_collapsed=asked.keeps_collapsed)
        displaced = collector.displaced
        index = SceneIndex(scene, visited, collector.materials.sources, report, displaced)
        for thing, number in collector.groups:
            index.place_instances(thing, number)
        for thing, number in collector.lamps:
            index.place_light(thing, number)
        return index

    def _turns_images(self, scene: Any) -> bool:
        """Whether this is another frame, and images show something else there, of which no update
        tells.
        """
        if self._frame in (None, _frame_of(scene)):
            return False
        return any(image.source in moving.KINDS for image in bpy.data.images)

    @property
    def work(self) -> dict[str, int]:
        """How much was read since something was heard last: "walks" over all objects, "meshes" and
        other shapes, "materials", "worlds".
        """
        return {name: self._cache.work[name] for name in WORK}

    def _sky(self, depsgraph: Any, report: Report) -> Sky:
        scene, known = depsgraph.scene_eval, self._cache.worlds
        world, is_transparent = world_of(depsgraph, scene), scene.render.film_transparent
        key = WorldKey(world.original.session_uid if world is not None else 0, is_transparent)
        if key not in known:
            own = Report()
            self._cache.work["worlds"] += 1
            images = Images(own, cache=self._cache.images)
            sky = export_world(world, is_transparent, images, own)
            known[key] = with_pass_settings(sky, scene.world, own), own
        sky, notes = known[key]
        report.add(notes)
        return sky


def _asked(
    passes: frozenset[str] = frozenset(),
    space: Any = None,
    groups: Members = NO_MEMBERS,
    culling: Culling | None = None,
    aovs: tuple[Aov, ...] = (),
    keeps_collapsed: bool = False,
) -> Asked:
    """space: the 3D view whose local view and visibility count, None for none.  passes, aovs,
    keeps_collapsed: as for `export_scene`.  groups: `LightGroups.members` where light groups are
    shown.  culling: what is left out of the view.
    """
    return Asked(
        RequiredAttributes(frozenset({""}) if "UV" in passes else frozenset()),
        shown_in(space),
        groups,
        culling,
        aovs,
        keeps_collapsed,
    )


def _frame_of(scene: Any) -> tuple[int, float]:
    return scene.frame_current, scene.frame_subframe


def shown_in(space: Any) -> tuple:
    """Equal as long as a 3D view leaves out the same kinds of objects and stays in the same local
    view; no update tells of these.
    """
    if space is None:
        return ()
    kinds = [name for name in dir(space) if name.startswith("show_object_viewport_")]
    local = space.local_view
    return (
        local.as_pointer() if local else 0,
        space.use_local_collections,
        *(getattr(space, name) for name in kinds),
    )
