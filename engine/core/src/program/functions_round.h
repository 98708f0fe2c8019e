// Rounding and remainders (functions.h).
#pragma once
#include "program/functions_exact.h"

namespace glint {
namespace {

/// All four exact, with the sign of x where they are 0, and NaN and infinities as they are.
inline Doubles floor(Doubles x) { return down(x); }
inline Doubles ceil(Doubles x) { return -down(-x); }
inline Doubles trunc(Doubles x) { return with_sign(down(magnitude(x)), x); }
/// Halves away from zero.
inline Doubles round(Doubles x) {
  const Doubles size = magnitude(x), low = down(size);
  return with_sign(low + choose(size - low >= 0.5, splat(1), splat(0)), x);
}

/// x modulo y for positive finite numbers of any sizes, by long division of integers.
__attribute__((noinline)) inline double remainder_far(double x, double y) {
  const auto integer = [](double a, int& exponent) {
    const uint64_t bits = __builtin_bit_cast(uint64_t, a), fraction = bits & 0x000fffffffffffff;
    exponent = int(bits >> 52);
    if (exponent == 0) {
      exponent = 1;
      return fraction;
    }
    return fraction | 0x0010000000000000;
  };
  int at_x = 0, at_y = 0;
  uint64_t rest = integer(x, at_x), divisor = integer(y, at_y);
  rest %= divisor;
  for (int more = at_x - at_y; more > 0; more -= 11)
    rest = (rest << (more < 11 ? more : 11)) % divisor;
  // rest times the unit of y, which may be too small for one factor.
  const int half = at_y / 2;
  const auto power = [](int k) { return __builtin_bit_cast(double, uint64_t(k + 1023) << 52); };
  return (double(int64_t(rest)) * power(half - 538)) * power(at_y - half - 537);
}

/// C's fmod: x less the multiple of y that leaves the sign of x and less than |y|, exact for all
/// numbers; slow, lane by lane, where the quotient is 2^53 or more or a number is not from 1e-200
/// to 1e200. NaN for y = 0 and for an infinite x.
inline Doubles fmod(Doubles x, Doubles y) {
  const Doubles a = magnitude(x), b = magnitude(y), n = down(a / b);
  // Where the quotient was rounded up to an integer the rest is negative.
  const Pair p = exact_product(n, b);
  Doubles rest = (a - p.high) - p.low;
  rest = choose(rest < 0, rest + b, rest);
  const Mask finite = a < kInfinite, small = (a < b) & finite;
  const Mask near = (a < 1e200) & (b > 1e-200) & (n < 0x1p53);
  if (const uint32_t far = bits((b > 0) & finite & ~small & ~near))
    for (size_t k = 0; k < kLanes; ++k)
      if (far >> k & 1) rest[k] = remainder_far(a[k], b[k]);
  rest = choose(small, a, rest);
  return choose(finite & (b > 0), with_sign(rest, x), splat(kNotANumber));
}

/// x - y floor(x / y), with the sign of y: exact where x and y have the same sign, else rounded
/// once. NaN for y = 0 and for an infinite x.
inline Doubles floor_mod(Doubles x, Doubles y) {
  const Doubles rest = fmod(x, y);
  return choose((rest != 0) & ((rest < 0) != (y < 0)), rest + y,
                with_sign(rest, choose(rest == 0, y, rest)));
}

}  // namespace
}  // namespace glint
