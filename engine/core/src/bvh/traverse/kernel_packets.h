// Packets of rays through a tree, nearest boxes first: a whole tile, or a group of kFloats rays.
#pragma once
#include "bvh/traverse/kernel_instances.h"

namespace glint {
namespace {

/// `box`: number of the node that has the child's box, times kWidth, plus the child's number;
/// kNoBox for the root.
struct Entry {
  ChildRef child;
  float distance;
  uint32_t units, box;
};
constexpr uint32_t kNoBox = 0xffffffffu;

/// By component: a processor waits for the parts of a structure that it has just written before it
/// can read the whole.
struct Stack {
  ChildRef child[kStack];
  float distance[kStack];
  uint32_t units[kStack], box[kStack];
  int count = 0;

  /// Puts an entry among those from `base` on, the nearest on top.
  void push(int base, const Entry& e) {
    int p = count++;
    for (; p > base && distance[p - 1] < e.distance; --p) {
      child[p] = child[p - 1];
      distance[p] = distance[p - 1];
      units[p] = units[p - 1];
      box[p] = box[p - 1];
    }
    child[p] = e.child;
    distance[p] = e.distance;
    units[p] = e.units;
    box[p] = e.box;
  }
  Entry pop() {
    --count;
    return {child[count], distance[count], units[count], box[count]};
  }
};

constexpr int kFewTriangles = 3;  // to a group, they are tested sooner than their edges are known

/// A group of rays of one axis class.
template <bool Any>
struct GroupLevel {
  Walk<Any>& w;
  const Order& order;
  int k, g;
  bool common;
  WideFrustum whole;
  GroupLevel(Walk<Any>& walk, const Order& o, int group, bool one)
      : w(walk),
        order(o),
        k(group * kFloats),
        g(group),
        common(one),
        whole(walk.packets.groups.at(group)) {
    if (!(w.packets.lines >> g & 1)) set_ray_lines(w.tile, w.packets, k);
  }

