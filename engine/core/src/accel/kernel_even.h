// The common case of a tile, quickly: all its rays are of one kind, with origins within four radii of the tree's ball. The rays'
// numbers are those of set_tile; what all rays share is computed once, and all groups' bundles side by side.
#pragma once
#include "kernel_frustum.h"

namespace glint {
namespace {

/// What is known of an even tile's directions and ends.
struct Span {
  Doubles shortest = splat(kInf), longest{}, earliest = splat(kInf), latest{};  // |along|, t_max, t_min
};

/// The kind of rays in direction d, as Tile::kind has it. Of axes of one length the first is the longest.
inline uint32_t kind_of(const double (&d)[3]) {
  const double x = magnitude(d[0]), y = magnitude(d[1]), z = magnitude(d[2]);
  const uint32_t axis = z > x && z > y ? 2 : y > x ? 1 : 0;
  return axis | (d[axis] < 0 ? 4 : 0);
}

/// Directions of the rays [k, k + kDoubles), columns in the rays' order, the longest along `axis`. False when they are not even.
inline bool set_even_directions(Tile& tile, int k, const double* const (&d)[3], int axis, Doubles sign, Span& span) {
  const Doubles d0 = load(d[0] + k), d1 = load(d[1] + k), along = load(d[2] + k), ahead = flip(along, sign);
  const Doubles inverse = 1 / along, s0 = d0 * inverse, s1 = d1 * inverse;
  const Doubles t_min = load(tile.t_min + k), t_max = load(tile.t_max + k), zero{};
  store(tile.shear[0] + k, s0), store(tile.shear[1] + k, s1), store(tile.along + k, along);
  narrow(tile.slope[0] + k, flip(s0, sign)), narrow(tile.slope[1] + k, flip(s1, sign));
  span.shortest = smaller(ahead, span.shortest), span.longest = larger(ahead, span.longest);
  span.earliest = smaller(t_max, span.earliest), span.latest = larger(t_min, span.latest);
  const Doubles across[2] = {magnitude(d0), magnitude(d1)};
  const DoubleMask first = axis < 2 ? at_most(across[0], ahead) : less(across[0], ahead);  // as set_rays decides
  const DoubleMask second = axis < 1 ? at_most(across[1], ahead) : less(across[1], ahead);
  const DoubleMask good = first & second & less(t_min, t_max) & at_most(zero, t_min);
  return bits(good) == (1u << kDoubles) - 1;
}

/// Origins of the rays [k, k + kDoubles), columns in the rays' order; center likewise. Returns the squares of their distances from it.
inline Doubles set_even_origins(Tile& tile, int k, const double* const (&o)[3], const double (&center)[3], Doubles sign) {
  Doubles square{};
  for (int a = 0; a < 3; ++a) {
    const Doubles p = load(o[a] + k), f = splat(center[a]) - p, q = a == 2 ? flip(p, sign) : p;
    float* coarse = a == 2 ? tile.start : tile.of[a];
    store(tile.o[a] + k, p);
    narrow(coarse + k, q);
    narrow(tile.rest[a] + k, q - widen(coarse + k));
    square += f * f;
  }
  return square;
}

/// The same for all rays at once, which begin at one point.
inline Doubles set_common_origin(Tile& tile, const double* const (&o)[3], const double (&center)[3], double sign) {
  double square = 0;
  for (int a = 0; a < 3; ++a) {
    const double p = *o[a], f = center[a] - p, q = a == 2 ? flip(p, sign) : p;
    const float coarse = float(q), rest = float(q - double(coarse));
    for (int k = 0; k < kTile; k += kDoubles) store(tile.o[a] + k, splat(p));
    for (int k = 0; k < kTile; k += kLanes)
      store((a == 2 ? tile.start : tile.of[a]) + k, splat(coarse)), store(tile.rest[a] + k, splat(rest));
    square += f * f;
  }
  return splat(square);
}

/// Whether all rays begin at the first one's origin.
inline bool at_one_point(const Tile& tile) {
  for (int k = 0; k < kTile; k += kDoubles) {
    Longs other{};
    for (const double* o : tile.xyz_o) other |= Longs(load(o + k)) ^ Longs(splat(*o));
    if (any(Longs(other != Longs{}))) return false;
  }
  return true;
}

/// Where the rays [k, k + kDoubles) end, as depths.
inline void set_even_ends(Tile& tile, int k) {
  const Doubles depth = smaller(magnitude(load(tile.t_max + k) * load(tile.along + k)), splat(double(kFar))), room = depth * 0x1p-22;
  narrow(tile.lo + k, depth - room), narrow(tile.hi + k, smaller(depth + room, splat(double(kFar))));
}

/// Where the rays [k, k + kDoubles) begin.
inline void set_even_begins(Tile& tile, int k) {
  const Doubles depth = smaller(magnitude(load(tile.t_min + k) * load(tile.along + k)), splat(double(kFar))), room = depth * 0x1p-22;
  narrow(tile.begin_lo + k, depth - room), narrow(tile.begin_hi + k, smaller(depth + room, splat(double(kFar))));
}

/// What is the same for all rays of an even tile but their origins.
inline void set_even_depths(Tile& tile, uint32_t kind, const Span& span) {
  double end = kInf, shortest = kInf;
  for (int j = 0; j < kDoubles; ++j)
    end = span.earliest[j] < end ? span.earliest[j] : end, shortest = span.shortest[j] < shortest ? span.shortest[j] : shortest;
  const bool endless = end * shortest >= 8 * tile.tree->radius;  // rays that end behind everything need not know where
  const bool at_once = !any(Longs(span.latest != Doubles{}));  // all rays begin at their origins
  for (int k = 0; k < kTile; k += kLanes) {
    if (at_once) store(tile.begin_lo + k, Floats{}), store(tile.begin_hi + k, Floats{});
    else for (int h = 0; h < kLanes; h += kDoubles) set_even_begins(tile, k + h);
    store(tile.kind + k, Ints{} + int32_t(kind)), store(tile.pending + k, Ints{});
    if (endless) store(tile.lo + k, splat(kFar)), store(tile.hi + k, splat(kFar));
    else for (int h = 0; h < kLanes; h += kDoubles) set_even_ends(tile, k + h);
  }
  for (int k = 0; k < kTile; k += kDoubles) store(tile.skipped + k, Doubles{});
}

/// set_tile for a tile that is even. False when it is not: then set_tile has to do it.
inline bool set_even_tile(Tile& tile) {
  if (tile.count != kTile || !(reach_of(*tile.tree) < 1e30)) return false;
  const uint32_t kind = kind_of({*tile.xyz_d[0], *tile.xyz_d[1], *tile.xyz_d[2]});
  const Order& order = kOrders[kind];
  const double *d[3], *o[3];
  double center[3];
  for (int a = 0; a < 3; ++a)
    d[a] = tile.xyz_d[order.axes[a]], o[a] = tile.xyz_o[order.axes[a]], center[a] = tile.tree->center[order.axes[a]];
  const Doubles sign = splat(double(order.sign));
  Span span;
  for (int k = 0; k < kTile; k += kDoubles)
    if (!set_even_directions(tile, k, d, order.axes[2], sign, span)) return false;
  Doubles square{};
  tile.common = at_one_point(tile);
  if (tile.common) square = set_common_origin(tile, o, center, double(order.sign));
  else for (int k = 0; k < kTile; k += kDoubles) square = larger(set_even_origins(tile, k, o, center, sign), square);
  const Longs good = (square < splat(16 * tile.tree->radius * tile.tree->radius)) & (span.shortest > splat(0x1p-900)) &
                     (span.longest < splat(0x1p900));
  if (any(~good)) return false;
  set_even_depths(tile, kind, span);
  set_room(tile, square, 0);
  return true;
}

/// How deep an even tile's rays and groups go.
inline void set_even_reach(const Tile& tile, Bundles& b) {
  const DepthRange range(tile, order_of(tile, 0));
  for (int k = 0; k < kTile; k += kLanes) set_ray_depths(tile, b, k, range);
  for (int g = 0; g < kGroups; g += kLanes) {
    store(b.groups.first + g, fold_rows<Smaller>(b.rays.first + g * kLanes));
    store(b.groups.last + g, fold_rows<Larger>(b.rays.last + g * kLanes));
  }
}

/// Bundles of all groups of an even tile whose rays begin at one point: before they exist, hence the lines through it bound them.
inline void set_common_groups(const Tile& tile, Bundles& b) {
  for (int g = 0; g < kGroups; g += kLanes)
    for (int a = 0; a < 2; ++a) {
      const float* slopes = tile.slope[a] + g * kLanes;
      const Floats low = fold_rows<Smaller>(slopes), high = fold_rows<Larger>(slopes);
      const Floats o = splat(tile.of[a][0]), start = splat(tile.start[0]), room = splat(tile.room);
      store(b.groups.m[2 * a] + g, low), store(b.groups.c[2 * a] + g, o - low * start - room);
      store(b.groups.m[2 * a + 1] + g, high), store(b.groups.c[2 * a + 1] + g, o - high * start + room);
    }
}

/// The same when they do not: lines through where the rays are at the group's first and last depth.
inline void set_parted_groups(const Tile& tile, Bundles& b) {
  alignas(64) float near[kTile], far[kTile];
  for (int a = 0; a < 2; ++a) {
    for (int g = 0; g < kGroups; ++g) {
      const int k = g * kLanes;
      const Floats m = load(tile.slope[a] + k), c = load(tile.of[a] + k) - m * load(tile.start + k);
      store(near + k, c + m * splat(b.groups.first[g])), store(far + k, c + m * splat(b.groups.last[g]));
    }
    for (int g = 0; g < kGroups; g += kLanes) {
      const float *p = near + g * kLanes, *q = far + g * kLanes;
      float *c = b.groups.c[2 * a] + g, *high_c = b.groups.c[2 * a + 1] + g;
      float *m = b.groups.m[2 * a] + g, *high_m = b.groups.m[2 * a + 1] + g;
      const Floats first = load(b.groups.first + g), last = load(b.groups.last + g), room = splat(2 * tile.room);
      lines_through(fold_rows<Smaller>(p), fold_rows<Smaller>(q), first, last, -room, c, m);
      lines_through(fold_rows<Larger>(p), fold_rows<Larger>(q), first, last, room, high_c, high_m);
    }
  }
}

inline void set_even_bundles(const Tile& tile, Bundles& b) {
  set_even_reach(tile, b);
  tile.common ? set_common_groups(tile, b) : set_parted_groups(tile, b);
}

}  // namespace
}  // namespace glint
