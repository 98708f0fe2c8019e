/* Glint's core: one scene in, one picture out, as a flat C interface for 64-bit machines.
 *
 * Numbers: world quantities are double, geometry and textures are float32, uint32, uint16 and uint8
 * as named. A matrix target_from_source is double[12], row by row of a (3, 4) matrix.
 * docs/semantics says which picture a scene stands for.
 *
 * Ownership: the caller keeps every array that a GlintSceneData points at alive and unchanged until
 * glint_scene_destroy, and the arrays of GlintRenderSettings until glint_render_destroy. Only the
 * small tables (geometries, attributes, textures, programs, inputs, lobes, materials, groups,
 * lights) are copied. Destroy the renders of a scene before the scene. The arrays of the geometries
 * that a GlintAccelData points at stay until glint_accel_destroy; its other arrays are copied.
 *
 * Errors: functions that can fail take `error`, a buffer of `error_size` bytes that receives UTF-8
 * text, one problem a line. There is no global state; handles may be used from any thread, each
 * handle from one thread at a time, except glint_render_cancel: from any, and the queries of an
 * accelerator: from many at once.
 */
#ifndef GLINT_H
#define GLINT_H
#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32) && defined(GLINT_BUILDING)
#define GLINT_API __declspec(dllexport)
#elif defined(_WIN32)
#define GLINT_API __declspec(dllimport)
#else
#define GLINT_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define GLINT_ABI_VERSION 82

enum GlintGeometryKind { GLINT_MESH, GLINT_SPHERES, GLINT_POLYGONS, GLINT_STRANDS };
enum GlintDomain { GLINT_POINT, GLINT_CORNER, GLINT_FACE }; /* domains of attributes */

/* Values on a mesh: `rows` rows of `channels` floats. `name` is any number >= 0 that GlintInput
 * names. */
typedef struct GlintAttribute {
  const float* values;
  uint64_t rows;
  int32_t name, domain, channels, reserved;
} GlintAttribute;

/* Object space. Unused pointers are null.
 * MESH: vertices, triangles (3 a primitive), corners (3 a primitive, rows of CORNER attributes),
 * normals (values null: flat). SPHERES: vertices are the centres, radii; attributes are FACE, a row
 * each. POLYGONS: vertices, offsets (primitive_count + 1), indices. STRANDS: vertices and a radius
 * for each; indices, one a primitive: the vertex where the segment begins, which ends at the next
 * one; triangles where there are attributes: the two ends of each, the second twice. attributes:
 * rows [first_attribute, first_attribute + attribute_count) of the scene's table. */
typedef struct GlintGeometry {
  const float* vertices;
  const uint32_t* triangles;
  const uint32_t* corners;
  const float* radii;
  const uint32_t* offsets;
  const uint32_t* indices;
  const uint16_t* material_slots;
  uint64_t vertex_count, primitive_count, index_count;
  GlintAttribute normals;
  uint32_t first_attribute, attribute_count;
  int32_t kind, reserved;
} GlintGeometry;

enum GlintInstanceFlags {
  GLINT_VISIBLE_CAMERA = 1,
  GLINT_VISIBLE_MIRROR = 2,
  GLINT_VISIBLE_SHADOW = 4,
  GLINT_HOLDOUT = 8,
  GLINT_CATCHER = 16, /* of shadows: camera rays see what others change of its light, not it */
  GLINT_VISIBLE_TRANSMISSION = 32, /* to refracted rays */
  GLINT_VISIBLE_DIFFUSE = 64       /* to rays that look for bounced light, or light of a dome */
};

/* A geometry placed row_count times: rows [first_row, …) of world_from_object, material_count
 * numbers from first_material on. light_set: below 64, see
 * GlintLight. crypto_object, crypto_asset: what Cryptomatte passes tell of it, the bits of floats.
 * light_group: of what glows, 0, or 1 plus the number of one of the scene's. geometry_offset,
 * shading_offset: >= 0, the cosine below which light grazes its smooth surfaces, and from 0 to 1 by
 * how much of their angles its surfaces see light lower. */
typedef struct GlintInstances {
  uint64_t first_row, row_count;
  uint32_t geometry, flags, first_material, material_count;
  int32_t object_index;
  uint32_t light_set;
  uint32_t crypto_object, crypto_asset;
  int32_t light_group, reserved;
  double geometry_offset, shading_offset;
} GlintInstances;

enum GlintTextureType { GLINT_UINT8, GLINT_FLOAT32 };
enum GlintEncoding { GLINT_LINEAR_ENCODING, GLINT_SRGB };
enum GlintExtension { GLINT_REPEAT, GLINT_EXTEND, GLINT_CLIP, GLINT_MIRROR_EXTENSION };
enum GlintInterpolation { GLINT_LINEAR, GLINT_CLOSEST, GLINT_CUBIC };

/* pixels: (height, width, 4), row 0 at the bottom, straight alpha. SRGB only for UINT8. */
typedef struct GlintTexture {
  const void* pixels;
  uint32_t width, height;
  int32_t type, encoding, extension, interpolation;
} GlintTexture;

enum GlintChannel { GLINT_COLOR, GLINT_ALPHA, GLINT_LUMINANCE };

