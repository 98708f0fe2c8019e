// Tiles of 64 rays through the trees, nearest boxes first. A tile goes down as one packet while its
// rays stay together; where few of its groups are left, those go on as smaller packets, and where
// few rays of a group are left, those go on one by one.
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

/// A group of rays of one kind.
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
        k(group * kLanes),
        g(group),
        common(one),
        whole(walk.packets.groups.at(group)) {
    if (!(w.packets.lines >> g & 1)) set_ray_lines(w.tile, w.packets, k);
  }

  uint32_t met(const Boxes& box) const { return units_met(w.packets.rays, k, kLanes, box); }
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
    alignas(64) float extent[kLanes];
    for (int first = 0; first < leaf_triangles.n; first += kLanes) {
      const Boxes boxes = triangle_boxes(leaf_triangles, first, order);
      const int rest = leaf_triangles.n - first < kLanes ? leaf_triangles.n - first : kLanes;
      uint32_t mask = whole.meet(boxes) & ((1u << rest) - 1);
      if (!mask) continue;
      if (w.pencil.exists && __builtin_popcount(mask) > kFewTriangles)
        mask = pencil_triangles(child, leaf_triangles, first, mask);
      if (!mask) continue;
      store(extent, extent_of(boxes));
      const Corners<Common> corners(leaf_triangles, first, order, origin<Common>(w.tile, k));
      for (; mask; mask &= mask - 1) {
        const int lane = __builtin_ctz(mask);
        hit_group<Any, Common>(w, k, corners, first, lane, order, extent[lane], child);
      }
    }
  }
  /// Returns the triangles that their edges leave in doubt.
  uint32_t pencil_triangles(ChildRef child, const Triangles& triangles, int first, uint32_t mask) {
    const EdgeLines lines = edge_lines(w.pencil, triangles, first, order);
    mask &= ~bits(lines.beside(w.pencil.group(g)));
    if (!mask) return 0;
    const EdgeTable edges(lines);
    uint32_t doubtful = 0;
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      if (hit_pencil<Any>(w, k, edges.at(lane), child, first + lane) == Verdict::kDoubtful)
        doubtful |= mask & -mask;
    }
    return doubtful;
  }
};

