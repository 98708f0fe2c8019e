// Hyperbolic functions (functions.h).
#pragma once
#include "program/functions_exp.h"

namespace glint {
namespace {

/// sinh x for |x| <= 1.
inline Pair hyperbolic_sine_near_zero(Doubles x) {
  static constexpr double c[] = {1.0 / 121645100408832000,
                                 1.0 / 355687428096000,
                                 1.0 / 1307674368000,
                                 1.0 / 6227020800,
                                 1.0 / 39916800,
                                 1.0 / 362880,
                                 1.0 / 5040,
                                 1.0 / 120,
                                 1.0 / 6};
  const Doubles square = x * x;
  return ordered_sum(x, x * (square * polynomial(c, square)));
}

/// cosh x for |x| <= 1.
inline Pair hyperbolic_cosine_near_zero(Doubles x) {
  static constexpr double c[] = {
      1.0 / 6402373705728000, 1.0 / 20922789888000, 1.0 / 87178291200, 1.0 / 479001600,
      1.0 / 3628800,          1.0 / 40320,          1.0 / 720,         1.0 / 24};
  const Doubles square = x * x;
  const Pair near = ordered_sum(splat(1), 0.5 * square);
  return ordered_sum(near.high, near.low + square * square * polynomial(c, square));
}

/// e^|x| / 2, infinite only where cosh x is.
inline Doubles half_exponential(Doubles size) {
  return scaled_exponential(clamped(size, 1000), splat(0), -1);
}

/// To 2 ulp; infinite beyond the range of double.
inline Doubles sinh(Doubles x) {
  const Doubles size = magnitude(x), half = half_exponential(size);
  const Doubles near = hyperbolic_sine_near_zero(size).high;
  return with_sign(choose(size < 1, near, half - 0.25 / half), x);
}

/// To 2 ulp; infinite beyond the range of double.
inline Doubles cosh(Doubles x) {
  const Doubles half = half_exponential(magnitude(x));
  return half + 0.25 / half;
}

/// To 1.1 ulp.
inline Doubles tanh(Doubles x) {
  const Doubles size = magnitude(x), inner = smaller(size, splat(1));
  const Doubles near =
      quotient(hyperbolic_sine_near_zero(inner), hyperbolic_cosine_near_zero(inner));
  const Doubles half = half_exponential(2 * smaller(size, splat(30)));
  const Doubles far = 1 - 1 / (0.5 + half);
  return choose(x == x, with_sign(choose(size < 1, near, far), x), x);
}

}  // namespace
}  // namespace glint
