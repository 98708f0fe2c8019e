// Rays against the primitives of a leaf. A hit's depth is first known as an interval; double
// precision is asked only when intervals overlap, and once for the nearest hit of each ray in the
// end.
#pragma once
#include "bvh/traverse/kernel_boxes.h"
#include "bvh/traverse/kernel_common_origin.h"

namespace glint {
namespace {

inline PrimitiveId id_of(const Tile& tile, int r, uint32_t ordinal) {
  PrimitiveId id = tile.tree->ids[ordinal];
  if (tile.instances) id.instance = tile.instances[r];
  return id;
}
/// Instances were asked before.
inline bool visible(const Tile& tile, uint32_t ordinal) {
  const Answers& a = *tile.answers;
  return !a.masks || tile.instances ||
         (a.masks[tile.tree->ids[ordinal].instance] & a.visibility) != 0;
}

/// A tile on its way through a tree.
template <bool Any>
struct Walk {
  const TopLevelView& world;
  const TreeView& tree;
  Tile& tile;
  Packets& packets;
  const Pencil& pencil;
  BoxRays& boxes;
  SingleRays& left;

  void block(int r) {
    tile.answers->blocked[tile.slot[r]] = tile.answers->stop();
    tile.lo[r] = tile.hi[r] = -kFar;
  }
  /// After a change of answers.
  void update(int r) {
    if (!Any) refresh(tile, r);
    else if (tile.answers->blocked[tile.slot[r]] == tile.answers->stop()) block(r);
  }
  /// The packets' part of it.
  void trim(int r) {
    packets.rays.last[r] = smaller(packets.rays.last[r], tile.start[r] + tile.hi[r] + tile.room);
  }

  /// The exact hit of one triangle, in double.
  Exact<double> exact(int r, ChildRef leaf, int place) const {
    const Triangles triangles(tree, leaf);
    const Order& order = order_of(tile, r);
    double corner[3][3];
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) corner[j][k] = double(triangles.at(j, order.axes[k])[place]);
    const double o[3] = {tile.o[0][r], tile.o[1][r], tile.o[2][r]},
                 shear[2] = {tile.shear[0][r], tile.shear[1][r]};
    Exact<double> e;
    e.see(corner, o, shear);
    e.weigh();
    if (!(magnitude(e.off_x) <= tile.close && magnitude(e.off_y) <= tile.close)) weigh_edges(e);
    return e;
  }
  void take(int r, ChildRef leaf, int place) {
    const Exact<double> e = exact(r, leaf, place);
    const PrimitiveId id = id_of(tile, r, leaf_first(leaf) + uint32_t(place));
    if (tile.answers->template accept<Any>(tile.slot[r], e.depth / tile.along[r], e.u, e.v, id) &&
        Any)
      block(r);
  }
  /// Decides in double between a triangle and the best hit so far.
  __attribute__((noinline)) void decide(int r, ChildRef leaf, int place) {
    if (tile.pending[r] != kNothing) take(r, tile.pending[r], int(tile.place[r]));
    tile.pending[r] = kNothing;
    take(r, leaf, place);
    update(r);
  }
};

/// Those of some rays, k the first of them, that a triangle stops where they meet it. Any hit: a
/// ray that it dims is told, and goes on.
template <bool Any>
__attribute__((noinline)) uint32_t stopped(const Walk<Any>& w, int k, uint32_t rays, ChildRef leaf,
                                           int place) {
  const Tile& tile = w.tile;
  Answers& answers = *tile.answers;
  const Opacity& opacity = *answers.opacity;
  const bool solid = !(Any && opacity.onward), dimming = !(Any || opacity.onward);
  const auto stops = [&](uint8_t kind) {
    return (solid && kind == Opacity::kSolid) || (dimming && kind == Opacity::kVaried);
  };
  uint32_t stopped = rays;
  for (; rays; rays &= rays - 1) {
    const int r = k + __builtin_ctz(rays);
    if (!alive(tile, r)) continue;
    const PrimitiveId id = id_of(tile, r, leaf_first(leaf) + uint32_t(place));
    uint8_t kind = opacity.of_instance[id.instance];
    if (stops(kind)) continue;
    const Exact<double> e = w.exact(r, leaf, place);
    if (kind == Opacity::kMapped)
      kind = opacity.at(opacity.maps, id.instance, id.primitive, e.u, e.v);
    if (stops(kind)) continue;
    stopped &= ~(rays & -rays);
    const double t = e.depth / tile.along[r];
    const int s = tile.slot[r];
    if (Any && kind != Opacity::kClear && t > answers.t_min[s] && t < answers.t_max[s])
      answers.dim(s, {t, id.instance, id.primitive, float(e.u), float(e.v)});
  }
  return stopped;
}

/// Triangles, or one triangle in all lanes, against rays, or one ray in all lanes.
struct TriangleTest {
  Floats x[3], y[3], z[3], a, b, c, low, high;

