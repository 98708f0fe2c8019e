// The Error pass: how far a pixel may be from its limit, by how its mean moved from wave to wave (SEMANTICS.md, "Error").
#pragma once
#include <cstdint>

#include "refine.h"
#include "zeros.h"

namespace glint {

/// One thread a tile at a time, and all threads at the same step after a wave: measure, look_around (once, after the first samples).
class ErrorEstimate {
 public:
  ErrorEstimate() = default;
  /// region, rows: as for Refinement.
  ErrorEstimate(Region region, size_t rows);

  bool on() const { return width_ > 0; }
  /// Another wave, up to `samples`, of the pixels that took part. after: the tile's sums of colour and lost alpha, `stride` apart.
  void measure(const Tile& tile, const SlotTable& slots, const Refinement& refinement, const double* after, size_t stride, uint32_t samples);
  void look_around(const Tile& tile);
  /// Two standard deviations of a pixel with that many samples, in 8-bit levels, about.
  float levels(uint32_t pixel, uint32_t samples) const;

 private:
  double moved(size_t row, size_t slot, const double* after, size_t stride, uint32_t samples);

  uint32_t width_ = 0, height_ = 0;
  size_t rows_ = 0;
  Zeros<float> means_;             // of rows, before the wave: red, green, blue, lost alpha
  Zeros<float> spread_, around_;   // of pixels, squared levels: of one sample; of the mean of the first samples, of it and its neighbours
};

}  // namespace glint
