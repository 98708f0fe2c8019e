// Rays through the trees that instances refer to.
#pragma once
#include "bvh/traverse/kernel_single.h"

namespace glint {
namespace {

template <bool Any>
void trace_tile(Tile& tile);

/// Rays in arrays of their own.
struct Columns {
  alignas(64) double values[8][kTile];

  void show(Tile& tile) const {
    for (int a = 0; a < 3; ++a) {
      tile.xyz_o[a] = values[a];
      tile.xyz_d[a] = values[3 + a];
    }
    tile.t_min = values[6];
    tile.t_max = values[7];
  }
  /// Rays that hit nothing, up to a whole group; where all of them may be one packet, up to a whole
  /// tile, beside the first one.
  void fill(int count) {
    const int end = count < kLeastPacket ? (count + kFloats - 1) / kFloats * kFloats : kTile;
    for (int c = 0; c < 8; ++c)
      for (int k = count; k < end; ++k) values[c][k] = c < 6 ? values[c][0] : 0;
  }
};

inline void take(const double* p, double& v) { v = *p; }
inline void take(const double* p, Doubles& v) { v = load(p); }

/// A ray, or several, by component: origin and direction.
template <class V>
struct OpenRay {
  V o[3], d[3];
  OpenRay() = default;
  template <class Source>
  OpenRay(const Source& tile, int r) {
    for (int a = 0; a < 3; ++a) {
      take(tile.xyz_o[a] + r, o[a]);
      take(tile.xyz_d[a] + r, d[a]);
    }
  }
  /// In the space of an instance's tree.
  template <class Source>
  OpenRay(const InstanceRecord& i, const Source& tile, int r) {
    const OpenRay world(tile, r);
    const V p[3] = {world.o[0] - i.origin[0], world.o[1] - i.origin[1], world.o[2] - i.origin[2]};
    for (int a = 0; a < 3; ++a) {
      o[a] = p[0] * i.linear[a] + p[1] * i.linear[3 + a] + p[2] * i.linear[6 + a];
      d[a] = world.d[0] * i.linear[a] + world.d[1] * i.linear[3 + a] + world.d[2] * i.linear[6 + a];
    }
  }
  /// Whether it certainly misses the ball round a tree: by far more than rounding.
  auto passes_by(const TreeView& tree) const {
    const V f[3] = {tree.center[0] - o[0], tree.center[1] - o[1], tree.center[2] - o[2]};
    const V n[3] = {f[1] * d[2] - f[2] * d[1], f[2] * d[0] - f[0] * d[2],
                    f[0] * d[1] - f[1] * d[0]};
    return dot(n, n) > (tree.ball * tree.ball + dot(f, f) * 0x1p-40) * dot(d, d);
  }

