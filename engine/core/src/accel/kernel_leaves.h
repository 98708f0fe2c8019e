// Rays against the primitives of a leaf. A hit's depth is first known as an interval; double precision is asked only when intervals overlap,
// and once for the nearest hit of each ray in the end.
#pragma once
#include "kernel_frustum.h"

namespace glint {
namespace {

inline uint32_t leaf_first(ChildRef leaf) { return leaf & kOrdinal; }
inline int leaf_count(ChildRef leaf) { return int(leaf >> kCountShift & 7) + 1; }

/// The triangles of one leaf: n floats for each coordinate.
struct Triangles {
  const float* p;
  int n;
  Triangles(const TreeView& tree, ChildRef leaf) : p(tree.floats + 9 * size_t(leaf_first(leaf))), n(leaf_count(leaf)) {}
  const float* at(int corner, int axis) const { return p + (3 * corner + axis) * n; }
};

inline PrimitiveId id_of(const Tile& tile, uint32_t ordinal) {
  PrimitiveId id = tile.tree->ids[ordinal];
  if (tile.instance != Hit::kNone) id.instance = tile.instance;
  return id;
}
inline bool visible(const Tile& tile, uint32_t instance) {
  return tile.instance != Hit::kNone || (tile.answers->masks[instance] & tile.answers->visibility) != 0;
}

/// A tile on its way through a tree.
template <bool Any>
struct Walk {
  const WorldView& world;
  const TreeView& tree;
  Tile& tile;
  Bundles& bundles;
  double reach;  // reach_of(tree)

  void block(int r) {
    tile.answers->blocked[tile.slot[r]] = 1;
    tile.lo[r] = tile.hi[r] = bundles.rays.last[r] = -kFar;
  }
  /// After a change of answers.
  void update(int r) {
    if (Any) {
      if (tile.answers->blocked[tile.slot[r]]) block(r);
      return;
    }
    refresh(tile, r);
    bundles.rays.last[r] = smaller(bundles.rays.last[r], tile.start[r] + tile.hi[r] + tile.room);
  }

  /// The exact hit of one triangle, in double.
  Exact<double> exact(int r, ChildRef leaf, int place) const {
    const Triangles triangles(tree, leaf);
    const Order order(tile.kind[r]);
    double corner[3][3];
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) corner[j][k] = double(triangles.at(j, order.axes[k])[place]);
    const double o[3] = {tile.o[0][r], tile.o[1][r], tile.o[2][r]}, shear[2] = {tile.shear[0][r], tile.shear[1][r]};
    Exact<double> e;
    e.see(corner, o, shear);
    e.weigh();
    const double room = 0x1p-21 * reach;
    if (!(magnitude(e.off_x) <= room && magnitude(e.off_y) <= room)) weigh_edges(e);
    return e;
  }
  void take(int r, ChildRef leaf, int place) {
    const Exact<double> e = exact(r, leaf, place);
    tile.answers->template accept<Any>(tile.slot[r], e.depth / tile.along[r], e.u, e.v, id_of(tile, leaf_first(leaf) + uint32_t(place)));
  }
  /// Decides in double between a triangle and the best hit so far.
  __attribute__((noinline)) void decide(int r, ChildRef leaf, int place) {
    if (tile.pending[r] != kNothing) take(r, tile.pending[r], int(tile.place[r]));
    tile.pending[r] = kNothing;
    take(r, leaf, place);
    update(r);
  }
};

/// Triangles, or one triangle in all lanes, against rays, or one ray in all lanes.
struct TriangleTest {
  Floats x[3], y[3], z[3], a, b, c, low, high;