/* What varies over a surface, computed for every point (engine/program/program.py says how code,
 * constants and outputs are written). code: word_count numbers of the scene's program_words from
 * first_word on, constants and tables likewise. Settings of operations name attributes as
 * GlintInput does, textures by their place in the table, tables by where in these numbers they
 * begin: with their size. slots: numbers a point. */
typedef struct GlintProgram {
  uint64_t first_word, word_count, first_constant, constant_count, first_table, table_size;
  uint32_t slots, reserved;
} GlintProgram;

/* value * texture(uv) * attribute * output, where bounded plus offset and kept between low and
 * high, or one minus that. texture, uv, attribute: -1 for none (uv: for the active map). output: 0,
 * or 1 plus the first of three slots of the material's program. */
typedef struct GlintInput {
  double value[3];
  double uv_transform[6];
  double offset[3], low, high;
  int32_t texture, channel, uv, attribute, attribute_channel, bounded, complement, output;
} GlintInput;

enum GlintLobeKind {
  GLINT_AMBIENT,
  GLINT_DIFFUSE,
  GLINT_SPECULAR,
  GLINT_MIRROR,
  GLINT_REFRACTION,
  GLINT_TRANSPARENT,
  GLINT_EMISSION,
  GLINT_SHEEN,
  GLINT_TRANSLUCENT,
  GLINT_HOLDOUT_LOBE,
  GLINT_TOON_DIFFUSE,
  GLINT_TOON_SPECULAR,
  GLINT_OREN_NAYAR,
  GLINT_OREN_NAYAR_MULTIPLE,
  GLINT_FIBRE_DIFFUSE,
  GLINT_FIBRE_SPECULAR,
  GLINT_FIBRE_TRANSMISSION
};

/* Three numbers of a lobe, by its kind, as engine/closures/table.py lists them with their ranges:
 * its exponent, masking (Smith's alpha of a SPECULAR lobe, 0 for none) and index of refraction (of
 * a TRANSPARENT lobe how much denser it is inside, for light to lit points, 1 for not); width and
 * lean of SHEEN; size and smooth edge, shares of a right angle, of TOON; how far the light of FIBRE
 * fans out round the tangent, 0 for as far as normals do, and the tangent of half of how far it
 * leans against it; the number of the AOV of an EMISSION lobe that is for one. Their slots: 0, or 1
 * plus the slot of the material's program that takes the place of the number; those of the first
 * two are kept from 0 to the lobe's own, an ior that is not from 1e-30 to 1e30 is the lobe's own.
 * fresnel: bits GLINT_DIELECTRIC, GLINT_SCHLICK and GLINT_EDGE (of SPECULAR lobes alone), of
 * SPECULAR lobes that give nothing on the inner side GLINT_OUTSIDE, and of MIRROR lobes of a
 * dielectric whose index counts on both sides as outside GLINT_BOTH_SIDES. fibre_slot: of FIBRE
 * lobes, 0 or 1 plus the first of three slots with the fibre's tangent in world space, of any
 * length, 0 of what is no fibre. normal_slot: of SPECULAR, MIRROR and REFRACTION lobes, 0 or 1 plus
 * the first of three slots with a shading normal of their own in world space. stretch_slot: of
 * SPECULAR lobes, 0 or 1 plus the first of three slots with a direction across the normal in world
 * space, as long as what slopes along it are times; 0 for none. radius: of DIFFUSE lobes, how far
 * below the surface their light goes in red, green and blue, world units: the d of Christensen and
 * Burley's profile, at least 0, 0 for none; radius_slot: 0, or 1 plus the first of three slots that
 * take its place. distribution: GlintDistribution, of the half vectors of SPECULAR lobes, and of
 * REFRACTION lobes but for GLINT_ASHIKHMIN_SHIRLEY. With a width alpha it is the masking of a
 * SPECULAR lobe, whose exponent p is not read; of a REFRACTION lobe alpha^2 is 2 / (p + 2).
 */
enum GlintDistribution { GLINT_BLINN_PHONG, GLINT_GGX, GLINT_BECKMANN, GLINT_ASHIKHMIN_SHIRLEY };
enum GlintFresnel {
  GLINT_DIELECTRIC = 1,
  GLINT_SCHLICK = 2,
  GLINT_EDGE = 4,
  GLINT_OUTSIDE = 8,
  GLINT_BOTH_SIDES = 16
};
typedef struct GlintLobe {
  union {
    double exponent, width, size, aov;
  };
  union {
    double masking, lean, smooth, fan;
  };
  union {
    double ior, tilt;
  };
  double radius[3];
  uint32_t first_input, input_count;
  int32_t kind, fresnel;
  union {
    int32_t exponent_slot, width_slot, size_slot;
  };
  union {
    int32_t masking_slot, lean_slot, smooth_slot, fan_slot;
  };
  int32_t ior_slot, fibre_slot, normal_slot, stretch_slot, radius_slot, distribution;
} GlintLobe;

/* How light that a bent normal n faces is hidden by the normal m that it was bent from: not at all;
 * where it comes from behind m; and besides, by what m and n say of bumps, from matt lobes: Chiang,
 * Li, Burley 2019, or Conty Estevez, Lecocq, Stein 2019 (semantics/shadows.md). */
enum GlintBumpShadowing { GLINT_BUMP_NONE, GLINT_BUMP_SIDES, GLINT_BUMP_CHIANG, GLINT_BUMP_GGX };

