"""Scene and settings to the core's structures: small tables are made, big arrays are lent where
their layout already fits.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import compress, count
from operator import is_not
from typing import Any

import numpy as np

from ..errors import SceneError
from ..program.operations import Reference
from ..program.program import Instruction, Program, instructions
from ..program.table import CODES
from ..sampling import light_points, pixel_offsets
from ..scene import (
    LOBES,
    Attribute,
    Camera,
    Geometry,
    Input,
    Instances,
    Light,
    Material,
    Mesh,
    Polygons,
    Scene,
    Spheres,
    Texture,
)
from ..settings import BUILDS, ILLUMINATIONS, Settings
from . import core_types

_DOMAINS = ("POINT", "CORNER", "FACE")
_ENCODINGS = ("LINEAR", "SRGB")
_EXTENSIONS = ("REPEAT", "EXTEND", "CLIP", "MIRROR")
_INTERPOLATIONS = ("LINEAR", "CLOSEST")
_CHANNELS = ("COLOR", "ALPHA", "LUMINANCE")
_LIGHTS = ("POINT", "SUN", "SPOT", "AREA", "DOME")
_SHAPES = ("RECTANGLE", "ELLIPSE")
_CAMERAS = ("PERSPECTIVE", "ORTHOGRAPHIC")

# a viewport asks for the same few all the time
_pixel_offsets = functools.lru_cache(maxsize=16)(pixel_offsets)
_light_points = functools.lru_cache(maxsize=16)(light_points)


@dataclass
class Packed:
    """A structure for the core with everything that it points at."""

    data: Any
    lent: list = field(default_factory=list)


@dataclass
class _Packer:
    """Arrays and tables on their way into one structure."""

    lent: list[np.ndarray] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)
    attributes: list[tuple] = field(default_factory=list)
    inputs: list[tuple] = field(default_factory=list)
    lobes: list[tuple] = field(default_factory=list)
    programs: list[tuple] = field(default_factory=list)
    words: list[int] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    tables: list[float] = field(default_factory=list)
    packed: dict[Program, int] = field(default_factory=dict)

    def lend(
        self, values: Any, dtype: type, shape: tuple[int | None, ...], what: str
    ) -> np.ndarray:
        """`values` as a C-contiguous array of that dtype and shape (None: any size), itself where
        possible.
        """
        array = np.ascontiguousarray(values, dtype)
        if array.ndim != len(shape) or any(
            want not in (None, have) for want, have in zip(shape, array.shape, strict=True)
        ):
            wanted = ", ".join("any" if size is None else str(size) for size in shape)
            raise SceneError(f"{what} has the shape {array.shape}: ({wanted}) is needed")
        self.lent.append(array)
        return array

    def optional(self, values: Any, dtype: type, shape: tuple[int | None, ...], what: str) -> int:
        """The address of an array, 0 for None."""
        return 0 if values is None else address(self.lend(values, dtype, shape, what))

    def name(self, text: str) -> int:
        return self.names.setdefault(text, len(self.names))


def address(array: np.ndarray) -> int:
    """Where the first element lies; 0 for an empty array."""
    return array.__array_interface__["data"][0] if array.size else 0


def number(value: str, names: Sequence[str], what: str) -> int:
    """The place of `value` among `names`. Raises SceneError for another value."""
    if value not in names:
        raise SceneError(f"{what} {value!r} is not one of {', '.join(names)}")
    return names.index(value)


def pack_scene(scene: Scene) -> Packed:
    """`scene` as a `core_types.SceneData`. Raises SceneError for arrays of the wrong shape and
    unknown names.
    """
    return ScenePacker().pack(scene)


@dataclass(frozen=True)
class _Part:
    """Tables made from values of a scene. counts: rows of each, by the name of the field that tells
    it to the core.
    """

    source: Any
    tables: dict[str, np.ndarray]
    lent: list


class ScenePacker:
    """Packs scene after scene: tables of values that are the very same as those of the scene before
    are not made again.

    What was packed stays as it is: tables are copied before rows of them change.
    """

    def __init__(self) -> None:
        self._names: dict[str, int] = {}
        self._parts: dict[str, _Part] = {}
        self._nobodys: tuple[Program, int, Material] | None = None

    def pack(self, scene: Scene) -> Packed:
        """As `pack_scene`."""
        data = core_types.SceneData(camera=pack_camera(scene.camera))
        data.ambient[:], data.background[:] = scene.world.ambient, scene.world.background
        data.transparent = scene.world.transparent
        data.world_axes[:] = np.asarray(scene.world.axes, np.float64).T.reshape(9)
        parts = {
            "geometries": self._part("geometries", scene.geometries, self._geometries),
            "materials": self._part(
                "materials", (*scene.materials, *self._sky(scene)), self._materials
            ),
            "textures": self._part("textures", (*scene.textures, *scene.world.textures), _textures),
            "lights": self._part("lights", scene.lights, _lights),
            "instances": self._part("instances", scene.instances, _instances),
        }
        self._parts = parts
        if scene.world.program is not None:
            data.world_program = int(parts["materials"].tables["materials"]["program"][-1])
            data.world_slot = scene.world.program.outputs[0]
        for part in parts.values():
            for name, table in part.tables.items():
                setattr(data, name, address(table))
                setattr(data, _COUNTS[name], len(table))
        return Packed(data, list(parts.values()))

    def _sky(self, scene: Scene) -> tuple[Material, ...]:
        """What brings a world's program into the tables, where its textures follow those of the
        scene: a material without lobes, that nothing wears.
        """
        program, first = scene.world.program, len(scene.textures)
        if program is None:
            return ()
        if self._nobodys is None or self._nobodys[:2] != (program, first):
            numbers = {k: first + k for k in range(len(scene.world.textures))}
            material = Material("world", (), program=program.with_textures(numbers))
            self._nobodys = (program, first, material)
        return (self._nobodys[2],)

    def _part(
        self, name: str, source: tuple, make: Callable[[tuple, _Part | None, list[int]], _Part]
    ) -> _Part:
        before = self._parts.get(name)
        if before is None or len(before.source) != len(source):
            return make(source, None, [])
        changed = list(compress(count(), map(is_not, source, before.source)))
        return make(source, before, changed) if changed else before

    def _geometries(
        self, geometries: tuple[Geometry, ...], before: _Part | None, changed: list[int]
    ) -> _Part:
        if before is not None:
            others = {k: _PackedGeometry(geometries[k], self._names) for k in changed}
            counts = before.tables["geometries"]["attribute_count"]
            if all(len(packed.attributes) == counts[k] for k, packed in others.items()):
                return _patched_geometries(geometries, before, others)
        fresh = [_PackedGeometry(geometry, self._names) for geometry in geometries]
        starts = np.cumsum([0] + [len(packed.attributes) for packed in fresh])
        table = _table(core_types.GeometryData, [packed.row for packed in fresh])
        table["first_attribute"] = starts[:-1]
        attributes = _table(
            core_types.AttributeData, [row for packed in fresh for row in packed.attributes]
        )
        return _Part(
            geometries,
            {"geometries": table, "attributes": attributes},
            [packed.lent for packed in fresh],
        )

    def _materials(
        self, materials: tuple[Material, ...], before: _Part | None, changed: list[int]
    ) -> _Part:
        packer = _Packer(names=self._names)
        rows = [_material(packer, material) for material in materials]
        tables = {
            "materials": _table(core_types.MaterialData, rows),
            "lobes": _table(core_types.LobeData, packer.lobes),
            "inputs": _table(core_types.InputData, packer.inputs),
            "programs": _table(core_types.ProgramData, packer.programs),
            "program_words": np.array(packer.words, np.int32),
            "program_constants": np.array(packer.constants, np.float64),
            "program_tables": np.array(packer.tables, np.float64),
        }
        return _Part(materials, tables, [])


_COUNTS = {
    "geometries": "geometry_count",
    "attributes": "attribute_count",
    "materials": "material_count",
    "lobes": "lobe_count",
    "inputs": "input_count",
    "programs": "program_count",
    "program_words": "program_word_count",
    "program_constants": "program_constant_count",
    "program_tables": "program_table_count",
    "textures": "texture_count",
    "lights": "light_count",
    "instances": "instances_count",
    "world_from_object": "row_count",
    "material_slots": "material_slot_count",
}


def _table(structure: type, rows: Sequence[tuple]) -> np.ndarray:
    return np.array(rows, np.dtype(structure)) if rows else np.empty(0, np.dtype(structure))


class _PackedGeometry:
    """A geometry's row, whose attributes are counted from 0, and theirs."""

    def __init__(self, geometry: Geometry, names: dict[str, int]) -> None:
        packer = _Packer(names=names)
        self.row = _geometry(packer, geometry)
        self.attributes, self.lent = packer.attributes, packer.lent