  void edges() {
    a = x[2] * y[1] - y[2] * x[1];
    b = x[0] * y[2] - y[0] * x[2];
    c = x[1] * y[0] - y[1] * x[0];
    low = smaller(a, smaller(b, c));
    high = larger(a, larger(b, c));
  }
  uint32_t conflict() const { return bits(less(low, Floats{}) & less(Floats{}, high)); }
  /// All edge functions of one sign, 0 excluded: no doubt that the ray hits.
  Mask sure() const { return less(Floats{}, low) | less(high, Floats{}); }
  /// Whether a candidate is hit indeed. (Beyond 1e19 edge functions may be infinity less infinity.)
  bool hit(int lane, bool sure) const {
    const float sum = a[lane] + b[lane] + c[lane];
    if (sure && sum == sum) return true;
    const float px[3] = {x[0][lane], x[1][lane], x[2][lane]},
                py[3] = {y[0][lane], y[1][lane], y[2][lane]};
    return exactly_hit(px, py);
  }
  /// Bounds of the depth. The sheared corners are off by up to 2^-24 (4 z + 2 x) + far, the edge
  /// functions by 6 x times that, and where such weights put the point by 72 times that and the
  /// depth's extent over the area. x: `extent`, no corner is farther away across. NaN where numbers
  /// are too large for it, wide where they are too small.
  __attribute__((always_inline)) void depth(Floats extent, float far, Floats& lo,
                                            Floats& hi) const {
    const Floats inverse = 1 / (a + b + c), at = (a * z[0] + b * z[1] + c * z[2]) * inverse;
    const Floats front = smaller(z[0], smaller(z[1], z[2])),
                 rear = larger(z[0], larger(z[1], z[2]));
    const Floats most = larger(rear, -front), apart = splat(2 * kFarTie * far);
    const Floats off = splat(0x1p-15f) * (most + extent) + apart;
    const Floats error = magnitude((extent * (rear - front) * off + splat(kUnderflow)) * inverse);
    const Floats room = most * splat(0x1p-20f) + apart;
    lo = larger(front, at - error) - room;
    hi = smaller(rear, at + error) + room;
  }
  /// The largest coordinate of any corner across.
  Floats extent() const {
    const Floats ab =
        larger(larger(magnitude(x[0]), magnitude(x[1])), larger(magnitude(y[0]), magnitude(y[1])));
    return larger(ab, larger(magnitude(x[2]), magnitude(y[2])));
  }
};

/// What a ray that hits has no corner beyond, across.
inline Floats extent_of(const Boxes& b) {
  return (b.high_x - b.low_x) + (b.high_y - b.low_y) + (b.rear - b.front);
}

/// Boxes of the triangles [first, first + kLanes) of a leaf.
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

/// The rays [k + h, k + h + kDoubles) against a triangle each, in double. Returns which of them
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
  const Doubles room = splat(tile.close);
  return bits(at_most(magnitude(e.off_x), room) & at_most(magnitude(e.off_y), room));
}
/// A triangle for each ray.
inline uint32_t exact_hits(const Tile& tile, int k, int h, const float (&corner)[9][kLanes],
                           double* t, float* u, float* v) {
  Doubles p[3][3];
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) p[j][a] = widen(corner[3 * j + a] + h);
  return exact_hits(tile, k, h, p, t, u, v);
}
/// One triangle for the rays [k, k + kLanes).
inline uint32_t exact_hits(const Tile& tile, int k, const Triangles& leaf, int place,
                           const Order& order, double* t, float* u, float* v) {
  Doubles p[3][3];
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) p[j][a] = splat(double(leaf.at(j, order.axes[a])[place]));
  uint32_t close = 0;
  for (int h = 0; h < kLanes; h += kDoubles) close |= exact_hits(tile, k, h, p, t, u, v) << h;
  return close;
}

