"""What moves: places and shapes at one time after the other, matched to the scene of the frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ...engine.scene import Geometry, Instances, Light, Mesh, Scene, Spheres, Strands
from .geometry.displacing import Displaced
from .geometry.meshes import mesh_key, normals_of, vertices_of
from .geometry.shapes import centers_of
from .geometry.strands import StrandSource, read_curves, read_hair
from .instances import ExportedObject, Flags, walk
from .lights import light_frame
from .report import Report

Array = np.ndarray

_FEWEST, _MOST = 3, 9
"""Keys that Cycles gives objects by default, and the most that are taken."""


class Sentences(NamedTuple):
    """What is told of things that stand still all the same, and of meshes that keep their shape, as
    hair and point clouds do.
    """

    gone: str
    remade: str
    recombed: str = ""


WHILE_OPEN = Sentences(
    "Objects that are not there for all the shutter's time, or come in other numbers, "
    "stand still: {}",
    "Meshes whose number of vertices or faces changes while the shutter is open keep "
    "their shape: {}",
)
FROM_FRAME_TO_FRAME = Sentences(
    "Objects that are not there in the frames before and after, or come in other numbers, stand "
    "still in the pass Vector: {}",
    "Meshes whose number of vertices or faces changes from frame to frame keep their shape in the "
    "pass Vector: {}",
    "Hair and point clouds that change their number of points from frame to frame keep their shape "
    "in the pass Vector: {}",
)


class Shape(NamedTuple):
    """A mesh at one time. faces: how many polygons and corners, which must not change.  normals:
    with the domain, None for a flat mesh.
    """

    vertices: Array
    faces: tuple[int, int]
    normals: tuple[str, Array] | None


class _Mover(NamedTuple):
    """What a thing is. shape: its mesh's key, None for what is none.  keys, shape_keys: at how many
    times it is looked at; 1 for what is to stand still.
    """

    is_light: bool
    shape: tuple | None
    keys: int
    shape_keys: int


@dataclass(eq=False)
class Pose:
    """One time. things: in the order of the walk.  shapes: meshes by their keys, and for the pass
    Vector strands and the centres of point clouds.  ids: (instances, 8) Blender's persistent ids.
    """

    things: list[ExportedObject]
    shapes: dict[tuple, Shape | StrandSource | Array | None] = field(default_factory=dict)
    ids: Array = field(default_factory=lambda: np.zeros((0, 8), np.int32))

    @property
    def most_keys(self) -> int:
        """That anything here asks for."""
        movers = [thing.content for thing in self.things]
        return max((max(m.keys, m.shape_keys) for m in movers), default=_FEWEST)


def read_pose(depsgraph: Any, for_vectors: bool = False) -> Pose:
    """Where everything stands that `export_scene` would export, and its shape. Only on Blender's
    thread; arrays are copies.

    for_vectors: without normals, and whatever objects say of their motion blur, as in Cycles.
    """
    pose = Pose([])
    reader = _Reader(depsgraph, for_vectors, pose)
    pose.things = walk(depsgraph, reader.meet, Report(), make_hair=reader.meet_hair)
    pose.ids = np.zeros((len(depsgraph.object_instances), 8), np.int32)
    if len(pose.ids):
        depsgraph.object_instances.foreach_get("persistent_id", pose.ids.reshape(-1))
    return pose


_BENDING: dict[str, Callable] = {
    "PointCloud": lambda data, scene: centers_of(data),
    "Curves": read_curves,
}
"""What the pass Vector reads of these data-blocks."""


@dataclass(eq=False)
class _Reader:
    """Fills a pose while the depsgraph is walked."""

    depsgraph: Any
    for_vectors: bool
    pose: Pose

    def meet_hair(self, instance: Any, flags: Flags) -> _Mover:
        if not self.for_vectors:
            return self._still(instance)
        thing = instance.object
        owner = (instance.instance_object or thing).original.session_uid
        key, render = ("hair", owner, thing.data.as_pointer()), self.depsgraph.mode == "RENDER"
        return self._bending(key, read_hair, thing, self.depsgraph.scene_eval, render)

    def meet(self, instance: Any, flags: Flags) -> _Mover | None:
        thing, data = instance.object, instance.object.data
        kind = type(data).__name__
        if thing.type == "LIGHT":
            return _Mover(True, None, self._keys_of(instance), 1)
        if kind not in ("Mesh", "PointCloud", "Curves", "Volume"):
            return None
        if self.for_vectors and kind in _BENDING:
            key = (kind, data.as_pointer())
            return self._bending(key, _BENDING[kind], data, self.depsgraph.scene_eval)
        if kind != "Mesh" or data.is_editmode:
            return self._still(instance)
        key = mesh_key(data)
        if key not in self.pose.shapes:
            self.pose.shapes[key] = _shape(data, not self.for_vectors)
        shape_keys = _FEWEST if self.for_vectors else _shape_keys_of(instance)
        return _Mover(False, key, self._keys_of(instance), shape_keys)

    def _keys_of(self, instance: Any) -> int:
        return _FEWEST if self.for_vectors else _keys_of(instance)

    def _still(self, instance: Any) -> _Mover:
        return _Mover(False, None, self._keys_of(instance), 1)

    def _bending(self, key: tuple, read: Callable, *arguments: Any) -> _Mover:
        """Of strands and true spheres, read when first met."""
        if key not in self.pose.shapes:
            self.pose.shapes[key] = read(*arguments)
        return _Mover(False, key, _FEWEST, _FEWEST)


def _shape(mesh: Any, with_normals: bool) -> Shape:
    if len(mesh.vertices) == 0:
        return Shape(np.zeros((0, 3), np.float32), (0, 0), None)
    normals = normals_of(mesh) if with_normals else None
    return Shape(vertices_of(mesh), (len(mesh.polygons), len(mesh.loops)), normals)


def _owners(instance: Any) -> Iterator[Any]:
    """Cycles' settings of the object, and of what instances it."""
    for thing in (instance.object, instance.parent if instance.is_instance else None):
        settings = getattr(thing, "cycles", None)
        if settings is not None:
            yield settings


