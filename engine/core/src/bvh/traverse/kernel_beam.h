// Beams: many rays that begin at one point, as a camera's do, and go on as one packet, whose
// triangles are then tested against one register of rays after the other. A ray is two numbers, its
// place: its slopes, from those of the beam's middle. Everything in single precision is a bound: a
// triangle is hit for sure, missed for sure, nearer or farther for sure, or else `decide` asks the
// rules that hold for single rays. So products may be fused with sums here, and registers be as
// wide as they are.
#pragma once
#include "bvh/traverse/kernel_packets.h"
#include "simd/broad_lanes.h"

namespace glint {
namespace {

constexpr int kBeam = kBroad == 4 ? 128 : 256;
constexpr int kMostSlices = 32;
/// Leaves that a beam may come to before it is parted.
constexpr int leaves_allowed(int rays, bool any) { return any ? 150 : rays > kTile ? 300 : 100; }

/// What a beam's rays are in double, columns in their order (Order::axes).
struct BeamSource {
  const double *o[3], *d[3], *t_min, *t_max;
  const Order* order;
};

/// `Count` rays. Depths are counted from the apex, in the rays' sense, as 1 / depth: linear in the
/// place along a plane, and 0 where nothing was hit yet.
template <int Count>
struct Beam {
  static constexpr int kSlices = Count / kBroad;  // groups of rays as wide as a register
  alignas(64) float place[2][Count];
  alignas(64) float farthest[Count], nearest[Count];    // bounds of 1 / depth of a ray's best hit
  alignas(64) uint32_t pending[Count], leaf_at[Count];  // its leaf, kNothing: none; place in it
  alignas(64) float center[2][kMostSlices], half[2][kMostSlices];  // of slices: extent in places
  alignas(64) float end[kMostSlices];                              // and the least `farthest`
  BeamSource source;
  const Order* order;  // the rays', or turned round where they end at the apex
  Origin apex;
  float middle[2], width[2];  // slopes of the ray with place 0; no place is more
  float slope;                // no slope is more
  float reach;                // from the apex to where rays begin, in depth, where they end there
  float off;                  // what rays miss the apex by
  float room;                 // of boxes
  float begin;                // surely in front of hits beyond all t_min: 1 / depth
  float last_end;             // the least `end`
  float last_depth;           // coordinate beyond which no box is of use
  double close;               // as Tile::close

