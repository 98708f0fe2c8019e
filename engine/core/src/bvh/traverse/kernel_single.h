// Rays through a tree each on its own, nearest boxes first. Several are on their way at a time: a
// processor that waits for the box or the triangle of one of them has work with the others.
#pragma once
#include "bvh/traverse/kernel_leaves.h"

namespace glint {
namespace {

/// Decides or takes the triangles of `mask`, not culled, whose depths are between lo and hi.
/// `sure`: hit without doubt.
template <bool Any>
__attribute__((noinline)) void take_triangles(Walk<Any>& w, int r, ChildRef ref, int first,
                                              uint32_t mask, uint32_t sure, Floats lo, Floats hi) {
  Tile& tile = w.tile;
  alignas(64) float nearest[kFloats], farthest[kFloats];
  store(nearest, lo);
  store(farthest, hi);
  for (; mask; mask &= mask - 1) {
    const int lane = __builtin_ctz(mask), place = first + lane;
    const bool hit = sure >> lane & 1;
    if (hit && nearest[lane] > tile.hi[r]) continue;
    if (!visible(tile, leaf_first(ref) + uint32_t(place))) continue;
    if (tile.answers->opacity &&
        !((hit || w.seen(r, ref, place).hit()) && stopped(w, r, 1, ref, place)))
      continue;
    if (hit && farthest[lane] < tile.lo[r] && nearest[lane] > tile.begin_hi[r]) {
      if (Any) return w.block(r);
      tile.lo[r] = nearest[lane];
      tile.hi[r] = farthest[lane];
      tile.pending[r] = ref;
      tile.place[r] = uint32_t(place);
      w.trim(r);
      continue;
    }
    tile.answers->count_fallback(tile.slot[r]);
    w.decide(r, ref, place);
    w.trim(r);
    if (Any && !alive(tile, r)) return;
  }
}

/// The triangles [first, first + kFloats) of a leaf as one ray sees them; depths are `back` less.
template <bool Any>
__attribute__((always_inline)) inline void take_seen(Walk<Any>& w, int r, ChildRef ref, int first,
                                                     const TriangleTest<Floats>& t, Floats back) {
  const Tile& tile = w.tile;
  const int rest = leaf_count(ref) - first < kFloats ? leaf_count(ref) - first : kFloats;
  uint32_t mask = ~t.missed() & ((1u << rest) - 1);
  if (!mask) return;
  Floats lo, hi;
  t.depth(tile, lo, hi);
  lo -= back;
  hi -= back;
  const uint32_t sure = bits(t.sure());
  mask &= ~(sure & bits(less(splat(tile.hi[r]), lo) | less(hi, splat(tile.begin_lo[r]))));
  if (mask) take_triangles(w, r, ref, first, mask, sure, lo, hi);
}

/// The triangles of a leaf against one ray.
template <bool Any>
inline void hit_triangles(Walk<Any>& w, int r, ChildRef ref, const Order& order) {
  const Tile& tile = w.tile;
  const int n = leaf_count(ref);
  const float* leaf = w.tree.floats + 9 * size_t(leaf_first(ref));
  const float *px = leaf + order.axes[0] * n, *py = leaf + order.axes[1] * n,
              *pz = leaf + order.axes[2] * n;
  const size_t corner = 3 * size_t(n);
  const Floats ox = splat(tile.of[0][r]), oy = splat(tile.of[1][r]), oz = splat(tile.start[r]),
               sign = splat(order.sign);
  const Floats sx = splat(-tile.slope[0][r]), sy = splat(-tile.slope[1][r]);
  // What is missing to the origin, of corners seen along the ray; of depths in the end.
  const float low = tile.low_part[2][r];
  const Floats rx = splat(tile.low_part[0][r] - tile.slope[0][r] * low),
               ry = splat(tile.low_part[1][r] - tile.slope[1][r] * low), rz = splat(low);
  for (int first = 0; first < n; first += kFloats) {
    TriangleTest<Floats> t;
    for (size_t j = 0; j < 3; ++j) {
      t.z[j] = fused(load(pz + j * corner + first), sign, -oz);
      t.x[j] = fused(sx, t.z[j], load(px + j * corner + first) - ox) - rx;
      t.y[j] = fused(sy, t.z[j], load(py + j * corner + first) - oy) - ry;
    }
    t.edges();
    t.margin = edge_margin(t.extent(), larger(t.rear(), -t.front()), tile.off);
    take_seen(w, r, ref, first, t, rz);
  }
}

template <bool Any>
inline void hit_leaf(Walk<Any>& w, int r, ChildRef leaf, const Order& order) {
  if (w.tree.kind == kTriangleLeaf) hit_triangles(w, r, leaf, order);
  else hit_shapes(w, r, leaf);
}

/// Asks for the memory that a ray needs when it is its turn again: a node, or what a leaf holds,
/// `size` bytes each from `held` on. No branch: where it goes cannot be foreseen.
inline void fetch(const TreeView& tree, ChildRef child, const void* held, size_t size) {
  const uintptr_t node = reinterpret_cast<uintptr_t>(tree.nodes) + child * sizeof(Node);
  const uintptr_t leaf = reinterpret_cast<uintptr_t>(held) + leaf_first(child) * size;
  const uintptr_t at_leaf = uintptr_t(intptr_t(int32_t(child) >> 31));  // all bits or none
  const char* p = reinterpret_cast<const char*>((node & ~at_leaf) | (leaf & at_leaf));
  for (size_t k = 0; k < sizeof(Node); k += 64) __builtin_prefetch(p + k);
}

/// A ray on its own, and what waits for it.
struct SingleRay {
  int r;
  Waiting limit;  // what is farther away is not worth going to
  Waiting* top;   // past the last that waits

