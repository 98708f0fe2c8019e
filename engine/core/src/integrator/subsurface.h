// Light that goes into a surface and comes out of it elsewhere (semantics/subsurface.md).
#pragma once
#include <vector>

#include "integrator/batch.h"
#include "integrator/scene_queries.h"

namespace glint {

/// Christensen and Burley's profile of a point, by channel: d is how far its light goes, 0 of a
/// channel that has none.
struct Profile {
  static constexpr double kReach = 16.6;  // of the largest d: all but 0.3 % of the light

  Vec3d d;
  double reach = 0, channels = 0;
  Vec3d third, whole;  // 1 / (3 d); the share of a channel within the reach

  Profile() = default;
  explicit Profile(Vec3d radius);
  /// The share of the light that comes out within r, the mean of the channels.
  double mean(double r) const;
  /// Within which that share of it comes out.
  double radius(double share) const;
  /// How much of each channel comes out between two radii, over what does of all.
  Vec3d ring(double low, double high) const;
  /// How dense it is at a distance over how dense it is nearer, round a ring of that radius each,
  /// by channel.
  Vec3d fall(double near, double far) const;
};

class Subsurface {
 public:
  Subsurface(const Scene& scene, const RenderPlan& plan);

  bool on() const { return on_; }
  /// Takes from the batch's points what of their light comes out elsewhere.
  /// is_seen(k): whether point k shows what light does there.
  template <class IsSeen>
  void enter(Batch& batch, uint32_t sample, IsSeen is_seen) {
    points_.clear();
    for (uint32_t k = 0; k < batch.size(); ++k)
      if (batch.lit[k] && any(row(batch.below, k)) && is_seen(k))
        enter(batch, k, plan_.subsurface_point(sample));
  }
  /// Where it comes out, to `exits`.
  void leave(const Batch& batch, SceneQueries& queries, Queue& exits, RayCounts& counts);

 private:
  /// Of a sample: in what distance it looks, and what of each channel it stands for.
  struct Ring {
    Profile profile;
    const double* row = nullptr;
    double r = 0;
    Vec3d share;
  };
  struct Point {
    uint32_t row;
    Ring ring;
    Vec3d given, most;  // most: of all that comes out along a ray over what one part is of
    Vec3d axes[3];
    Vec3d x;
    bool outside;
  };
  struct Exit {
    uint32_t order, point;
    Ray ray;
    Hit hit;
    Vec3d T;
  };

  void enter(Batch& batch, uint32_t k, const double* row);
  const Ring& ring(Vec3d radius, const double* row);
  double least_radius(Vec3d x) const;
  void look(size_t first, size_t count, bool across, SceneQueries& queries);
  static size_t axis_of(const Point& point, bool across) {
    return across ? size_t(point.ring.row[5]) : 0;
  }
  static Vec3d share(const Point& point, size_t axis, Vec3d x, Vec3d g);

  const Scene& scene_;
  const RenderPlan& plan_;
  const bool on_;
  std::vector<Point> points_;
  std::vector<Exit> exits_;
  std::vector<uint32_t> layer_;
  std::vector<Vec3d> parts_, sums_;  // of the hits of a block, and of its points
  Ring known_;                       // the last one
};

}  // namespace glint
