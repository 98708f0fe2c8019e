// The few transcendental functions that reach a pixel, from + - * / and sqrt only: the same bits on
// every machine. Errors, tested against mpmath: exp and log below 2 ulp, sine and cosine on [0, pi]
// below 2e-16 absolute.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace glint {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr double kLn2High = 0x1.62e42fee00000p-1,
                        kLn2Low =
                            0x1.a39ef35793c76p-33;  // the high part has 32 bits: k * high is exact

/// 2^k for -1022 <= k <= 1023.
inline double power_of_two(int k) { return std::bit_cast<double>(uint64_t(k + 1023) << 52); }

/// Horner's rule, the highest coefficient first.
template <int N>
double polynomial(const double (&c)[N], double x) {
  double sum = c[0];
  for (int i = 1; i < N; ++i) sum = sum * x + c[i];
  return sum;
}

/// e^x; 0 below -708, infinity above 709.78.
inline double exponential(double x) {
  if (!(x >= -708)) return x < -708 ? 0 : x;  // NaN stays
  if (x > 709.782712893384) return kInfinity;
  static constexpr double c[] = {1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800,
                                 1.0 / 362880,     1.0 / 40320,     1.0 / 5040,     1.0 / 720,
                                 1.0 / 120,        1.0 / 24,        1.0 / 6,        0.5};
  double k = std::floor(x * 1.44269504088896340736 + 0.5);
  double r = (x - k * kLn2High) - k * kLn2Low;
  double y = 1 + (r + r * r * polynomial(c, r));
  return y * power_of_two(int(k) - 1) * 2;
}

/// The natural logarithm; -infinity at 0, NaN below.
inline double logarithm(double x) {
  if (!(x > 0)) return x == 0 ? -kInfinity : std::numeric_limits<double>::quiet_NaN();
  if (x == kInfinity) return x;
  int k = 0;
  if (x < 0x1p-1022) {
    x *= 0x1p54;
    k = -54;
  }
  uint64_t bits = std::bit_cast<uint64_t>(x);
  k += int(bits >> 52) - 1023;
  double m = std::bit_cast<double>((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
  if (m > 1.41421356237309504880) {
    m *= 0.5;
    ++k;
  }
  static constexpr double c[] = {2.0 / 23, 2.0 / 21, 2.0 / 19, 2.0 / 17, 2.0 / 15, 2.0 / 13,
                                 2.0 / 11, 2.0 / 9,  2.0 / 7,  2.0 / 5,  2.0 / 3};
  double f = m - 1, s = f / (2 + f), s2 = s * s;
  double half =
      0.5 * f * f;  // log m = f - (f^2/2 - s (f^2/2 + s^2 c(s^2))): the big term f is exact
  return k * kLn2High + (f - (half - (s * (half + s2 * polynomial(c, s2)) + k * kLn2Low)));
}

/// sin x on [-pi/2, pi/2] by its series, nested: x - x (x^2/6 (1 - x^2/20 (1 - ...))); the first
/// term left out is below 1e-20.
inline double sine_series(double x) {
  double x2 = x * x, rest = 1;
  for (int k = 26; k >= 4; k -= 2) rest = 1 - x2 / (k * (k + 1)) * rest;
  return x - x * (x2 / 6 * rest);
}

inline double sine(double x) {
  return x > kPi / 2 ? sine_series((kPi - x) + 1.2246467991473532e-16) : sine_series(x);
}
inline double cosine(double x) { return sine_series((kPi / 2 - x) + 6.123233995736766e-17); }

/// cos^p of the angle whose squared tangent is given, for a cosine > 0, as highlights have it
/// (shading/stage_math.h).
double cosine_power(double tangent2, double p);

}  // namespace glint