template <class Level>
inline void walk(Level& level, const TreeView& tree, ChildRef root, uint32_t units) {
  Stack stack;
  alignas(64) float front[kLanes];
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
    for (int first = 0; first < kWidth; first += kLanes) {
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

/// All rays of a tile, of one kind.
template <bool Any>
struct TileLevel {
  Walk<Any>& w;
  const Order& order;
  bool common;
  WideFrustum whole;
  int tests = 0, found = 0;  // groups tested against triangles, and those with a hit
  TileLevel(Walk<Any>& walk, const Order& o, bool one)
      : w(walk), order(o), common(one), whole(walk.packets.all) {}

  uint32_t met(const Boxes& box) const { return units_met(w.packets.groups, 0, kGroups, box); }
  uint32_t still(uint32_t groups, float distance) const {
    uint32_t mask = 0;
    for (int k = 0; k < kGroups; k += kLanes)
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
      walk(level, w.tree, child, (1u << kLanes) - 1);
    }
    shorten();
  }
  /// After hits of groups' rays. (All at once: a processor waits before it reads a vector of which
  /// it has just written a part.)
  void shorten() {
    Floats last = splat(-kFar);
    for (int g = 0; g < kGroups; g += kLanes) {
      float* groups = w.packets.groups.last + g;
      const Floats shorter = smaller(fold_rows<Larger>(w.packets.rays.last + g * kLanes),
                                     load(groups));  // empty ones stay so
      store(groups, shorter);
      last = larger(shorter, last);
    }
    whole.last = splat(largest(last));
  }
  void leaf(ChildRef child, uint32_t groups, uint32_t box) {
    const int before = found;
    if (w.tree.kind == kTriangleLeaf && wasteful() && box != kNoBox) {
      ray_by_ray(child, groups, box);
    } else if (w.tree.kind == kTriangleLeaf && !few(groups)) {
      common ? triangles<true>(child, groups) : triangles<false>(child, groups);
      if (found == before) return;
    } else if (w.tree.kind == kInstanceLeaf) {
      instances(child, groups, box);
    } else {
      for (; groups; groups &= groups - 1) {
        GroupLevel<Any> level(w, order, __builtin_ctz(groups), common);
        level.leaf(child, (1u << kLanes) - 1, box);
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
      const int k = __builtin_ctz(m) * kLanes;
      uint32_t met = living(w.tile, k);
      if (!(w.packets.lines >> __builtin_ctz(m) & 1)) set_ray_lines(w.tile, w.packets, k);
      if (box != kNoBox)
        met &= units_met(w.packets.rays, k, kLanes,
                         child_box(w.tree.nodes[box / kWidth], int(box % kWidth), order));
      rays |= uint64_t(met) << k;
    }
    trace_instances(w, child, rays);
    for (uint32_t m = groups; m; m &= m - 1) {
      const int g = __builtin_ctz(m);
      w.packets.groups.last[g] = largest(load(w.packets.rays.last + g * kLanes));
    }
  }
  template <bool Common>
  void triangles(ChildRef child, uint32_t groups) {
    const Triangles leaf_triangles(w.tree, child);
    for (int first = 0; first < leaf_triangles.n; first += kLanes) {
      const Boxes boxes = triangle_boxes(leaf_triangles, first, order);
      const int rest = leaf_triangles.n - first < kLanes ? leaf_triangles.n - first : kLanes;
      const uint32_t mask = whole.meet(boxes) & ((1u << rest) - 1);
      if (!mask) continue;
      const int pairs = __builtin_popcount(mask) *
                        __builtin_popcount(groups);  // edges are worth their while for several
      if (w.pencil.exists && pairs > kGroups / 2)
        pencil_triangles<Common>(child, leaf_triangles, first, mask, boxes, groups);
      else parted_triangles<Common>(child, leaf_triangles, first, mask, boxes, groups);
    }
  }
  /// Groups of a pencil: triangles beside them are known by their edges.
  template <bool Common>
  void pencil_triangles(ChildRef child, const Triangles& triangles, int first, uint32_t mask,
                        const Boxes& boxes, uint32_t groups) {
    const EdgeLines lines = edge_lines(w.pencil, triangles, first, order);
    mask &= ~bits(lines.beside(w.pencil.all));
    if (!mask) return;
    const EdgeTable edges(lines);
    alignas(64) float extent[kLanes], front[kLanes], rear[kLanes];
    store(extent, extent_of(boxes));
    store(front, boxes.front);
    store(rear, boxes.rear);
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      const EdgeLines one = edges.at(lane);
      uint32_t met = 0;
      for (int g = 0; g < kGroups; g += kLanes) {
        const Mask before = less(load(w.packets.groups.last + g), splat(front[lane]));
        const Mask after = less(splat(rear[lane]), load(w.packets.groups.first + g));
        met |= (~bits(before | after | one.beside(w.pencil.groups(g))) & ((1u << kLanes) - 1)) << g;
      }
      if (const uint32_t doubtful = hit_pencils(met & groups, one, child, first + lane))
        hit_groups(doubtful, Corners<Common>(triangles, first, order, origin<Common>(w.tile, 0)),
                   first, lane, extent[lane], child);
    }
  }
  /// One triangle. Returns the groups that its edges leave in doubt.
  uint32_t hit_pencils(uint32_t groups, const EdgeLines& edges, ChildRef child, int place) {
    uint32_t doubtful = 0;
    for (; groups; groups &= groups - 1) {
      const Verdict verdict =
          hit_pencil<Any>(w, __builtin_ctz(groups) * kLanes, edges, child, place);
      if (verdict == Verdict::kDoubtful) {
        doubtful |= groups & -groups;
        continue;
      }
      ++tests;
      found += verdict == Verdict::kHit;
    }
    return doubtful;
  }
  template <bool Common>
  void parted_triangles(ChildRef child, const Triangles& triangles, int first, uint32_t mask,
                        const Boxes& boxes, uint32_t groups) {
    alignas(64) float extent[kLanes], box[6][kLanes];
    store(extent, extent_of(boxes));
    store(box[0], boxes.low_x);
    store(box[1], boxes.high_x);
    store(box[2], boxes.low_y);
    store(box[3], boxes.high_y);
    store(box[4], boxes.front);
    store(box[5], boxes.rear);
    const Corners<Common> corners(triangles, first, order,
                                  origin<Common>(w.tile, __builtin_ctz(groups) * kLanes));
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      const Boxes one{splat(box[0][lane]), splat(box[1][lane]), splat(box[2][lane]),
                      splat(box[3][lane]), splat(box[4][lane]), splat(box[5][lane])};
      hit_groups(met(one) & groups, corners, first, lane, extent[lane], child);
    }
  }
  template <bool Common>
  void hit_groups(uint32_t groups, const Corners<Common>& corners, int first, int lane,
                  float extent, ChildRef child) {
    tests += __builtin_popcount(groups);
    for (; groups; groups &= groups - 1) {
      found += hit_group<Any, Common>(w, __builtin_ctz(groups) * kLanes, corners, first, lane,
                                      order, extent, child);
    }
  }
};

