// The triangles of a leaf, as they lie in memory and as rays see them.
#pragma once
#include "bvh/traverse/kernel_coherent.h"

namespace glint {
namespace {

inline uint32_t leaf_first(ChildRef leaf) { return leaf & kOrdinal; }
inline int leaf_count(ChildRef leaf) { return int(leaf >> kCountShift & 7) + 1; }

/// The triangles of one leaf: n floats for each coordinate.
struct Triangles {
  const float* p;
  int n;
  Triangles(const TreeView& tree, ChildRef leaf)
      : p(tree.floats + 9 * size_t(leaf_first(leaf))), n(leaf_count(leaf)) {}
  const float* at(int corner, int axis) const { return p + (3 * corner + axis) * n; }
};

/// A point in the rays' order and sense, as the sum of two floats.
struct Origin {
  float o[3], low_part[3];
};

/// Coordinates of the triangles [first, first + kFloats) of a leaf, corner by corner, in the rays'
/// order and sense, from `from`.
__attribute__((always_inline)) inline void corners_from(const Origin& from, const Triangles& leaf,
                                                        int first, const Order& order,
                                                        Floats (&p)[9]) {
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) {
      const Floats v = load(leaf.at(j, order.axes[a]) + first);
      p[3 * j + a] =
          (a == 2 ? v * splat(order.sign) : v) - splat(from.o[a]) - splat(from.low_part[a]);
    }
}

}  // namespace
}  // namespace glint
