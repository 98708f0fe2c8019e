// Which pixels of a block get what a sample's rays of some of them find: of bounced light, from its
// points and by gather rays, and of what wide lobes reflect. Neighbours on one surface look in
// directions of their own, or in turn (Keller, Heidrich 2001, Interleaved sampling), and each takes
// what the others find as if it had found it (Bekaert, Sbert, Halton 2002, Accelerating path
// tracing by re-using paths).
#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "integrator/batch.h"
#include "integrator/plan.h"

namespace glint {

/// Which blocks pixels are in: those of `side` pixels on a side that lie along the frame, moved to
/// the left and down by so many pixels. The first and the last of a tile take in what that leaves
/// over at its ends, so that none are thin.
struct BlockGrid {
  uint32_t side = 1;
  int left = 0, down = 0;
  /// Of what wide lobes reflect in a sample: in nine samples they lie in nine ways, so that no
  /// block shows.
  static BlockGrid of_gloss(uint32_t sample) {
    return {RenderPlan::kGlossBlock, int((sample + 1) % 3) - 1,
            int((sample + sample / 3 + 1) % 3) - 1};
  }
};

/// Of the camera rays of one sample of a tile's pixels.
class BlockShares {
 public:
  /// Of paths from the batch's points on, which are of these pixels of the region. given: what each
  /// gives back of light, of gather rays from all sides, all 0 where it shares nothing: what its
  /// own rays find is its own then, as they carry it. Those of a group give back the same channels.
  /// apart: which share gather rays, but no shadow rays; null for none.  exponents: of
  /// the narrowest lobes, whose normals lie the closer together in a group; null for matt ones.
  void set(const RenderPlan& plan, const Batch& batch, const std::vector<uint32_t>& pixels,
           const BlockGrid& grid, const std::vector<Vec3d>& given,
           const std::vector<uint8_t>* apart, const std::vector<double>* exponents);
  bool shares(uint32_t path) const { return points_[path].kind & kChannels; }
  /// add(path, share) for each path that gets something of what a ray of `path` finds at x, on a
  /// surface with the normal g: by how densely the rays of each look there (the balance heuristic).
  template <class Add>
  void give(uint32_t path, Vec3d x, Vec3d g, Add add) const {
    const Group& group = groups_[group_[path]];
    if (group.count == 1) return add(path, points_[path].given);
    double dense[kMost], total = 0;
    for (uint32_t k = 0; k < group.count; ++k)
      total += dense[k] = density(points_[group.paths[k]], x, g);
    if (!(total > 0)) return;
    for (uint32_t k = 0; k < group.count; ++k)
      if (dense[k] > 0) add(group.paths[k], (dense[k] / total) * points_[group.paths[k]].given);
  }
  /// At which of the sample's kGlossPlaces in a wide lobe the path's ray is reflected: of a group
  /// about half send a ray, in turn, a power of two, to places that are even by themselves.
  static constexpr uint8_t kAlone = RenderPlan::kGlossPlaces, kWaits = kAlone + 1;
  uint8_t turn(uint32_t path, uint32_t sample) const {
    const uint32_t count = groups_[group_[path]].count,
                   rays = std::min(std::bit_ceil(count) / 2, uint32_t(kAlone)),
                   at = (points_[path].place + sample) % count * rays;
    if (count == 1) return kAlone;
    return at % count < rays ? uint8_t((at / count + rays * sample) % kAlone) : kWaits;
  }
  /// Of its shadow rays to points of bounced light the path traces every `count`-th from `number`
  /// on in this sample, its group the others. Every fourth sample lies in the same part of its
  /// pixel, and each has its turn in all of these.
  struct Turn {
    uint32_t number, count;
  };
  Turn turn_of_points(uint32_t path, uint32_t sample) const {
    if (!shares_points(path)) return {0, 1};
    const uint32_t count = groups_[group_[path]].count;
    return {(points_[path].place + sample + sample / 4) % count, count};
  }
  /// Makes of what each path has of such rays what all of its group have, as much of it as the path
  /// gives back. columns: red, green and blue.
  void pool(double* const* columns) const;
  /// Adds to each path's sum of `to`, the channel c, what those of its group brought to `from` that
  /// sent rays, in equal parts and as much of it as it gives back itself.
  void mix(size_t c, uint32_t sample, const double* from, double* to) const;

 private:
  static constexpr uint32_t kMost = (RenderPlan::kGlossBlock + 1) * (RenderPlan::kGlossBlock + 1);
  static constexpr double kLeast = 1e-100;  // that is given of a channel: less is nothing
  static constexpr uint8_t kChannels = 7, kApart = 8;
  struct Point {
    Vec3d x, n, given;  // given: 1 where it shares nothing
    double least;       // cosine between n and the normals of others on its surface
    uint8_t kind;       // the channels of what it gives, a bit each, and kApart
    uint8_t place;      // among those of its group
  };
  /// Points of a block on one surface.
  struct Group {
    uint32_t count = 0, paths[kMost];
  };

  bool shares_points(uint32_t path) const { return shares(path) && !(points_[path].kind & kApart); }
  /// How densely, by area, a point's rays lie at x, times π.
  static double density(const Point& from, Vec3d x, Vec3d g) {
    const Vec3d to = x - from.x;
    const double d2 = dot(to, to);
    return std::max(dot(from.n, to), 0.0) * std::fabs(dot(g, to)) / (d2 * d2);
  }
  void join(uint32_t path, size_t block);

  std::vector<Point> points_;
  std::vector<Group> groups_;
  std::vector<uint32_t> group_;                // of each path
  std::vector<std::vector<uint32_t>> blocks_;  // groups of each block of a tile
};

}  // namespace glint
