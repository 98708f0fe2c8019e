// Packets of rays against boxes. At each depth a packet lies between two lines in either axis
// across: c + m depth (in coordinates of the tree's space, the depth axis in the rays' sense).
// Rounding can be bounded without divisions, and 0 times infinity does not occur.
#pragma once
#include "bvh/traverse/kernel_tile.h"

namespace glint {
namespace {

enum Line { kLowX, kHighX, kLowY, kHighY, kLines };

/// A packet exists from depth `first` to depth `last`, coordinates of the depth axis.
struct Frustum {
  float first, last, c[kLines], m[kLines];
};

/// Where the planes of a node are, seen along the rays of one axis class (Tile::axis_class):
/// offsets in Node::planes, and the sign of the depth axis.
struct Order {
  uint32_t low[2], high[2], front, rear;  // front and rear: the depth axis
  float sign;
  int axes[3];
  constexpr explicit Order(uint32_t kind)
      : low{}, high{}, front(0), rear(0), sign(kind >> 2 ? -1.0f : 1.0f), axes{} {
    const int z = int(kind & 3), back = int(kind >> 2);
    axes[0] = z == 2 ? 0 : z + 1;
    axes[1] = z == 0 ? 2 : z - 1;
    axes[2] = z;
    for (int k = 0; k < 2; ++k) {
      low[k] = uint32_t(2 * axes[k] * kWidth);
      high[k] = low[k] + kWidth;
    }
    front = uint32_t((2 * z + back) * kWidth);
    rear = uint32_t((2 * z + 1 - back) * kWidth);
  }
};
constexpr Order kOrders[8] = {Order(0), Order(1), Order(2), Order(0),
                              Order(4), Order(5), Order(6), Order(4)};
inline const Order& order_of(const Tile& tile, int r) { return kOrders[tile.axis_class[r]]; }

/// Which axis is Order::axes[a] for rays of these kinds.
inline Ints across(Ints kind, int a) {
  const Ints z = kind & 3;
  return a == 0 ? (z + 1) & Ints(z < 2) : z - 1 + (Ints(z < 1) & 3);
}

/// Boxes in the order of the rays' axes, kFloats of them.
struct Boxes {
  Floats low_x, high_x, low_y, high_y, front, rear;
};

__attribute__((always_inline)) inline Boxes boxes_of(const float* planes, const Order& order) {
  const Floats sign = splat(order.sign);
  return {load(planes + order.low[0]),       load(planes + order.high[0]),
          load(planes + order.low[1]),       load(planes + order.high[1]),
          load(planes + order.front) * sign, load(planes + order.rear) * sign};
}

/// Which lanes of boxes and packets do not miss each other; where a number is NaN, they do not.
__attribute__((always_inline)) inline uint32_t meet(const Boxes& b, Floats first, Floats last,
                                                    const Floats (&c)[kLines],
                                                    const Floats (&m)[kLines]) {
  const Floats front = larger(b.front, first), rear = smaller(b.rear, last);
  const FloatMask right = less(c[kHighX] + larger(m[kHighX] * front, m[kHighX] * rear), b.low_x);
  const FloatMask left = less(b.high_x, c[kLowX] + smaller(m[kLowX] * front, m[kLowX] * rear));
  const FloatMask above = less(c[kHighY] + larger(m[kHighY] * front, m[kHighY] * rear), b.low_y);
  const FloatMask below = less(b.high_y, c[kLowY] + smaller(m[kLowY] * front, m[kLowY] * rear));
  return ~bits(less(rear, front) | right | left | above | below) & ((1u << kFloats) - 1);
}

/// One packet, in all lanes.
struct WideFrustum {
  Floats first, last, c[kLines], m[kLines];
  explicit WideFrustum(const Frustum& f) : first(splat(f.first)), last(splat(f.last)) {
    for (int k = 0; k < kLines; ++k) {
      c[k] = splat(f.c[k]);
      m[k] = splat(f.m[k]);
    }
  }
  __attribute__((always_inline)) uint32_t meet(const Boxes& b) const {
    return glint::meet(b, first, last, c, m);
  }
};

/// Between which coordinates of the depth axis rays begin.
struct StartRange {
  float first, last;
};

/// Rays of a tile that go down together, all of one axis class. A ray exists from depth `first` to
/// depth `last`, coordinates of the depth axis, and crosses a plane across at `inverse` times it
/// plus `at`.
struct Packet {
  alignas(64) float inverse[2][kTile], at[2][kTile], first[kTile], last[kTile];
  Frustum whole;
  StartRange starts;
};

/// The line through two planes' values.
inline void line_through(float at_first, float at_last, float first, float last, float margin,
                         float& c, float& m) {
  const float length = last - first;
  m = length > 0 ? (at_last - at_first) / length : 0;
  c = at_first - m * first + margin;
}

/// Between which depths the tree lies for rays of one order.
struct DepthRange {
  Floats front, rear;
  DepthRange(const Tile& tile, const Order& order) {
    const float center = order.sign * float(tile.tree->center[order.axes[2]]),
                radius = float(tile.tree->radius) * 1.001f + tile.margin;
    front = splat(center - radius);
    rear = splat(center + radius);
  }
};

/// Where the rays [k, k + kFloats) of a packet cross planes. What that is off by moves a ray across
/// by 14.1 u of the largest coordinate, of which boxes have 20 u. Rays along a plane get a slope of
/// 2^-60, which leads out of no box.
inline void set_crossings(const Tile& tile, Packet& p, int k) {
  for (int a = 0; a < 2; ++a) {
    const Floats slope = load(tile.slope[a] + k);
    const Floats least = Floats(Ints(splat(0x1p-60f)) | (Ints(slope) & INT32_MIN));
    const Floats inverse = 1 / choose(less(magnitude(slope), splat(0x1p-60f)), least, slope);
    store(p.inverse[a] + k, inverse);
    store(p.at[a] + k, fused(-load(tile.of[a] + k), inverse, load(tile.start + k)));
  }
}

/// Lanes of a vector among a tile's rays.
inline uint32_t some_of(uint64_t rays, int k, int count) {
  return uint32_t(rays >> k) & uint32_t((uint64_t(1) << count) - 1);
}

/// The frustum of some rays of a tile, and where each begins and ends. Returns how far apart they
/// are: the area that they cover where they begin and where they end.
inline float set_frustum(const Tile& tile, Packet& p, const Order& order, uint64_t rays) {
  const DepthRange range(tile, order);
  const Floats margin = splat(tile.margin), far = splat(kFar);
  Floats first = far, last = -far, begin = far, end = -far;
  for (int k = 0; k < kTile; k += kFloats) {
    const uint32_t some = some_of(rays, k, kFloats);
    if (!some) continue;
    const FloatMask mine = lanes(some);
    const Floats start = load(tile.start + k);
    // The beginning needs room for rounding start + begin alone: with more, rays would enter boxes
    // of the surface that they leave.
    const Floats from =
                     larger(start + load(tile.begin_lo + k) - splat(0.25f) * margin, range.front),
                 to = smaller(start + load(tile.hi + k) + margin, range.rear);
    store(p.first + k, from);
    store(p.last + k, to);
    first = smaller(choose(mine, from, far), first);
    last = larger(choose(mine, to, -far), last);
    begin = smaller(choose(mine, start, far), begin);
    end = larger(choose(mine, start, -far), end);
  }
  p.starts = {smallest(begin), largest(end)};
  Frustum& f = p.whole;
  f.first = smallest(first);
  f.last = largest(last);
  float near = 1, away = 1;
  for (int a = 0; a < 2; ++a) {
    Floats low[2] = {far, far}, high[2] = {-far, -far};
    for (int k = 0; k < kTile; k += kFloats) {
      const uint32_t some = some_of(rays, k, kFloats);
      if (!some) continue;
      const FloatMask mine = lanes(some);
      const Floats m = load(tile.slope[a] + k), c = load(tile.of[a] + k) - m * load(tile.start + k);
      for (int e = 0; e < 2; ++e) {
        const Floats at = c + m * splat(e ? f.last : f.first);
        low[e] = smaller(choose(mine, at, far), low[e]);
        high[e] = larger(choose(mine, at, -far), high[e]);
      }
    }
    const float low_near = smallest(low[0]), low_away = smallest(low[1]),
                high_near = largest(high[0]), high_away = largest(high[1]), room = 2 * tile.margin;
    line_through(low_near, low_away, f.first, f.last, -room, f.c[2 * a], f.m[2 * a]);
    line_through(high_near, high_away, f.first, f.last, room, f.c[2 * a + 1], f.m[2 * a + 1]);
    near *= high_near - low_near;
    away *= high_away - low_away;
  }
  return near + away;
}

}  // namespace
}  // namespace glint
