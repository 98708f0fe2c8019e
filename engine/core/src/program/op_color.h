// Operations on colours.
#pragma once
#include "program/machine.h"

namespace glint {
namespace {
namespace op {

inline void rgb_to_bw(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three c = at.vector(0, k);
    at.put(0, k, 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z);
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