/* program: 0, or 1 plus its number. normal: 0, or 1 plus the first of three slots of the program
 * with the shading normal in world space that takes the place of the mesh's. crypto: what
 * Cryptomatte passes tell of it, the bits of a float. aov: 0, or 1 plus the number of a material
 * that no instance has: its EMISSION lobes, whose exponents are numbers of AOVs, are what this one
 * gives to these. medium: 0, or 1 plus the number of what fills the inside of things that wear it.
 * bump_shadowing: of GlintBumpShadowing; base_normal: as normal, what that was bent from, 0 for the
 * mesh's. */
typedef struct GlintMaterial {
  uint32_t first_lobe, lobe_count;
  int32_t index, program, normal;
  uint32_t crypto;
  int32_t aov, medium, bump_shadowing, base_normal;
} GlintMaterial;

/* What light passes through: how much of it that goes straight on is taken away or sent elsewhere,
 * at least 0, and what radiance it gives, each a world unit. anisotropy: -1 to 1, of Henyey and
 * Greenstein. program: 0, or 1 plus the number of the program that says what varies from place to
 * place; it must not read attributes or triangles, and that of a world no placement either. The
 * slots: 0, or 1 plus the (first of three) that takes the place of the number. step: above 0, how
 * far apart rays ask the program, a share of the mean side of the box round a thing, in the world
 * world units. */
typedef struct GlintMedium {
  double absorption[3], scattering[3], emission[3], anisotropy, step;
  int32_t program, absorption_slot, scattering_slot, emission_slot, anisotropy_slot, reserved;
} GlintMedium;

enum GlintLightKind {
  GLINT_POINT_LIGHT,
  GLINT_SUN,
  GLINT_SPOT,
  GLINT_AREA,
  GLINT_DOME,
  GLINT_MESH_LIGHT,
  GLINT_MEDIUM_LIGHT
};
enum GlintLightFlags {
  GLINT_CAST_SHADOW = 1,
  GLINT_SEEN_BY_CAMERA = 2,
  GLINT_SEEN_BY_MIRROR = 4,
  GLINT_SOFT_FALLOFF = 8,
  GLINT_ELLIPSE = 16,
  GLINT_NOT_ON_MATT = 32,  /* DIFFUSE, SHEEN, TRANSLUCENT and FIBRE_DIFFUSE lobes get no light */
  GLINT_NOT_ON_GLOSS = 64, /* other lobes get none */
  GLINT_NOT_IN_MEDIA = 128,
  GLINT_SEEN_BY_TRANSMISSION = 256
};

/* Lengths in world units, angles in radians. A light with a number that is not finite is left out
 * and counted. program: 0, or 1 plus the number of the program that says, sample by sample, what
 * the colour is times; program_slot: the first of its three slots that hold that. It must not read
 * attributes or triangles. DOME, MESH and MEDIUM lights have none. A MESH light is the
 * scene's emitters from first_emitter on, emitter_count of them; its bounds, and those of a MEDIUM
 * light, are size_x, size_y and twice the radius. spread: of an AREA light, the full angle of what
 * it shines in; pi or more: all that is before it. MEDIUM lights have no highlights. excluded_sets:
 * a bit for each light_set of the instances that it does not light, passed_sets: of those that its
 * shadow rays pass. level: of a POINT lamp that far points see in clusters with others, where in
 * their tree it is parted from the one before it, 0 to 127 (engine/lights/lamps.py,
 * cluster_levels); -1 for all others. light_group: as of GlintInstances; of MESH and
 * MEDIUM lights their triangles and points have one each. */
typedef struct GlintLight {
  double world_from_light[12];
  double color[3];
  double strength, radius, angle, spot_size, spot_blend, size_x, size_y, spread;
  int32_t kind;
  uint32_t flags;
  int32_t program, program_slot;
  int32_t level, light_group;
  uint64_t excluded_sets, passed_sets;
  uint64_t first_emitter, emitter_count;
} GlintLight;

/* A triangle of a MESH light: what comes from its outer side and its inner one, its unit normal,
 * one over how densely, by area, points lie on it, and the length of its longest side. light_group:
 * as of GlintInstances. */
typedef struct GlintEmitter {
  double front[3], back[3], normal[3], spread, reach;
  int32_t light_group, reserved;
} GlintEmitter;

enum GlintCameraKind { GLINT_PERSPECTIVE, GLINT_ORTHOGRAPHIC, GLINT_PANORAMA };

enum GlintProjection {
  GLINT_EQUIRECTANGULAR,
  GLINT_FISHEYE_EQUIDISTANT,
  GLINT_FISHEYE_EQUISOLID,
  GLINT_FISHEYE_LENS_POLYNOMIAL,
  GLINT_MIRROR_BALL,
  GLINT_EQUIANGULAR_CUBEMAP_FACE,
  GLINT_CENTRAL_CYLINDRICAL
};

/* clip_planes: camera rays see where a x + b y + c z + d >= 0 for each of the first rows (a, b, c,
 * d); x, y along the camera's axes, z depth; none of a panorama, and of an eye of a pair. What
 * follows is a panorama's:
 * projection, of GlintProjection; longitude, latitude: first and last, radians; heights: of the
 * cylinder of radius 1; fov: radians; lens, sensor: width and height, one unit; polynomial: of the
 * angle over the distance on the sensor, from the constant up. Of all but orthographic ones:
 * eye_offset: of an eye to the right of the camera's place, across every direction, 0 for one that
 * does not stand aside; convergence: the distance at which eyes look at one point, infinite where
 * they look in parallel; pole_merge: elevations between which the offset fades away, used where
 * pole_merge[1] > 0; eye_up: unit, where a perspective's elevations count to, a panorama's do along
 * its own axis. */