  void edges() {
    a = x[2] * y[1] - y[2] * x[1], b = x[0] * y[2] - y[0] * x[2], c = x[1] * y[0] - y[1] * x[0];
    low = smaller(a, smaller(b, c)), high = larger(a, larger(b, c));
  }
  uint32_t conflict() const { return bits((low < Floats{}) & (high > Floats{})); }
  /// All edge functions of one sign, 0 excluded: no doubt that the ray hits.
  Ints sure() const { return (low > Floats{}) | (high < Floats{}); }
  bool exactly(int lane) const {
    const float px[3] = {x[0][lane], x[1][lane], x[2][lane]}, py[3] = {y[0][lane], y[1][lane], y[2][lane]};
    return exactly_hit(px, py);
  }
  /// Bounds of the depth. `spread`: how much of the depth's extent is uncertain by rounding, times the sum of the edge functions.
  void depth(Floats spread, Floats sign, Floats& lo, Floats& hi) const {
    const Floats inverse = 1 / (a + b + c), at = (a * z[0] + b * z[1] + c * z[2]) * inverse * sign;
    const Floats z0 = z[0] * sign, z1 = z[1] * sign, z2 = z[2] * sign;
    const Floats front = smaller(z0, smaller(z1, z2)), rear = larger(z0, larger(z1, z2));
    const Floats error = larger(spread * inverse, -(spread * inverse)), room = larger(rear, -front) * splat(0x1p-20f);
    lo = larger(at - error, front) - room, hi = smaller(at + error, rear) + room;
  }
};

/// Numerator of the uncertainty of depths: see TriangleTest::depth.
inline Floats spread_of(const Boxes& b, double reach) {
  const Floats deep = b.rear - b.front;
  return ((b.high_x - b.low_x) + (b.high_y - b.low_y) + deep + deep) * deep * splat(float(0x1p-14 * reach));
}

/// Boxes of the triangles [first, first + kLanes) of a leaf.
inline Boxes triangle_boxes(const Triangles& leaf, int first, const Order& order) {
  Floats low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    const Floats a = load(leaf.at(0, order.axes[k]) + first), b = load(leaf.at(1, order.axes[k]) + first),
                 c = load(leaf.at(2, order.axes[k]) + first);
    low[k] = smaller(a, smaller(b, c)), high[k] = larger(a, larger(b, c));
  }
  const bool back = order.sign < 0;
  return {low[0], high[0], low[1], high[1], back ? -high[2] : low[2], back ? -low[2] : high[2]};
}

/// One triangle for all lanes: corner by corner, coordinates in the rays' order.
inline void spread_corners(const Triangles& leaf, int place, const Order& order, float (&corner)[9][kLanes]) {
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) store(corner[3 * j + a], splat(leaf.at(j, order.axes[a])[place]));
}

/// The rays [k + h, k + h + kDoubles) against a triangle each, in double. Returns which of them weigh() has answered.
inline uint32_t exact_hits(const Tile& tile, int k, int h, const float (&corner)[9][kLanes], double* t, float* u, float* v) {
  Exact<Doubles> e;
  Doubles p[3][3];
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) p[j][a] = widen(corner[3 * j + a] + h);
  const int at = k + h;
  const Doubles o[3] = {load(tile.o[0] + at), load(tile.o[1] + at), load(tile.o[2] + at)};
  const Doubles shear[2] = {load(tile.shear[0] + at), load(tile.shear[1] + at)};
  e.see(p, o, shear);
  e.weigh();
  store(t + h, e.depth / load(tile.along + at)), narrow(u + h, e.u), narrow(v + h, e.v);
  const Doubles room = splat(0x1p-21 * reach_of(*tile.tree));
  return bits(Longs((magnitude(e.off_x) <= room) & (magnitude(e.off_y) <= room)));
}

/// Which of the rays [k, k + kLanes) meet the plane of a triangle that they hit before they begin: so do shadow rays and reflections on the
/// surface that they leave.
__attribute__((noinline)) inline uint32_t behind(const Tile& tile, int k, const Triangles& leaf, int place, const Order& order) {
  alignas(64) float corner[9][kLanes];
  alignas(64) double t[kLanes];
  alignas(64) float u[kLanes], v[kLanes];
  spread_corners(leaf, place, order, corner);
  uint32_t mask = 0;
  for (int h = 0; h < kLanes; h += kDoubles)
    mask |= (exact_hits(tile, k, h, corner, t, u, v) & ~bits(Longs(load(t + h) > load(tile.t_min + k + h)))) << h;
  return mask;
}

