// The functions of math.h that highlights need, without branches.
#pragma once
#include "lanes.h"

namespace glint {
namespace {

constexpr double kShift = 0x1.8p52;  // the sum with it is rounded to an integer, which its last bits then are
constexpr double kTwoHigh = 0x1.62e42fee00000p-1, kTwoLow = 0x1.a39ef35793c76p-33;  // log 2; the high part has 32 bits: k * high is exact

/// Horner's rule, the highest coefficient first.
template <int N>
inline Doubles polynomial(const double (&c)[N], Doubles x) {
  Doubles sum = splat(c[0]);
  for (int i = 1; i < N; ++i) sum = sum * x + c[i];
  return sum;
}

/// e^x for x <= 0; 0 below -708.
inline Doubles exponential(Doubles x) {
  static constexpr double c[] = {1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800, 1.0 / 362880, 1.0 / 40320,
                                 1.0 / 5040,       1.0 / 720,       1.0 / 120,      1.0 / 24,      1.0 / 6,      0.5};
  const Doubles shifted = x * 1.44269504088896340736 + kShift, k = shifted - kShift;
  const Doubles r = (x - k * kTwoHigh) - k * kTwoLow;
  const Doubles power = Doubles((Mask(shifted) + 1023) << 52);
  return where(x >= -708, (1 + (r + r * r * polynomial(c, r))) * power);
}

/// The natural logarithm of a finite x >= 1.
inline Doubles logarithm(Doubles x) {
  static constexpr double c[] = {2.0 / 23, 2.0 / 21, 2.0 / 19, 2.0 / 17, 2.0 / 15, 2.0 / 13, 2.0 / 11, 2.0 / 9, 2.0 / 7, 2.0 / 5, 2.0 / 3};
  Doubles m = Doubles((Mask(x) & 0x000fffffffffffff) | 0x3ff0000000000000);
  const Mask big = m > 1.41421356237309504880;
  const Mask exponent = (Mask(x) >> 52) - 1023 - big;
  m = choose(big, 0.5 * m, m);
  const Doubles k = Doubles(exponent + 0x4338000000000000) - kShift;
  const Doubles f = m - 1, s = f / (2 + f), s2 = s * s, half = 0.5 * f * f;
  return k * kTwoHigh + (f - (half - (s * (half + s2 * polynomial(c, s2)) + k * kTwoLow)));
}

/// log(1 + y) for y >= 0 with full relative accuracy at small y; beyond 1e300 as there.
inline Doubles logarithm_1p(Doubles y) {
  y = smaller(y, splat(1e300));
  const Doubles u = 1 + y;
  return choose(u == 1, y, logarithm(u) + (y - (u - 1)) / u);
}

/// cos^p of the angle whose squared tangent is given, for a cosine > 0: exp(-p/2 log1p(tan^2)), accurate at any p >= 0.
inline Doubles cosine_power(Doubles tangent2, Doubles p) { return exponential(-0.5 * p * logarithm_1p(tangent2)); }

/// The angle between two vectors, neither of which need be unit: log(1 + tan^2), and whether it is below a right angle.
struct Slope {
  Doubles log;
  Mask sharp;
};
inline Slope slope(const Three& n, const Three& h) {
  const Doubles c = dot(n, h);
  const Three s = cross(n, h);
  return {logarithm_1p(where(c > 0, dot(s, s) / (c * c))), c > 0};
}

/// max(0, cos)^p with 0^0 = 1 (Blinn-Phong, notes 4.13).
inline Doubles highlight(const Slope& at, Doubles p) {
  return choose(p == 0, splat(1), where(at.sharp, exponential(-0.5 * p * at.log)));
}

void cosine_powers(const double* tangent2, const double* p, double* out, size_t count) {
  for (size_t k = 0; k < count; ++k) {
    const Doubles power = cosine_power(splat(tangent2[k]), splat(p[k]));
    out[k] = power[0];
  }
}

}  // namespace
}  // namespace glint