  /// The slopes of a ray, as Tile::shear.
  void set_shear(int r, double (&shear)[2]) const {
    const double inverse = 1 / source.d[2][r];
    for (int a = 0; a < 2; ++a) shear[a] = source.d[a][r] * inverse;
  }
};

/// The triangles [first, first + kLanes) of a leaf, seen from a beam's apex. Edge functions k + x
/// place + y place', positive inside; 1 / depth = plane + plane_x place + plane_y place', off by
/// less than plane_off.
///
/// Bounds. With s the largest slope, z no less than any corner is along and m than any is across as
/// one of the beam's rays sees it, corners are off by at most d = 2^-20 s z + 2^-21 m across: those
/// of single rays' test (hit_group) by u (5 s z + 3 m), those here by u (6 s z + 3 m) for the
/// difference to the apex, the place and the shear. Either test sees the triangle through its
/// displaced corners: so a ray that it takes for one inside passes within d of the triangle, where
/// edge functions change by at most 2 E d, E the longest edge; and one that is inside by 4 E d is
/// farther than sqrt 2 d from every edge and stays inside. What the products here round is less
/// than 9 u m^2. Signs of the single rays' test are exact (exactly_hit).
///
/// Depths. A hit that is surely inside lies on the triangle, and moves with its displaced corners:
/// by d across and 4 u z along, as parts of the plane's distance det / |n|. The normal's products
/// are off by 4 u E3^2, which at a point of the triangle, E3 or less from the corner that the plane
/// goes through, is 12 u E3^3. Other roundings are less than 8 u of the sum's terms.
struct BeamTriangles {
  Floats k[3], x[3], y[3], margin, plane, plane_x, plane_y, plane_off;
  uint32_t edge_on;  // no side is known
  uint32_t near;     // not surely beside or behind the beam
};

template <bool Any, int Count>
__attribute__((always_inline)) inline BeamTriangles see_triangles(const Beam<Count>& beam,
                                                                  const Triangles& leaf,
                                                                  int first) {
  Floats p[9], across{}, deepest{};
  corners_from(beam.apex, leaf, first, *beam.order, p);
  for (int j = 0; j < 3; ++j) {
    const Floats z = p[3 * j + 2];
    for (int a = 0; a < 2; ++a) {
      p[3 * j + a] = fused(splat(-beam.middle[a]), z, p[3 * j + a]);
      across = larger(magnitude(p[3 * j + a]), across);
    }
    deepest = larger(magnitude(z), deepest);
  }
  const Floats w0 = splat(beam.width[0]), w1 = splat(beam.width[1]),
               widest = splat(larger(beam.width[0], beam.width[1]));
  across = fused(widest, deepest, across);
  BeamTriangles t;
  for (int e = 0; e < 3; ++e) {
    const Floats *a = p + 3 * ((e + 1) % 3), *b = p + 3 * ((e + 2) % 3);
    t.k[e] = fused(a[0], b[1], -(a[1] * b[0]));
    t.x[e] = fused(a[1], b[2], -(a[2] * b[1]));
    t.y[e] = fused(a[2], b[0], -(a[0] * b[2]));
  }
  Floats g[3], h[3], longest{}, longest_z{};
  for (int a = 0; a < 3; ++a) {
    g[a] = p[3 + a] - p[a];
    h[a] = p[6 + a] - p[a];
    Floats& l = a == 2 ? longest_z : longest;
    l = larger(l, larger(magnitude(h[a] - g[a]), larger(magnitude(g[a]), magnitude(h[a]))));
  }
  const Floats longest_3 = larger(longest, longest_z);
  longest = fused(widest, longest_z, longest);
  const Floats nx = fused(g[1], h[2], -(g[2] * h[1])), ny = fused(g[2], h[0], -(g[0] * h[2])),
               nz = fused(g[0], h[1], -(g[1] * h[0]));
  const Floats det = fused(nx, p[0], fused(ny, p[1], nz * p[2])), inverse = 1 / det;
  t.plane = nz * inverse;
  t.plane_x = nx * inverse;
  t.plane_y = ny * inverse;
  Floats off = fused(splat(0x1p-20f * beam.slope), deepest, splat(0x1p-21f) * across);
  if (Any) off += splat(0x1p-20f * beam.slope * beam.reach + 1.25f * beam.off);
  t.margin =
      fused(splat(4.0f) * longest, off, fused(splat(0x1p-20f) * across, across, splat(kUnderflow)));
  const Floats terms =
      fused(magnitude(t.plane_x), w0, fused(magnitude(t.plane_y), w1, magnitude(t.plane)));
  const Floats bent =
      fused(magnitude(nx) + magnitude(ny), fused(splat(0x1p-23f), across, off),
            fused(magnitude(nz), splat(0x1p-22f) * deepest,
                  splat(0x1p-20f) * longest_3 * longest_3 * longest_3 + splat(kUnderflow)));
  t.plane_off = terms * fused(bent, magnitude(inverse), splat(0x1p-21f));
  const Floats area = t.k[0] + t.k[1] + t.k[2];
  const Floats swing = fused(magnitude(nx), w0, magnitude(ny) * w1);
  t.edge_on = ~bits(less(fused(splat(4.0f), t.margin, swing), magnitude(area)));
  const Ints side = Ints(area) & INT32_MIN;
  Mask beside =
      less(fused(magnitude(t.plane_x), w0, fused(magnitude(t.plane_y), w1, t.plane)) + t.plane_off,
           splat(beam.last_end));
  for (int e = 0; e < 3; ++e) {
    t.k[e] = Floats(Ints(t.k[e]) ^ side);
    t.x[e] = Floats(Ints(t.x[e]) ^ side);
    t.y[e] = Floats(Ints(t.y[e]) ^ side);
    beside = beside |
             less(fused(magnitude(t.x[e]), w0, fused(magnitude(t.y[e]), w1, t.k[e])), -t.margin);
  }
  t.near = ~bits(beside) | t.edge_on;
  return t;
}

/// The same in memory, to be had one by one.
struct BeamTable {
  alignas(64) float lines[14][kLanes];
  explicit BeamTable(const BeamTriangles& t) {
    for (int e = 0; e < 3; ++e) {
      store(lines[3 * e], t.k[e]);
      store(lines[3 * e + 1], t.x[e]);
      store(lines[3 * e + 2], t.y[e]);
    }
    store(lines[9], t.margin);
    store(lines[10], t.plane);
    store(lines[11], t.plane_x);
    store(lines[12], t.plane_y);
    store(lines[13], t.plane_off);
  }
  float at(int line, int lane) const { return lines[line][lane]; }
};

/// A point in the order of rays, in the sense of `order`.
inline Origin origin_at(const double (&point)[3], const Order& order) {
  Origin origin;
  for (int a = 0; a < 3; ++a) {
    const double p = a == 2 ? flip(point[a], double(order.sign)) : point[a];
    origin.o[a] = float(p);
    origin.low_part[a] = float(p - double(origin.o[a]));
  }
  return origin;
}

/// A beam on its way through a tree of triangles.
template <bool Any, int Count>
struct BeamWalk {
  static constexpr int kSlices = Beam<Count>::kSlices;
  const TreeView& tree;
  Beam<Count>& beam;
  Answers& answers;

