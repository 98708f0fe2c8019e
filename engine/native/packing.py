"""Scenes to the core's structures: small tables are made, big arrays are lent where
their layout already fits.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator

import numpy as np

from ..lights.lamps import cluster_levels
from ..program.program import Program
from ..scene import (
    EVERYTHING,
    LIGHT_SHAPES,
    Camera,
    Emitters,
    Geometry,
    Light,
    Material,
    Scene,
    Texture,
)
from ..scene.delta import Numbers, SceneDelta, differing
from ..scene.panorama import Eye, Panorama
from . import core_types
from .packer import Packed, Packer, Part, address, number, table_of
from .packing_geometry import PackedGeometry, patched_geometries
from .packing_instances import pack_instances
from .packing_materials import pack_material, without_ambient


def pack_scene(scene: Scene) -> Packed:
    """`scene` as a `core_types.SceneData`. Raises SceneError for arrays of the wrong shape and
    unknown names.
    """
    return ScenePacker().pack(scene)


class ScenePacker:
    """Packs scene after scene: tables of what is as it was in the scene before are not made again.

    What was packed stays as it is: tables are copied before rows of them change.
    """

    def __init__(self) -> None:
        self._names: dict[str, int] = {}
        self._scene = Scene(None)  # type: ignore[arg-type]  # as unlike any other as can be
        self._parts: dict[str, Part] = {}
        self._nobodys: tuple[tuple, Material] | None = None
        self._lit_by: dict[tuple[Program, int], Material] = {}
        self._unlit: dict[int, tuple[Material, Material]] = {}

    def pack(self, scene: Scene, known: SceneDelta | None = None) -> Packed:
        """As `pack_scene`. known: as `SceneDelta.between` has it."""
        delta = SceneDelta.between(self._scene, scene, known)
        data = core_types.SceneData(camera=pack_camera(scene.camera))
        data.ambient[:], data.background[:] = scene.world.ambient, scene.world.background
        data.transparent, mist = scene.world.transparent, scene.world.mist
        data.mist_start, data.mist_depth = mist.start, mist.depth
        data.occlusion_distance = scene.world.occlusion_distance
        data.aov_count = len(scene.aovs)
        data.light_group_count = len(scene.light_groups)
        data.world_light_group = 1 + scene.world.light_group
        data.mist_falloff = number(mist.falloff, core_types.Mist, "mist falloff")
        data.world_axes[:] = np.asarray(scene.world.axes, np.float64).T.reshape(9)
        materials = (
            *(scene.materials if any(scene.world.ambient) else self._without_ambient(scene)),
            *aov_materials(scene),
            *self._carriers(scene),
            *self._sky(scene),
        )
        place = functools.partial(pack_instances, self._names, delta.how)
        parts = {
            "geometries": self._part(
                "geometries", scene.geometries, self._geometries, delta.geometries
            ),
            "materials": self._derived("materials", materials, self._materials),
            "textures": self._derived("textures", _all_textures(scene), _textures),
            "lights": self._part("lights", scene.lights, _lights, delta.lights),
            "emitters": self._derived("emitters", _all_emitters(scene), _emitters),
            "instances": self._part("instances", scene.instances, place, delta.instances),
        }
        self._scene, self._parts = scene, parts
        parts = {**parts, "lights": _with_programs(scene, parts)}
        if self._sky(scene):
            sky = parts["materials"].tables["materials"][-1]
            data.world_program, data.world_medium = int(sky["program"]), int(sky["medium"])
        if scene.world.program is not None:
            data.world_slot = scene.world.program.outputs[0]
        for part in parts.values():
            for name, table in part.tables.items():
                setattr(data, name, address(table))
                setattr(data, _COUNTS[name], len(table))
        return Packed(data, list(parts.values()))

    def _without_ambient(self, scene: Scene) -> Iterator[Material]:
        """The scene's materials, of a world without ambient light; the same as before, where they
        are.
        """
        known, self._unlit = self._unlit, {}
        for material in scene.materials:
            pair = known.get(id(material)) or (material, without_ambient(material))
            self._unlit[id(material)] = pair
            yield pair[1]

    def _carriers(self, scene: Scene) -> tuple[Material, ...]:
        """What brings the programs of lights into the tables, in their order: materials without
        lobes, that nothing wears. Their textures follow those of the scene and the world.
        """
        first, known, found = len(scene.textures) + len(scene.world.textures), self._lit_by, []
        self._lit_by = {}
        for light in scene.lights:
            if light.program is None:
                continue
            key = light.program, first
            if key not in known:
                numbers = {k: first + k for k in range(len(light.textures))}
                program = light.program.with_textures(numbers)
                known[key] = Material("light", (), program=program)
            self._lit_by[key] = known[key]
            found.append(known[key])
            first += len(light.textures)
        return tuple(found)

    def _sky(self, scene: Scene) -> tuple[Material, ...]:
        """What brings a world's program, whose textures follow those of the scene, and medium into
        the tables: a material without lobes, that nothing wears.
        """
        world, first = scene.world, len(scene.textures)
        if world.program is None and world.medium is None:
            return ()
        key = world.program, first, world.medium
        if self._nobodys is None or self._nobodys[0] != key:
            numbers = {k: first + k for k in range(len(world.textures))}
            program = world.program.with_textures(numbers) if world.program else None
            medium = world.medium.with_textures(numbers) if world.medium else None
            self._nobodys = key, Material("world", (), program=program, medium=medium)
        return (self._nobodys[1],)

    def _part(
        self,
        name: str,
        source: tuple,
        make: Callable[[tuple, Part | None, tuple[int, ...]], Part],
        changed: Numbers,
    ) -> Part:
        before = self._parts.get(name)
        if before is None or changed is None:
            return make(source, None, ())
        return make(source, before, changed) if changed else before

    def _derived(self, name: str, source: tuple, make: Callable) -> Part:
        """Of values that are gathered from several places of the scene."""
        before = self._parts.get(name)
        changed = None if before is None else differing(before.source, source)
        return self._part(name, source, make, changed)

    def _geometries(
        self, geometries: tuple[Geometry, ...], before: Part | None, changed: tuple[int, ...]
    ) -> Part:
        if before is not None:
            others = {k: PackedGeometry(geometries[k], self._names) for k in changed}
            counts = before.tables["geometries"]["attribute_count"]
            if all(len(packed.attributes) == counts[k] for k, packed in others.items()):
                return patched_geometries(geometries, before, others)
        fresh = [PackedGeometry(geometry, self._names) for geometry in geometries]
        starts = np.cumsum([0] + [len(packed.attributes) for packed in fresh])
        table = table_of(core_types.GeometryData, [packed.row for packed in fresh])
        table["first_attribute"] = starts[:-1]
        attributes = table_of(
            core_types.AttributeData, [row for packed in fresh for row in packed.attributes]
        )
        return Part(
            geometries,
            {"geometries": table, "attributes": attributes},
            [packed.lent for packed in fresh],
        )

    def _materials(
        self, materials: tuple[Material, ...], before: Part | None, changed: tuple[int, ...]
    ) -> Part:
        packer = Packer(names=self._names)
        numbers = {id(material): 1 + k for k, material in enumerate(materials)}
        rows = [
            pack_material(packer, material, numbers.get(id(material.aovs), 0))
            for material in materials
        ]
        tables = {
            "materials": table_of(core_types.MaterialData, rows),
            "lobes": table_of(core_types.LobeData, packer.lobes),
            "inputs": table_of(core_types.InputData, packer.inputs),
            "media": table_of(core_types.MediumData, packer.media),
            "programs": table_of(core_types.ProgramData, packer.programs),
            "program_words": np.array(packer.words, np.int32),
            "program_constants": np.array(packer.constants, np.float64),
            "program_tables": np.array(packer.tables, np.float64),
        }
        return Part(materials, tables, [])


_COUNTS = {
    "geometries": "geometry_count",
    "attributes": "attribute_count",
    "materials": "material_count",
    "lobes": "lobe_count",
    "media": "medium_count",
    "inputs": "input_count",
    "programs": "program_count",
    "program_words": "program_word_count",
    "program_constants": "program_constant_count",
    "program_tables": "program_table_count",
    "textures": "texture_count",
    "lights": "light_count",
    "emitters": "emitter_count",
    "emitter_corners": "emitter_corner_count",
    "instances": "instances_count",
    "world_from_object": "row_count",
    "material_slots": "material_slot_count",
    "instance_value_names": "instance_value_count",
    "instance_values": "instance_value_count",
}


def _textures(textures: tuple[Texture, ...], before: Part | None, changed: tuple[int, ...]) -> Part:
    packer = Packer()
    return Part(
        textures,
        {"textures": table_of(core_types.TextureData, [_texture(packer, t) for t in textures])},
        packer.lent,
    )


def _lights(lights: tuple[Light, ...], before: Part | None, changed: tuple[int, ...]) -> Part:
    sizes = [len(light.emitters.corners) if light.emitters else 0 for light in lights]
    firsts = np.cumsum([0, *sizes]).tolist()
    rows = [
        _light(*told) for told in zip(lights, cluster_levels(lights), firsts, sizes, strict=False)
    ]
    return Part(lights, {"lights": table_of(core_types.LightData, rows)}, [])


def aov_materials(scene: Scene) -> tuple[Material, ...]:
    """What the scene's materials give to its AOVs, those that give any."""
    given = (material.aovs for material in scene.materials) if scene.aovs else ()
    return tuple(aovs for aovs in given if aovs is not None)