/// Candidates among the rays [k, k + kLanes): takes those that are certain, and decides the others.
template <bool Any>
inline void take_rays(Walk<Any>& w, int k, uint32_t mask, const TriangleTest& t, Floats spread, const Order& order, ChildRef leaf, int place) {
  Tile& tile = w.tile;
  const PrimitiveId id = id_of(tile, leaf_first(leaf) + uint32_t(place));
  if (!visible(tile, id.instance)) return;
  Floats lo, hi;
  t.depth(spread, splat(order.sign), lo, hi);
  const Floats best_lo = load(tile.lo + k), best_hi = load(tile.hi + k);
  const Ints sure = t.sure();
  mask &= ~bits((sure & (lo > best_hi)) | (sure & (hi < load(tile.begin_lo + k))));
  if (!mask) return;
  const Ints nearer = sure & (hi < best_lo) & (lo > load(tile.begin_hi + k));
  const uint32_t certain = bits(nearer) & mask;
  if (Any) {
    for (uint32_t m = certain; m; m &= m - 1) w.block(k + __builtin_ctz(m));
  } else if (certain) {
    // Lanes of `nearer` outside of `mask` are in conflict: `sure` is false there.
    store(tile.lo + k, select(nearer, lo, best_lo)), store(tile.hi + k, select(nearer, hi, best_hi));
    store(tile.pending + k, (nearer & int32_t(leaf)) | (~nearer & load(tile.pending + k)));
    store(tile.place + k, (nearer & place) | (~nearer & load(tile.place + k)));
    float* last = w.bundles.rays.last + k;
    store(last, smaller(load(last), load(tile.start + k) + load(tile.hi + k) + splat(tile.room)));
  }
  mask &= ~certain;
  const uint32_t starting = bits(sure & (lo <= load(tile.begin_hi + k))) & mask;
  if (starting & (starting - 1)) mask &= ~(starting & behind(tile, k, Triangles(w.tree, leaf), place, order));
  for (uint32_t m = mask; m; m &= m - 1) {
    const int lane = __builtin_ctz(m), r = k + lane;
    if (!(tile.hi[r] > -kFar)) continue;
    if (sure[lane] || t.exactly(lane)) w.decide(r, leaf, place);
  }
}

/// Corners of the triangles [first, first + kLanes) of a leaf, coordinates in the rays' order; from the rays' origin if that is one point.
struct Corners {
  alignas(64) float p[9][kLanes];
  Corners(const Triangles& leaf, int first, const Order& order, const float (&o)[3]) {
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a) store(p[3 * j + a], load(leaf.at(j, order.axes[a]) + first) - splat(o[a]));
  }
};

/// One triangle against the rays [k, k + kLanes). True when some ray was hit, perhaps behind something else.
template <bool Any, bool Common>
inline bool hit_group(Walk<Any>& w, int k, const Corners& corners, int first, int lane, const Order& order, float spread, ChildRef ref) {
  const Tile& tile = w.tile;
  const int place = first + lane;
  TriangleTest t;
  const Floats sx = load(tile.sf[0] + k), sy = load(tile.sf[1] + k);
  for (int j = 0; j < 3; ++j) {
    Floats x = splat(corners.p[3 * j][lane]), y = splat(corners.p[3 * j + 1][lane]), z = splat(corners.p[3 * j + 2][lane]);
    if constexpr (!Common) x = x - load(tile.of[0] + k), y = y - load(tile.of[1] + k), z = z - load(tile.of[2] + k);
    t.x[j] = x - sx * z, t.y[j] = y - sy * z, t.z[j] = z;
  }
  t.edges();
  const uint32_t mask = ~t.conflict() & ((1u << kLanes) - 1);
  if (!mask) return false;
  take_rays(w, k, mask, t, splat(spread), order, ref, place);
  return true;
}