/// Which of the rays [k, k + kLanes) meet the plane of a triangle that they hit before they begin:
/// so do shadow rays and reflections on the surface that they leave.
__attribute__((noinline)) inline uint32_t behind(const Tile& tile, int k, const Triangles& leaf,
                                                 int place, const Order& order) {
  alignas(64) double t[kLanes];
  alignas(64) float u[kLanes], v[kLanes];
  uint32_t mask = exact_hits(tile, k, leaf, place, order, t, u, v);
  for (int h = 0; h < kLanes; h += kDoubles)
    mask &= ~(bits(less(load(tile.t_min + k + h), load(t + h))) << h);
  return mask;
}

/// Decides candidates among the rays [k, k + kLanes) one by one, unless they begin on the far side
/// of a surface that they leave.
template <bool Any>
__attribute__((noinline)) void decide_rays(Walk<Any>& w, int k, uint32_t mask, uint32_t starting,
                                           const TriangleTest& t, const Order& order, ChildRef leaf,
                                           int place) {
  if (starting & (starting - 1))
    mask &= ~(starting & behind(w.tile, k, Triangles(w.tree, leaf), place, order));
  const uint32_t sure = bits(t.sure());
  for (; mask; mask &= mask - 1) {
    const int lane = __builtin_ctz(mask), r = k + lane;
    if (!alive(w.tile, r)) continue;
    w.tile.answers->count_fallback(w.tile.slot[r]);
    if (t.hit(lane, sure >> lane & 1)) {
      w.decide(r, leaf, place);
      w.trim(r);
    }
  }
}

/// Takes hits that are nearer than the best ones without doubt, of the rays [k, k + kLanes): those
/// of `mask`; `nearer` has no other ones but such that cannot be.
template <bool Any>
__attribute__((always_inline)) inline void take_certain(Walk<Any>& w, int k, uint32_t mask,
                                                        Mask nearer, Floats lo, Floats hi,
                                                        ChildRef leaf, int place) {
  Tile& tile = w.tile;
  float* last = w.packets.rays.last + k;
  if (Any) {
    for (; mask; mask &= mask - 1)
      tile.answers->blocked[tile.slot[k + __builtin_ctz(mask)]] = tile.answers->stop();
    for (float* p : {tile.lo + k, tile.hi + k, last})
      store(p, select(nearer, splat(-kFar), load(p)));
    return;
  }
  const Floats end = select(nearer, hi, load(tile.hi + k));
  store(tile.lo + k, select(nearer, lo, load(tile.lo + k)));
  store(tile.hi + k, end);
  store(tile.pending + k, select(nearer, Ints{} + int32_t(leaf), load(tile.pending + k)));
  store(tile.place + k, select(nearer, Ints{} + place, load(tile.place + k)));
  store(last, smaller(load(last), load(tile.start + k) + end + splat(tile.room)));
}

/// Which candidates are hit indeed.
inline uint32_t hit_lanes(const TriangleTest& t, uint32_t mask) {
  const Floats sum = t.a + t.b + t.c;
  uint32_t hit = mask & bits(t.sure() & at_most(sum, sum));
  for (uint32_t m = mask & ~hit; m; m &= m - 1)
    if (t.hit(__builtin_ctz(m), false)) hit |= m & -m;
  return hit;
}

/// Candidates among the rays [k, k + kLanes): takes those that are certain, and decides the others.
template <bool Any>
__attribute__((always_inline)) inline void take_rays(Walk<Any>& w, int k, uint32_t mask,
                                                     const TriangleTest& t, float extent,
                                                     const Order& order, ChildRef leaf, int place) {
  Tile& tile = w.tile;
  Floats lo, hi;
  t.depth(splat(extent), tile.far_room, lo, hi);
  const Floats best_lo = load(tile.lo + k), best_hi = load(tile.hi + k),
               begin_hi = load(tile.begin_hi + k);
  const Mask sure = t.sure();
  mask &= ~bits(sure & (less(best_hi, lo) | less(hi, load(tile.begin_lo + k))));
  if (!mask || !visible(tile, leaf_first(leaf) + uint32_t(place))) return;
  Mask nearer = sure & less(hi, best_lo) & less(begin_hi, lo);
  if (tile.answers->opacity) {
    if (Any) mask &= hit_lanes(t, mask);
    mask = stopped(w, k, mask, leaf, place);
    nearer = nearer & lanes(mask);
    if (!mask) return;
  }
  const uint32_t certain = bits(nearer) & mask;
  // Lanes of `nearer` outside of `mask` are in conflict: `sure` is false there.
  if (certain) take_certain(w, k, certain, nearer, lo, hi, leaf, place);
  mask &= ~certain;
  if (mask)
    decide_rays(w, k, mask, mask & bits(sure & at_most(lo, begin_hi)), t, order, leaf, place);
}

