// The functions of math.h that highlights need, without branches.
#pragma once
#include "simd/lanes.h"

namespace glint {
namespace {

constexpr double kShift =
    0x1.8p52;  // the sum with it is rounded to an integer, which its last bits then are
constexpr double kTwoHigh = 0x1.62e42fee00000p-1,
                 kTwoLow =
                     0x1.a39ef35793c76p-33;  // log 2; the high part has 32 bits: k * high is exact

/// c[0] x^(N-1) + ... + c[N-1]. The even and the odd powers each by Horner's rule, side by side: a
/// processor waits for half as many steps.
template <int N>
inline Doubles polynomial(const double (&c)[N], Doubles x) {
  const Doubles square = x * x;
  Doubles last = splat(c[0]), other = splat(c[1]);  // last: the powers of c[0], c[2], ...
  for (int i = 2; i < N; i += 2) {
    last = last * square + c[i];
    if (i + 1 < N) other = other * square + c[i + 1];
  }
  return N % 2 ? last + other * x : last * x + other;
}

/// e^x for x <= 0; 0 below -708.
inline Doubles exponential(Doubles x) {
  static constexpr double c[] = {1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800,
                                 1.0 / 362880,     1.0 / 40320,     1.0 / 5040,     1.0 / 720,
                                 1.0 / 120,        1.0 / 24,        1.0 / 6,        0.5};
  const Doubles shifted = x * 1.44269504088896340736 + kShift, k = shifted - kShift;
  const Doubles r = (x - k * kTwoHigh) - k * kTwoLow;
  const Doubles power = Doubles((Mask(shifted) + 1023) << 52);
  return where(x >= -708, (1 + (r + r * r * polynomial(c, r))) * power);
}

/// A positive normal number as m 2^k, m in [1, 2).
struct Parts {
  Doubles m;
  Mask k;
  explicit Parts(Doubles x)
      : m(Doubles((Mask(x) & 0x000fffffffffffff) | 0x3ff0000000000000)), k(Mask(x) >> 52) {}
};

/// log(1 + a / b) for a >= 0 and b > 0 with full relative accuracy however small a / b is, as 2
/// artanh of difference over sum. Below 1e-300 b is that.
inline Doubles logarithm_of_one_and(Doubles a, Doubles b) {
  static constexpr double c[] = {2.0 / 23, 2.0 / 21, 2.0 / 19, 2.0 / 17, 2.0 / 15, 2.0 / 13,
                                 2.0 / 11, 2.0 / 9,  2.0 / 7,  2.0 / 5,  2.0 / 3};
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
  return k * kTwoHigh + (s * (2 + s2 * polynomial(c, s2)) + k * kTwoLow);
}

/// cos^p of the angle whose squared tangent is given, for a cosine > 0: exp(-p/2 log(1 + tan^2)),
/// accurate at any p >= 0.
inline Doubles cosine_power(Doubles tangent2, Doubles p) {
  return exponential(-0.5 * p * logarithm_of_one_and(tangent2, splat(1)));
}

/// The angle between two vectors, neither of which need be unit: log(1 + tan^2), and whether it is
/// below a right angle.
struct Slope {
  Doubles log;
  Mask sharp;
};
inline Slope slope(const Three& n, const Three& h) {
  const Doubles c = dot(n, h);
  const Three s = cross(n, h);
  return {logarithm_of_one_and(dot(s, s), c * c), c > 0};
}

/// max(0, cos)^p with 0^0 = 1 (Blinn-Phong, notes 4.13).
inline Doubles highlight(const Slope& at, Doubles p) {
  return choose(p == 0, splat(1), where(at.sharp, exponential(-0.5 * p * at.log)));
}

/// (1 - cosine)^p for a cosine of 0 to 1 and p > 0.
inline Doubles grazing_power(Doubles cosine, Doubles p) {
  return exponential(-p * logarithm_of_one_and(cosine, 1 - cosine));
}

/// n.v of the normal that a ray along d sees, 0 where it is turned away from the ray.
inline Doubles seen_cosine(const Three& n, const Three& d) {
  return smaller(larger(-dot(n, d), splat(0)), splat(1));
}

/// Unpolarised reflectance of a dielectric.
inline Doubles fresnel_reflectance(Doubles cosine, Doubles relative_ior) {
  const Doubles sine2 = (1 - cosine * cosine) / (relative_ior * relative_ior),
                beyond = root(1 - sine2);
  const Doubles s = (cosine - relative_ior * beyond) / (cosine + relative_ior * beyond);
  const Doubles p = (relative_ior * cosine - beyond) / (relative_ior * cosine + beyond);
  return choose(sine2 < 1, 0.5 * (s * s + p * p), splat(1));
}

/// What a highlight is times beside its power (SEMANTICS.md): cosines n.l, n.v and v.h, one light
/// and one direction of view a lane.
class Gloss {
 public:
  Gloss(Doubles nl, Doubles nv, Doubles vh) : nl_(nl), nv_(nv), vh_(vh) {}

  /// masking2: alpha squared, 0 for none. fresnel: as SpecularTerm has it.
  Doubles factor(Doubles masking2, Doubles fresnel) {
    if (bits(masking2 != masking2_)) {
      const Doubles rest = 1 - masking2, down = nl_ * root(masking2 + rest * nv_ * nv_) +
                                                nv_ * root(masking2 + rest * nl_ * nl_);
      masking2_ = masking2, masking_ = choose(masking2 > 0, 2 * nl_ / down, splat(1));
    }
    const uint32_t schlick = bits(fresnel < 0), dielectric = bits(fresnel > 0);
    Doubles result = masking_;
    if (schlick) result = result * choose(fresnel < 0, schlick_weight(), splat(1));
    if (dielectric)
      result = result * choose(fresnel > 0,
                               fresnel_reflectance(vh_, choose(fresnel > 0, fresnel, splat(1))),
                               splat(1));
    return result;
  }

 private:
  Doubles schlick_weight() const {
    const Doubles rest = 1 - vh_, square = rest * rest;
    return square * square * rest;
  }

  Doubles nl_, nv_, vh_, masking2_ = splat(0), masking_ = splat(1);
};

void cosine_powers(const double* tangent2, const double* p, double* out, size_t count) {
  for (size_t k = 0; k < count; ++k) {
    const Doubles power = cosine_power(splat(tangent2[k]), splat(p[k]));
    out[k] = power[0];
  }
}

}  // namespace
}  // namespace glint
