// Rays against spheres and polygons, in double precision.
#pragma once
#include "bvh/traverse/kernel_walk.h"

namespace glint {
namespace {

/// A ray for spheres and polygons, in double; d scaled so that its longest component is in [1, 2).
struct Scaled {
  D3 o, d;
  double unit;
  Scaled(const Tile& tile, int r)
      : o{tile.xyz_o[0][r], tile.xyz_o[1][r], tile.xyz_o[2][r]}, d{}, unit(0) {
    const double power = power_below(magnitude(tile.along[r]));
    unit = 1 / power;
    d = unit * D3{tile.xyz_d[0][r], tile.xyz_d[1][r], tile.xyz_d[2][r]};
  }
};

/// Both roots in the form that keeps its digits far away (Haines et al. 2019, Precision
/// Improvements for Ray/Sphere Intersection).
template <bool Any>
inline void hit_sphere(Walk<Any>& w, int slot, const Scaled& ray, const float* s, PrimitiveId id) {
  const D3 f = ray.o - D3{double(s[0]), double(s[1]), double(s[2])};
  const double inverse_square = 1 / dot(ray.d, ray.d), radius = s[3], b = -dot(f, ray.d);
  const D3 nearest = f + (b * inverse_square) * ray.d;
  const double discriminant = radius * radius - dot(nearest, nearest);
  if (!(discriminant >= 0)) return;
  const double root = __builtin_sqrt(discriminant / inverse_square);
  const double far = b + (b < 0 ? -root : root), product = dot(f, f) - radius * radius;
  const double t1 = far * inverse_square, t0 = far != 0 ? product / far : t1;
  w.tile.answers->template accept<Any>(slot, t0 * ray.unit, 0, 0, id);
  w.tile.answers->template accept<Any>(slot, t1 * ray.unit, 0, 0, id);
}

/// Odd-even rule in the plane of projection: counts the edges that a line to the right of (x, y)
/// crosses.
inline bool odd(const PolygonRecord& record, const float* corners, double x, double y) {
  bool inside = false;
  const float* last = corners + 3 * (record.count - 1);
  double ax = double(last[record.axis_u]) - x, ay = double(last[record.axis_v]) - y;
  for (uint32_t k = 0; k < record.count; ++k) {
    const double bx = double(corners[3 * k + record.axis_u]) - x,
                 by = double(corners[3 * k + record.axis_v]) - y;
    if ((ay > 0) != (by > 0) && (ax * by - bx * ay > 0) == (by > ay)) inside = !inside;
    ax = bx;
    ay = by;
  }
  return inside;
}

template <bool Any>
inline void hit_polygon(Walk<Any>& w, int slot, const Scaled& ray, const PolygonRecord& record,
                        PrimitiveId id) {
  const double t = dot(d3(record.n), d3(record.p) - ray.o) / dot(d3(record.n), ray.d);
  if (!(magnitude(t) < kInf)) return;
  const D3 p = ray.o + t * ray.d;
  const double at[3] = {p.x, p.y, p.z};
  if (odd(record, w.tree.corners + 3 * record.first, at[record.axis_u], at[record.axis_v]))
    w.tile.answers->template accept<Any>(slot, t * ray.unit, 0, 0, id);
}

/// Spheres or polygons against one ray.
template <bool Any>
__attribute__((noinline)) void hit_shapes(Walk<Any>& w, int r, ChildRef leaf) {
  if (!alive(w.tile, r)) return;
  const Scaled ray(w.tile, r);
  const int slot = w.tile.slot[r];
  const Opacity* const opacity = w.tile.answers->opacity;
  for (uint32_t k = leaf_first(leaf), last = k + uint32_t(leaf_count(leaf)); k < last; ++k) {
    if (!visible(w.tile, k)) continue;
    const PrimitiveId id = id_of(w.tile, r, k);
    if (Any && opacity && opacity->of_instance[id.instance] == Opacity::kClear) continue;
    if (w.tree.kind == kSphereLeaf) hit_sphere(w, slot, ray, w.tree.floats + 4 * size_t(k), id);
    else hit_polygon(w, slot, ray, w.tree.polygons[k], id);
  }
  w.update(r);
}

}  // namespace
}  // namespace glint
