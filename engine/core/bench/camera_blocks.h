// Camera rays as whole frames have them: made by the core's camera stage, in double, a tile at a
// time, in memory that stays in the caches; and so are their hits.
#pragma once
#include <array>

#include "ray_sets.h"
#include "shading/stages.h"

namespace glint::bench {

/// Those of a picture, in the order of FrameRays::primary.
class CameraBlocks {
 public:
  static constexpr size_t kMost = 1024;  // as many as the renderer has at once

  CameraBlocks(const View& view, uint32_t size);
  size_t size() const { return size_t(size_) * size_; }
  /// The rays [first, first + count), made again; no multiple of kMost lies between them.
  const Rays& make(size_t first, size_t count);
  /// Room for their hits.
  Hits hits() { return hits_.from(0); }

 private:
  using Column = std::array<double, kMost>;
  uint32_t size_;
  double step_, half_;
  const Stages& stages_;
  CameraStage stage_{};
  Column place_[2], window_[2], o_[3], d_[3], t_min_, t_max_;  // place_: within a block, in pixels
  RayEnds ends_{};
  Rays rays_{};
  HitArrays hits_;
};

}  // namespace glint::bench
