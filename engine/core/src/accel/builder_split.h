// One range of boxes in two: binned surface area heuristic (Wald 2007, On fast Construction of SAH-based Bounding Volume Hierarchies).
#pragma once
#include <algorithm>

#include "bounds.h"

namespace glint {

constexpr int kMaxBins = 32;

/// Boxes [begin, end): refs, or clusters of them. Below them are refs [first, first + weight) of the tree.
struct Range {
  size_t begin = 0, end = 0, first = 0, weight = 0;
  Box box;
  size_t count() const { return end - begin; }
};

/// Which bin a centroid falls into along each axis.
struct BinMap {
  F4 origin, scale, last;
  int count;

  BinMap(const Box& centroids, size_t refs) : origin(centroids.lo), scale(splat(0)), count(int(std::min<size_t>(kMaxBins, 4 + refs / 16))) {
    for (int k = 0; k < 3; ++k) {
      const float extent = centroids.hi[k] - centroids.lo[k];
      if (extent > 1e-35f && extent <= std::numeric_limits<float>::max()) scale[k] = 0.9999f * float(count) / extent;
    }
    last = splat(float(count - 1));
  }
  /// A bin for every axis; NaN, from an infinite extent, gives 0.
  I4 operator()(const Ref& r) const {
    return __builtin_convertvector(lower(upper((centroid(r) - origin) * scale, F4{}), last), I4);
  }
  /// Whether the bin along `axis` is one below `bin`, which is neither the first one nor beyond the last.
  bool below(const Ref& r, int axis, int bin) const {
    return !((0.5f * r.lo[axis] + 0.5f * r.hi[axis] - origin[axis]) * scale[axis] >= float(bin));
  }
};

struct Bins {
  Box box[3][kMaxBins];
  uint32_t count[3][kMaxBins];

  void clear(int bins) {
    for (int k = 0; k < 3; ++k) std::fill_n(box[k], bins, Box{}), std::fill_n(count[k], bins, 0u);
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
  const double x = double(b.hi[0]) - double(b.lo[0]), y = double(b.hi[1]) - double(b.lo[1]), z = double(b.hi[2]) - double(b.lo[2]);
  const double a = x * (y + z) + y * z;
  return a > 0 ? a : 0;
}

}  // namespace glint
