// Exponentials, logarithms and powers (functions.h).
#pragma once
#include "program/functions_exact.h"

namespace glint {
namespace {

/// e^r for |r| <= 0.35.
inline Doubles exponential_near_zero(Doubles r) {
  static constexpr double c[] = {1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800,
                                 1.0 / 362880,     1.0 / 40320,     1.0 / 5040,     1.0 / 720,
                                 1.0 / 120,        1.0 / 24,        1.0 / 6,        0.5};
  return 1 + (r + r * r * polynomial(c, r));
}

/// e^x for x <= 0; 0 below -708.
inline Doubles exponential(Doubles x) {
  const Doubles shifted = x * 1.44269504088896340736 + kShift, k = shifted - kShift;
  const Doubles r = (x - k * kTwoHigh) - k * kTwoLow;
  const Doubles power = Doubles((Mask(shifted) + 1023) << 52);
  return where(x >= -708, exponential_near_zero(r) * power);
}

/// Sides of a range: x, where it is NaN.
inline Doubles clamped(Doubles x, double limit) {
  return choose(x > limit, splat(limit), choose(x < -limit, splat(-limit), x));
}

/// y 2^k for integers |k| <= 2000, rounded once: in two steps, as 2^k alone may be no double.
inline Doubles scaled(Doubles y, Doubles k) {
  const Doubles half = (0.5 * k + kShift) - kShift;
  return (y * power_of_two(half)) * power_of_two(k - half);
}

/// e^(x + low) 2^extra for |x| <= 1000 and |low| <= 1e-10.
inline Doubles scaled_exponential(Doubles x, Doubles low, double extra) {
  const Doubles k = (x * 1.44269504088896340736 + kShift) - kShift;
  const Doubles r = (x - k * kTwoHigh) - (k * kTwoLow - low);
  return scaled(exponential_near_zero(r), k + extra);
}

/// e^x to 1.1 ulp. 0 and infinity beyond the range of double; NaN stays.
inline Doubles exp(Doubles x) { return scaled_exponential(clamped(x, 1000), splat(0), 0); }

/// 2^x to 1.1 ulp, exact for integers. 0 and infinity beyond the range of double; NaN stays.
inline Doubles exp2(Doubles x) {
  x = clamped(x, 1200);
  const Doubles k = (x + kShift) - kShift;
  return scaled(exponential_near_zero((x - k) * 0.693147180559945309417), k);
}

/// A positive normal number as m 2^k, m in [1, 2).
struct Parts {
  Doubles m;
  Mask k;
  explicit Parts(Doubles x)
      : m(Doubles((Mask(x) & 0x000fffffffffffff) | 0x3ff0000000000000)), k(Mask(x) >> 52) {}
};

/// 2 artanh(s) / s - 2 over s^2, for |s| <= 0.172.
inline Doubles artanh_series(Doubles s2) {
  static constexpr double c[] = {2.0 / 23, 2.0 / 21, 2.0 / 19, 2.0 / 17, 2.0 / 15, 2.0 / 13,
                                 2.0 / 11, 2.0 / 9,  2.0 / 7,  2.0 / 5,  2.0 / 3};
  return polynomial(c, s2);
}

/// log(1 + a / b) for a >= 0 and b > 0 with full relative accuracy however small a / b is, as 2
/// artanh of difference over sum. Below 1e-300 b is that.
__attribute__((always_inline)) inline Doubles logarithm_of_one_and(Doubles a, Doubles b) {
  constexpr double kRoot = 1.41421356237309504880;
  b = larger(b, splat(1e-300));
  const Doubles total = a + b;
  const Parts p(total), q(b);
  const Mask above = p.m > kRoot * q.m, below = q.m > kRoot * p.m;
  const Doubles m = choose(above, 0.5 * p.m, choose(below, 2 * p.m, p.m));
  const Mask near =
      total <= kRoot * b;  // there the difference of the two would have lost a's digits
  const Doubles k = where(~near, Doubles(p.k - q.k - above + below + 0x4338000000000000) - kShift);
  const Doubles s = choose(near, a, m - q.m) / choose(near, total + b, m + q.m), s2 = s * s;
  return k * kTwoHigh + (s * (2 + s2 * artanh_series(s2)) + k * kTwoLow);
}

/// A positive finite number as (1 + f) 2^k, 1 + f from the root of 1/2 to that of 2.
struct NearOne {
  Doubles f, k;
  explicit NearOne(Doubles x) {
    const Mask small = x < 0x1p-1022;
    const Words at = Words(choose(small, x * 0x1p54, x));
    const Words biased = (at + (0x3ff0000000000000 - 0x3fe6a09e667f3bcd)) >> 52;
    f = Doubles(at - ((biased - 1023) << 52)) - 1;
    k = Doubles(biased + 0x4330000000000000) -
        choose(small, splat(0x1p52 + 1023 + 54), splat(0x1p52 + 1023));
  }
};

/// `y`, but what any logarithm is of x where x is not positive and finite.
inline Doubles logarithm_or_limit(Doubles x, Doubles y) {
  const Doubles limit =
      choose(x == 0, splat(-kInfinite), choose(x > 0, splat(kInfinite), splat(kNotANumber)));
  return choose((x > 0) & (x < kInfinite), y, limit);
}

/// The natural logarithm to 1 ulp. -infinity at 0, NaN below. log(1 + f) is
/// f - (f^2/2 - s (f^2/2 + s^2 c(s^2))) with s = f / (2 + f): its large term f is exact.
inline Doubles log(Doubles x) {
  const NearOne at(x);
  const Doubles s = at.f / (2 + at.f), s2 = s * s, half = 0.5 * at.f * at.f;
  const Doubles rest = s * (half + s2 * artanh_series(s2)) + at.k * kTwoLow;
  return logarithm_or_limit(x, at.k * kTwoHigh + (at.f - (half - rest)));
}

/// log(x) scale for scale = scale_high + scale_low and log 2 scale = one_high + one_low, the high
/// parts of 26 and at most 40 bits.
inline Doubles scaled_logarithm(Doubles x, double scale_high, double scale_low, double one_high,
                                double one_low) {
  const NearOne at(x);
  const Doubles s = at.f / (2 + at.f), s2 = s * s, half = 0.5 * at.f * at.f;
  const Doubles high = high_half(at.f - half);
  const Doubles low = ((at.f - high) - half) + s * (half + s2 * artanh_series(s2));
  const Pair sum = ordered_sum(at.k * one_high, high * scale_high);
  const Doubles rest = at.k * one_low + ((low + high) * scale_low + low * scale_high);
  return logarithm_or_limit(x, sum.high + (sum.low + rest));
}

/// To 1 ulp. -infinity at 0, NaN below.
inline Doubles log2(Doubles x) {
  return scaled_logarithm(x, 0x1.7154760000000p+0, 0x1.4ae0bf85ddf44p-26, 1, 0);
}

/// To 1 ulp. -infinity at 0, NaN below.
inline Doubles log10(Doubles x) {
  return scaled_logarithm(x, 0x1.bcb7b10000000p-2, 0x1.49b9438ca9aaep-28, 0x1.34413509f6000p-2,
                          0x1.9fef311f12b36p-42);
}

/// log x to 2^-64 of itself, for positive finite x: 2 s + 2/3 s^3 as pairs, what follows in double.
inline Pair logarithm_pair(Doubles x) {
  static constexpr double c[] = {2.0 / 23, 2.0 / 21, 2.0 / 19, 2.0 / 17, 2.0 / 15,
                                 2.0 / 13, 2.0 / 11, 2.0 / 9,  2.0 / 7,  2.0 / 5};
  const NearOne at(x);
  // s = f / (2 + f): what the quotient lacks comes from its remainder.
  const Doubles sum = 2 + at.f, sum_low = at.f - (sum - 2), inverse = 1 / sum, s = at.f * inverse;
  const Pair back = exact_product(s, sum);
  const Doubles s_low = (((at.f - back.high) - back.low) - s * sum_low) * inverse;

  Pair square = exact_product(s, s);
  square.low = square.low + 2 * s * s_low;
  Pair cube = exact_product(square.high, s);
  cube.low = cube.low + (square.low * s + square.high * s_low);
  const Pair third = exact_product(cube.high, splat(2.0 / 3));
  const Doubles third_low = third.low + (cube.low * (2.0 / 3) + cube.high * 0x1.5555555555555p-55);
  const Doubles rest = cube.high * (square.high * polynomial(c, square.high));

  const Pair near = ordered_sum(2 * s, third.high);
  const Pair all = ordered_sum(at.k * kTwoHigh, near.high);
  return ordered_sum(all.high,
                     all.low + (near.low + (at.k * kTwoLow + (2 * s_low + (third_low + rest)))));
}

/// x^y for x > 0 finite.
inline Doubles positive_power(Doubles x, Doubles y) {
  const Pair log = logarithm_pair(x);
  const Pair p = exact_product(clamped(y, 0x1p70), log.high);
  const Doubles low = p.low + clamped(y, 0x1p70) * log.low;
  const Mask usual = magnitude(p.high) < 1000;
  return scaled_exponential(clamped(p.high, 1000), where(usual, low), 0);
}

/// x^y to 2 ulp with C's limits: 1 where y is 0 or x is 1, whatever the other is; a negative x
/// has powers to integers, the odd ones negative, and NaN to others.
inline Doubles pow(Doubles x, Doubles y) {
  const Doubles size = magnitude(x);
  const Mask whole_y = down(y) == y, odd = whole_y & (down(0.5 * y) != 0.5 * y);
  const Doubles limit = where((size == 0) == (y < 0), splat(kInfinite));
  Doubles power = choose((size == 0) | (size == kInfinite), limit, positive_power(size, y));
  power = Doubles(Mask(power) ^ (odd & Mask(x) & INT64_MIN));
  const Mask none = ((x < 0) & (size < kInfinite) & ~whole_y) | (x != x) | (y != y);
  return choose((x == 1) | (y == 0), splat(1), choose(none, splat(kNotANumber), power));
}

}  // namespace
}  // namespace glint
