// Rays through the trees that instances refer to.
#pragma once
#include "kernel_single.h"

namespace glint {
namespace {

template <bool Any>
void trace_tile(Tile& tile);

inline D3 to_object(const InstanceRecord& i, D3 v) { return v.x * d3(i.linear) + v.y * d3(i.linear + 3) + v.z * d3(i.linear + 6); }

/// Rays in arrays of their own.
struct Columns {
  alignas(64) double values[8][kTile];

  void show(Tile& tile) const {
    for (int a = 0; a < 3; ++a) tile.xyz_o[a] = values[a], tile.xyz_d[a] = values[3 + a];
    tile.t_min = values[6], tile.t_max = values[7];
  }
  /// Rays that hit nothing, up to a whole group.
  void fill(int count) {
    for (int k = count; k % kLanes; ++k)
      for (auto& column : values) column[k] = 0;
  }
};

/// Whether a ray certainly misses the ball round a tree: by far more than rounding.
inline bool passes_by(const TreeView& tree, D3 o, D3 d) {
  const D3 f = d3(tree.center) - o, n = {f.y * d.z - f.z * d.y, f.z * d.x - f.x * d.z, f.x * d.y - f.y * d.x};
  return dot(n, n) > (tree.ball * tree.ball + dot(f, f) * 0x1p-40) * dot(d, d);
}

/// A ray in the space of an instance's tree.
struct ObjectRay {
  D3 o, d;
  ObjectRay() = default;
  ObjectRay(const InstanceRecord& i, const Tile& tile, int r)
      : o(to_object(i, D3{tile.xyz_o[0][r], tile.xyz_o[1][r], tile.xyz_o[2][r]} - d3(i.origin))),
        d(to_object(i, {tile.xyz_d[0][r], tile.xyz_d[1][r], tile.xyz_d[2][r]})) {}
};

/// Rays of a tile on a visit to one object's tree, each by way of an instance of it.
template <bool Any>
struct Visit {
  Walk<Any>& w;
  Tile inner;
  Columns columns;
  uint32_t instances[kTile];
  uint8_t from[kTile];

  Visit(Walk<Any>& walk, uint32_t tree) : w(walk) {
    inner.answers = w.tile.answers, inner.tree = &w.world.objects[tree], inner.world = &w.world;
    inner.instances = instances, inner.count = 0;
  }
  void add(int r, const InstanceRecord& instance, const ObjectRay& ray) {
    const Answers& answers = *w.tile.answers;
    const int k = inner.count++, s = w.tile.slot[r];
    const double end = Any || answers.t_max[s] < answers.t[s] ? answers.t_max[s] : answers.t[s];
    const double row[8] = {ray.o.x, ray.o.y, ray.o.z, ray.d.x, ray.d.y, ray.d.z, w.tile.t_min[r], end};
    for (int c = 0; c < 8; ++c) columns.values[c][k] = row[c];
    inner.slot[k] = uint8_t(s), from[k] = uint8_t(r), instances[k] = instance.instance;
  }
  void trace() {
    if (inner.count == 0) return;
    columns.fill(inner.count);
    columns.show(inner);
    trace_tile<Any>(inner);
    for (int k = 0; k < inner.count; ++k) {
      if (!Any && w.tile.answers->t[inner.slot[k]] == columns.values[7][k]) continue;
      w.update(from[k]), w.trim(from[k]);
    }
  }
};

/// Some rays of a tile through one instance's tree.
template <bool Any>
__attribute__((noinline)) void trace_instance(Walk<Any>& w, const InstanceRecord& instance, uint64_t rays) {
  Visit<Any> visit(w, instance.tree);
  for (; rays; rays &= rays - 1) {
    const int r = __builtin_ctzll(rays);
    const ObjectRay ray(instance, w.tile, r);
    if (!passes_by(*visit.inner.tree, ray.o, ray.d)) visit.add(r, instance, ray);
  }
  visit.trace();
}

/// Rays of a tile through the instances of a leaf.
template <bool Any>
void trace_instances(Walk<Any>& w, ChildRef leaf, uint64_t rays) {
  for (uint32_t k = leaf_first(leaf), last = k + uint32_t(leaf_count(leaf)); k < last; ++k) {
    const InstanceRecord& instance = w.world.instances[k];
    if (!(instance.visibility & w.tile.answers->visibility)) continue;
    uint64_t living = 0;
    for (uint64_t m = rays; m; m &= m - 1)
      if (alive(w.tile, __builtin_ctzll(m))) living |= m & -m;
    if (living) trace_instance(w, instance, living);
  }
}

/// Rays without company in the tree over instances. Each goes on until it has come to an instance that it may hit. When all have, those
/// at instances of the same object go into its tree together: the instances may be different ones. A leaf is one instance.
template <bool Any>
struct Visitors : Company<Any, true> {
  using Company<Any, true>::w, Company<Any, true>::at, Company<Any, true>::walker;
  ObjectRay ray[kWalkers];
  uint32_t there = 0;  // have come to an instance

  explicit Visitors(Walk<Any>& walk) : Company<Any, true>(walk, walk.left.rays) {}
  void go() {
    for (uint32_t nodes, through;;) {
      this->look(nodes, through);
      const uint32_t leaves = this->everybody() & ~nodes & ~through & ~there;
      if (!(nodes | leaves | there)) return;
      if (leaves) arrive(leaves);
      else if (nodes) this->pass_nodes(nodes);
      else while (there) enter();
    }
  }
  const InstanceRecord& instance(int k) const { return w.world.instances[leaf_first(at[k])]; }
  /// Those that may hit their instance stay there.
  void arrive(uint32_t mask) {
    for (; mask; mask &= mask - 1) {
      const int k = __builtin_ctz(mask);
      const InstanceRecord& i = instance(k);
      ray[k] = ObjectRay(i, w.tile, walker[k].r);
      if (i.visibility & w.tile.answers->visibility && !passes_by(w.world.objects[i.tree], ray[k].o, ray[k].d)) there |= 1u << k;
      else Company<Any, true>::go(k, walker[k].pop());
    }
  }
  /// Sends those on their way that are at the same object as the first one.
  void enter() {
    const uint32_t tree = instance(__builtin_ctz(there)).tree;
    uint32_t same = 0;
    Visit<Any> visit(w, tree);
    for (uint32_t m = there; m; m &= m - 1) {
      const int k = __builtin_ctz(m);
      if (instance(k).tree == tree) visit.add(walker[k].r, instance(k), ray[k]), same |= m & -m;
    }
    visit.trace();
    there &= ~same;
    for (; same; same &= same - 1) leave(__builtin_ctz(same));
  }
  void leave(int k) {
    walker[k].shorten(w.tile);
    Company<Any, true>::go(k, alive(w.tile, walker[k].r) ? walker[k].pop() : kDone);
  }
};

template <bool Any>
__attribute__((noinline)) void visit_instances(Walk<Any>& w) {
  Visitors<Any>(w).go();
}

}  // namespace
}  // namespace glint
