// Camera rays (notes 4.4-4.6) in anchored space.
#pragma once
#include "bvh/traverse/empty_tile_culling.h"
#include "scene/scene.h"
#include "shading/stages.h"

namespace glint {

class CameraRays {
 public:
  explicit CameraRays(const Scene& scene)
      : camera_(scene.camera),
        m_(affine(camera_.world_from_camera)),
        backward_(unit(m_.z)),
        scale_(scene.anchor.scale),
        origin_(scene.anchor.origin),
        eye_(scene.anchor.point(m_.t)) {}

  /// Where the camera stands in anchored space: the origin, except in a scene that was made like
  /// one of another camera.
  Vec3d eye() const { return eye_; }

  bool is_panorama() const { return camera_.kind == GLINT_PANORAMA; }
  /// Whether its rays begin at one point, where no lens and no motion part them.
  bool has_one_eye() const { return !parallel() && camera_.eye_offset == 0; }
  /// Whether its rays fill the frustums between those of their corners.
  bool has_frustums() const { return !is_panorama() && camera_.eye_offset == 0; }

  /// Where column + 0.5 + dx of the frame's columns is in the window, and row + 0.5 + dy of its
  /// rows.
  double u(double column, double dx) const {
    return at(column + 0.5 + dx, camera_.window, camera_.width);
  }
  double v(double row, double dy) const {
    return at(row + 0.5 + dy, camera_.window + 2, camera_.height);
  }

  /// What the stage needs but for the points that the rays go through.
  CameraStage stage() const {
    CameraStage s{};
    for (int c = 0; c < 3; ++c) {
      s.u[c] = m_.x[c];
      s.v[c] = m_.y[c];
      s.w[c] = m_.z[c];
    }
    for (int c = 0; c < 3; ++c) s.origin[c] = origin_[c];
    s.scale = scale_;
    s.clip_start = camera_.clip_start;
    s.clip_end = camera_.clip_end;
    s.parallel = parallel();
    s.panorama = is_panorama() ? &camera_ : nullptr;
    s.eye = camera_.eye_offset != 0 ? &camera_ : nullptr;
    return s;
  }

  bool clips() const { return camera_.clip_plane_count != 0; }
  /// Cuts the rays of a stage to where they are inside the clip planes.
  void clip(const CameraStage& s) const {
    for (size_t k = 0; camera_.clip_plane_count && k < s.count; ++k) {
      const double x = s.lens_x ? s.lens_x[k] : 0, y = s.lens_x ? s.lens_y[k] : 0;
      const double u = s.across[k], v = s.upward[k];
      Line line{x, y, u - s.bend * x, v - s.bend * y};
      if (s.parallel) line = {u + x, v + y, -s.bend * x, -s.bend * y};
      // of t, to one unit of depth
      const double step = scale_ * length(line.du * m_.x + line.dv * m_.y - m_.z);
      for (int p = 0; p < camera_.clip_plane_count; ++p)
        cut(camera_.clip_planes[p], line, step, s.t_min[k], s.t_max[k]);
    }
  }

  /// Round all rays through points of the window from (u0, v0) to (u1, v1); where it
  /// `has_frustums`.
  TileFrustum frustum(double u0, double v0, double u1, double v1) const {
    const double corners[4][2] = {{u0, v0}, {u1, v0}, {u1, v1}, {u0, v1}};
    Vec3d origins[4], directions[4];
    for (int j = 0; j < 4; ++j) {
      const Vec3d across = corners[j][0] * m_.x + corners[j][1] * m_.y;
      origins[j] = parallel() ? scale_ * across + eye_ : eye_;
      directions[j] = unit(parallel() ? -m_.z : across - m_.z);
    }
    return TileFrustum(origins, directions);
  }

  /// How far a point is from the eye, or along -w where rays are parallel, in world units.
  double distance(Vec3d p) const {
    return parallel() ? std::fabs(depth(p)) : length(p - eye_) * (1 / scale_);
  }
  /// How far a point is from where its camera ray begins, which is at the near end of what is
  /// seen.
  double distance_seen(Vec3d p) const {
    return distance(p) * (1 - camera_.clip_start * length(m_.z) / depth(p));
  }
  /// A direction along the camera's axes: right, up, forward.
  Vec3d along_axes(Vec3d n) const {
    return {dot(n, unit(m_.x)), dot(n, unit(m_.y)), -dot(n, backward_)};
  }
  /// Depth along -w in world units of an anchored point; of a panorama the distance from the eye.
  double depth(Vec3d p) const {
    return (is_panorama() ? length(p - eye_) : -dot(p - eye_, backward_)) *
           (1 / scale_);  // a power of two
  }

 private:
  bool parallel() const { return camera_.kind == GLINT_ORTHOGRAPHIC; }
  static double at(double place, const double* ends, double pixels) {
    return ends[0] + place * (ends[1] - ends[0]) / pixels;
  }

  /// The ray (u + du z, v + dv z, z).
  struct Line {
    double u, v, du, dv;
  };

  /// One plane and a ray.
  static void cut(const double* plane, const Line& ray, double step, double& t_min, double& t_max) {
    const double slope = plane[2] + (plane[0] * ray.du + plane[1] * ray.dv),
                 constant = plane[3] + (plane[0] * ray.u + plane[1] * ray.v);
    const double t = -constant / slope * step;
    if (slope > 0) t_min = std::max(t_min, t);
    else if (slope < 0) t_max = std::min(t_max, t);
    else if (!(constant >= 0)) t_max = -1;
  }

  const GlintCamera& camera_;
  Affine m_;
  Vec3d backward_;
  double scale_;
  Vec3d origin_, eye_;
};

}  // namespace glint
