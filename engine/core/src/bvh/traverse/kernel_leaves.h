// Rays against the triangles of a leaf. Float says which are certainly hit or missed, and bounds a
// hit's depth; the rule in double is asked only where that is not enough, and once for the nearest
// hit of each ray in the end (kernel_resolve.h).
#pragma once
#include "bvh/traverse/kernel_opacity.h"
#include "bvh/traverse/kernel_shapes.h"

namespace glint {
namespace {

inline Floats largest_magnitude(Floats a, Floats b) {
#if defined(__AVX512DQ__)
  return Floats(_mm256_range_ps(__m256(a), __m256(b), 0xb));
#else
  return larger(magnitude(a), magnitude(b));
#endif
}

/// What the edge functions of corners seen in float differ by from those of the rule, where a ray
/// hits in either. `extent`: the corners are no farther away across, `deepest`: along; `off`:
/// Tile::off. A corner seen in float is off by at most u (6.1 deepest + 3.1 extent) + off across; d
/// has as much again as 4 u extent^2, what the products round, are part of 4 d extent.
__attribute__((always_inline)) inline Floats edge_margin(Floats extent, Floats deepest, float off) {
  const Floats d = fused(splat(kSeenAlong), deepest, fused(splat(kSeenAcross), extent, splat(off)));
  return fused(fused(splat(4.0f), d, extent), 4 * d, splat(kLeastProduct));
}

/// Triangles, or one triangle in all lanes, against rays, or one ray in all lanes, in float: what
/// is certain.
template <class V>
struct TriangleTest {
  V x[3], y[3], z[3], a, b, c, low, high, margin;