/// The triangles of a leaf against one ray.
template <bool Any>
inline void hit_triangles(Walk<Any>& w, int r, ChildRef ref, const Order& order) {
  Tile& tile = w.tile;
  const Triangles leaf(w.tree, ref);
  const Floats ox = splat(tile.of[0][r]), oy = splat(tile.of[1][r]), oz = splat(tile.of[2][r]);
  const Floats sx = splat(tile.sf[0][r]), sy = splat(tile.sf[1][r]);
  for (int first = 0; first < leaf.n; first += kLanes) {
    TriangleTest t;
    for (int j = 0; j < 3; ++j) {
      t.z[j] = load(leaf.at(j, order.axes[2]) + first) - oz;
      t.x[j] = load(leaf.at(j, order.axes[0]) + first) - ox - sx * t.z[j];
      t.y[j] = load(leaf.at(j, order.axes[1]) + first) - oy - sy * t.z[j];
    }
    t.edges();
    const int rest = leaf.n - first < kLanes ? leaf.n - first : kLanes;
    uint32_t mask = ~t.conflict() & ((1u << rest) - 1);
    if (!mask) continue;
    Floats lo, hi;
    t.depth(spread_of(triangle_boxes(leaf, first, order), w.reach), splat(order.sign), lo, hi);
    const Ints sure = t.sure();
    mask &= ~bits(sure & ((lo > splat(tile.hi[r])) | (hi < splat(tile.begin_lo[r]))));
    for (; mask; mask &= mask - 1) {
      const int lane = __builtin_ctz(mask);
      if (!visible(tile, id_of(tile, leaf_first(ref) + uint32_t(first + lane)).instance)) continue;
      if (sure[lane] && (lo[lane] > tile.hi[r])) continue;
      if (sure[lane] && hi[lane] < tile.lo[r] && lo[lane] > tile.begin_hi[r]) {
        if (Any) return w.block(r);
        tile.lo[r] = lo[lane], tile.hi[r] = hi[lane], tile.pending[r] = ref, tile.place[r] = uint32_t(first + lane);
        w.bundles.rays.last[r] = smaller(w.bundles.rays.last[r], tile.start[r] + tile.hi[r] + tile.room);
      } else if (sure[lane] || t.exactly(lane)) {
        w.decide(r, ref, first + lane);
        if (Any && tile.answers->blocked[tile.slot[r]]) return;
      }
    }
  }
}

/// A ray for spheres and polygons, in double; d scaled so that its longest component is in [1, 2).
struct Scaled {
  D3 o, d;
  double unit;
  Scaled(const Tile& tile, int r) : o{tile.xyz_o[0][r], tile.xyz_o[1][r], tile.xyz_o[2][r]}, d{}, unit(0) {
    const double power = power_below(magnitude(tile.along[r]));
    unit = 1 / power;
    d = unit * D3{tile.xyz_d[0][r], tile.xyz_d[1][r], tile.xyz_d[2][r]};
  }
};

/// Both roots in the form that keeps its digits far away (Haines et al. 2019, Precision Improvements for Ray/Sphere Intersection).
template <bool Any>
inline void hit_sphere(Walk<Any>& w, int slot, const Scaled& ray, const float* s, PrimitiveId id) {
  const D3 f = ray.o - D3{double(s[0]), double(s[1]), double(s[2])};
  const double inverse_square = 1 / dot(ray.d, ray.d), radius = s[3], b = -dot(f, ray.d);
  const D3 nearest = f + (b * inverse_square) * ray.d;
  const double discriminant = radius * radius - dot(nearest, nearest);
  if (!(discriminant >= 0)) return;
  const double root = __builtin_sqrt(discriminant / inverse_square);
  const double far = b + (b < 0 ? -root : root), product = dot(f, f) - radius * radius;
  const double t1 = far * inverse_square, t0 = far != 0 ? product / far : t1;
  w.tile.answers->template accept<Any>(slot, t0 * ray.unit, 0, 0, id);
  w.tile.answers->template accept<Any>(slot, t1 * ray.unit, 0, 0, id);
}

/// Odd-even rule in the plane of projection: counts the edges that a line to the right of (x, y) crosses.
inline bool odd(const PolygonRecord& record, const float* corners, double x, double y) {
  bool inside = false;
  const float* last = corners + 3 * (record.count - 1);
  double ax = double(last[record.axis_u]) - x, ay = double(last[record.axis_v]) - y;
  for (uint32_t k = 0; k < record.count; ++k) {
    const double bx = double(corners[3 * k + record.axis_u]) - x, by = double(corners[3 * k + record.axis_v]) - y;
    if ((ay > 0) != (by > 0) && (ax * by - bx * ay > 0) == (by > ay)) inside = !inside;
    ax = bx, ay = by;
  }
  return inside;
}

