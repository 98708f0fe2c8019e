"""Settings to the core's structures, with the tables of sample points that a scene needs."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from ..errors import SceneError
from ..film import OCCLUSION, PASSES
from ..lights.dome import dome_table
from ..lights.glowing_media import medium_table
from ..lights.interleaving import interleaving, visibility_samples
from ..lights.lamps import is_soft
from ..lights.mesh_lights import MeshTable, mesh_table
from ..lights.openings import opening_table
from ..sampling import (
    BOUNCE_PARTS,
    bounce_points,
    dealt_offsets,
    dealt_samples,
    light_points,
    lobe_points,
    node_points,
    occlusion_points,
    scatter_offsets,
    subsurface_points,
)
from ..sampling.lens import BLOCK, lens_points
from ..sampling.motion import camera_frames, is_moving, sample_times
from ..scene import Lens, Light, Openings, Polygons, Scene, Spheres
from ..settings import DECLARED, Settings
from . import core_types
from .packer import Packed, Packer, address, number
from .packing import pack_camera

PASS_NUMBERS = {name: core_types.Pass[name.upper().replace(" ", "_")].value for name in PASSES}
"""The core's numbers of the passes."""

# a viewport asks for the same few all the time
_lens_points = functools.lru_cache(maxsize=4)(lens_points)
_pixel_offsets = functools.lru_cache(maxsize=16)(dealt_offsets)
_light_points = functools.lru_cache(maxsize=16)(light_points)

_SAME = [
    name
    for name, *_ in core_types.RenderSettingsData._fields_
    if name in DECLARED and not DECLARED[name].choices
]
"""Numbers that the core takes as they are, under the same name."""


def pack_settings(scene: Scene, settings: Settings, waves: str, remember: bool = False) -> Packed:
    """`settings` as `core_types.RenderSettingsData`, with the sample points that the scene's lights
    need.

    waves: of `core_types.Waves`.
    """
    packer = Packer()
    each = visibility_samples(scene, settings)
    offsets = _pixel_offsets(settings.samples, each, settings.filter_width)
    offsets = packer.lend(offsets, np.float64, (each, None, 2), "pixel offsets")
    data = core_types.RenderSettingsData(
        pixel_offsets=address(offsets), waves=core_types.Waves[waves], remember=remember
    )
    data.interleaving = interleaving(scene, settings)
    data.resolves = settings.soft_light == "RESOLVED"
    data.reflective_caustics = settings.reflective_caustics == "ON"
    data.refractive_caustics = settings.refractive_caustics == "ON"
    for name in _SAME:
        setattr(data, name, getattr(settings, name))
    data.visibility_samples = each
    data.passes = sum(1 << PASS_NUMBERS[name] for name in passes_of(settings))
    data.passes |= (1 << core_types.Pass.AOV) if scene.aovs else 0
    data.passes |= (1 << core_types.Pass.LIGHT_GROUPS) if scene.light_groups else 0
    data.illumination = number(settings.illumination, core_types.Illumination, "illumination")
    build = "BALANCED" if settings.acceleration == "AUTO" else settings.acceleration
    data.acceleration = number(build, core_types.Build, "acceleration")
    data.reflections = number(settings.reflecting, core_types.Reflect, "reflections")
    data.region[:] = settings.region or (0, 0, *scene.camera.resolution)
    dealt = replace(settings, samples=dealt_samples(settings.samples, data.interleaving))
    has_dome = any(light.kind == "DOME" for light in scene.lights)
    deals_dome = has_dome and data.interleaving > 1
    if settings.reflecting != "OFF" or deals_dome or _has_rough_glass(scene):
        points = lobe_points(dealt.samples)
        data.lobe_levels, data.lobe_count = len(points), points.size // 2
        points = packer.lend(points.reshape(-1, 2), np.float64, (None, 2), "lobe points")
        data.lobe_points = address(points)
    _add_scattering(data, packer, scene, dealt)
    _add_bounces(data, packer, scene, dealt)
    if settings.light_samples > 1 and any(is_soft(light) for light in scene.lights):
        square, disc = _light_points(dealt.samples * settings.light_samples)
        data.light_square = address(packer.lend(square, np.float64, (None, 2), "light points"))
        data.light_disc = address(packer.lend(disc, np.float64, (None, 2), "light points"))
        data.light_point_count = len(square)
    for light in scene.lights:
        if light.kind == "DOME":
            _add_dome(data, packer, light, dealt)
    _add_meshes(data, packer, [x for x in scene.lights if x.kind == "MESH"], dealt)
    _add_media(data, packer, [x for x in scene.lights if x.kind == "MEDIUM"], dealt)
    if scene.camera.lens:
        _add_lens(data, packer, scene.camera.lens, settings)
    data.moving = is_moving(scene)
    if scene.camera.motion is not None:
        _add_motion(data, packer, scene, settings)
    _add_neighbours(data, packer, scene, settings)
    _add_occlusion(data, packer, dealt)
    _add_node_points(data, packer, scene, dealt)
    _add_subsurface(data, packer, scene, dealt)
    return Packed(data, packer.lent)


