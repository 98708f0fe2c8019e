"""The check at the door: what makes a scene unfit to render, one sentence each, with the thing's
name and the remedy.

Tracers rely on it: after an empty list every array has the dtype and shape that `scene.py` says,
every index is in range, and every number is finite except vertices, centres and radii, whose
primitives the tracers drop. Flattened placements and negative light are sound.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Integral
from typing import Any

import numpy as np

from ..linear import determinant, length, pseudo_inverse
from ..program.operations import Reference
from ..program.problems import program_problems
from ..program.program import Program, instructions
from .checks import (
    Found,
    array,
    at_least,
    below,
    finite,
    finite_array,
    handle,
    holds,
    is_real,
    numbers,
    one_of,
    whole,
)
from .model import (
    BUMP_SHADOWING,
    CAMERAS,
    CHANNELS,
    CORNER,
    ENCODINGS,
    EVERYTHING,
    EXTENSIONS,
    FACE,
    INTERPOLATIONS,
    LIGHT_SHAPES,
    LIGHTS,
    LOBES,
    MISTS,
    MOST_SETS,
    POINT,
    Attribute,
    Camera,
    Input,
    Instances,
    Lens,
    Light,
    Lobe,
    Material,
    Medium,
    Mesh,
    Polygons,
    Scene,
    Spheres,
    Strands,
    Texture,
    World,
)
from .panorama import panorama_problems

_DOUBTFUL_VOLUME = 1e-6
"""Of three unit axes: from it on the smallest singular value is at least 5e-7 of the largest, far
from rounding.
"""

_ORTHONORMAL = 1e-4
"""How far a light's axes may be from orthonormal: matrices that went through a few float32 products
stay well within.
"""


MOST_AOVS = 256
MOST_LIGHT_GROUPS = 64
MOST_DISTANCE = 1e30
"""That occlusion looks: ends of its rays stay finite."""


def scene_problems(scene: Scene) -> list[str]:
    """Every problem of `scene`, in the order of its fields; empty when it is sound. Reads each
    array at most twice and copies no mesh.

    Things of other classes than those of `scene.py` are told before anybody looks into them.
    """
    strangers = [*_strangers(scene)]
    if strangers:
        return strangers
    checks: tuple[tuple[Iterable[Any], Callable[[Any], Found]], ...] = (
        ((scene.camera,), _camera),
        (scene.geometries, _geometry),
        (_worth_asking(scene.instances), partial(_instances, scene)),
        (scene.materials, partial(_material, len(scene.textures))),
        (scene.textures, _texture),
        (scene.lights, _light),
        ((scene.world,), _world),
        (scene.world.textures, _texture),
        *((light.textures, _texture) for light in scene.lights),
    )
    found = [
        f"{_label(thing)}: {text}"
        for things, check in checks
        for thing in things
        for text in check(thing)
    ]
    return [
        *found,
        *_aovs(scene),
        *_light_groups(scene),
        *_domes(scene.lights),
        *_neighbours(scene),
    ]


def _light_groups(scene: Scene) -> Found:
    """Groups that the scene does not have, and too many of them."""
    count = len(scene.light_groups)
    if count > MOST_LIGHT_GROUPS:
        yield f"scene has {count} light groups: use at most {MOST_LIGHT_GROUPS}"
    things: tuple[Any, ...] = (*scene.lights, *scene.instances, scene.world)
    for thing in things:
        group = thing.light_group
        if type(group) is int and -1 <= group < count:
            continue
        wrong = [*whole("light_group", group)]
        if not wrong and not -1 <= group < count:
            wrong = [f"light_group is {group}: use one of the {count}, or -1 for none"]
        yield from (f"{_label(thing)}: {text}" for text in wrong)


def _aovs(scene: Scene) -> Found:
    """Numbers of AOVs that the scene does not have, and too many of them."""
    count = len(scene.aovs)
    if count > MOST_AOVS:
        yield f"scene has {count} AOVs: use at most {MOST_AOVS}"
    for material in scene.materials if count else ():
        for lobe in material.aovs.lobes if material.aovs else ():
            if lobe.exponent >= count:
                yield f"{_label(material)}: aovs names number {lobe.exponent:g} of {count}"


def _neighbours(scene: Scene) -> Found:
    """What is not the same thing in the frames before and after."""
    if scene.neighbours is None:
        return
    if [type(some) for some in scene.neighbours] != [Scene, Scene]:
        yield "scene: neighbours are not two scenes: give the one before and the one after, or None"
        return
    for other in scene.neighbours:
        yield from (f"neighbour's {_label(other.camera)}: {text}" for text in _camera(other.camera))
        if other.camera.kind != scene.camera.kind:
            yield f"neighbour's camera is {other.camera.kind}: use {scene.camera.kind}"
        for name in ("geometries", "instances"):
            here, there = getattr(scene, name), getattr(other, name)
            if len(here) != len(there):
                yield f"neighbour has {len(there)} {name}: use {len(here)}, as the scene has"
                continue
            same = _same_shape if name == "geometries" else _same_rows
            for own, moved in zip(here, there, strict=True):
                if moved is not own:
                    yield from (f"neighbour's {_label(moved)}: {t}" for t in same(own, moved))


def _same_shape(geometry: Any, moved: Any) -> Found:
    if type(geometry) is not type(moved):
        yield f"is another kind than the scene's: use {type(geometry).__name__}"
    elif isinstance(geometry, Mesh | Strands):
        yield from array("vertices", moved.vertices, np.float32, np.shape(geometry.vertices))
    elif isinstance(geometry, Spheres):
        yield from array("centers", moved.centers, np.float32, np.shape(geometry.centers))


def _same_rows(instances: Instances, moved: Any) -> Found:
    if not isinstance(moved, Instances) or moved.geometry != instances.geometry:
        yield "has another geometry than the scene's: use the same"
        return
    shape = np.shape(instances.world_from_object)
    found = [*array("world_from_object", moved.world_from_object, np.float64, shape)]
    yield from found or finite_array("world_from_object", moved.world_from_object)


_HELD = {
    "geometries": (Mesh, Spheres, Polygons, Strands),
    "instances": (Instances,),
    "materials": (Material,),
    "textures": (Texture,),
    "lights": (Light,),
}


def _strangers(scene: Scene) -> Found:
    """Tuples without their comma, and what else is not of the classes that are looked into."""
    for name, kind in (("camera", Camera), ("world", World)):
        if not isinstance(getattr(scene, name), kind):
            yield f"scene: {name} is a {type(getattr(scene, name)).__name__}: use {kind.__name__}"
    for light in scene.lights if isinstance(scene.lights, tuple) else ():
        if isinstance(light, Light):
            yield from (
                f"{_label(light)}: {text}" for text in holds("textures", light.textures, (Texture,))
            )
    for name, kinds in _HELD.items():
        yield from (f"scene: {text}" for text in holds(name, getattr(scene, name), kinds))


def _label(thing: Any) -> str:
    kind = type(thing).__name__.lower()
    return f"{kind} {thing.name!r}" if hasattr(thing, "name") else kind


# --- geometry
# --------------------------------------------------------------------------------------------------


def _geometry(geometry: Any) -> Found:
    checks: dict[type, Callable[[Any], Found]] = {
        Mesh: _mesh,
        Spheres: _spheres,
        Polygons: _polygons,
        Strands: _strands,
    }
    yield from next(check for kind, check in checks.items() if isinstance(geometry, kind))(geometry)


def _mesh(mesh: Mesh) -> Found:
    shapes = [
        *array("vertices", mesh.vertices, np.float32, (None, 3)),
        *array("triangles", mesh.triangles, np.uint32, (None, 3)),
    ]
    yield from shapes
    if shapes:
        return
    yield from below("triangles", mesh.triangles, len(mesh.vertices), "vertices")
    yield from _slots(mesh.material_slots, len(mesh.triangles), "triangle")
    if mesh.corners is not None:
        yield from array("corners", mesh.corners, np.uint32, mesh.triangles.shape)
    yield from _attributes(mesh)
    if mesh.motion is not None:
        yield from _keys("motion", mesh.motion, np.float32, mesh.vertices.shape)
    if mesh.normal_motion is not None:
        if mesh.motion is None or not isinstance(mesh.normals, Attribute):
            yield "normal_motion is there without motion or normals: give both, or None"
            return
        yield from _keys("normal_motion", mesh.normal_motion, np.float32, mesh.normals.values.shape)


def _keys(name: str, keys: Any, dtype: type, shape: tuple[int, ...]) -> Found:
    """Two or more values of one shape while the shutter is open; float64 ones are finite."""
    found = [*array(name, keys, dtype, (None, *shape))]
    if not found and len(keys) < 2:
        found = [f"{name} has {len(keys)} keys: use two or more, or None"]
    if not found and dtype is np.float64:
        found = [*finite_array(name, keys)]
    yield from found


def _slots(slots: np.ndarray | None, count: int, primitive: str) -> Found:
    if slots is None:
        return
    for text in array("material_slots", slots, np.uint16, (count,)):
        yield f"{text}, one for each {primitive}"


def _attributes(mesh: Mesh) -> Found:
    rows = {POINT: len(mesh.vertices), CORNER: _corner_rows(mesh), FACE: len(mesh.triangles)}
    strangers = [*holds("attributes", mesh.attributes, (Attribute,))]
    strangers += holds("normals", () if mesh.normals is None else (mesh.normals,), (Attribute,))
    yield from strangers
    if strangers:
        return
    if mesh.normals is not None:
        yield from one_of("the domain of normals", mesh.normals.domain, (POINT, CORNER))
        yield from _attribute("normals", mesh.normals, rows, (3,))
    yield from _named(mesh.attributes, rows)


def _named(attributes: tuple[Attribute, ...], rows: Mapping[str, int | None]) -> Found:
    names = [attribute.name for attribute in attributes]
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"has several attributes called {name!r}: give each a name of its own"
    for attribute in attributes:
        yield from _attribute(f"attribute {attribute.name!r}", attribute, rows, (2, 3, 4))


def _corner_rows(mesh: Mesh) -> int | None:
    """How many rows a CORNER attribute must have at least; None without usable corners."""
    corners = mesh.corners
    if corners is None or not isinstance(corners, np.ndarray) or corners.dtype != np.uint32:
        return None
    return int(corners.max()) + 1 if corners.size else 0


def _attribute(
    name: str, attribute: Attribute, rows: Mapping[str, int | None], columns: tuple[int, ...]
) -> Found:
    shapes = [
        *one_of(f"the domain of {name}", attribute.domain, tuple(rows)),
        *array(name, attribute.values, np.float32, (None, None)),
    ]
    yield from shapes
    if shapes:
        return
    count, width = attribute.values.shape
    if width not in columns:
        yield f"{name} has {width} columns: use {' or '.join(map(str, columns))}"
    needed = rows[attribute.domain]
    if needed is None:
        yield f"{name} is on corners and the mesh has none: give Mesh.corners"
    elif count != needed and (attribute.domain != CORNER or count < needed):
        yield f"{name} has {count} rows on {attribute.domain}: use {needed}"
    yield from finite_array(name, attribute.values)


def _spheres(spheres: Spheres) -> Found:
    shapes = [*array("centers", spheres.centers, np.float32, (None, 3))]
    yield from shapes
    if shapes:
        return
    count = len(spheres.centers)
    yield from array("radii", spheres.radii, np.float32, (count,))
    if isinstance(spheres.radii, np.ndarray) and np.any(spheres.radii < 0):
        yield "radii has a negative value: use 0 or more"
    yield from _slots(spheres.material_slots, count, "sphere")


def _strands(strands: Strands) -> Found:
    shapes = [
        *array("vertices", strands.vertices, np.float32, (None, 3)),
        *array("starts", strands.starts, np.uint32, (None,)),
    ]
    yield from shapes
    if shapes:
        return
    count = len(strands.vertices)
    yield from array("radii", strands.radii, np.float32, (count,))
    if isinstance(strands.radii, np.ndarray) and np.any(strands.radii < 0):
        yield "radii has a negative value: use 0 or more"
    yield from below("starts", strands.starts, max(count - 1, 0), "vertices before the last")
    yield from _slots(strands.material_slots, len(strands.starts), "segment")
    rows = {POINT: count, FACE: len(strands.starts)}
    strangers = [*holds("attributes", strands.attributes, (Attribute,))]
    yield from strangers
    yield from () if strangers else _named(strands.attributes, rows)


def _polygons(polygons: Polygons) -> Found:
    shapes = [
        *array("vertices", polygons.vertices, np.float32, (None, 3)),
        *array("offsets", polygons.offsets, np.uint32, (None,)),
        *array("indices", polygons.indices, np.uint32, (None,)),
    ]
    yield from shapes
    if shapes:
        return
    yield from _offsets(polygons.offsets, len(polygons.indices))
    yield from below("indices", polygons.indices, len(polygons.vertices), "vertices")
    yield from _slots(polygons.material_slots, max(len(polygons.offsets) - 1, 0), "polygon")


def _offsets(offsets: np.ndarray, count: int) -> Found:
    if len(offsets) == 0 or offsets[0] != 0 or offsets[-1] != count:
        yield f"offsets runs not from 0 to the {count} indices: start at 0 and end there"
        return
    corners = np.diff(offsets.astype(np.int64))
    if np.any(corners < 0):
        yield f"offsets falls after polygon {int(np.argmax(corners < 0))}: keep it rising"
    elif np.any(corners < 3):
        k = int(np.argmax(corners < 3))
        yield f"polygon {k} has {corners[k]} corners: use at least 3"


def _worth_asking(groups: Sequence[Instances]) -> Sequence[Instances]:
    """All of them; but where all matrices are sound, one of those that differ in names and matrices
    alone. A file of 50 000 objects has as many groups, and to ask each takes longer than to trace
    them.
    """
    if {getattr(group.world_from_object, "dtype", None) for group in groups} != {
        np.dtype(np.float64)
    }:
        return groups
    if {group.world_from_object.shape[1:] for group in groups} != {(3, 4)} or {
        type(group.materials) for group in groups
    } != {tuple}:
        return groups
    if not np.isfinite(np.concatenate([group.world_from_object for group in groups])).all():
        return groups
    return list({_kind(group): group for group in reversed(groups)}.values())[::-1]


def _kind(group: Instances) -> tuple:
    """What `_instances` looks at but for the matrices, with the types: 1.0 equals 1 and is no
    index.
    """
    links = group.receivers, group.blockers
    values = (group.geometry, group.object_index, group.light_set, *links, *group.materials)
    special = group.values or group.motion is not None
    return values, tuple(map(type, values)), id(group) if special else 0


def _instances(scene: Scene, instances: Instances) -> Found:
    yield from handle("geometry", instances.geometry, len(scene.geometries), "geometries")
    shapes = [*array("world_from_object", instances.world_from_object, np.float64, (None, 3, 4))]
    yield from shapes or finite_array("world_from_object", instances.world_from_object)
    if instances.motion is not None and not shapes:
        yield from _keys("motion", instances.motion, np.float64, instances.world_from_object.shape)
    if not isinstance(instances.materials, (tuple, list, np.ndarray)):
        yield f"materials is {instances.materials!r}: use a tuple of whole numbers"
        return
    for material in instances.materials:
        yield from handle("a material", material, len(scene.materials), "materials")
    yield from whole("object_index", instances.object_index)
    yield from handle("light_set", instances.light_set, MOST_SETS, "sets")
    yield from _links(instances)
    for name, values in instances.values.items():
        found = [*array(f"value {name!r}", values, np.float32, (None, 4))]
        yield from found or finite_array(f"value {name!r}", values)
        if not found and not shapes and len(values) != len(instances.world_from_object):
            yield (
                f"value {name!r} has {len(values)} rows: use {len(instances.world_from_object)}, "
                "one a placement"
            )


# --- surfaces
# --------------------------------------------------------------------------------------------------


def _material(textures: int, material: Material) -> Found:
    yield from whole("index", material.index)
    if material.program is not None:
        yield from (f"program: {text}" for text in program_problems(material.program, textures))
    outputs = len(material.program.outputs) if material.program is not None else 0
    if material.aovs is not None:
        given = material.aovs
        if any(lobe.kind != "EMISSION" or lobe.exponent % 1 for lobe in given.lobes):
            yield "aovs has other lobes than EMISSION with whole exponents: use these alone"
        if given.aovs is not None:
            yield "aovs has AOVs of its own: use none"
        yield from (f"aovs: {text}" for text in _material(textures, replace(given, aovs=None)))
    for name in ("normal_output", "base_normal_output"):
        yield from handle(name, getattr(material, name), outputs, "outputs", none=True)
    yield from one_of("bump_shadowing", material.bump_shadowing, BUMP_SHADOWING)
    yield from _medium(material.medium, textures)
    strangers = [*holds("lobes", material.lobes, (Lobe,))]
    yield from strangers
    for number, lobe in enumerate(() if strangers else material.lobes):
        yield from (f"lobe {number}: {text}" for text in _lobe(lobe, textures, outputs))


def _medium(medium: Medium | None, textures: int, is_world: bool = False) -> Found:
    if medium is None:
        return
    if not isinstance(medium, Medium):
        yield f"medium is a {type(medium).__name__}: use Medium or None"
        return
    for name in ("absorption", "scattering", "emission"):
        value = getattr(medium, name)
        problems = [*numbers(f"medium {name}", value, 3)]
        yield from problems
        if not problems and name != "emission" and min(value) < 0:
            yield f"medium {name} is {value}: use numbers of at least 0"
    yield from at_least("medium anisotropy", medium.anisotropy, -1, 1)
    if not (is_real(medium.step) and np.isfinite(medium.step) and medium.step > 0):
        yield f"medium step is {medium.step!r}: use a finite number above 0"
    outputs = 0
    if medium.program is not None:
        found = [*program_problems(medium.program, textures)]
        found += _out_of_place(medium.program, is_world) if not found else []
        yield from (f"medium program: {text}" for text in found)
        outputs = len(medium.program.outputs)
    for name in ("absorption", "scattering", "emission", "anisotropy"):
        name = f"{name}_output"
        yield from handle(f"medium {name}", getattr(medium, name), outputs, "outputs", none=True)


def _out_of_place(program: Program, is_world: bool) -> Found:
    """What is read that points inside of media have not."""
    for step in instructions(program):
        of_placement = step.operation.name == "instance_value"
        named = any(choices is Reference.ATTRIBUTE for _, choices in step.operation.settings)
        if (named and not of_placement) or step.operation.name in ("barycentric", "edge_distance"):
            yield f"reads {step.operation.name}, which a medium has not: use its position"
        elif of_placement and is_world:
            yield "reads a placement, which a world has not: use its position"


def _lobe(lobe: Lobe, textures: int, outputs: int) -> Found:
    yield from one_of("kind", lobe.kind, LOBES)
    yield from at_least("exponent", lobe.exponent, 0)
    if not (is_real(lobe.ior) and np.isfinite(lobe.ior) and lobe.ior > 0):
        yield f"ior is {lobe.ior!r}: use a finite number above 0"
    yield from at_least("masking", lobe.masking, 0, 1)
    strangers = [*holds("factors", lobe.factors, (Input,))]
    yield from strangers
    for factor in () if strangers else lobe.factors:
        yield from _input(factor, textures, outputs)
    for name in ("exponent", "masking", "ior", "fibre", "normal", "stretch"):
        output = getattr(lobe, f"{name}_output")
        yield from handle(f"{name}_output", output, outputs, "outputs", none=True)


def _input(factor: Input, textures: int, outputs: int) -> Found:
    yield from handle("output", factor.output, outputs, "outputs", none=True)
    yield from numbers("value", factor.value, 3)
    yield from handle("texture", factor.texture, textures, "textures", none=True)
    yield from one_of("channel", factor.channel, CHANNELS)
    yield from one_of("attribute_channel", factor.attribute_channel, ("COLOR", "ALPHA"))
    yield from numbers("offset", factor.offset, 3)
    if not (is_real(factor.low) and is_real(factor.high) and factor.low <= factor.high):
        yield f"low is {factor.low!r} and high {factor.high!r}: use numbers, low at most high"
    for row in factor.uv_transform:
        yield from numbers("a row of uv_transform", row, 3)
    if len(factor.uv_transform) != 2:
        yield f"uv_transform has {len(factor.uv_transform)} rows: use 2"


def _texture(texture: Texture) -> Found:
    yield from one_of("encoding", texture.encoding, ENCODINGS)
    yield from one_of("extension", texture.extension, EXTENSIONS)
    yield from one_of("interpolation", texture.interpolation, INTERPOLATIONS)
    shapes = [*array("pixels", texture.pixels, (np.uint8, np.float32), (None, None, 4))]
    yield from shapes
    if shapes:
        return
    if texture.pixels.size == 0:
        yield f"pixels has shape {texture.pixels.shape}: use at least one pixel"
    if texture.pixels.dtype == np.float32:
        yield from finite_array("pixels", texture.pixels)
        if texture.encoding == "SRGB":
            yield "encoding SRGB is for uint8: decode float32 pixels to LINEAR"


# --- light and view
# --------------------------------------------------------------------------------------------------


def _domes(lights: tuple[Light, ...]) -> Found:
    names = [light.name for light in lights if light.kind == "DOME"]
    if len(names) > 1:
        yield f"scene: the DOME lights {', '.join(map(repr, names))} are several: keep one"


def _links(thing: Light | Instances) -> Found:
    for name in ("receivers", "blockers"):
        value = getattr(thing, name)
        if not (isinstance(value, int) and 0 <= value <= EVERYTHING):
            yield f"{name} is {value!r}: use a whole number of {MOST_SETS} bits"


def _light(light: Light) -> Found:
    yield from one_of("kind", light.kind, LIGHTS)
    if light.kind == "DOME":
        yield from _radiance(light.radiance)
    if light.kind == "MESH":
        yield "kind 'MESH' is made by the tracers: give surfaces EMISSION"
    if light.kind == "BOUNCED":
        yield "kind 'BOUNCED' is made by the tracers: set diffuse_bounces"
    if light.program is not None:
        yield from _light_program(light, light.program)
    yield from one_of("shape", light.shape, LIGHT_SHAPES)
    yield from _links(light)
    yield from _placement("world_from_light", light.world_from_light, _not_orthonormal)
    if light.motion is not None:
        yield from _light_motion(light)
    yield from numbers("color", light.color, 3)
    yield from finite("strength", light.strength)
    for name in ("radius", "size_x", "size_y"):
        yield from at_least(name, getattr(light, name), 0)
    for name in ("angle", "spot_size"):
        yield from at_least(name, getattr(light, name), 0, 2 * np.pi)
    yield from at_least("spot_blend", light.spot_blend, 0, 1)


def _light_motion(light: Light) -> Found:
    if light.kind == "DOME":
        yield "a DOME has motion: leave it out, the sky stands still"
        return
    found = [*_keys("motion", light.motion, np.float64, (3, 4))]
    yield from found
    for key in () if found or light.motion is None else light.motion:
        yield from _not_orthonormal("motion", key)


def _light_program(light: Light, program: Program) -> Found:
    found = [*program_problems(program, len(light.textures))]
    yield from (f"program: {text}" for text in found)
    if light.kind == "DOME":
        yield "a DOME has a program: bake it into its radiance"
    if not found and not program.outputs:
        yield "program has no output: compile it with one"
    if not found and program.attributes:
        yield "program reads an attribute, which a light has not: use its position or normal"
    if not found and any(
        step.operation.name in ("barycentric", "edge_distance") for step in instructions(program)
    ):
        yield "program reads a triangle, which a light has not: use its position or normal"


def _radiance(values: Any) -> Found:
    found = [*array("radiance", values, np.float32, (None, None, 3))]
    if not found and values.size == 0:
        found = ["radiance is empty: a DOME needs at least one cell"]
    yield from found or finite_array("radiance", values)


def _placement(name: str, matrix: Any, further: Callable[[str, np.ndarray], Found]) -> Found:
    """One (3, 4) float64 matrix: shape, then finiteness, then what else its use asks for."""
    found = [*array(name, matrix, np.float64, (3, 4))]
    found = found or [*finite_array(name, matrix)] or [*further(name, matrix)]
    yield from found


def _not_orthonormal(name: str, matrix: np.ndarray) -> Found:
    axes = matrix[:, :3]
    if np.max(np.abs(axes.T @ axes - np.eye(3))) > _ORTHONORMAL:
        yield f"{name} has columns that are not orthonormal: take scale and shear out of it"


def _not_a_frame(name: str, matrix: np.ndarray) -> Found:
    sizes = length(matrix[:, :3].T)
    if np.any(sizes == 0) or _is_flat(matrix[:, :3] / sizes):
        yield f"{name} is flattened: give the camera three independent axes"


def _is_flat(axes: np.ndarray) -> bool:
    """(3, 3) unit columns. The decomposition decides, where the volume of the axes leaves a
    doubt.
    """
    is_doubtful = not abs(determinant(axes)) >= _DOUBTFUL_VOLUME
    return is_doubtful and bool(pseudo_inverse(axes).rank < 3)


def _camera(camera: Camera) -> Found:
    yield from one_of("kind", camera.kind, CAMERAS)
    yield from _placement("world_from_camera", camera.world_from_camera, _not_a_frame)
    yield from _window(camera)
    yield from _resolution(camera)
    yield from _clip(camera)
    if camera.kind == "PANORAMA":
        yield from panorama_problems(camera.panorama)
    if camera.lens is not None:
        yield from _lens(camera.lens)
    if camera.motion is not None:
        yield from _motion(camera.motion)
    if camera.shutter is not None:
        yield from _shutter(camera.shutter)


def _window(camera: Camera) -> Found:
    problems = [*numbers("window", camera.window, 4)]
    yield from problems
    if not problems and (
        camera.window[0] == camera.window[1] or camera.window[2] == camera.window[3]
    ):
        yield f"window {camera.window} has no area: use l different from r and b from t"


def _resolution(camera: Camera) -> Found:
    try:
        nx, ny = camera.resolution
        sound = isinstance(nx, Integral) and isinstance(ny, Integral) and nx >= 1 and ny >= 1
    except (TypeError, ValueError):
        sound = False
    if not sound:
        yield f"resolution is {camera.resolution!r}: use two whole numbers, 1 or more"


def _clip(camera: Camera) -> Found:
    start, end = camera.clip_start, camera.clip_end
    # An orthographic view may start behind its plane, as Blender's viewport does; no ray of a
    # perspective goes there.
    if camera.kind != "ORTHOGRAPHIC" and not start >= 0:
        yield f"clip_start is {start!r}: use 0 or more"
    if not start < end:
        yield (
            f"clip_start {start!r} and clip_end {end!r} leave nothing between: use a smaller "
            "clip_start"
        )
    if len(camera.clip_planes) > 6:
        yield f"clip_planes has {len(camera.clip_planes)} rows: use 6 at most"
    if len(camera.clip_planes) and camera.kind == "PANORAMA":
        yield "clip_planes cut panoramas nowhere: use ()"
    for plane in camera.clip_planes:
        yield from numbers("clip_planes", plane, 4)


def _shutter(opening: Any) -> Found:
    found = [*array("shutter", opening, np.float64, (None,))]
    found = found or [*finite_array("shutter", opening)]
    yield from found
    if not found and (len(opening) < 2 or opening.min() < 0 or not opening.any()):
        yield "shutter is never open: use two or more numbers of at least 0, not all 0, or None"


def _motion(keys: np.ndarray) -> Found:
    found = [*array("motion", keys, np.float64, (None, 3, 4))]
    found = found or [*finite_array("motion", keys)]
    yield from found
    if found:
        return
    if len(keys) < 2:
        yield f"motion has {len(keys)} keys: use two or more, or None"
    for key in keys:
        yield from _not_a_frame("motion", key[:, :3])


def _lens(lens: Lens) -> Found:
    values = lens.radius, lens.focus, lens.rotation, lens.ratio
    problems = [*numbers("lens", values, 4)]
    yield from problems
    if not problems and not (lens.radius >= 0 and lens.focus > 0 and lens.ratio > 0):
        yield (
            f"lens has radius {lens.radius!r}, focus {lens.focus!r} and ratio {lens.ratio!r}: use "
            "a radius of 0 or more, the others above 0"
        )
    if not (isinstance(lens.blades, Integral) and (lens.blades == 0 or lens.blades >= 3)):
        yield f"lens has {lens.blades!r} blades: use 0, or 3 and more"


def _world(world: World) -> Found:
    yield from numbers("ambient", world.ambient, 3)
    yield from numbers("background", world.background, 3)
    if not np.isfinite([world.mist.start, world.mist.depth]).all():
        yield "mist is not finite: use numbers"
    yield from at_least("occlusion_distance", world.occlusion_distance, 0, MOST_DISTANCE)
    if world.mist.falloff not in MISTS:
        yield f"mist falloff {world.mist.falloff!r} is not one of {', '.join(MISTS)}"
    found = [*array("axes", world.axes, np.float64, (3, 3))]
    yield from found or finite_array("axes", world.axes)
    yield from _medium(world.medium, len(world.textures), is_world=True)
    if world.program is not None:
        yield from (f"program: {text}" for text in _sky_problems(world, world.program))


def _sky_problems(world: World, program: Program) -> list[str]:
    problems = [*program_problems(program, len(world.textures))]
    if problems:
        return problems
    if any(step.operation.reads_surface for step in instructions(program)):
        problems.append("reads surfaces, which rays that hit nothing do not have")
    if len(program.outputs) != 1:
        problems.append(f"has {len(program.outputs)} outputs: a world's has one")
    return problems
