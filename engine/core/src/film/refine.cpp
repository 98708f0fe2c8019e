#include "film/refine.h"

#include <algorithm>
#include <cmath>

#include "film/film.h"
#include "math/math.h"

namespace glint {
namespace {

/// 8-bit levels of the sRGB curve, which goes on above 1.
double levels(double x) {
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * exponential(logarithm(x) / 2.4) - 0.055);
}

constexpr float kNone = 1e30f;  // range of samples that are not finite

/// n^(3/4): how fast errors of well-placed samples fall at an edge.
double convergence(uint32_t n) { return std::sqrt(double(n)) * std::sqrt(std::sqrt(double(n))); }

}  // namespace

double visible_difference(double mean, double difference) {
  if (difference == 0) return 0;
  const double high = std::max(std::fabs(mean), difference);
  return levels(high) - levels(high - difference);
}

Refinement::Refinement(double threshold, uint32_t light_samples, Region region, Region traced,
                       size_t rows)
    : threshold_(threshold),
      light_samples_(light_samples),
      width_(region.width()),
      height_(region.height()),
      traced_{traced.x0 - region.x0, traced.y0 - region.y0, traced.x1 - region.x0,
              traced.y1 - region.y0},
      rows_(rows),
      bounds_(8 * rows),
      stopped_(rows),
      ahead_(rows),
      soft_light_(rows),
      range_(size_t(width_) * height_),
      around_(size_t(width_) * height_) {}

uint8_t* Refinement::soft_light(const Tile& tile, uint32_t sample) {
  return stops_pixels() && sample < kFirst ? soft_light_.data() + tile.first_row : nullptr;
}

void Refinement::list_active(const Tile& tile, std::vector<uint32_t>& slots) const {
  slots.clear();
  for (uint32_t k = 0; k < tile.pixels(); ++k)
    if (!stopped_.data()[tile.first_row + k]) slots.push_back(k);
}

bool Refinement::rested(const Tile& tile, uint32_t samples) const {
  if (!on()) return false;
  const uint32_t* const stopped = stopped_.data() + tile.first_row;
  return std::all_of(stopped, stopped + tile.pixels(),
                     [samples](uint32_t at) { return at != 0 && at < samples; });
}

Refinement::Ranges Refinement::ranges(const Tile& tile, size_t channel) {
  return {bound(int(channel), tile.first_row), bound(int(channel) + 4, tile.first_row)};
}

void Refinement::measure(const Tile& tile, const SlotTable& slots, const double* after,
                         size_t stride, uint32_t samples) {
  for (uint32_t k = 0; k < tile.pixels(); ++k) {
    const size_t row = tile.first_row + k;
    if (stopped_.data()[row]) continue;
    double range = 255 * (double(*bound(7, row)) - double(*bound(3, row)));
    for (int c = 0; c < 3; ++c) {
      const double apart = double(*bound(c + 4, row)) - double(*bound(c, row));
      const double seen = visible_difference(after[size_t(c) * stride + k] / samples, apart);
      range = seen >= range ? seen : seen == seen ? range : kInfinity;
    }
    range_.data()[slots.pixel(tile, k, width_)] = range < kNone ? float(range) : kNone;
  }
}

void Refinement::measure_neighborhood(const Tile& tile) {
  const auto larger = [&](float largest, size_t pixel) {
    return std::max(largest, range_.data()[pixel]);
  };
  sum_neighborhoods<float>(tile, width_, height_, larger,
                           [&](size_t pixel, float largest) { around_.data()[pixel] = largest; });
}

double Refinement::bound_of_error(uint32_t pixel, uint32_t samples) const {
  return double(std::max(range_.data()[pixel], around_.data()[pixel])) / convergence(samples);
}

void Refinement::decide_ahead(const Tile& tile, const SlotTable& slots, uint32_t samples,
                              uint32_t least, const ErrorEstimate& estimate) {
  for (uint32_t k = 0; k < tile.pixels(); ++k) {
    const size_t row = tile.first_row + k;
    const uint32_t pixel = slots.pixel(tile, k, width_);
    uint32_t& ahead = ahead_.data()[row];
    for (uint32_t n = samples; samples == kFirst && ahead == 0; n *= 2) {
      const bool enough =
          threshold_ > 0 && n >= least && double(estimate.levels(pixel, n)) <= threshold_;
      if (enough || n >= 1u << 30) ahead = n;
    }
    uint32_t& stopped = stopped_.data()[row];
    if (!stopped && (samples >= ahead || !is_traced(pixel % width_, pixel / width_)))
      stopped = samples;
  }
}

bool Refinement::is_black(size_t row) const {
  bool black = true;
  for (int c = 0; c < 3; ++c) black &= *bound(c, row) == 0 && *bound(c + 4, row) == 0;
  return black;
}

/// Whether the row has seen enough of the soft lights. light_points: of each that it has looked at.
bool Refinement::may_stop(size_t row, uint64_t light_points) const {
  const uint8_t met = soft_light_.data()[row];
  if (!met) return true;
  const bool black = is_black(row), cut = met & kCut;
  const uint32_t least = black || cut ? kDimPoints : kLightPoints;
  return light_points >= least && !(black && cut);
}

void Refinement::decide(const Tile& tile, const SlotTable& slots, uint32_t samples,
                        bool any_may_stop) {
  for (uint32_t k = 0; k < tile.pixels(); ++k) {
    const size_t row = tile.first_row + k;
    uint32_t& stopped = stopped_.data()[row];
    const uint32_t pixel = slots.pixel(tile, k, width_);
    const bool good = any_may_stop && threshold_ > 0 &&
                      bound_of_error(pixel, samples) <= threshold_ &&
                      may_stop(row, uint64_t(samples) * light_samples_);
    if (!stopped && (good || !is_traced(pixel % width_, pixel / width_))) stopped = samples;
  }
}

}  // namespace glint
