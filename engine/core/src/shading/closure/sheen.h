// SHEEN lobes: a cosine lobe, seen from above, that is stretched and leans over
// (semantics/lobes.md).
#pragma once
#include "shading/closure/lobe_row.h"

namespace glint {
namespace {

/// What one gives back of light along l. cosine: n.l. Where n is turned away n.v is below 0.
__attribute__((noinline)) Doubles eval_sheen(const LitPoints& s, size_t k, int number,
                                             const Three& n, const Three& d, const Three& l,
                                             Doubles cosine) {
  const LobeRow row(s, k, GLINT_SHEEN, number);
  const Doubles width = row.number(SheenRow::kWidth), lean = row.number(SheenRow::kLean),
                vh = root(larger(0.5 * (1 - dot(l, d)), splat(0))), lv = 2 * vh * vh - 1,
                nv = smaller(-dot(n, d), splat(1)), sine2 = 1 - nv * nv,
                along = where(sine2 > 0, (lv - cosine * nv) / root(sine2)),
                square = width * width * (1 - cosine * cosine) - 2 * width * lean * along * cosine +
                         (1 + lean * lean) * cosine * cosine;
  return cosine * width * width / (square * square);
}

}  // namespace
}  // namespace glint