  static V each(float a) {
    if constexpr (sizeof(V) == sizeof(Floats)) return splat(a);
    else return spread(a);
  }
  void edges() {
    a = fused(x[2], y[1], -(y[2] * x[1]));
    b = fused(x[0], y[2], -(y[0] * x[2]));
    c = fused(x[1], y[0], -(y[1] * x[0]));
    low = smaller(a, smaller(b, c));
    high = larger(a, larger(b, c));
  }
  /// No doubt that the ray does not hit.
  uint32_t missed() const { return bits(less(low, -margin) & less(margin, high)); }
  /// No doubt that it does.
  auto sure() const { return less(margin, low) | less(high, -margin); }
  /// Bounds of the depth of a sure hit: its edge functions are off by `margin` each, and where such
  /// weights put the point by three times that and the depth's extent over the area. NaN where
  /// numbers are too large for it, wide where they are too small.
  __attribute__((always_inline)) void depth(const Tile& tile, V& lo, V& hi) const {
    const V inverse = 1 / (a + b + c), at = fused(a, z[0], fused(b, z[1], c * z[2])) * inverse;
    const V front = this->front(), rear = this->rear(), most = larger(rear, -front),
            error = magnitude(fused(3 * margin, rear - front, each(kUnderflow)) * inverse),
            room = fused(most, each(kSumMargin), each(2 * kFarTie * tile.far_margin + tile.off));
    lo = larger(front, at - error) - room;
    hi = smaller(rear, at + error) + room;
  }
  /// The largest coordinate of any corner across.
  Floats extent() const {
    const Floats ab =
        largest_magnitude(largest_magnitude(x[0], x[1]), largest_magnitude(y[0], y[1]));
    return largest_magnitude(ab, largest_magnitude(x[2], y[2]));
  }
  V front() const { return smaller(z[0], smaller(z[1], z[2])); }
  V rear() const { return larger(z[0], larger(z[1], z[2])); }
};

/// What a ray that hits has no corner beyond, across.
inline Floats extent_of(const Boxes& b) {
  return (b.high_x - b.low_x) + (b.high_y - b.low_y) + (b.rear - b.front);
}

/// Boxes of the triangles [first, first + kFloats) of a leaf.
inline Boxes triangle_boxes(const Triangles& leaf, int first, const Order& order) {
  Floats low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    const Floats a = load(leaf.at(0, order.axes[k]) + first),
                 b = load(leaf.at(1, order.axes[k]) + first),
                 c = load(leaf.at(2, order.axes[k]) + first);
    low[k] = smaller(a, smaller(b, c));
    high[k] = larger(a, larger(b, c));
  }
  const bool back = order.sign < 0;
  return {low[0], high[0], low[1], high[1], back ? -high[2] : low[2], back ? -low[2] : high[2]};
}

/// Which of the rays [k, k + kFloats) meet the plane of a triangle that they hit before they begin:
/// so do shadow rays and reflections on the surface that they leave.
__attribute__((noinline)) inline uint32_t behind(const Tile& tile, int k, const Triangles& leaf,
                                                 int place, const Order& order) {
  alignas(64) double t[kFloats];
  alignas(64) float u[kFloats], v[kFloats];
  uint32_t mask = exact_hits(tile, k, leaf, place, order, t, u, v);
  for (int h = 0; h < kFloats; h += kLanes)
    mask &= ~(bits(less(load(tile.t_min + k + h), load(t + h))) << h);
  return mask;
}

/// Decides candidates among the rays [k, k + kBroad) one by one, unless they begin on the far side
/// of a surface that they leave.
template <bool Any>
__attribute__((noinline)) void decide_rays(Walk<Any>& w, int k, uint32_t mask, uint32_t starting,
                                           const Order& order, ChildRef leaf, int place) {
  if (starting & (starting - 1))
    for (int h = 0; h < kBroad; h += kFloats)
      if (const uint32_t some = some_of(starting, h, kFloats))
        mask &= ~((some & behind(w.tile, k + h, Triangles(w.tree, leaf), place, order)) << h);
  for (; mask; mask &= mask - 1) {
    const int r = k + __builtin_ctz(mask);
    if (!alive(w.tile, r)) continue;
    w.tile.answers->count_fallback(w.tile.slot[r]);
    w.decide(r, leaf, place);
    w.trim(r);
  }
}

/// Takes hits that are nearer than the best ones without doubt, of the rays [k, k + kBroad): those
/// of `mask`; `nearer` has no other ones but such that cannot be.
template <bool Any>
__attribute__((always_inline)) inline void take_certain(Walk<Any>& w, int k, uint32_t mask,
                                                        BroadMask nearer, Broad lo, Broad hi,
                                                        ChildRef leaf, int place) {
  Tile& tile = w.tile;
  if (Any) {
    for (; mask; mask &= mask - 1)
      tile.answers->blocked[tile.slot[k + __builtin_ctz(mask)]] = tile.answers->stop();
    for (float* p : {tile.lo + k, tile.hi + k})
      store_broad(p, choose(nearer, spread(-kFar), load_broad(p)));
    return;
  }
  const Broad end = choose(nearer, hi, load_broad(tile.hi + k));
  store_broad(tile.lo + k, choose(nearer, lo, load_broad(tile.lo + k)));
  store_broad(tile.hi + k, end);
  put(tile.pending + k, nearer, leaf);
  put(tile.place + k, nearer, uint32_t(place));
  float* last = w.packet.last + k;
  const Broad start = load_broad(tile.start + k);
  store_broad(last, smaller(load_broad(last), start + end + spread(tile.margin)));
}

/// Those of some rays from k on that hit a triangle.
template <bool Any>
inline uint32_t hit_lanes(const Walk<Any>& w, int k, uint32_t rays, ChildRef leaf, int place) {
  uint32_t hit = 0;
  for (; rays; rays &= rays - 1)
    if (w.seen(k + __builtin_ctz(rays), leaf, place).hit()) hit |= rays & -rays;
  return hit;
}

/// Those of some rays from k on that hit a triangle and are stopped by it. `sure`: hit for sure.
template <bool Any>
__attribute__((noinline)) uint32_t stopped_of(const Walk<Any>& w, int k, uint32_t rays,
                                              uint32_t sure, ChildRef leaf, int place) {
  uint32_t stop = 0;
  for (int h = 0; h < kBroad; h += kFloats) {
    const uint32_t some = some_of(rays, h, kFloats) & living(w.tile, k + h),
                   hit = some & some_of(sure, h, kFloats);
    stop |= stopped(w, k + h, hit | hit_lanes(w, k + h, some & ~hit, leaf, place), leaf, place)
            << h;
  }
  return stop;
}

/// Candidates among the rays [k, k + kBroad): takes those that are certain, and decides the
/// others.
template <bool Any>
__attribute__((always_inline)) inline void take_rays(Walk<Any>& w, int k, uint32_t mask,
                                                     const TriangleTest<Broad>& t,
                                                     const Order& order, ChildRef leaf, int place) {
  Tile& tile = w.tile;
  Broad lo, hi;
  t.depth(tile, lo, hi);
  const Broad best_lo = load_broad(tile.lo + k), best_hi = load_broad(tile.hi + k),
              begin_hi = load_broad(tile.begin_hi + k);
  const BroadMask sure = t.sure();
  mask &= ~bits(sure & (less(best_hi, lo) | less(hi, load_broad(tile.begin_lo + k))));
  if (!mask || !visible(tile, leaf_first(leaf) + uint32_t(place))) return;
  BroadMask nearer = sure & less(hi, best_lo) & less(begin_hi, lo);
  if (tile.answers->opacity) {
    mask = stopped_of(w, k, mask, bits(sure), leaf, place);
    nearer = nearer & broad_lanes(mask);
    if (!mask) return;
  }
  const uint32_t certain = bits(nearer) & mask;
  // Lanes of `nearer` outside of `mask` are missed: `sure` is false there.
  if (certain) take_certain(w, k, certain, nearer, lo, hi, leaf, place);
  mask &= ~certain;
  if (mask) decide_rays(w, k, mask, mask & bits(sure & at_most(lo, begin_hi)), order, leaf, place);
}

/// What Corners subtract: where all rays begin, if that is one point.
template <bool Common>
inline Origin origin(const Tile& tile) {
  if (!Common) return {};
  return {{tile.of[0][0], tile.of[1][0], tile.start[0]},
          {tile.low_part[0][0], tile.low_part[1][0], tile.low_part[2][0]}};
}

/// Corners of the triangles [first, first + kFloats) of a leaf, coordinates in the rays' order and
/// sense, from the rays' origin if that is one point; and margins of their edge functions.
template <bool Common>
struct Corners {
  alignas(64) float p[9][kFloats], margin[kFloats];
  Corners(const Triangles& leaf, int first, const Order& order, const Tile& tile,
          const Boxes& boxes, const StartRange& starts) {
    Floats v[9];
    corners_from(origin<Common>(tile), leaf, first, order, v);
    for (int j = 0; j < 9; ++j) store(p[j], v[j]);
    const Floats deepest =
        Common ? largest_magnitude(v[2], largest_magnitude(v[5], v[8]))
               : larger(boxes.rear - splat(starts.first), splat(starts.last) - boxes.front);
    store(margin, edge_margin(extent_of(boxes), deepest, tile.off));
  }
};

/// One triangle against the rays [k, k + kBroad).
template <bool Any, bool Common>
__attribute__((always_inline)) inline void hit_group(Walk<Any>& w, int k,
                                                     const Corners<Common>& corners, int first,
                                                     int lane, const Order& order, ChildRef ref) {
  const Tile& tile = w.tile;
  TriangleTest<Broad> t;
  const Broad sx = load_broad(tile.slope[0] + k), sy = load_broad(tile.slope[1] + k);
  for (int j = 0; j < 3; ++j) {
    Broad x = spread(corners.p[3 * j][lane]), y = spread(corners.p[3 * j + 1][lane]),
          z = spread(corners.p[3 * j + 2][lane]);
    if constexpr (!Common) {
      x = x - load_broad(tile.of[0] + k) - load_broad(tile.low_part[0] + k);
      y = y - load_broad(tile.of[1] + k) - load_broad(tile.low_part[1] + k);
      z = z - load_broad(tile.start + k) - load_broad(tile.low_part[2] + k);
    }
    t.x[j] = fused(-sx, z, x);
    t.y[j] = fused(-sy, z, y);
    t.z[j] = z;
  }
  t.edges();
  t.margin = spread(corners.margin[lane]);
  const uint32_t mask = ~t.missed() & ((1u << kBroad) - 1);
  if (mask) take_rays(w, k, mask, t, order, ref, first + lane);
}

/// The plane of a triangle, in the rays' order.
struct Plane {
  D3 corner, normal;    // normal: as long as twice the area
  double size, square;  // of two edges, all components
  Plane(const Triangles& leaf, int place, const Order& order)
      : corner(vertex(leaf, place, order, 0)) {
    const D3 p = vertex(leaf, place, order, 1) - corner, q = vertex(leaf, place, order, 2) - corner;
    normal = {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
    size = (magnitude(p.x) + magnitude(q.x)) + (magnitude(p.y) + magnitude(q.y)) +
           (magnitude(p.z) + magnitude(q.z));
    square = size * size;
  }
  static D3 vertex(const Triangles& leaf, int place, const Order& order, int j) {
    return {leaf.at(j, order.axes[0])[place], leaf.at(j, order.axes[1])[place],
            leaf.at(j, order.axes[2])[place]};
  }
};

/// Which of the rays with origins o, in an order where their slopes are 2 at most, if they pass
/// inside a triangle, surely meet it behind there. Exact would come to negative depths: with m no
/// less than any corner is away and N twice the area that the ray sees in its own order, at least
/// half of what is seen here, its point is off the ray by less than 2^-42 m^3 / N. Where that is
/// less than `close`, and less than half of s when multiplied by the normal, the depth has the sign
/// of s.
inline uint32_t well_behind(const Doubles (&o)[3], const Doubles (&shear)[2], double close,
                            const Plane& plane, double sign) {
  const Doubles x = splat(plane.corner.x) - o[0], y = splat(plane.corner.y) - o[1],
                z = splat(plane.corner.z) - o[2];
  const Doubles nx = splat(plane.normal.x), ny = splat(plane.normal.y), nz = splat(plane.normal.z);
  const Doubles s = nx * x + ny * y + nz * z, seen = nx * shear[0] + ny * shear[1] + nz;
  const Doubles m = magnitude(x) + magnitude(y) + magnitude(z) + splat(plane.size),
                back = flip(s, seen * splat(-sign));
  return bits(less(splat(0x1p-41 * plane.square) * (m * m * m),
                   magnitude(seen) * smaller(back, splat(close * plane.square))));
}

}  // namespace
}  // namespace glint
