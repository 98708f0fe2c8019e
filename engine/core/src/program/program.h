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
};

/// Of the rays that meet the points.
enum class RayKind { kCamera, kBounced, kShadow };

/// The points, a number a point, in anchored space. Those beyond the last repeat one before.
struct ProgramPoints {
  uint32_t instance[kBlock], primitive[kBlock];
  double weights[3][kBlock];  // barycentric, of meshes
  double x[3][kBlock], g[3][kBlock], n[3][kBlock],
      d[3][kBlock];            // g, n: turned to the viewer; d: of the ray, unit
  int64_t outside[kBlock];     // mask: the outer side is seen
  double length[kBlock] = {};  // of the ray, in the world, as what follows only where it is read
  int64_t tags[kBlock] = {};   // RayTag
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
  const GlintCamera* panorama;  // null for none
};

/// Constants as programs read them.
std::vector<double> spread_constants(const double* constants, size_t count);

}  // namespace glint