  uint32_t met(const Boxes& box) const { return units_met(w.packets.rays, k, kFloats, box); }
  uint32_t still(uint32_t rays, float distance) const {
    return rays & bits(less(splat(distance), load(w.packets.rays.last + k)));
  }
  static bool few(uint32_t rays) { return __builtin_popcount(rays) <= 3; }
  void split(ChildRef child, uint32_t rays, float distance) { leave(w, k, rays, child, distance); }
  void shorten() {
    w.packets.groups.last[g] = largest(load(w.packets.rays.last + k));
    whole.last = splat(w.packets.groups.last[g]);
  }
  void leaf(ChildRef child, uint32_t rays, uint32_t) {
    if (w.tree.kind == kInstanceLeaf) trace_instances(w, child, uint64_t(rays) << k);
    else if (w.tree.kind != kTriangleLeaf)
      for (; rays; rays &= rays - 1) {
        hit_shapes(w, k + __builtin_ctz(rays), child);
        w.trim(k + __builtin_ctz(rays));
      }
    else if (__builtin_popcount(rays) <= 2)
      for (; rays; rays &= rays - 1) {
        hit_triangles(w, k + __builtin_ctz(rays), child, order);
        w.trim(k + __builtin_ctz(rays));
      }
    else common ? triangles<true>(child) : triangles<false>(child);
    shorten();
  }
  template <bool Common>
  void triangles(ChildRef child) {
    const Triangles leaf_triangles(w.tree, child);
    for (int first = 0; first < leaf_triangles.n; first += kFloats) {
      const Boxes boxes = triangle_boxes(leaf_triangles, first, order);
      const int rest = leaf_triangles.n - first < kFloats ? leaf_triangles.n - first : kFloats;
      uint32_t mask = whole.meet(boxes) & ((1u << rest) - 1);
      if (!mask) continue;
      if (w.apex_packet.exists && __builtin_popcount(mask) > kFewTriangles)
        mask = apex_triangles(child, leaf_triangles, first, mask);
      if (!mask) continue;
      const Corners<Common> corners(leaf_triangles, first, order, w.tile, k, boxes,
                                    w.packets.starts[g]);
      for (; mask; mask &= mask - 1)
        hit_group<Any, Common>(w, k, corners, first, __builtin_ctz(mask), order, child);
    }
  }
  /// Returns the triangles that their edges leave in doubt.
  uint32_t apex_triangles(ChildRef child, const Triangles& triangles, int first, uint32_t mask) {
    const EdgeLines lines = edge_lines(w.apex_packet, triangles, first, order);
    mask &= ~bits(lines.beside(w.apex_packet.group(g)));
    if (!mask) return 0;
    const EdgeTable edges(lines);
    uint32_t undecided = 0;
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      if (hit_apex_packet<Any>(w, k, edges.at(lane), child, first + lane) == Verdict::kUndecided)
        undecided |= mask & -mask;
    }
    return undecided;
  }
};

template <class Level>
inline void walk(Level& level, const TreeView& tree, ChildRef root, uint32_t units) {
  Stack stack;
  alignas(64) float front[kFloats];
  stack.push(0, {root, -kFar, units, kNoBox});
  while (stack.count) {
    const Entry e = stack.pop();
    const uint32_t rest = level.still(e.units, e.distance);
    if (!rest) continue;
    if (e.child & kLeaf) {
      level.leaf(e.child, rest, e.box);
      continue;
    }
    if (level.few(rest)) {
      level.split(e.child, rest, e.distance);
      continue;
    }
    const Node& n = tree.nodes[e.child];
    const int base = stack.count;
    for (int first = 0; first < kWidth; first += kFloats) {
      const Boxes boxes = boxes_of(n.planes[0] + first, level.order);
      store(front, boxes.front);
      for (uint32_t mask = level.whole.meet(boxes); mask; mask &= mask - 1) {
        const int lane = __builtin_ctz(mask);
        const uint32_t met = level.met(child_box(n, first + lane, level.order)) & rest;
        if (met)
          stack.push(base, {n.child[first + lane], front[lane], met,
                            e.child * kWidth + uint32_t(first + lane)});
      }
    }
  }
}

/// All rays of a tile, of one axis class.
template <bool Any>
struct TileLevel {
  Walk<Any>& w;
  const Order& order;
  bool common;
  WideFrustum whole;
  StartRange starts{1, 0};   // of all rays, once triangles ask for it
  int tests = 0, found = 0;  // groups tested against triangles, and those with a hit
  TileLevel(Walk<Any>& walk, const Order& o, bool one)
      : w(walk), order(o), common(one), whole(walk.packets.all) {}

