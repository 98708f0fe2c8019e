// What light samples give, added to the sums of points as far as their shadow rays are free.
#pragma once
#include "shading/stage_rows.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// Zero is added where the ray is blocked, so that -0 turns to 0 alone and in packets.
void sum(const LightSum& s) {
  for (size_t k = 0; k < s.count;) {
    const uint32_t first = s.point[k];
    if (s.count - k >= kLanes && s.point[k + kLanes - 1] - first == kLanes - 1) {
      const Mask open = each_lane<Mask>(
          [&](size_t lane) { return s.blocked[k + lane] ? int64_t(0) : int64_t(-1); });
      for (size_t c = 0; c < 3; ++c)
        store(s.total[c] + first, load(s.total[c] + first) + where(open, load(s.given[c] + k)));
      k += kLanes;
    } else {
      for (size_t c = 0; c < 3; ++c)
        s.total[c][first] = s.total[c][first] + (s.blocked[k] ? 0 : s.given[c][k]);
      ++k;
    }
  }
}

void sum_parts(const LightParts& s) {
  const auto add = [](double* const(&columns)[3], const Chosen& at, const Three& c) {
    if (columns[0]) scatter3(columns, at, gather3(columns, at) + c);
  };
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Chosen at = chosen(s.point, k, s.count);
    const Three diffuse = load3(s.diffuse, k),
                specular = s.specular[0] ? load3(s.specular, k) : Three{},
                full = diffuse + specular;
    const Doubles open = each_lane([&](size_t lane) { return s.blocked[k + lane] ? 0.0 : 1.0; });
    const Three lit = full * (s.shadow[0] ? load3(s.shadow, k) : Three{open, open, open});
    add(s.sums.total, at, lit);
    add(s.sums.diffuse, at, diffuse);
    add(s.sums.specular, at, specular);
    add(s.sums.shadow, at, lit - full);
  }
}

}  // namespace
}  // namespace glint