  /// Returns where to go first; kDone when nothing is left within its reach.
  ChildRef start(const Tile& tile, int ray, const SingleRays& left, Waiting* stack) {
    r = ray;
    stack[0] = kBottom;
    top = left.put(ray, stack + 1);
    shorten(tile);
    return pop();
  }
  /// After a hit.
  void shorten(const Tile& tile) { limit = limit_of(tile.hi[r]); }
  ChildRef pop() { return go(*--top); }
  /// There, or to what waits on top when that is too far away.
  ChildRef go(Waiting next) {
    while (next > limit) next = *--top;
    return ChildRef(next);
  }
  /// To the nearest child of a node that the ray meets, or what was left for later.
  template <bool Turns, bool Any>
  __attribute__((always_inline)) ChildRef descend(const Walk<Any>& w, ChildRef node) {
    const Node& n = w.tree.nodes[node];
    const BoxHits met = Turns && n.turned ? BoxHits(n, w.tile, r) : BoxHits(n, w.boxes, w.tile, r);
    const Waiting below = top[-1], nearest = put_met(n, met, top);
    top += __builtin_popcount(met.mask) - 1;
    return go(met.mask ? nearest : below);
  }
};

/// The rays of a tile on their way, through a tree over instances or another one. A processor
/// cannot foresee where each of them goes; so they go in step. Turns: some nodes are turned.
template <bool Any, bool Placed, bool Turns = false>
struct InterleavedRays {
  Walk<Any>& w;
  int count = 0;  // single rays, whole vectors of them
  bool slow;      // memory, and others have the time until it answers
  alignas(64) ChildRef at[kInterleaved];
  SingleRay single[kInterleaved];

