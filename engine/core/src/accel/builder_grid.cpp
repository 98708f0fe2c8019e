#include "builder_grid.h"

#include <bit>

#include "builder.h"

namespace glint {
namespace {

constexpr int kMaxBits = 5;          // of a cell's number along an axis: 37449 cells of all sizes, which fit 16 bits
constexpr size_t kCluster = 16;      // refs: neighbouring cells are joined up to this many
constexpr size_t kSingle = 4096;     // refs: so many of the largest become clusters of their own
constexpr size_t kChunk = 16384;

/// Spreads the low bits of a number to every third bit.
uint32_t spread(uint32_t x) {
  x = (x | x << 8) & 0x0300f00f;
  x = (x | x << 4) & 0x030c30c3;
  return (x | x << 2) & 0x09249249;
}

/// Cells of 2^bits along each axis at level 0, half as many at each further level, numbered level by level in Morton order.
class Grid {
 public:
  Grid(const Box& centroids, size_t refs, bool by_size) : origin_(centroids.lo), scale_(splat(0)), by_size_(by_size) {
    while (bits_ < kMaxBits && (size_t(4) << 3 * bits_) < refs) ++bits_;
    for (int k = 0; k < 3; ++k) {
      const float extent = centroids.hi[k] - centroids.lo[k];
      if (extent > 1e-35f && extent <= std::numeric_limits<float>::max()) scale_[k] = 0.9999f * float(1 << bits_) / extent;
    }
    for (int level = 0; level <= bits_; ++level) first_[level + 1] = first_[level] + (1u << 3 * (bits_ - level));
  }
  int bits() const { return bits_; }
  uint32_t cells() const { return first_[bits_ + 1]; }
  uint32_t first(int level) const { return first_[level]; }

  uint32_t operator()(const Ref& r) const {
    const I4 mask{-1, -1, -1, 0};
    const F4 last = splat(float((1 << bits_) - 1));
    const I4 cell = __builtin_convertvector(lower(upper((centroid(r) - origin_) * scale_, F4{}), last), I4);
    const F4 size = (F4(I4(high(r)) & mask) - F4(I4(low(r)) & mask)) * scale_;
    const int level = by_size_ ? level_of(std::max({size[0], size[1], size[2]})) : 0;
    return first_[level] + (spread(uint32_t(cell[0] >> level)) | spread(uint32_t(cell[1] >> level)) << 1 |
                            spread(uint32_t(cell[2] >> level)) << 2);
  }

 private:
  /// The first level whose cells are not smaller than `size`, measured in cells of level 0.
  int level_of(float size) const {
    if (!(size > 1)) return 0;
    const int exponent = int(std::bit_cast<uint32_t>(size) >> 23) - 126;
    return std::min(exponent, bits_);
  }

