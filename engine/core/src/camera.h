// Camera rays (notes 4.4-4.6) in anchored space.
#pragma once
#include "scene.h"
#include "stages/stages.h"

namespace glint {

class CameraRays {
 public:
  explicit CameraRays(const Scene& scene)
      : camera_(scene.camera), m_(affine(camera_.world_from_camera)), backward_(unit(m_.z)), scale_(scene.anchor.scale),
        eye_(scene.anchor.point(m_.t)) {}

  /// Where the camera stands in anchored space: the origin, except in a scene that was made like one of another camera.
  Vec3d eye() const { return eye_; }

  /// What the stage needs for rays through points of pixels (first_column + i + 0.5 + dx, first_row + j + 0.5 + dy).
  CameraStage stage(double first_column, double first_row, double dx, double dy) const {
    CameraStage s{};
    s.first_column = first_column, s.first_row = first_row, s.dx = dx, s.dy = dy;
    s.width = camera_.width, s.height = camera_.height;
    std::copy_n(camera_.window, 4, s.window);
    for (int c = 0; c < 3; ++c) s.u[c] = m_.x[c], s.v[c] = m_.y[c], s.w[c] = m_.z[c];
    s.scale = scale_, s.clip_start = camera_.clip_start, s.clip_end = camera_.clip_end;
    s.parallel = camera_.kind == GLINT_ORTHOGRAPHIC;
    return s;
  }

  /// Depth along -w in world units of an anchored point.
  double depth(Vec3d p) const { return -dot(p - eye_, backward_) / scale_; }

 private:
  const GlintCamera& camera_;
  Affine m_;
  Vec3d backward_;
  double scale_;
  Vec3d eye_;
};

}  // namespace glint
