"""What moves: places and shapes at one time after the other, matched to the scene of the frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ...engine.scene import Geometry, Light, Mesh, Scene, Spheres, Strands
from .culling import Culling
from .geometry.displacing import Displaced
from .geometry.meshes import mesh_key, normals_of, sound, values_of, vertices_of
from .geometry.points import export_points
from .geometry.shapes import marked_sphere
from .geometry.splines import Keys, cut
from .geometry.strand_attributes import fibre_values
from .geometry.strands import curve_keys, hair_keys
from .instances import ExportedObject, walk
from .lights import light_frame
from .placing import are_surfaces
from .report import Report
from .shader_nodes.reader import FIBRE

Array = np.ndarray

_FEWEST, _MOST = 3, 9
"""Keys that Cycles gives objects by default, and the most that are taken."""


class Sentences(NamedTuple):
    """What is told of things that are not there at all times, and of meshes that keep their shape,
    as hair and point clouds do.
    """

    gone: str
    remade: str
    recombed: str


WHILE_OPEN = Sentences(
    "Objects that are not there for all the shutter's time stand still for the rest of it: {}",
    "Meshes whose number of vertices or faces changes while the shutter is open keep "
    "their shape: {}",
    "Hair and point clouds that change their number of points while the shutter is open keep their "
    "shape: {}",
)
FROM_FRAME_TO_FRAME = Sentences(
    "Objects that are not there in the frame before or after stand still for it in the pass "
    "Vector: {}",
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
    """What a thing is. shape: the key of its shape, None for what has none that changes.  keys,
    shape_keys: at how many times it is looked at; 1 for what is to stand still.
    """

    is_light: bool
    shape: tuple | None
    keys: int
    shape_keys: int


@dataclass(eq=False)
class Pose:
    """One time. things: in the order of the walk.  shapes: meshes, curves and true spheres by their
    keys.  velocities: (points, 3) float32 of those that know where they move, object units a
    second.  ids: (instances, 8) Blender's persistent ids.  seconds: since frame 0.
    """

    things: list[ExportedObject]
    shapes: dict[tuple, Shape | Keys | Spheres | None] = field(default_factory=dict)
    velocities: dict[tuple, Array] = field(default_factory=dict)
    ids: Array = field(default_factory=lambda: np.zeros((0, 8), np.int32))
    seconds: float = 0.0

    @property
    def most_keys(self) -> int:
        """That anything here asks for."""
        movers = [thing.content for thing in self.things]
        return max((max(m.keys, m.shape_keys) for m in movers), default=_FEWEST)


def frame_of(scene: Any) -> float:
    """The frame with its subframe as `frame_set` takes it: before Time Remapping."""
    return scene.frame_current + scene.frame_subframe


def read_pose(depsgraph: Any, for_vectors: bool = False, culling: Culling | None = None) -> Pose:
    """Where everything stands that `export_scene` would export, and its shape. Only on Blender's
    thread; arrays are copies.

    for_vectors: without normals, and whatever objects say of their motion blur, as in Cycles.
    culling: of the export, at its time.
    """
    render = depsgraph.scene.render
    pose = Pose([], seconds=frame_of(depsgraph.scene) * render.fps_base / render.fps)
    reader = _Reader(depsgraph, for_vectors, pose)
    hair = reader.meet_hair
    pose.things = walk(
        depsgraph, reader.meet, Report(), make_hair=hair, culling=culling, has_flags=False
    )
    pose.ids = np.zeros((len(depsgraph.object_instances), 8), np.int32)
    if len(pose.ids):
        depsgraph.object_instances.foreach_get("persistent_id", pose.ids.reshape(-1))
    return pose


_BENDING: dict[str, Callable] = {
    "PointCloud": lambda data, scene: export_points(data),
    "Curves": curve_keys,
}
"""What is read of these data-blocks."""


@dataclass(eq=False)
class _Reader:
    """Fills a pose while the depsgraph is walked."""

    depsgraph: Any
    for_vectors: bool
    pose: Pose

    def meet_hair(self, instance: Any, _flags: None) -> _Mover:
        thing = instance.object
        owner = (instance.instance_object or thing).original.session_uid
        key, render = ("hair", owner, thing.data.as_pointer()), self.depsgraph.mode == "RENDER"
        return self._bending(instance, key, hair_keys, thing, self.depsgraph.scene_eval, render)

    def meet(self, instance: Any, _flags: None) -> _Mover | None:
        thing, data = instance.object, instance.object.data
        kind = type(data).__name__
        if thing.type == "LIGHT":
            return _Mover(True, None, self._keys_of(instance), 1)
        if kind not in ("Mesh", "PointCloud", "Curves", "Volume"):
            return None
        if kind == "Volume" or (kind == "Mesh" and data.is_editmode):
            return _Mover(False, None, self._keys_of(instance), 1)
        if kind == "Mesh":
            key, how = mesh_key(data), (_shape, data, not self.for_vectors)
        else:
            key, how = (kind, data.as_pointer()), (_BENDING[kind], data, self.depsgraph.scene_eval)
        mover, velocity = self._bending(instance, key, *how), _velocity(data)
        if velocity is not None:
            self.pose.velocities[key] = velocity
        return mover

    def _keys_of(self, instance: Any) -> int:
        return _FEWEST if self.for_vectors else _keys_of(instance)

    def _bending(self, instance: Any, key: tuple, read: Callable, *arguments: Any) -> _Mover:
        """Of what may change its shape, read when first met."""
        keys = self._keys_of(instance)
        shape_keys = keys if self.for_vectors or _bends(instance) else 1
        if shape_keys == 1:
            return _Mover(False, None, keys, 1)
        if key not in self.pose.shapes:
            self.pose.shapes[key] = read(*arguments)
        return _Mover(False, key, keys, shape_keys)


def _shape(mesh: Any, with_normals: bool) -> Shape | Spheres:
    if len(mesh.vertices) == 0:
        return Shape(np.zeros((0, 3), np.float32), (0, 0), None)
    sphere = marked_sphere(mesh, Report())
    if sphere is not None:
        return sphere
    normals = normals_of(mesh) if with_normals else None
    return Shape(vertices_of(mesh), (len(mesh.polygons), len(mesh.loops)), normals)


def _velocity(data: Any) -> Array | None:
    """(points, 3) of the attribute that simulations and caches write, as Cycles takes it."""
    attribute = data.attributes.get("velocity")
    if attribute is None or (attribute.domain, attribute.data_type) != ("POINT", "FLOAT_VECTOR"):
        return None
    return values_of(attribute)


def _carried(shape: Shape | Keys | Spheres, way: Array) -> Shape | Keys | Spheres:
    """A shape whose points went on by (points, 3)."""
    if isinstance(shape, Shape):
        return shape._replace(vertices=shape.vertices + way)
    name = "positions" if isinstance(shape, Keys) else "centers"
    return replace(shape, **{name: getattr(shape, name) + way})


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


def _bends(instance: Any) -> bool:
    """Whether its settings let it change its shape while it blurs."""
    return getattr(next(_owners(instance), None), "use_deform_motion", True)


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
    for number, thing, rows in _exported(scene, frame):
        block = instances[number]
        instances[number] = replace(block, motion=matcher.placements(thing, rows))
        geometry = geometries[block.geometry]
        if getattr(geometry, "motion", None) is None and thing.content.shape is not None:
            how = displaced.get(block.geometry)
            geometries[block.geometry] = matcher.shape(thing, geometry, how)
    lights = tuple(matcher.light(light) for light in scene.lights)
    return replace(scene, geometries=tuple(geometries), instances=tuple(instances), lights=lights)


def at_key(scene: Scene, still: Scene, k: int) -> Scene:
    """What `moved` made of `still`, at a key that all that moves has; lights stay."""
    geometries = (_at(geometry, k) for geometry in scene.geometries)
    instances = (
        replace(block, world_from_object=block.motion[k], motion=None)
        if block.motion is not None
        else block
        for block in scene.instances
    )
    return replace(still, geometries=tuple(geometries), instances=tuple(instances))


def _at(geometry: Geometry, k: int) -> Geometry:
    keys = getattr(geometry, "motion", None)
    if keys is None:
        return geometry
    if isinstance(geometry, Mesh):
        return replace(geometry, vertices=keys[k], motion=None)
    still = replace(geometry, motion=None, radius_motion=None)
    return replace(still, **{"centers" if isinstance(still, Spheres) else "vertices": keys[k]})


def _exported(scene: Scene, frame: Pose) -> Iterator[tuple[int, ExportedObject, Array]]:
    """Numbers of blocks with the things that they were made from, and which rows of these they
    have: both are in one order, in which blocks and rows may be missing.
    """
    ahead = [thing for thing in frame.things if not thing.content.is_light]
    first = 0
    for number, block in enumerate(scene.instances):
        geometry = scene.geometries[block.geometry]
        for place in range(first, len(ahead)):
            thing = ahead[place]
            if thing.name != block.name:
                continue
            rows = np.ones(len(thing.matrices), bool)
            if len(block.world_from_object) != len(rows):
                rows = are_surfaces(thing.matrices)
            if np.array_equal(thing.matrices[rows], block.world_from_object) and _is_of(
                geometry, frame.shapes.get(thing.content.shape)
            ):
                yield number, thing, rows
                first = place + 1
                break


def _is_of(geometry: Geometry, shape: Shape | Keys | Spheres | None) -> bool:
    """Whether this may be what a geometry was made from: meshes have the names and places of the
    point clouds and the hair that their modifiers make.
    """
    kinds = {Shape: Mesh, Keys: Strands, Spheres: Spheres}
    return shape is None or isinstance(geometry, kinds[type(shape)])


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

    def placements(self, thing: ExportedObject, rows: Array) -> Array | None:
        """(keys, k, 3, 4) of a thing that moves, in some of its rows."""
        if thing.content.keys == 1:
            return None
        found = [self._rows(thing, k) for k in self._times(thing.content.keys)]
        if not all(there[rows].all() for _, there in found):
            self._report.note(self._sentences.gone, thing.name)
        keys = np.stack([matrices[rows] for matrices, _ in found])
        return None if (keys == thing.matrices[rows]).all() else keys

    def _rows(self, thing: ExportedObject, k: int) -> tuple[Array, Array]:
        """(k, 3, 4) of the thing's instances at a key, by their persistent ids, and (k,) which are
        there; others are where they are at the frame, as in Cycles.
        """
        there = self._there[k].get(self._names[thing])
        if there is None:
            return thing.matrices, np.zeros(len(thing.matrices), bool)
        now, then = self._frame.ids[thing.numbers], self._keys[k].ids[there.numbers]
        if np.array_equal(now, then):
            return there.matrices, np.ones(len(thing.matrices), bool)
        row_of = {one.tobytes(): row for row, one in enumerate(then)}
        rows = np.array([row_of.get(one.tobytes(), -1) for one in now])
        known = rows >= 0
        return np.where(known[:, None, None], there.matrices[rows], thing.matrices), known

    def shape(
        self, thing: ExportedObject, geometry: Geometry, how: Displaced | None = None
    ) -> Geometry:
        """A geometry with what it is at the keys, where its shape changes. how: it is displaced."""
        here = self._frame.shapes[thing.content.shape]
        shapes = [self._shape_at(thing, here, k) for k in self._times(thing.content.shape_keys)]
        if here is None or any(type(shape) is not type(here) for shape in shapes):
            return geometry
        if isinstance(here, Shape):
            return self._mesh(thing, geometry, here, shapes, how)
        if isinstance(here, Keys):
            found = _bent(geometry, here, shapes)
        else:
            found = _scattered(geometry, here, shapes)
        if found is None:
            self._report.note(self._sentences.recombed, thing.name)
        return found or geometry

    def _mesh(
        self,
        thing: ExportedObject,
        mesh: Mesh,
        here: Shape,
        shapes: list[Shape],
        how: Displaced | None,
    ) -> Mesh:
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

    def _shape_at(
        self, thing: ExportedObject, here: Shape | Keys | Spheres | None, k: int
    ) -> Shape | Keys | Spheres | None:
        velocity = self._frame.velocities.get(thing.content.shape)
        if velocity is not None and here is not None:
            velocity = sound(velocity, "velocity", thing.name, self._report)
            seconds = self._keys[k].seconds - self._frame.seconds
            return _carried(here, velocity * np.float32(seconds))
        there = self._there[k].get(self._names[thing])
        return None if there is None else self._keys[k].shapes.get(there.content.shape)

    def light(self, light: Light) -> Light:
        found = self._lights.get((light.name, light.world_from_light.tobytes()))
        if found is None:
            return light
        thing, row = found
        frames = []
        for k in self._times(thing.content.keys) if thing.content.keys > 1 else ():
            matrices, _ = self._rows(thing, k)
            frames.append(light_frame(matrices[row])[0])
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


def _names(things: list[ExportedObject]) -> dict[ExportedObject, tuple[int, int, int]]:
    """The session uids of each, and which of those with the same it is: things of other instancers
    may be culled.
    """
    seen: dict[tuple[int, int], int] = {}
    names = {}
    for thing in things:
        uids = thing.uid, thing.instancer
        seen[uids] = seen.get(uids, -1) + 1
        names[thing] = *uids, seen[uids]
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


def _bent(strands: Strands, here: Keys, there: list[Keys]) -> Strands | None:
    """The strands, cut where they are now; None where other times have other numbers of keys."""
    found = cut(here)
    if found is None or found.at[:, :3].shape != strands.vertices.shape:
        return None
    if any(not np.array_equal(keys.offsets, here.offsets) for keys in there):
        return None
    if all(_alike(keys, here) for keys in there):
        return strands
    at = np.stack([found.of(keys) for keys in there])
    places, radii = at[..., :3], np.maximum(at[..., 3], 0)
    moving = [
        replace(strands, vertices=v, radii=r, attributes=())
        for v, r in zip(places, radii, strict=True)
    ]
    attributes = tuple(
        replace(a, motion=np.stack([fibre_values(one) for one in moving]).astype(np.float32))
        if a.name == FIBRE
        else a
        for a in strands.attributes
    )
    return replace(
        strands,
        motion=np.ascontiguousarray(places),
        radius_motion=_or_none(radii),
        attributes=attributes,
    )


def _alike(a: Keys, b: Keys) -> bool:
    """Whether curves are the same but for what rounding makes of them: of hair's positions, and of
    radii that follow from them.
    """
    tolerance = max(a.precision, b.precision)
    return all(
        np.allclose(x, y, rtol=0, atol=tolerance, equal_nan=True)
        for x, y in ((a.positions, b.positions), (a.radii, b.radii))
    )


def _scattered(spheres: Spheres, here: Spheres, there: list[Spheres]) -> Spheres | None:
    """The spheres; None where other times have other numbers of them."""
    if any(one.centers.shape != spheres.centers.shape for one in (here, *there)):
        return None
    places, radii = (np.stack([getattr(s, name) for s in there]) for name in ("centers", "radii"))
    if all(
        np.array_equal(keys, np.broadcast_to(still, keys.shape), equal_nan=True)
        for keys, still in ((places, here.centers), (radii, here.radii))
    ):
        return spheres
    return replace(spheres, motion=places, radius_motion=_or_none(radii))


def _or_none(keys: Array) -> Array | None:
    """None where all keys are the same."""
    return None if np.array_equal(keys, np.broadcast_to(keys[0], keys.shape)) else keys
