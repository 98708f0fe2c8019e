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

/// Triangles with corners x, y, z to the order of rays of these kinds: corner by corner.
inline void turn(const Picked& triangles, Ints kind, float (&corner)[9][kFloats]) {
  const FloatMask x = equal(kind, Ints{}), y = equal(kind, Ints{} + 1);
  for (int c = 0; c < 9; c += 3) {
    const Floats* p = triangles.corner + c;
    store(corner[c], choose(x, p[1], choose(y, p[2], p[0])));
    store(corner[c + 1], choose(x, p[2], choose(y, p[0], p[1])));
    store(corner[c + 2], choose(x, p[0], choose(y, p[1], p[2])));
  }
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
  const Picked triangles(*tile.tree, tile.pending + k, tile.place + k, mask, {0, 1, 2});
  alignas(64) float corner[9][kFloats];
  turn(triangles, load(tile.axis_class + k) & 3, corner);
  f.instance = tile.instances ? load(tile.instances + k) : triangles.instance;
  f.primitive = triangles.primitive;
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
