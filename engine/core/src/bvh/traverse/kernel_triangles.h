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
  const float* at(int corner, int axis) const {
    return p + ptrdiff_t(axis) * n + ptrdiff_t(corner) * (3 * n);
  }
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

/// A triangle each of kFloats rays, in registers.
struct Picked {
  Floats corner[9];  // coordinate a of corner j: 3 j + a
  Ints instance, primitive;

  /// Those of some rays, places in leaves; others get any. axes: which coordinates. Processors pick
  /// from a leaf's rows, for all rays whose triangles are in it, sooner than they gather.
  __attribute__((always_inline)) Picked(const TreeView& tree, const uint32_t* leaves,
                                        const uint32_t* places, uint32_t rays,
                                        const int (&axes)[3]) {
    const Ints leaf_of = load(leaves), place = load(places) & 7;  // others may have any place
    const float* const ids = reinterpret_cast<const float*>(tree.ids);
#if defined(__AVX2__)
    const Ints twice = 2 * place;
    const auto add = [&](ChildRef ref, auto keep) {
      const Triangles leaf(tree, ref);
      const float* const id = ids + 2 * size_t(leaf_first(ref));
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < 3; ++a)
          corner[3 * j + a] = keep(corner[3 * j + a], pick(leaf.at(j, axes[a]), place));
      instance = Ints(keep(Floats(instance), pick_of_two(id, twice)));
      primitive = Ints(keep(Floats(primitive), pick_of_two(id, twice + 1)));
    };
    ChildRef ref = leaves[__builtin_ctz(rays)];
    add(ref, [](Floats, Floats picked) { return picked; });
    while (rays &= ~bits(equal(leaf_of, Ints{} + int32_t(ref)))) {
      ref = leaves[__builtin_ctz(rays)];
      const FloatMask same = equal(leaf_of, Ints{} + int32_t(ref));
      add(ref, [&](Floats old, Floats picked) { return choose(same, picked, old); });
    }
#else
    const Ints some = leaf_of != Ints{}, n = ((leaf_of >> kCountShift & 7) + 1) & some,
               first = leaf_of & some & int32_t(kOrdinal), at = place & some;
    for (int a = 0; a < 3; ++a)
      for (int j = 0; j < 3; ++j)
        corner[3 * j + a] = read_at(tree.floats, 9 * first + at + (3 * j + axes[a]) * n);
    instance = Ints(read_at(ids, 2 * (first + at)));
    primitive = Ints(read_at(ids, 2 * (first + at) + 1));
    static_cast<void>(rays);
#endif
  }
};

}  // namespace
}  // namespace glint
