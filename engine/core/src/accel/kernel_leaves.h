// Ray against triangles, spheres and polygons.
#pragma once
#include "kernel_ray.h"

namespace glint {
namespace {

/// Edge functions of a triangle seen along the ray: twice the areas opposite to a, b, c.
struct Edges {
  double a, b, c;
  double sum() const { return a + b + c; }
  bool conflict() const { return (a < 0 || b < 0 || c < 0) && (a > 0 || b > 0 || c > 0); }
};

/// Sheared corners in double from float numbers: the products below are then exact, and so are the signs of the differences.
inline Edges exact_edges(const float (&x)[3], const float (&y)[3]) {
  const double ax = x[0], ay = y[0], bx = x[1], by = y[1], cx = x[2], cy = y[2];
  return {cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax};
}

/// The triangles of one leaf: n floats for each coordinate.
struct Triangles {
  const float* p;
  int n;
  const float* at(int corner, int axis) const { return p + (3 * corner + axis) * n; }
};

struct Weights {
  double u, v, t;
};

/// Barycentric weights of the point nearest to the exact ray, all >= 0, and its t. The float test has decided that the ray hits; where the
/// exact ray passes just outside, the weights are those of the triangle's edge. `fallback`: the float test's edges, for a ray in the plane.
inline Weights refine(const LocalRay& r, const Triangles& leaf, int k, Edges fallback) {
  double corner[3][3], x[3], y[3];
  for (int j = 0; j < 3; ++j) {
    for (int axis = 0; axis < 3; ++axis) corner[j][axis] = double(leaf.at(j, r.axes[axis])[k]);
    const double z = corner[j][2] - r.axes_o[2];
    x[j] = corner[j][0] - r.axes_o[0] - r.shear[0] * z, y[j] = corner[j][1] - r.axes_o[1] - r.shear[1] * z;
  }
  Edges e{x[2] * y[1] - y[2] * x[1], x[0] * y[2] - y[0] * x[2], x[1] * y[0] - y[1] * x[0]};
  if (e.sum() == 0) e = fallback;
  const double sign = __builtin_copysign(1, e.sum()), a = sign * e.a, b = sign * e.b, c = sign * e.c;
  e = {a > 0 ? a : 0, b > 0 ? b : 0, c > 0 ? c : 0};
  const double inverse = 1 / e.sum(), u = e.b * inverse, v = e.c * inverse;
  double along = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double first = corner[0][axis];
    along += (first - r.axes_o[axis] + u * (corner[1][axis] - first) + v * (corner[2][axis] - first)) * r.axes_d[axis];
  }
  return {u, v, along * r.inverse_square};
}

/// Decides a triangle whose edge functions did not all have one sign other than 0 (Woop, Benthin, Wald 2013, section 3.2), and refines it.
template <bool Any>
inline bool triangle_hit(const Triangles& leaf, int k, Edges e, LocalRay& r, Query& q, PrimitiveId id) {
  const bool sure = (e.a > 0 && e.b > 0 && e.c > 0) || (e.a < 0 && e.b < 0 && e.c < 0);
  if (!sure) {
    float x[3], y[3];
    for (int j = 0; j < 3; ++j) {
      const float z = leaf.at(j, r.axes[2])[k] - r.of[2];
      x[j] = leaf.at(j, r.axes[0])[k] - r.of[0] - r.sf[0] * z, y[j] = leaf.at(j, r.axes[1])[k] - r.of[1] - r.sf[1] * z;
    }
    e = exact_edges(x, y);
    if (e.conflict() || !(e.sum() != 0)) return false;
  }
  const Weights w = refine(r, leaf, k, e);
  return accept<Any>(q, r, w.t, w.u, w.v, id);
}

/// Watertight (Woop, Benthin, Wald 2013), closed at edges and corners, both sides. True when the ray's bound changed.
template <bool Any>
inline bool hit_triangles(const TreeView& tree, uint32_t ordinal, int n, LocalRay& r, Query& q) {
  const Triangles leaf{tree.floats + 9 * size_t(ordinal), n};
  const Floats ox = splat(r.of[0]), oy = splat(r.of[1]), oz = splat(r.of[2]), sx = splat(r.sf[0]), sy = splat(r.sf[1]);
  bool changed = false;
  for (int first = 0; first < n; first += kLanes) {
    Floats x[3], y[3];
    for (int j = 0; j < 3; ++j) {
      const Floats z = load(leaf.at(j, r.axes[2]) + first) - oz;
      x[j] = load(leaf.at(j, r.axes[0]) + first) - ox - sx * z;
      y[j] = load(leaf.at(j, r.axes[1]) + first) - oy - sy * z;
    }
    const Floats ea = x[2] * y[1] - y[2] * x[1], eb = x[0] * y[2] - y[0] * x[2], ec = x[1] * y[0] - y[1] * x[0];
    const Floats zero{};
    const uint32_t both = bits(((ea < zero) | (eb < zero) | (ec < zero)) & ((ea > zero) | (eb > zero) | (ec > zero)));
    const int rest = n - first < kLanes ? n - first : kLanes;
    for (uint32_t mask = ~both & ((1u << rest) - 1); mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      const Edges e{double(ea[lane]), double(eb[lane]), double(ec[lane])};
      changed |= triangle_hit<Any>(leaf, first + lane, e, r, q, tree.ids[ordinal + uint32_t(first + lane)]);
      if (Any && q.found) return true;
    }
  }
  return changed;
}

/// Both roots in the form that keeps its digits far away (Haines et al. 2019, Precision Improvements for Ray/Sphere Intersection).
template <bool Any>
inline bool hit_spheres(const TreeView& tree, uint32_t ordinal, int n, LocalRay& r, Query& q) {
  bool changed = false;
  for (uint32_t k = ordinal; k < ordinal + uint32_t(n); ++k) {
    const float* s = tree.floats + 4 * size_t(k);
    const D3 f = r.o - D3{double(s[0]), double(s[1]), double(s[2])};
    const double radius = s[3], b = -dot(f, r.d);
    const D3 nearest = f + (b * r.inverse_square) * r.d;
    const double discriminant = radius * radius - dot(nearest, nearest);
    if (!(discriminant >= 0)) continue;
    const double root = __builtin_sqrt(discriminant / r.inverse_square);
    const double far = b + (b < 0 ? -root : root), product = dot(f, f) - radius * radius;
    const double t1 = far * r.inverse_square, t0 = far != 0 ? product / far : t1;
    changed |= accept<Any>(q, r, t0 < t1 ? t0 : t1, 0, 0, tree.ids[k]);
    changed |= accept<Any>(q, r, t0 < t1 ? t1 : t0, 0, 0, tree.ids[k]);
    if (Any && q.found) return true;
  }
  return changed;
}

/// Odd-even rule in the plane of projection: counts the edges that a line to the right of (x, y) crosses.
inline bool odd(const PolygonRecord& record, const float* corners, double x, double y) {
  bool inside = false;
  const float* last = corners + 3 * (record.count - 1);
  double ax = double(last[record.axis_u]) - x, ay = double(last[record.axis_v]) - y;
  for (uint32_t k = 0; k < record.count; ++k) {
    const double bx = double(corners[3 * k + record.axis_u]) - x, by = double(corners[3 * k + record.axis_v]) - y;
    if ((ay > 0) != (by > 0) && (ax * by - bx * ay > 0) == (by > ay)) inside = !inside;
    ax = bx, ay = by;
  }
  return inside;
}

template <bool Any>
inline bool hit_polygons(const TreeView& tree, uint32_t ordinal, int n, LocalRay& r, Query& q) {
  bool changed = false;
  for (uint32_t k = ordinal; k < ordinal + uint32_t(n); ++k) {
    const PolygonRecord& record = tree.polygons[k];
    const double t = dot(d3(record.n), d3(record.p) - r.o) / dot(d3(record.n), r.d);
    if (!(magnitude(t) < kInf)) continue;
    const D3 p = r.o + t * r.d;
    const double at[3] = {p.x, p.y, p.z};
    if (!odd(record, tree.corners + 3 * record.first, at[record.axis_u], at[record.axis_v])) continue;
    changed |= accept<Any>(q, r, t, 0, 0, tree.ids[k]);
    if (Any && q.found) return true;
  }
  return changed;
}

}  // namespace
}  // namespace glint
