// Arithmetic whose rounding errors are known, for the elementary functions (functions.h).
#pragma once
#include "simd/lanes.h"

namespace glint {
namespace {

/// The sum with it is rounded to an integer, which its last bits then are.
constexpr double kShift = 0x1.8p52;
/// log 2; the high part has 32 bits: k * high is exact.
constexpr double kTwoHigh = 0x1.62e42fee00000p-1, kTwoLow = 0x1.a39ef35793c76p-33;
constexpr double kInfinite = __builtin_inf(), kNotANumber = __builtin_nan("");

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

/// 2^k for integers -1022 <= k <= 1023.
inline Doubles power_of_two(Doubles k) { return Doubles((Mask(k + kShift) + 1023) << 52); }

/// The unevaluated sum high + low, where low is at most half a unit of the last place of high.
struct Pair {
  Doubles high, low;
};

/// a + b without error.
inline Pair exact_sum(Doubles a, Doubles b) {
  const Doubles sum = a + b, of_b = sum - a;
  return {sum, (a - (sum - of_b)) + (b - of_b)};
}

/// a + b without error, where |a| >= |b| or a = 0.
inline Pair ordered_sum(Doubles a, Doubles b) {
  const Doubles sum = a + b;
  return {sum, b - (sum - a)};
}

/// `a` rounded to 26 bits; what it lacks of `a` has 26 bits, too.
inline Doubles high_half(Doubles a) {
  return Doubles((Mask(a) + (int64_t(1) << 26)) & -(int64_t(1) << 27));
}

/// a * b without error (Dekker), where a, b and a b lie between 1e-250 and 1e300 or are 0.
inline Pair exact_product(Doubles a, Doubles b) {
  const Doubles p = a * b, c = high_half(a), d = high_half(b), e = a - c, f = b - d;
  return {p, (((c * d - p) + c * f) + e * d) + e * f};
}

/// a / b, rounded once but for 2^-50 of a unit of the last place.
inline Doubles quotient(const Pair& a, const Pair& b) {
  const Doubles q = a.high / b.high;
  const Pair p = exact_product(q, b.high);
  return q + ((((a.high - p.high) - p.low) + a.low) - q * b.low) / b.high;
}

}  // namespace
}  // namespace glint
