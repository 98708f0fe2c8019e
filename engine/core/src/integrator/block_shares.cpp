#include "integrator/block_shares.h"

#include <algorithm>

#include "film/film.h"
#include "math/math.h"

namespace glint {
namespace {

constexpr double kAlike = 0.97;  // least cosine between normals of one surface
constexpr double kSharp = 0.18;  // of 1 less that, over the exponent of a lobe, the most
constexpr double kFlat = 0.04;   // of the way between its points, squared, the most along these

/// Along an axis the ends of a region, and of those of its pixels that are traced to the end.
struct Axis {
  uint32_t begin, inner_begin, inner_end, end;
  /// In its tile, of the pixel p. Blocks end where tiles do, and where those pixels do.
  uint32_t number_of_block(uint32_t p, int moved, uint32_t side) const {
    const uint32_t tile = begin + (p - begin) / Tile::kSize * Tile::kSize;
    const bool after_begin = p >= inner_begin, after_end = p >= inner_end;
    const uint32_t first = std::max(tile, after_end     ? inner_end
                                          : after_begin ? inner_begin
                                                        : begin),
                   stop = std::min(tile + Tile::kSize, after_end     ? end
                                                       : after_begin ? inner_end
                                                                     : inner_begin);
    const int64_t at = std::clamp(int64_t(p) + moved, int64_t(first), int64_t(stop) - 1);
    return uint32_t(at) / side - tile / side + after_begin + after_end;
  }
};

}  // namespace

void BlockShares::set(const RenderPlan& plan, const Batch& batch,
                      const std::vector<uint32_t>& pixels, const BlockGrid& grid,
                      const std::vector<Vec3d>& given, const std::vector<uint8_t>* apart,
                      const std::vector<double>* exponents) {
  const Region region = plan.region, inner = plan.traced;
  const Axis columns{region.x0, inner.x0, inner.x1, region.x1},
      rows{region.y0, inner.y0, inner.y1, region.y1};
  const uint32_t width = region.width(), across = Tile::kSize / grid.side + 3;
  points_.resize(batch.size());
  group_.resize(batch.size());
  groups_.clear();
  blocks_.resize(size_t(across) * across);
  for (std::vector<uint32_t>& block : blocks_) block.clear();
  for (uint32_t k = 0; k < batch.size(); ++k) {
    uint8_t kind = apart && (*apart)[k] ? kApart : 0;
    for (int c = 0; c < 3; ++c) kind |= uint8_t((std::fabs(given[k][c]) >= kLeast) << c);
    const bool shares = kind & kChannels;
    points_[k] = {row(batch.points.x, k),
                  row(batch.points.n, k),
                  shares ? given[k] : Vec3d{1, 1, 1},
                  exponents ? std::max(kAlike, 1 - kSharp / (*exponents)[k]) : kAlike,
                  kind,
                  0};
    const uint32_t x = region.x0 + pixels[k] % width, y = region.y0 + pixels[k] / width,
                   column = columns.number_of_block(x, grid.left, grid.side),
                   line = rows.number_of_block(y, grid.down, grid.side);
    if (shares) join(k, line * across + column);
    else {
      group_[k] = uint32_t(groups_.size());
      groups_.push_back({1, {k}});
    }
  }
}

void BlockShares::pool(double* const* columns) const {
  for (const Group& group : groups_) {
    if (group.count == 1 || !shares_points(group.paths[0])) continue;
    for (int c = 0; c < 3; ++c) {
      if (std::fabs(points_[group.paths[0]].given[c]) < kLeast) continue;
      double sum = 0;
      for (uint32_t k = 0; k < group.count; ++k)
        sum += columns[c][group.paths[k]] / points_[group.paths[k]].given[c];
      for (uint32_t k = 0; k < group.count; ++k)
        columns[c][group.paths[k]] = sum * points_[group.paths[k]].given[c];
    }
  }
}

void BlockShares::mix(size_t c, uint32_t sample, const double* from, double* to) const {
  for (const Group& group : groups_) {
    if (std::fabs(points_[group.paths[0]].given[int(c)]) < kLeast) continue;
    double sum = 0, count = 0;
    for (uint32_t k = 0; k < group.count; ++k) {
      const uint32_t path = group.paths[k];
      if (turn(path, sample) == kWaits) continue;
      sum += from[path] / points_[path].given[int(c)];
      ++count;
    }
    for (uint32_t k = 0; k < group.count; ++k) {
      const uint32_t path = group.paths[k];
      to[path] += points_[path].given[int(c)] * (sum / count);
    }
  }
}

/// Adds the point to the first group of the block whose first point is on its surface.
void BlockShares::join(uint32_t path, size_t block) {
  const Point& point = points_[path];
  for (const uint32_t number : blocks_[block]) {
    Group& group = groups_[number];
    const Point& other = points_[group.paths[0]];
    const Vec3d way = point.x - other.x;
    const double along = dot(way, point.n), beside = dot(way, other.n),
                 flat = kFlat * dot(way, way);
    if (point.kind == other.kind && dot(point.n, other.n) >= std::max(point.least, other.least) &&
        along * along <= flat && beside * beside <= flat) {
      points_[path].place = uint8_t(group.count);
      group.paths[group.count++] = path;
      group_[path] = number;
      return;
    }
  }
  group_[path] = uint32_t(groups_.size());
  blocks_[block].push_back(group_[path]);
  groups_.push_back({1, {path}});
}

}  // namespace glint