/// What Corners subtract: where all rays begin, if that is one point.
template <bool Common>
inline Origin origin(const Tile& tile, int k) {
  if (!Common) return {};
  return {{tile.of[0][k], tile.of[1][k], tile.start[k]},
          {tile.rest[0][k], tile.rest[1][k], tile.rest[2][k]}};
}

/// Corners of the triangles [first, first + kLanes) of a leaf, coordinates in the rays' order and
/// sense; from the rays' origin if that is one point.
template <bool Common>
struct Corners {
  alignas(64) float p[9][kLanes];
  Corners(const Triangles& leaf, int first, const Order& order, const Origin& from) {
    Floats v[9];
    corners_from(from, leaf, first, order, v);
    for (int j = 0; j < 9; ++j) store(p[j], v[j]);
  }
};

/// One triangle against the rays [k, k + kLanes). True when some ray was hit, perhaps behind
/// something else.
template <bool Any, bool Common>
inline bool hit_group(Walk<Any>& w, int k, const Corners<Common>& corners, int first, int lane,
                      const Order& order, float extent, ChildRef ref) {
  const Tile& tile = w.tile;
  TriangleTest t;
  const Floats sx = load(tile.slope[0] + k), sy = load(tile.slope[1] + k);
  for (int j = 0; j < 3; ++j) {
    Floats x = splat(corners.p[3 * j][lane]), y = splat(corners.p[3 * j + 1][lane]),
           z = splat(corners.p[3 * j + 2][lane]);
    if constexpr (!Common) {
      x = x - load(tile.of[0] + k) - load(tile.rest[0] + k);
      y = y - load(tile.of[1] + k) - load(tile.rest[1] + k);
      z = z - load(tile.start + k) - load(tile.rest[2] + k);
    }
    t.x[j] = x - sx * z;
    t.y[j] = y - sy * z;
    t.z[j] = z;
  }
  t.edges();
  const uint32_t mask = ~t.conflict() & ((1u << kLanes) - 1);
  if (!mask) return false;
  take_rays(w, k, mask, t, extent, order, ref, first + lane);
  return true;
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

/// Which of the rays [k, k + kDoubles), if they pass inside a triangle, surely meet it behind their
/// origins. Exact would come to negative depths: with m no less than any corner is away and N twice
/// the area that the ray sees, its point is off the ray by less than 2^-42 m^3 / N. Where that is
/// less than `close`, and less than half of s when multiplied by the normal, the depth has the sign
/// of s.
inline uint32_t well_behind(const Tile& tile, int k, const Plane& plane, double sign) {
  const Doubles x = splat(plane.corner.x) - load(tile.o[0] + k),
                y = splat(plane.corner.y) - load(tile.o[1] + k);
  const Doubles z = splat(plane.corner.z) - load(tile.o[2] + k);
  const Doubles nx = splat(plane.normal.x), ny = splat(plane.normal.y), nz = splat(plane.normal.z);
  const Doubles s = nx * x + ny * y + nz * z,
                seen = nx * load(tile.shear[0] + k) + ny * load(tile.shear[1] + k) + nz;
  const Doubles m = magnitude(x) + magnitude(y) + magnitude(z) + splat(plane.size),
                back = flip(s, seen * splat(-sign));
  return bits(less(splat(0x1p-42 * plane.square) * (m * m * m),
                   magnitude(seen) * smaller(back, splat(tile.close * plane.square))));
}

enum class Verdict { kMissed, kHit, kDoubtful };

/// One triangle and those of the rays [k, k + kLanes) that may begin on it: kHit when they have
/// left it behind, as shadow rays and reflections have. `rays`: pass inside of it without doubt.
template <bool Any>
__attribute__((noinline)) Verdict leave_behind(const Walk<Any>& w, int k, uint32_t rays,
                                               ChildRef leaf, int place) {
  const Order& order = order_of(w.tile, k);
  const Plane plane(Triangles(w.tree, leaf), place, order);
  for (int h = 0; h < kLanes; h += kDoubles) {
    const uint32_t some = rays >> h & ((1u << kDoubles) - 1);
    if (some && some & ~well_behind(w.tile, k + h, plane, double(order.sign)))
      return Verdict::kDoubtful;
  }
  return Verdict::kHit;
}

/// One triangle against the rays [k, k + kLanes) of a pencil, by its edges: where these leave no
/// doubt, they agree with hit_group. The edge functions are off by at most a third of `margin`, and
/// so the depth by its extent times margin over their sum.
template <bool Any>
inline Verdict hit_pencil(Walk<Any>& w, int k, const EdgeLines& l, ChildRef leaf, int place) {
  const Tile& tile = w.tile;
  const Floats sx = load(w.pencil.place[0] + k), sy = load(w.pencil.place[1] + k);
  const Floats a = l.k[0] + l.x[0] * sx + l.y[0] * sy, b = l.k[1] + l.x[1] * sx + l.y[1] * sy,
               c = l.k[2] + l.x[2] * sx + l.y[2] * sy;
  const Floats least = smaller(a, smaller(b, c));
  Mask inside = less(l.margin, least);
  constexpr uint32_t kAll = (1u << kLanes) - 1;
  if (bits(inside | less(least, -l.margin)) != kAll) return Verdict::kDoubtful;
  if (!bits(inside) || !visible(tile, leaf_first(leaf) + uint32_t(place))) return Verdict::kMissed;
  const Floats inverse = 1 / (a + b + c), at = l.z + (b * l.dz[0] + c * l.dz[1]) * inverse;
  const Floats error = ((l.rear - l.front) * l.margin + splat(kUnderflow)) * inverse;
  const Floats room = larger(l.rear, -l.front) * splat(0x1p-20f) + splat(w.pencil.room),
               start = load(w.pencil.start + k);
  const Floats lo = larger(at - error, l.front) - start - room,
               hi = smaller(at + error, l.rear) - start + room;
  const Mask begun = less(load(tile.begin_hi + k), lo),
             beyond = less(load(tile.hi + k), lo) | less(hi, load(tile.begin_lo + k));
  if (tile.answers->opacity)
    inside =
        inside & lanes(stopped(w, k, bits(inside) & ~bits(beyond), leaf, place) | bits(beyond));
  const Mask nearer = inside & less(hi, load(tile.lo + k)) & begun;
  if (const uint32_t open = bits(inside) & ~bits(nearer | beyond)) {
    const Mask ahead = less((hi - lo) * splat(0.125f), lo + hi);  // by its looks: not worth asking
    return (open & bits(begun | ahead)) | bits(nearer) ? Verdict::kDoubtful
                                                       : leave_behind(w, k, open, leaf, place);
  }
  if (bits(nearer)) take_certain(w, k, bits(nearer), nearer, lo, hi, leaf, place);
  return Verdict::kHit;
}

/// A ray for spheres and polygons, in double; d scaled so that its longest component is in [1, 2).
struct Scaled {
  D3 o, d;
  double unit;
  Scaled(const Tile& tile, int r)
      : o{tile.xyz_o[0][r], tile.xyz_o[1][r], tile.xyz_o[2][r]}, d{}, unit(0) {
    const double power = power_below(magnitude(tile.along[r]));
    unit = 1 / power;
    d = unit * D3{tile.xyz_d[0][r], tile.xyz_d[1][r], tile.xyz_d[2][r]};
  }
};

/// Both roots in the form that keeps its digits far away (Haines et al. 2019, Precision
/// Improvements for Ray/Sphere Intersection).
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

/// Odd-even rule in the plane of projection: counts the edges that a line to the right of (x, y)
/// crosses.
inline bool odd(const PolygonRecord& record, const float* corners, double x, double y) {
  bool inside = false;
  const float* last = corners + 3 * (record.count - 1);
  double ax = double(last[record.axis_u]) - x, ay = double(last[record.axis_v]) - y;
  for (uint32_t k = 0; k < record.count; ++k) {
    const double bx = double(corners[3 * k + record.axis_u]) - x,
                 by = double(corners[3 * k + record.axis_v]) - y;
    if ((ay > 0) != (by > 0) && (ax * by - bx * ay > 0) == (by > ay)) inside = !inside;
    ax = bx;
    ay = by;
  }
  return inside;
}

template <bool Any>
inline void hit_polygon(Walk<Any>& w, int slot, const Scaled& ray, const PolygonRecord& record,
                        PrimitiveId id) {
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
    if (!visible(w.tile, k)) continue;
    const PrimitiveId id = id_of(w.tile, r, k);
    if (w.tree.kind == kSphereLeaf) hit_sphere(w, slot, ray, w.tree.floats + 4 * size_t(k), id);
    else hit_polygon(w, slot, ray, w.tree.polygons[k], id);
  }
  w.update(r);
}

