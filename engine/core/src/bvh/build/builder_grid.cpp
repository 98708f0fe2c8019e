#include "bvh/build/builder_grid.h"

#include <bit>

#include "bvh/build/builder.h"

namespace glint {
namespace {

constexpr int kMaxBits = 15;     // of a cell's number: 37449 cells of all sizes, which fit 16 bits
constexpr int kMaxAxisBits = 8;  // of them along one axis
constexpr size_t kSingle =
    4096;  // refs: so many of the largest, or a quarter of all, become clusters of their own
constexpr size_t kChunk = 16384;

/// Cells as near to cubes as halving gives: their longest side is halved `bits` times in turn. A
/// cell's number has a bit for every halving, the first one highest. At each further level three
/// halvings less; levels are numbered one after the other.
class Grid {
 public:
  Grid(const Box& centroids, size_t refs, size_t limit, bool by_size)
      : origin_(centroids.lo), scale_(splat(0)), last_(splat(0)), by_size_(by_size) {
    const int bits = std::clamp(int(std::bit_width(4 * refs / limit)), 3, kMaxBits);
    int axis_of[kMaxBits], halvings[3] = {};
    float side[3];
    for (int k = 0; k < 3; ++k) {
      side[k] = centroids.hi[k] - centroids.lo[k];
      if (!(side[k] > 1e-35f && side[k] <= std::numeric_limits<float>::max())) side[k] = 0;
    }
    for (; bits_ < bits; ++bits_) {
      const int axis = longest(side, halvings);
      if (axis < 0) break;
      axis_of[bits_] = axis;
      ++halvings[axis];
      side[axis] *= 0.5f;
    }
    for (int k = 0; k < 3; ++k) {
      const int cells = 1 << halvings[k];
      if (side[k] > 0) scale_[k] = 0.9999f / side[k];
      last_[k] = float(cells - 1);
    }
    inverse_side_ = 1 / std::max({side[0], side[1], side[2]});
    name_cells(axis_of);
    for (int level = 0; level <= levels(); ++level)
      first_[level + 1] = first_[level] + (1u << (bits_ - std::min(bits_, 3 * level)));
  }
  /// The number of the last level: one cell.
  int levels() const { return (bits_ + 2) / 3; }
  uint32_t cells() const { return first_[levels() + 1]; }
  uint32_t first(int level) const { return first_[level]; }

  uint32_t operator()(const Ref& r) const {
    const I4 cell =
        __builtin_convertvector(lower(upper((centroid(r) - origin_) * scale_, F4{}), last_), I4);
    const uint32_t name = uint32_t(name_[0][cell[0]] | name_[1][cell[1]] | name_[2][cell[2]]);
    if (!by_size_) return name;
    const F4 size = extent({low(r), high(r)});
    const int level = level_of(std::max({size[0], size[1], size[2]}) * inverse_side_);
    return first_[level] + (name >> 3 * level);
  }

 private:
  static int longest(const float (&side)[3], const int (&halvings)[3]) {
    int best = -1;
    for (int k = 0; k < 3; ++k)
      if (side[k] > 0 && halvings[k] < kMaxAxisBits && (best < 0 || side[k] > side[best])) best = k;
    return best;
  }
  /// name_[axis][c]: the bits that cell c along an axis gives to a cell's number.
  void name_cells(const int* axis_of) {
    int bit[3] = {};
    for (int k = bits_ - 1; k >= 0; --k) {
      const int axis = axis_of[k], low = 1 << bit[axis]++;
      for (int c = 0; c < low; ++c)
        name_[axis][low + c] = uint16_t(name_[axis][c] | 1 << (bits_ - 1 - k));
    }
  }
  /// The first level whose cells are not smaller than `size`, measured in cells of level 0.
  int level_of(float size) const {
    if (!(size > 1)) return 0;
    const int exponent = int(std::bit_cast<uint32_t>(size) >> 23) - 126;
    return std::min(exponent, levels());
  }