def _add_scattering(
    data: core_types.RenderSettingsData, packer: Packer, scene: Scene, settings: Settings
) -> None:
    """Where media scatter light from, if any do."""
    if scene.scatters:
        offsets = scatter_offsets(settings.samples)
        offsets = packer.lend(offsets, np.float64, (None,), "scatter offsets")
        data.scatter_offsets, data.scatter_count = address(offsets), len(offsets)


def _add_dome(
    data: core_types.RenderSettingsData, packer: Packer, light: Light, settings: Settings
) -> None:
    data.dome_samples = settings.dome_samples
    table = dome_table(light, settings.samples, settings.dome_samples)
    data.dome_count = len(table.along)
    samples = np.column_stack([table.along, table.light, table.points, table.shadowed])
    data.dome_table = address(packer.lend(samples, np.float64, (None, 10), "dome samples"))
    data.dome_cells = address(packer.lend(table.cells, np.float32, (None, None, 4), "dome cells"))
    data.dome_rows, data.dome_columns = table.cells.shape[:2]
    even = packer.lend(table.irradiance, np.float32, (None, None, 3), "dome irradiance")
    data.dome_irradiance = address(even)
    data.dome_irradiance_rows, data.dome_irradiance_columns = even.shape[:2]
    data.dome_axes[:] = table.axes.T.reshape(9)
    if light.openings is not None:
        _add_openings(data, packer, light.openings, settings)


def _add_openings(
    data: core_types.RenderSettingsData, packer: Packer, found: Openings, settings: Settings
) -> None:
    rows = np.concatenate(
        [found.centers, found.right, found.up, found.normals, found.shares[:, None]], 1
    )
    data.openings = address(packer.lend(rows, np.float64, (None, 13), "openings"))
    number, place = opening_table(found, settings.samples, settings.opening_samples)
    points = np.concatenate([number[:, None], place], 1)
    data.opening_points = address(packer.lend(points, np.float64, (None, 3), "opening points"))
    data.opening_count, data.opening_point_count = len(rows), len(points)
    data.opening_samples = settings.opening_samples


def _lend_points(packer: Packer, tables: list[MeshTable], name: str) -> tuple[int, int]:
    """Where the tables of lights of a kind lie, one after the other, and the rows of each."""
    rows = np.concatenate([_point_rows(table) for table in tables])
    lent = packer.lend(rows, np.float64, (None, 18), name)
    return address(lent), len(rows) // len(tables)


def _add_meshes(
    data: core_types.RenderSettingsData, packer: Packer, lights: list[Light], settings: Settings
) -> None:
    if not lights:
        return
    tables = [mesh_table(light, settings.samples, settings.mesh_samples) for light in lights]
    data.mesh_table, data.mesh_count = _lend_points(packer, tables, "mesh light samples")
    data.mesh_samples = tables[0].each


def _add_media(
    data: core_types.RenderSettingsData, packer: Packer, lights: list[Light], settings: Settings
) -> None:
    if not lights:
        return
    tables = [medium_table(light, settings.samples, settings.medium_samples) for light in lights]
    data.medium_table, data.medium_count = _lend_points(packer, tables, "medium light samples")
    data.medium_samples = tables[0].each
    data.medium_shadows = settings.medium_shadows


def _point_rows(t: MeshTable) -> np.ndarray:
    """(k, 18) as glint.h has mesh_table."""
    columns = (t.point, t.normal, t.front, t.back, t.spread, t.reach, t.disc)
    return np.column_stack((*columns, np.zeros(len(t.point)), 1 + t.light_group))


def _add_motion(
    data: core_types.RenderSettingsData, packer: Packer, scene: Scene, settings: Settings
) -> None:
    times = sample_times(scene, settings.samples)
    frames = camera_frames(scene.camera, times).reshape(-1, 12)
    frames = packer.lend(frames, np.float64, (None, 12), "camera frames")
    data.camera_frames, data.camera_frame_count = address(frames), len(frames)
    data.camera_block = BLOCK