def _all_emitters(scene: Scene) -> tuple[Emitters, ...]:
    return tuple(light.emitters for light in scene.lights if light.emitters is not None)


def _emitters(
    emitters: tuple[Emitters, ...], before: Part | None, changed: tuple[int, ...]
) -> Part:
    """Of the MESH lights, one after the other."""
    tables = [np.zeros(len(light.corners), np.dtype(core_types.EmitterData)) for light in emitters]
    for light, table in zip(emitters, tables, strict=True):
        for name in ("front", "back"):
            table[name] = getattr(light, name)
        table["normal"], table["spread"] = light.normals, light.spreads
        table["reach"] = light.reaches
        table["light_group"] = 1 + light.light_group
    all_corners = [light.corners.reshape(-1, 9).astype(np.float32) for light in emitters]
    table = np.concatenate(tables) if tables else np.zeros(0, np.dtype(core_types.EmitterData))
    corners = np.concatenate(all_corners) if emitters else np.zeros((0, 9), np.float32)
    return Part(emitters, {"emitters": table, "emitter_corners": corners}, [])


def _all_textures(scene: Scene) -> tuple[Texture, ...]:
    own = (texture for light in scene.lights for texture in light.textures)
    return (*scene.textures, *scene.world.textures, *own)


def _with_programs(scene: Scene, parts: dict[str, Part]) -> Part:
    """The lights' part with the numbers that their programs have in the materials' one."""
    part = parts["lights"]
    rows = [k for k, light in enumerate(scene.lights) if light.program is not None]
    if not rows:
        return part
    first = len(scene.materials) + len(aov_materials(scene))
    table = part.tables["lights"].copy()
    table["program"][rows] = parts["materials"].tables["materials"]["program"][first:][: len(rows)]
    return Part(part.source, {"lights": table}, part.lent)


