#include "program/program.h"

#include <algorithm>

#include "shading/stages.h"

namespace glint {

std::vector<double> spread_constants(const double* constants, size_t count) {
  std::vector<double> spread(count * kPad);
  for (size_t i = 0; i < count; ++i) std::fill_n(spread.data() + i * kPad, kPad, constants[i]);
  return spread;
}

}  // namespace glint
