"""Gathers what a walk over the depsgraph meets, and makes a scene of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...engine.displacement import Displacement, Place
from ...engine.scene import Camera, Geometry, Instances, Scene
from .cache import ExportCache
from .geometry.cache import Requirements, Shape, ShapeKey, Source
from .geometry.displacing import Displaced, displaced_source
from .geometry.meshes import MeshSource, mesh_key, read_attributes, readable
from .geometry.points import PointSource, read_point_attributes, read_points
from .geometry.shapes import read_shape
from .geometry.strand_attributes import read_strand_attributes
from .geometry.strands import StrandSource, read_curves, read_hair
from .geometry.volumes import read_volume
from .images.decoded import Decoded
from .images.images import Images
from .instance_attributes import InstanceAttributes
from .instances import ExportedObject, Flags, places_on_instancers, random_numbers
from .light_groups import LightGroups
from .lights import Lights
from .materials.aovs import Aov
from .materials.materials import Materials
from .materials.nodes_volume import with_step_rate
from .materials.required import RequiredAttributes
from .placing import without_collapsed, without_unplaced
from .properties import Value, sound, value_of
from .report import Report
from .shader_nodes.objects import INSTANCER, OF_EACH
from .unsupported import note_subdivision
from .world import Sky


class Placed(NamedTuple):
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


class Lamp(NamedTuple):
    """A light data-block, its object's visibility, and its light group."""

    light: Any
    flags: Flags
    light_group: int