typedef struct GlintCamera {
  double world_from_camera[12];
  double window[4]; /* l, r, b, t */
  double clip_start, clip_end;
  uint32_t width, height;
  int32_t kind, clip_plane_count;
  double clip_planes[6][4];
  double longitude[2], latitude[2], heights[2], fov, lens, sensor[2], polynomial[5];
  double eye_offset, convergence, pole_merge[2], eye_up[3];
  int32_t projection, reserved;
} GlintCamera;

/* How mist grows with the distance: its square, as it is, its square root. */
enum GlintMist { GLINT_MIST_QUADRATIC, GLINT_MIST_LINEAR, GLINT_MIST_INVERSE_QUADRATIC };

/* instance_values: what programs read of placements, 4 numbers a row of world_from_object, all rows
 * of one name after those of another; instance_value_names: these, as operations name attributes.
 * world_program: 0, or 1 plus the number of the program that gives what rays see that hit nothing,
 * instead of the background; world_slot: the first of its three slots that hold that. It must not
 * read surfaces. world_axes: the program's axes in the scene, column by column. Mist grows from
 * none at mist_start to all at mist_depth beyond it; mist_falloff: of GlintMist.
 * occlusion_distance: 0 to 1e30, how far the pass Ambient Occlusion looks. aov_count: up to 256
 * AOVs. world_medium: 0, or 1 plus the number of the medium that is everywhere. light_group_count:
 * up to 64 groups of lights. world_light_group: as of GlintInstances, of the surroundings. */
typedef struct GlintSceneData {
  GlintCamera camera;
  double ambient[3], background[3], world_axes[9], mist_start, mist_depth, occlusion_distance;
  int32_t transparent, world_program, world_slot, mist_falloff, aov_count, world_medium;
  int32_t light_group_count, world_light_group;
  const GlintGeometry* geometries;
  const GlintAttribute* attributes;
  const GlintInstances* instances;
  const double* world_from_object; /* 12 a row */
  const uint32_t* material_slots;  /* numbers of materials, shared by the instances */
  const int32_t* instance_value_names;
  const float* instance_values;
  const GlintTexture* textures;
  const int32_t* program_words;
  const double* program_constants;
  const double* program_tables;
  const GlintProgram* programs;
  const GlintInput* inputs;
  const GlintLobe* lobes;
  const GlintMaterial* materials;
  const GlintMedium* media;
  const GlintLight* lights;
  const GlintEmitter* emitters;
  const float* emitter_corners; /* 9 an emitter, in its light's axes */
  uint64_t geometry_count, attribute_count, instances_count, row_count, material_slot_count;
  uint64_t texture_count, program_word_count, program_constant_count, program_table_count;
  uint64_t program_count, input_count, lobe_count, material_count, light_count;
  uint64_t emitter_count, emitter_corner_count, instance_value_count, medium_count;
} GlintSceneData;

enum GlintIllumination { GLINT_PHYSICAL, GLINT_CLASSIC };
enum GlintBuild { GLINT_BUILD_FAST, GLINT_BUILD_BALANCED, GLINT_BUILD_FINE };
/* Which rough surfaces reflect others. */
enum GlintReflect { GLINT_REFLECT_OFF, GLINT_REFLECT_METALS, GLINT_REFLECT_ALL };
enum GlintWaves { GLINT_WAVES_UNSEEN, GLINT_WAVES_SEEN, GLINT_WAVES_HELD };

/* Passes, as numbers for glint_render_picture and as bits (1 << pass) for GlintRenderSettings. */
enum GlintPass {
  GLINT_PASS_COMBINED,
  GLINT_PASS_DIFFUSE,
  GLINT_PASS_SPECULAR,
  GLINT_PASS_AMBIENT,
  GLINT_PASS_SHADOW,
  GLINT_PASS_MIRROR,
  GLINT_PASS_EMISSION,
  GLINT_PASS_ENVIRONMENT,
  GLINT_PASS_DEPTH,
  GLINT_PASS_POSITION,
  GLINT_PASS_NORMAL,
  GLINT_PASS_UV,
  GLINT_PASS_OBJECT_INDEX,
  GLINT_PASS_MATERIAL_INDEX,
  GLINT_PASS_ERROR,
  GLINT_PASS_SAMPLES,
  GLINT_PASS_COST,
  GLINT_PASS_GRAZING,
  GLINT_PASS_GAP,
  GLINT_PASS_FALLBACKS,
  GLINT_PASS_MIST,
  GLINT_PASS_CRYPTO_OBJECT,
  GLINT_PASS_CRYPTO_MATERIAL,
  GLINT_PASS_CRYPTO_ASSET,
  GLINT_PASS_AOV, /* four channels for each AOV of the scene */
  GLINT_PASS_DENOISING_NORMAL,
  GLINT_PASS_DENOISING_ALBEDO,
  GLINT_PASS_DENOISING_DEPTH,
  GLINT_PASS_SHADOW_CATCHER,
  GLINT_PASS_DIFFUSE_DIRECT,
  GLINT_PASS_DIFFUSE_INDIRECT,
  GLINT_PASS_DIFFUSE_COLOR,
  GLINT_PASS_GLOSSY_DIRECT,
  GLINT_PASS_GLOSSY_INDIRECT,
  GLINT_PASS_GLOSSY_COLOR,
  GLINT_PASS_TRANSMISSION_DIRECT,
  GLINT_PASS_TRANSMISSION_INDIRECT,
  GLINT_PASS_TRANSMISSION_COLOR,
  GLINT_PASS_VOLUME_DIRECT,
  GLINT_PASS_VOLUME_INDIRECT,
  GLINT_PASS_VECTOR,
  GLINT_PASS_AMBIENT_OCCLUSION,
  GLINT_PASS_LIGHT_GROUPS, /* three channels for each light group of the scene */
  GLINT_PASS_COUNT
};