inline bool same_kind(const Tile& tile, int k) {
  return bits(load(tile.kind + k) == (Ints{} + int32_t(tile.kind[k]))) == (1u << kLanes) - 1;
}

template <bool Any>
inline void walk_group(Walk<Any>& w, int g, bool common) {
  const Order& order = order_of(w.tile, g * kLanes);
  GroupLevel<Any> level(w, order, g, common);
  walk(level, w.tree, w.tree.root, (1u << kLanes) - 1);
}

/// All rays as one packet.
template <bool Any>
inline void walk_together(Walk<Any>& w, uint32_t groups, bool common) {
  constexpr int kCount = sizeof w.packets.groups.first / sizeof(float);
  for (uint32_t m = ~groups & ((1u << kCount) - 1); m; m &= m - 1)
    empty_group(w.packets, __builtin_ctz(m));
  const bool orderly = set_all(w.tile, w.packets);
  const Order& order = order_of(w.tile, __builtin_ctz(groups) * kLanes);
  if (!orderly) {
    for (; groups; groups &= groups - 1) walk_group(w, __builtin_ctz(groups), common);
    return;
  }
  TileLevel<Any> level(w, order, common);
  walk(level, w.tree, w.tree.root, groups);
}

/// Whether the rays [k, k + kLanes) begin where ray `head` does.
inline bool at_one_point(const Tile& tile, int k, int head) {
  Ints other = (load(tile.of[0] + k) != splat(tile.of[0][head])) |
               (load(tile.of[1] + k) != splat(tile.of[1][head]));
  other |= load(tile.start + k) != splat(tile.start[head]);
  for (int a = 0; a < 3; ++a) other |= load(tile.rest[a] + k) != splat(tile.rest[a][head]);
  return !bits(other);
}

/// Groups of an even tile with a ray alive.
inline uint32_t living_groups(const Tile& tile) {
  uint32_t groups = 0;
  for (int g = 0; g < kGroups; ++g) groups |= uint32_t(living(tile, g * kLanes) != 0) << g;
  return groups;
}