def _patched_geometries(
    geometries: tuple[Geometry, ...], before: _Part, fresh: dict[int, _PackedGeometry]
) -> _Part:
    """The tables with other rows for geometries that have as many attributes as those in their
    places had.
    """
    tables = {name: table.copy() for name, table in before.tables.items()}
    lent = list(before.lent)
    for k, packed in fresh.items():
        first = int(tables["geometries"]["first_attribute"][k])
        tables["geometries"][k] = packed.row
        tables["geometries"]["first_attribute"][k] = first
        tables["attributes"][first : first + len(packed.attributes)] = _table(
            core_types.AttributeData, packed.attributes
        )
        lent[k] = packed.lent
    return _Part(geometries, tables, lent)


def _textures(textures: tuple[Texture, ...], before: _Part | None, changed: list[int]) -> _Part:
    packer = _Packer()
    return _Part(
        textures,
        {"textures": _table(core_types.TextureData, [_texture(packer, t) for t in textures])},
        packer.lent,
    )


def _lights(lights: tuple[Light, ...], before: _Part | None, changed: list[int]) -> _Part:
    return _Part(
        lights, {"lights": _table(core_types.LightData, [_light(light) for light in lights])}, []
    )


def pack_camera(camera: Camera) -> core_types.CameraData:
    """`camera` as a `core_types.CameraData`."""
    data = core_types.CameraData(clip_start=camera.clip_start, clip_end=camera.clip_end)
    data.world_from_camera[:] = np.asarray(camera.world_from_camera, float).reshape(12)
    data.window[:] = camera.window
    data.width, data.height = camera.resolution
    data.clip_plane_count = len(camera.clip_planes)
    planes = np.ravel(camera.clip_planes)[:24]
    data.clip_planes[: len(planes)] = planes
    data.kind = number(camera.kind, _CAMERAS, "camera kind")
    return data


