// Rays of a tile through a tree as one packet, nearest boxes first. The packet's frustum culls the
// children of a node; each ray then meets the boxes that are left on its own, many rays at a time,
// and goes on only where it has met one. So a packet may be as wide as it likes, and its rays part
// where they do.
#pragma once
#include "bvh/traverse/kernel_instances.h"

namespace glint {
namespace {

/// As many rays as a register holds, against boxes whose sides across are moved outwards.
struct BroadRays {
  Broad inverse_x, at_x, inverse_y, at_y, first, last;
  BroadRays(const Packet& p, int k)
      : inverse_x(load_broad(p.inverse[0] + k)),
        at_x(load_broad(p.at[0] + k)),
        inverse_y(load_broad(p.inverse[1] + k)),
        at_y(load_broad(p.at[1] + k)),
        first(load_broad(p.first + k)),
        last(load_broad(p.last + k)) {}
  /// Which of them meet one.
  __attribute__((always_inline)) uint32_t met(const float (&planes)[6][kFloats], int lane) const {
    const auto cross = [&](int plane, Broad inverse, Broad at) {
      return fused(spread(planes[plane][lane]), inverse, at);
    };
    const Broad x0 = cross(0, inverse_x, at_x), x1 = cross(1, inverse_x, at_x),
                y0 = cross(2, inverse_y, at_y), y1 = cross(3, inverse_y, at_y);
    const Broad near =
        larger(larger(smaller(x0, x1), smaller(y0, y1)), larger(spread(planes[4][lane]), first));
    const Broad far =
        smaller(smaller(larger(x0, x1), larger(y0, y1)), smaller(spread(planes[5][lane]), last));
    return bits(at_most(near, far));
  }
};

constexpr int kFewRays = 8;  // are tested against a leaf's triangles one by one

/// Rays of a tile, all of one axis class, on their way.
template <bool Any>
struct PacketWalk {
  Walk<Any>& w;
  const Order& order;
  uint64_t pure;  // rays whose vector has no others
  bool common;    // they begin at one point
  uint64_t alive;

  /// Those that are not yet stopped before `distance`, a coordinate of the depth axis.
  uint64_t still(uint64_t rays, float distance) const {
    if (Any) return rays & alive;
    uint64_t mask = 0;
    for (int k = 0; k < kTile; k += kBroad)
      mask |= uint64_t(bits(less(spread(distance), load_broad(w.packet.last + k)))) << k;
    return mask & rays;
  }
  void look() {
    alive = 0;
    for (int k = 0; k < kTile; k += kFloats) alive |= uint64_t(living(w.tile, k)) << k;
  }
  /// After what may have stopped a ray.
  void look(int r) {
    if (Any) alive &= ~(uint64_t(!glint::alive(w.tile, r)) << r);
  }
  void shapes(ChildRef leaf, uint64_t rays) {
    for (; rays; rays &= rays - 1) {
      const int r = __builtin_ctzll(rays);
      hit_shapes(w, r, leaf);
      w.trim(r);
      look(r);
    }
  }
  void one_by_one(ChildRef leaf, uint64_t rays) {
    for (; rays; rays &= rays - 1) {
      const int r = __builtin_ctzll(rays);
      hit_triangles(w, r, leaf, order);
      look(r);
    }
  }
  void leaf(ChildRef child, uint64_t rays) {
    if (w.tree.kind == kInstanceLeaf) {
      trace_instances(w, child, rays);
      return look();
    }
    if (w.tree.kind != kTriangleLeaf) return shapes(child, rays);
    const bool few = __builtin_popcountll(rays) <= kFewRays;
    if (few && !common) return one_by_one(child, rays);
    one_by_one(child, rays & ~pure);
    common ? triangles<true>(child, rays & pure, few) : triangles<false>(child, rays & pure, few);
  }
  template <bool Common>
  void triangles(ChildRef child, uint64_t rays, bool few) {
    const Triangles leaf_triangles(w.tree, child);
    for (int first = 0; first < leaf_triangles.n; first += kFloats) {
      const Boxes boxes = triangle_boxes(leaf_triangles, first, order);
      const Corners<Common> corners(leaf_triangles, first, order, w.tile, boxes, w.packet.starts);
      if (few) {
        for (uint64_t m = rays; m; m &= m - 1)
          hit_from_origin(corners, __builtin_ctzll(m), child, first);
        continue;
      }
      const int rest = leaf_triangles.n - first < kFloats ? leaf_triangles.n - first : kFloats;
      uint32_t mask = WideFrustum(w.packet.whole).meet(boxes) & ((1u << rest) - 1);
      for (; mask; mask &= mask - 1)
        for (int k = 0; k < kTile; k += kBroad)
          if (some_of(rays, k, kBroad))
            hit_group<Any, Common>(w, k, corners, first, __builtin_ctz(mask), order, child);
    }
    if (Any) look();
  }
  /// The triangles [first, first + kFloats) of a leaf against one ray.
  template <bool Common>
  void hit_from_origin(const Corners<Common>& corners, int r, ChildRef child, int first) {
    TriangleTest<Floats> t;
    const Floats sx = splat(-w.tile.slope[0][r]), sy = splat(-w.tile.slope[1][r]);
    for (int j = 0; j < 3; ++j) {
      t.z[j] = load(corners.p[3 * j + 2]);
      t.x[j] = fused(sx, t.z[j], load(corners.p[3 * j]));
      t.y[j] = fused(sy, t.z[j], load(corners.p[3 * j + 1]));
    }
    t.edges();
    t.margin = load(corners.margin);
    take_seen(w, r, child, first, t, Floats{});
    look(r);
  }
};

/// What waits for a packet's rays. By component: a processor waits for the parts of a structure
/// that it has just written before it can read the whole.
struct PacketStack {
  ChildRef child[kStack];
  float distance[kStack];
  uint64_t rays[kStack];
  int count = 0;

