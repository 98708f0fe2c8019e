#include "film/estimate.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "film/film.h"
#include "math/math.h"

namespace glint {
namespace {

constexpr double kMost = 1e30;  // squared levels of what is not finite

/// By how many levels the mean of a pixel moved, the largest of its channels. before: colour and
/// alpha.  after: sums of colour and lost alpha.
double moved(const float* before, const double* after, size_t stride, uint32_t samples) {
  double largest = 0;
  for (size_t c = 0; c < 4; ++c) {
    const double mean = after[c * stride] / samples,
                 then = c == 3 ? 1 - double(before[c]) : double(before[c]);
    const double apart = std::fabs(mean - then),
                 seen = c == 3 ? 255 * apart : visible_difference(mean, apart);
    largest = seen >= largest ? seen : seen == seen ? largest : kInfinity;
  }
  return largest;
}

}  // namespace

ErrorEstimate::ErrorEstimate(Region region)
    : width_(region.width()),
      height_(region.height()),
      spread_(size_t(width_) * height_),
      around_(size_t(width_) * height_) {}

void ErrorEstimate::measure(const Tile& tile, const SlotTable& slots, const Refinement& refinement,
                            const float* before, const double* after, size_t stride,
                            uint32_t samples) {
  if (samples == 1) return;
  const double n = samples, m = std::bit_floor(samples - 1);  // samples before the wave
  for (uint32_t k = 0; k < tile.pixels(); ++k) {
    const size_t row = tile.first_row + k;
    if (!refinement.is_active(row)) continue;
    const uint32_t pixel = slots.pixel(tile, k, width_);
    const double d = moved(before + 4 * size_t(pixel), after + k, stride, samples);
    const double spread = std::min(d * d * (m * n / (n - m)), kMost);
    float& known = spread_.data()[pixel];
    known = float(samples == 2 ? spread : (double(known) + spread) / 2);
  }
}

void ErrorEstimate::measure_neighborhood(const Tile& tile) {
  struct Mean {
    double sum, count;
  };
  const auto add = [&](Mean mean, size_t pixel) {
    return Mean{mean.sum + double(spread_.data()[pixel]), mean.count + 1};
  };
  const auto keep = [&](size_t pixel, Mean mean) {
    around_.data()[pixel] = float(mean.sum / (mean.count * Refinement::kFirst));
  };
  sum_neighborhoods<Mean>(tile, width_, height_, add, keep);
}

float ErrorEstimate::levels(uint32_t pixel, uint32_t samples) const {
  if (samples < Refinement::kFirst) return Refinement::kUnknown;
  const double ratio = double(Refinement::kFirst) / samples;
  const double square = double(spread_.data()[pixel]) / samples +
                        double(around_.data()[pixel]) * (ratio * std::sqrt(ratio));
  return std::min(float(std::sqrt(square)), Refinement::kUnknown);
}

}  // namespace glint