# --- geometry
# --------------------------------------------------------------------------------------------------


def _geometry(packer: _Packer, geometry: Geometry) -> tuple:
    packs = {Mesh: _mesh, Spheres: _spheres, Polygons: _polygons}
    if type(geometry) not in packs:
        raise SceneError(f"{type(geometry).__name__} is no geometry")
    values = dict.fromkeys((name for name, _ in core_types.GeometryData._fields_), 0)
    values.update(normals=_NO_ATTRIBUTE, first_attribute=len(packer.attributes))
    values.update(packs[type(geometry)](packer, geometry))
    slots, what = (values["primitive_count"],), f"{geometry.name}: material_slots"
    values["material_slots"] = packer.optional(geometry.material_slots, np.uint16, slots, what)
    return tuple(values.values())


_NO_ATTRIBUTE = (0, 0, 0, 0, 0, 0)


def _mesh(packer: _Packer, mesh: Mesh) -> dict[str, Any]:
    vertices = packer.lend(mesh.vertices, np.float32, (None, 3), f"{mesh.name}: vertices")
    triangles = packer.lend(mesh.triangles, np.uint32, (None, 3), f"{mesh.name}: triangles")
    corners = packer.optional(mesh.corners, np.uint32, triangles.shape, f"{mesh.name}: corners")
    normals = _NO_ATTRIBUTE if mesh.normals is None else _attribute(packer, mesh, mesh.normals)
    packer.attributes.extend([_attribute(packer, mesh, attribute) for attribute in mesh.attributes])
    return {
        "vertices": address(vertices),
        "triangles": address(triangles),
        "corners": corners,
        "vertex_count": len(vertices),
        "primitive_count": len(triangles),
        "normals": normals,
        "attribute_count": len(mesh.attributes),
        "kind": 0,
    }


