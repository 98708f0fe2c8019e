// Up to 64 rays in the space of one tree, by component, and what they have hit.
#pragma once
#include "bvh/traverse/kernel_ray.h"
#include "simd/broad.h"

namespace glint {
namespace {

constexpr int kTile = 64;
constexpr int kGroups = kTile / kFloats;     // vectors of them
constexpr int kLeastPacket = 3 * kTile / 8;  // fewer rays are not worth a packet of all
constexpr float kFar = 3e38f;
constexpr ChildRef kNothing = 0;  // as `pending`: leaves have kLeaf set

/// The rays of a tile as the caller sees them, and the best hits in all trees so far.
struct Answers {
  const double *t_min, *t_max;
  double* t;
  uint32_t *instance, *primitive;
  float *u, *v;
  uint8_t *blocked, *fallbacks;  // fallbacks: null when nobody asks
  uint32_t visibility;
  const uint32_t* masks;  // visibility of every instance; null when all can be seen
  RayStacks* stacks;
  const Opacity* opacity = nullptr;  // null: all that is met stops a ray
  Layers layers{};                   // null when nobody asks

  /// What `blocked` is where no ray gets through.
  uint8_t stop() const { return opacity ? 2 : 1; }
  void count_fallback(int slot) {
    if (fallbacks && fallbacks[slot] < 255) ++fallbacks[slot];
  }
  /// A surface that does not stop the ray. The same one may be met again, in another leaf.
  void dim(int slot, const Hit& hit) {
    blocked[slot] = 1;
    if (!layers.hits || (layers.left_out && layers.left_out[hit.instance])) return;
    Hit* const hits = layers.hits + uint32_t(slot) * Layers::kMost;
    uint8_t& count = layers.count[slot];
    uint32_t end = count < Layers::kMost ? count : Layers::kMost, at = end;
    while (at > 0 && nearer(hit, hits[at - 1])) --at;
    if (at > 0 && !nearer(hits[at - 1], hit) && hits[at - 1].t == hit.t) return;
    if (end == Layers::kMost) {
      count = Layers::kMost + 1;
      --end;
    } else ++count;
    if (at > end) return;
    for (; end > at; --end) hits[end] = hits[end - 1];
    hits[at] = hit;
  }
  static bool nearer(const Hit& a, const Hit& b) {
    const double p = key_of(a.t), q = key_of(b.t);
    if (p != q) return p < q;
    return a.instance != b.instance ? a.instance < b.instance : a.primitive < b.primitive;
  }
  /// Takes a hit unless there is a better one.
  template <bool Any>
  bool accept(int slot, double at, double wu, double wv, PrimitiveId id) {
    if (!(at > t_min[slot] && at < t_max[slot])) return false;
    if (Any) {
      dim(slot, {at, id.instance, id.primitive, float(wu), float(wv)});
      return true;
    }
    const double key = key_of(at), best = key_of(t[slot]);
    const bool lower = id.instance != instance[slot] ? id.instance < instance[slot]
                                                     : id.primitive < primitive[slot];
    if (!(key < best || (key == best && lower))) return false;
    t[slot] = at;
    instance[slot] = id.instance;
    primitive[slot] = id.primitive;
    u[slot] = float(wu);
    v[slot] = float(wv);
    return true;
  }
};

/// Rays in the space of a tree. The float ray is what triangles and boxes are tested against. It
/// starts at the ray's origin, or, when that is more than four radii from the tree's ball, where
/// the ray crosses the plane before the ball across its longest axis: far away its rounding would
/// be coarser than what it is to hit. Its origin is the sum of two floats, so that near it almost
/// nothing is rounded: a ray knows which side of the surface it leaves. Depths count from there in
/// the ray's sense. [lo, hi] bounds the nearest hit so far, or the end of the ray, [begin_lo,
/// begin_hi] the beginning, with room for the rounding of double and float.
struct Tile {
  alignas(64) double o[3][kTile], shear[2][kTile], along[kTile];
  double skipped[kTile];  // from the ray's origin to the float ray's, along the depth axis
  const double *xyz_o[3], *xyz_d[3];  // axes x, y, z of the tree's space
  const double *t_min, *t_max;        // t_max: or the best hit so far, where that is nearer
  alignas(64) float of[2][kTile],
      start[kTile];          // float ray's origin: across, and along in the ray's sense
  float low_part[3][kTile];  // what is missing to it
  float slope[2][kTile];     // across by depth
  float lo[kTile], hi[kTile], begin_lo[kTile], begin_hi[kTile];
  uint32_t pending[kTile], place[kTile];  // leaf and place in it of a hit that is nearer than the
                                          // best of `answers`, not yet computed
  uint32_t axis_class[kTile];  // longest axis, + 4 when the direction along it is negative
  uint8_t slot[kTile];         // in `answers`
  int count;
  bool coherent, common;  // all rays as kernel_coherent.h wants them; and beginning at one point
  float margin;           // bound of the rounding of float coordinates, for boxes
  float far_margin;  // of that, the rounding of double for rays from far away; infinite where rays
                     // go one by one
  float off;         // bound of what the float rays miss the exact ones by, across
  double close;      // exact rays pass triangles that they hit within this
  const uint32_t*
      instances;  // by way of which each ray came, or null in world space: the leaves know
  Answers* answers;
  const TreeView* tree;
  const TopLevelView* world;
};

inline double reach_of(const TreeView& tree) {
  double m = 0;
  for (double c : tree.center) m = c > m ? c : -c > m ? -c : m;
  return m + 5 * tree.radius;
}

inline double least_of(Doubles v) {
  double least = kInf;
  for (int j = 0; j < kLanes; ++j) least = v[j] < least ? v[j] : least;
  return least;
}
inline double most_of(Doubles v) {
  double most = 0;
  for (int j = 0; j < kLanes; ++j) most = v[j] > most ? v[j] : most;
  return most;
}

/// No farther than kFar, where NaN comes from infinity.
inline Doubles limited(Doubles depth) {
  const Doubles limit = splat(double(kFar));
  return choose(depth < limit, choose(depth > -limit, depth, -limit), limit);
}
inline double limited(double depth) {
  return depth < double(kFar) ? larger(depth, -double(kFar)) : double(kFar);
}

/// Depth interval of ray parameter t, and of those that count as the same; t * along may be
/// infinite.
inline void depth_interval(Doubles t, Doubles along, Doubles h, Doubles sign, float* lo,
                           float* hi) {
  const Doubles at = t * along, depth = sign * (at - h),
                margin = magnitude(depth) * kDepthMargin + (magnitude(at) + magnitude(h)) * kTie;
  narrow(lo, limited(depth - margin));
  narrow(hi, limited(depth + margin));
}

/// Ray parameter interval of one ray, after its best hit has become nearer.
inline void refresh(Tile& tile, int r) {
  const Answers& a = *tile.answers;
  const int s = tile.slot[r];
  const double t = a.t[s] < a.t_max[s] ? a.t[s] : a.t_max[s], along = tile.along[r],
               sign = along < 0 ? -1 : 1;
  const double at = t * along, h = tile.skipped[r], depth = sign * (at - h);
  const double margin = magnitude(depth) * kDepthMargin + (magnitude(at) + magnitude(h)) * kTie;
  tile.lo[r] = float(limited(depth - margin));
  tile.hi[r] = float(limited(depth + margin));
}

/// Vectors in the order of the rays' axes: m1 and m2 say which of x, y, z is the longest.
struct Turned {
  Doubles across0, across1, along;
};
inline Turned turn(Longs m1, Longs m2, Doubles x, Doubles y, Doubles z) {
  return {choose(m2, x, choose(m1, z, y)), choose(m2, y, choose(m1, x, z)),
          choose(m2, z, choose(m1, y, x))};
}
/// The same for lanes with one order.
inline Turned turn(uint32_t m1, uint32_t m2, const Doubles (&v)[3]) {
  return m2 ? Turned{v[0], v[1], v[2]} : m1 ? Turned{v[2], v[0], v[1]} : Turned{v[1], v[2], v[0]};
}

/// Rays [k, k + kLanes) from xyz_o and xyz_d. Those that can hit nothing get hi = lo = -kFar.
inline void set_rays(Tile& tile, int k, Doubles& distance, double& farthest) {
  const TreeView& tree = *tile.tree;
  const Doubles d[3] = {load(tile.xyz_d[0] + k), load(tile.xyz_d[1] + k), load(tile.xyz_d[2] + k)};
  const Doubles o[3] = {load(tile.xyz_o[0] + k), load(tile.xyz_o[1] + k), load(tile.xyz_o[2] + k)};
  const Doubles o0 = o[0], o1 = o[1], o2 = o[2];
  const Longs m1 = magnitude(d[1]) > magnitude(d[0]);
  const Longs m2 = magnitude(d[2]) > larger(magnitude(d[1]), magnitude(d[0]));
  constexpr uint32_t kAll = (1u << kLanes) - 1;
  const uint32_t b1 = bits(m1), b2 = bits(m2);
  const bool even = b2 == kAll || (b2 == 0 && (b1 == 0 || b1 == kAll));
  const Turned td = even ? turn(b1, b2, d) : turn(m1, m2, d[0], d[1], d[2]),
               to = even ? turn(b1, b2, o) : turn(m1, m2, o0, o1, o2);
  const Doubles along = td.along, inverse = 1 / along, s0 = td.across0 * inverse,
                s1 = td.across1 * inverse;
  const Doubles a0 = to.across0, a1 = to.across1, a2 = to.along;
  const Doubles c0 = splat(tree.center[0]), c1 = splat(tree.center[1]), c2 = splat(tree.center[2]);
  const Doubles f0 = c0 - o0, f1 = c1 - o1, f2 = c2 - o2, zero{}, one = splat(1.0);
  const Longs back = along < zero;
  const Doubles sign = choose(back, -one, one);
  store(tile.o[0] + k, a0);
  store(tile.o[1] + k, a1);
  store(tile.o[2] + k, a2);
  store(tile.shear[0] + k, s0);
  store(tile.shear[1] + k, s1);
  store(tile.along + k, along);
  narrow(tile.slope[0] + k, sign * s0);
  narrow(tile.slope[1] + k, sign * s1);
  const Doubles square = f0 * f0 + f1 * f1 + f2 * f2;
  const Longs far = ~(square < splat(16 * tree.radius * tree.radius));
  distance = larger(choose(far, splat(9 * tree.radius * tree.radius), square), distance);
  Doubles p0 = a0, p1 = a1, p2 = a2;
  if (any(far)) {
    alignas(64) float plane[kLanes];
    narrow(plane, turn(m1, m2, c0, c1, c2).along - sign * tree.radius);
    const Doubles at = widen(plane);
    p2 = choose(far, at, a2);
    p0 = choose(far, a0 + s0 * (at - a2), a0);
    p1 = choose(far, a1 + s1 * (at - a2), a1);
  }
  const Doubles q2 = sign * p2, h = p2 - a2;
  narrow(tile.of[0] + k, p0);
  narrow(tile.of[1] + k, p1);
  narrow(tile.start + k, q2);
  narrow(tile.low_part[0] + k, p0 - widen(tile.of[0] + k));
  narrow(tile.low_part[1] + k, p1 - widen(tile.of[1] + k));
  narrow(tile.low_part[2] + k, q2 - widen(tile.start + k));
  store(tile.skipped + k, h);
  const Longs kind = (m2 & 2) | (~m2 & m1 & 1) | (back & 4);
  store_low(tile.axis_class + k, kind);
  store_low(tile.pending + k, Longs{});
  const Doubles sum = (s0 + s1 + along) * zero + (p0 + p1 + p2) * zero;
  const Doubles t_min = load(tile.t_min + k),
                t_max = smaller(splat(kLast), load(tile.t_max + k));  // NaN stays NaN
  const Doubles limit = splat(double(kFar)),
                wide = splat(reach_of(tree) < kWide ? 10 * kWide : double(kFar));
  const Longs good = (sum == zero) & (magnitude(along) >= splat(0x1p-1022)) &
                     (magnitude(p0) < wide) & (magnitude(p1) < wide) & (magnitude(p2) < limit) &
                     (t_min < t_max);
  if (any(far & good))
    farthest =
        larger(__builtin_sqrt(most_of(choose(far & good, square, zero))) * kFarRounding, farthest);
  if (any(Longs(t_min != zero))) {
    depth_interval(t_min, along, h, sign, tile.begin_lo + k, tile.begin_hi + k);
  } else {
    const Doubles depth = -sign * h, margin = magnitude(h) * kDepthMargin;
    narrow(tile.begin_lo + k, depth - margin);
    narrow(tile.begin_hi + k, depth + margin);
  }
  // Rays that end behind everything need not know where.
  const Doubles beyond = splat(8 * tree.radius);
  const Longs within = sign * (t_max * along) - magnitude(h) * (1 + kTie) < beyond;
  if (any(within)) depth_interval(t_max, along, h, sign, tile.lo + k, tile.hi + k);
  else {
    narrow(tile.lo + k, limit);
    narrow(tile.hi + k, limit);
  }
  if (!any(~good)) return;
  for (int j = 0; j < kLanes; ++j)
    if (!good[j]) {
      tile.lo[k + j] = tile.hi[k + j] = -kFar;
      tile.begin_lo[k + j] = tile.begin_hi[k + j] = kFar;
    }
}

inline bool alive(const Tile& tile, int r) { return tile.hi[r] > -kFar; }
/// Which of the rays [k, k + kFloats) are alive.
inline uint32_t living(const Tile& tile, int k) { return bits(load(tile.hi + k) > splat(-kFar)); }

/// Bound of all rounding on the way to a float test, in coordinates: 20 ulps of the largest numbers
/// that occur. `square`: distances of the float rays' origins from the tree's centre; `farthest`:
/// the rounding of double for rays from far away.
inline void set_margin(Tile& tile, Doubles square, double farthest) {
  const double size = reach_of(*tile.tree);
  const double reach = size - 4 * tile.tree->radius + __builtin_sqrt(most_of(square));
  const double bent = tile.tree->kind == kInstanceLeaf ? kInstanceMargin : 1;
  tile.margin = float(kBoxMargin * reach + bent * farthest);
  tile.far_margin = float(size < kWide && farthest < 1e30 ? farthest : kInf);
  tile.off = 8 * (float(kFarRounding * reach) + tile.far_margin);
  tile.close = 0x1p-21 * (size - 4 * tile.tree->radius);
}

/// Lanes without rays.
inline void leave_out(Tile& tile, int k) {
  const Doubles limit = splat(double(kFar));
  narrow(tile.lo + k, -limit);
  narrow(tile.hi + k, -limit);
  narrow(tile.begin_lo + k, limit);
  narrow(tile.begin_hi + k, limit);
  store_low(tile.pending + k, Longs{});
}

/// False when no ray is alive. The arrays of the rays are given, and whole vectors of them: lanes
/// beyond `count` have t_min = t_max. The rest of a register is without rays.
inline bool set_tile(Tile& tile) {
  Doubles square{};
  double farthest = 0;
  bool some = false;
  for (int k = 0; k < tile.count; k += kBroad) {
    for (int j = 0; j < kBroad; j += kLanes)
      if (k + j < tile.count) set_rays(tile, k + j, square, farthest);
      else leave_out(tile, k + j);
    for (int j = 0; j < kBroad; j += kFloats) some |= living(tile, k + j) != 0;
  }
  if (some) set_margin(tile, square, farthest);
  return some;
}

}  // namespace
}  // namespace glint
