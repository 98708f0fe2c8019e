"""The export's order of work."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...engine.displacement import Displacement, Place
from ...engine.scene import Geometry, Instances, Scene, SceneDelta, Spheres, Strands
from .camera import border, export_camera, resolution
from .geometry.displacing import Displaced, displaced_source
from .geometry.meshes import MeshSource, mesh_key, read_attributes, readable
from .geometry.shapes import export_points, read_shape
from .geometry.strands import StrandSource, read_curves, read_hair, read_strand_attributes
from .geometry.volumes import read_volume
from .images.decoded import Decoded
from .images.images import Images
from .instances import Flags, Thing, places_on_instancers, random_numbers, walk
from .light_groups import LightGroups
from .lights import Lights, Seen
from .materials.aovs import Aov, note_world
from .materials.materials import Materials, without_unused
from .materials.nodes_volume import with_step_rate
from .materials.wanted import Wanted
from .missing import note_missing
from .panorama import Looker
from .placing import (
    note_catchers,
    note_empty_view,
    note_hair_shaders,
    note_linked_glow,
    note_media,
    without_collapsed,
    without_unplaced,
)
from .properties import Value, sound, value_of
from .report import Report
from .shader_nodes.objects import OF_EACH
from .unheard import note_scene, note_subdivision
from .world import Sky, export_world, with_light_group, with_pass_settings


@dataclass(frozen=True, eq=False)
class Export:
    """What one export gives.

    scene: plain values, nothing of Blender's.
    notes: what could not be rendered as it is, each said once.
    stats: seconds per stage ("objects", "finish", "export") and counts ("meshes", "instances",
    "triangles", "lights", "materials", "textures", "bytes"). region: the render border as (x0, y0,
    x1, y1) pixels of the full frame, origin bottom left, or None. displaced: how meshes were, by
    their numbers among the scene's geometries. delta: from the scene before, None where none is
    known.
    """

    scene: Scene
    notes: tuple[str, ...] = ()
    stats: dict[str, float] = field(default_factory=dict)
    region: tuple[int, int, int, int] | None = None
    displaced: dict[int, Displaced] = field(default_factory=dict)
    delta: SceneDelta | None = None


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without Python's search for circles of garbage: an export makes ten values for each object
    and throws none away, and the searches take a quarter of the time of many objects.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@_uncollected()
def export_scene(
    depsgraph: Any,
    *,
    width: int | None = None,
    height: int | None = None,
    passes: frozenset[str] = frozenset(),
    decoded: Decoded | None = None,
    aovs: tuple[Aov, ...] = (),
    has_light_groups: bool = False,
    looker: Looker | None = None,
) -> Export:
    """The scene that an evaluated depsgraph shows, for its own view layer and frame.

    width, height: pixels of the full frame instead of the scene's. passes: names from
    `film.PASSES`; "UV" makes all meshes bring their active map. decoded: images of the export
    before; this one's take their place. aovs: passes of the view layer's own that are wanted.
    has_light_groups: whether those of its light groups are.
    looker: where to look from, None for the scene's camera.
    Only on Blender's thread. Raises ExportError where there is no usable camera or border.
    """
    start = time.perf_counter()
    scene, report = depsgraph.scene_eval, Report()
    size = resolution(scene.render, width, height)
    region = border(scene.render, size)
    through = evaluated(scene.camera, depsgraph) if looker is None else looker.camera
    camera = export_camera(through, scene.render, size, report, looker)
    groups = LightGroups.of(depsgraph.view_layer, report) if has_light_groups else LightGroups()
    wanted = Wanted(frozenset({""}) if "UV" in passes else frozenset())
    collector, things = _walked(depsgraph, wanted, report, decoded, aovs, groups)
    met = time.perf_counter()
    world = _world(depsgraph, scene)
    sky = export_world(world, scene.render.film_transparent, Images(report, decoded), report)
    sky = with_light_group(with_pass_settings(sky, scene.world), groups.number(world))
    note_scene(scene, report)
    note_missing(depsgraph, report)
    note_world(world, aovs, report)
    exported = collector.scene(camera, things, sky)
    if decoded is not None:
        decoded.forget_unused()
    end = time.perf_counter()
    stats = {
        "objects": met - start,
        "finish": end - met,
        "export": end - start,
        **counts(exported),
    }
    return Export(exported, report.notes(), stats, region, collector.displaced)


def _walked(depsgraph: Any, wanted: Wanted, report: Report, *given: Any) -> tuple[Collector, Any]:
    """What is met, with what materials read of it; and the things. Twice where rays of materials
    read what they meet, which is known only afterwards.
    """
    collector = Collector(depsgraph, wanted, report, *given)
    things = walk(depsgraph, collector.meet, report, make_hair=collector.meet_hair)
    everywhere = wanted | collector.materials.sampled
    if everywhere == wanted:
        return collector, things
    return _walked(depsgraph, everywhere, report, *given)


def seen_by(
    scene: Scene, looker: Looker, depsgraph: Any, width: int, height: int
) -> tuple[Scene, tuple[str, ...]]:
    """The scene with the camera of another view, and notes of it. Raises ExportError as
    `export_scene`.
    """
    render, report = depsgraph.scene_eval.render, Report()
    size = resolution(render, width, height)
    camera = export_camera(looker.camera, render, size, report, looker)
    return replace(scene, camera=camera), report.notes()


def evaluated(thing: Any, depsgraph: Any) -> Any:
    return thing.evaluated_get(depsgraph) if thing is not None else None


def _world(depsgraph: Any, scene: Any) -> Any:
    """The world that surrounds this view layer; None where the layer leaves the sky out."""
    if not depsgraph.view_layer.use_sky:
        return None
    override = getattr(depsgraph.view_layer, "world_override", None)
    return evaluated(override, depsgraph) if override is not None else scene.world


class _Placed(NamedTuple):
    """A geometry with what its instances need. values: what programs read of it;
    of_each: names of what they read of each instance by itself. asset, light_group: as
    `Instances` has it. is_bound: its geometry depends on where it stands.
    """

    geometry: int
    materials: tuple[int, ...]
    object_index: int
    flags: Flags
    values: tuple[tuple[str, Value], ...] = ()
    of_each: tuple[str, ...] = ()
    asset: str = ""
    is_bound: bool = False
    light_group: int = -1


class _Lamp(NamedTuple):
    light: Any
    seen: Seen


class Collector:
    """Gathers geometries and materials while the depsgraph is walked."""

    def __init__(
        self,
        depsgraph: Any,
        wanted: Wanted,
        report: Report,
        decoded: Decoded | None = None,
        aovs: tuple[Aov, ...] = (),
        light_groups: LightGroups | None = None,
    ) -> None:
        self.light_groups = light_groups or LightGroups()
        self.depsgraph, self.wanted, self.report = depsgraph, wanted, report
        self.images = Images(report, decoded)
        self.materials = Materials(self.images, report, aovs)
        self.lights = Lights(self.images, report)
        self.override = evaluated(depsgraph.view_layer.material_override, depsgraph)
        self._geometries: list[MeshSource | StrandSource | Geometry] = []
        self._known: dict[tuple, int | None] = {}
        self._wanted_by_slots: dict[tuple[int, ...], Wanted] = {}
        self._moves_by_slots: dict[tuple[int, ...], tuple[Displacement | None, ...]] = {}
        self.displaced: dict[int, Displaced] = {}

    def meet(self, instance: Any, flags: Flags) -> _Placed | _Lamp | None:
        """What an object is to the scene; None for what has no shape of its own (curves come again
        as meshes).
        """
        thing = instance.object
        owner = instance.instance_object or thing  # the one that is not temporary
        data = thing.data
        if thing.type == "LIGHT":
            group = self.light_groups.number(thing)
            seen = Seen(flags.camera, flags.mirror, flags.receivers, flags.blockers, group)
            return _Lamp(data, seen)
        match type(data).__name__:
            case "Mesh" if self.depsgraph.view_layer.use_solid:
                geometry = self._mesh(data, owner)
            case "PointCloud":
                geometry = self._points(data)
            case "Curves":
                geometry = self._curves(data, owner)
            case "Volume":
                return self._volume(instance, flags)
            case _:
                return None
        return self._place(instance, flags, geometry)

    def meet_hair(self, instance: Any, flags: Flags) -> _Placed | None:
        """The particle hair of an object, where its layer shows any."""
        if not self.depsgraph.view_layer.use_strand:
            return None
        thing = instance.object
        return self._place(instance, flags, self._hair(thing, instance.instance_object or thing))

    def _place(self, instance: Any, flags: Flags, geometry: int | None) -> _Placed | None:
        if geometry is None:
            return None
        thing = instance.object
        slots = self._slots(thing, self._used_slots(geometry))
        values, of_each = self._values(slots, instance)
        moves = self._moves(slots)
        is_bound = False
        if moves:
            is_bound = any(one is not None and one.is_placed for one in moves)
            geometry = self._displaced(instance, geometry, moves, values if is_bound else None)
        if isinstance(self._geometry(geometry), MeshSource | StrandSource):
            owner = instance.instance_object or thing
            self._add_attributes(geometry, thing.data, owner, self._wanted(slots))
        elif self.materials.wanted(slots):
            self.report.note(
                "True spheres have no UV maps or attributes, which materials read: {}; render them "
                "as meshes",
                thing.name,
            )
        return _Placed(
            geometry, slots, thing.pass_index, flags, values, of_each, _asset(thing), is_bound,
            self.light_groups.number(thing),
        )  # fmt: skip

    def _values(
        self, slots: tuple[int, ...], instance: Any
    ) -> tuple[tuple[tuple[str, Value], ...], tuple[str, ...]]:
        """What the materials in these slots read of an instance, and of each by itself."""
        wanted = self._wanted(slots).objects
        of_each = tuple(name for name in OF_EACH if name in wanted and instance.is_instance)
        return tuple((name, self._value(name, instance)) for name in sorted(wanted)), of_each

    def _volume(self, instance: Any, flags: Flags) -> _Placed | None:
        """A Volume object; None where it shows nothing."""
        thing = instance.object
        volume = read_volume(thing.data, instance.instance_object or thing, self.report)
        if volume is None:
            return None
        slots = thing.material_slots
        material = self.override or (slots[0].material if slots else None)
        number, surface = self.materials.volume(material, volume)
        if surface is None:
            return None
        return _Placed(
            self._around(surface), (number,), thing.pass_index, flags,
            *self._values((number,), instance), _asset(thing),
            light_group=self.light_groups.number(thing),
        )  # fmt: skip

    def _around(self, surface: MeshSource) -> int:
        """Index of the surface round a volume."""
        key = ("volume", id(surface))
        if key not in self._known:
            self._known[key] = self._append(surface)
        return self._known[key]

    def _displaced(
        self,
        instance: Any,
        number: int,
        moves: tuple[Displacement | None, ...],
        values: tuple[tuple[str, Value], ...] | None,
    ) -> int:
        """Index of a geometry as materials displace it. values: of the placement on which that
        depends, None where it does not.
        """
        thing, source = instance.object, self._geometry(number)
        if not isinstance(source, MeshSource):
            if not isinstance(source, StrandSource):
                self.report.note(
                    "True spheres are not displaced: {}; render them as meshes", thing.name
                )
            return number
        owner = instance.instance_object or thing
        place, key = Place(), ("displaced", mesh_key(thing.data), moves)
        if values is not None:
            matrix = np.array(instance.matrix_world, np.float64)[:3]
            place, key = Place(matrix, dict(values)), (*key, matrix.tobytes(), values)
            if not np.isfinite(matrix).all():
                return number
        return self._met(
            key, lambda report: displaced_source(thing.data, owner, source, moves, place, report),
            owner,
        )  # fmt: skip

    def _value(self, name: str, instance: Any) -> Value:
        view_layer, scene = self.depsgraph.view_layer_eval, self.depsgraph.scene_eval
        found = value_of(name, instance, view_layer, scene)
        if found != sound(found):
            self.report.note(
                "Properties that are not finite in single precision count as 0 ({}): set them anew",
                f"{name.partition(':')[2] or name} of {instance.object.name}",
            )
        return sound(found)

    def instances(self, thing: Thing) -> Instances:
        """Where a thing stands and as what it is seen."""
        placed, flags = thing.content, thing.content.flags
        if placed.is_bound and len(thing.matrices) > 1:
            self.report.note(
                "Instances are displaced as the first of them, although that depends on where they "
                "stand: {}; use object space, or objects of their own",
                thing.name,
            )
        count = len(thing.matrices)
        values = {
            name: np.tile(np.array(value, np.float32), (count, 1)) for name, value in placed.values
        }
        for name in placed.of_each:
            values[name] = self._of_instances[name][thing.numbers]
        return Instances(
            thing.name, placed.geometry, thing.matrices, placed.materials, placed.object_index,
            flags.camera, flags.mirror, flags.shadow, flags.holdout, values, flags.light_set,
            asset=placed.asset, catcher=flags.catcher, light_group=placed.light_group,
            receivers=flags.receivers, blockers=flags.blockers,
        )  # fmt: skip

    @cached_property
    def _of_instances(self) -> dict[str, np.ndarray]:
        """(count, 4) float32 each of every instance, by the names of `OF_EACH`."""
        random = np.repeat(random_numbers(self.depsgraph)[:, None], 4, 1)
        places = (np.pad(p, ((0, 0), (0, 1))) for p in places_on_instancers(self.depsgraph))
        return dict(zip(OF_EACH, (random, *places), strict=True))

    def _slots(self, thing: Any, used: tuple[int, ...]) -> tuple[int, ...]:
        """The materials of an object's slots up to the last that some face uses. A slot that none
        uses takes what another has, so that materials nobody sees are not read.
        """
        if self.override is not None:
            return (self.materials.index(self.override),)
        slots = thing.material_slots
        if not slots:
            return (self.materials.index(None),)
        if used == (0,):
            return (self.materials.index(slots[0].material),)
        numbers = {
            k: self.materials.index(slots[k].material)
            for k in dict.fromkeys(min(k, len(slots) - 1) for k in used)
        }
        return tuple(numbers.get(k, numbers[min(numbers)]) for k in range(max(numbers) + 1))

    def _wanted(self, slots: tuple[int, ...]) -> Wanted:
        """What the passes and the materials in these slots read of a mesh."""
        if slots not in self._wanted_by_slots:
            self._wanted_by_slots[slots] = self.wanted | self.materials.wanted(slots)
        return self._wanted_by_slots[slots]

    def _moves(self, slots: tuple[int, ...]) -> tuple[Displacement | None, ...]:
        """How the materials in these slots move vertices; empty where none does."""
        if slots not in self._moves_by_slots:
            self._moves_by_slots[slots] = self.materials.displacements(slots)
        return self._moves_by_slots[slots]

    def _geometry(self, number: int) -> MeshSource | StrandSource | Geometry:
        return self._geometries[number]

    def _used_slots(self, number: int) -> tuple[int, ...]:
        geometry = self._geometry(number)
        return getattr(geometry, "used_slots", (0,))

    def _mesh(self, data: Any, owner: Any) -> int | None:
        """Index of a mesh's geometry, which is a sphere where it is marked as one, read when first
        met; None without faces.
        """

        def read(report: Report) -> MeshSource | Spheres | None:
            note_subdivision(owner.name, owner, report)
            return read_shape(data, owner, report)

        return self._met(mesh_key(data), read, owner)

    def _met(
        self, key: tuple, read: Callable[[Report], MeshSource | Geometry | None], owner: Any
    ) -> int | None:
        """Index of the geometry with this key, read when first met; None where it has nothing.
        owner: an object that has it.
        """
        if key not in self._known:
            self._known[key] = self._append(read(self.report))
        return self._known[key]

    def _add_attributes(self, number: int, data: Any, owner: Any, wanted: Wanted) -> None:
        """What an object's materials read of its mesh."""
        if wanted:
            self._read_attributes(data, owner, self._geometries[number], wanted, self.report)

    def _read_attributes(
        self,
        data: Any,
        owner: Any,
        source: MeshSource | StrandSource,
        wanted: Wanted,
        report: Report,
    ) -> None:
        if isinstance(source, StrandSource):
            read_strand_attributes(data, owner, source, wanted, report, self.is_render)
            return
        with readable(data, owner) as mesh:
            read_attributes(mesh, source, wanted, report)

    @property
    def is_render(self) -> bool:
        """Whether the settings for renders count, not those for the viewport."""
        return self.depsgraph.mode == "RENDER"

    def _curves(self, data: Any, owner: Any) -> int | None:
        key = (data.as_pointer(), len(data.points), data.name)
        if key not in self._known:
            self._known[key] = self._append(read_curves(data, self.depsgraph.scene_eval))
        return self._known[key]

    def _hair(self, thing: Any, owner: Any) -> int | None:
        key = ("hair", owner.original.session_uid, thing.data.as_pointer())
        if key not in self._known:
            found = read_hair(thing, self.depsgraph.scene_eval, self.is_render)
            self._known[key] = self._append(found)
        return self._known[key]

    def _points(self, cloud: Any) -> int | None:
        key = (cloud.as_pointer(), len(cloud.points), cloud.name)
        if key not in self._known:
            self._known[key] = self._append(export_points(cloud))
        return self._known[key]

    def _append(self, geometry: MeshSource | StrandSource | Geometry | None) -> int | None:
        if geometry is None:
            return None
        self._geometries.append(geometry)
        return len(self._geometries) - 1

    def scene(self, camera: Any, things: list[Thing], sky: Sky) -> Scene:
        """All of it as one value."""
        geometries = tuple(
            g.finished() if isinstance(g, MeshSource | StrandSource) else g
            for g in self._geometries
        )
        instances = tuple(
            self.instances(thing) for thing in things if isinstance(thing.content, _Placed)
        )
        how = {k: g.displaced for k, g in enumerate(self._geometries) if is_displaced(g)}
        if how:
            instances, kept = without_unplaced(instances, len(geometries))
            geometries = tuple(geometries[k] for k in kept)
            self.displaced = {n: how[k] for n, k in enumerate(kept) if k in how}
        instances = without_collapsed(instances, self.report)
        note_empty_view(
            camera, geometries, instances, self.report, self.depsgraph.scene_eval.camera.name
        )
        for thing in things:
            if isinstance(thing.content, _Lamp):
                self.lights.add(thing.name, thing.content.light, thing.matrices, thing.content.seen)
        note_catchers(instances, self.materials.materials, self.report)
        note_linked_glow(instances, self.materials.materials, self.report)
        note_media(instances, self.materials.materials, self.report)
        note_hair_shaders(instances, geometries, self.materials.materials, self.report)
        materials, textures = without_unused(self.materials.materials, self.images.textures)
        lights, set_by = sky.lights_with(self.lights.lights), self.depsgraph.scene_eval
        materials, (world,) = (with_step_rate(m, set_by) for m in (materials, (sky.world,)))
        names = tuple(aov.name for aov in self.materials.aovs)
        return Scene(
            camera, geometries, instances, materials, textures, lights, world, names,
            light_groups=self.light_groups.names,
        )  # fmt: skip