def _keys_of(instance: Any) -> int:
    """As Cycles has them: 2 to the power of its steps, and one; 1 where its motion is off."""
    settings = list(_owners(instance))
    if not all(getattr(one, "use_motion_blur", True) for one in settings):
        return 1
    steps = max((getattr(one, "motion_steps", 1) for one in settings), default=1)
    return min(2 ** max(steps, 1) + 1, _MOST)


def _shape_keys_of(instance: Any) -> int:
    settings = next(_owners(instance), None)
    return _keys_of(instance) if getattr(settings, "use_deform_motion", True) else 1


def moved(
    scene: Scene,
    frame: Pose,
    keys: list[Pose],
    report: Report,
    sentences: Sentences = WHILE_OPEN,
    displaced: Mapping[int, Displaced] = MappingProxyType({}),
) -> Scene:
    """The scene with the motion of what moves from one key to the next.

    frame: when the scene was exported.  keys: at even times while the shutter is open, 2 to some
    power and one of them. displaced: of geometries, by their numbers, which are displaced at all
    times as at that of the frame.
    """
    matcher = _Matcher(frame, keys, report, sentences)
    geometries = list(scene.geometries)
    instances = list(scene.instances)
    for number, thing in _exported(scene.instances, frame.things):
        block = instances[number]
        instances[number] = replace(block, motion=matcher.placements(thing))
        if isinstance(geometries[block.geometry], Mesh):
            how = displaced.get(block.geometry)
            geometries[block.geometry] = matcher.shape(thing, geometries[block.geometry], how)
    lights = tuple(matcher.light(light) for light in scene.lights)
    return replace(scene, geometries=tuple(geometries), instances=tuple(instances), lights=lights)