def _attribute(packer: _Packer, mesh: Mesh, attribute: Attribute) -> tuple:
    values = packer.lend(
        attribute.values, np.float32, (None, None), f"{mesh.name}: attribute {attribute.name!r}"
    )
    domain = number(attribute.domain, _DOMAINS, "attribute domain")
    return (address(values), len(values), packer.name(attribute.name), domain, values.shape[1], 0)


def _spheres(packer: _Packer, spheres: Spheres) -> dict[str, Any]:
    centers = packer.lend(spheres.centers, np.float32, (None, 3), f"{spheres.name}: centers")
    radii = packer.lend(spheres.radii, np.float32, (len(centers),), f"{spheres.name}: radii")
    count = len(centers)
    return {
        "vertices": address(centers),
        "radii": address(radii),
        "vertex_count": count,
        "primitive_count": count,
        "kind": 1,
    }


def _polygons(packer: _Packer, polygons: Polygons) -> dict[str, Any]:
    vertices = packer.lend(polygons.vertices, np.float32, (None, 3), f"{polygons.name}: vertices")
    offsets = packer.lend(polygons.offsets, np.uint32, (None,), f"{polygons.name}: offsets")
    indices = packer.lend(polygons.indices, np.uint32, (None,), f"{polygons.name}: indices")
    if len(offsets) < 1:
        raise SceneError(f"{polygons.name}: offsets is empty, it starts with 0")
    return {
        "vertices": address(vertices),
        "offsets": address(offsets),
        "indices": address(indices),
        "vertex_count": len(vertices),
        "primitive_count": len(offsets) - 1,
        "index_count": len(indices),
        "kind": 2,
    }


# --- instances
# --------------------------------------------------------------------------------------------------


def _instances(groups: tuple[Instances, ...], before: _Part | None, changed: list[int]) -> _Part:
    """One array of matrices and one of materials for all groups; a scene's only group lends its
    own.
    """
    if before is not None and all(_differ_in_place(groups[k], before.source[k]) for k in changed):
        return _moved_instances(groups, before, changed)
    packer = _Packer()
    matrices = [np.asarray(group.world_from_object) for group in groups]
    for group, rows in zip(groups, matrices, strict=True):
        if rows.ndim != 3 or rows.shape[1:] != (3, 4):
            raise SceneError(
                f"{group.name}: world_from_object has the shape {rows.shape}: (any, 3, 4) is needed"
            )
    joined = (
        matrices[0]
        if len(matrices) == 1
        else np.concatenate(matrices)
        if matrices
        else np.empty((0, 3, 4))
    )
    joined = packer.lend(joined, np.float64, (None, 3, 4), "world_from_object")
    slots = packer.lend(
        [number for group in groups for number in group.materials], np.uint32, (None,), "materials"
    )
    first_rows = np.cumsum([0] + [len(rows) for rows in matrices])
    first_slots = np.cumsum([0] + [len(group.materials) for group in groups])
    rows = [
        _group(*entry)
        for entry in zip(groups, first_rows, map(len, matrices), first_slots, strict=False)
    ]
    tables = {
        "instances": _table(core_types.InstancesData, rows),
        "world_from_object": joined,
        "material_slots": slots,
    }
    return _Part(groups, tables, packer.lent)


def _differ_in_place(a: Instances, b: Instances) -> bool:
    """Whether two groups are as many placements of the same."""
    alike = a.materials == b.materials and _group(a, 0, 0, 0) == _group(b, 0, 0, 0)
    return alike and np.shape(a.world_from_object) == np.shape(b.world_from_object)


