// The Error pass: how far a pixel may be from its limit, by how its mean moved from wave to wave
// (semantics/stopping.md).
#pragma once
#include <cstdint>

#include "film/refine.h"
#include "system/zeroed_buffer.h"

namespace glint {

/// One thread a tile at a time, and all threads at the same step after a wave: measure,
/// measure_neighborhood (once, after the first samples).
class ErrorEstimate {
 public:
  ErrorEstimate() = default;
  explicit ErrorEstimate(Region region);

  bool on() const { return width_ > 0; }
  /// Another wave, up to `samples`, of the pixels that took part. before: the picture without it,
  /// colour and alpha of every pixel. after: the tile's sums of colour and lost alpha, `stride`
  /// apart.
  void measure(const Tile& tile, const SlotTable& slots, const Refinement& refinement,
               const float* before, const double* after, size_t stride, uint32_t samples);
  void measure_neighborhood(const Tile& tile);
  /// Two standard deviations of a pixel with that many samples, in 8-bit levels, about.
  float levels(uint32_t pixel, uint32_t samples) const;

 private:
  uint32_t width_ = 0, height_ = 0;
  ZeroedBuffer<float> spread_, around_;  // of pixels, squared levels: of one sample; of the mean of
                                         // the first samples, of it and its neighbours
};

}  // namespace glint
