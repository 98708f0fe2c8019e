// Rays against spheres, strands and polygons, in double precision.
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

/// Where a ray is inside of something convex.
struct Within {
  double from = kInf, to = -kInf;
  void add(double first, double last) {
    if (!(first <= last)) return;
    from = first < from ? first : from;
    to = last > to ? last : to;
  }
};

/// The sphere about the point from which the ray is at `o`.
inline void add_sphere(Within& in, const D3& o, const D3& d, double inverse_square, double radius) {
  const double b = -dot(o, d) * inverse_square;
  const D3 nearest = o + b * d;
  const double discriminant = (radius * radius - dot(nearest, nearest)) * inverse_square;
  if (!(discriminant >= 0)) return;
  const double root = __builtin_sqrt(discriminant);
  in.add(b - root, b + root);
}

/// What a t² + 2 b t + c <= 0 leaves of first <= t <= last; a and b are not both 0.
inline void add_quadratic(Within& in, double a, double b, double c, double first, double last) {
  const double discriminant = b * b - a * c;
  if (!(discriminant >= 0)) {
    if (a < 0) in.add(first, last);
    return;
  }
  const double root = __builtin_sqrt(discriminant), sum = -(b + (b < 0 ? -root : root)),
               x = sum / (a + 0.0), y = sum != 0 ? c / sum : 0, low = x < y ? x : y,
               high = x < y ? y : x;
  if (a >= 0) return in.add(low > first ? low : first, high < last ? high : last);
  in.add(first, low < last ? low : last);
  in.add(high > first ? high : first, last);
}

/// The part of the cone round both spheres between the circles where it touches them. `o`: from the
/// first centre, L: between them. Counts from the ray's point nearest to the axis, so that what is
/// far away keeps its digits.
inline void add_cone(Within& in, const D3& o, const D3& d, const D3& axis, double L, double ra,
                     double rb) {
  const double sine = (ra - rb) / L, square = 1 - sine * sine;
  if (!(square > 0)) return;
  const D3 u = (1 / L) * axis;
  const double rise = dot(d, u);
  const D3 e = d - rise * u;
  double height = dot(o, u), ee = dot(e, e), start = ee > 0 ? -dot(o - height * u, e) / ee : 0;
  const double at = height + start * rise;
  if (!(at >= 0 && at <= L)) start = rise != 0 ? ((at > 0 ? L : 0.0) - height) / rise : 0;
  if (!(magnitude(start) < kInf)) return;
  const D3 p = o + start * d;
  height = dot(p, u);
  const D3 q = p - height * u;
  const double w = ra - sine * height, a = square * ee - sine * sine * rise * rise,
               b = square * dot(q, e) + sine * rise * w, c = square * dot(q, q) - w * w;
  const double low = ra * sine - height, high = L + rb * sine - height;
  double first = -kInf, last = kInf;
  if (rise != 0) {
    first = (rise > 0 ? low : high) / rise;
    last = (rise > 0 ? high : low) / rise;
  } else if (!(low <= 0 && high >= 0)) return;
  if (a == 0 && b == 0) return;
  Within part;
  add_quadratic(part, a, b, c, first, last);
  in.add(part.from + start, part.to + start);
}

/// Whether the lines of a ray and of an axis are farther apart than `reach`, by more than rounding.
inline bool far_apart(const D3& o, const D3& d, const D3& axis, double reach) {
  const D3 n = {d.y * axis.z - d.z * axis.y, d.z * axis.x - d.x * axis.z,
                d.x * axis.y - d.y * axis.x};
  const double room = 1.000001 * reach +
                      1e-12 * (magnitude(axis.x) + magnitude(axis.y) + magnitude(axis.z)),
               between = dot(o, n);
  return between * between > room * room * dot(n, n);
}

/// Where the ray enters the convex hull of the spheres about two ends. Spheres and cone lie in it
/// and fill it, so that none of them has to be chosen. first: where it begins.
template <bool Any>
inline void hit_strand(Walk<Any>& w, int slot, const Scaled& ray, PrimitiveId id, size_t first) {
  const float *s = w.tree.strands.vertices + 3 * first, *r = w.tree.strands.radii + first;
  const D3 a{double(s[0]), double(s[1]), double(s[2])};
  const D3 axis = D3{double(s[3]), double(s[4]), double(s[5])} - a, f = ray.o - a;
  const double inverse_square = 1 / dot(ray.d, ray.d), begin = -dot(f, ray.d) * inverse_square,
               ra = r[0], rb = r[1];
  const D3 o = f + begin * ray.d;
  if (far_apart(o, ray.d, axis, ra > rb ? ra : rb)) return;
  const double L = __builtin_sqrt(dot(axis, axis));
  Within in;
  add_sphere(in, o, ray.d, inverse_square, ra);
  add_sphere(in, o - axis, ray.d, inverse_square, rb);
  if (L > 0) add_cone(in, o, ray.d, axis, L, ra, rb);
  if (!(in.from <= in.to)) return;
  // How far along, as surface.cpp has it in double.
  const double sine = L > 0 ? (ra - rb) / L : 1, square = 1 - sine * sine,
               at = square > 0 ? (dot(o + in.from * ray.d, axis) / L - ra * sine) / (square * L)
                               : double(ra < rb),
               along = at > 0 ? at < 1 ? at : 1 : 0;
  w.tile.answers->template accept<Any>(slot, (begin + in.from) * ray.unit, float(along), 0, id);
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

/// Spheres, strands or polygons against one ray.
template <bool Any>
__attribute__((noinline)) void hit_shapes(Walk<Any>& w, int r, ChildRef leaf) {
  if (!alive(w.tile, r)) return;
  const Scaled ray(w.tile, r);
  const int slot = w.tile.slot[r];
  const Opacity* const opacity = w.tile.answers->opacity;
  for (uint32_t k = leaf_first(leaf), last = k + uint32_t(leaf_count(leaf)); k < last; ++k) {
    if (!visible(w.tile, k)) continue;
    const PrimitiveId id = id_of(w.tile, r, k);
    if (opacity && (Any || opacity->alone) && opacity->of_instance[id.instance] == Opacity::kClear)
      continue;
    if (w.tree.kind == kSphereLeaf) hit_sphere(w, slot, ray, w.tree.floats + 4 * size_t(k), id);
    else if (w.tree.kind == kStrandLeaf) hit_strand(w, slot, ray, id, w.tree.ids[k].instance);
    else hit_polygon(w, slot, ray, w.tree.polygons[k], id);
  }
  w.update(r);
}

}  // namespace
}  // namespace glint