  explicit InterleavedRays(Walk<Any>& walk) : w(walk) {
    RayStacks& stacks = *w.tile.answers->stacks;
    for (uint64_t rays = w.left.rays; rays; rays &= rays - 1, ++count)
      at[count] = single[count].start(w.tile, __builtin_ctzll(rays), w.left,
                                      Placed ? stacks.placed[count] : stacks.own[count]);
    slow = w.tree.large && count > 2;
    for (; count % kFloats; ++count) at[count] = kDone;
  }
  /// Who is at a node, and who at a leaf.
  void look(uint64_t& nodes, uint64_t& leaves) const {
    nodes = leaves = 0;
    for (int k = 0; k < count; k += kFloats) {
      const Ints child = load(at + k);
      nodes |= uint64_t(bits(child >= Ints{})) << k;
      leaves |= uint64_t(bits(child < Ints{}) & ~bits(equal(child, Ints{} + int32_t(kDone)))) << k;
    }
  }
  void pass_nodes(uint64_t mask) {
    for (; mask; mask &= mask - 1) {
      const int k = __builtin_ctzll(mask);
      go(k, single[k].template descend<Turns>(w, at[k]));
    }
  }
  void go(int k, ChildRef next) {
    at[k] = next;
    if (!slow) return;
    if constexpr (Placed) fetch(w.tree, next, w.world.instances, sizeof(InstanceRecord));
    else if (Turns) fetch(w.tree, next, w.tree.ids, sizeof(PrimitiveId));
    else fetch(w.tree, next, w.tree.floats, 9 * sizeof(float));
  }
};

/// Rays in a tree over primitives: those at nodes take a step, or those at leaves, whichever are
/// more.
template <bool Any, bool Turns>
struct InterleavedTraversal : InterleavedRays<Any, false, Turns> {
  using Base = InterleavedRays<Any, false, Turns>;
  using Base::Base;
  using Base::w, Base::at, Base::single;

  void go() {
    for (uint64_t nodes, leaves;;) {
      this->look(nodes, leaves);
      if (!(nodes | leaves)) return;
      if (__builtin_popcountll(nodes) >= __builtin_popcountll(leaves)) this->pass_nodes(nodes);
      else pass_leaves(leaves);
    }
  }
  void pass_leaves(uint64_t mask) {
    for (; mask; mask &= mask - 1) {
      const int k = __builtin_ctzll(mask);
      SingleRay& a = single[k];
      hit_leaf(w, a.r, at[k], order_of(w.tile, a.r));
      a.shorten(w.tile);
      Base::go(k, Any && !alive(w.tile, a.r) ? kDone : a.pop());
    }
  }
};

template <bool Any>
void visit_instances(Walk<Any>& w);
template <bool Any>
__attribute__((noinline)) void visit_primitives(Walk<Any>& w) {
  if (w.tree.turns) InterleavedTraversal<Any, true>(w).go();
  else InterleavedTraversal<Any, false>(w).go();
}

/// The rest of the way of all rays that have left their packets. The packets do not learn of it:
/// Walk::trim.
template <bool Any>
__attribute__((noinline)) void walk_rays(Walk<Any>& w) {
  w.boxes.prepare(w.tile, w.left.rays);
  w.tree.kind == kInstanceLeaf ? visit_instances(w) : visit_primitives(w);
  w.left.rays = 0;
  w.left.count = 0;
}

/// Rays of the group from k on leave their packet for a part of the tree that lies behind
/// `distance`, a coordinate of the depth axis.
template <bool Any>
inline void leave(Walk<Any>& w, int k, uint32_t rays, ChildRef child, float distance) {
  if (w.left.full()) {
    const uint64_t all = w.left.rays;
    walk_rays(w);
    for (uint64_t m = all; m; m &= m - 1) w.trim(__builtin_ctzll(m));
  }
  for (; rays; rays &= rays - 1) {
    const int r = k + __builtin_ctz(rays);
    w.left.add(r, child, distance - w.tile.start[r] - larger(0.0f, w.tile.low_part[2][r]));
  }
}

/// The same of some rays of a tile.
template <bool Any>
inline void leave(Walk<Any>& w, uint64_t rays, ChildRef child, float distance) {
  for (int k = 0; k < kTile; k += kFloats)
    if (const uint32_t some = some_of(rays, k, kFloats)) leave(w, k, some, child, distance);
}

}  // namespace
}  // namespace glint