def _add_neighbours(
    data: core_types.RenderSettingsData, packer: Packer, scene: Scene, settings: Settings
) -> None:
    """Where things are in the frames before and after, where they are asked for, and the
    vertices of geometries that have another shape there.
    """
    if scene.neighbours is None or "Vector" not in settings.passes:
        return
    both = (core_types.NeighbourData * 2)()
    for told, other in zip(both, scene.neighbours, strict=True):
        blocks = [np.zeros((0, 3, 4)), *(block.world_from_object for block in other.instances)]
        rows = packer.lend(np.concatenate(blocks), np.float64, (None, 3, 4), "neighbour")
        shapes = np.zeros(len(other.geometries), np.dtype(core_types.ShapeData))
        for k, (here, there) in enumerate(zip(scene.geometries, other.geometries, strict=True)):
            if there is not here and not isinstance(here, Polygons):
                points = there.centers if isinstance(there, Spheres) else there.vertices
                vertices = packer.lend(points, np.float32, (None, 3), "neighbour")
                shapes[k] = address(vertices), len(vertices)
        told.camera, told.world_from_object = pack_camera(other.camera), address(rows)
        told.row_count, told.shapes, told.shape_count = len(rows), address(shapes), len(shapes)
        packer.lent.append(shapes)
    table = np.frombuffer(memoryview(both), np.dtype(core_types.NeighbourData))
    packer.lent.append(table)
    data.neighbours = address(table)


def _add_occlusion(data: core_types.RenderSettingsData, packer: Packer, settings: Settings) -> None:
    """Directions in which the pass looks, where it is asked for."""
    if OCCLUSION not in settings.passes:
        return
    points = occlusion_points(settings.samples, settings.occlusion_samples)
    points = packer.lend(points, np.float64, (None, 2), "occlusion points")
    data.occlusion_points, data.occlusion_count = address(points), len(points)
    data.occlusion_samples = settings.occlusion_samples


def _add_node_points(
    data: core_types.RenderSettingsData, packer: Packer, scene: Scene, settings: Settings
) -> None:
    """Directions in which programs look, where any asks for rays."""
    each = scene.most_asked
    if each > 0:
        points = node_points(settings.samples, each)
        points = packer.lend(points, np.float64, (None, 5), "points of nodes")
        data.node_points, data.node_point_count = address(points), len(points)


def _add_subsurface(
    data: core_types.RenderSettingsData, packer: Packer, scene: Scene, settings: Settings
) -> None:
    """What comes out of surfaces elsewhere, where some do."""
    if settings.subsurface == "ON" and scene.has_subsurface:
        points = subsurface_points(settings.samples)
        points = packer.lend(points, np.float64, (None, 6), "subsurface points")
        data.subsurface_points, data.subsurface_count = address(points), len(points)


def _add_bounces(
    data: core_types.RenderSettingsData, packer: Packer, scene: Scene, settings: Settings
) -> None:
    """How light bounces along paths, where it does."""
    data.bounces = settings.bounces if scene.lights else 0
    if data.bounces:
        parts = BOUNCE_PARTS if data.interleaving > 1 else 1
        points = bounce_points(parts * settings.samples)
        data.bounce_levels, data.bounce_count = points.shape[:2]
        points = packer.lend(points, np.float64, (None, None, 3), "bounce points")
        data.bounce_points = address(points)


def _add_lens(
    data: core_types.RenderSettingsData, packer: Packer, lens: Lens, settings: Settings
) -> None:
    points = packer.lend(
        _lens_points(lens, settings.samples).reshape(-1, 2), np.float64, (None, 2), "lens points"
    )
    data.lens_points, data.lens_point_count = address(points), len(points)
    data.camera_block, data.lens_focus = BLOCK, lens.focus


def passes_of(settings: Settings) -> tuple[str, ...]:
    """Combined and what else is wanted, in the core's order. Raises SceneError for an unknown
    pass.
    """
    unknown = sorted(set(settings.passes) - set(PASS_NUMBERS))
    if unknown:
        raise SceneError(f"no such pass: {', '.join(unknown)}")
    wanted = {"Combined", *settings.passes}
    return tuple(sorted(wanted, key=PASS_NUMBERS.__getitem__))


def _has_rough_glass(scene: Scene) -> bool:
    return any(lobe.is_rough_glass for material in scene.materials for lobe in material.lobes)