  uint32_t met(const Boxes& box) const { return units_met(w.packets.groups, 0, kGroups, box); }
  uint32_t still(uint32_t groups, float distance) const {
    uint32_t mask = 0;
    for (int k = 0; k < kGroups; k += kFloats)
      mask |= bits(less(splat(distance), load(w.packets.groups.last + k))) << k;
    return groups & mask;
  }
  bool few(uint32_t groups) const {
    return wasteful() || __builtin_popcount(groups) <= kGroups / 4;
  }
  /// Most triangles are missed by whole groups, as where a mesh is finer than the rays.
  bool wasteful() const { return tests > 3 * found + 2 * kGroups; }
  void split(ChildRef child, uint32_t groups, float) {
    for (; groups; groups &= groups - 1) {
      GroupLevel<Any> level(w, order, __builtin_ctz(groups), common);
      walk(level, w.tree, child, (1u << kFloats) - 1);
    }
    shorten();
  }
  /// After hits of groups' rays. (All at once: a processor waits before it reads a vector of which
  /// it has just written a part.)
  void shorten() {
    Floats last = splat(-kFar);
    for (int g = 0; g < kGroups; g += kFloats) {
      float* groups = w.packets.groups.last + g;
      const Floats shorter = smaller(fold_rows<Larger>(w.packets.rays.last + g * kFloats),
                                     load(groups));  // empty ones stay so
      store(groups, shorter);
      last = larger(shorter, last);
    }
    whole.last = splat(largest(last));
  }
  void leaf(ChildRef child, uint32_t groups, uint32_t box) {
    const int before = found;
    const bool apart = w.tree.kind == kStrandLeaf || (w.tree.kind == kTriangleLeaf && wasteful());
    if (apart && box != kNoBox) {
      ray_by_ray(child, groups, box);
    } else if (w.tree.kind == kTriangleLeaf && !few(groups)) {
      common ? triangles<true>(child, groups) : triangles<false>(child, groups);
      if (found == before) return;
    } else if (w.tree.kind == kInstanceLeaf) {
      instances(child, groups, box);
    } else {
      for (; groups; groups &= groups - 1) {
        GroupLevel<Any> level(w, order, __builtin_ctz(groups), common);
        level.leaf(child, (1u << kFloats) - 1, box);
      }
    }
    shorten();
  }
  /// Only the rays that meet a leaf's own box.
  void ray_by_ray(ChildRef child, uint32_t groups, uint32_t box) {
    const Boxes own = child_box(w.tree.nodes[box / kWidth], int(box % kWidth), order);
    for (; groups; groups &= groups - 1) {
      GroupLevel<Any> level(w, order, __builtin_ctz(groups), common);
      if (const uint32_t rays = level.met(own)) level.leaf(child, rays, box);
    }
  }
  void instances(ChildRef child, uint32_t groups, uint32_t box) {
    uint64_t rays = 0;
    for (uint32_t m = groups; m; m &= m - 1) {
      const int k = __builtin_ctz(m) * kFloats;
      uint32_t met = living(w.tile, k);
      if (!(w.packets.lines >> __builtin_ctz(m) & 1)) set_ray_lines(w.tile, w.packets, k);
      if (box != kNoBox)
        met &= units_met(w.packets.rays, k, kFloats,
                         child_box(w.tree.nodes[box / kWidth], int(box % kWidth), order));
      rays |= uint64_t(met) << k;
    }
    trace_instances(w, child, rays);
    for (uint32_t m = groups; m; m &= m - 1) {
      const int g = __builtin_ctz(m);
      w.packets.groups.last[g] = largest(load(w.packets.rays.last + g * kFloats));
    }
  }
  template <bool Common>
  void triangles(ChildRef child, uint32_t groups) {
    if (!Common && starts.last < starts.first) starts = starts_of(w.tile, 0, w.tile.count);
    const Triangles leaf_triangles(w.tree, child);
    for (int first = 0; first < leaf_triangles.n; first += kFloats) {
      const Boxes boxes = triangle_boxes(leaf_triangles, first, order);
      const int rest = leaf_triangles.n - first < kFloats ? leaf_triangles.n - first : kFloats;
      const uint32_t mask = whole.meet(boxes) & ((1u << rest) - 1);
      if (!mask) continue;
      const int pairs = __builtin_popcount(mask) *
                        __builtin_popcount(groups);  // edges are worth their while for several
      if (w.apex_packet.exists && pairs > kGroups / 2)
        apex_triangles<Common>(child, leaf_triangles, first, mask, boxes, groups);
      else parted_triangles<Common>(child, leaf_triangles, first, mask, boxes, groups);
    }
  }
  /// Groups of an apex packet: triangles beside them are known by their edges.
  template <bool Common>
  void apex_triangles(ChildRef child, const Triangles& triangles, int first, uint32_t mask,
                      const Boxes& boxes, uint32_t groups) {
    const EdgeLines lines = edge_lines(w.apex_packet, triangles, first, order);
    mask &= ~bits(lines.beside(w.apex_packet.all));
    if (!mask) return;
    const EdgeTable edges(lines);
    alignas(64) float front[kFloats], rear[kFloats];
    store(front, boxes.front);
    store(rear, boxes.rear);
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      const EdgeLines one = edges.at(lane);
      uint32_t met = 0;
      for (int g = 0; g < kGroups; g += kFloats) {
        const FloatMask before = less(load(w.packets.groups.last + g), splat(front[lane]));
        const FloatMask after = less(splat(rear[lane]), load(w.packets.groups.first + g));
        met |= (~bits(before | after | one.beside(w.apex_packet.groups(g))) & ((1u << kFloats) - 1))
               << g;
      }
      if (const uint32_t undecided = hit_apex_packets(met & groups, one, child, first + lane))
        hit_groups(undecided, Corners<Common>(triangles, first, order, w.tile, 0, boxes, starts),
                   first, lane, child);
    }
  }
  /// One triangle. Returns the groups that its edges leave in doubt.
  uint32_t hit_apex_packets(uint32_t groups, const EdgeLines& edges, ChildRef child, int place) {
    uint32_t undecided = 0;
    for (; groups; groups &= groups - 1) {
      const Verdict verdict =
          hit_apex_packet<Any>(w, __builtin_ctz(groups) * kFloats, edges, child, place);
      if (verdict == Verdict::kUndecided) {
        undecided |= groups & -groups;
        continue;
      }
      ++tests;
      found += verdict == Verdict::kHit;
    }
    return undecided;
  }
  template <bool Common>
  void parted_triangles(ChildRef child, const Triangles& triangles, int first, uint32_t mask,
                        const Boxes& boxes, uint32_t groups) {
    alignas(64) float box[6][kFloats];
    store(box[0], boxes.low_x);
    store(box[1], boxes.high_x);
    store(box[2], boxes.low_y);
    store(box[3], boxes.high_y);
    store(box[4], boxes.front);
    store(box[5], boxes.rear);
    const Corners<Common> corners(triangles, first, order, w.tile, __builtin_ctz(groups) * kFloats,
                                  boxes, starts);
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      const Boxes one{splat(box[0][lane]), splat(box[1][lane]), splat(box[2][lane]),
                      splat(box[3][lane]), splat(box[4][lane]), splat(box[5][lane])};
      hit_groups(met(one) & groups, corners, first, lane, child);
    }
  }
  template <bool Common>
  void hit_groups(uint32_t groups, const Corners<Common>& corners, int first, int lane,
                  ChildRef child) {
    tests += __builtin_popcount(groups);
    for (; groups; groups &= groups - 1)
      found += hit_group<Any, Common>(w, __builtin_ctz(groups) * kFloats, corners, first, lane,
                                      order, child);
  }
};

