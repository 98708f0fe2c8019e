// A tile on its way through a tree: what all phases of a traversal share.
#pragma once
#include "bvh/traverse/kernel_boxes.h"
#include "bvh/traverse/kernel_triangles.h"

namespace glint {
namespace {

inline PrimitiveId id_of(const Tile& tile, int r, uint32_t ordinal) {
  PrimitiveId id = tile.tree->ids[ordinal];
  if (tile.instances) id.instance = tile.instances[r];
  return id;
}
/// Instances were asked before.
inline bool visible(const Tile& tile, uint32_t ordinal) {
  const Answers& a = *tile.answers;
  return !a.masks || tile.instances ||
         (a.masks[tile.tree->ids[ordinal].instance] & a.visibility) != 0;
}

/// One triangle as a ray sees it. o, shear: of the ray, in its order.
__attribute__((always_inline)) inline Exact<double> seen(const Triangles& triangles, int place,
                                                         const Order& order, const double (&o)[3],
                                                         const double (&shear)[2]) {
  double corner[3][3];
  for (int j = 0; j < 3; ++j)
    for (int k = 0; k < 3; ++k) corner[j][k] = double(triangles.at(j, order.axes[k])[place]);
  Exact<double> e;
  e.see(corner, o, shear);
  return e;
}
/// The hit of one that a ray hits. close: Tile::close.
inline void weigh(Exact<double>& e, double close) {
  e.weigh();
  if (!(magnitude(e.off_x) <= close && magnitude(e.off_y) <= close)) weigh_edges(e);
}

/// A tile on its way through a tree.
template <bool Any>
struct Walk {
  const TopLevelView& world;
  const TreeView& tree;
  Tile& tile;
  Packet& packet;
  BoxRays& boxes;
  SingleRays& left;

  void block(int r) {
    tile.answers->blocked[tile.slot[r]] = tile.answers->stop();
    tile.lo[r] = tile.hi[r] = -kFar;
  }
  /// After a change of answers.
  void update(int r) {
    if (!Any) refresh(tile, r);
    else if (tile.answers->blocked[tile.slot[r]] == tile.answers->stop()) block(r);
  }
  /// The packet's part of it; of rays that look for any hit it asks who is alive. (All at once: a
  /// processor waits before it reads a vector of which it has just written a part.)
  void trim(int r) {
    if (Any) return;
    float* last = packet.last + r / kBroad * kBroad;
    const Broad old = load_broad(last), end = spread(tile.start[r] + tile.hi[r] + tile.margin);
    store_broad(last, choose(broad_lanes(1u << r % kBroad), smaller(end, old), old));
  }

  Exact<double> seen(int r, ChildRef leaf, int place) const {
    return glint::seen(Triangles(tree, leaf), place, order_of(tile, r),
                       {tile.o[0][r], tile.o[1][r], tile.o[2][r]},
                       {tile.shear[0][r], tile.shear[1][r]});
  }
  void take(int r, ChildRef leaf, int place) {
    Exact<double> e = seen(r, leaf, place);
    if (!e.hit()) return;
    weigh(e, tile.close);
    const PrimitiveId id = id_of(tile, r, leaf_first(leaf) + uint32_t(place));
    if (tile.answers->template accept<Any>(tile.slot[r], e.depth / tile.along[r], e.u, e.v, id) &&
        Any)
      block(r);
  }
  /// Decides in double whether a ray hits a triangle, and nearer than its best hit so far.
  __attribute__((noinline)) void decide(int r, ChildRef leaf, int place) {
    if (tile.pending[r] != kNothing) take(r, tile.pending[r], int(tile.place[r]));
    tile.pending[r] = kNothing;
    take(r, leaf, place);
    update(r);
  }
};

}  // namespace
}  // namespace glint
