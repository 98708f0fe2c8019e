// One ray through a tree, nearest boxes first.
#pragma once
#include "kernel_leaves.h"

namespace glint {
namespace {

template <bool Any>
void trace_instances(Walk<Any>& w, ChildRef leaf, uint64_t rays);

/// One ray's numbers for boxes, in all lanes. Slabs are ordered by the direction's signs.
struct BoxRay {
  Floats near_o[3], far_o[3], near_inverse[3], far_inverse[3], first, last;
  uint32_t near_plane[3], far_plane[3];  // offsets in Node::planes
  BoxRay(const Tile& tile, int r, const Order& order) : first(splat(tile.begin_lo[r])), last(splat(tile.hi[r])) {
    // The triangle test rounds p - o as these slabs do: what else it rounds is half of the room, and nothing along the depth.
    const float room = 0.5f * tile.room;
    for (int k = 0; k < 2; ++k) {
      const float inverse = 1 / tile.slope[k][r];
      uint32_t sign_bit;
      __builtin_memcpy(&sign_bit, &inverse, sizeof sign_bit);
      const bool back = sign_bit >> 31;
      const float o = tile.of[k][r], outward = back ? -room : room;
      near_o[k] = splat(o + outward), far_o[k] = splat(o - outward);
      set_inverse(k, inverse);
      near_plane[k] = back ? order.high[k] : order.low[k], far_plane[k] = back ? order.low[k] : order.high[k];
    }
    near_o[2] = far_o[2] = splat(order.sign * tile.start[r]);
    set_inverse(2, order.sign);
    near_plane[2] = order.front, far_plane[2] = order.rear;
  }
  /// The far side is a little longer than computed (Ize 2013: two ulps; here eight).
  void set_inverse(int k, float inverse) { near_inverse[k] = splat(inverse), far_inverse[k] = splat(inverse * (1 + 0x1p-20f)); }
};

/// Which children the ray meets, and how deep. 0 * inf is NaN: `larger` and `smaller` then give up a bound or two, and at worst a box is
/// entered in vain.
struct BoxHits {
  Floats near[kWidth / kLanes];
  uint32_t mask = 0;
  __attribute__((always_inline)) BoxHits(const Node& n, const BoxRay& b) {
    for (int first = 0; first < kWidth; first += kLanes) {
      const float* planes = n.planes[0] + first;
      const Floats near_x = (load(planes + b.near_plane[0]) - b.near_o[0]) * b.near_inverse[0];
      const Floats near_y = (load(planes + b.near_plane[1]) - b.near_o[1]) * b.near_inverse[1];
      const Floats near_z = (load(planes + b.near_plane[2]) - b.near_o[2]) * b.near_inverse[2];
      const Floats far_x = (load(planes + b.far_plane[0]) - b.far_o[0]) * b.far_inverse[0];
      const Floats far_y = (load(planes + b.far_plane[1]) - b.far_o[1]) * b.far_inverse[1];
      const Floats far_z = (load(planes + b.far_plane[2]) - b.far_o[2]) * b.far_inverse[2];
      near[first / kLanes] = larger(larger(near_x, near_y), larger(near_z, b.first));
      mask |= bits(near[first / kLanes] <= smaller(smaller(smaller(far_x, far_y), far_z), b.last)) << first;
    }
  }
};

/// Decides or takes the triangles of `mask`, not culled, whose depths are between lo and hi. `sure`: hit without doubt.
template <bool Any>
__attribute__((noinline)) void take_triangles(Walk<Any>& w, int r, ChildRef ref, int first, uint32_t mask, const TriangleTest& t, Floats lo,
                                              Floats hi) {
  Tile& tile = w.tile;
  const uint32_t sure = bits(t.sure());
  alignas(64) float nearest[kLanes], farthest[kLanes];
  store(nearest, lo), store(farthest, hi);
  for (; mask; mask &= mask - 1) {
    const int lane = __builtin_ctz(mask), place = first + lane;
    const bool hit = sure >> lane & 1;
    if (hit && nearest[lane] > tile.hi[r]) continue;
    if (!visible(tile, leaf_first(ref) + uint32_t(place))) continue;
    if (hit && farthest[lane] < tile.lo[r] && nearest[lane] > tile.begin_hi[r]) {
      if (Any) return w.block(r);
      tile.lo[r] = nearest[lane], tile.hi[r] = farthest[lane], tile.pending[r] = ref, tile.place[r] = uint32_t(place);
    } else if (hit || t.exactly(lane)) {
      w.decide(r, ref, place);
      if (Any && !alive(tile, r)) return;
    }
  }
}

/// The triangles of a leaf against one ray.
template <bool Any>
inline void hit_triangles(Walk<Any>& w, int r, ChildRef ref, const Order& order) {
  const Tile& tile = w.tile;
  const int n = leaf_count(ref);
  const float* leaf = w.tree.floats + 9 * size_t(leaf_first(ref));
  const float *px = leaf + order.axes[0] * n, *py = leaf + order.axes[1] * n, *pz = leaf + order.axes[2] * n;
  const size_t corner = 3 * size_t(n);
  const Floats ox = splat(tile.of[0][r]), oy = splat(tile.of[1][r]), oz = splat(tile.start[r]), sign = splat(order.sign);
  const Floats rx = splat(tile.rest[0][r]), ry = splat(tile.rest[1][r]), rz = splat(tile.rest[2][r]);
  const Floats sx = splat(tile.slope[0][r]), sy = splat(tile.slope[1][r]);
  for (int first = 0; first < n; first += kLanes) {
    TriangleTest t;
    for (size_t j = 0; j < 3; ++j) {
      t.z[j] = load(pz + j * corner + first) * sign - oz - rz;
      t.x[j] = load(px + j * corner + first) - ox - rx - sx * t.z[j];
      t.y[j] = load(py + j * corner + first) - oy - ry - sy * t.z[j];
    }
    t.edges();
    const int rest = n - first < kLanes ? n - first : kLanes;
    uint32_t mask = ~t.conflict() & ((1u << rest) - 1);
    if (!mask) continue;
    Floats lo, hi;
    t.depth(t.extent(), tile.far_room, lo, hi);
    mask &= ~bits(t.sure() & ((lo > splat(tile.hi[r])) | (hi < splat(tile.begin_lo[r]))));
    if (mask) take_triangles(w, r, ref, first, mask, t, lo, hi);
  }
}

template <bool Any>
inline void hit_leaf(Walk<Any>& w, int r, ChildRef leaf, const Order& order) {
  if (w.tree.kind == kTriangleLeaf) hit_triangles(w, r, leaf, order);
  else if (w.tree.kind == kInstanceLeaf) trace_instances(w, leaf, uint64_t(1) << r);
  else hit_shapes(w, r, leaf);
}

struct Waiting {
  ChildRef child;
  float distance;
};

/// Puts the children of `mask`, three or more, on the stack, the nearest on top, and takes that one off.
inline Waiting nearest_of(const Node& n, uint32_t mask, const float* distance, Waiting*& top) {
  Waiting* const base = top;
  for (; mask; mask &= mask - 1) {
    const int k = __builtin_ctz(mask);
    const Waiting e{n.child[k], distance[k]};
    Waiting* p = top++;
    for (; p > base && p[-1].distance < e.distance; --p) *p = p[-1];
    *p = e;
  }
  return *--top;
}

/// One ray through the part of a tree below `child`. Bundles do not learn of it: Walk::trim.
template <bool Any>
__attribute__((noinline)) void walk_ray(Walk<Any>& w, int r, ChildRef child) {
  const Order& order = order_of(w.tile, r);
  Waiting stack[kStack], *top = stack;
  BoxRay b(w.tile, r, order);
  float end = w.tile.hi[r];
  alignas(64) float distance[kWidth];
  for (;;) {
    bool missed = false;
    while (!(child & kLeaf)) {
      const Node& n = w.tree.nodes[child];
      const BoxHits met(n, b);
      if ((missed = met.mask == 0)) break;
      const int one = __builtin_ctz(met.mask);
      uint32_t others = met.mask & (met.mask - 1);
      child = n.child[one];
      if (!others) continue;
      for (int k = 0; k < kWidth / kLanes; ++k) store(distance + k * kLanes, met.near[k]);
      const int two = __builtin_ctz(others);
      if (others & (others - 1)) {
        child = nearest_of(n, met.mask, distance, top).child;
        continue;
      }
      const bool swap = distance[two] < distance[one];
      *top++ = {n.child[swap ? one : two], distance[swap ? one : two]};
      child = n.child[swap ? two : one];
    }
    if (!missed) {
      hit_leaf(w, r, child, order);
      end = w.tile.hi[r];
      if (Any && !(end > -kFar)) return;
      b.last = splat(end);
    }
    do {
      if (top == stack) return;
      --top;
    } while (top->distance > end);
    child = top->child;
  }
}

}  // namespace
}  // namespace glint