def bent(
    scene: Scene, frame: Pose, keys: list[Pose], report: Report, sentences: Sentences
) -> dict[int, list[Geometry]]:
    """Strands and true spheres that move within their objects, by their numbers: as they are at the
    keys. Arguments as of `moved`.
    """
    matcher, found = _Matcher(frame, keys, report, sentences), dict[int, list[Geometry]]()
    # meshes may have the names and places of point clouds that their modifiers make
    kinds = StrandSource | np.ndarray
    things = [t for t in frame.things if isinstance(frame.shapes.get(t.content.shape), kinds)]
    blocks = [
        block
        for block in scene.instances
        if isinstance(scene.geometries[block.geometry], Strands | Spheres)
    ]
    for number, thing in _exported(tuple(blocks), things):
        place = blocks[number].geometry
        shapes = None if place in found else matcher.points(thing, scene.geometries[place])
        if shapes is not None:
            found[place] = shapes
    return found


def at_key(
    scene: Scene,
    still: Scene,
    k: int,
    others: Mapping[int, list[Geometry]] = MappingProxyType({}),
) -> Scene:
    """What `moved` made of `still`, at a key that all that moves has, and `bent` of `others`;
    lights stay.
    """
    geometries = (
        others[number][k]
        if number in others
        else replace(g, vertices=g.motion[k], motion=None)
        if getattr(g, "motion", None) is not None
        else g
        for number, g in enumerate(scene.geometries)
    )
    instances = (
        replace(block, world_from_object=block.motion[k], motion=None)
        if block.motion is not None
        else block
        for block in scene.instances
    )
    return replace(still, geometries=tuple(geometries), instances=tuple(instances))


def _exported(
    blocks: tuple[Instances, ...], things: list[ExportedObject]
) -> Iterator[tuple[int, ExportedObject]]:
    """Numbers of blocks with the things that they were made from: both are in one order, in which
    blocks may be missing, and some may have rows of a thing alone.
    """
    ahead = [thing for thing in things if not thing.content.is_light]
    first = 0
    for number, block in enumerate(blocks):
        for place in range(first, len(ahead)):
            thing = ahead[place]
            if thing.name == block.name and np.array_equal(thing.matrices, block.world_from_object):
                yield number, thing
                first = place + 1
                break


