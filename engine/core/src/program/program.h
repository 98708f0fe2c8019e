// Programs as the stages run them (engine/program/program.py has the format). Plain data.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "glint.h"

namespace glint {

/// Points that a program runs over at once: their slots stay in the second-level cache.
constexpr size_t kBlock = 64;

/// Settings that refer to something: an attribute's name as GlintAttribute has it (-1: the active
/// UV map), a texture's number, the place in `tables` of a table: how many numbers, and these.
struct ProgramShape {
  const int32_t* code;
  size_t words;
  const double* constants;  // kPad of each
  const double* tables;
  uint32_t slots;
  bool reads_ray;  // what ProgramPoints has of the ray
  bool asks_rays;  // of the scene
};

/// Of the rays that meet the points.
enum class RayKind {
  kCamera,
  kBounced,
  kShadow,
  kShadowBounced,    // to a light, in the direction of a rough lobe
  kShadowScattered,  // and of a matt one
};

/// The points, a number a point, in anchored space. Those beyond the last repeat one before.
struct ProgramPoints {
  uint32_t instance[kBlock], primitive[kBlock];
  double weights[3][kBlock];  // barycentric, of meshes
  double x[3][kBlock], g[3][kBlock], n[3][kBlock],
      d[3][kBlock];            // g, n: turned to the viewer; d: of the ray, unit
  int64_t outside[kBlock];     // mask: the outer side is seen
  double length[kBlock] = {};  // of the ray, in the world, as what follows only where it is read
  int64_t tags[kBlock] = {};   // RayTag
  double offset[kBlock];  // Surface::offset; only of programs that ask for rays, as what follows
  uint32_t row[kBlock];   // of the batch, for which the rays are counted
};

/// Rays from the points of a block that a program asks about, in anchored space; d is unit. None is
/// traced of a point whose t_max is not above 0.
struct AskedRays {
  double o[3][kBlock], d[3][kBlock], t_max[kBlock];
};

/// Of which instances rays meet surfaces: of those that shadow rays meet; of all that any rays do;
/// of the point's own, whatever it hides from.
enum class AskedOf { kShadows, kAny, kOwn };

/// Where rays meet surfaces, a row each, in the order of no point: numbers of the points, and as
/// surface.h has them.
struct AskedHits {
  size_t count;
  const uint32_t *point, *instance, *primitive;
  const double* weights[2];  // of the second and the third corner
  const double *x[3], *g[3], *n[3];
  const int64_t* outside;
};

/// The scene as programs ask for it; no surface lets such rays through.
struct RayQueries {
  void* self;
  /// blocked[k] = 1 where anything is on the way, else 0.
  void (*blocked)(void* self, const ProgramPoints& points, size_t count, const AskedRays& rays,
                  AskedOf of, uint8_t* blocked);
  /// The nearest hit of each ray.
  AskedHits (*nearest)(void* self, const ProgramPoints& points, size_t count, const AskedRays& rays,
                       AskedOf of);
  /// The nearest hits of each ray, as many as Layers has, on the point's own instance.
  AskedHits (*crossings)(void* self, const ProgramPoints& points, size_t count,
                         const AskedRays& rays);
  const double* table;  // NodePoint's numbers, rows that all points share
  uint64_t rows, sample;
  double reach;  // of occlusion, in the world
};

/// A row of the table: a point of the unit disc, even over it; a point of it as dense as (1 - r)^3,
/// r its distance from the middle; and an axis, 0 half of the time, else 1 or 2.
struct NodePoint {
  static constexpr size_t kColumns = 5;
  double even[2], dense[2];
  int axis;
};

/// What programs know beside the points. World = x / scale + origin.
struct ProgramView {
  double origin[3], scale;
  double axes[3][3], eye[3];  // of the camera: right, up, backward, as columns; world
  double window[4];
  double step;  // of shifted reads: a tenth of a pixel at the distance 1, or where rays are
                // parallel at any; world
  bool parallel;
  double clip_start;            // where rays of the camera start: a share of its axis backward
  double convergence;           // of an eye of a pair; infinite where rays are not turned
  const GlintCamera* panorama;  // null for none
};

/// Constants as programs read them.
std::vector<double> spread_constants(const double* constants, size_t count);

}  // namespace glint
