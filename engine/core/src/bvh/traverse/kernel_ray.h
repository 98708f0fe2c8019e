// What a hit is: the rule, in double, that every traversal must come to. Letters: o origin, d
// direction, t ray parameter. Axes of a ray are numbered in its own order: two across, then the one
// along which its direction is longest; `depth` counts along that one, in the ray's sense.
//
// A ray hits a triangle when no two of its edge functions have different signs, and not all are 0.
// They are those of corners seen along the ray, from its origin, in double: what rounding makes of
// a corner depends on nothing but the corner and the ray, and the signs are exact. So of the
// triangles round an edge or a corner that a ray meets, one at least is hit, on the side where it
// is.
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

/// What a product lost by rounding to p.
inline double lost(double a, double b, double p) {
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
  return __builtin_fma(a, b, -p);
#else
  // Dekker 1971: halves of 26 digits, whose products are exact.
  const double s = a * 0x1.0000002p27, t = b * 0x1.0000002p27;
  const double ah = s - (s - a), al = a - ah, bh = t - (t - b), bl = b - bh;
  return ((ah * bh - p) + ah * bl + al * bh) + al * bl;
#endif
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

/// A number with the sign of a b - c d, exactly. (Rounding keeps order: only where the products
/// round to one number, what they lost decides.)
inline double difference_of_products(double a, double b, double c, double d) {
  const double p = a * b, q = c * d;
  return p != q ? p - q : lost(a, b, p) - lost(c, d, q);
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
    V from[3][3];
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) from[j][k] = corner[j][k] - o[k];
    see(from, shear);
  }
  /// from[j][k]: the same, counted from the ray's origin.
  void see(const V (&from)[3][3], const V (&shear)[2]) {
    for (int j = 0; j < 3; ++j) {
      z[j] = from[j][2];
      x[j] = from[j][0] - shear[0] * z[j];
      y[j] = from[j][1] - shear[1] * z[j];
    }
  }
  /// Whether the ray hits.
  bool hit() const {
    const auto side = [this](int j, int k) {
      return difference_of_products(x[k], y[j], y[k], x[j]);
    };
    const double a = side(1, 2), b = side(2, 0), c = side(0, 1);
    const bool one_sign = (a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0);
    return one_sign && (a != 0 || b != 0 || c != 0);
  }
  /// Of a ray that hits.
  void weigh() {
    const V a = x[2] * y[1] - y[2] * x[1], b = x[0] * y[2] - y[0] * x[2],
            c = x[1] * y[0] - y[1] * x[0], inverse = 1 / (a + b + c);
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

/// Seen nearly edge-on those weights mean little: then the point of the three edges that is nearest
/// to the ray.
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
