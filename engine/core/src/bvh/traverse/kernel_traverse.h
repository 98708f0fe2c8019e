// Batches of rays through the trees: as beams where they begin or end at one point, else as tiles
// of 64, whose rays of one axis class are a packet.
#pragma once
#include "bvh/traverse/kernel_beam_instances.h"
#include "bvh/traverse/kernel_packets.h"

namespace glint {
namespace {

constexpr int kLeastOfClass = 16;  // fewer rays of one axis class go one by one

/// Sorts a tile's rays into packets and sends them down.
template <bool Any>
inline void walk_tile(Walk<Any>& w) {
  Tile& tile = w.tile;
  uint64_t rays = 0;
  for (int k = 0; k < tile.count; k += kFloats) rays |= uint64_t(living(tile, k)) << k;
  if (tile.coherent) {
    if (rays) walk_packet(w, order_of(tile, 0), rays, ~uint64_t(0), tile.common);
    return;
  }
  // Too far apart for an object's triangles, or numbers too large for products of packets: one by
  // one.
  if ((tile.instances && tile.count < kLeastPacket) || !(tile.far_margin < kFar))
    return leave(w, rays, w.tree.root, -kFar);
  const uint64_t all = rays;
  uint64_t lone = 0;
  while (rays) {
    const uint32_t kind = tile.axis_class[__builtin_ctzll(rays)];
    uint64_t same = 0, pure = 0;
    for (int k = 0; k < tile.count; k += kFloats)
      same |= uint64_t(bits(equal(load(tile.axis_class + k), Ints{} + int32_t(kind)))) << k;
    same &= all;
    for (int k = 0; k < kTile; k += kBroad)
      if (some_of(same, k, kBroad) == some_of(all, k, kBroad))
        pure |= uint64_t(some_of(same, k, kBroad)) << k;
    rays &= ~same;
    if (__builtin_popcountll(same) < kLeastOfClass) lone |= same;
    else walk_packet(w, kOrders[kind], same, pure, false);
  }
  leave(w, lone, w.tree.root, -kFar);
}

/// The tile's rays through its tree. xyz_o, xyz_d, slot, count, instances, answers, tree and world
/// are set.
template <bool Any>
__attribute__((noinline)) void trace_tile(Tile& tile) {
  tile.coherent = set_coherent_tile(tile);
  if (!tile.coherent && !set_tile(tile)) return;
  Packet packet;
  BoxRays boxes;
  SingleRays left;
  Walk<Any> w{*tile.world, *tile.tree, tile, packet, boxes, left};
  walk_tile(w);
  if (left.rays) walk_rays(w);
  if constexpr (!Any)
    for (int k = 0; k < tile.count; k += kFloats) finish_group(w, k);
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

template <bool Any>
inline void clear(const Answers& a, int count) {
  if (a.fallbacks) fill(a.fallbacks, count, uint8_t(0));
  if (Any) {
    fill(a.blocked, count, uint8_t(0));
    if (a.layers.hits) fill(a.layers.count, count, uint8_t(0));
    return;
  }
  fill(a.t, count, kInf);
  fill(a.instance, count, Hit::kNone);
  fill(a.primitive, count, 0u);
  fill(a.u, count, 0.0f);
  fill(a.v, count, 0.0f);
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
                  Answers& answers, size_t first_tree = 0) {
  Columns columns;
  Tile tile;
  tile.answers = &answers;
  tile.world = &world;
  tile.instances = nullptr;
  for (int k = 0; k < kTile; ++k) tile.slot[k] = uint8_t(k);
  show_rays(rays, first, count, columns, tile);
  fetch_ahead(rays, first);
  for (size_t k = first_tree; k < world.tree_count; ++k) {
    if (world.tree_count > 1 && all_pass_by(tile, world.trees[k])) continue;
    if (k > 0) limit_rays<Any>(answers, columns, tile);
    tile.tree = &world.trees[k];
    trace_tile<Any>(tile);
  }
}

inline int tile_size(const Rays& rays, size_t first) {
  return rays.count - first < kTile ? int(rays.count - first) : kTile;
}

/// What rays from `first` on are to find, and where their hits go.
inline Answers answers_of(const TopLevelView& world, const Rays& rays, size_t first,
                          RayStacks& stacks) {
  Answers a{};
  a.visibility = rays.visibility;
  a.masks = rays.visibility & world.common_visibility ? nullptr : world.visibility;
  a.t_min = rays.t_min + first;
  a.t_max = rays.t_max + first;
  a.opacity = rays.opacity;
  a.stacks = &stacks;
  return a;
}

/// When to try a beam again: the more often they failed in a row, the later.
struct Trials {
  size_t next = 0, wait = 2;  // the ray from which on; in beams

  bool due(size_t k) const { return k >= next; }
  /// Notes how a beam from k on has fared.
  bool note(Beamed beamed, size_t k) {
    if (beamed == Beamed::kUnfit) return false;
    const bool good = beamed == Beamed::kTraced;
    if (!good) next = k + wait * kBeam;
    wait = good ? 2 : wait < 32 ? 4 * wait : wait;
    return good;
  }
};

/// All rays, in beams as large as they allow. answers_from: Answers of the rays from one on.
template <bool Any, class AnswersFrom>
struct Batch {
  const TopLevelView& world;
  const Rays& rays;
  const AnswersFrom& answers_from;
  Trials trials = {};

  void trace_all() {
    const bool beams = world.tree_count && !(Any && rays.opacity && rays.opacity->onward);
    for (size_t k = 0; k < rays.count;) {
      const size_t done = beams && rays.count - k >= kBeam ? trace_in_beam(k) : 0;
      const size_t count = done ? kBeam : size_t(tile_size(rays, k));
      if (!done || done < world.tree_count) trace_in_tiles(k, count, done);
      k += count;
    }
  }
  /// A beam from `first` on through the first tree: how many trees that does.
  size_t trace_in_beam(size_t first) {
    const TreeView& tree = *world.trees;
    const bool placed = tree.kind == kInstanceLeaf;
    if (tree.kind != kTriangleLeaf && !(placed && !Any)) return 0;
    if (!trials.due(first)) return 0;
    Answers answers = answers_from(first);
    if (answers.fallbacks) fill(answers.fallbacks, kBeam, uint8_t(0));
    if (answers.layers.hits) fill(answers.layers.count, kBeam, uint8_t(0));
    if (placed) clear<false>(answers, kBeam);
    return trials.note(placed ? trace_placed_beam(world, tree, rays, first, answers)
                              : trace_beam<Any>(tree, rays, first, answers),
                       first);
  }
  /// The rays from `first` on through the trees from `tree` on.
  void trace_in_tiles(size_t first, size_t count, size_t tree) {
    for (size_t k = first; k < first + count; k += kTile) {
      const int some = int(count < kTile ? count : kTile);
      Answers answers = answers_from(k);
      if (tree == 0) clear<Any>(answers, some);
      trace<Any>(world, rays, k, some, answers, tree);
    }
  }
};

template <bool Any, class AnswersFrom>
inline void trace_all(const TopLevelView& world, const Rays& rays,
                      const AnswersFrom& answers_from) {
  Batch<Any, AnswersFrom>{world, rays, answers_from}.trace_all();
}

void closest(const TopLevelView& world, const Rays& rays, const Hits& hits, RayStacks& stacks) {
  trace_all<false>(world, rays, [&](size_t first) {
    Answers a = answers_of(world, rays, first, stacks);
    a.t = hits.t + first;
    a.instance = hits.instance + first;
    a.primitive = hits.primitive + first;
    a.u = hits.u + first;
    a.v = hits.v + first;
    a.fallbacks = hits.fallbacks ? hits.fallbacks + first : nullptr;
    return a;
  });
}

void occluded(const TopLevelView& world, const Rays& rays, uint8_t* blocked, const Layers* layers,
              RayStacks& stacks) {
  trace_all<true>(world, rays, [&](size_t first) {
    Answers a = answers_of(world, rays, first, stacks);
    a.blocked = blocked + first;
    if (layers)
      a.layers = {layers->hits + first * Layers::kMost, layers->count + first, layers->left_out};
    return a;
  });
}

}  // namespace
}  // namespace glint
