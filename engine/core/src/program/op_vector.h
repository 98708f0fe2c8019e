// Operations on vectors.
#pragma once
#include "program/machine.h"
#include "program/safe_functions.h"

namespace glint {
namespace {
namespace op {

inline void combine_xyz(const Machine& m, const Operands& at) {
  each_group(
      m, [&](size_t k) { at.put(0, k, Three{at.number(0, k), at.number(1, k), at.number(2, k)}); });
}

inline void separate_xyz(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three v = at.vector(0, k);
    at.put(0, k, v.x);
    at.put(1, k, v.y);
    at.put(2, k, v.z);
  });
}

inline void vector_average(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three v = at.vector(0, k);
    at.put(0, k, (v.x + v.y + v.z) / 3);
  });
}

/// Scaled by the largest part, so that no square overflows or vanishes.
inline void vector_length(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three v = at.vector(0, k);
    const Doubles most = max_abs(v);
    const Doubles over = choose(most > 0, splat(1) / choose(most > 0, most, splat(1)), splat(1));
    const Three scaled{v.x * over, v.y * over, v.z * over};
    at.put(0, k, most * length(scaled));
  });
}

inline void vector_normalized(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, unit(at.vector(0, k))); });
}

inline void scaled_sum(const Machine& m, const Operands& at) {
  each_group(m,
             [&](size_t k) { at.put(0, k, at.number(1, k) * at.vector(0, k) + at.vector(2, k)); });
}

inline void product(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) { at.put(0, k, at.vector(0, k) * at.vector(1, k)); });
}

inline void bounded(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three v = at.vector(0, k), low = at.vector(1, k), high = at.vector(2, k);
    at.put(0, k,
           Three{held_between(v.x, low.x, high.x), held_between(v.y, low.y, high.y),
                 held_between(v.z, low.z, high.z)});
  });
}

/// engine/program/operations_vector.py's VectorOperation.
enum class VectorMath : int32_t {
  kAdd,
  kSubtract,
  kMultiply,
  kDivide,
  kMultiplyAdd,
  kCrossProduct,
  kProject,
  kReflect,
  kRefract,
  kFaceforward,
  kScale,
  kNormalize,
  kAbsolute,
  kPower,
  kSign,
  kMinimum,
  kMaximum,
  kRound,
  kFloor,
  kCeil,
  kFraction,
  kModulo,
  kWrap,
  kSnap,
  kSine,
  kCosine,
  kTangent
};

inline Three project(const Three& a, const Three& b) {
  return safe_divide(dot(a, b), dot(b, b)) * b;
}

inline Three reflect(const Three& a, const Three& b) {
  const Three n = unit(b);
  return a - 2 * dot(a, n) * n;
}

/// 0 where the direction is reflected totally.
inline Three refract(const Three& a, const Three& b, Doubles eta) {
  const Three n = unit(b);
  const Doubles along = dot(n, a), k = 1 - eta * eta * (1 - along * along);
  return where(~(k < 0), eta * a - (eta * along + root(most(k, splat(0)))) * n);
}

/// of(a), of(a, b) or of(a, b, c) on the numbers of each vector.
template <class Of>
inline void each_part(const Machine& m, const Operands& at, Of of) {
  each_group(m, [&](size_t k) {
    const Three a = at.vector(0, k), b = at.vector(1, k), c = at.vector(2, k);
    if constexpr (requires { of(a.x); }) at.put(0, k, Three{of(a.x), of(a.y), of(a.z)});
    else if constexpr (requires { of(a.x, b.x); })
      at.put(0, k, Three{of(a.x, b.x), of(a.y, b.y), of(a.z, b.z)});
    else at.put(0, k, Three{of(a.x, b.x, c.x), of(a.y, b.y, c.y), of(a.z, b.z, c.z)});
  });
}

