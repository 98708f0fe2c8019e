"""The structures of core/include/glint.h, field by field. Pointers are plain addresses (c_size_t),
so that tables can be NumPy arrays.
"""

from __future__ import annotations

from ctypes import Structure, c_double, c_int32, c_size_t, c_uint32, c_uint64
from typing import Any

ABI_VERSION = 13

PREPARING, TRACING, HELD, DONE, CANCELLED, FAILED = range(6)
"""States of a render."""

WAVES = ("UNSEEN", "SEEN", "HELD")
"""Who looks at a render's waves: nobody before the end, whoever passes by, somebody for whom each
of them waits.
"""

PASS_NUMBERS = {
    "Combined": 0,
    "Diffuse": 1,
    "Specular": 2,
    "Ambient": 3,
    "Shadow": 4,
    "Mirror": 5,
    "Emission": 6,
    "Environment": 7,
    "Depth": 8,
    "Position": 9,
    "Normal": 10,
    "UV": 11,
    "Object Index": 12,
    "Material Index": 13,
    "Error": 14,
    "Samples": 15,
    "Cost": 16,
    "Grazing": 17,
    "Gap": 18,
    "Fallbacks": 19,
}

FEATURES = (
    "mirror",
    "refraction",
    "transparent",
    "soft lights",
    "textures",
    "smooth normals",
    "holdout",
    "visible lights",
    "node programs",
    "world light",
)
"""Names of the bits of `StatsData.features`, from the lowest."""


def _each(kind: Any, names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names.split()]


class AttributeData(Structure):
    _fields_ = (
        _each(c_size_t, "values")
        + _each(c_uint64, "rows")
        + _each(c_int32, "name domain channels reserved")
    )


class GeometryData(Structure):
    _fields_ = (
        _each(c_size_t, "vertices triangles corners radii offsets indices material_slots")
        + _each(c_uint64, "vertex_count primitive_count index_count")
        + _each(AttributeData, "normals")
        + _each(c_uint32, "first_attribute attribute_count")
        + _each(c_int32, "kind reserved")
    )


class InstancesData(Structure):
    _fields_ = (
        _each(c_uint64, "first_row row_count")
        + _each(c_uint32, "geometry flags first_material material_count")
        + _each(c_int32, "object_index reserved")
    )


class TextureData(Structure):
    _fields_ = (
        _each(c_size_t, "pixels")
        + _each(c_uint32, "width height")
        + _each(c_int32, "type encoding extension interpolation")
    )


class ProgramData(Structure):
    _fields_ = _each(
        c_uint64,
        "first_word word_count first_constant constant_count first_table table_size",
    ) + _each(c_uint32, "slots reserved")


class InputData(Structure):
    _fields_ = (
        _each(c_double * 3, "value")
        + _each(c_double * 6, "uv_transform")
        + _each(c_double * 3, "offset")
        + _each(c_double, "low high")
        + _each(c_int32, "texture channel uv attribute attribute_channel bounded complement output")
    )


class LobeData(Structure):
    _fields_ = (
        _each(c_double, "exponent ior masking")
        + _each(c_uint32, "first_input input_count")
        + _each(c_int32, "kind fresnel exponent_slot masking_slot")
    )


class MaterialData(Structure):
    _fields_ = _each(c_uint32, "first_lobe lobe_count") + _each(
        c_int32, "index program normal reserved"
    )


class LightData(Structure):
    _fields_ = (
        _each(c_double * 12, "world_from_light")
        + _each(c_double * 3, "color")
        + _each(c_double, "strength radius angle spot_size spot_blend size_x size_y")
        + _each(c_int32, "kind")
        + _each(c_uint32, "flags")
    )


class CameraData(Structure):
    _fields_ = (
        _each(c_double * 12, "world_from_camera")
        + _each(c_double * 4, "window")
        + _each(c_double, "clip_start clip_end")
        + _each(c_uint32, "width height")
        + _each(c_int32, "kind clip_plane_count")
        + _each(c_double * 24, "clip_planes")
    )


class SceneData(Structure):
    _fields_ = (
        _each(CameraData, "camera")
        + _each(c_double * 3, "ambient background")
        + _each(c_double * 9, "world_axes")
        + _each(c_int32, "transparent world_program world_slot reserved")
        + _each(
            c_size_t,
            "geometries attributes instances world_from_object material_slots textures "
            "program_words program_constants program_tables programs inputs lobes materials lights",
        )
        + _each(
            c_uint64, "geometry_count attribute_count instances_count row_count material_slot_count"
        )
        + _each(
            c_uint64,
            "texture_count program_word_count program_constant_count program_table_count "
            "program_count input_count lobe_count material_count light_count",
        )
    )


class SettingsData(Structure):
    _fields_ = (
        _each(c_size_t, "pixel_offsets light_square light_disc dome_table dome_cells")
        + _each(c_uint64, "light_point_count dome_count")
        + _each(c_double * 9, "dome_axes")
        + _each(c_double, "error_threshold cutoff")
        + _each(
            c_uint32,
            "samples light_samples dome_samples dome_rows dome_columns max_bounces threads passes",
        )
        + _each(c_uint32 * 4, "region")
        + _each(c_int32, "illumination waves acceleration remember")
    )


class ProgressData(Structure):
    _fields_ = _each(c_double, "fraction") + _each(c_uint32, "samples") + _each(c_int32, "state")


class StatsData(Structure):
    _fields_ = (
        _each(c_double, "build_seconds trace_seconds")
        + _each(c_uint64, "triangles instances primitives tree_bytes tree_nodes")
        + _each(c_uint64, "dropped_primitives dropped_instances dropped_lights")
        + _each(c_uint64, "camera_rays shadow_rays mirror_rays refraction_rays transparent_rays")
        + _each(c_uint32, "features threads")
    )


class AccelData(Structure):
    _fields_ = _each(c_size_t, "geometries instances world_from_object") + _each(
        c_uint64, "geometry_count instances_count row_count"
    )


class RaysData(Structure):
    """GlintRaysF32 and GlintRaysF64: they differ in what their addresses point at."""

    _fields_ = (
        _each(c_size_t, "origins directions t_min t_max")
        + _each(c_uint64, "count")
        + _each(
            c_uint32, "origin_stride direction_stride t_min_stride t_max_stride visibility threads"
        )
    )


class HitsData(Structure):
    """GlintHitsF32 and GlintHitsF64."""

    _fields_ = _each(c_size_t, "t instance primitive u v")


class AccelStatsData(Structure):
    _fields_ = (
        _each(c_double * 3, "low high")
        + _each(c_double, "build_seconds")
        + _each(c_uint64, "instances primitives dropped bytes nodes")
    )