/// Sorts a tile's rays into packets and sends them down.
template <bool Any>
inline void walk_tile(Walk<Any>& w) {
  Tile& tile = w.tile;
  if (tile.even) {
    set_even_bundles(tile, w.packets);
    const uint32_t groups = living_groups(tile);
    return groups ? walk_together(w, groups, tile.common) : void();
  }
  // Too far apart for an object's triangles, or numbers too large for products of packets: one by
  // one.
  if ((tile.instances && tile.count < kCompany) || !(tile.far_room < kFar)) {
    for (int k = 0; k < tile.count; k += kLanes)
      leave(w, k, living(tile, k), tile.tree->root, -kFar);
    return;
  }
  uint32_t alive_groups = 0, even = 0;
  bool one_kind = true, one_point = true;
  int head = -1;
  for (int g = 0; g < kGroups && g * kLanes < tile.count; ++g) {
    const int k = g * kLanes;
    const uint32_t lives = living(tile, k);
    if (!lives) continue;
    alive_groups |= 1u << g;
    if (head < 0) head = k;
    if (!alone(tile) && same_kind(tile, k) &&
        (tile.count > kLanes || __builtin_popcount(lives) > 2))
      even |= 1u << g;
    one_kind &= (even >> g & 1) && tile.kind[k] == tile.kind[head];
  }
  for (uint32_t m = even; m; m &= m - 1) {
    const int g = __builtin_ctz(m), k = g * kLanes;
    set_ray_depths(tile, w.packets, k, DepthRange(tile, order_of(tile, k)));
    const bool one = at_one_point(tile, k, head);
    const bool ahead = smallest(load(w.packets.rays.first + k)) >= tile.start[head] - 3 * tile.room;
    one_point &= one;
    if (one && ahead) set_common_group(tile, w.packets, g);
    else {
      set_ray_lines(tile, w.packets, k);
      set_group(tile, w.packets, g);
    }
  }
  if (one_kind && (alive_groups & (alive_groups - 1)))
    return walk_together(w, alive_groups, one_point);
  for (uint32_t m = alive_groups; m; m &= m - 1) {
    const int g = __builtin_ctz(m);
    if (even >> g & 1) walk_group(w, g, false);
    else leave(w, g * kLanes, living(tile, g * kLanes), w.tree.root, -kFar);
  }
}

/// The tile's rays through its tree. xyz_o, xyz_d, slot, count, instances, answers, tree and world
/// are set.
template <bool Any>
__attribute__((noinline)) void trace_tile(Tile& tile) {
  tile.even = set_even_tile(tile);
  if (!tile.even && !set_tile(tile)) return;
  Packets packets;
  Pencil pencil;
  if (tile.even) set_pencil(tile, pencil);
  BoxRays boxes;
  SingleRays left;
  Walk<Any> w{*tile.world, *tile.tree, tile, packets, pencil, boxes, left};
  walk_tile(w);
  if (left.rays) walk_rays(w);
  if constexpr (!Any)
    for (int k = 0; k < tile.count; k += kLanes) finish_group(w, k);
}

/// Rays [first, first + count) of a batch: where they are when they fill a tile, else in `columns`.
inline void show_rays(const Rays& rays, size_t first, int count, Columns& columns, Tile& tile) {
  const double* source[8] = {rays.o[0], rays.o[1], rays.o[2],  rays.d[0],
                             rays.d[1], rays.d[2], rays.t_min, rays.t_max};
  tile.count = count;
  if (count == kTile) {
    for (int a = 0; a < 3; ++a) {
      tile.xyz_o[a] = source[a] + first;
      tile.xyz_d[a] = source[3 + a] + first;
    }
    tile.t_min = source[6] + first;
    tile.t_max = source[7] + first;
    return;
  }
  for (int c = 0; c < 8; ++c)
    for (int k = 0; k < count; ++k) columns.values[c][k] = source[c][first + size_t(k)];
  columns.fill(count);
  columns.show(tile);
}

/// Asks for the numbers of the tile after this one, to have them when it is its turn.
inline void fetch_ahead(const Rays& rays, size_t first) {
  constexpr size_t kLine = 64 / sizeof(double);
  if (first + 2 * kTile > rays.count) return;
  for (size_t k = first + kTile; k < first + 2 * kTile; k += kLine) {
    for (int a = 0; a < 3; ++a) {
      __builtin_prefetch(rays.o[a] + k);
      __builtin_prefetch(rays.d[a] + k);
    }
    __builtin_prefetch(rays.t_min + k);
    __builtin_prefetch(rays.t_max + k);
  }
}

