#include "estimate.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "film.h"
#include "math.h"

namespace glint {
namespace {

constexpr double kMost = 1e30;  // squared levels of what is not finite

}  // namespace

ErrorEstimate::ErrorEstimate(Region region, size_t rows)
    : width_(region.width()), height_(region.height()), rows_(rows), means_(4 * rows), spread_(size_t(width_) * height_),
      around_(size_t(width_) * height_) {}

/// By how many levels the mean moved since the last call; the largest of its channels.
double ErrorEstimate::moved(size_t row, size_t slot, const double* after, size_t stride, uint32_t samples) {
  double largest = 0;
  for (size_t c = 0; c < 4; ++c) {
    float& before = means_.data()[c * rows_ + row];
    const double mean = after[c * stride + slot] / samples, apart = std::fabs(mean - double(before));
    const double seen = c == 3 ? 255 * apart : visible_difference(mean, apart);
    largest = seen >= largest ? seen : seen == seen ? largest : kInfinity;
    before = float(mean);
  }
  return largest;
}

void ErrorEstimate::measure(const Tile& tile, const SlotTable& slots, const Refinement& refinement, const double* after, size_t stride,
                            uint32_t samples) {
  const double n = samples, m = samples > 1 ? std::bit_floor(samples - 1) : 0;  // samples before the wave
  for (uint32_t k = 0; k < tile.pixels(); ++k) {
    const size_t row = tile.first_row + k;
    if (!refinement.is_active(row)) continue;
    const double d = moved(row, k, after, stride, samples);
    if (samples == 1) continue;
    const double spread = std::min(d * d * (m * n / (n - m)), kMost);
    float& known = spread_.data()[slots.pixel(tile, k, width_)];
    known = float(samples == 2 ? spread : (double(known) + spread) / 2);
  }
}

void ErrorEstimate::look_around(const Tile& tile) {
  struct Mean {
    double sum, count;
  };
  const auto add = [&](Mean mean, size_t pixel) { return Mean{mean.sum + double(spread_.data()[pixel]), mean.count + 1}; };
  const auto keep = [&](size_t pixel, Mean mean) { around_.data()[pixel] = float(mean.sum / (mean.count * Refinement::kFirst)); };
  sum_neighborhoods<Mean>(tile, width_, height_, add, keep);
}

float ErrorEstimate::levels(uint32_t pixel, uint32_t samples) const {
  if (samples < Refinement::kFirst) return Refinement::kUnknown;
  const double ratio = double(Refinement::kFirst) / samples;
  const double square = double(spread_.data()[pixel]) / samples + double(around_.data()[pixel]) * (ratio * std::sqrt(ratio));
  return std::min(float(std::sqrt(square)), Refinement::kUnknown);
}

}  // namespace glint
