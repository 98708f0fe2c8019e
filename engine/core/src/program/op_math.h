// Operations on numbers.
#pragma once
#include "program/machine.h"

namespace glint {
namespace {
namespace op {

inline void math(const Machine& m, const Operands& at) {
  each_group(m,
             [&](size_t k) { at.put(0, k, at.number(0, k) * at.number(1, k) + at.number(2, k)); });
}

inline void clamp(const Machine& m, const Operands& at) {
  const bool sorts = at.settings[0] == 1;
  each_group(m, [&](size_t k) {
    Doubles low = at.number(1, k), high = at.number(2, k);
    if (sorts) {
      const Mask swapped = low > high;
      const Doubles larger_one = choose(swapped, low, high);
      low = choose(swapped, high, low);
      high = larger_one;
    }
    at.put(0, k, smaller(larger(at.number(0, k), low), high));
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