  F4 origin_, scale_, last_;
  float inverse_side_ = 0;
  int bits_ = 0;
  bool by_size_;
  uint16_t name_[3][1 << kMaxAxisBits] = {};
  uint32_t first_[kMaxBits / 3 + 2] = {};
};

/// How a loop over a range is shared out: the same parts for counting and for moving.
struct Parts {
  size_t begin, end, count, each;
  Parts(const Range& r, ThreadPool& pool)
      : begin(r.begin),
        end(r.end),
        count(std::min((r.count() + kChunk - 1) / kChunk, 4 * pool.size())),
        each((r.count() + count - 1) / count) {}
  size_t first(size_t part) const { return std::min(end, begin + part * each); }
};

Box centroid_box(const Ref* refs, const Parts& parts, ThreadPool& pool) {
  std::vector<Box> part(parts.count);
  pool.run(parts.count, [&](size_t g) {
    for (size_t k = parts.first(g); k < parts.first(g + 1); ++k) part[g].add(centroid(refs[k]));
  });
  Box box;
  for (const Box& b : part) box.add(b);
  return box;
}

/// Moves refs[range) to scratch, cell by cell, in their old order within a cell. start[c], start[c
/// + 1]: where cell c lies.
std::vector<size_t> sort_by_cell(const Ref* refs, Ref* scratch, const Grid& grid,
                                 const Parts& parts, ThreadPool& pool) {
  Buffer<uint16_t> cell(parts.end - parts.begin);
  std::vector<std::vector<uint32_t>> counts(parts.count);
  pool.run(parts.count, [&](size_t g) {
    counts[g].assign(grid.cells(), 0);
    for (size_t k = parts.first(g); k < parts.first(g + 1); ++k) {
      const uint32_t c = grid(refs[k]);
      cell[k - parts.begin] = uint16_t(c);
      ++counts[g][c];
    }
  });
  std::vector<size_t> start(grid.cells() + 1);
  size_t at = parts.begin;
  for (uint32_t c = 0; c < grid.cells(); ++c) {
    start[c] = at;
    for (auto& part : counts) {
      const uint32_t n = part[c];
      part[c] = uint32_t(at - parts.begin);
      at += n;
    }
  }
  start.back() = at;
  pool.run(parts.count, [&](size_t g) {
    uint32_t* next = counts[g].data();
    for (size_t k = parts.first(g); k < parts.first(g + 1); ++k)
      scratch[parts.begin + next[cell[k - parts.begin]]++] = refs[k];
  });
  return start;
}

/// Cells [first, first + count) of one level as clusters: together if they hold at most `limit`
/// refs, else by halves.
void gather(const std::vector<size_t>& start, uint32_t first, uint32_t count, size_t limit,
            std::vector<Ref>& clusters) {
  const size_t refs = start[first + count] - start[first];
  if (refs == 0) return;
  if (refs <= limit || count == 1) {
    clusters.push_back({{}, uint32_t(start[first]), {}, uint32_t(refs)});
    return;
  }
  gather(start, first, count / 2, limit, clusters);
  gather(start, first + count / 2, count / 2, limit, clusters);
}

/// body(c) for every cluster, in pieces shared by the pool.
template <class Body>
void each_cluster(size_t count, ThreadPool& pool, Body body) {
  const size_t pieces = std::min<size_t>(count, 64);
  pool.run(pieces, [&](size_t g) {
    for (size_t c = count * g / pieces; c < count * (g + 1) / pieces; ++c) body(c);
  });
}

std::vector<Ref> clusters_of(const Ref* refs, Ref* scratch, const Grid& grid, const Parts& parts,
                             size_t limit, ThreadPool& pool) {
  const std::vector<size_t> start = sort_by_cell(refs, scratch, grid, parts, pool);
  std::vector<Ref> clusters;
  const size_t single = std::min(kSingle, (parts.end - parts.begin) / 4);
  int level = 0;
  for (; level <= grid.levels() && parts.end - start[grid.first(level)] > single; ++level)
    gather(start, grid.first(level), grid.first(level + 1) - grid.first(level), limit, clusters);
  for (size_t k = start[grid.first(level)]; k < parts.end; ++k)
    clusters.push_back({{}, uint32_t(k), {}, 1});
  each_cluster(clusters.size(), pool, [&](size_t c) {
    const size_t first = clusters[c].primitive, count = clusters[c].source;
    Box box;
    for (size_t k = first; k < first + count; ++k) box.add(Box{low(scratch[k]), high(scratch[k])});
    clusters[c] = make_ref(box, uint32_t(first), uint32_t(count));
  });
  return clusters;
}

}  // namespace

std::vector<Ref> make_clusters(const Ref* refs, Ref* scratch, const Range& range, size_t limit,
                               ThreadPool& pool) {
  const Parts parts(range, pool);
  const Box centroids = centroid_box(refs, parts, pool);
  std::vector<Ref> clusters =
      clusters_of(refs, scratch, Grid(centroids, range.count(), limit, true), parts, limit, pool);
  const auto lighter = [](const Ref& a, const Ref& b) { return a.source < b.source; };
  if (std::max_element(clusters.begin(), clusters.end(), lighter)->source >
      range.count() / 2)  // all large: by their place alone
    clusters = clusters_of(refs, scratch, Grid(centroids, range.count(), limit, false), parts,
                           limit, pool);
  return clusters;
}

std::vector<size_t> sort_into_cells(Ref* refs, Ref* scratch, const Range& range, size_t limit,
                                    ThreadPool& pool) {
  const Parts parts(range, pool);
  const Grid grid(centroid_box(refs, parts, pool), range.count(), limit, false);
  std::vector<size_t> start = sort_by_cell(refs, scratch, grid, parts, pool);
  std::copy(scratch + range.begin, scratch + range.end, refs + range.begin);
  start.erase(start.begin() + grid.first(1), start.end() - 1);
  return start;
}

void gather_clusters(Ref* refs, const Ref* scratch, size_t begin, const std::vector<Ref>& clusters,
                     ThreadPool& pool) {
  std::vector<size_t> at(clusters.size() + 1, begin);
  for (size_t c = 0; c < clusters.size(); ++c) at[c + 1] = at[c] + clusters[c].source;
  each_cluster(clusters.size(), pool, [&](size_t c) {
    std::copy_n(scratch + clusters[c].primitive, clusters[c].source, refs + at[c]);
  });
}

}  // namespace glint
