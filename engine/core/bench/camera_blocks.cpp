#include "camera_blocks.h"

namespace glint::bench {

CameraBlocks::CameraBlocks(const View& view, uint32_t size)
    : size_(size),
      step_(2 * view.half_width / size),
      half_(view.half_width),
      stages_(best_stages()),
      hits_(kMost) {
  const Vec3d forward = normalize(view.target - view.eye),
              right = normalize(cross(forward, view.up)), up = cross(right, forward);
  stage_.scale = 1;
  stage_.clip_end = 1e30;
  stage_.across = window_[0].data();
  stage_.upward = window_[1].data();
  stage_.t_min = t_min_.data();
  stage_.t_max = t_max_.data();
  stage_.latest = &ends_.latest;
  stage_.earliest = &ends_.earliest;
  rays_.ends = &ends_;
  for (size_t c = 0; c < 3; ++c) {
    stage_.u[c] = right[int(c)];
    stage_.v[c] = up[int(c)];
    stage_.w[c] = -forward[int(c)];
    stage_.o[c] = o_[c].data();
    stage_.d[c] = d_[c].data();
    o_[c].fill(view.eye[int(c)]);
    rays_.o[c] = o_[c].data();
    rays_.d[c] = d_[c].data();
  }
  rays_.t_min = t_min_.data();
  rays_.t_max = t_max_.data();
  rays_.visibility = kCamera;
  for (uint32_t k = 0; k < kMost; ++k) {
    uint32_t column, row;
    pixel_of(k, column, row);
    place_[0][k] = column;
    place_[1][k] = row;
  }
}

const Rays& CameraBlocks::make(size_t first, size_t count) {
  const size_t within = first % kMost;
  uint32_t column, row;
  pixel_of(uint32_t(first - within), column, row);
  const double left = step_ * (column + 0.5) - half_, top = half_ - step_ * (row + 0.5);
  for (size_t k = 0; k < count; ++k) {
    window_[0][k] = left + step_ * place_[0][within + k];
    window_[1][k] = top - step_ * place_[1][within + k];
  }
  stage_.count = rays_.count = count;
  stages_.camera(stage_);
  return rays_;
}

}  // namespace glint::bench
