// A ray on its way through the trees. Letters: o origin, d direction, t ray parameter.
#pragma once
#include "accel.h"
#include "kernel_simd.h"
#include "tree.h"

namespace glint {
namespace {

constexpr double kInf = __builtin_inf();

struct D3 {
  double x, y, z;
};
inline D3 operator-(D3 a, D3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline D3 operator+(D3 a, D3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline D3 operator*(double s, D3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(D3 a, D3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline D3 d3(const double* p) { return {p[0], p[1], p[2]}; }

/// The nearest so far. `key` is t without its last 12 bits: distances that agree to 2^-40 are the same distance, and then the lower
/// (instance, primitive) wins, in whichever order they are met. (Rounding differs between the same triangle written abc and bca.)
struct Query {
  double t_min, t_max;
  uint32_t visibility;
  const uint32_t* masks;  // visibility of every instance
  bool found = false;
  uint32_t instance = Hit::kNone, primitive = 0;
  double t = kInf, key = kInf;
  double u = 0, v = 0;
};

inline double key_of(double t) {
  uint64_t bits;
  __builtin_memcpy(&bits, &t, sizeof bits);
  bits &= ~uint64_t(0xfff);
  __builtin_memcpy(&t, &bits, sizeof bits);
  return t;
}

/// The ray in the space of a tree, t counted in units of `unit` (a power of two, so that the longest component of d is in [1, 2)).
/// The float ray starts at o + start d, close to the tree's ball: far away its rounding would be coarser than what it is to hit.
/// Arrays with two-dimensional names are in the order of `axes`: across, across, along the longest component.
struct LocalRay {
  D3 o, d;                      // exact
  double unit, per_unit, start;
  double inverse_square;        // 1 / d.d
  int axes[3];
  double axes_o[3], axes_d[3];  // exact, in the order of the axes
  double shear[2];              // d across / d along
  float of[3], sf[2];           // origin and shear of the float ray, in the order of the axes
  float near_o[4], far_o[4];    // origin rounded so that boxes come nearer and end farther
  float inv[4];
  uint32_t near_plane[3];       // index into Node::planes
  float t_min, t_max;           // bounds for boxes, with room for all rounding
  uint32_t instance;            // Hit::kNone in world space: the leaves know
};

/// Upper bound for boxes from the nearest hit or the ray's end.
inline void shorten(LocalRay& r, const Query& q) {
  const double t = (q.t < q.t_max ? q.t : q.t_max) * r.per_unit;
  const double rest = t - r.start + (t < 0 ? -t : t) * 0x1p-38;
  const float f = rest > 0 ? float(rest) : 0;
  r.t_max = f + f * 0x1p-20f + 1e-38f;
}

/// 2^k <= a < 2^(k+1) as 2^k; 0 when a is not a normal finite number.
inline double power_below(double a) {
  uint64_t bits;
  __builtin_memcpy(&bits, &a, sizeof bits);
  bits &= 0x7ff0000000000000u;
  if (bits == 0x7ff0000000000000u) bits = 0;
  __builtin_memcpy(&a, &bits, sizeof bits);
  return a;
}

inline double magnitude(double a) { return __builtin_fabs(a); }

/// Where the float ray begins: at t_min, or where the exact ray enters the tree's ball if it comes from farther than a few radii away.
inline double start_of(const LocalRay& r, const TreeView& tree, double t_min) {
  const D3 f = d3(tree.center) - r.o;
  if (dot(f, f) < 16 * tree.radius * tree.radius) return t_min;
  const double t = dot(f, r.d) * r.inverse_square - tree.radius * __builtin_sqrt(r.inverse_square);
  return t > t_min ? t : t_min;
}

inline void choose_axes(LocalRay& r, D3 start) {
  const double o[3] = {r.o.x, r.o.y, r.o.z}, d[3] = {r.d.x, r.d.y, r.d.z}, s[3] = {start.x, start.y, start.z};
  const int xy = magnitude(d[1]) > magnitude(d[0]), z = magnitude(d[2]) > magnitude(d[xy]) ? 2 : xy;
  r.axes[0] = z == 2 ? 0 : z + 1, r.axes[1] = z == 0 ? 2 : z - 1, r.axes[2] = z;
  for (int k = 0; k < 3; ++k) r.axes_o[k] = o[r.axes[k]], r.axes_d[k] = d[r.axes[k]], r.of[k] = float(s[r.axes[k]]);
  const double inverse = 1 / r.axes_d[2];
  for (int k = 0; k < 2; ++k) r.shear[k] = r.axes_d[k] * inverse, r.sf[k] = float(r.shear[k]);
}

inline void round_for_boxes(LocalRay& r, D3 start) {
  const Four o = {float(start.x), float(start.y), float(start.z), 0}, d = {float(r.d.x), float(r.d.y), float(r.d.z), 1};
  const Four inv = 1 / d, ulp = Four(FourInts(o) & 0x7fffffff) * 0x1p-23f + 1e-37f;
  const FourInts negative = FourInts(inv) >> 31;
  const Four outward = Four(FourInts(ulp) ^ (negative & int32_t(0x80000000)));
  store(r.inv, inv), store(r.near_o, o + outward), store(r.far_o, o - outward);
  for (uint32_t k = 0; k < 3; ++k) r.near_plane[k] = 2 * k + uint32_t(negative[k] & 1);
}

/// False when the ray cannot hit anything: no direction, not finite, or past its end before the tree begins.
inline bool enter(LocalRay& r, D3 o, D3 d, const TreeView& tree, const Query& q) {
  const double longest = __builtin_fmax(__builtin_fmax(magnitude(d.x), magnitude(d.y)), magnitude(d.z));
  const double power = power_below(longest);
  if (!(power > 0)) return false;
  r.unit = 1 / power, r.per_unit = power;
  r.o = o, r.d = r.unit * d;
  r.inverse_square = 1 / dot(r.d, r.d);
  const double t_min = q.t_min * power;
  r.start = start_of(r, tree, t_min);
  const double limit = (q.t < q.t_max ? q.t : q.t_max) * power;
  if (!(r.start <= limit + magnitude(limit) * 0x1p-38)) return false;
  const D3 start = r.o + r.start * r.d;
  choose_axes(r, start);
  round_for_boxes(r, start);
  r.t_min = 0;
  shorten(r, q);
  return r.of[0] - r.of[0] + (r.of[1] - r.of[1]) + (r.of[2] - r.of[2]) == 0;
}

/// Takes a hit at t (in the ray's units) unless there is a better one. True when the ray's bound changed.
template <bool Any>
inline bool accept(Query& q, LocalRay& r, double t_local, double u, double v, PrimitiveId id) {
  const double t = t_local * r.unit;
  if (!(t > q.t_min && t < q.t_max)) return false;
  if (r.instance != Hit::kNone) id.instance = r.instance;
  if (!(q.masks[id.instance] & q.visibility)) return false;
  q.found = true;
  if (Any) return true;
  const double key = key_of(t);
  const bool lower = id.instance != q.instance ? id.instance < q.instance : id.primitive < q.primitive;
  if (!(key < q.key || (key == q.key && lower))) return false;
  q.t = t, q.key = key, q.instance = id.instance, q.primitive = id.primitive, q.u = u, q.v = v;
  shorten(r, q);
  return true;
}

}  // namespace
}  // namespace glint
