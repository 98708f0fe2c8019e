// One range of boxes in two: binned surface area heuristic (Wald 2007, On fast Construction of
// SAH-based Bounding Volume Hierarchies).
#pragma once
#include <algorithm>

#include "bvh/bounds.h"

namespace glint {

constexpr int kMaxBins = 32;

/// Boxes [begin, end): refs, or clusters of them. Below them are refs [first, first + weight) of
/// the tree.
struct Range {
  size_t begin = 0, end = 0, first = 0, weight = 0;
  Box box;
  size_t count() const { return end - begin; }
};

/// Which bin a centroid falls into along each axis.
struct BinMap {
  F4 origin, scale, last;
  int count;

  BinMap(const Box& centroids, size_t refs)
      : origin(centroids.lo),
        scale(splat(0)),
        count(int(std::min<size_t>(kMaxBins, 4 + refs / 16))) {
    for (int k = 0; k < 3; ++k) {
      const float extent = centroids.hi[k] - centroids.lo[k];
      if (extent > 1e-35f && extent <= std::numeric_limits<float>::max())
        scale[k] = 0.9999f * float(count) / extent;
    }
    last = splat(float(count - 1));
  }
  /// A bin for every axis; NaN, from an infinite extent, gives 0.
  I4 operator()(const Ref& r) const {
    return __builtin_convertvector(lower(upper((centroid(r) - origin) * scale, F4{}), last), I4);
  }
  /// Whether the bin along `axis` is one below `bin`, which is neither the first one nor beyond the
  /// last.
  bool below(const Ref& r, int axis, int bin) const {
    return !((0.5f * r.lo[axis] + 0.5f * r.hi[axis] - origin[axis]) * scale[axis] >= float(bin));
  }
};

/// What a ref weighs: itself, or all that its cluster holds.
struct Single {
  static uint32_t weight(const Ref&) { return 1; }
};
struct Cluster {
  static uint32_t weight(const Ref& r) { return r.source; }
};

struct Bins {
  Box box[3][kMaxBins];
  uint32_t count[3][kMaxBins];

  void clear(int bins) {
    for (int k = 0; k < 3; ++k) {
      std::fill_n(box[k], bins, Box{});
      std::fill_n(count[k], bins, 0u);
    }
  }
  template <class Weight>
  void fill(const Ref* first, const Ref* last, const BinMap& map) {
    clear(map.count);
    for (const Ref* p = first; p != last; ++p) {
      const I4 b = map(*p);
      const Box all{low(*p), high(*p)};
      for (int k = 0; k < 3; ++k) {
        box[k][b[k]].add(all);
        count[k][b[k]] += Weight::weight(*p);
      }
    }
  }
};

/// Refs whose bin along `axis` is below `bin` go left. Axis -1: no split found.
struct Split {
  int axis = -1, bin = 0;
  float cost = std::numeric_limits<float>::infinity();
  size_t left = 0;
  Box left_box, right_box;
};

/// Half the surface; 0 where that is not a number.
inline double half_area(const Box& b) {
  const double x = double(b.hi[0]) - double(b.lo[0]), y = double(b.hi[1]) - double(b.lo[1]),
               z = double(b.hi[2]) - double(b.lo[2]);
  const double a = x * (y + z) + y * z;
  return a > 0 ? a : 0;
}

/// Half the surfaces of three boxes of a range, in units that make the range's own extents at most
/// 1: lane k is that of box[k].
struct Areas {
  F4 unit;
  explicit Areas(const Box& range) {
    const F4 e = extent(range);
    const float longest = std::max({e[0], e[1], e[2], std::numeric_limits<float>::min()});
    unit = splat(longest <= std::numeric_limits<float>::max() ? 1 / longest : 0);
  }
  F4 operator()(const Box (&box)[3]) const {
    const F4 p = extent(box[0]) * unit, q = extent(box[1]) * unit, r = extent(box[2]) * unit;
    const F4 x{p[0], q[0], r[0], 0}, y{p[1], q[1], r[1], 0}, z{p[2], q[2], r[2], 0};
    return x * (y + z) + y * z;
  }
};

/// What lies on one side of a bin along each axis.
struct Grown {
  Box box[3];
  F4 weight{};
  void add(const Bins& bins, int b) {
    for (int k = 0; k < 3; ++k) box[k].add(bins.box[k][b]);
    weight += F4{float(bins.count[0][b]), float(bins.count[1][b]), float(bins.count[2][b]), 0};
  }
};

/// The cheapest split of a range. Costs that are not numbers, from a side without boxes or from
/// infinite extents, are never the cheapest.
inline Split best_split(const Bins& bins, const BinMap& map, const Areas& areas) {
  F4 right_cost[kMaxBins], lowest = splat(std::numeric_limits<float>::infinity());
  I4 at{};
  Grown right, left;
  for (int b = map.count - 1; b > 0; --b) {
    right.add(bins, b);
    right_cost[b] = areas(right.box) * right.weight;
  }
  for (int b = 1; b < map.count; ++b) {
    left.add(bins, b - 1);
    const F4 cost = areas(left.box) * left.weight + right_cost[b];
    const I4 lower_here = cost < lowest;
    lowest = F4((I4(cost) & lower_here) | (I4(lowest) & ~lower_here));
    at = (lower_here & b) | (at & ~lower_here);
  }
  Split best;
  for (int k = 0; k < 3; ++k)
    if (lowest[k] < best.cost) {
      best.axis = k;
      best.bin = at[k];
      best.cost = lowest[k];
    }
  if (best.axis < 0) return best;
  for (int b = 0; b < map.count; ++b)
    (b < best.bin ? best.left_box : best.right_box).add(bins.box[best.axis][b]);
  for (int b = 0; b < best.bin; ++b) best.left += bins.count[best.axis][b];
  return best;
}

inline Box centroid_box(const Ref* first, const Ref* last) {
  Box box;
  for (const Ref* r = first; r != last; ++r) box.add(centroid(*r));
  return box;
}
inline Box ref_box(const Ref* first, const Ref* last) {
  Box box;
  for (const Ref* r = first; r != last; ++r) box.add(Box{low(*r), high(*r)});
  return box;
}

}  // namespace glint
