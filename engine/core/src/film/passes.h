// Sets of passes, a bit each.
#pragma once
#include <cstdint>

#include "glint.h"

namespace glint {

using Passes = uint64_t;
constexpr Passes pass_bit(int pass) { return Passes(1) << pass; }

}  // namespace glint
