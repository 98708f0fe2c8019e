// Hits in double precision: of triangles whose depth intervals overlap that of the best hit, and of
// the nearest one of each ray in the end.
#pragma once
#include "bvh/traverse/kernel_walk.h"

namespace glint {
namespace {

/// The rays [k + h, k + h + kLanes) against a triangle each, in double. Returns which of them
/// weigh() has answered.
inline uint32_t exact_hits(const Tile& tile, int k, int h, const Doubles (&p)[3][3], double* t,
                           float* u, float* v) {
  Exact<Doubles> e;
  const int at = k + h;
  const Doubles o[3] = {load(tile.o[0] + at), load(tile.o[1] + at), load(tile.o[2] + at)};
  const Doubles shear[2] = {load(tile.shear[0] + at), load(tile.shear[1] + at)};
  e.see(p, o, shear);
  e.weigh();
  store(t + h, e.depth / load(tile.along + at));
  narrow(u + h, e.u);
  narrow(v + h, e.v);
  const Doubles margin = splat(tile.close);
  return bits(at_most(magnitude(e.off_x), margin) & at_most(magnitude(e.off_y), margin));
}
/// A triangle for each ray.
inline uint32_t exact_hits(const Tile& tile, int k, int h, const float (&corner)[9][kFloats],
                           double* t, float* u, float* v) {
  Doubles p[3][3];
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) p[j][a] = widen(corner[3 * j + a] + h);
  return exact_hits(tile, k, h, p, t, u, v);
}
/// One triangle for the rays [k, k + kFloats).
inline uint32_t exact_hits(const Tile& tile, int k, const Triangles& leaf, int place,
                           const Order& order, double* t, float* u, float* v) {
  Doubles p[3][3];
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) p[j][a] = splat(double(leaf.at(j, order.axes[a])[place]));
  uint32_t close = 0;
  for (int h = 0; h < kFloats; h += kLanes) close |= exact_hits(tile, k, h, p, t, u, v) << h;
  return close;
}

/// The pending hits of the rays [k, k + kFloats): corner by corner, coordinates in the rays' order,
/// and whose triangles they are. Lanes without one get any.
inline void gather_corners(const Tile& tile, int k, float (&corner)[9][kFloats], Ints& instance,
                           Ints& primitive) {
  const TreeView& tree = *tile.tree;
  const Ints pending = load(tile.pending + k), some = pending != Ints{},
             ordinal = pending & some & int32_t(kOrdinal);
  const Ints n = ((pending >> kCountShift & 7) + 1) & some,
             first = 9 * ordinal + (load(tile.place + k) & some);
  const Ints axis[3] = {across(load(tile.axis_class + k), 0), across(load(tile.axis_class + k), 1),
                        load(tile.axis_class + k) & 3};
  for (int a = 0; a < 3; ++a) {
    Ints at = first + axis[a] * n;
    for (int j = 0; j < 3; ++j, at += 3 * n) store(corner[3 * j + a], read_at(tree.floats, at));
  }
  const Ints id = 2 * (ordinal + (load(tile.place + k) & some));
  const float* ids = reinterpret_cast<const float*>(tree.ids);
  instance = tile.instances ? load(tile.instances + k) : Ints(read_at(ids, id));
  primitive = Ints(read_at(ids, id + 1));
}

/// Hits of the rays [k, k + kFloats), computed.
struct Found {
  alignas(64) double t[kFloats];
  alignas(64) float u[kFloats], v[kFloats];
  Ints instance, primitive;
  uint32_t close;  // lanes that weigh() has answered
};

/// The pending hits of the rays [k, k + kFloats), those of `mask`.
inline void find_hits(const Tile& tile, int k, uint32_t mask, Found& f) {
  const int r = k + __builtin_ctz(mask);
  const ChildRef leaf = tile.pending[r];
  const Ints other = (load(tile.pending + k) ^ int32_t(leaf)) |
                     (load(tile.place + k) ^ int32_t(tile.place[r])) |
                     (load(tile.axis_class + k) ^ int32_t(tile.axis_class[r]));
  if (all_zero(other)) {
    const int place = int(tile.place[r]);
    const PrimitiveId id = id_of(tile, r, leaf_first(leaf) + uint32_t(place));
    f.instance = tile.instances ? load(tile.instances + k) : Ints{} + int32_t(id.instance);
    f.primitive = Ints{} + int32_t(id.primitive);
    f.close =
        exact_hits(tile, k, Triangles(*tile.tree, leaf), place, order_of(tile, r), f.t, f.u, f.v);
    return;
  }
  alignas(64) float corner[9][kFloats];
  gather_corners(tile, k, corner, f.instance, f.primitive);
  f.close = 0;
  for (int h = 0; h < kFloats; h += kLanes)
    f.close |= exact_hits(tile, k, h, corner, f.t, f.u, f.v) << h;
}

/// Computes the pending hits of the rays [k, k + kFloats).
inline void finish_group(Walk<false>& w, int k) {
  Tile& tile = w.tile;
  const uint32_t mask = ~bits(equal(load(tile.pending + k), Ints{})) & ((1u << kFloats) - 1);
  if (!mask) return;
  Found f;
  find_hits(tile, k, mask, f);
  Answers& answers = *tile.answers;
  if (!(mask & ~f.close) && !tile.instances &&
      k + kFloats <= tile.count) {  // slots are those of the rays
    const FloatMask none = equal(load(tile.pending + k), Ints{});
    for (int h = 0; h < kFloats; h += kLanes)
      store(answers.t + k + h, choose(Longs(widen(tile.pending + k + h) != Longs{}), load(f.t + h),
                                      load(answers.t + k + h)));
    store(answers.u + k, choose(none, load(answers.u + k), load(f.u)));
    store(answers.v + k, choose(none, load(answers.v + k), load(f.v)));
    store(answers.instance + k, choose(none, load(answers.instance + k), f.instance));
    store(answers.primitive + k, choose(none, load(answers.primitive + k), f.primitive));
    return;
  }
  for (uint32_t m = mask; m; m &= m - 1) {
    const int lane = __builtin_ctz(m), r = k + lane, s = tile.slot[r];
    if (!(f.close >> lane & 1)) {
      w.take(r, tile.pending[r], int(tile.place[r]));
      continue;
    }
    answers.t[s] = f.t[lane];
    answers.u[s] = f.u[lane];
    answers.v[s] = f.v[lane];
    answers.instance[s] = uint32_t(f.instance[lane]);
    answers.primitive[s] = uint32_t(f.primitive[lane]);
  }
}

}  // namespace
}  // namespace glint