  /// Whether a single ray's float test finds a triangle hit.
  bool hit(int r, const Triangles& leaf, int place, const double (&shear)[2]) const {
    const BeamSource& s = beam.source;
    const Order& order = *s.order;
    const double sign = double(order.sign);
    const float slope[2] = {float(flip(shear[0], sign)), float(flip(shear[1], sign))};
    const Origin from = origin_at({s.o[0][r], s.o[1][r], s.o[2][r]}, order);
    float x[3], y[3];
    for (int j = 0; j < 3; ++j) {
      const auto at = [&](int a) { return leaf.at(j, order.axes[a])[place]; };
      const float z = at(2) * order.sign - from.o[2] - from.low_part[2];
      x[j] = at(0) - from.o[0] - from.low_part[0] - slope[0] * z;
      y[j] = at(1) - from.o[1] - from.low_part[1] - slope[1] * z;
    }
    const float a = x[2] * y[1] - y[2] * x[1], b = x[0] * y[2] - y[0] * x[2],
                c = x[1] * y[0] - y[1] * x[0];
    const float low = smaller(a, smaller(b, c)), high = larger(a, larger(b, c));
    if (low < 0 && high > 0) return false;
    return low > 0 || high < 0 || exactly_hit(x, y);
  }
  Hit exact(int r, ChildRef leaf, int place, const double (&shear)[2]) const {
    const BeamSource& s = beam.source;
    const Exact<double> e = exact_hit(Triangles(tree, leaf), place, *s.order,
                                      {s.o[0][r], s.o[1][r], s.o[2][r]}, shear, beam.close);
    const PrimitiveId id = tree.ids[leaf_first(leaf) + uint32_t(place)];
    return {e.depth / s.d[2][r], id.instance, id.primitive, float(e.u), float(e.v)};
  }
  /// What floats cannot tell of a ray and a triangle.
  __attribute__((noinline)) void decide(int r, ChildRef leaf, int place) {
    if (Any && beam.farthest[r] > kFar) return;
    answers.count_fallback(r);
    const BeamSource& s = beam.source;
    double shear[2];
    beam.set_shear(r, shear);
    if (!hit(r, Triangles(tree, leaf), place, shear)) return;
    const Hit found = exact(r, leaf, place, shear);
    if (!(found.t > s.t_min[r] && found.t < s.t_max[r])) return;
    if (Any) {
      beam.farthest[r] = beam.nearest[r] = __builtin_inff();
      return;
    }
    if (beam.pending[r] != kNothing &&
        !Answers::nearer(found, exact(r, beam.pending[r], int(beam.leaf_at[r]), shear)))
      return;
    const double inverse_depth = 1 / magnitude(found.t * s.d[2][r]);
    beam.pending[r] = leaf;
    beam.leaf_at[r] = uint32_t(place);
    beam.farthest[r] = float(inverse_depth * (1 - 0x1p-21));
    beam.nearest[r] = float(inverse_depth * (1 + 0x1p-21));
  }

