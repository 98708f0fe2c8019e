// Camera rays (notes 4.4-4.6) in anchored space.
#pragma once
#include "accel/accel.h"
#include "math.h"
#include "scene.h"

namespace glint {

class CameraRays {
 public:
  explicit CameraRays(const Scene& scene)
      : camera_(scene.camera), m_(affine(camera_.world_from_camera)), backward_(unit(m_.z)), scale_(scene.anchor.scale) {}

  /// Through the point (i + 0.5 + dx, j + 0.5 + dy) of the frame, pixels from the bottom left. d is unit.
  Ray through(uint32_t i, uint32_t j, double dx, double dy) const {
    const double* w = camera_.window;  // l, r, b, t
    double u = w[0] + (i + 0.5 + dx) * (w[1] - w[0]) / camera_.width, v = w[2] + (j + 0.5 + dy) * (w[3] - w[2]) / camera_.height;
    Vec3d across = u * m_.x + v * m_.y;
    bool parallel = camera_.kind == GLINT_ORTHOGRAPHIC;
    Vec3d d = parallel ? -m_.z : across - m_.z;
    Ray ray{parallel ? scale_ * across : Vec3d{}, unit(d), 0, kInfinity, kCamera};
    double step = dot(d, ray.d) * scale_;  // anchored length of one unit of depth along the ray
    ray.t_min = camera_.clip_start * step * (1 - 0x1p-50);  // the bounds themselves count, the ray's interval is open
    ray.t_max = camera_.clip_end * step * (1 + 0x1p-50);
    return ray;
  }

  /// Depth along -w in world units of an anchored point.
  double depth(Vec3d p) const { return -dot(p, backward_) / scale_; }

 private:
  const GlintCamera& camera_;
  Affine m_;
  Vec3d backward_;
  double scale_;
};

}  // namespace glint