 private:
  static V dot(const V (&a)[3], const V (&b)[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
};

/// Rays of a tile on a visit to one object's tree, each by way of an instance of it. Slots of a
/// tile in the world are its rays.
template <bool Any>
struct Visit {
  Walk<Any>& w;
  Tile inner;
  Columns columns;
  uint32_t instances[kTile];

  Visit(Walk<Any>& walk, uint32_t tree) : w(walk) {
    inner.answers = w.tile.answers;
    inner.tree = &w.world.objects[tree];
    inner.world = &w.world;
    inner.instances = instances;
    inner.count = 0;
  }
  void add(int r, const InstanceRecord& instance, const OpenRay<double>& ray) {
    for (int a = 0; a < 3; ++a) {
      columns.values[a][inner.count] = ray.o[a];
      columns.values[3 + a][inner.count] = ray.d[a];
    }
    add_end(r, instance);
  }
  /// Those of the rays [k, k + kLanes) that do not pass by.
  void add(int k, uint32_t rays, const InstanceRecord& instance) {
    const OpenRay<Doubles> all(instance, w.tile, k);
    rays &= ~bits(all.passes_by(*inner.tree));
    if (!rays) return;
    const int to = inner.count;
    for (int a = 0; a < 3; ++a) {
      store(columns.values[a] + to, packed(all.o[a], rays));
      store(columns.values[3 + a] + to, packed(all.d[a], rays));
    }
    if (k + kLanes > w.tile.count) {  // answers end there
      for (; rays; rays &= rays - 1) add_end(k + __builtin_ctz(rays), instance);
      return;
    }
    const Answers& answers = *w.tile.answers;
    const Doubles end = load(answers.t_max + k);
    store(columns.values[6] + to, packed(load(w.tile.t_min + k), rays));
    store(columns.values[7] + to, packed(Any ? end : smaller(end, load(answers.t + k)), rays));
    for (; rays; rays &= rays - 1) {
      inner.slot[inner.count] = uint8_t(k + __builtin_ctz(rays));
      instances[inner.count++] = instance.instance;
    }
  }
  void add_end(int r, const InstanceRecord& instance) {
    const Answers& answers = *w.tile.answers;
    const int k = inner.count++;
    columns.values[6][k] = w.tile.t_min[r];
    columns.values[7][k] = Any || answers.t_max[r] < answers.t[r] ? answers.t_max[r] : answers.t[r];
    inner.slot[k] = uint8_t(r);
    instances[k] = instance.instance;
  }
  void trace() {
    if (inner.count == 0) return;
    columns.fill(inner.count);
    columns.show(inner);
    trace_tile<Any>(inner);
    for (int k = 0; k < inner.count; ++k) {
      const int r = inner.slot[k];
      if (Any ? w.tile.answers->blocked[r] != w.tile.answers->stop()
              : w.tile.answers->t[r] == columns.values[7][k])
        continue;
      w.update(r);
      w.trim(r);
    }
  }
};

/// Some rays of a tile through one instance's tree.
template <bool Any>
__attribute__((noinline)) void trace_instance(Walk<Any>& w, const InstanceRecord& instance,
                                              uint64_t rays) {
  Visit<Any> visit(w, instance.tree);
  for (int k = 0; k < w.tile.count; k += kLanes)
    if (const uint32_t some = rays >> k & ((1u << kLanes) - 1)) visit.add(k, some, instance);
  visit.trace();
}

/// Rays of a tile through the instances of a leaf.
template <bool Any>
void trace_instances(Walk<Any>& w, ChildRef leaf, uint64_t rays) {
  for (uint32_t i = leaf_first(leaf), last = i + uint32_t(leaf_count(leaf)); i < last; ++i) {
    const InstanceRecord& instance = w.world.instances[i];
    if (!(instance.visibility & w.tile.answers->visibility)) continue;
    uint64_t alive = 0;
    for (int k = 0; k < w.tile.count; k += kFloats) alive |= uint64_t(living(w.tile, k)) << k;
    if (alive & rays) trace_instance(w, instance, alive & rays);
  }
}

/// Rays without company in the tree over instances. Each goes on until it has come to an instance
/// that it may hit. When all have, those at instances of the same object go into its tree together:
/// the instances may be different ones. A leaf is one instance.
template <bool Any>
struct InstanceTraversal : InterleavedRays<Any, true> {
  using InterleavedRays<Any, true>::w, InterleavedRays<Any, true>::at,
      InterleavedRays<Any, true>::single;
  OpenRay<double> ray[kInterleaved];
  uint64_t there = 0;  // have come to an instance

  using InterleavedRays<Any, true>::InterleavedRays;
  void go() {
    for (uint64_t nodes, leaves;;) {
      this->look(nodes, leaves);
      leaves &= ~there;
      if (!(nodes | leaves | there)) return;
      if (leaves) arrive(leaves);
      else if (nodes) this->pass_nodes(nodes);
      else
        while (there) enter();
    }
  }
  const InstanceRecord& instance(int k) const { return w.world.instances[leaf_first(at[k])]; }
  /// Those that may hit their instance stay there.
  void arrive(uint64_t mask) {
    for (; mask; mask &= mask - 1) {
      const int k = __builtin_ctzll(mask);
      const InstanceRecord& i = instance(k);
      ray[k] = {i, w.tile, single[k].r};
      if (i.visibility & w.tile.answers->visibility && !ray[k].passes_by(w.world.objects[i.tree]))
        there |= uint64_t(1) << k;
      else InterleavedRays<Any, true>::go(k, single[k].pop());
    }
  }
  /// Sends those on their way that are at the same object as the first one.
  void enter() {
    const uint32_t tree = instance(__builtin_ctzll(there)).tree;
    uint64_t same = 0;
    Visit<Any> visit(w, tree);
    for (uint64_t m = there; m; m &= m - 1) {
      const int k = __builtin_ctzll(m);
      if (instance(k).tree == tree) {
        visit.add(single[k].r, instance(k), ray[k]);
        same |= m & -m;
      }
    }
    visit.trace();
    there &= ~same;
    for (; same; same &= same - 1) leave(__builtin_ctzll(same));
  }
  void leave(int k) {
    single[k].shorten(w.tile);
    InterleavedRays<Any, true>::go(k, alive(w.tile, single[k].r) ? single[k].pop() : kDone);
  }
};

template <bool Any>
__attribute__((noinline)) void visit_instances(Walk<Any>& w) {
  InstanceTraversal<Any>(w).go();
}

}  // namespace
}  // namespace glint
