// Operations on vectors.
#pragma once
#include "program/machine.h"

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

inline Doubles bounded_number(Doubles x, Doubles low, Doubles high) {
  return smaller(larger(x, low), high);
}

inline void bounded(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three v = at.vector(0, k), low = at.vector(1, k), high = at.vector(2, k);
    at.put(0, k,
           Three{bounded_number(v.x, low.x, high.x), bounded_number(v.y, low.y, high.y),
                 bounded_number(v.z, low.z, high.z)});
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
