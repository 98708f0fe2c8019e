"""Made by packaging/core_types.py from core/include/glint.h, which says what it means.

Constants have lost the prefixes of their enum. Pointers are plain addresses (c_size_t), so that
tables can be NumPy arrays.
"""

from __future__ import annotations

from ctypes import Structure, c_double, c_int32, c_size_t, c_uint32, c_uint64
from enum import IntEnum
from typing import Any

ABI_VERSION = 83


def _each(kind: Any, names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names.split()]


class GeometryKind(IntEnum):
    MESH = 0
    SPHERES = 1
    POLYGONS = 2
    STRANDS = 3


class Domain(IntEnum):
    POINT = 0
    CORNER = 1
    FACE = 2


class InstanceFlags(IntEnum):
    VISIBLE_CAMERA = 1
    VISIBLE_MIRROR = 2
    VISIBLE_SHADOW = 4
    HOLDOUT = 8
    CATCHER = 16
    VISIBLE_TRANSMISSION = 32
    VISIBLE_DIFFUSE = 64


class TextureType(IntEnum):
    UINT8 = 0
    FLOAT32 = 1


class Encoding(IntEnum):
    LINEAR = 0
    SRGB = 1


class Extension(IntEnum):
    REPEAT = 0
    EXTEND = 1
    CLIP = 2
    MIRROR = 3


class Interpolation(IntEnum):
    LINEAR = 0
    CLOSEST = 1
    CUBIC = 2


class Channel(IntEnum):
    COLOR = 0
    ALPHA = 1
    LUMINANCE = 2


class LobeKind(IntEnum):
    AMBIENT = 0
    DIFFUSE = 1
    SPECULAR = 2
    MIRROR = 3
    REFRACTION = 4
    TRANSPARENT = 5
    EMISSION = 6
    SHEEN = 7
    TRANSLUCENT = 8
    HOLDOUT = 9
    TOON_DIFFUSE = 10
    TOON_SPECULAR = 11
    OREN_NAYAR = 12
    OREN_NAYAR_MULTIPLE = 13
    FIBRE_DIFFUSE = 14
    FIBRE_SPECULAR = 15
    FIBRE_TRANSMISSION = 16


class Distribution(IntEnum):
    BLINN_PHONG = 0
    GGX = 1
    BECKMANN = 2
    ASHIKHMIN_SHIRLEY = 3


class Fresnel(IntEnum):
    DIELECTRIC = 1
    SCHLICK = 2
    EDGE = 4
    OUTSIDE = 8
    BOTH_SIDES = 16


class BumpShadowing(IntEnum):
    NONE = 0
    SIDES = 1
    CHIANG = 2
    GGX = 3


class LightKind(IntEnum):
    POINT = 0
    SUN = 1
    SPOT = 2
    AREA = 3
    DOME = 4
    MESH = 5
    MEDIUM = 6


class LightFlags(IntEnum):
    CAST_SHADOW = 1
    SEEN_BY_CAMERA = 2
    SEEN_BY_MIRROR = 4
    SOFT_FALLOFF = 8
    ELLIPSE = 16
    NOT_ON_MATT = 32
    NOT_ON_GLOSS = 64
    NOT_IN_MEDIA = 128
    SEEN_BY_TRANSMISSION = 256


class CameraKind(IntEnum):
    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1
    PANORAMA = 2


class Projection(IntEnum):
    EQUIRECTANGULAR = 0
    FISHEYE_EQUIDISTANT = 1
    FISHEYE_EQUISOLID = 2
    FISHEYE_LENS_POLYNOMIAL = 3
    MIRROR_BALL = 4
    EQUIANGULAR_CUBEMAP_FACE = 5
    CENTRAL_CYLINDRICAL = 6


class Mist(IntEnum):
    QUADRATIC = 0
    LINEAR = 1
    INVERSE_QUADRATIC = 2


class Illumination(IntEnum):
    PHYSICAL = 0
    CLASSIC = 1


class Build(IntEnum):
    FAST = 0
    BALANCED = 1
    FINE = 2