template <class T>
inline void fill(T* p, int count, T value) {
  for (int k = 0; k < count; ++k) p[k] = value;
}

inline void clear(const Answers& a, int count) {
  fill(a.t, count, kInf);
  fill(a.instance, count, Hit::kNone);
  fill(a.primitive, count, 0u);
  fill(a.u, count, 0.0f);
  fill(a.v, count, 0.0f);
  if (a.fallbacks) fill(a.fallbacks, count, uint8_t(0));
}

/// The nearer of a ray's end and its best hit, or nothing left of a ray that is blocked.
template <bool Any>
inline void limit_rays(const Answers& a, Columns& columns, Tile& tile) {
  for (int k = 0; k < tile.count; ++k)
    columns.values[7][k] = Any ? a.blocked[k] == a.stop() ? a.t_min[k] : a.t_max[k]
                           : a.t[k] < a.t_max[k] ? a.t[k]
                                                 : a.t_max[k];
  tile.t_max = columns.values[7];
}

/// Whether all rays certainly miss the ball round a tree. Without branches, so that it is done for
/// several rays at once.
inline bool all_pass_by(const Tile& tile, const TreeView& tree) {
  int near = 0;
  for (int r = 0; r < tile.count; ++r) near += !OpenRay<double>(tile, r).passes_by(tree);
  return near == 0;
}

template <bool Any>
inline void trace(const TopLevelView& world, const Rays& rays, size_t first, int count,
                  Answers& answers) {
  Columns columns;
  Tile tile;
  tile.answers = &answers;
  tile.world = &world;
  tile.instances = nullptr;
  answers.visibility = rays.visibility;
  answers.masks = rays.visibility & world.common_visibility ? nullptr : world.visibility;
  answers.t_min = rays.t_min + first;
  answers.t_max = rays.t_max + first;
  answers.opacity = rays.opacity;
  for (int k = 0; k < kTile; ++k) tile.slot[k] = uint8_t(k);
  show_rays(rays, first, count, columns, tile);
  fetch_ahead(rays, first);
  for (size_t k = 0; k < world.tree_count; ++k) {
    if (world.tree_count > 1 && all_pass_by(tile, world.trees[k])) continue;
    if (k > 0) limit_rays<Any>(answers, columns, tile);
    tile.tree = &world.trees[k];
    trace_tile<Any>(tile);
  }
}

inline int tile_size(const Rays& rays, size_t first) {
  return rays.count - first < kTile ? int(rays.count - first) : kTile;
}

void closest(const TopLevelView& world, const Rays& rays, const Hits& hits, WalkerStacks& stacks) {
  for (size_t k = 0; k < rays.count; k += kTile) {
    Answers answers{nullptr,
                    nullptr,
                    hits.t + k,
                    hits.instance + k,
                    hits.primitive + k,
                    hits.u + k,
                    hits.v + k,
                    nullptr,
                    hits.fallbacks ? hits.fallbacks + k : nullptr,
                    0,
                    nullptr,
                    &stacks};
    clear(answers, tile_size(rays, k));
    trace<false>(world, rays, k, tile_size(rays, k), answers);
  }
}

void occluded(const TopLevelView& world, const Rays& rays, uint8_t* blocked, const Layers* layers,
              WalkerStacks& stacks) {
  for (size_t k = 0; k < rays.count; k += kTile) {
    Answers answers{nullptr, nullptr,     nullptr, nullptr, nullptr, nullptr,
                    nullptr, blocked + k, nullptr, 0,       nullptr, &stacks};
    fill(blocked + k, tile_size(rays, k), uint8_t(0));
    if (layers) {
      answers.layers = {layers->hits + k * Layers::kMost, layers->count + k};
      fill(answers.layers.count, tile_size(rays, k), uint8_t(0));
    }
    trace<true>(world, rays, k, tile_size(rays, k), answers);
  }
}

}  // namespace
}  // namespace glint