template <bool Any>
inline void hit_polygon(Walk<Any>& w, int slot, const Scaled& ray, const PolygonRecord& record, PrimitiveId id) {
  const double t = dot(d3(record.n), d3(record.p) - ray.o) / dot(d3(record.n), ray.d);
  if (!(magnitude(t) < kInf)) return;
  const D3 p = ray.o + t * ray.d;
  const double at[3] = {p.x, p.y, p.z};
  if (odd(record, w.tree.corners + 3 * record.first, at[record.axis_u], at[record.axis_v]))
    w.tile.answers->template accept<Any>(slot, t * ray.unit, 0, 0, id);
}

/// Spheres or polygons against one ray.
template <bool Any>
__attribute__((noinline)) void hit_shapes(Walk<Any>& w, int r, ChildRef leaf) {
  if (!alive(w.tile, r)) return;
  const Scaled ray(w.tile, r);
  const int slot = w.tile.slot[r];
  for (uint32_t k = leaf_first(leaf), last = k + uint32_t(leaf_count(leaf)); k < last; ++k) {
    const PrimitiveId id = id_of(w.tile, k);
    if (!visible(w.tile, id.instance)) continue;
    if (w.tree.kind == kSphereLeaf) hit_sphere(w, slot, ray, w.tree.floats + 4 * size_t(k), id);
    else hit_polygon(w, slot, ray, w.tree.polygons[k], id);
  }
  w.update(r);
}

/// The pending hits of the rays [k, k + kLanes): corner by corner, coordinates in the rays' order, and whose triangles they are. Lanes without
/// one get 0.
inline void gather_corners(const Tile& tile, int k, uint32_t mask, float (&corner)[9][kLanes], Ints& instance, Ints& primitive) {
  Floats p[9] = {};
  instance = primitive = Ints{};
  const Ints pending = load(tile.pending + k), place = load(tile.place + k), kind = load(tile.kind + k);
  while (mask) {
    const int r = k + __builtin_ctz(mask);
    const Ints same = (pending == Ints{} + int32_t(tile.pending[r])) & (place == Ints{} + int32_t(tile.place[r])) &
                      (kind == Ints{} + int32_t(tile.kind[r]));
    const Triangles leaf(*tile.tree, tile.pending[r]);
    const Order order(tile.kind[r]);
    const PrimitiveId id = id_of(tile, leaf_first(tile.pending[r]) + tile.place[r]);
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a) p[3 * j + a] = select(same, splat(leaf.at(j, order.axes[a])[tile.place[r]]), p[3 * j + a]);
    instance |= same & int32_t(id.instance), primitive |= same & int32_t(id.primitive);
    mask &= ~bits(same);
  }
  for (int j = 0; j < 9; ++j) store(corner[j], p[j]);
}

/// Computes the pending hits of the rays [k, k + kLanes).
inline void finish_group(Walk<false>& w, int k) {
  Tile& tile = w.tile;
  Ints none = load(tile.pending + k) == Ints{};
  const uint32_t mask = ~bits(none) & ((1u << kLanes) - 1);
  if (!mask) return;
  alignas(64) float corner[9][kLanes];
  alignas(64) double t[kLanes];
  alignas(64) float u[kLanes], v[kLanes];
  Ints instance, primitive;
  gather_corners(tile, k, mask, corner, instance, primitive);
  uint32_t close = 0;
  for (int h = 0; h < kLanes; h += kDoubles) close |= exact_hits(tile, k, h, corner, t, u, v) << h;
  Answers& answers = *tile.answers;
  if ((mask & close) == (1u << kLanes) - 1 && tile.instance == Hit::kNone) {  // slots are those of the rays
    for (int h = 0; h < kLanes; h += kDoubles) store(answers.t + k + h, load(t + h));
    store(answers.u + k, load(u)), store(answers.v + k, load(v));
    store(answers.instance + k, instance), store(answers.primitive + k, primitive);
    return;
  }
  for (uint32_t m = mask; m; m &= m - 1) {
    const int lane = __builtin_ctz(m), r = k + lane, s = tile.slot[r];
    if (!(close >> lane & 1)) {
      w.take(r, tile.pending[r], int(tile.place[r]));
      continue;
    }
    answers.t[s] = t[lane], answers.u[s] = u[lane], answers.v[s] = v[lane];
    answers.instance[s] = uint32_t(instance[lane]), answers.primitive[s] = uint32_t(primitive[lane]);
  }
}

}  // namespace
}  // namespace glint
