// Points of a rectangle that are even over the solid angle it fills, from every point it is seen
// from (Ureña, Fajardo, King 2013, "An Area-Preserving Parametrization for Spherical Rectangles").
// Angles are kept as turns, so that hardly anything cancels, and one arc tangent, one sine and one
// cosine are enough. Letters: x, y coordinates in the rectangle's plane from the foot of the point
// that sees it, z distance from that plane, q distance from the axis of x; b the solid angle to the
// left of x beyond y0 and before y1, as the notes' right-angled corner at (x, y) has tan = x y / (z
// r).
#pragma once
#include "shading/stage_math.h"

namespace glint {
namespace {

/// The complex number c + i s; its angle is what counts.
struct Turn {
  Doubles c, s;
};
inline Turn operator*(const Turn& a, const Turn& b) {
  return {a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s};
}
inline Turn back(const Turn& a) { return {a.c, -a.s}; }

/// Its angle, from 0 to a full turn.
inline Doubles angle(const Turn& a) {
  static constexpr double c[] = {0.02275052699336167,  -0.04483334622272886, 0.05736332165907643,
                                 -0.06649613695291669, 0.0769105515839315,   -0.09090852557176049,
                                 0.11111109636534361,  -0.1428571426609662,  0.19999999999898407,
                                 -0.3333333333333325};
  constexpr double turn = 6.28318530717958647692;
  const Doubles x = magnitude(a.c), y = magnitude(a.s), low = smaller(x, y), high = larger(x, y);
  const Mask wide = low > 0.41421356237309503 *
                              high;  // above an eighth of a half turn: what is left to a quarter
  const Doubles t = choose(wide, low - high, low) / choose(wide, low + high, high), t2 = t * t;
  const Doubles eighth = t + t * (t2 * polynomial(c, t2)) + where(wide, splat(turn / 8));
  const Doubles quarter = choose(y > x, turn / 4 - eighth, eighth),
                half = choose(a.c < 0, turn / 2 - quarter, quarter);
  return choose(a.s < 0, turn - half, half);
}

/// The unit turn by an angle from 0 to a full turn: the series for an eighth of it, doubled three
/// times.
inline Turn turn_by(Doubles angle) {
  static constexpr double sine[] = {
      -1.0 / 1307674368000, 1.0 / 6227020800, -1.0 / 39916800, 1.0 / 362880,
      -1.0 / 5040,          1.0 / 120,        -1.0 / 6};
  static constexpr double versine[] = {
      -1.0 / 20922789888000, 1.0 / 87178291200, -1.0 / 479001600, 1.0 / 3628800,
      -1.0 / 40320,          1.0 / 720,         -1.0 / 24,        0.5};
  const Doubles a = 0.125 * angle, a2 = a * a;
  Doubles s = a + a * (a2 * polynomial(sine, a2)),
          v = a2 * polynomial(versine, a2);  // v: 1 - cosine, which keeps its last digits
  for (int k = 0; k < 3; ++k) {
    const Doubles double_s = 2 * (s * (1 - v));
    v = 2 * (s * s);
    s = double_s;
  }
  return {1 - v, s};
}

/// cos b - cos a for |b| <= a, from the sines too where the cosines are alike.
inline Doubles cosines_apart(const Turn& b, const Turn& a) {
  return choose(a.c > 0, (a.s - b.s) * (a.s + b.s) / (a.c + b.c), b.c - a.c);
}

inline Doubles within(Doubles x, Doubles low, Doubles high) {
  return smaller(larger(x, low), high);
}

/// A rectangle as a point sees it: x0 to x1, y0 to y1, at the distance z > 0.
struct Rectangle {
  Doubles x0, x1, y0, y1, z;

  Turn corner(Doubles x, Doubles y) const { return {z * root(x * x + y * y + z * z), x * y}; }
  /// The turn of b at x.
  Turn strip(Doubles x) const { return corner(x, y1) * back(corner(x, y0)); }

  Doubles solid_angle() const { return angle(strip(x1) * back(strip(x0))); }

  /// The x at which b is the angle of the unit turn given.
  Doubles x_at(const Turn& b) const {
    const Doubles z2 = z * z, q = root((y0 * y0 + z2) * (y1 * y1 + z2));
    const Turn height = {(z2 + y0 * y1) / q, z * (y1 - y0) / q},
               middle = {(y0 * y1 - z2) / q, z * (y0 + y1) / q};
    return within(z * b.s / root(cosines_apart(b, height) * cosines_apart(b, middle)), x0, x1);
  }

  /// The y below which the share v of the light from x comes.
  Doubles y_at(Doubles x, double v) const {
    const Doubles q2 = x * x + z * z, h0 = y0 / root(q2 + y0 * y0), h1 = y1 / root(q2 + y1 * y1),
                  h = h0 + v * (h1 - h0);
    return within(h * root(q2 / ((1 - h) * (1 + h))), y0, y1);
  }
};

/// A point of a rectangle, and the solid angle of all of it.
struct RectanglePoint {
  Doubles x, y, solid_angle;
};

/// The point at (u, v) of the unit square.
inline RectanglePoint rectangle_point(const Rectangle& r, double u, double v) {
  const Turn first = r.strip(r.x0);
  const Doubles z2 = r.z * r.z, size = (r.x0 * r.x0 + z2) *
                                       root((r.y0 * r.y0 + z2) * (r.y1 * r.y1 + z2));  // of `first`
  const Doubles solid_angle = angle(r.strip(r.x1) * back(first));
  const Doubles x = r.x_at(Turn{first.c / size, first.s / size} * turn_by(u * solid_angle));
  return {x, r.y_at(x, v), solid_angle};
}

}  // namespace
}  // namespace glint
