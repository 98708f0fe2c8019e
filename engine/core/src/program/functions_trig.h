// Circular functions and their inverses (functions.h).
#pragma once
#include "program/functions_angle.h"

namespace glint {
namespace {

/// What the sine of r + low has beside r, for |r| <= pi / 4.
inline Doubles sine_rest(const Pair& r) {
  static constexpr double c[] = {
      1.0 / 355687428096000, -1.0 / 1307674368000, 1.0 / 6227020800, -1.0 / 39916800,
      1.0 / 362880,          -1.0 / 5040,          1.0 / 120,        -1.0 / 6};
  const Doubles square = r.high * r.high;
  return (square * r.high) * polynomial(c, square) + r.low * (1 - 0.5 * square);
}
inline Doubles sine_near_zero(const Pair& r) { return r.high + sine_rest(r); }

/// The cosine of r + low for |r| <= pi / 4, as a number and what is to be added to it.
inline Pair cosine_parts(const Pair& r) {
  static constexpr double c[] = {
      -1.0 / 6402373705728000, 1.0 / 20922789888000, -1.0 / 87178291200, 1.0 / 479001600,
      -1.0 / 3628800,          1.0 / 40320,          -1.0 / 720,         1.0 / 24};
  const Doubles square = r.high * r.high, half = 0.5 * square, near = 1 - half;
  return {near, ((1 - near) - half) + (square * square * polynomial(c, square) - r.high * r.low)};
}
inline Doubles cosine_near_zero(const Pair& r) {
  const Pair c = cosine_parts(r);
  return c.high + c.low;
}

/// The sine of an angle `more` right angles further.
inline Doubles sine_of(const Turned& at, int64_t more) {
  const Mask turns = at.turns + more;
  const Doubles s = choose((turns & 1) != 0, cosine_near_zero(at.rest), sine_near_zero(at.rest));
  return Doubles(Mask(s) ^ ((turns & 2) << 62));
}

/// To 1 ulp for any finite x (radians); slow, lane by lane, from 2^20 on. NaN for infinities.
inline Doubles sin(Doubles x) { return choose(x == 0, x, sine_of(turned(x), 0)); }

/// To 1 ulp for any finite x (radians); slow, lane by lane, from 2^20 on. NaN for infinities.
inline Doubles cos(Doubles x) { return sine_of(turned(x), 1); }

/// To 1.1 ulp for any finite x (radians); slow, lane by lane, from 2^20 on. NaN for infinities.
inline Doubles tan(Doubles x) {
  const Turned at = turned(x);
  const Pair c = cosine_parts(at.rest), cosine = ordered_sum(c.high, c.low);
  const Pair sine = ordered_sum(at.rest.high, sine_rest(at.rest));
  const Mask odd = (at.turns & 1) != 0;
  const Pair above = {choose(odd, -cosine.high, sine.high), choose(odd, -cosine.low, sine.low)};
  const Pair below = {choose(odd, sine.high, cosine.high), choose(odd, sine.low, cosine.low)};
  return choose(x == 0, x, quotient(above, below));
}

/// asin(x) / x - 1 for x^2 <= 1/4: x^2 times a fit to 5e-18 at Chebyshev's nodes.
inline Doubles arc_sine_rest(Doubles square) {
  static constexpr double c[] = {0x1.d78189767524ep-6, -0x1.e7a24f548c99fp-7, 0x1.1d661531b222ep-6,
                                 0x1.653a8f8cfd43cp-8, 0x1.524ea8b3aad31p-7,  0x1.78246f32d075cp-7,
                                 0x1.c9cf3759fd8ffp-7, 0x1.1c4d343fa57f6p-6,  0x1.6e8bb1d89492bp-6,
                                 0x1.f1c71c1d4aa0dp-6, 0x1.6db6db6e3292ep-5,  0x1.3333333332ec4p-4,
                                 0x1.5555555555556p-3};
  return square * polynomial(c, square);
}

/// Where |x| > 1/2, asin(x) = pi / 2 - 2 asin(root) with root = sqrt((1 - x) / 2).
struct ArcSine {
  Mask inner;
  Doubles size, root, rest;  // rest: of the arc sine of x or of the root beside it
  explicit ArcSine(Doubles x) : inner(magnitude(x) <= 0.5), size(magnitude(x)) {
    const Doubles square = choose(inner, x * x, 0.5 * (1 - size));
    root = glint::root(square);
    const Pair back = exact_product(root, root);
    const Doubles root_low = where(root != 0, ((square - back.high) - back.low) / (2 * root));
    const Doubles series = arc_sine_rest(square);
    rest = choose(inner, size * series, root_low + root * series);
  }
};

/// To 1 ulp; NaN outside [-1, 1].
inline Doubles asin(Doubles x) {
  const ArcSine at(x);
  const Pair sum = ordered_sum(splat(kRightHigh), -2 * at.root);
  const Doubles outer = sum.high + (sum.low + (kRightLow - 2 * at.rest));
  return with_sign(choose(at.inner, at.size + at.rest, outer), x);
}

/// To 1 ulp; NaN outside [-1, 1].
inline Doubles acos(Doubles x) {
  const ArcSine at(x);
  const Doubles inner = kRightHigh - (x - (kRightLow - with_sign(at.rest, x)));
  const Doubles left = kRightHigh - (at.root + (at.rest - kRightLow));
  return choose(at.inner, inner, 2 * choose(x < 0, left, at.root + at.rest));
}

/// atan(x) for x >= 0, to 1 ulp: as atan(c) + atan((x - c) / (1 + c x)) for c = 0, 1/2, 1, 3/2 or
/// infinity, so that the quotient is at most 7/16 in size; its series beside x is a fit to 4e-18.
inline Doubles positive_arc_tangent(Doubles x) {
  static constexpr double c[] = {
      0x1.e3ddb8d3850abp-7, -0x1.0f54730d6c30ep-5, 0x1.6ffb4e901f5dbp-5, -0x1.ab582fd05ec97p-5,
      0x1.e1704532a7e28p-5, -0x1.110c9a0c8644ap-4, 0x1.3b1375a0eb258p-4, -0x1.745d154ac3da3p-4,
      0x1.c71c71bd21787p-4, -0x1.2492492485417p-3, 0x1.99999999998c4p-3, -0x1.5555555555555p-2};
  Doubles above = x, below = splat(1), high = splat(0), low = splat(0);
  const auto from = [&](double least, Doubles a, Doubles b, double angle, double angle_low) {
    const Mask here = x >= least;
    above = choose(here, a, above);
    below = choose(here, b, below);
    high = choose(here, splat(angle), high);
    low = choose(here, splat(angle_low), low);
  };
  from(0.4375, 2 * x - 1, 2 + x, 0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56);
  from(0.6875, x - 1, x + 1, 0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55);
  from(1.1875, x - 1.5, 1 + 1.5 * x, 0x1.f730bd281f69bp-1, 0x1.007887af0cbbdp-56);
  from(2.4375, splat(-1), x, kRightHigh, kRightLow);
  const Doubles q = above / below, square = q * q;
  return high + (q + (q * (square * polynomial(c, square)) + low));
}

/// To 1 ulp.
inline Doubles atan(Doubles x) { return with_sign(positive_arc_tangent(magnitude(x)), x); }

/// The angle of the vector (x, y), -pi to pi, to 2 ulp, with C's limits: of zeros and infinities,
/// too, where signs of zeros count.
inline Doubles atan2(Doubles y, Doubles x) {
  const Doubles rise = magnitude(y), run = magnitude(x);
  const Doubles slope = choose(rise == run, splat(1), rise / run);
  const Doubles angle = where(rise != 0, positive_arc_tangent(slope));
  const Doubles turned_back = 2 * kRightHigh - (angle - 2 * kRightLow);
  const Doubles size = choose(Mask(x) < 0, turned_back, angle);
  return choose((x != x) | (y != y), splat(kNotANumber), with_sign(size, y));
}

}  // namespace
}  // namespace glint