class Reflect(IntEnum):
    OFF = 0
    METALS = 1
    ALL = 2


class Waves(IntEnum):
    UNSEEN = 0
    SEEN = 1
    HELD = 2


class Pass(IntEnum):
    COMBINED = 0
    DIFFUSE = 1
    SPECULAR = 2
    AMBIENT = 3
    SHADOW = 4
    MIRROR = 5
    EMISSION = 6
    ENVIRONMENT = 7
    DEPTH = 8
    POSITION = 9
    NORMAL = 10
    UV = 11
    OBJECT_INDEX = 12
    MATERIAL_INDEX = 13
    ERROR = 14
    SAMPLES = 15
    COST = 16
    GRAZING = 17
    GAP = 18
    FALLBACKS = 19
    MIST = 20
    CRYPTO_OBJECT = 21
    CRYPTO_MATERIAL = 22
    CRYPTO_ASSET = 23
    AOV = 24
    DENOISING_NORMAL = 25
    DENOISING_ALBEDO = 26
    DENOISING_DEPTH = 27
    SHADOW_CATCHER = 28
    DIFFUSE_DIRECT = 29
    DIFFUSE_INDIRECT = 30
    DIFFUSE_COLOR = 31
    GLOSSY_DIRECT = 32
    GLOSSY_INDIRECT = 33
    GLOSSY_COLOR = 34
    TRANSMISSION_DIRECT = 35
    TRANSMISSION_INDIRECT = 36
    TRANSMISSION_COLOR = 37
    VOLUME_DIRECT = 38
    VOLUME_INDIRECT = 39
    VECTOR = 40
    AMBIENT_OCCLUSION = 41
    LIGHT_GROUPS = 42


class State(IntEnum):
    PREPARING = 0
    TRACING = 1
    HELD = 2
    MOVING = 3
    DONE = 4
    CANCELLED = 5
    FAILED = 6


class Feature(IntEnum):
    MIRROR = 1
    REFRACTION = 2
    TRANSPARENT = 4
    SOFT_LIGHTS = 8
    TEXTURES = 16
    SMOOTH_NORMALS = 32
    HOLDOUT = 64
    VISIBLE_LIGHTS = 128
    NODE_PROGRAMS = 256
    WORLD_LIGHT = 512
    MESH_LIGHT = 1024
    DEPTH_OF_FIELD = 2048
    CAMERA_MOTION = 4096
    OBJECT_MOTION = 16384
    MEDIA = 32768
    SHADOW_CATCHER = 65536
    OPENINGS = 131072
    VARIED_MEDIA = 262144
    MEDIUM_LIGHT = 524288


class MathFunction(IntEnum):
    EXP = 0
    LOG = 1
    COS = 2
    SIN = 3
    COSINE_POWER = 4


class Hash(IntEnum):
    BLOCK = 1024
    SUMS = 4


class AttributeData(Structure):
    _fields_ = [
        *_each(c_size_t, "values"),
        *_each(c_uint64, "rows"),
        *_each(c_int32, "name domain channels reserved"),
    ]


class GeometryData(Structure):
    _fields_ = [
        *_each(c_size_t, "vertices triangles corners radii offsets indices material_slots"),
        *_each(c_uint64, "vertex_count primitive_count index_count"),
        *_each(AttributeData, "normals"),
        *_each(c_uint32, "first_attribute attribute_count"),
        *_each(c_int32, "kind reserved"),
    ]


class InstancesData(Structure):
    _fields_ = [
        *_each(c_uint64, "first_row row_count"),
        *_each(c_uint32, "geometry flags first_material material_count"),
        *_each(c_int32, "object_index"),
        *_each(c_uint32, "light_set crypto_object crypto_asset"),
        *_each(c_int32, "light_group reserved"),
        *_each(c_double, "geometry_offset shading_offset"),
    ]


class TextureData(Structure):
    _fields_ = [
        *_each(c_size_t, "pixels"),
        *_each(c_uint32, "width height"),
        *_each(c_int32, "type encoding extension interpolation"),
    ]