inline bool same_axis_class(const Tile& tile, int k) {
  return bits(load(tile.axis_class + k) == (Ints{} + int32_t(tile.axis_class[k]))) ==
         (1u << kFloats) - 1;
}

template <bool Any>
inline void walk_group(Walk<Any>& w, int g, bool common) {
  const Order& order = order_of(w.tile, g * kFloats);
  GroupLevel<Any> level(w, order, g, common);
  walk(level, w.tree, w.tree.root, (1u << kFloats) - 1);
}

/// All rays as one packet.
template <bool Any>
inline void walk_together(Walk<Any>& w, uint32_t groups, bool common) {
  constexpr int kCount = sizeof w.packets.groups.first / sizeof(float);
  for (uint32_t m = ~groups & ((1u << kCount) - 1); m; m &= m - 1)
    empty_group(w.packets, __builtin_ctz(m));
  const bool orderly = set_all(w.tile, w.packets);
  const Order& order = order_of(w.tile, __builtin_ctz(groups) * kFloats);
  if (!orderly) {
    for (; groups; groups &= groups - 1) walk_group(w, __builtin_ctz(groups), common);
    return;
  }
  TileLevel<Any> level(w, order, common);
  walk(level, w.tree, w.tree.root, groups);
}

}  // namespace
}  // namespace glint