/// The pending hits of the rays [k, k + kLanes): corner by corner, coordinates in the rays' order,
/// and whose triangles they are. Lanes without one get any.
inline void gather_corners(const Tile& tile, int k, float (&corner)[9][kLanes], Ints& instance,
                           Ints& primitive) {
  const TreeView& tree = *tile.tree;
  const Ints pending = load(tile.pending + k), some = pending != Ints{},
             ordinal = pending & some & int32_t(kOrdinal);
  const Ints n = ((pending >> kCountShift & 7) + 1) & some,
             first = 9 * ordinal + (load(tile.place + k) & some);
  const Ints axis[3] = {across(load(tile.kind + k), 0), across(load(tile.kind + k), 1),
                        load(tile.kind + k) & 3};
  for (int a = 0; a < 3; ++a) {
    Ints at = first + axis[a] * n;
    for (int j = 0; j < 3; ++j, at += 3 * n) store(corner[3 * j + a], gather(tree.floats, at));
  }
  const Ints id = 2 * (ordinal + (load(tile.place + k) & some));
  const float* ids = reinterpret_cast<const float*>(tree.ids);
  instance = tile.instances ? load(tile.instances + k) : Ints(gather(ids, id));
  primitive = Ints(gather(ids, id + 1));
}

/// Hits of the rays [k, k + kLanes), computed.
struct Found {
  alignas(64) double t[kLanes];
  alignas(64) float u[kLanes], v[kLanes];
  Ints instance, primitive;
  uint32_t close;  // lanes that weigh() has answered
};