/* The same scene in another frame, for GLINT_PASS_VECTOR. camera: of the same kind.
 * world_from_object: as many rows as the scene has. shapes: one for each of its geometries;
 * vertices null where these stay, else those of a mesh, of spheres or of strands, as many as it
 * has. */
typedef struct GlintShape {
  const float* vertices;
  uint64_t vertex_count;
} GlintShape;

typedef struct GlintNeighbour {
  GlintCamera camera;
  const double* world_from_object; /* 12 a row */
  const GlintShape* shapes;
  uint64_t row_count, shape_count;
} GlintNeighbour;

/* region: x0, y0, x1, y1 half open in the full frame. threads: 0 for one a core. waves: whether
 * anybody looks before the end; if nobody does, more samples are traced at once, to the same bits.
 * HELD: see glint_render_resume. pixel_offsets: (visibility_samples, samples * visibility_samples,
 * 2), for each class of pixels (engine/sampling, offset_classes) the same ones; the first `samples`
 * are of the samples. Where light is resolved, nothing moves or catches shadows, no light follows
 * the camera rays of the rest, which tell how much of the pixel shows what; else visibility_samples
 * is 1. light_square, light_disc: (light_point_count, 2), at least samples * light_samples points
 * when light_samples > 1 and a light has an extent; else they may be null. dome_table: (dome_count,
 * 10), of as many samples as divide it, after which they begin again, of a GLINT_DOME: the
 * direction to it, what comes from there (dome_samples times its share), one over the density of
 * directions, a point of the unit disc, and 1 where shadow rays of surfaces meet what casts
 * shadows, 0 where what is visible to diffuse rays. dome_cells: (dome_rows, dome_columns, 4), what
 * comes from a direction of the light's axes (dome_axes, column by column) over the density and one
 * over that, equirectangular, from below upward. dome_irradiance: (dome_irradiance_rows,
 * dome_irradiance_columns, 3), over pi, of surfaces that nothing hides it from, by their normals in
 * the light's axes: corners of cells from pole to pole and once round. openings: (opening_count,
 * 13), rectangles through which that light is sampled too, or null: centre, half sides along x and
 * y, unit normal to the light's side, all in the world, and the share of the points;
 * opening_points: (opening_point_count, 3), of as many samples, opening_samples points each, as
 * divide it: the row of openings, and where on it from -1 to 1 along its half sides. mesh_table:
 * (mesh_count, 18), of as many samples, mesh_samples points each, as divide it, after which they
 * begin again, of each GLINT_MESH_LIGHT in turn: the point and its unit normal in the light's axes,
 * the numbers of GlintEmitter but the normal, a point of the unit disc, 0, and its light_group.
 * medium_table: the same of each GLINT_MEDIUM_LIGHT; front is what the medium gives a world unit,
 * spread one over the density of points by volume, reach the radius of the ball that each stands
 * for, normal and back are unused. Tables may be null where the scene has no such light.
 * lobe_points: (lobe_count, 2) of the unit disc, as many for each of lobe_levels reflections of a
 * path, where in the lobes of rough surfaces its rays are reflected, and those go to a GLINT_DOME
 * where samples are dealt; null only where neither is.
 * error_threshold: in 8-bit levels, at least 0 and below 256; pixels whose estimated error it
 * covers take no further samples after a wave. 0: all take all. cutoff: mirror and refraction rays
 * with no channel of their weight as large end there, 0 to 1. clamp_indirect: the most that a ray
 * adds to a sample but from the camera, the mean of the channels; 0: all. reflective_caustics:
 * whether gloss and mirrors throw light on to what is matt. refractive_caustics: whether what glass
 * bends lights that. photons: of lamps' light that mirrors and glass throw so, 0: it is not
 * followed. acceleration: of the first render of a scene counts, the trees are kept. remember: keep
 * what the first wave hit and which lights it saw, some 30 bytes a pixel, in the scene and those
 * that take its trees over, so that a render of other lights, materials or surroundings need not
 * trace it again. It has the same bits. lens_points: null for a pinhole, else (camera_block²,
 * samples, 2) points of the lens along the camera's u and v, of each pixel of a block of
 * camera_block² pixels of the frame, row by row; lens_focus: the depth where everything is sharp,
 * camera units. camera_frames: null for a camera that stands still, else (camera_block², samples,
 * 12) its world_from_camera of each sample. scatter_offsets: (scatter_count), a number of (0, 1)
 * for each sample; null only where no medium scatters: by how much the places on rays are shifted
 * from which media do, volume_samples at least for each light. moving: each sample is of a scene of
 * its own, see glint_render_move. crypto_ids: how many of a pixel Cryptomatte passes tell, 1 to 64
 * where one is asked for, two numbers each. lamp_shadows: where more than twice as many lamps cast
 * shadows and have no program, a point sends so many of its rays to them, times the samples of a
 * soft one; 0: one to each, up to 1024. medium_shadows: how many rays of a point and sample the
 * points of all GLINT_MEDIUM_LIGHTs share, 1 to medium_samples. neighbours: null where nothing
 * moves, else two, of the frame before and of the one after. occlusion_points: (occlusion_count, 2)
 * of the unit disc, below the directions of GLINT_PASS_AMBIENT_OCCLUSION, of as many samples,
 * occlusion_samples each, as divide it, after which they begin again; null only where nobody asks
 * for it. node_points: (node_point_count, 5), where programs that ask for rays look (program.h,
 * NodePoint), points of the unit disc and an axis, 0 to 2; null only where none does.
 * subsurface_points: (subsurface_count, 6), of as many samples, after which they begin again: the
 * shares of the light of a point that come out of the surface within the nearest and the farthest
 * radius that a sample stands for, and within its own, in this order: least, own, most; the cosine
 * and the sine of the angle round the point; which of the two axes across the normal the sample
 * looks along, 1 or 2. Null: all light comes out where it goes in. interleaving: side of the blocks
 * of pixels over which samples are dealt, a power of two up to 8, 1 for none: the tables of lights,
 * lobes and gather rays then hold the samples of all pixels of a block (engine/sampling,
 * dealt_sample). resolves: light with noise is averaged over the pixels of a block. bounces: how
 * often surfaces scatter light onto others, volume_bounces: 0, or 1 where that lights media, too;
 * bounce_points: (bounce_levels, bounce_count, 3), for each bounce of a path, the first ones again
 * after bounce_levels of them, and for each of as many samples, after which they begin again: a
 * point of the unit disc below the direction, and a number of [0, 1) below which the share of its
 * light must not lie that a later bounce is worth. Null only where bounces is 0. */
