"""The export again and again: what has not changed since the last time is not read again, and the
scene is the same as if it had been.

Blender says what changed (`depsgraph.updates`); arrays of meshes, compiled materials, decoded
images and the world's mean colours are kept. Where only objects moved or lamps changed, these alone
are read (`moves`). Else the walk over the instances and the lights is done anew: it takes ten
microseconds an object.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....engine.scene import (
    Camera,
    Geometry,
    Material,
    Mesh,
    Scene,
    SceneDelta,
    Strands,
    Texture,
    settled,
)
from ..export import Collector, _Lamp, _Placed, _world, is_displaced
from ..geometry.meshes import MeshSource
from ..geometry.shapes import export_points
from ..geometry.strands import StrandSource, read_curves, read_hair
from ..geometry.volumes import Volume
from ..images.images import Images
from ..instances import Census, Thing, walk
from ..light_groups import LightGroups
from ..materials.displacing import Displacement, compile_displacement, wanted_objects
from ..materials.graph import node_tree
from ..materials.materials import (
    Materials,
    compile_material,
    compile_volume,
    default_material,
    wanted_by,
    with_textures,
    without_unused,
)
from ..materials.nodes_volume import with_step_rate
from ..materials.wanted import Wanted
from ..missing import note_missing
from ..placing import without_collapsed, without_unplaced
from ..report import Report
from ..unheard import note_scene
from ..world import Sky, export_world, with_light_group, with_pass_settings
from .moves import Stage
from .repaints import repainted

WORK = ("walks", "meshes", "materials", "worlds")
"""What `LiveExport.work` counts."""
NO_CAMERA = Camera("PERSPECTIVE", np.eye(4)[:3], (-1.0, 1.0, -1.0, 1.0), (1, 1))
"""Stands in scenes until a view brings its own."""


@dataclass
class Changes:
    """What must be read again: session uids, addresses of the node trees that belong to one
    material, everything that shades.
    """

    geometry: set[int] = field(default_factory=set)
    materials: set[int] = field(default_factory=set)
    trees: set[int] = field(default_factory=set)
    world: bool = False
    shading: bool = False
    images: bool = False

    def add(self, update: Any) -> None:
        """Take in one of `depsgraph.updates`."""
        block = update.id.original
        uid, kind = block.session_uid, block.id_type
        if update.is_updated_geometry:
            self.geometry.add(uid)
        if kind == "MATERIAL":
            self.materials.add(uid)
        elif kind == "WORLD":
            self.world = True
        elif kind in ("IMAGE", "TEXTURE", "MOVIECLIP"):
            self.images = self.shading = True
        elif kind == "NODETREE" and block.is_embedded_data:
            self.trees.add(block.as_pointer())
        elif kind == "NODETREE":
            self.shading = True  # a group: any material may use it


@dataclass
class _Shape:
    """What is kept of a geometry.

    about: the uids of the objects that were met with it, of each of which Blender tells when its
    data change. The data of an original object may point at nothing after an undo.  states: the
    mesh with its attributes after each sequence of wishes.  report: of reading it.
    """

    geometry: MeshSource | StrandSource | Geometry | None
    about: set[int]
    states: dict[tuple[Wanted, ...], MeshSource | StrandSource] = field(default_factory=dict)
    finished: dict[tuple[Wanted, ...], Mesh | Strands] = field(default_factory=dict)
    report: Report = field(default_factory=Report)


@dataclass(frozen=True, eq=False)
class _Compiled:
    """A material whose inputs name places of `textures`, (key, texture) in the order in which
    compiling met them.

    tree: address of the material's own node tree, 0 without one.  in_memory: reads an image whose
    pixels only Blender has. displacement: how it moves vertices. report: of compiling it.
    surface: round the Volume object that it is compiled for.
    """

    material: Material
    tree: int
    in_memory: bool
    textures: tuple[tuple[tuple, Texture], ...]
    wanted: Wanted
    displacement: Displacement | None
    report: Report
    surface: MeshSource | None = None

    def asks_as(self, other: _Compiled) -> bool:
        """Whether it reads the same of meshes, and moves them alike."""
        return (self.wanted, self.displacement) == (other.wanted, other.displacement)


class Store:
    """What is kept from one export to the next."""

    def __init__(self) -> None:
        self.met: dict[tuple, dict[tuple, _Shape]] = {}
        self.compiled: dict[int | tuple, _Compiled] = {}
        self.pixels: dict[tuple, Any] = {}
        self.textures: dict[tuple, Texture] = {}
        self.worlds: dict[tuple, tuple[Sky, Report]] = {}
        self.memory_epoch = 0
        self.read: Counter[str] = Counter()
        self.joined: (
            tuple[tuple[_Compiled, ...], tuple[Material, ...], tuple[Texture, ...]] | None
        ) = None

    def forget(self, changes: Changes) -> None:
        """Drop what changed."""
        if changes.geometry:
            for asked, met in self.met.items():
                self.met[asked] = {
                    key: shape for key, shape in met.items() if not shape.about & changes.geometry
                }
        if changes.shading:
            self.compiled = {}
        stale = changes.materials
        gone = [
            kept
            for uid, kept in self.compiled.items()
            if (uid[0] if isinstance(uid, tuple) else uid) in stale or kept.tree in changes.trees
        ]
        if (
            changes.images
            or changes.shading
            or changes.world
            or any(kept.in_memory for kept in gone)
        ):
            self._forget_memory()
        self.compiled = {uid: kept for uid, kept in self.compiled.items() if kept not in gone}
        if changes.images:
            self.pixels, self.textures = {}, {}
        if changes.shading or changes.world or changes.trees:
            self.worlds = {}

    def _forget_memory(self) -> None:
        """Images that only Blender has may have been painted or reloaded, which it tells as a
        change of their materials.
        """
        self.memory_epoch += 1
        self.compiled = {uid: kept for uid, kept in self.compiled.items() if not kept.in_memory}
        self.pixels = {
            key: pixels for key, pixels in self.pixels.items() if not _is_in_memory(key[0])
        }
        used = {key for kept in self.compiled.values() for key, _ in kept.textures}
        self.textures = {key: texture for key, texture in self.textures.items() if key in used}

    def keep_met(self, asked: Iterable[tuple]) -> None:
        """Drop the shapes that none of these walks met: the others are of views that are gone."""
        self.met = {key: self.met[key] for key in asked}

    def shape(self, key: tuple) -> _Shape | None:
        """As some view met it."""
        return next((met[key] for met in self.met.values() if key in met), None)

    def forget_moving_images(self) -> None:
        """The frame changed, and an image is a sequence: any may be it."""
        self.compiled = {
            uid: compiled for uid, compiled in self.compiled.items() if not compiled.textures
        }
        self.worlds = {}


class LiveExport:
    """The scene of one depsgraph, kept up to date. Nothing of Blender's is held between calls."""

    def __init__(self) -> None:
        self._store = Store()
        self._frame: tuple[int, float] | None = None
        self._stages: dict[tuple, Stage] = {}
        self._given: dict[tuple, Scene] = {}
        self._deltas: dict[tuple, SceneDelta] = {}

    def update(
        self,
        depsgraph: Any,
        camera: Camera,
        *,
        passes: frozenset[str] = frozenset(),
        space: Any = None,
    ) -> Scene:
        """The scene now: `hear` and `scene`."""
        self.hear(depsgraph)
        return self.scene(depsgraph, camera, passes=passes, space=space)

    def hear(self, depsgraph: Any) -> None:
        """Take in `depsgraph.updates`, which must tell all that changed since the last call."""
        updates, images = depsgraph.updates[:], _KeepingImages(self._store, Report())
        self._store.read.clear()
        self._store.keep_met(self._stages)
        self._given = {asked: self._given[asked] for asked in self._stages}
        self._deltas = {}
        turns = self._turns_images(depsgraph.scene_eval)
        if turns:
            self._stages = {}
        painted = repainted(updates)
        if painted:
            self._keep(lambda stage: stage.stands(updates, depsgraph.view_layer))
            self._store.forget(
                _changes(
                    update for update in updates if update.id.id_type in ("MATERIAL", "NODETREE")
                )
            )
            self._keep(lambda stage: self._repaint(stage, painted, depsgraph.scene_eval))
        else:
            self._keep(lambda stage: stage.follow(updates, depsgraph.view_layer, images))
            self._store.forget(_changes(updates))
        if turns:
            self._store.forget_moving_images()
        self._frame = _frame_of(depsgraph.scene_eval)

    def _keep(self, is_wanted: Callable[[Stage], bool]) -> None:
        self._stages = {asked: stage for asked, stage in self._stages.items() if is_wanted(stage)}

    def _repaint(self, stage: Stage, painted: dict[int, Any], scene: Any) -> bool:
        """Takes edited materials, by session uid, into a stage; False where they read other things
        of meshes than before.
        """
        materials = _KeepingMaterials(self._store, Report())
        for uid, before in stage.worn:
            now = materials.wear(uid, painted.get(uid))
            if now is None or not now.asks_as(before):
                return False
        new, textures = materials.joined()
        stage.scene, stage.worn = (
            replace(stage.scene, materials=with_step_rate(new, scene), textures=textures),
            materials.worn,
        )
        return True

    def scene(
        self,
        depsgraph: Any,
        camera: Camera,
        *,
        passes: frozenset[str] = frozenset(),
        space: Any = None,
        groups: tuple = (),
    ) -> Scene:
        """The scene as of what was heard. What several views ask for is walked over once for all
        that see the same.

        space: the 3D view whose local view and visibility count, None for none.  passes: as for
        `export_scene`.  groups: `LightGroups.members` where light groups are shown.
        """
        asked = _asked(passes, space, groups)
        if asked not in self._stages:
            self._stages[asked] = self._walked(depsgraph, asked, space, asked[0])
        stage, before = self._stages[asked], self._given.get(asked)
        if before is not None and asked not in self._deltas:
            stage.scene, self._deltas[asked] = settled(before, stage.scene)
        self._given[asked] = stage.scene
        return replace(stage.scene, camera=camera)

    def delta(
        self, passes: frozenset[str] = frozenset(), space: Any = None, groups: tuple = ()
    ) -> SceneDelta | None:
        """How the scene that `scene` gave last for the same view differs from the one that it gave
        before what was heard last; None where there is none.
        """
        return self._deltas.get(_asked(passes, space, groups))

    def notes(
        self, passes: frozenset[str] = frozenset(), space: Any = None, groups: tuple = ()
    ) -> tuple[str, ...]:
        """What could not be exported as it is, of the scene that `scene` gave last for the same
        view.
        """
        stage, report = self._stages[_asked(passes, space, groups)], Report()
        for part in (stage.report, *(compiled.report for _, compiled in stage.worn)):
            report.add(part)
        return report.notes()

    def _walked(self, depsgraph: Any, asked: tuple, space: Any, wanted: Wanted) -> Stage:
        """Walks again where rays of materials read what they meet, which is known only then."""
        report, census = Report(), Census()
        self._store.read["walks"] += 1
        groups = LightGroups(*asked[2][:1])
        collector = _KeepingCollector(self._store, depsgraph, wanted, report, groups)
        things = walk(
            depsgraph,
            collector.meet,
            report,
            lambda thing: space is None or thing.visible_in_viewport_get(space),
            census,
            collector.meet_hair,
        )
        everywhere = wanted | collector.materials.sampled
        if everywhere != wanted:
            return self._walked(depsgraph, asked, space, everywhere)
        note_scene(depsgraph.scene_eval, report)
        note_missing(depsgraph, report)
        self._store.met[asked] = collector.met
        world = _world(depsgraph, depsgraph.scene_eval)
        sky = with_light_group(self._sky(depsgraph, report), groups.number(world))
        return collector.stage(things, sky, census)

    def _turns_images(self, scene: Any) -> bool:
        """Whether this is another frame, and images show something else there, of which no update
        tells.
        """
        if self._frame in (None, _frame_of(scene)):
            return False
        return any(image.source in ("SEQUENCE", "MOVIE") for image in bpy.data.images)

    @property
    def work(self) -> dict[str, int]:
        """How much was read since something was heard last: "walks" over all objects, "meshes" and
        other shapes, "materials", "worlds".
        """
        return {name: self._store.read[name] for name in WORK}

    def _sky(self, depsgraph: Any, report: Report) -> Sky:
        scene = depsgraph.scene_eval
        world = _world(depsgraph, scene)
        key = (
            world.original.session_uid if world is not None else 0,
            scene.render.film_transparent,
        )
        if key not in self._store.worlds:
            own = Report()
            self._store.read["worlds"] += 1
            images = _KeepingImages(self._store, own)
            self._store.worlds[key] = (
                with_pass_settings(
                    export_world(world, scene.render.film_transparent, images, own), scene.world
                ),
                own,
            )
        sky, notes = self._store.worlds[key]
        report.add(notes)
        return sky