class _Matcher:
    """Finds the things of the frame at the other times."""

    def __init__(self, frame: Pose, keys: list[Pose], report: Report, sentences: Sentences) -> None:
        self._frame, self._keys = frame, keys
        self._report, self._sentences = report, sentences
        self._names = _names(frame.things)
        self._there = [{name: t for t, name in _names(k.things).items()} for k in keys]
        self._lights = self._light_places()

    def _times(self, keys: int) -> list[int]:
        """Which of the poses a thing of so many keys takes."""
        return list(range(0, len(self._keys), max((len(self._keys) - 1) // (keys - 1), 1)))

    def placements(self, thing: ExportedObject) -> Array | None:
        """(keys, k, 3, 4) of a thing that moves."""
        if thing.content.keys == 1:
            return None
        found = [self._rows(thing, k) for k in self._times(thing.content.keys)]
        if any(rows is None for rows in found):
            self._report.note(self._sentences.gone, thing.name)
            return None
        keys = np.stack(found)
        return None if (keys == thing.matrices).all() else keys

    def _rows(self, thing: ExportedObject, k: int) -> Array | None:
        """(k, 3, 4) of the thing's instances at a key, by their persistent ids."""
        there = self._there[k].get(self._names[thing])
        if there is None:
            return None
        now, then = self._frame.ids[thing.numbers], self._keys[k].ids[there.numbers]
        if np.array_equal(now, then):
            return there.matrices
        row_of = {one.tobytes(): row for row, one in enumerate(then)}
        rows = [row_of.get(one.tobytes(), -1) for one in now]
        return None if -1 in rows else there.matrices[rows]

    def shape(self, thing: ExportedObject, mesh: Mesh, how: Displaced | None = None) -> Mesh:
        """The mesh with what it is at the keys, where its shape changes. how: it is displaced."""
        if thing.content.shape_keys == 1 or thing.content.shape is None or mesh.motion is not None:
            return mesh
        here = self._frame.shapes[thing.content.shape]
        shapes = [self._shape_at(thing, k) for k in self._times(thing.content.shape_keys)]
        if any(shape is None for shape in shapes):
            return mesh
        if any(s.faces != here.faces or s.vertices.shape != here.vertices.shape for s in shapes):
            self._report.note(self._sentences.remade, thing.name)
            return mesh
        if all(np.array_equal(s.vertices, here.vertices, equal_nan=True) for s in shapes):
            return mesh
        normals, vertices = _normals(mesh, shapes), [s.vertices for s in shapes]
        if how is not None:
            given = [None] * len(shapes) if normals is None else normals
            moved = [how.at(mesh, *pair) for pair in zip(vertices, given, strict=True)]
            vertices, turned = zip(*moved, strict=True)
            normals = None if normals is None else np.stack(turned)
        return replace(mesh, motion=np.stack(vertices), normal_motion=normals)

    def points(self, thing: ExportedObject, geometry: Strands | Spheres) -> list[Geometry] | None:
        """Strands or true spheres at the keys; None where they keep their shape."""
        here = self._frame.shapes.get(thing.content.shape)
        there = [self._shape_at(thing, k) for k in range(len(self._keys))]
        if any(type(one) is not type(here) for one in there) or isinstance(here, Shape | None):
            return None
        if isinstance(here, StrandSource):
            own = here.vertices_with(here.keys)
            places = [here.vertices_with(one.keys) for one in there]
            name, count = "vertices", geometry.vertices.shape
        else:
            own, places, name, count = here, there, "centers", geometry.centers.shape
        if own.shape != count or any(one is None or one.shape != count for one in places):
            self._report.note(self._sentences.recombed, thing.name)
            return None
        if all(np.array_equal(one, own, equal_nan=True) for one in places):
            return None
        return [replace(geometry, **{name: one}) for one in places]

    def _shape_at(self, thing: ExportedObject, k: int) -> Shape | StrandSource | Array | None:
        there = self._there[k].get(self._names[thing])
        return None if there is None else self._keys[k].shapes.get(there.content.shape)

    def light(self, light: Light) -> Light:
        found = self._lights.get((light.name, light.world_from_light.tobytes()))
        if found is None:
            return light
        thing, row = found
        frames = []
        for k in self._times(thing.content.keys) if thing.content.keys > 1 else ():
            rows = self._rows(thing, k)
            frames.append(None if rows is None else light_frame(rows[row])[0])
        if not frames or any(frame is None for frame in frames):
            return light
        keys = np.stack(frames)
        return light if (keys == light.world_from_light).all() else replace(light, motion=keys)

    def _light_places(self) -> dict[tuple, tuple[ExportedObject, int]]:
        places = {}
        for thing in self._frame.things:
            for row, matrix in enumerate(thing.matrices if thing.content.is_light else ()):
                frame = light_frame(matrix)[0]
                if frame is not None:
                    places[thing.name, frame.tobytes()] = thing, row
        return places


def _names(things: list[ExportedObject]) -> dict[ExportedObject, tuple[int, int]]:
    """The session uid of each, and which of those with the same it is."""
    seen: dict[int, int] = {}
    names = {}
    for thing in things:
        seen[thing.uid] = seen.get(thing.uid, -1) + 1
        names[thing] = thing.uid, seen[thing.uid]
    return names


def _normals(mesh: Mesh, shapes: list[Shape]) -> Array | None:
    """(keys, rows, 3); None for a flat mesh, and where they are stored otherwise at some key."""
    if mesh.normals is None:
        return None
    found = [s.normals for s in shapes]
    fits = all(
        one is not None
        and one[0] == mesh.normals.domain
        and one[1].shape == mesh.normals.values.shape
        for one in found
    )
    return np.stack([one[1] for one in found]) if fits else None
