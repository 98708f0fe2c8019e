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

  /// What the stage needs for rays through points (first_column + column + 0.5 + dx, first_row + row + 0.5 + dy), but for these four.
  CameraStage stage(double first_column, double first_row) const {
    CameraStage s{};
    s.first_column = first_column, s.first_row = first_row;
    s.width = camera_.width, s.height = camera_.height;
    std::copy_n(camera_.window, 4, s.window);
    for (int c = 0; c < 3; ++c) s.u[c] = m_.x[c], s.v[c] = m_.y[c], s.w[c] = m_.z[c];
    s.scale = scale_, s.clip_start = camera_.clip_start, s.clip_end = camera_.clip_end;
    s.parallel = camera_.kind == GLINT_ORTHOGRAPHIC;
    return s;
  }

  /// Cuts the rays of a stage to where they are inside the clip planes.
  void clip(const CameraStage& s) const {
    for (size_t k = 0; camera_.clip_plane_count && k < s.count; ++k) {
      const double u = at(s.first_column + s.column[k] + 0.5 + s.dx[k], s.window, s.width);
      const double v = at(s.first_row + s.row[k] + 0.5 + s.dy[k], s.window + 2, s.height);
      const double step = scale_ * length(s.parallel ? m_.z : u * m_.x + v * m_.y - m_.z);  // of t, to one unit of depth
      for (int p = 0; p < camera_.clip_plane_count; ++p) cut(camera_.clip_planes[p], u, v, step, s.t_min[k], s.t_max[k]);
    }
  }

  /// Depth along -w in world units of an anchored point.
  double depth(Vec3d p) const { return -dot(p - eye_, backward_) * (1 / scale_); }  // a power of two

 private:
  static double at(double place, const double* ends, double pixels) { return ends[0] + place * (ends[1] - ends[0]) / pixels; }

  /// One plane and the ray (u z, v z, z), or (u, v, z) where rays are parallel.
  void cut(const double* plane, double u, double v, double step, double& t_min, double& t_max) const {
    const bool parallel = camera_.kind == GLINT_ORTHOGRAPHIC;
    const double across = plane[0] * u + plane[1] * v;
    const double slope = plane[2] + (parallel ? 0 : across), constant = plane[3] + (parallel ? across : 0);
    const double t = -constant / slope * step;
    if (slope > 0) t_min = std::max(t_min, t);
    else if (slope < 0) t_max = std::min(t_max, t);
    else if (!(constant >= 0)) t_max = -1;
  }

  const GlintCamera& camera_;
  Affine m_;
  Vec3d backward_;
  double scale_;
  Vec3d eye_;
};

}  // namespace glint