typedef struct GlintRenderSettings {
  const double* pixel_offsets;
  const double* light_square;
  const double* light_disc;
  const double* dome_table;
  const double* mesh_table;
  const double* medium_table;
  const double* lobe_points;
  const float* dome_cells;
  const float* dome_irradiance;
  const double* openings;
  const double* opening_points;
  const double* scatter_offsets;
  const double* lens_points;
  const double* camera_frames;
  const double* occlusion_points;
  const double* node_points;
  const double* subsurface_points;
  const double* bounce_points;
  const GlintNeighbour* neighbours;
  uint64_t light_point_count, dome_count, mesh_count, medium_count, lobe_count, lens_point_count,
      camera_frame_count, scatter_count, occlusion_count, node_point_count, opening_count,
      opening_point_count, subsurface_count, bounce_count, passes;
  double dome_axes[9];
  double error_threshold, cutoff, clamp_indirect, lens_focus;
  uint32_t samples, visibility_samples, light_samples, volume_samples, dome_samples, mesh_samples,
      medium_samples, medium_shadows, lamp_shadows, occlusion_samples, opening_samples,
      interleaving, bounces, volume_bounces, bounce_levels;
  uint32_t dome_rows, dome_columns;
  uint32_t dome_irradiance_rows, dome_irradiance_columns, camera_block, lobe_levels, crypto_ids;
  uint32_t max_bounces, photons, threads;
  uint32_t region[4];
  int32_t illumination, waves, acceleration, remember, reflections, moving, resolves,
      reflective_caustics, refractive_caustics;
} GlintRenderSettings;

enum GlintState {
  GLINT_PREPARING,
  GLINT_TRACING,
  GLINT_HELD,
  GLINT_MOVING,
  GLINT_DONE,
  GLINT_CANCELLED,
  GLINT_FAILED
};

/* fraction: share of the work on samples and on camera rays beyond them, as much as the last wave
 * told of these: less at its end than before where they are found to be more.  samples: those of
 * the last complete wave, which glint_render_picture gives. */
typedef struct GlintProgress {
  double fraction;
  uint32_t samples;
  int32_t state;
} GlintProgress;

enum GlintFeature {
  GLINT_FEATURE_MIRROR = 1,
  GLINT_FEATURE_REFRACTION = 2,
  GLINT_FEATURE_TRANSPARENT = 4,
  GLINT_FEATURE_SOFT_LIGHTS = 8,
  GLINT_FEATURE_TEXTURES = 16,
  GLINT_FEATURE_SMOOTH_NORMALS = 32,
  GLINT_FEATURE_HOLDOUT = 64,
  GLINT_FEATURE_VISIBLE_LIGHTS = 128,
  GLINT_FEATURE_NODE_PROGRAMS = 256,
  GLINT_FEATURE_WORLD_LIGHT = 512,
  GLINT_FEATURE_MESH_LIGHT = 1024,
  GLINT_FEATURE_DEPTH_OF_FIELD = 2048,
  GLINT_FEATURE_CAMERA_MOTION = 4096,
  GLINT_FEATURE_OBJECT_MOTION = 16384,
  GLINT_FEATURE_MEDIA = 32768,
  GLINT_FEATURE_SHADOW_CATCHER = 65536,
  GLINT_FEATURE_OPENINGS = 131072,
  GLINT_FEATURE_VARIED_MEDIA = 262144,
  GLINT_FEATURE_MEDIUM_LIGHT = 524288
};