/// The pending hits of the rays [k, k + kLanes), those of `mask`.
inline void find_hits(const Tile& tile, int k, uint32_t mask, Found& f) {
  const int r = k + __builtin_ctz(mask);
  const ChildRef leaf = tile.pending[r];
  const Ints other = (load(tile.pending + k) ^ int32_t(leaf)) |
                     (load(tile.place + k) ^ int32_t(tile.place[r])) |
                     (load(tile.kind + k) ^ int32_t(tile.kind[r]));
  if (all_zero(other)) {
    const int place = int(tile.place[r]);
    const PrimitiveId id = id_of(tile, r, leaf_first(leaf) + uint32_t(place));
    f.instance = tile.instances ? load(tile.instances + k) : Ints{} + int32_t(id.instance);
    f.primitive = Ints{} + int32_t(id.primitive);
    f.close =
        exact_hits(tile, k, Triangles(*tile.tree, leaf), place, order_of(tile, r), f.t, f.u, f.v);
    return;
  }
  alignas(64) float corner[9][kLanes];
  gather_corners(tile, k, corner, f.instance, f.primitive);
  f.close = 0;
  for (int h = 0; h < kLanes; h += kDoubles)
    f.close |= exact_hits(tile, k, h, corner, f.t, f.u, f.v) << h;
}

/// Computes the pending hits of the rays [k, k + kLanes).
inline void finish_group(Walk<false>& w, int k) {
  Tile& tile = w.tile;
  const uint32_t mask = ~bits(equal(load(tile.pending + k), Ints{})) & ((1u << kLanes) - 1);
  if (!mask) return;
  Found f;
  find_hits(tile, k, mask, f);
  Answers& answers = *tile.answers;
  if (!(mask & ~f.close) && !tile.instances &&
      k + kLanes <= tile.count) {  // slots are those of the rays
    const Mask none = equal(load(tile.pending + k), Ints{});
    for (int h = 0; h < kLanes; h += kDoubles)
      store(answers.t + k + h, select(Longs(widen(tile.pending + k + h) != Longs{}), load(f.t + h),
                                      load(answers.t + k + h)));
    store(answers.u + k, select(none, load(answers.u + k), load(f.u)));
    store(answers.v + k, select(none, load(answers.v + k), load(f.v)));
    store(answers.instance + k, select(none, load(answers.instance + k), f.instance));
    store(answers.primitive + k, select(none, load(answers.primitive + k), f.primitive));
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
