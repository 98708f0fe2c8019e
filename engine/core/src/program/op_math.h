// Operations on numbers.
#pragma once
#include "program/machine.h"
#include "program/safe_functions.h"

namespace glint {
namespace {
namespace op {

/// engine/program/operations_math.py's MathOperation.
enum class Math : int32_t {
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kSine,
  kCosine,
  kTangent,
  kArcsine,
  kArccosine,
  kArctangent,
  kPower,
  kLogarithm,
  kMinimum,
  kMaximum,
  kRound,
  kLessThan,
  kGreaterThan,
  kModulo,
  kAbsolute,
  kArctan2,
  kFloor,
  kCeil,
  kFract,
  kSqrt,
  kInverseSqrt,
  kSign,
  kExponent,
  kRadians,
  kDegrees,
  kSinh,
  kCosh,
  kTanh,
  kTrunc,
  kSnap,
  kWrap,
  kCompare,
  kMultiplyAdd,
  kPingpong,
  kSmoothMin,
  kSmoothMax,
  kFlooredModulo
};

/// of(a), of(a, b) or of(a, b, c) at each point, of the first arguments.
template <class Of>
inline void each_number(const Machine& m, const Operands& at, Of of) {
  each_group(m, [&](size_t k) {
    const Doubles a = at.number(0, k);
    if constexpr (requires { of(a); }) at.put(0, k, of(a));
    else if constexpr (requires { of(a, a); }) at.put(0, k, of(a, at.number(1, k)));
    else at.put(0, k, of(a, at.number(1, k), at.number(2, k)));
  });
}

constexpr double kDegree = 0.017453292519943295769;

inline void unclamped_math(const Machine& m, const Operands& at) {
  typedef Doubles D;
  const auto of = [&](auto function) { each_number(m, at, function); };
  switch (Math(at.settings[0])) {
    case Math::kAdd: return of([](D a, D b) { return a + b; });
    case Math::kSubtract: return of([](D a, D b) { return a - b; });
    case Math::kMultiply: return of([](D a, D b) { return a * b; });
    case Math::kDivide: return of([](D a, D b) { return safe_divide(a, b); });
    case Math::kSine: return of([](D a) { return sin(a); });
    case Math::kCosine: return of([](D a) { return cos(a); });
    case Math::kTangent: return of([](D a) { return tan(a); });
    case Math::kArcsine: return of([](D a) { return asin(held_between(a, splat(-1), splat(1))); });
    case Math::kArccosine:
      return of([](D a) { return acos(held_between(a, splat(-1), splat(1))); });
    case Math::kArctangent: return of([](D a) { return atan(a); });
    case Math::kPower: return of([](D a, D b) { return safe_power(a, b); });
    case Math::kLogarithm: return of([](D a, D b) { return safe_logarithm(a, b); });
    case Math::kMinimum: return of([](D a, D b) { return least(a, b); });
    case Math::kMaximum: return of([](D a, D b) { return most(a, b); });
    case Math::kRound: return of([](D a) { return down(a + 0.5); });
    case Math::kLessThan: return of([](D a, D b) { return one_where(a < b); });
    case Math::kGreaterThan: return of([](D a, D b) { return one_where(a > b); });
    case Math::kModulo: return of([](D a, D b) { return safe_modulo(a, b); });
    case Math::kAbsolute: return of([](D a) { return magnitude(a); });
    case Math::kArctan2:
      return of([](D a, D b) { return where((a != 0) | (b != 0), atan2(a, b)); });
    case Math::kFloor: return of([](D a) { return down(a); });
    case Math::kCeil: return of([](D a) { return ceil(a); });
    case Math::kFract: return of([](D a) { return fraction(a); });
    case Math::kSqrt: return of([](D a) { return root(most(a, splat(0))); });
    case Math::kInverseSqrt: return of([](D a) { return where(a > 0, 1 / root(a)); });
    case Math::kSign: return of([](D a) { return sign(a); });
    case Math::kExponent: return of([](D a) { return exp(a); });
    case Math::kRadians: return of([](D a) { return a * kDegree; });
    case Math::kDegrees: return of([](D a) { return a * (1 / kDegree); });
    case Math::kSinh: return of([](D a) { return sinh(a); });
    case Math::kCosh: return of([](D a) { return cosh(a); });
    case Math::kTanh: return of([](D a) { return tanh(a); });
    case Math::kTrunc: return of([](D a) { return trunc(a); });
    case Math::kSnap: return of([](D a, D b) { return snapped(a, b); });
    case Math::kWrap: return of([](D a, D b, D c) { return wrapped(a, b, c); });
    case Math::kCompare: return of([](D a, D b, D c) { return one_where(alike(a, b, c)); });
    case Math::kMultiplyAdd: return of([](D a, D b, D c) { return a * b + c; });
    case Math::kPingpong: return of([](D a, D b) { return ping_pong(a, b); });
    case Math::kSmoothMin: return of([](D a, D b, D c) { return smooth_minimum(a, b, c); });
    case Math::kSmoothMax: return of([](D a, D b, D c) { return -smooth_minimum(-a, -b, c); });
    case Math::kFlooredModulo: return of([](D a, D b) { return floored_modulo(a, b); });
  }
}

inline void math(const Machine& m, const Operands& at) {
  unclamped_math(m, at);
  const bool clamps = at.settings[1] != 0;
  if (!clamps || !at.wants(0)) return;
  each_group(
      m, [&](size_t k) { at.put(0, k, held_between(load(at.output[0] + k), splat(0), splat(1))); });
}

inline void clamp(const Machine& m, const Operands& at) {
  const bool sorts = at.settings[0] == 1;
  each_group(m, [&](size_t k) {
    const Doubles low = at.number(1, k), high = at.number(2, k);
    const Doubles lower = sorts ? least(low, high) : low, upper = sorts ? most(low, high) : high;
    at.put(0, k, held_between(at.number(0, k), lower, upper));
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