typedef struct GlintStats {
  double build_seconds, trace_seconds;
  uint64_t triangles, instances, primitives, tree_bytes, tree_nodes;
  uint64_t dropped_primitives, dropped_instances, dropped_lights;
  uint64_t camera_rays, shadow_rays, mirror_rays, refraction_rays, transparent_rays, gather_rays,
      probe_rays, media_points;
  uint32_t features, threads;
} GlintStats;

typedef struct GlintScene GlintScene;
typedef struct GlintRender GlintRender;
typedef struct GlintPicture GlintPicture;

GLINT_API uint32_t glint_abi_version(void);

/* The instruction set whose kernels trace here, for example "avx2"; what the environment variable
 * GLINT_ISA forces, where it can. */
GLINT_API const char* glint_isa(void);

/* Checks everything; null and text in `error` when something is wrong or memory is short. */
GLINT_API GlintScene* glint_scene_create(const GlintSceneData* data, char* error,
                                         size_t error_size);

/* The scene of `data`, which may be any; what is expensive is taken over from `base` where the
 * arrays are the same, by address. The arrays of `base` must still be there. exact: what it draws
 * has the bits that it has after glint_scene_create. Else it may differ in the last bits, and less
 * is made anew: the trees stay where they are while the camera moves about the scene, and
 * geometries that moved or changed get trees of their own. The two may be destroyed in any order.
 */
GLINT_API GlintScene* glint_scene_create_like(const GlintScene* base, const GlintSceneData* data,
                                              int32_t exact, char* error, size_t error_size);
GLINT_API void glint_scene_destroy(GlintScene* scene);

/* Starts the work on threads of its own: trees first (kept in the scene for later renders), then
 * waves of 1, 2, 4, 8 … samples; where they are unseen, the first ones are one. */
GLINT_API GlintRender* glint_render_start(GlintScene* scene, const GlintRenderSettings* settings,
                                          char* error, size_t error_size);

/* Sleeps until a wave is complete that no earlier call reported, the render ends, or `milliseconds`
 * are over. */
GLINT_API GlintProgress glint_render_wait(GlintRender* render, uint32_t milliseconds);

/* With GLINT_WAVES_HELD the work pauses after each wave but the last (state HELD) until this call.
 */
GLINT_API void glint_render_resume(GlintRender* render);

/* With `moving` the work pauses before each sample but the first (state MOVING) until this call
 * gives the scene of the next sample: that of another time, with the same camera. Of the settings
 * only the tables may differ from those of the start; they and the scene are borrowed until the
 * next call of this, the ones before no longer. Returns 0, or -1 and text in `error`, and the work
 * still pauses. */
GLINT_API int32_t glint_render_move(GlintRender* render, GlintScene* scene,
                                    const GlintRenderSettings* settings, char* error,
                                    size_t error_size);

/* Returns at once; the state turns CANCELLED soon. */
GLINT_API void glint_render_cancel(GlintRender* render);

/* A pass of the last complete wave, `size` floats, rows from the bottom. It is not copied: the next
 * wave is drawn elsewhere, so that these stay as they are until glint_picture_free, beyond the
 * render's own life. The render may read them until it ends, and nothing may write them before.
 * Null when there is no complete wave, the pass was not asked for, the size does not fit, or memory
 * is short. */
GLINT_API GlintPicture* glint_render_picture(GlintRender* render, int32_t pass, uint64_t size);
GLINT_API float* glint_picture_values(GlintPicture* picture);
GLINT_API void glint_picture_free(GlintPicture* picture);

GLINT_API GlintStats glint_render_stats(GlintRender* render);

/* Why the state is FAILED. The text lives as long as the render. */
GLINT_API const char* glint_render_error(GlintRender* render);

/* Cancels, waits for the threads, and frees. */
GLINT_API void glint_render_destroy(GlintRender* render);

/* --- Rays without a picture
 * ------------------------------------------------------------------------------------------------
 */

/* What rays meet: geometries, of which corners, material_slots, normals and attributes are not
 * looked at, and where they stand, of which geometry, rows and the GLINT_VISIBLE flags count.
 * Placements are numbered from 0 in the order of `instances`, then by row. */
typedef struct GlintAccelData {
  const GlintGeometry* geometries;
  const GlintInstances* instances;
  const double* world_from_object; /* 12 a row */
  uint64_t geometry_count, instances_count, row_count;
} GlintAccelData;

/* `count` rays o + t d in world space; d need not have length 1, t counts in its lengths. Ray k
 * begins at origins[k * origin_stride]: strides count numbers, 3 or more for rows, 0 for one row
 * that serves all; those of t_min and t_max: 1 or more, or 0. A hit counts where t_min < t < t_max.
 * t_min below 0 counts as 0; null pointers stand for 0 and infinity. Misses by definition: a number
 * that is not finite (t_max may be infinite), a direction of length 0 or beyond 1e-150 ... 1e150.
 * visibility: GLINT_VISIBLE bits; placements that have none of them are not there.  threads: 0 for
 * one a core. */
typedef struct GlintRaysF32 {
  const float* origins;
  const float* directions;
  const float* t_min;
  const float* t_max;
  uint64_t count;
  uint32_t origin_stride, direction_stride, t_min_stride, t_max_stride;
  uint32_t visibility, threads;
} GlintRaysF32;

