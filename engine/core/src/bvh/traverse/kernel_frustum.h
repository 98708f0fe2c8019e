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

/// Several packets, one to a lane.
template <int Count>
struct Frusta {
  alignas(64) float first[Count], last[Count], c[kLines][Count], m[kLines][Count];
  Frustum at(int k) const {
    return {first[k],
            last[k],
            {c[0][k], c[1][k], c[2][k], c[3][k]},
            {m[0][k], m[1][k], m[2][k], m[3][k]}};
  }
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

/// Which packets [base, base + count) meet one box.
template <int Count>
__attribute__((always_inline)) inline uint32_t units_met(const Frusta<Count>& units, int base,
                                                         int count, const Boxes& box) {
  uint32_t mask = 0;
  for (int k = 0; k < count; k += kFloats) {
    const int at = base + k;
    const Floats c[kLines] = {load(units.c[0] + at), load(units.c[1] + at), load(units.c[2] + at),
                              load(units.c[3] + at)};
    const Floats m[kLines] = {load(units.m[0] + at), load(units.m[1] + at), load(units.m[2] + at),
                              load(units.m[3] + at)};
    mask |= meet(box, load(units.first + at), load(units.last + at), c, m) << k;
  }
  return mask;
}

/// One child of a node in all lanes.
__attribute__((always_inline)) inline Boxes child_box(const Node& n, int child,
                                                      const Order& order) {
  const float* p = n.planes[0] + child;
  return {splat(p[order.low[0]]),
          splat(p[order.high[0]]),
          splat(p[order.low[1]]),
          splat(p[order.high[1]]),
          splat(p[order.front] * order.sign),
          splat(p[order.rear] * order.sign)};
}

/// Between which coordinates of the depth axis rays begin.
struct StartRange {
  float first, last;
};
inline StartRange starts_of(const Tile& tile, int k, int end) {
  Floats first = load(tile.start + k), last = first;
  for (k += kFloats; k < end; k += kFloats) {
    first = smaller(load(tile.start + k), first);
    last = larger(load(tile.start + k), last);
  }
  return {smallest(first), largest(last)};
}

/// All packets of a tile whose rays are of one axis class: rays, groups of kFloats, all.
struct Packets {
  Frusta<kTile> rays;
  Frusta<(kGroups < kFloats ? kFloats : kGroups)> groups;
  Frustum all;
  StartRange starts[kGroups];
  uint32_t lines = 0;  // groups whose rays have their lines and `starts`
};

/// The lines through two planes' values.
inline void line_through(float at_first, float at_last, float first, float last, float margin,
                         float& c, float& m) {
  const float length = last - first;
  m = length > 0 ? (at_last - at_first) / length : 0;
  c = at_first - m * first + margin;
}

/// The same for packets in lanes.
inline void lines_through(Floats at_first, Floats at_last, Floats first, Floats last, Floats margin,
                          float* c, float* m) {
  const Floats length = last - first,
               slope = choose(less(Floats{}, length), (at_last - at_first) / length, Floats{});
  store(m, slope);
  store(c, at_first - slope * first + margin);
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

/// How deep the rays [k, k + kFloats) go.
inline void set_ray_depths(const Tile& tile, Packets& b, int k, const DepthRange& range) {
  const Floats start = load(tile.start + k), margin = splat(tile.margin);
  // The beginning needs room for rounding start + begin alone: with more, rays would enter boxes of
  // the surface that they leave.
  store(b.rays.first + k,
        larger(start + load(tile.begin_lo + k) - splat(0.25f * tile.margin), range.front));
  store(b.rays.last + k, smaller(start + load(tile.hi + k) + margin, range.rear));
}

/// Lines of the rays [k, k + kFloats).
inline void set_ray_lines(const Tile& tile, Packets& b, int k) {
  const Floats start = load(tile.start + k), margin = splat(tile.margin);
  for (int a = 0; a < 2; ++a) {
    const Floats m = load(tile.slope[a] + k), c = load(tile.of[a] + k) - m * start;
    store(b.rays.m[2 * a] + k, m);
    store(b.rays.m[2 * a + 1] + k, m);
    store(b.rays.c[2 * a] + k, c - margin);
    store(b.rays.c[2 * a + 1] + k, c + margin);
  }
  b.starts[k / kFloats] = starts_of(tile, k, k + kFloats);
  b.lines |= 1u << k / kFloats;
}

/// The packet of a group; without a ray alive it is empty.
inline void set_group(const Tile& tile, Packets& b, int g) {
  const int k = g * kFloats;
  const float first = smallest(load(b.rays.first + k)), last = largest(load(b.rays.last + k));
  b.groups.first[g] = first;
  b.groups.last[g] = last;
  for (int a = 0; a < 2; ++a) {
    const Floats m = load(b.rays.m[2 * a] + k), c = load(b.rays.c[2 * a] + k) + splat(tile.margin);
    const Floats at_first = c + m * splat(first), at_last = c + m * splat(last);
    const int low = 2 * a, high = low + 1;
    line_through(smallest(at_first), smallest(at_last), first, last, -2 * tile.margin,
                 b.groups.c[low][g], b.groups.m[low][g]);
    line_through(largest(at_first), largest(at_last), first, last, 2 * tile.margin,
                 b.groups.c[high][g], b.groups.m[high][g]);
  }
}

inline void empty_group(Packets& b, int g) {
  b.groups.first[g] = kFar;
  b.groups.last[g] = -kFar;
  for (int l = 0; l < kLines; ++l) {
    b.groups.c[l][g] = l % 2 ? -kFar : kFar;
    b.groups.m[l][g] = 0;
  }
}

/// The packet of all groups that are not empty. Returns whether they share it out: not each of them
/// as wide as the whole.
inline bool set_all(const Tile& tile, Packets& b) {
  constexpr int kCount = sizeof b.groups.first / sizeof(float);
  Frustum& f = b.all;
  f.first = kFar;
  f.last = -kFar;
  for (int g = 0; g < kCount; g += kFloats) {
    f.first = smaller(f.first, smallest(load(b.groups.first + g)));
    f.last = larger(f.last, largest(load(b.groups.last + g)));
  }
  const Floats first = splat(f.first), last = splat(f.last),
               middle = splat(0.5f * f.first + 0.5f * f.last);
  float near[kLines] = {kFar, -kFar, kFar, -kFar}, far[kLines] = {kFar, -kFar, kFar, -kFar},
        area = 0;
  for (int g = 0; g < kCount; g += kFloats) {
    Floats c[kLines], m[kLines];
    for (int l = 0; l < kLines; ++l) {
      c[l] = load(b.groups.c[l] + g);
      m[l] = load(b.groups.m[l] + g);
      const Floats p = c[l] + m[l] * first, q = c[l] + m[l] * last;
      near[l] = l % 2 ? larger(near[l], largest(p)) : smaller(near[l], smallest(p));
      far[l] = l % 2 ? larger(far[l], largest(q)) : smaller(far[l], smallest(q));
    }
    const Floats width = c[kHighX] - c[kLowX] + (m[kHighX] - m[kLowX]) * middle;
    const Floats height = c[kHighY] - c[kLowY] + (m[kHighY] - m[kLowY]) * middle;
    area +=
        sum(choose(load(b.groups.first + g) <= load(b.groups.last + g), width * height, Floats{}));
  }
  for (int l = 0; l < kLines; ++l)
    line_through(near[l], far[l], f.first, f.last, (l % 2 ? 2 : -2) * tile.margin, f.c[l], f.m[l]);
  const float width = near[kHighX] - near[kLowX] + far[kHighX] - far[kLowX],
              height = near[kHighY] - near[kLowY] + far[kHighY] - far[kLowY];
  return !(4 * area > 3 * width * height);
}

}  // namespace
}  // namespace glint