  /// Puts an entry among those from `base` on, the nearest on top.
  void push(int base, ChildRef node, float at, uint64_t some) {
    int p = count++;
    for (; p > base && distance[p - 1] < at; --p) {
      child[p] = child[p - 1];
      distance[p] = distance[p - 1];
      rays[p] = rays[p - 1];
    }
    child[p] = node;
    distance[p] = at;
    rays[p] = some;
  }
};

constexpr int kAlone = 2;  // so few rays go on one by one
/// Rays farther apart than this, in squares of the tree's radius, do so at once. Instances are
/// smaller than the tree.
constexpr float kOpen = 1, kOpenInstances = 0.125f;

template <bool Any>
__attribute__((noinline)) void walk_packet(Walk<Any>& w, const Order& order, uint64_t rays,
                                           uint64_t pure, bool common) {
  const float open = w.tree.kind == kInstanceLeaf ? kOpenInstances : kOpen,
              radius = float(w.tree.radius);
  if (set_frustum(w.tile, w.packet, order, rays) > open * radius * radius)
    return leave(w, rays, w.tree.root, -kFar);
  for (int k = 0; k < kTile; k += kFloats)
    if (some_of(rays, k, kFloats)) set_crossings(w.tile, w.packet, k);
  PacketWalk<Any> walk{w, order, pure, common, rays};
  const WideFrustum whole(w.packet.whole);
  const TreeView& tree = w.tree;
  const Floats margin = splat(w.tile.margin);
  const bool placed = tree.kind == kInstanceLeaf;
  PacketStack stack;
  stack.push(0, tree.root, -kFar, rays);
  alignas(64) float planes[6][kFloats];
  while (stack.count) {
    const int top = --stack.count;
    const ChildRef child = stack.child[top];
    const float distance = stack.distance[top];
    const uint64_t rest = walk.still(stack.rays[top], distance);
    if (!rest) continue;
    if (child & kLeaf) {
      walk.leaf(child, rest);
      continue;
    }
    const Node& n = tree.nodes[child];
    if (__builtin_popcountll(rest) <= kAlone || n.turned) {
      leave(w, rest, child, distance);
      walk.look();
      continue;
    }
    for (int first = 0; first < kWidth; first += kFloats) {
      const Boxes boxes = boxes_of(n.planes[0] + first, order);
      uint32_t mask = whole.meet(boxes);
      if (!mask) continue;
      store(planes[0], boxes.low_x - margin);
      store(planes[1], boxes.high_x + margin);
      store(planes[2], boxes.low_y - margin);
      store(planes[3], boxes.high_y + margin);
      store(planes[4], boxes.front);
      store(planes[5], boxes.rear);
      uint64_t met[kFloats] = {};
      for (int k = 0; k < kTile; k += kBroad) {
        if (!some_of(rest, k, kBroad)) continue;
        const BroadRays some(w.packet, k);
        for (uint32_t m = mask; m; m &= m - 1)
          met[__builtin_ctz(m)] |= uint64_t(some.met(planes, __builtin_ctz(m))) << k;
      }
      for (; mask; mask &= mask - 1) {
        const int lane = __builtin_ctz(mask);
        if (!(met[lane] & rest)) continue;
        stack.push(top, n.child[first + lane], planes[4][lane], met[lane] & rest);
        if (placed) fetch(tree, n.child[first + lane], w.world.instances, sizeof(InstanceRecord));
        else if (tree.large) fetch(tree, n.child[first + lane], tree.floats, 9 * sizeof(float));
      }
    }
  }
}

}  // namespace
}  // namespace glint