def _asked(passes: frozenset[str], space: Any, groups: tuple) -> tuple:
    """What a view wants of meshes, what it shows, and light groups."""
    return Wanted(frozenset({""}) if "UV" in passes else frozenset()), shown_in(space), groups


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


def _changes(updates: Iterable[Any]) -> Changes:
    changes = Changes()
    for update in updates:
        changes.add(update)
    return changes


class _KeepingImages(Images):
    """Images that are decoded only when the store has none as they are now."""

    def __init__(self, store: Store, report: Report) -> None:
        super().__init__(report)
        self._pixels, self._memory_epoch = store.pixels, store.memory_epoch
        self.in_memory = False

    def _key(self, image: Any, user: Any, tile: int = 0) -> tuple:
        address, path = super()._key(image, user, tile)
        if image is None:
            return address, path
        state = self._state(image, path)
        self.in_memory = self.in_memory or _is_in_memory((address, state))
        return (address, state), path

    def _state(self, image: Any, path: str) -> tuple:
        """What a change of the image shows in, should Blender not tell of it: reloaded files and
        other ways to read them.
        """
        space = image.colorspace_settings
        settings = (image.source, image.alpha_mode, space.name, space.is_data, tuple(image.size))
        if not image.is_dirty and not image.packed_file and Path(path).is_file():
            file = Path(path).stat()
            return ("file", file.st_mtime_ns, file.st_size, *settings)
        return ("memory", self._memory_epoch, *settings)