typedef struct GlintRaysF64 {
  const double* origins;
  const double* directions;
  const double* t_min;
  const double* t_max;
  uint64_t count;
  uint32_t origin_stride, direction_stride, t_min_stride, t_max_stride;
  uint32_t visibility, threads;
} GlintRaysF64;

/* Room for `count` of each. Misses: t infinite, placement and primitive -1, u and v 0. u, v: on
 * triangles the barycentric weights of the second and third vertex, on strands how far along the
 * segment (u), elsewhere 0. */
typedef struct GlintHitsF32 {
  float* t;
  int32_t* instance;
  int32_t* primitive;
  float* u;
  float* v;
} GlintHitsF32;

typedef struct GlintHitsF64 {
  double* t;
  int32_t* instance;
  int32_t* primitive;
  float* u;
  float* v;
} GlintHitsF64;

/* low, high: world-space box round all finite vertices and spheres; low above high when there are
 * none. dropped: primitives without extent or with a vertex that is not finite, which no ray meets.
 */
typedef struct GlintAccelStats {
  double low[3], high[3];
  double build_seconds;
  uint64_t instances, primitives, dropped, bytes, nodes;
} GlintAccelStats;

typedef struct GlintAccel GlintAccel;

/* Checks everything and builds the trees, as carefully as the GlintBuild `acceleration` says, on
 * `threads` threads (0: one a core); null and text in `error` when something is wrong, a matrix is
 * not finite, or memory is short. */
GLINT_API GlintAccel* glint_accel_create(const GlintAccelData* data, int32_t acceleration,
                                         uint32_t threads, char* error, size_t error_size);
GLINT_API void glint_accel_destroy(GlintAccel* accel);
GLINT_API GlintAccelStats glint_accel_stats(const GlintAccel* accel);

/* The first hit of every ray; of hits at one distance (to 2^-40) that of the lowest placement, then
 * primitive. The answers do not depend on the number of threads. Return 0, or -1 and text in
 * `error`. */
GLINT_API int32_t glint_accel_closest_f32(const GlintAccel* accel, const GlintRaysF32* rays,
                                          const GlintHitsF32* hits, char* error, size_t error_size);
GLINT_API int32_t glint_accel_closest_f64(const GlintAccel* accel, const GlintRaysF64* rays,
                                          const GlintHitsF64* hits, char* error, size_t error_size);

/* blocked[k] = 1 when ray k hits anything, else 0. Return 0, or -1 and text in `error`. */
GLINT_API int32_t glint_accel_occluded_f32(const GlintAccel* accel, const GlintRaysF32* rays,
                                           uint8_t* blocked, char* error, size_t error_size);
GLINT_API int32_t glint_accel_occluded_f64(const GlintAccel* accel, const GlintRaysF64* rays,
                                           uint8_t* blocked, char* error, size_t error_size);

/* The elementary functions of materials' programs, for tests: out[k] = f(x[k], y[k]) by its name in
 * C ("exp", "atan2", ...; "floor_mod"). Returns 0, or -1 where there is none of that name. */
GLINT_API int32_t glint_function(const char* name, const double* x, const double* y, double* out,
                                 uint64_t count);

enum GlintMathFunction { GLINT_EXP, GLINT_LOG, GLINT_COS, GLINT_SIN, GLINT_COSINE_POWER };

/* The core's own mathematics, for tests: out[k] = f(x[k]). COSINE_POWER: max(0, cos)^y from tan^2 =
 * x of the angle. */
GLINT_API void glint_math(int32_t function, const double* x, const double* y, double* out,
                          uint64_t count);

/* Words of a block of `glint_universal_hash`, and its sums. */
enum GlintHash { GLINT_HASH_BLOCK = 1024, GLINT_HASH_SUMS = 4 };

/* words: (count,). sums: (ceil(count / GLINT_HASH_BLOCK), GLINT_HASH_SUMS), the last block as if
 * zeros followed. Of two blocks that differ a sum is the same by a chance of 2^-32. */
GLINT_API void glint_universal_hash(const uint32_t* words, uint64_t count, uint64_t* sums);

/* A mesh of `count` triangles with a UV map. vertices: (vertex_count, 3). triangles, corners:
 * (count, 3), rows of vertices, and of uv and what is found. normals: (count, 3, 3) unit. uv:
 * (corner_count, 2). */
typedef struct GlintTangentData {
  const double* vertices;
  const uint32_t* triangles;
  const uint32_t* corners;
  const double* normals;
  const double* uv;
  uint64_t count, vertex_count, corner_count;
} GlintTangentData;

/* out: (corner_count, 4), the unit tangent of each corner and the sign of its bitangent. Returns 0,
 * -1 where memory is short, -2 where a row is not there. */
GLINT_API int32_t glint_tangents(const GlintTangentData* data, float* out);

/* Runs a program whose operations read no points, for tests. code, constants, tables: as those of
 * GlintProgram. columns: (slots, count), what the slots hold before and afterwards. Returns 0, or
 * -1 where memory is short. */
GLINT_API int32_t glint_program_run(const int32_t* code, uint64_t words, const double* constants,
                                    uint64_t constant_count, const double* tables, uint32_t slots,
                                    double* columns, uint64_t count);

#ifdef __cplusplus
}
#endif
#endif