  void leaf(ChildRef ref) {
    const Triangles triangles(tree, ref);
    uint32_t changed = 0;
    for (int first = 0; first < triangles.n; first += kLanes) {
      const BeamTriangles seen = see_triangles<Any>(beam, triangles, first);
      const int rest = triangles.n - first < kLanes ? triangles.n - first : kLanes;
      uint32_t mask = seen.near & ((1u << rest) - 1);
      if (!mask) continue;
      const BeamTable table(seen);
      for (; mask; mask &= mask - 1) {
        const int lane = __builtin_ctz(mask);
        const bool edge_on = seen.edge_on >> lane & 1;
        if (answers.masks && !shown(ref, first + lane)) continue;
        uint32_t slices = edge_on ? uint32_t((uint64_t(1) << kSlices) - 1) : met(table, lane);
        for (; slices; slices &= slices - 1) {
          const int g = __builtin_ctz(slices);
          if (edge_on ? slice_edge_on(g, table, lane, ref, first + lane)
                      : slice(g, table, lane, ref, first + lane))
            changed |= 1u << g;
        }
      }
    }
    if (changed) shorten(changed);
  }
  /// Whether all triangles of a leaf stop rays.
  bool opaque(ChildRef ref) const {
    const Opacity& opacity = *answers.opacity;
    const PrimitiveId* ids = tree.ids + leaf_first(ref);
    for (int k = 0; k < leaf_count(ref); ++k)
      if (!stops<Any>(opacity, opacity.of_instance[ids[k].instance])) return false;
    return true;
  }
  bool shown(ChildRef ref, int place) const {
    return (answers.masks[tree.ids[leaf_first(ref) + uint32_t(place)].instance] &
            answers.visibility) != 0;
  }
  /// Slices that a triangle is not surely beside or behind.
  __attribute__((always_inline)) uint32_t met(const BeamTable& t, int lane) const {
    const Broad behind = spread(-t.at(9, lane)), px = spread(t.at(11, lane)),
                py = spread(t.at(12, lane)), p = spread(t.at(10, lane) + t.at(13, lane));
    uint32_t mask = 0;
    for (int g = 0; g < kSlices; g += kBroad) {
      const Broad cx = load_broad(beam.center[0] + g), cy = load_broad(beam.center[1] + g),
                  hx = load_broad(beam.half[0] + g), hy = load_broad(beam.half[1] + g);
      BroadMask out =
          less(fused(magnitude(px), hx, fused(magnitude(py), hy, fused(px, cx, fused(py, cy, p)))),
               load_broad(beam.end + g));
      for (int e = 0; e < 3; ++e) {
        const Broad x = spread(t.at(3 * e + 1, lane)), y = spread(t.at(3 * e + 2, lane)),
                    k = spread(t.at(3 * e, lane));
        out = out |
              less(fused(magnitude(x), hx, fused(magnitude(y), hy, fused(x, cx, fused(y, cy, k)))),
                   behind);
      }
      mask |= (~bits(out) & ((1u << kBroad) - 1)) << g;
    }
    return mask & uint32_t((uint64_t(1) << kSlices) - 1);
  }
  __attribute__((always_inline)) Broad edge(int e, const BeamTable& t, int lane, Broad x,
                                            Broad y) const {
    return fused(spread(t.at(3 * e + 1, lane)), x,
                 fused(spread(t.at(3 * e + 2, lane)), y, spread(t.at(3 * e, lane))));
  }
  /// One triangle against the rays of a slice. Whether a hit was found.
  __attribute__((always_inline)) bool slice(int g, const BeamTable& t, int lane, ChildRef ref,
                                            int place) {
    const int k = g * kBroad;
    const Broad x = load_broad(beam.place[0] + k), y = load_broad(beam.place[1] + k),
                farthest = load_broad(beam.farthest + k), nearest = load_broad(beam.nearest + k);
    const Broad least =
        smaller(edge(0, t, lane, x, y), smaller(edge(1, t, lane, x, y), edge(2, t, lane, x, y)));
    const float margin = t.at(9, lane), off = t.at(13, lane);
    const Broad at =
        fused(spread(t.at(11, lane)), x, fused(spread(t.at(12, lane)), y, spread(t.at(10, lane))));
    const Broad low = at - spread(off), high = at + spread(off);
    const BroadMask inside = less(spread(margin), least),
                    nearer = inside & less(nearest, low) & less(high, spread(beam.begin)),
                    away = less(least, spread(-margin)) | less(high, farthest);
    const uint32_t sure = bits(nearer);
    if (sure && Any) {
      store_broad(beam.farthest + k, select(nearer, spread(__builtin_inff()), farthest));
      store_broad(beam.nearest + k, select(nearer, spread(__builtin_inff()), nearest));
    } else if (sure) {
      store_broad(beam.farthest + k, select(nearer, low, farthest));
      store_broad(beam.nearest + k, select(nearer, high, nearest));
      put(beam.pending + k, nearer, ref);
      put(beam.leaf_at + k, nearer, uint32_t(place));
    }
    uint32_t doubt = ~(sure | bits(away)) & ((1u << kBroad) - 1);
    if (Any && __builtin_expect((doubt & bits(inside)) != 0, 0))
      doubt &= ~left_behind(k, doubt & bits(inside), ref, place);
    if (__builtin_expect(doubt != 0, 0)) {
      if (__builtin_expect(!Any && answers.opacity, 0)) doubt &= ~not_begun(k, doubt, ref, place);
      decide_all(k, doubt, ref, place);
    }
    return (sure | doubt) != 0;
  }
  /// Those of some rays from k on that meet a triangle before they begin, if at all: they go on
  /// behind a surface that they pass.
  __attribute__((noinline)) uint32_t not_begun(int k, uint32_t rays, ChildRef ref,
                                               int place) const {
    const BeamSource& s = beam.source;
    const Triangles leaf(tree, ref);
    Doubles p[3][3];
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a) p[j][a] = splat(double(leaf.at(j, s.order->axes[a])[place]));
    uint32_t found = 0;
    for (int h = 0; h < kBroad; h += kDoubles) {
      if (!(rays >> h & ((1u << kDoubles) - 1))) continue;
      const int r = k + h;
      const Doubles along = load(s.d[2] + r), inverse = 1 / along, margin = splat(beam.close);
      Exact<Doubles> e;
      e.see(p, {load(s.o[0] + r), load(s.o[1] + r), load(s.o[2] + r)},
            {load(s.d[0] + r) * inverse, load(s.d[1] + r) * inverse});
      e.weigh();
      found |= bits(at_most(magnitude(e.off_x), margin) & at_most(magnitude(e.off_y), margin) &
                    at_most(e.depth / along, load(s.t_min + r)))
               << h;
    }
    return found & rays;
  }
  /// Those of some rays from k on, all surely inside a triangle, that surely begin beyond it: on
  /// the surface that they leave.
  __attribute__((noinline)) uint32_t left_behind(int k, uint32_t rays, ChildRef ref,
                                                 int place) const {
    const BeamSource& s = beam.source;
    const Plane plane(Triangles(tree, ref), place, *s.order);
    uint32_t left = 0;
    for (int h = 0; h < kBroad; h += kDoubles) {
      if (!(rays >> h & ((1u << kDoubles) - 1))) continue;
      const int r = k + h;
      const Doubles inverse = 1 / load(s.d[2] + r);
      left |= well_behind({load(s.o[0] + r), load(s.o[1] + r), load(s.o[2] + r)},
                          {load(s.d[0] + r) * inverse, load(s.d[1] + r) * inverse}, beam.close,
                          plane, double(s.order->sign))
              << h;
    }
    return left & rays;
  }
  /// One that may face either way.
  __attribute__((noinline)) bool slice_edge_on(int g, const BeamTable& t, int lane, ChildRef ref,
                                               int place) {
    const int k = g * kBroad;
    const Broad x = load_broad(beam.place[0] + k), y = load_broad(beam.place[1] + k);
    const Broad a = edge(0, t, lane, x, y), b = edge(1, t, lane, x, y), c = edge(2, t, lane, x, y);
    const float margin = t.at(9, lane);
    const BroadMask missed = less(smaller(a, smaller(b, c)), spread(-margin)) &
                             less(spread(margin), larger(a, larger(b, c)));
    const uint32_t doubt = ~bits(missed) & ((1u << kBroad) - 1);
    decide_all(k, doubt, ref, place);
    return doubt != 0;
  }
  void decide_all(int k, uint32_t rays, ChildRef ref, int place) {
    for (; rays; rays &= rays - 1) decide(k + __builtin_ctz(rays), ref, place);
  }
  void shorten(uint32_t slices) {
    for (; slices; slices &= slices - 1) {
      const int g = __builtin_ctz(slices);
      beam.end[g] = smallest(load_broad(beam.farthest + g * kBroad));
    }
    set_end();
  }
  void set_end() {
    Broad least = load_broad(beam.end);
    for (int g = kBroad; g < kSlices; g += kBroad) least = smaller(load_broad(beam.end + g), least);
    set_end(smallest(least));
  }
  void set_end(float least) {
    beam.last_end = least;
    beam.last_depth = beam.apex.o[2] + beam.apex.low_part[2] + (1 + 0x1p-20f) / least + beam.room;
  }