  F4 origin_, scale_;
  int bits_ = 1;
  bool by_size_;
  uint32_t first_[kMaxBits + 2] = {};
};

/// How a loop over a range is shared out: the same parts for counting and for moving.
struct Parts {
  size_t begin, end, count, each;
  Parts(const Range& r, Team& team)
      : begin(r.begin), end(r.end), count(std::min((r.count() + kChunk - 1) / kChunk, 4 * team.size())),
        each((r.count() + count - 1) / count) {}
  size_t first(size_t part) const { return std::min(end, begin + part * each); }
};

Box centroid_box(const Ref* refs, const Parts& parts, Team& team) {
  std::vector<Box> part(parts.count);
  team.run(parts.count, [&](size_t g) {
    for (size_t k = parts.first(g); k < parts.first(g + 1); ++k) part[g].add(centroid(refs[k]));
  });
  Box box;
  for (const Box& b : part) box.add(b);
  return box;
}

/// Moves refs[range) to scratch, cell by cell, in their old order within a cell. start[c], start[c + 1]: where cell c lies.
std::vector<size_t> sort_by_cell(const Ref* refs, Ref* scratch, const Grid& grid, const Parts& parts, Team& team) {
  Buffer<uint16_t> cell(parts.end - parts.begin);
  std::vector<std::vector<uint32_t>> counts(parts.count);
  team.run(parts.count, [&](size_t g) {
    counts[g].assign(grid.cells(), 0);
    for (size_t k = parts.first(g); k < parts.first(g + 1); ++k) {
      const uint32_t c = grid(refs[k]);
      cell[k - parts.begin] = uint16_t(c), ++counts[g][c];
    }
  });
  std::vector<size_t> start(grid.cells() + 1);
  size_t at = parts.begin;
  for (uint32_t c = 0; c < grid.cells(); ++c) {
    start[c] = at;
    for (auto& part : counts) {
      const uint32_t n = part[c];
      part[c] = uint32_t(at - parts.begin), at += n;
    }
  }
  start.back() = at;
  team.run(parts.count, [&](size_t g) {
    uint32_t* next = counts[g].data();
    for (size_t k = parts.first(g); k < parts.first(g + 1); ++k) scratch[parts.begin + next[cell[k - parts.begin]]++] = refs[k];
  });
  return start;
}

/// Cells [first, first + count) of one level as clusters: together if they hold few refs, else by eighths.
void gather(const std::vector<size_t>& start, uint32_t first, uint32_t count, std::vector<Ref>& clusters) {
  const size_t refs = start[first + count] - start[first];
  if (refs == 0) return;
  if (refs <= kCluster || count == 1) {
    clusters.push_back({{}, uint32_t(start[first]), {}, uint32_t(refs)});
    return;
  }
  for (uint32_t k = 0; k < 8; ++k) gather(start, first + k * (count / 8), count / 8, clusters);
}

/// body(c) for every cluster, in pieces shared by the team.
template <class Body>
void each_cluster(size_t count, Team& team, Body body) {
  const size_t pieces = std::min<size_t>(count, 64);
  team.run(pieces, [&](size_t g) {
    for (size_t c = count * g / pieces; c < count * (g + 1) / pieces; ++c) body(c);
  });
}

std::vector<Ref> clusters_of(const Ref* refs, Ref* scratch, const Grid& grid, const Parts& parts, Team& team) {
  const std::vector<size_t> start = sort_by_cell(refs, scratch, grid, parts, team);
  std::vector<Ref> clusters;
  int level = 0;
  for (; level <= grid.bits() && parts.end - start[grid.first(level)] > kSingle; ++level)
    gather(start, grid.first(level), grid.first(level + 1) - grid.first(level), clusters);
  for (size_t k = start[grid.first(level)]; k < parts.end; ++k) clusters.push_back({{}, uint32_t(k), {}, 1});
  each_cluster(clusters.size(), team, [&](size_t c) {
    const size_t first = clusters[c].primitive, count = clusters[c].source;
    Box box;
    for (size_t k = first; k < first + count; ++k) box.add(Box{low(scratch[k]), high(scratch[k])});
    clusters[c] = make_ref(box, uint32_t(first), uint32_t(count));
  });
  return clusters;
}

}  // namespace

std::vector<Ref> make_clusters(const Ref* refs, Ref* scratch, const Range& range, Team& team) {
  const Parts parts(range, team);
  const Box centroids = centroid_box(refs, parts, team);
  std::vector<Ref> clusters = clusters_of(refs, scratch, Grid(centroids, range.count(), true), parts, team);
  const auto lighter = [](const Ref& a, const Ref& b) { return a.source < b.source; };
  if (std::max_element(clusters.begin(), clusters.end(), lighter)->source > range.count() / 2)  // all large: by their place alone
    clusters = clusters_of(refs, scratch, Grid(centroids, range.count(), false), parts, team);
  return clusters;
}

std::vector<size_t> gather_clusters(Ref* refs, const Ref* scratch, size_t begin, const std::vector<Ref>& clusters, Team& team) {
  std::vector<size_t> at(clusters.size() + 1, begin);
  for (size_t c = 0; c < clusters.size(); ++c) at[c + 1] = at[c] + clusters[c].source;
  each_cluster(clusters.size(), team, [&](size_t c) { std::copy_n(scratch + clusters[c].primitive, clusters[c].source, refs + at[c]); });
  return at;
}

}  // namespace glint