class ProgramData(Structure):
    _fields_ = [
        *_each(c_uint64, "first_word word_count first_constant constant_count first_table"),
        *_each(c_uint64, "table_size"),
        *_each(c_uint32, "slots reserved"),
    ]


class InputData(Structure):
    _fields_ = [
        *_each(c_double * 3, "value"),
        *_each(c_double * 6, "uv_transform"),
        *_each(c_double * 3, "offset"),
        *_each(c_double, "low high"),
        *_each(c_int32, "texture channel uv attribute attribute_channel bounded complement output"),
    ]


class LobeData(Structure):
    _fields_ = [
        *_each(c_double, "exponent masking ior"),
        *_each(c_double * 3, "radius"),
        *_each(c_uint32, "first_input input_count"),
        *_each(c_int32, "kind fresnel exponent_slot masking_slot ior_slot fibre_slot normal_slot"),
        *_each(c_int32, "stretch_slot radius_slot distribution"),
    ]


class MaterialData(Structure):
    _fields_ = [
        *_each(c_uint32, "first_lobe lobe_count"),
        *_each(c_int32, "index program normal"),
        *_each(c_uint32, "crypto"),
        *_each(c_int32, "aov medium bump_shadowing base_normal"),
    ]


class MediumData(Structure):
    _fields_ = [
        *_each(c_double * 3, "absorption scattering emission"),
        *_each(c_double, "anisotropy step"),
        *_each(c_int32, "program absorption_slot scattering_slot emission_slot anisotropy_slot"),
        *_each(c_int32, "reserved"),
    ]


class LightData(Structure):
    _fields_ = [
        *_each(c_double * 12, "world_from_light"),
        *_each(c_double * 3, "color"),
        *_each(c_double, "strength radius angle spot_size spot_blend size_x size_y spread"),
        *_each(c_int32, "kind"),
        *_each(c_uint32, "flags"),
        *_each(c_int32, "program program_slot level light_group"),
        *_each(c_uint64, "excluded_sets passed_sets first_emitter emitter_count"),
    ]


class EmitterData(Structure):
    _fields_ = [
        *_each(c_double * 3, "front back normal"),
        *_each(c_double, "spread reach"),
        *_each(c_int32, "light_group reserved"),
    ]


class CameraData(Structure):
    _fields_ = [
        *_each(c_double * 12, "world_from_camera"),
        *_each(c_double * 4, "window"),
        *_each(c_double, "clip_start clip_end"),
        *_each(c_uint32, "width height"),
        *_each(c_int32, "kind clip_plane_count"),
        *_each(c_double * 24, "clip_planes"),
        *_each(c_double * 2, "longitude latitude heights"),
        *_each(c_double, "fov lens"),
        *_each(c_double * 2, "sensor"),
        *_each(c_double * 5, "polynomial"),
        *_each(c_double, "eye_offset convergence"),
        *_each(c_double * 2, "pole_merge"),
        *_each(c_double * 3, "eye_up"),
        *_each(c_int32, "projection reserved"),
    ]


class SceneData(Structure):
    _fields_ = [
        *_each(CameraData, "camera"),
        *_each(c_double * 3, "ambient background"),
        *_each(c_double * 9, "world_axes"),
        *_each(c_double, "mist_start mist_depth occlusion_distance"),
        *_each(c_int32, "transparent world_program world_slot mist_falloff aov_count world_medium"),
        *_each(c_int32, "light_group_count world_light_group"),
        *_each(c_size_t, "geometries attributes instances world_from_object material_slots"),
        *_each(c_size_t, "instance_value_names instance_values textures program_words"),
        *_each(c_size_t, "program_constants program_tables programs inputs lobes materials media"),
        *_each(c_size_t, "lights emitters emitter_corners"),
        *_each(c_uint64, "geometry_count attribute_count instances_count row_count"),
        *_each(c_uint64, "material_slot_count texture_count program_word_count"),
        *_each(c_uint64, "program_constant_count program_table_count program_count input_count"),
        *_each(c_uint64, "lobe_count material_count light_count emitter_count"),
        *_each(c_uint64, "emitter_corner_count instance_value_count medium_count"),
    ]