def is_displaced(geometry: Any) -> bool:
    """Whether it is a mesh that its materials displace."""
    return getattr(geometry, "displaced", None) is not None


def _asset(thing: Any) -> str:
    """The name of an object's topmost parent, as Cycles' Cryptomatte has it; "" where it has none
    but itself.
    """
    top = thing
    while top.parent is not None:
        top = top.parent
    return top.name if top is not thing else ""


def counts(scene: Scene) -> dict[str, float]:
    """How much there is, and the bytes of its arrays."""
    per_geometry = [len(getattr(g, "triangles", ())) for g in scene.geometries]
    arrays = [a for g in scene.geometries for a in _arrays(g)]
    textures = [*scene.textures, *scene.world.textures]
    textures += [texture for light in scene.lights for texture in light.textures]
    arrays += [i.world_from_object for i in scene.instances] + [t.pixels for t in textures]
    arrays += [light.radiance for light in scene.lights if light.radiance is not None]
    return {
        "meshes": len(scene.geometries),
        "instances": sum(len(i.world_from_object) for i in scene.instances),
        "triangles": sum(per_geometry),
        "segments": sum(len(g.starts) for g in scene.geometries if isinstance(g, Strands)),
        "placed_triangles": sum(
            len(i.world_from_object) * per_geometry[i.geometry] for i in scene.instances
        ),
        "lights": len(scene.lights),
        "materials": len(scene.materials),
        "textures": len({id(texture.pixels) for texture in textures}),
        "bytes": sum({id(a): a.nbytes for a in arrays}.values()),
    }


def _arrays(geometry: Geometry) -> list[np.ndarray]:
    values = list(vars(geometry).values())
    values += [
        a.values
        for a in (
            *getattr(geometry, "attributes", ()),
            *filter(None, [getattr(geometry, "normals", None)]),
        )
    ]
    return [value for value in values if isinstance(value, np.ndarray)]