def _is_in_memory(key: Any) -> bool:
    """Of the first part of a key of `_KeepingImages`."""
    return isinstance(key, tuple) and key[1][0] == "memory"


class _KeepingMaterials(Materials):
    """Materials that are compiled only when the store has none."""

    def __init__(self, store: Store, report: Report) -> None:
        super().__init__(_KeepingImages(store, report), report)
        self._store = store
        self.used: list[_Compiled] = []

    def index(self, material: Any) -> int:
        return self._number(material.original.session_uid if material is not None else 0, material)

    def volume(self, material: Any, volume: Volume) -> tuple[int, MeshSource | None]:
        uid = material.original.session_uid if material is not None else 0
        number = self._number((uid, volume.key), material, volume)
        return number, self.used[number].surface

    def wear(self, uid: int | tuple, material: Any) -> _Compiled | None:
        """Number a material after those before it; None where it is neither kept nor given."""
        if uid not in self._store.compiled and material is None:
            return None
        return self.used[self._number(uid, material)]

    @property
    def worn(self) -> tuple[tuple[int | tuple, _Compiled], ...]:
        """Session uids, 0 for none, and materials in their order."""
        return tuple(zip(self._indices, self.used, strict=True))

    def _number(self, key: int | tuple, material: Any, volume: Volume | None = None) -> int:
        if key not in self._indices:
            compiled = self._store.compiled.get(key) or self._compile(material, volume)
            self._store.compiled[key] = compiled
            self._indices[key] = len(self.used)
            self.used.append(compiled)
            self._wanted.append(compiled.wanted)
            self._displacements.append(compiled.displacement)
        return self._indices[key]

    def _compile(self, material: Any, volume: Volume | None) -> _Compiled:
        report, surface = Report(), None
        self._store.read["materials"] += 1
        images = _KeepingImages(self._store, report)
        if volume is not None:
            result, surface = compile_volume(material, volume, images, report)
        elif material is not None:
            result = compile_material(material, images, report)
        else:
            result = default_material()
        moves = compile_displacement(material, images, report) if volume is None else None
        keys = sorted(images._indices, key=images._indices.__getitem__)
        textures = tuple(
            (key, self._store.textures.setdefault(key, images.textures[k]))
            for k, key in enumerate(keys)
        )
        if moves is not None:  # the same as before where its images are
            kept = {id(images.textures[k]): texture for k, (_, texture) in enumerate(textures)}
            moves = replace(moves, textures=tuple(kept[id(texture)] for texture in moves.textures))
        tree = node_tree(material.original) if material is not None else None
        return _Compiled(
            result,
            tree.as_pointer() if tree is not None else 0,
            images.in_memory,
            textures,
            wanted_by(result) | wanted_objects(moves),
            moves,
            report,
            surface,
        )

    def joined(self) -> tuple[tuple[Material, ...], tuple[Texture, ...]]:
        """Materials and textures as one export would have numbered them."""
        used = tuple(self.used)
        known = self._store.joined
        if known is None or known[0] != used:
            known = self._store.joined = (used, *_join(used))
        return known[1:]


