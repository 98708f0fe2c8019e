// Adaptive refinement: which pixels are good enough after a wave, by how far their samples lie
// apart (semantics/stopping.md).
#pragma once
#include <cstdint>
#include <vector>

#include "system/zeroed_buffer.h"

namespace glint {

struct Region {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  uint32_t width() const { return x1 - x0; }
  uint32_t height() const { return y1 - y0; }
};

struct Tile;
class SlotTable;
class ErrorEstimate;

/// How far two linear values seem apart on an sRGB screen, in 8-bit levels, given their mean and
/// their difference >= 0.
double visible_difference(double mean, double difference);

/// Between which values some samples of a pixel lie.
struct Between {
  float low = 0, high = 0;
  void add(double sample, bool is_first) {
    const float value = float(sample);
    low = is_first || value < low ? value : low;
    high = is_first || value > high ? value : high;
  }
};

/// What is known of the samples of each pixel. Rows are those of the film's tiles and their slots,
/// pixels those of its region. One thread a tile at a time, and all threads at the same step:
/// ranges, measure, measure_neighborhood (once), decide.
class Refinement {
 public:
  static constexpr uint32_t kFirst =
      4;  // samples of the first estimate: everywhere, and what neighbours look at
  static constexpr uint32_t kLightPoints =
      16;  // of each soft light that a pixel has looked at before it may stop
  static constexpr uint32_t kDimPoints =
      32;  // where it is black so far, or the horizon cuts the light
  static constexpr uint32_t kLensSamples = 16;  // the same of a lens
  enum SoftLight : uint8_t {
    kReached = 1,
    kCut = 2
  };  // by one sample, whatever stands between; by the horizon
  static constexpr float kUnknown =
      256;  // the error of a pixel with fewer samples: beyond all levels

  /// Of the slots of a tile.
  struct Ranges {
    float *low, *high;
    Between operator[](uint32_t slot) const { return {low[slot], high[slot]}; }
    void set(uint32_t slot, const Between& range) const {
      low[slot] = range.low;
      high[slot] = range.high;
    }
  };

  Refinement() = default;
  /// threshold: in levels, 0 stops no pixel.  light_samples: points on a soft light a sample.
  /// region: with the pixels round `traced` that only their neighbours look at, and that take no
  /// more than the first samples.  rows: slots of all tiles.
  Refinement(double threshold, uint32_t light_samples, Region region, Region traced, size_t rows);

  bool on() const { return width_ > 0; }
  bool stops_pixels() const { return on() && threshold_ > 0; }
  /// Whether the pixel takes further samples.
  bool is_active(size_t row) const { return !stopped_.data()[row]; }
  /// Whether no pixel of the tile took any of the samples of the wave that has brought it to so
  /// many.
  bool rested(const Tile& tile, uint32_t samples) const;
  /// Samples of the pixel when others have `samples`.
  uint32_t taken(size_t row, uint32_t samples) const {
    const uint32_t stopped = on() ? stopped_.data()[row] : 0;
    return stopped && stopped < samples ? stopped : samples;
  }

  /// Where to note what each slot of the tile has met of `SoftLight` in that sample; null where
  /// nobody asks.
  uint8_t* soft_light(const Tile& tile, uint32_t sample);
  /// The tile's slots that take further samples.
  void list_active(const Tile& tile, std::vector<uint32_t>& slots) const;
  /// Between which values the samples lie of each slot of the tile: in a channel of colour, or in
  /// lost alpha, the fourth.
  Ranges ranges(const Tile& tile, size_t channel);
  /// How far the samples of each pixel lie apart. after: its sums.
  void measure(const Tile& tile, const SlotTable& slots, const double* after, size_t stride,
               uint32_t samples);
  void measure_neighborhood(const Tile& tile);
  /// Stops the pixels whose error is at most the threshold, if any may stop.
  void decide(const Tile& tile, const SlotTable& slots, uint32_t samples, bool any_may_stop);
  /// The same where light is resolved: what the first waves say of a pixel and those round it tells
  /// how many samples it takes, so that this depends on no more of the picture. least: of a pixel.
  void decide_ahead(const Tile& tile, const SlotTable& slots, uint32_t samples, uint32_t least,
                    const ErrorEstimate& estimate);

 private:
  /// What is held against the threshold, in levels: hardly ever less than the error of a pixel with
  /// that many samples.
  double bound_of_error(uint32_t pixel, uint32_t samples) const;
  bool may_stop(size_t row, uint64_t light_points) const;
  /// Whether all samples of the row are.
  bool is_black(size_t row) const;
  float* bound(int k, size_t row) const { return bounds_.data() + size_t(k) * rows_ + row; }
  bool is_traced(uint32_t x, uint32_t y) const {
    return x - traced_.x0 < traced_.width() && y - traced_.y0 < traced_.height();
  }

  double threshold_ = 0;
  uint32_t light_samples_ = 1;
  uint32_t width_ = 0, height_ = 0;
  Region traced_;  // counted from the corner of the region
  size_t rows_ = 0;
  ZeroedBuffer<float>
      bounds_;  // rows of the least red, green, blue, lost alpha; then of the largest
  ZeroedBuffer<uint32_t> stopped_;    // samples of rows that take no more
  ZeroedBuffer<uint32_t> ahead_;      // samples that rows will take, where that is told ahead
  ZeroedBuffer<uint8_t> soft_light_;  // what rows met of `SoftLight` in the first samples
  ZeroedBuffer<float> range_,
      around_;  // levels between samples of a pixel; between the first samples of it or a neighbour
};

}  // namespace glint