def pack_camera(camera: Camera) -> core_types.CameraData:
    """`camera` as a `core_types.CameraData`."""
    data = core_types.CameraData(clip_start=camera.clip_start, clip_end=camera.clip_end)
    data.world_from_camera[:] = np.asarray(camera.world_from_camera, float).reshape(12)
    data.window[:] = camera.window
    data.width, data.height = camera.resolution
    data.clip_plane_count = len(camera.clip_planes)
    planes = np.ravel(camera.clip_planes)[:24]
    data.clip_planes[: len(planes)] = planes
    data.kind = number(camera.kind, core_types.CameraKind, "camera kind")
    if camera.kind == "PANORAMA" and camera.panorama is not None:
        _pack_panorama(data, camera.panorama)
    eye = camera.eye or Eye(0.0)
    data.eye_offset, data.convergence = eye.offset, eye.convergence
    data.eye_up[:], data.pole_merge[:] = eye.up, eye.pole_merge or (0.0, 0.0)
    return data


def _pack_panorama(data: core_types.CameraData, panorama: Panorama) -> None:
    data.projection = number(panorama.projection, core_types.Projection, "projection")
    for name in ("longitude", "latitude", "heights", "sensor", "polynomial"):
        getattr(data, name)[:] = getattr(panorama, name)
    data.fov, data.lens = panorama.fov, panorama.lens


# --- textures and lights
# --------------------------------------------------------------------------------------------------


def _texture(packer: Packer, texture: Texture) -> tuple:
    dtype = np.uint8 if texture.pixels.dtype == np.uint8 else np.float32
    pixels = packer.lend(texture.pixels, dtype, (None, None, 4), f"texture {texture.name}")
    return (
        address(pixels),
        pixels.shape[1],
        pixels.shape[0],
        dtype is np.float32,
        number(texture.encoding, core_types.Encoding, "encoding"),
        number(texture.extension, core_types.Extension, "extension"),
        number(texture.interpolation, core_types.Interpolation, "interpolation"),
    )


def _light(light: Light, level: int, first_emitter: int, emitter_count: int) -> tuple:
    bits = core_types.LightFlags
    flags = (
        bits.CAST_SHADOW * light.cast_shadow
        | bits.SEEN_BY_CAMERA * light.visible_camera
        | bits.SEEN_BY_MIRROR * light.visible_mirror
        | bits.SEEN_BY_TRANSMISSION * light.visible_transmission
        | bits.SOFT_FALLOFF * light.soft_falloff
        | bits.ELLIPSE * LIGHT_SHAPES.index(light.shape)
        | bits.NOT_ON_MATT * (not light.lights_matt)
        | bits.NOT_ON_GLOSS * (not light.lights_gloss)
        | bits.NOT_IN_MEDIA * (not light.lights_media)
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
        light.spread,
        number(light.kind, core_types.LightKind, "light kind"),
        flags,
        0,
        light.program.outputs[0] if light.program is not None else 0,
        level,
        1 + light.light_group,
        EVERYTHING ^ light.receivers,
        EVERYTHING ^ light.blockers,
        first_emitter,
        emitter_count,
    )
