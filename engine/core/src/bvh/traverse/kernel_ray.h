// What a hit is: the rules that every traversal must come to. Letters: o origin, d direction, t ray
// parameter. Axes of a ray are numbered in its own order: two across, then the one along which its
// direction is longest; `depth` counts along that one, in the ray's sense.
#pragma once
#include "bvh/accel.h"
#include "bvh/bvh.h"
#include "bvh/traverse/error_bounds.h"
#include "simd/floats.h"

namespace glint {
namespace {

constexpr double kInf = __builtin_inf();
constexpr double kLast = 0x1.fffffffffffffp+1023;  // no hit is farther away, whatever t_max is

struct D3 {
  double x, y, z;
};
inline D3 operator-(D3 a, D3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline D3 operator+(D3 a, D3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline D3 operator*(double s, D3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(D3 a, D3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline D3 d3(const double* p) { return {p[0], p[1], p[2]}; }

/// t without its last 12 bits: distances that agree to 2^-40 are the same distance, and then the
/// lower (instance, primitive) wins, in whichever order they are met. (Rounding differs between the
/// same triangle written abc and bca.)
inline double key_of(double t) {
  uint64_t bits;
  __builtin_memcpy(&bits, &t, sizeof bits);
  bits &= ~uint64_t(0xfff);
  __builtin_memcpy(&t, &bits, sizeof bits);
  return t;
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

/// Edge functions of a triangle seen along the ray: twice the areas opposite to a, b, c.
struct Edges {
  double a, b, c;
  double sum() const { return a + b + c; }
  bool conflict() const { return (a < 0 || b < 0 || c < 0) && (a > 0 || b > 0 || c > 0); }
};

/// Whether a triangle is hit whose float edge functions are not all of one sign (Woop, Benthin,
/// Wald 2013, section 3.2). Sheared corners in double from float numbers: the products are then
/// exact, and so are the signs of the differences.
inline bool exactly_hit(const float (&x)[3], const float (&y)[3]) {
  const double ax = x[0], ay = y[0], bx = x[1], by = y[1], cx = x[2], cy = y[2];
  const Edges e{cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax};
  return !e.conflict() && magnitude(e.sum()) > 0;
}

/// A ray (V: double) or several against a triangle each, in double: depth of the hit as a multiple
/// of the direction's length along.
template <class V>
struct Exact {
  V x[3], y[3], z[3];  // corners seen along the ray, its origin at 0
  V u, v, depth;       // weights of the second and third corner
  V off_x, off_y;      // how far that point of the triangle is from the ray

  /// corner[j][k]: coordinate k of corner j.
  void see(const V (&corner)[3][3], const V (&o)[3], const V (&shear)[2]) {
    for (int j = 0; j < 3; ++j) {
      z[j] = corner[j][2] - o[2];
      x[j] = corner[j][0] - o[0] - shear[0] * z[j];
      y[j] = corner[j][1] - o[1] - shear[1] * z[j];
    }
  }
  /// The float test has decided that the ray hits: where the exact ray passes just outside, weights
  /// below 0 become 0.
  void weigh() {
    const V zero{};
    V a = x[2] * y[1] - y[2] * x[1], b = x[0] * y[2] - y[0] * x[2], c = x[1] * y[0] - y[1] * x[0];
    const V sum = a + b + c;
    a = larger(flip(a, sum), zero);
    b = larger(flip(b, sum), zero);
    c = larger(flip(c, sum), zero);
    const V inverse = 1 / (a + b + c);
    set(a * inverse, b * inverse, c * inverse);
  }
  /// The point with these weights. A corner far away gets a small one: taken from there, the depth
  /// would have the rounding of all its distance, and could even lie outside of the triangle's box,
  /// where packets and single rays would come to different answers.
  void set(V w, V wu, V wv) {
    u = wu;
    v = wv;
    off_x = w * x[0] + u * x[1] + v * x[2];
    off_y = w * y[0] + u * y[1] + v * y[2];
    const V front = smaller(z[0], smaller(z[1], z[2])), rear = larger(z[0], larger(z[1], z[2]));
    depth = smaller(larger(w * z[0] + u * z[1] + v * z[2], front), rear);
  }
};

/// Seen edge-on those weights mean little: then the point of the three edges that is nearest to the
/// ray.
inline void weigh_edges(Exact<double>& e) {
  double nearest = kInf;
  for (int j = 0; j < 3; ++j) {
    const int k = j == 2 ? 0 : j + 1;
    const double ex = e.x[k] - e.x[j], ey = e.y[k] - e.y[j], square = ex * ex + ey * ey,
                 along = -(e.x[j] * ex + e.y[j] * ey);
    const double s = !(along > 0) ? 0 : along >= square ? 1 : along / square;
    const double px = e.x[j] + s * ex, py = e.y[j] + s * ey, distance = px * px + py * py;
    if (!(distance < nearest)) continue;
    nearest = distance;
    const double weight[3] = {j == 0   ? 1 - s
                              : j == 2 ? s
                                       : 0,
                              j == 0   ? s
                              : j == 1 ? 1 - s
                                       : 0,
                              j == 1   ? s
                              : j == 2 ? 1 - s
                                       : 0};
    e.set(weight[0], weight[1], weight[2]);
  }
}

}  // namespace
}  // namespace glint