def _moved_instances(groups: tuple[Instances, ...], before: _Part, changed: list[int]) -> _Part:
    matrices = before.tables["world_from_object"].copy()
    first_rows = before.tables["instances"]["first_row"]
    for k in changed:
        first = int(first_rows[k])
        matrices[first : first + len(groups[k].world_from_object)] = groups[k].world_from_object
    return _Part(groups, {**before.tables, "world_from_object": matrices}, before.lent)


def _group(group: Instances, first_row: int, row_count: int, first_slot: int) -> tuple:
    flags = (
        group.visible_camera
        | group.visible_mirror << 1
        | group.visible_shadow << 2
        | group.holdout << 3
    )
    return (
        first_row,
        row_count,
        group.geometry,
        flags,
        first_slot,
        len(group.materials),
        group.object_index,
        0,
    )


# --- materials
# --------------------------------------------------------------------------------------------------


def _material(packer: _Packer, material: Material) -> tuple:
    first, program = len(packer.lobes), material.program
    outputs = program.outputs if program else ()
    for lobe in material.lobes:
        kind = number(lobe.kind, LOBES, "lobe kind")
        fresnel = lobe.fresnel | lobe.schlick << 1
        packer.lobes.append(
            (
                lobe.exponent,
                lobe.ior,
                lobe.masking,
                len(packer.inputs),
                len(lobe.factors),
                kind,
                fresnel,
                _slot(outputs, lobe.exponent_output),
                _slot(outputs, lobe.masking_output),
            )
        )
        packer.inputs.extend([_input(packer, factor, outputs) for factor in lobe.factors])
    return (
        first,
        len(material.lobes),
        material.index,
        1 + _program(packer, program) if program else 0,
        _slot(outputs, material.normal_output),
        0,
    )


def _slot(outputs: tuple[int, ...], output: int) -> int:
    """As the core has it: 0 for none, else one more than the slot."""
    return 1 + outputs[output] if output >= 0 else 0


def _program(packer: _Packer, program: Program) -> int:
    """The program's number; equal ones are packed once."""
    if program in packer.packed:
        return packer.packed[program]
    table, starts = [], []
    for values in program.tables:
        starts.append(len(table))
        table += [float(len(values)), *values]
    numbers = {
        Reference.ATTRIBUTE: [packer.name(name) if name else -1 for name in program.attributes],
        Reference.TEXTURE: program.textures,
        Reference.TABLE: starts,
    }
    words = [word for step in instructions(program) for word in _words(step, numbers)]
    packer.programs.append(
        (
            len(packer.words),
            len(words),
            len(packer.constants),
            len(program.constants),
            len(packer.tables),
            len(table),
            program.slots,
            0,
        )
    )
    packer.words += words
    packer.constants += program.constants
    packer.tables += table
    return packer.packed.setdefault(program, len(packer.packed))


def _words(step: Instruction, numbers: Mapping[Reference, Sequence[int]]) -> list[int]:
    """An instruction whose settings refer to what the core has."""
    settings = [
        numbers[choices][setting] if isinstance(choices, Reference) else setting
        for (_, choices), setting in zip(step.operation.settings, step.settings, strict=True)
    ]
    return [CODES[step.operation.name], *step.outputs, *step.arguments, *settings]


def _input(packer: _Packer, factor: Input, outputs: tuple[int, ...]) -> tuple:
    return (
        factor.value,
        sum(map(tuple, factor.uv_transform), ()),
        factor.offset,
        factor.low,
        factor.high,
        factor.texture,
        number(factor.channel, _CHANNELS, "channel"),
        packer.name(factor.uv) if factor.uv else -1,
        packer.name(factor.attribute) if factor.attribute else -1,
        number(factor.attribute_channel, _CHANNELS, "channel"),
        not factor.is_plain,
        factor.complement,
        _slot(outputs, factor.output),
    )


def _texture(packer: _Packer, texture: Texture) -> tuple:
    dtype = np.uint8 if texture.pixels.dtype == np.uint8 else np.float32
    pixels = packer.lend(texture.pixels, dtype, (None, None, 4), f"texture {texture.name}")
    return (
        address(pixels),
        pixels.shape[1],
        pixels.shape[0],
        dtype is np.float32,
        number(texture.encoding, _ENCODINGS, "encoding"),
        number(texture.extension, _EXTENSIONS, "extension"),
        number(texture.interpolation, _INTERPOLATIONS, "interpolation"),
    )


