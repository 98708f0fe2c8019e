// What the kinds of lobes have in common, by GlintLobeKind: engine/closures/table.py.
#pragma once
#include <iterator>

#include "glint.h"

namespace glint {

/// A number of a lobe; no name where a kind has none there.
struct ClosureParameter {
  const char* name;
  double low, high;
};

/// columns: of a row of its, the fewest; 0: it has none (rows.h).  passes: rays go on from it.
struct ClosureRow {
  const char* name;
  ClosureParameter parameters[3];
  int columns;
  bool passes, of_fibre;
};

constexpr ClosureRow kClosures[] = {
#include "shading/closure/table.inc"
};
constexpr int kLobeKinds = GLINT_FIBRE_TRANSMISSION + 1;
static_assert(std::size(kClosures) == kLobeKinds);

/// Bit 1 << kind for each kind of lobe that sends rays on, or is a hole for those of the camera.
constexpr uint32_t kPassing = [] {
  uint32_t kinds = 0;
  for (int kind = 0; kind < kLobeKinds; ++kind) kinds |= uint32_t(kClosures[kind].passes) << kind;
  return kinds;
}();

}  // namespace glint