class Collector:
    """Gathers geometries and materials while the depsgraph is walked.

    met: the shapes of what was met.  groups, lamps: after `scene`, where in it each thing is, None
    for what is not there as it is, or depends on where it stands. displaced: how geometries were,
    by their numbers.
    """

    def __init__(
        self,
        depsgraph: Any,
        required: RequiredAttributes,
        report: Report,
        cache: ExportCache,
        light_groups: LightGroups,
        decoded: Decoded | None = None,
        aovs: tuple[Aov, ...] = (),
    ) -> None:
        """report: of all but the materials, which have their own."""
        self.light_groups = light_groups
        self.depsgraph, self.required, self.report = depsgraph, required, report
        self.materials = Materials(cache, decoded, aovs)
        self.lights = Lights(Images(report, decoded, cache.images), report)
        self.override = evaluated(depsgraph.view_layer.material_override, depsgraph)
        self.met: dict[ShapeKey, Shape] = {}
        self.groups: list[tuple[ExportedObject, int | None]] = []
        self.lamps: list[tuple[ExportedObject, int | None]] = []
        self._cache = cache
        self._shapes: list[Shape] = []
        self._requirements: list[Requirements] = []
        self._known: dict[ShapeKey, int | None] = {}
        self._required_by_slots: dict[tuple[int, ...], RequiredAttributes] = {}
        self._moves_by_slots: dict[tuple[int, ...], tuple[Displacement | None, ...]] = {}
        self.displaced: dict[int, Displaced] = {}
        self._instancers: dict[int, Any] = {}

    def meet(self, instance: Any, flags: Flags) -> Placed | Lamp | None:
        """What an object is to the scene; None for what has no shape of its own (curves come again
        as meshes).
        """
        thing = instance.object
        owner = instance.instance_object or thing  # the one that is not temporary
        data = thing.data
        if thing.type == "LIGHT":
            return Lamp(data, flags, self.light_groups.number(thing))
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

    def meet_hair(self, instance: Any, flags: Flags) -> Placed | None:
        """The particle hair of an object, where its layer shows any."""
        if not self.depsgraph.view_layer.use_strand:
            return None
        thing = instance.object
        return self._place(instance, flags, self._hair(thing, instance.instance_object or thing))

    def _place(self, instance: Any, flags: Flags, geometry: int | None) -> Placed | None:
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
        if isinstance(self._shapes[geometry].geometry, Source):
            owner = instance.instance_object or thing
            self._add_attributes(geometry, thing.data, owner, self._required(slots))
        elif self.materials.required(slots):
            self.report.note(
                "True spheres have no UV maps or attributes, which materials read: {}; render them "
                "as meshes",
                thing.name,
            )
        return Placed(
            geometry, slots, thing.pass_index, flags, values, of_each, _asset(thing), is_bound,
            self.light_groups.number(thing),
        )  # fmt: skip

    def _values(
        self, slots: tuple[int, ...], instance: Any
    ) -> tuple[tuple[tuple[str, Value], ...], tuple[str, ...]]:
        """What the materials in these slots read of an instance, and of each by itself."""
        required = self._required(slots).objects
        of_each = ()
        if instance.is_instance and required:
            self._instancers[instance.parent.original.session_uid] = instance.parent
            of_each = tuple(sorted(n for n in required if n in OF_EACH or n.startswith(INSTANCER)))
        return tuple((name, self._value(name, instance)) for name in sorted(required)), of_each

    def _volume(self, instance: Any, flags: Flags) -> Placed | None:
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
        return Placed(
            self._around(surface), (number,), thing.pass_index, flags,
            *self._values((number,), instance), _asset(thing),
            light_group=self.light_groups.number(thing),
        )  # fmt: skip

    def _around(self, surface: MeshSource) -> int:
        """Index of the surface round a volume."""
        return self._met(ShapeKey("volume", (id(surface),)), lambda report: surface)

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
        thing, source = instance.object, self._shapes[number].geometry
        if not isinstance(source, MeshSource):
            if not isinstance(source, StrandSource):
                self.report.note(
                    "True spheres are not displaced: {}; render them as meshes", thing.name
                )
            return number
        owner = instance.instance_object or thing
        place, key = Place(), (mesh_key(thing.data), moves)
        if values is not None:
            matrix = np.array(instance.matrix_world, np.float64)[:3]
            place, key = Place(matrix, dict(values)), (*key, matrix.tobytes(), values)
            if not np.isfinite(matrix).all():
                return number
        return self._met(
            ShapeKey("displaced", key),
            lambda report: displaced_source(thing.data, owner, source, moves, place, report),
            owner,
        )

    def _value(self, name: str, instance: Any) -> Value:
        view_layer, scene = self.depsgraph.view_layer_eval, self.depsgraph.scene_eval
        found = value_of(name, instance, view_layer, scene)
        if found != sound(found):
            self.report.note(
                "Properties that are not finite in single precision count as 0 ({}): set them anew",
                f"{name.partition(':')[2] or name} of {instance.object.name}",
            )
        return sound(found)

    def instances(self, thing: ExportedObject) -> Instances:
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
            if name in OF_EACH:
                values[name] = self._of_instances[name][thing.numbers]
            else:
                plain, instancer = name.removeprefix(INSTANCER), self._instancers[thing.instancer]
                self._attributes.overlay(plain, instancer, thing.numbers, values[name])
        return Instances(
            thing.name, placed.geometry, thing.matrices, placed.materials, placed.object_index,
            flags.camera, flags.mirror, flags.shadow, flags.holdout, values, flags.light_set,
            asset=placed.asset, catcher=flags.catcher, light_group=placed.light_group,
            receivers=flags.receivers, blockers=flags.blockers,
            visible_transmission=flags.transmission,
            visible_diffuse=flags.diffuse, visible_media=flags.media,
            geometry_offset=flags.offsets[0], shading_offset=flags.offsets[1],
        )  # fmt: skip

    @cached_property
    def _attributes(self) -> InstanceAttributes:
        return InstanceAttributes(self.depsgraph, self.report)

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

    def _required(self, slots: tuple[int, ...]) -> RequiredAttributes:
        """What the passes and the materials in these slots read of a mesh."""
        if slots not in self._required_by_slots:
            self._required_by_slots[slots] = self.required | self.materials.required(slots)
        return self._required_by_slots[slots]

    def _moves(self, slots: tuple[int, ...]) -> tuple[Displacement | None, ...]:
        """How the materials in these slots move vertices; empty where none does."""
        if slots not in self._moves_by_slots:
            self._moves_by_slots[slots] = self.materials.displacements(slots)
        return self._moves_by_slots[slots]

    def _used_slots(self, number: int) -> tuple[int, ...]:
        return getattr(self._shapes[number].geometry, "used_slots", (0,))

    def _mesh(self, data: Any, owner: Any) -> int | None:
        """Index of a mesh's geometry, which is a sphere where it is marked as one; None without
        faces.
        """

        def read(report: Report) -> Source | Geometry | None:
            note_subdivision(owner.name, owner, report)
            return read_shape(data, owner, report)

        return self._met(ShapeKey("mesh", mesh_key(data)), read, owner)

    def _met(
        self, key: ShapeKey, read: Callable[[Report], Source | Geometry | None], *about: Any
    ) -> int | None:
        """Index of the geometry with this key, read where no export knows it; None where it has
        nothing. about: data-blocks that Blender tells of when it changes.
        """
        shape = self.met.get(key)
        if shape is None:
            shape = self._cache.shapes.shape(key)
            if shape is None:
                report = Report()
                self._cache.work["meshes"] += 1
                shape = Shape(read(report), report=report)
            self.met[key] = shape
            self.report.add(shape.report)
            self._known[key] = None if shape.geometry is None else len(self._shapes)
            if shape.geometry is not None:
                self._shapes.append(shape)
                self._requirements.append(())
        for block in about:
            shape.about.add(block.original.session_uid)
        return self._known[key]

    def _add_attributes(
        self, number: int, data: Any, owner: Any, required: RequiredAttributes
    ) -> None:
        """What an object's materials read of its mesh."""
        if not required:
            return
        shape, before = self._shapes[number], self._requirements[number]
        requirements = self._requirements[number] = (
            before if required in before else (*before, required)
        )

        def read(source: Source) -> None:
            if isinstance(source, PointSource):
                read_point_attributes(data, source, required, shape.report)
                return
            if isinstance(source, StrandSource):
                read_strand_attributes(data, owner, source, required, shape.report, self.is_render)
                return
            with readable(data, owner) as mesh:
                read_attributes(mesh, source, required, shape.report)

        shape.read_attributes(before, requirements, read)

    @property
    def is_render(self) -> bool:
        """Whether the settings for renders count, not those for the viewport."""
        return self.depsgraph.mode == "RENDER"

    def _curves(self, data: Any, owner: Any) -> int | None:
        scene, key = self.depsgraph.scene_eval, (data.as_pointer(), len(data.points), data.name)
        return self._met(
            ShapeKey("curves", (*key, self._curve_shape)),
            lambda report: read_curves(data, scene),
            owner,
            data,
        )

    def _hair(self, thing: Any, owner: Any) -> int | None:
        scene, key = (
            self.depsgraph.scene_eval,
            (owner.original.session_uid, thing.data.as_pointer()),
        )
        return self._met(
            ShapeKey("hair", (*key, self._curve_shape)),
            lambda report: read_hair(thing, scene, self.is_render),
            owner,
            *(system.settings for system in thing.particle_systems),
        )

    def _points(self, cloud: Any) -> int | None:
        key = (cloud.as_pointer(), len(cloud.points), cloud.name)
        return self._met(ShapeKey("points", key), lambda report: read_points(cloud), cloud)

    @property
    def _curve_shape(self) -> str:
        """How Cycles' settings say that curves go between keys."""
        return getattr(getattr(self.depsgraph.scene_eval, "cycles_curves", None), "shape", "")

    def scene(
        self,
        camera: Camera,
        things: list[ExportedObject],
        sky: Sky,
        *,
        keeps_collapsed: bool = False,
    ) -> Scene:
        """All of it as one value. keeps_collapsed: with placements that leave no surface."""
        placed = [thing for thing in things if isinstance(thing.content, Placed)]
        blocks = tuple(self.instances(thing) for thing in placed)
        blocks, kept = without_unplaced(blocks, len(self._shapes))
        shapes = [self._shapes[number] for number in kept]
        self.displaced = {k: s.geometry.displaced for k, s in enumerate(shapes) if _is_displaced(s)}
        geometries = tuple(self._shapes[k].as_required(self._requirements[k]) for k in kept)
        instances = blocks if keeps_collapsed else without_collapsed(blocks, self.report)
        numbers = {id(block): number for number, block in enumerate(instances)}
        for thing, block in zip(placed, blocks, strict=True):
            number = None if thing.content.is_bound else numbers.get(id(block))
            self.groups.append((thing, number))
        for thing in things:
            if isinstance(thing.content, Lamp):
                self.lamps.append((thing, self._light(thing)))
        for shape in self._shapes:
            self.report.add(shape.report)  # of their attributes
        materials, textures = self.materials.joined()
        set_by = self.depsgraph.scene_eval
        materials, (world,) = (with_step_rate(m, set_by) for m in (materials, (sky.world,)))
        return Scene(
            camera,
            geometries,
            instances,
            materials,
            textures,
            sky.lights_with(self.lights),
            world,
            tuple(aov.name for aov in self.materials.aovs),
            light_groups=self.light_groups.names,
        )

    def _light(self, thing: ExportedObject) -> int | None:
        """Adds a lamp's lights; the number of the one where there is just one."""
        first = len(self.lights.lights)
        lamp = thing.content
        self.lights.add(thing.name, lamp.light, thing.matrices, lamp.flags, lamp.light_group)
        return first if len(self.lights.lights) == first + 1 else None


def _is_displaced(shape: Shape) -> bool:
    """Whether it is a mesh that its materials displace."""
    return getattr(shape.geometry, "displaced", None) is not None


def evaluated(thing: Any, depsgraph: Any) -> Any:
    """As the depsgraph has it; None for None."""
    return thing.evaluated_get(depsgraph) if thing is not None else None


def _asset(thing: Any) -> str:
    """The name of an object's topmost parent, as Cycles' Cryptomatte has it; "" where it has none
    but itself.
    """
    top = thing
    while top.parent is not None:
        top = top.parent
    return top.name if top is not thing else ""