inline void vector_math(const Machine& m, const Operands& at) {
  typedef Doubles D;
  typedef const Three& V;
  const auto parts = [&](auto of) { each_part(m, at, of); };
  const auto vectors = [&](auto of) {
    each_group(m, [&](size_t k) {
      at.put(0, k, of(at.vector(0, k), at.vector(1, k), at.vector(2, k), at.number(3, k)));
    });
  };
  switch (VectorMath(at.settings[0])) {
    case VectorMath::kAdd: return parts([](D a, D b) { return a + b; });
    case VectorMath::kSubtract: return parts([](D a, D b) { return a - b; });
    case VectorMath::kMultiply: return parts([](D a, D b) { return a * b; });
    case VectorMath::kDivide: return parts([](D a, D b) { return safe_divide(a, b); });
    case VectorMath::kMultiplyAdd: return parts([](D a, D b, D c) { return a * b + c; });
    case VectorMath::kCrossProduct: return vectors([](V a, V b, V, D) { return cross(a, b); });
    case VectorMath::kProject: return vectors([](V a, V b, V, D) { return project(a, b); });
    case VectorMath::kReflect: return vectors([](V a, V b, V, D) { return reflect(a, b); });
    case VectorMath::kRefract: return vectors([](V a, V b, V, D s) { return refract(a, b, s); });
    case VectorMath::kFaceforward:
      return vectors([](V a, V b, V c, D) { return choose(dot(c, b) < 0, a, -a); });
    case VectorMath::kScale: return vectors([](V a, V, V, D s) { return s * a; });
    case VectorMath::kNormalize: return vectors([](V a, V, V, D) { return unit(a); });
    case VectorMath::kAbsolute: return parts([](D a) { return magnitude(a); });
    case VectorMath::kPower: return parts([](D a, D b) { return safe_power(a, b); });
    case VectorMath::kSign: return parts([](D a) { return sign(a); });
    case VectorMath::kMinimum: return parts([](D a, D b) { return least(a, b); });
    case VectorMath::kMaximum: return parts([](D a, D b) { return most(a, b); });
    case VectorMath::kRound: return parts([](D a) { return down(a + 0.5); });
    case VectorMath::kFloor: return parts([](D a) { return down(a); });
    case VectorMath::kCeil: return parts([](D a) { return ceil(a); });
    case VectorMath::kFraction: return parts([](D a) { return fraction(a); });
    case VectorMath::kModulo: return parts([](D a, D b) { return safe_modulo(a, b); });
    case VectorMath::kWrap: return parts([](D a, D b, D c) { return wrapped(a, b, c); });
    case VectorMath::kSnap: return parts([](D a, D b) { return snapped(a, b); });
    case VectorMath::kSine: return parts([](D a) { return sin(a); });
    case VectorMath::kCosine: return parts([](D a) { return cos(a); });
    case VectorMath::kTangent: return parts([](D a) { return tan(a); });
  }
}

/// Settings: 0 a · b, 1 |a - b|, 2 |a|.
inline void vector_measure(const Machine& m, const Operands& at) {
  const auto of = [&](auto measure) {
    each_group(m, [&](size_t k) { at.put(0, k, measure(at.vector(0, k), at.vector(1, k))); });
  };
  if (at.settings[0] == 0) return of([](const Three& a, const Three& b) { return dot(a, b); });
  if (at.settings[0] == 1) return of([](const Three& a, const Three& b) { return length(a - b); });
  of([](const Three& a, const Three&) { return length(a); });
}

/// A rotation about X, then Y, then Z, from the sines and cosines of the angles.
struct EulerRotation {
  Three x, y, z;  // rows
  EulerRotation(const Three& s, const Three& c)
      : x{c.y * c.z, s.y * s.x * c.z - c.x * s.z, s.y * c.x * c.z + s.x * s.z},
        y{c.y * s.z, s.y * s.x * s.z + c.x * c.z, s.y * c.x * s.z - s.x * c.z},
        z{-s.y, c.y * s.x, c.y * c.x} {}
  Three turned(const Three& v) const { return {dot(x, v), dot(y, v), dot(z, v)}; }
  Three turned_back(const Three& v) const {
    return {x.x * v.x + y.x * v.y + z.x * v.z, x.y * v.x + y.y * v.y + z.y * v.z,
            x.z * v.x + y.z * v.y + z.z * v.z};
  }
};

inline Three parts_divided(const Three& a, const Three& b) {
  return {safe_divide(a.x, b.x), safe_divide(a.y, b.y), safe_divide(a.z, b.z)};
}

/// engine/program/operations_vector.py's MappingType.
enum class Mapping : int32_t { kPoint, kTexture, kVector, kNormal };

inline void mapping(const Machine& m, const Operands& at) {
  const auto each = [&](auto of) {
    each_group(m, [&](size_t k) {
      const EulerRotation rotation(at.vector(2, k), at.vector(3, k));
      at.put(0, k, of(at.vector(0, k), at.vector(1, k), rotation, at.vector(4, k)));
    });
  };
  typedef const Three& V;
  typedef const EulerRotation& R;
  switch (Mapping(at.settings[0])) {
    case Mapping::kPoint:
      return each([](V v, V location, R r, V scale) { return r.turned(v * scale) + location; });
    case Mapping::kTexture:
      return each([](V v, V location, R r, V scale) {
        return parts_divided(r.turned_back(v - location), scale);
      });
    case Mapping::kVector: return each([](V v, V, R r, V scale) { return r.turned(v * scale); });
    case Mapping::kNormal:
      return each([](V v, V, R r, V scale) { return unit(r.turned(parts_divided(v, scale))); });
  }
}

inline void rotate_euler(const Machine& m, const Operands& at) {
  const bool inverts = at.settings[0] != 0;
  each_group(m, [&](size_t k) {
    const Three center = at.vector(1, k), arm = at.vector(0, k) - center;
    const EulerRotation rotation(at.vector(2, k), at.vector(3, k));
    at.put(0, k, (inverts ? rotation.turned_back(arm) : rotation.turned(arm)) + center);
  });
}

/// Rodrigues' formula; the vector as it is where the axis is 0.
inline void rotate_around_axis(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three v = at.vector(0, k), center = at.vector(1, k), axis = at.vector(2, k);
    const Doubles sine = at.number(3, k), cosine = at.number(4, k);
    const Three along = unit(axis), arm = v - center;
    const Three turned =
        cosine * arm + sine * cross(along, arm) + ((1 - cosine) * dot(along, arm)) * along;
    at.put(0, k, choose(nonzero(axis), turned + center, v));
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