  /// For the memory of a node or a leaf, to have it when it is its turn.
  void ask(ChildRef child) const {
    const char* p = child & kLeaf
                        ? reinterpret_cast<const char*>(tree.floats + 9 * size_t(leaf_first(child)))
                        : reinterpret_cast<const char*>(tree.nodes + child);
    for (size_t k = 0; k < sizeof(Node); k += 64) __builtin_prefetch(p + k);
  }
  /// False when it came to more leaves than it is meant for, or to what rays may pass.
  bool walk() {
    const Order& order = *beam.order;
    Floats m[kLines], c[kLines];
    Mask falls[kLines];
    for (int l = 0; l < kLines; ++l) {
      const int a = l / 2;
      const float turn = beam.width[a] + 0x1p-22f, apart = l % 2 ? beam.room : -beam.room;
      const float slope = l % 2 ? beam.middle[a] + turn : beam.middle[a] - turn;
      m[l] = splat(slope);
      c[l] = splat(beam.apex.o[a] - slope * beam.apex.o[2] + apart);
      falls[l] = less(m[l], Floats{});
    }
    const Floats first = splat(beam.apex.o[2] - beam.room);
    ChildRef waiting[kStack];
    float distance[kStack];
    alignas(64) float front[kWidth];
    int top = 0, leaves = leaves_allowed(Count, Any);
    ChildRef at = tree.root;
    for (;;) {
      if (at & kLeaf) {
        if (--leaves < 0 || (answers.opacity && !opaque(at))) return false;
        leaf(at);
      } else {
        const Node& n = tree.nodes[at];
        uint32_t mask = 0;
        for (int h = 0; h < kWidth; h += kLanes) {
          const Boxes b = boxes_of(n.planes[0] + h, order);
          const Floats near = larger(b.front, first), far = smaller(b.rear, splat(beam.last_depth));
          const auto line = [&](int l, bool low) {
            return fused(m[l], low ? select(falls[l], far, near) : select(falls[l], near, far),
                         c[l]);
          };
          const Mask misses = less(far, near) | less(b.high_x, line(kLowX, true)) |
                              less(line(kHighX, false), b.low_x) |
                              less(b.high_y, line(kLowY, true)) |
                              less(line(kHighY, false), b.low_y);
          store(front + h, near);
          mask |= (~bits(misses) & ((1u << kLanes) - 1)) << h;
        }
        const int base = top;
        for (; mask; mask &= mask - 1) {
          const int child = __builtin_ctz(mask);
          int p = top++;
          for (; p > base && distance[p - 1] < front[child]; --p) {
            waiting[p] = waiting[p - 1];
            distance[p] = distance[p - 1];
          }
          waiting[p] = n.child[child];
          ask(n.child[child]);
          distance[p] = front[child];
        }
      }
      do {
        if (top == 0) return true;
        --top;
      } while (!(distance[top] <= beam.last_depth));
      at = waiting[top];
    }
  }
};

/// What is known of a beam's rays: |along|, t_max, t_min.
struct BeamSpan {
  double shortest, longest, earliest, latest;
};

/// Whether `Count` rays from `first` on are of one axis class, and alive.
template <int Count>
inline bool set_source(Beam<Count>& beam, const Rays& rays, size_t first, BeamSpan& span) {
  const Order& order =
      kOrders[axis_class_of({rays.d[0][first], rays.d[1][first], rays.d[2][first]})];
  const int axis = order.axes[2];
  BeamSource& s = beam.source;
  beam.order = s.order = &order;
  s.t_min = rays.t_min + first;
  s.t_max = rays.t_max + first;
  for (int a = 0; a < 3; ++a) {
    s.d[a] = rays.d[order.axes[a]] + first;
    s.o[a] = rays.o[order.axes[a]] + first;
  }
  const Doubles sign = splat(double(order.sign)), zero{};
  Doubles shortest = splat(kInf), longest{}, earliest = splat(kInf), latest{};
  for (int k = 0; k < Count; k += kDoubles) {
    const Doubles ahead = flip(load(s.d[2] + k), sign), x = magnitude(load(s.d[0] + k)),
                  y = magnitude(load(s.d[1] + k)), t_min = load(s.t_min + k),
                  t_max = load(s.t_max + k);
    const DoubleMask good = (axis < 2 ? at_most(x, ahead) : less(x, ahead)) &
                            (axis < 1 ? at_most(y, ahead) : less(y, ahead)) & at_most(zero, t_min) &
                            less(t_min, t_max);
    if (bits(good) != (1u << kDoubles) - 1) return false;
    shortest = smaller(ahead, shortest);
    longest = larger(ahead, longest);
    earliest = smaller(t_max, earliest);
    latest = larger(t_min, latest);
  }
  span = {least_of(shortest), most_of(longest), least_of(earliest), most_of(latest)};
  return span.shortest > 0x1p-60 && span.longest < 0x1p60;
}

/// Whether all rays begin no more than four radii from the tree's ball: there the rays of all
/// tests begin at their origins. `square`: of the largest distance from its centre.
template <int Count>
inline bool set_room(Beam<Count>& beam, const TreeView& tree, double square) {
  const double size = reach_of(tree), center = size - 4 * tree.radius;
  if (!(square < 16 * tree.radius * tree.radius * (1 - 0x1p-40)) || !(size < 0x1p30)) return false;
  beam.room = float(2 * kBoxMargin * (center + __builtin_sqrt(square)));
  beam.close = 0x1p-21 * center;
  return true;
}

/// Rays that begin at one point.
template <int Count>
inline bool set_from_apex(Beam<Count>& beam, const TreeView& tree, const Rays& rays, size_t first) {
  for (const double* o : rays.o)
    if (!(o[first] == o[first + Count - 1])) return false;
  BeamSpan span;
  if (!set_source(beam, rays, first, span)) return false;
  const BeamSource& s = beam.source;
  for (int k = 0; k < Count; k += kDoubles) {
    Longs other{};
    for (const double* p : s.o) other |= Longs(load(p + k)) ^ Longs(splat(*p));
    if (any(Longs(other != Longs{}))) return false;
  }
  const double apex[3] = {*s.o[0], *s.o[1], *s.o[2]};
  double square = 0;
  for (int a = 0; a < 3; ++a) {
    const double f = tree.center[beam.order->axes[a]] - apex[a];
    square += f * f;
  }
  if (!set_room(beam, tree, square)) return false;
  beam.apex = origin_at(apex, *beam.order);
  beam.reach = beam.off = 0;
  beam.begin = float((1 - 0x1p-19) / (span.latest * span.longest));
  const bool endless = span.earliest * span.shortest >= 8 * tree.radius;
  for (int k = 0; k < Count; k += kDoubles) {
    const Doubles end = endless ? Doubles{} : 1 / magnitude(load(s.t_max + k) * load(s.d[2] + k));
    narrow(beam.farthest + k, end * (1 - 0x1p-21));
    narrow(beam.nearest + k, end * (1 + 0x1p-21));
  }
  return true;
}

/// Where the lines of a beam's first and last ray are nearest to each other, in the rays' order.
template <int Count>
inline bool set_meeting(const Beam<Count>& beam, double (&apex)[3]) {
  const BeamSource& s = beam.source;
  constexpr int kFinal = Count - 1;
  double first[2], final[2], across = 0, square = 0;
  beam.set_shear(0, first);
  beam.set_shear(kFinal, final);
  for (int a = 0; a < 2; ++a) {
    const double turn = final[a] - first[a];
    across += turn * (s.o[a][kFinal] - *s.o[a] - first[a] * (s.o[2][kFinal] - *s.o[2]));
    square += turn * turn;
  }
  apex[2] = s.o[2][kFinal] - across / square;
  for (int a = 0; a < 2; ++a) apex[a] = *s.o[a] + first[a] * (apex[2] - *s.o[2]);
  return square > 0;
}

/// Rays that end at one point, or a little before it. `farthest` and `nearest` are those of where
/// they begin: what lies behind that, as seen from the apex, is no hit.
template <int Count>
inline bool set_to_apex(Beam<Count>& beam, const TreeView& tree, const Rays& rays, size_t first) {
  const auto end_of = [&](int a, size_t k) { return rays.o[a][k] + rays.t_max[k] * rays.d[a][k]; };
  for (int a = 0; a < 3; ++a)  // where they do not, this tells mostly
    if (!(magnitude(end_of(a, first) - end_of(a, first + Count - 1)) < 0x1p-16 * tree.radius))
      return false;
  BeamSpan span;
  double apex[3];
  if (!set_source(beam, rays, first, span) || !set_meeting(beam, apex)) return false;
  const BeamSource& s = beam.source;
  const Order& order = kOrders[uint32_t(s.order - kOrders) ^ 4];
  beam.order = &order;
  const Doubles sign = splat(double(order.sign));
  Doubles off{}, square{}, nearest = splat(kInf), farthest{}, end{}, past = splat(kInf);
  for (int k = 0; k < Count; k += kDoubles) {
    const Doubles along = load(s.d[2] + k), length = magnitude(along),
                  way = load(s.o[2] + k) - splat(apex[2]), steps = way / along;
    Doubles distance{};
    for (int a = 0; a < 3; ++a) {
      const Doubles o = load(s.o[a] + k), f = splat(tree.center[order.axes[a]]) - o;
      distance += f * f;
      if (a < 2) off = larger(magnitude(o - load(s.d[a] + k) * steps - splat(apex[a])), off);
    }
    const Doubles from = flip(way, sign), start = from - load(s.t_min + k) * length,
                  rest = from - load(s.t_max + k) * length, inverse = 1 / start;
    square = larger(distance, square);
    nearest = smaller(start, nearest);
    farthest = larger(from, farthest);
    end = larger(rest, end);
    past = smaller(rest, past);
    narrow(beam.farthest + k, inverse * (1 - 0x1p-21));
    narrow(beam.nearest + k, inverse * (1 + 0x1p-21));
  }
  const double size = reach_of(tree), tiny = 0x1p-40 * size, reach = most_of(farthest),
               miss = most_of(off) + tiny;
  if (!set_room(beam, tree, most_of(square)) || !(reach < 16 * size) || !(miss < 0x1p-20 * reach) ||
      !(least_of(nearest) > 0x1p-16 * size) || !(least_of(past) > -tiny))
    return false;
  beam.reach = float(reach);
  beam.off = float(miss);
  beam.room += 2 * beam.off;
  beam.begin = float((1 - 0x1p-19) / (most_of(end) + tiny));
  beam.apex = origin_at(apex, order);
  return true;
}

/// False when the rays' slices do not share out their places: then smaller beams are better.
template <int Count>
inline bool set_places(Beam<Count>& beam) {
  const BeamSource& s = beam.source;
  const Broad sign = spread(beam.order->sign);
  float low[2] = {kFar, kFar}, high[2] = {-kFar, -kFar};
  for (int a = 0; a < 2; ++a)
    beam.middle[a] = float(0.5 * double(beam.order->sign) *
                           (s.d[a][0] / s.d[2][0] + s.d[a][Count - 1] / s.d[2][Count - 1]));
  for (int g = 0; g < Beam<Count>::kSlices; ++g) {
    const int k = g * kBroad;
    const Broad inverse = 1 / (narrow_broad(s.d[2] + k) * sign);
    for (int a = 0; a < 2; ++a) {
      const Broad place = narrow_broad(s.d[a] + k) * inverse - spread(beam.middle[a]);
      store_broad(beam.place[a] + k, place);
      const float least = smallest(place), most = largest(place);
      beam.center[a][g] = 0.5f * (least + most);
      beam.half[a][g] = 0.5f * (most - least);
      low[a] = smaller(low[a], least);
      high[a] = larger(high[a], most);
    }
    beam.end[g] = smallest(load_broad(beam.farthest + k));
    store_broad(reinterpret_cast<float*>(beam.pending + k), Broad{});
  }
  beam.slope = 0;
  for (int a = 0; a < 2; ++a) {
    beam.width[a] = larger(-low[a], high[a]);
    beam.slope = larger(beam.slope, magnitude(beam.middle[a]) + beam.width[a]);
  }
  for (int g = Beam<Count>::kSlices; g < kBroad; ++g) {
    for (int a = 0; a < 2; ++a) beam.center[a][g] = beam.half[a][g] = 0;
    beam.end[g] = kFar;
  }
  float area = 0;
  const float room[2] = {beam.width[0] / 16, beam.width[1] / 16};
  for (int g = 0; g < Beam<Count>::kSlices; ++g)
    area += (beam.half[0][g] + room[0]) * (beam.half[1][g] + room[1]);
  const float whole = beam.width[0] * beam.width[1];
  return 4 * area >= whole && area <= 4 * whole;
}

/// One hit that weigh() has not answered.
template <int Count>
__attribute__((noinline)) void finish_at_edge(const Beam<Count>& beam, const TreeView& tree,
                                              const Answers& answers, int r) {
  const BeamSource& s = beam.source;
  double shear[2];
  beam.set_shear(r, shear);
  const Exact<double> e = exact_hit(Triangles(tree, beam.pending[r]), int(beam.leaf_at[r]),
                                    *s.order, {s.o[0][r], s.o[1][r], s.o[2][r]}, shear, beam.close);
  answers.t[r] = e.depth / s.d[2][r];
  answers.u[r] = float(e.u);
  answers.v[r] = float(e.v);
}

/// The hits of kLanes rays, in double.
template <int Count>
inline void finish_beam(const Beam<Count>& beam, const TreeView& tree, const Answers& answers,
                        int k) {
  const Order& order = *beam.order;
  const Ints pending = load(beam.pending + k);
  const Mask none = equal(pending, Ints{});
  const uint32_t hits = ~bits(none) & ((1u << kLanes) - 1);
  if (!hits) {
    for (int h = 0; h < kLanes; h += kDoubles) store(answers.t + k + h, splat(kInf));
    store(answers.instance + k, Ints{} - 1);
    store(answers.primitive + k, Ints{});
    store(answers.u + k, Floats{});
    store(answers.v + k, Floats{});
    return;
  }
  const Ints leaf_at = load(beam.leaf_at + k), some = pending != Ints{};
  const int r = k + __builtin_ctz(hits);
  const Triangles leaf(tree, beam.pending[r]);
  const int place = int(beam.leaf_at[r]);
  const bool one = all_zero(
      ((pending ^ int32_t(beam.pending[r])) | (leaf_at ^ int32_t(beam.leaf_at[r]))) & some);
  alignas(64) float corner[9][kLanes];
  Ints instance, primitive;
  if (one) {
    const PrimitiveId id = tree.ids[leaf_first(beam.pending[r]) + beam.leaf_at[r]];
    instance = Ints{} + int32_t(id.instance);
    primitive = Ints{} + int32_t(id.primitive);
  } else {
    const Ints ordinal = pending & some & int32_t(kOrdinal), in_leaf = leaf_at & some,
               n = ((pending >> kCountShift & 7) + 1) & some;
    for (int a = 0; a < 3; ++a) {
      Ints at = 9 * ordinal + in_leaf + order.axes[a] * n;
      for (int j = 0; j < 3; ++j, at += 3 * n) store(corner[3 * j + a], gather(tree.floats, at));
    }
    const Ints id = 2 * (ordinal + in_leaf);
    const float* ids = reinterpret_cast<const float*>(tree.ids);
    instance = Ints(gather(ids, id));
    primitive = Ints(gather(ids, id + 1));
  }
  alignas(64) float u[kLanes], v[kLanes];
  uint32_t close = 0;
  for (int h = 0; h < kLanes; h += kDoubles) {
    const BeamSource& s = beam.source;
    Doubles p[3][3];
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a)
        p[j][a] =
            one ? splat(double(leaf.at(j, order.axes[a])[place])) : widen(corner[3 * j + a] + h);
    const Doubles along = load(s.d[2] + k + h), inverse = 1 / along;
    Exact<Doubles> e;
    e.see(p, {splat(*s.o[0]), splat(*s.o[1]), splat(*s.o[2])},
          {load(s.d[0] + k + h) * inverse, load(s.d[1] + k + h) * inverse});
    e.weigh();
    const Longs hit = widen(beam.pending + k + h) != Longs{};
    store(answers.t + k + h, select(hit, e.depth / along, splat(kInf)));
    narrow(u + h, e.u);
    narrow(v + h, e.v);
    const Doubles margin = splat(beam.close);
    close |= bits(at_most(magnitude(e.off_x), margin) & at_most(magnitude(e.off_y), margin)) << h;
  }
  store(answers.instance + k, select(none, Ints{} - 1, instance));
  store(answers.primitive + k, select(none, Ints{}, primitive));
  store(answers.u + k, select(none, Floats{}, load(u)));
  store(answers.v + k, select(none, Floats{}, load(v)));
  for (uint32_t edges = hits & ~close; edges; edges &= edges - 1)
    finish_at_edge(beam, tree, answers, k + __builtin_ctz(edges));
}

/// The closest hits of `Count` rays, into `answers`; Any: what blocks them. False, and nothing is
/// there, when they are no beam, see too much or may pass something.
template <bool Any, int Count>
__attribute__((noinline)) bool trace_beam(const TreeView& tree, const Rays& rays, size_t first,
                                          Answers& answers) {
  Beam<Count> beam;
  if (!(Any ? set_to_apex(beam, tree, rays, first) : set_from_apex(beam, tree, rays, first)) ||
      !set_places(beam))
    return false;
  BeamWalk<Any, Count> walk{tree, beam, answers};
  walk.set_end();
  if (!walk.walk()) return false;
  if constexpr (Any) {
    const uint8_t stop = answers.stop();
    for (int k = 0; k < Count; ++k) answers.blocked[k] = beam.farthest[k] > kFar ? stop : 0;
  } else
    for (int k = 0; k < Count; k += kLanes) finish_beam(beam, tree, answers, k);
  return true;
}

}  // namespace
}  // namespace glint
