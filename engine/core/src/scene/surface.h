// From a hit to the point on its surface: place, normals and attributes in double precision
// (notes 4.7-4.9, 2.7).
#pragma once
#include "bvh/accel.h"
#include "math/vec.h"
#include "program/program.h"

namespace glint {

struct Scene;

/// A point of a surface in anchored space. g and n are unit and turned to the viewer.
struct Surface {
  uint32_t instance = 0, primitive = 0;
  bool outside = true;            // the viewer is outside: the unturned g faces it
  double weights[3] = {1, 0, 0};  // barycentric, of meshes; of the ends of strands
  Vec3d x, g, n;
  double offset =
      0;  // how far along g a new ray starts so that rounding cannot bring it back to this surface
};

/// Where o + t d, d unit, meets the sphere, strand or polygon that `hit` names, near hit.t.
Surface surface_at(const Scene& scene, Vec3d o, Vec3d d, const Hit& hit);

/// The active UV map, and 1; zeros where the geometry has none.
Vec3d uv_at(const Scene& scene, const Surface& s);

/// Point i of the block: what programs read where a ray from `start` along d with that RayTag meets
/// the surface, but for `row`.
void set_point(ProgramPoints& points, size_t i, const Scene& scene, const Surface& s, Vec3d start,
               Vec3d d, int64_t tag);

/// How far a surface of coordinates up to `magnitude` may lie from where the accelerator has it:
/// the accelerator rounds its vertices to float, half an ulp (2^-24) in each of three coordinates,
/// sqrt(3)/2 ulps in all, and finds t in double. Eight half ulps leave room.
inline double rounding(double magnitude) { return 8 * 0x1p-24 * magnitude; }

/// Past a surface at t: what the accelerator takes for the same distance (2^-40) is one surface.
inline double beyond(double t) { return t + 0x1p-39 * t; }

}  // namespace glint