class ShapeData(Structure):
    _fields_ = [
        *_each(c_size_t, "vertices"),
        *_each(c_uint64, "vertex_count"),
    ]


class NeighbourData(Structure):
    _fields_ = [
        *_each(CameraData, "camera"),
        *_each(c_size_t, "world_from_object shapes"),
        *_each(c_uint64, "row_count shape_count"),
    ]


class RenderSettingsData(Structure):
    _fields_ = [
        *_each(c_size_t, "pixel_offsets light_square light_disc dome_table mesh_table"),
        *_each(c_size_t, "medium_table lobe_points dome_cells dome_irradiance openings"),
        *_each(c_size_t, "opening_points scatter_offsets lens_points camera_frames"),
        *_each(c_size_t, "occlusion_points node_points subsurface_points bounce_points neighbours"),
        *_each(c_uint64, "light_point_count dome_count mesh_count medium_count lobe_count"),
        *_each(c_uint64, "lens_point_count camera_frame_count scatter_count occlusion_count"),
        *_each(c_uint64, "node_point_count opening_count opening_point_count subsurface_count"),
        *_each(c_uint64, "bounce_count passes"),
        *_each(c_double * 9, "dome_axes"),
        *_each(c_double, "error_threshold cutoff clamp_indirect lens_focus"),
        *_each(c_uint32, "samples visibility_samples light_samples volume_samples dome_samples"),
        *_each(c_uint32, "mesh_samples medium_samples medium_shadows lamp_shadows"),
        *_each(c_uint32, "occlusion_samples opening_samples interleaving bounces volume_bounces"),
        *_each(c_uint32, "bounce_levels dome_rows dome_columns dome_irradiance_rows"),
        *_each(c_uint32, "dome_irradiance_columns camera_block lobe_levels crypto_ids max_bounces"),
        *_each(c_uint32, "photons threads"),
        *_each(c_uint32 * 4, "region"),
        *_each(c_int32, "illumination waves acceleration remember reflections moving resolves"),
        *_each(c_int32, "reflective_caustics refractive_caustics"),
    ]


class ProgressData(Structure):
    _fields_ = [
        *_each(c_double, "fraction"),
        *_each(c_uint32, "samples"),
        *_each(c_int32, "state"),
    ]


class StatsData(Structure):
    _fields_ = [
        *_each(c_double, "build_seconds trace_seconds"),
        *_each(c_uint64, "triangles instances primitives tree_bytes tree_nodes dropped_primitives"),
        *_each(c_uint64, "dropped_instances dropped_lights camera_rays shadow_rays mirror_rays"),
        *_each(c_uint64, "refraction_rays transparent_rays gather_rays probe_rays media_points"),
        *_each(c_uint32, "features threads"),
    ]


class AccelData(Structure):
    _fields_ = [
        *_each(c_size_t, "geometries instances world_from_object"),
        *_each(c_uint64, "geometry_count instances_count row_count"),
    ]


class RaysData(Structure):
    _fields_ = [
        *_each(c_size_t, "origins directions t_min t_max"),
        *_each(c_uint64, "count"),
        *_each(c_uint32, "origin_stride direction_stride t_min_stride t_max_stride visibility"),
        *_each(c_uint32, "threads"),
    ]


class HitsData(Structure):
    _fields_ = [
        *_each(c_size_t, "t instance primitive u v"),
    ]


class AccelStatsData(Structure):
    _fields_ = [
        *_each(c_double * 3, "low high"),
        *_each(c_double, "build_seconds"),
        *_each(c_uint64, "instances primitives dropped bytes nodes"),
    ]


class TangentData(Structure):
    _fields_ = [
        *_each(c_size_t, "vertices triangles corners normals uv"),
        *_each(c_uint64, "count vertex_count corner_count"),
    ]