def _join(used: tuple[_Compiled, ...]) -> tuple[tuple[Material, ...], tuple[Texture, ...]]:
    numbers: dict[tuple, int] = {}
    textures: list[Texture] = []
    materials: list[Material] = []
    for compiled in used:
        for key, texture in compiled.textures:
            if key not in numbers:
                numbers[key] = len(textures)
                textures.append(texture)
        materials.append(
            _renumbered(compiled.material, [numbers[key] for key, _ in compiled.textures])
        )
    return without_unused(materials, textures)


def _renumbered(material: Material, numbers: list[int]) -> Material:
    if not numbers:
        return material
    return with_textures(material, {-1: -1, **dict(enumerate(numbers))})


def _read(read: Callable[[Report], Any]) -> _Shape:
    """What is read, with what is told of it."""
    report = Report()
    return _Shape(read(report), set(), report=report)


class _KeepingCollector(Collector):
    """Gathers geometries and materials, most of them from the store."""

    def __init__(
        self, store: Store, depsgraph: Any, wanted: Wanted, report: Report, groups: LightGroups
    ) -> None:
        super().__init__(depsgraph, wanted, report, light_groups=groups)
        self._store = store
        self.materials = _KeepingMaterials(store, report)
        self._wishes: list[tuple[Wanted, ...]] = []
        self.met: dict[tuple, _Shape] = {}

    def _met(self, key: tuple, read: Callable[[Report], Any], owner: Any) -> int | None:
        if key not in self._known:
            self._known[key] = self._keep(key, lambda: _read(read))
        self.met[key].about.add(owner.original.session_uid)
        return self._known[key]

    def _geometry(self, number: int) -> MeshSource | Geometry:
        return self._geometries[number].geometry

    def _points(self, cloud: Any) -> int | None:
        key = (cloud.as_pointer(), len(cloud.points), cloud.name)
        if key not in self._known:
            self._known[key] = self._keep(
                key, lambda: _Shape(export_points(cloud), {cloud.original.session_uid})
            )
        return self._known[key]

    def _curves(self, data: Any, owner: Any) -> int | None:
        shape = self._curve_shape
        key = ("curves", data.as_pointer(), len(data.points), data.name, shape)
        if key not in self._known:
            scene = self.depsgraph.scene_eval
            self._known[key] = self._keep(key, lambda: _Shape(read_curves(data, scene), set()))
        self.met[key].about |= {owner.original.session_uid, data.original.session_uid}
        return self._known[key]

    def _around(self, surface: MeshSource) -> int:
        key = ("volume", id(surface))
        if key not in self._known:
            self._known[key] = self._keep(key, lambda: _Shape(surface, set()))
        return self._known[key]

    def _hair(self, thing: Any, owner: Any) -> int | None:
        scene = self.depsgraph.scene_eval
        key = (
            "hair",
            owner.original.session_uid,
            thing.data.as_pointer(),
            self._curve_shape,
        )
        if key not in self._known:
            self._known[key] = self._keep(
                key, lambda: _Shape(read_hair(thing, scene, self.is_render), set())
            )
        settings = {system.settings.original.session_uid for system in thing.particle_systems}
        self.met[key].about |= {owner.original.session_uid, *settings}
        return self._known[key]

    @property
    def _curve_shape(self) -> str:
        """How Cycles' settings say that curves go between keys."""
        return getattr(getattr(self.depsgraph.scene_eval, "cycles_curves", None), "shape", "")

    def _keep(self, key: tuple, read: Any) -> int | None:
        """The number of the shape with this key, read if the store has none."""
        shape = self._store.shape(key)
        if shape is None:
            self._store.read["meshes"] += 1
            shape = read()
        self.met[key] = shape
        if shape.geometry is None:
            return None
        self._geometries.append(shape)
        self._wishes.append(())
        return len(self._geometries) - 1

    def _add_attributes(self, number: int, data: Any, owner: Any, wanted: Wanted) -> None:
        if not wanted:
            return
        shape, before = self._geometries[number], self._wishes[number]
        wishes = self._wishes[number] = (*before, wanted) if wanted not in before else before
        if wishes not in shape.states:
            source = shape.states.get(before, shape.geometry)
            source = shape.states[wishes] = replace(
                source, uv_maps=dict(source.uv_maps), attributes=dict(source.attributes)
            )
            self._read_attributes(data, owner, source, wanted, shape.report)

    def _finished(self, number: int) -> Geometry:
        shape, wishes = self._geometries[number], self._wishes[number]
        if not isinstance(shape.geometry, MeshSource | StrandSource):
            return shape.geometry
        if wishes not in shape.finished:
            shape.finished[wishes] = shape.states.get(wishes, shape.geometry).finished()
        return shape.finished[wishes]

    def stage(self, things: list[Thing], sky: Sky, census: Census) -> Stage:
        """The scene, without a camera, and where its things are."""
        placed = [
            (thing, self.instances(thing)) for thing in things if isinstance(thing.content, _Placed)
        ]
        kept: Iterable[int] = range(len(self._geometries))
        if any(is_displaced(shape.geometry) for shape in self._geometries):
            blocks = tuple(block for _, block in placed)
            blocks, kept = without_unplaced(blocks, len(self._geometries))
            placed = [(thing, block) for (thing, _), block in zip(placed, blocks, strict=True)]
        geometries = tuple(self._finished(number) for number in kept)
        instances = without_collapsed(tuple(block for _, block in placed), self.report)
        lamps = [
            (thing, self._light(thing)) for thing in things if isinstance(thing.content, _Lamp)
        ]
        materials, textures = self.materials.joined()
        set_by = self.depsgraph.scene_eval
        materials, (world,) = (with_step_rate(m, set_by) for m in (materials, (sky.world,)))
        scene = Scene(
            NO_CAMERA,
            geometries,
            instances,
            materials,
            textures,
            sky.lights_with(self.lights.lights),
            world,
            light_groups=self.light_groups.names,
        )
        for shape in self._geometries:
            self.report.add(shape.report)
        stage, numbers = (
            Stage(scene, census, self.materials.worn, self.report),
            {id(block): number for number, block in enumerate(instances)},
        )
        for thing, block in placed:
            number = None if thing.content.is_bound else numbers.get(id(block))
            stage.place_instances(thing, number)
        for thing, number in lamps:
            stage.place_light(thing, number)
        return stage

    def _light(self, thing: Thing) -> int | None:
        """Adds a lamp's lights; the number of the one where there is just one."""
        first = len(self.lights.lights)
        self.lights.add(thing.name, thing.content.light, thing.matrices, thing.content.seen)
        return first if len(self.lights.lights) == first + 1 else None
