// Triangles as a beam sees them from its apex: bounds of its rays' edge functions and depths.
#pragma once
#include "bvh/traverse/kernel_leaves.h"
#include "simd/broad.h"

namespace glint {
namespace {

constexpr int kBeam = kBroad == 4 ? 128 : 256;
constexpr int kOfLine = 64 / sizeof(double);  // numbers in a line of memory
constexpr int kSlices = kBeam / kBroad;       // groups of rays as wide as a register
/// Leaves that a beam may come to before it is parted; of more, each has to hit so many rays.
constexpr int leaves_allowed(bool any) { return any ? 32 : 16; }
constexpr int kRaysOfLeaf = 2;

/// What a beam's rays are in double, by axis, and in the order of most of them (Order::axes).
struct BeamSource {
  const double *xyz_o[3], *xyz_d[3], *o[3], *d[3], *t_min, *t_max;
  const Order* order;
  bool mixed;  // not all are of its axis class
  bool more;   // rays follow that may be far away in memory

  /// Which of the rays [k, k + kLanes) are.
  DoubleMask of_order(int k) const {
    const Doubles ahead = flip(load(d[2] + k), splat(double(order->sign))),
                  x = magnitude(load(d[0] + k)), y = magnitude(load(d[1] + k));
    return (order->axes[2] < 2 ? at_most(x, ahead) : less(x, ahead)) &
           (order->axes[2] < 1 ? at_most(y, ahead) : less(y, ahead));
  }
  /// The same of `count` rays.
  uint32_t own(int k, int count) const {
    if (!mixed) return ~0u;
    uint32_t mask = 0;
    for (int h = 0; h < count; h += kLanes) mask |= bits(of_order(k + h)) << h;
    return mask;
  }
};

/// One of them, in its own order.
struct BeamRay {
  const Order& order;
  double o[3], along, shear[2];
  BeamRay(const BeamSource& s, int r)
      : order(kOrders[axis_class_of({s.xyz_d[0][r], s.xyz_d[1][r], s.xyz_d[2][r]})]) {
    for (int a = 0; a < 3; ++a) o[a] = s.xyz_o[order.axes[a]][r];
    along = s.xyz_d[order.axes[2]][r];
    const double inverse = 1 / along;
    for (int a = 0; a < 2; ++a) shear[a] = s.xyz_d[order.axes[a]][r] * inverse;
  }
  Exact<double> see(const Triangles& leaf, int place) const {
    return seen(leaf, place, order, o, shear);
  }
};

constexpr uint32_t kDecided = 1u << 31;  // in Beam::leaf_at: the rule in double has found the hit

/// A beam's rays. Depths are counted from the apex, in the rays' sense, as 1 / depth: linear in the
/// place along a plane, and 0 where nothing was hit yet.
struct Beam {
  alignas(64) float place[2][kBeam];
  alignas(64) float farthest[kBeam], nearest[kBeam];    // bounds of 1 / depth of a ray's best hit
  alignas(64) uint32_t pending[kBeam], leaf_at[kBeam];  // its leaf, kNothing: none; place in it
  alignas(64) float side[2][2][kSlices];                // of slices: least and most place
  alignas(64) float end[kSlices];                       // and the least `farthest`
  BeamSource source;
  const Order* order;  // the rays', or turned round where they end at the apex
  Origin apex;
  float middle[2], width[2];  // slopes of the ray with place 0; no place is more
  float slope;                // no slope is more
  float off;                  // what rays miss the apex by
  float past;                 // how far behind the apex rays end, in depth
  float room;                 // of boxes
  float begin;                // surely in front of hits beyond all t_min: 1 / depth
  float last_end;             // the least `end`
  float last_depth;           // coordinate beyond which no box is of use
  double close;               // as Tile::close
};

/// The triangles [first, first + kFloats) of a leaf, seen from a beam's apex. Edge functions k + x
/// place + y place', positive inside; 1 / depth = plane + plane_x place + plane_y place', off by
/// less than plane_off.
///
/// Bounds. With s the largest slope, z no less than any corner is along and m than any is across as
/// one of the beam's rays sees it, corners are off by at most d = 10 u s z + 5 u m across: by u
/// (8 s z + 4 m) for the difference to the apex, the place and the shear. The edge functions are
/// those of the displaced corners: a ray that hits the triangle passes within d of theirs, where
/// they are -2 E d at least, E the longest edge; and one that is inside by 2 E d is as far as the
/// corners may move from every edge, and stays inside. What the products here round is less than 9
/// u m^2. Of another axis class rays see the same triangle across another axis.
///
/// Depths. A hit that is surely inside lies on the triangle, and moves with its displaced corners:
/// by d across and 2.03 u z along, as parts of the plane's distance det / |n|, whose products and
/// first sum round 2.01 u of each term. The normal's products are off by 8.01 u E3^2, which at a
/// point of the triangle, E3 or less from the corner that the plane goes through, is 24.03 u E3^3.
/// Other roundings are 6.02 u of the sum's terms, and 8 u are enough for those of the bound. What
/// rays meet behind the apex, where they go on a little, has no 1 / depth: such planes pass the
/// apex within `past` along the rays and `off` across.
///
/// Weights. Not edge-on, a triangle has an area of 2^-18.1 m^2 or more. The point that a ray's
/// weights in double give is off it by less than 42 U m^3 of the area, 2^-29.5 m; m is 35 of the
/// tree's radii at most, and Beam::close 2^-21 of one at least. So weigh() has answered each hit
/// that is surely inside.
struct BeamTriangles {
  Floats k[3], x[3], y[3], margin, plane, plane_x, plane_y, plane_off;
  uint32_t edge_on;  // no side or no depth is known
  uint32_t near;     // not surely beside or behind the beam
};

template <bool Any>
__attribute__((always_inline)) inline BeamTriangles see_triangles(const Beam& beam,
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
  Floats off = fused(splat(0x1.4p-21f * beam.slope), deepest, splat(0x1.4p-22f) * across);
  if (Any) off += splat(1.25f * beam.off);
  t.margin =
      fused(splat(2.0f) * longest, off, fused(splat(0x1p-20f) * across, across, splat(kUnderflow)));
  const Floats terms =
      fused(magnitude(t.plane_x), w0, fused(magnitude(t.plane_y), w1, magnitude(t.plane)));
  const Floats bent =
      fused(magnitude(nx) + magnitude(ny), fused(splat(0x1p-23f), across, off),
            fused(magnitude(nz), splat(0x1.1p-22f) * deepest,
                  splat(0x1.9p-20f) * longest_3 * longest_3 * longest_3 + splat(kUnderflow)));
  t.plane_off = terms * fused(bent, magnitude(inverse), splat(0x1p-21f));
  const Floats area = t.k[0] + t.k[1] + t.k[2];
  const Floats swing = fused(magnitude(nx), w0, magnitude(ny) * w1);
  t.edge_on = ~bits(less(fused(splat(4.0f), t.margin, swing), magnitude(area)));
  if (Any)
    t.edge_on |=
        ~bits(less(fused(terms, splat(beam.past), bent * magnitude(inverse)), splat(0.5f)));
  const Ints side = Ints(area) & INT32_MIN;
  FloatMask beside =
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

/// Where a slice's largest value is, seen from Beam::side's most: how far.
inline Ints side_of(Floats slope) { return (Ints(slope) >> 31) & -kSlices; }

/// The same in memory, to be had one by one.
struct BeamTable {
  alignas(64) float lines[14][kFloats];
  alignas(64) uint32_t sides[4][2][kFloats];  // of edges and depth, by axis: side_of
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
    for (int e = 0; e < 3; ++e) {
      store(sides[e][0], side_of(t.x[e]));
      store(sides[e][1], side_of(t.y[e]));
    }
    store(sides[3][0], side_of(t.plane_x));
    store(sides[3][1], side_of(t.plane_y));
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

}  // namespace
}  // namespace glint
