// What a dome gives besides the directions of a sample (DomeStage). Letters: x point, n normal, l
// direction.
#pragma once
#include "shading/light/dome.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// The contribution of a sample's directions and its points on openings, times how many directions
/// there are.
inline Three contribution_beside_openings(const DomeStage& s, size_t k, const Three& n) {
  const Three x = load3(s.points->x, k);
  Three sum{};
  const auto add = [&](const Three& l, const Three& color, const Doubles& inverse_pdf) {
    const Doubles less = 1 + opening_pdf(*s.openings, x, l) * inverse_pdf;
    sum = sum + (larger(dot(l, n), splat(0)) / less) * color;
  };
  for (size_t i = 0; i < s.directions; ++i) {
    const double* const row = s.drawn + kDomeColumns * i;
    add(splat3(row), splat3(row + 3), splat(row[6]));
  }
  for (size_t j = 0; j < s.opening_point_count; ++j) {
    const OpeningPoint& on = s.opening_points[j];
    const Three l = unit(splat3(on.at) - x);
    const DomeCell cell = dome_cell(*s.dome, l);
    add(l, where(dot(l, splat3(on.normal)) > 0, cell.inverse_pdf) * cell.color, cell.inverse_pdf);
  }
  return sum;
}

void dome(const DomeStage& s) {
  for (size_t k = 0; k < s.points->count; k += kLanes) {
    if (!any(load(s.lit + k))) continue;
    const Three n = load3(s.points->n, k);
    Three sum{};
    for (size_t i = 0; i < s.directions; ++i) {
      const double* const row = s.drawn + kDomeColumns * i;
      sum = sum + larger(dot(splat3(row), n), splat(0)) * splat3(row + 3);
    }
    if (s.openings->count) sum = contribution_beside_openings(s, k, n);
    const Three rest = unhidden(*s.dome, n) - splat(1.0 / double(s.directions)) * sum;
    store3(s.rest, k, load3(s.points->diffuse, k) * rest);
  }
}

}  // namespace
}  // namespace glint
