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
  return dot(n, n) > (tree.radius * tree.radius + dot(f, f) * 0x1p-40) * dot(d, d);
}

/// Some rays of a tile through one instance's tree.
template <bool Any>
__attribute__((noinline)) void trace_instance(Walk<Any>& w, const InstanceRecord& instance, uint64_t rays) {
  Tile inner;
  Columns columns;
  const Answers& answers = *w.tile.answers;
  inner.answers = w.tile.answers, inner.tree = &w.world.objects[instance.tree], inner.world = &w.world;
  inner.instance = instance.instance, inner.count = 0;
  uint8_t from[kTile];
  for (uint64_t m = rays; m; m &= m - 1) {
    const int r = __builtin_ctzll(m), k = inner.count++, s = w.tile.slot[r];
    const Tile& t = w.tile;
    const D3 o = to_object(instance, D3{t.xyz_o[0][r], t.xyz_o[1][r], t.xyz_o[2][r]} - d3(instance.origin));
    const D3 d = to_object(instance, {t.xyz_d[0][r], t.xyz_d[1][r], t.xyz_d[2][r]});
    if (passes_by(*inner.tree, o, d)) {
      --inner.count;
      continue;
    }
    const double end = Any || answers.t_max[s] < answers.t[s] ? answers.t_max[s] : answers.t[s];
    const double row[8] = {o.x, o.y, o.z, d.x, d.y, d.z, t.t_min[r], end};
    for (int c = 0; c < 8; ++c) columns.values[c][k] = row[c];
    inner.slot[k] = uint8_t(s), from[k] = uint8_t(r);
  }
  if (inner.count == 0) return;
  columns.fill(inner.count);
  columns.show(inner);
  trace_tile<Any>(inner);
  for (int k = 0; k < inner.count; ++k) {
    const int s = inner.slot[k];
    if (!Any && answers.t[s] == columns.values[7][k]) continue;
    w.update(from[k]), w.trim(from[k]);
  }
}

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

}  // namespace
}  // namespace glint