def _light(light: Light) -> tuple:
    ellipse = number(light.shape, _SHAPES, "light shape")
    flags = (
        light.cast_shadow
        | light.visible_camera << 1
        | light.visible_mirror << 2
        | light.soft_falloff << 3
        | ellipse << 4
    )
    return (
        np.asarray(light.world_from_light, float).reshape(12),
        light.color,
        light.strength,
        light.radius,
        light.angle,
        light.spot_size,
        light.spot_blend,
        light.size_x,
        light.size_y,
        number(light.kind, _LIGHTS, "light kind"),
        flags,
    )


# --- settings
# --------------------------------------------------------------------------------------------------


def pack_settings(scene: Scene, settings: Settings, waves: str, remember: bool = False) -> Packed:
    """`settings` as a `core_types.SettingsData`, with the sample points that the scene's lights
    need.

    waves: one of `core_types.WAVES`.
    """
    packer = _Packer()
    offsets = packer.lend(
        _pixel_offsets(settings.samples, settings.filter_width),
        np.float64,
        (settings.samples, 2),
        "pixel offsets",
    )
    data = core_types.SettingsData(
        pixel_offsets=address(offsets),
        samples=settings.samples,
        error_threshold=settings.error_threshold,
        cutoff=settings.cutoff,
        light_samples=settings.light_samples,
        max_bounces=settings.max_bounces,
        threads=settings.threads,
        passes=sum(1 << core_types.PASS_NUMBERS[name] for name in passes_of(settings)),
        illumination=number(settings.illumination, ILLUMINATIONS, "illumination"),
        waves=core_types.WAVES.index(waves),
        acceleration=BUILDS.index(
            "BALANCED" if settings.acceleration == "AUTO" else settings.acceleration
        ),
        remember=remember,
    )
    data.region[:] = settings.region or (0, 0, *scene.camera.resolution)
    if settings.light_samples > 1 and any(is_soft(light) for light in scene.lights):
        square, disc = _light_points(settings.samples * settings.light_samples)
        data.light_square = address(packer.lend(square, np.float64, (None, 2), "light points"))
        data.light_disc = address(packer.lend(disc, np.float64, (None, 2), "light points"))
        data.light_point_count = len(square)
    for light in scene.lights:
        if light.kind == "DOME":
            _add_dome(data, packer, light, settings)
    return Packed(data, packer.lent)


def _add_dome(
    data: core_types.SettingsData, packer: _Packer, light: Light, settings: Settings
) -> None:
    from ..dome import dome_table

    data.dome_samples = settings.dome_samples
    data.dome_count = settings.samples * settings.dome_samples
    table = dome_table(light, data.dome_count)
    samples = np.concatenate([table.along, table.light, table.points], 1)
    data.dome_table = address(packer.lend(samples, np.float64, (None, 9), "dome samples"))
    data.dome_cells = address(packer.lend(table.cells, np.float32, (None, None, 4), "dome cells"))
    data.dome_rows, data.dome_columns = table.cells.shape[:2]
    data.dome_axes[:] = table.axes.T.reshape(9)


def passes_of(settings: Settings) -> tuple[str, ...]:
    """Combined and what else is wanted, in the core's order. Raises SceneError for an unknown
    pass.
    """
    unknown = sorted(set(settings.passes) - set(core_types.PASS_NUMBERS))
    if unknown:
        raise SceneError(f"no such pass: {', '.join(unknown)}")
    return tuple(
        name for name in core_types.PASS_NUMBERS if name == "Combined" or name in settings.passes
    )


def is_soft(light: Light) -> bool:
    extents = {"SUN": (light.angle,), "AREA": (light.size_x, light.size_y), "DOME": ()}
    return any(extent > 0 for extent in extents.get(light.kind, (light.radius,)))
