// The common case of a tile, quickly: all its rays are of one axis class, with origins within four
// radii of the tree's ball, or all outside. The rays' numbers are those of set_tile; what all rays
// share is computed once.
#pragma once
#include "bvh/traverse/kernel_frustum.h"

namespace glint {
namespace {

/// What is known of a coherent tile's directions and ends, and of the squares of its origins'
/// distances from the tree's centre.
struct Span {
  Doubles shortest = splat(kInf), longest{}, earliest = splat(kInf),
          latest{};  // |along|, t_max, t_min
  Doubles nearest = splat(kInf), farthest{};
  uint64_t alive = 0;

  void add(Doubles square) {
    nearest = smaller(square, nearest);
    farthest = larger(square, farthest);
  }
};

/// Tile::axis_class of rays in direction d. Of axes of one length the first is
/// the longest.
inline uint32_t axis_class_of(const double (&d)[3]) {
  const double x = magnitude(d[0]), y = magnitude(d[1]), z = magnitude(d[2]);
  const uint32_t axis = z > x && z > y ? 2 : y > x ? 1 : 0;
  return axis | (d[axis] < 0 ? 4 : 0);
}

/// Directions of the rays [k, k + kLanes), columns in the rays' order, the longest along `axis`.
/// False when they are not coherent. Those that end before they begin are not alive.
inline bool set_coherent_directions(Tile& tile, int k, const double* const (&d)[3], int axis,
                                    Doubles sign, Span& span) {
  const Doubles d0 = load(d[0] + k), d1 = load(d[1] + k), along = load(d[2] + k),
                ahead = flip(along, sign);
  const Doubles inverse = 1 / along, s0 = d0 * inverse, s1 = d1 * inverse;
  const Doubles t_min = load(tile.t_min + k), t_max = load(tile.t_max + k), zero{};
  store(tile.shear[0] + k, s0);
  store(tile.shear[1] + k, s1);
  store(tile.along + k, along);
  narrow(tile.slope[0] + k, flip(s0, sign));
  narrow(tile.slope[1] + k, flip(s1, sign));
  span.shortest = smaller(ahead, span.shortest);
  span.longest = larger(ahead, span.longest);
  const DoubleMask alive = less(t_min, t_max);
  span.alive |= uint64_t(bits(alive)) << k;
  span.earliest = smaller(choose(alive, t_max, splat(kInf)), span.earliest);
  span.latest = larger(t_min, span.latest);
  const Doubles across[2] = {magnitude(d0), magnitude(d1)};
  const DoubleMask first =
      axis < 2 ? at_most(across[0], ahead) : less(across[0], ahead);  // as set_rays decides
  const DoubleMask second = axis < 1 ? at_most(across[1], ahead) : less(across[1], ahead);
  const DoubleMask good = first & second & at_most(zero, t_min);
  return bits(good) == (1u << kLanes) - 1;
}

/// Origins of the rays [k, k + kLanes), columns in the rays' order; center likewise. Returns the
/// squares of their distances from it.
inline Doubles set_near_origins(Tile& tile, int k, const double* const (&o)[3],
                                const double (&center)[3], Doubles sign) {
  Doubles square{};
  for (int a = 0; a < 3; ++a) {
    const Doubles p = load(o[a] + k), f = splat(center[a]) - p, q = a == 2 ? flip(p, sign) : p;
    float* coarse = a == 2 ? tile.start : tile.of[a];
    store(tile.o[a] + k, p);
    narrow(coarse + k, q);
    narrow(tile.low_part[a] + k, q - widen(coarse + k));
    square += f * f;
  }
  return square;
}

/// The same for all rays at once, which begin at one point.
inline Doubles set_common_origin(Tile& tile, const double* const (&o)[3], const double (&center)[3],
                                 double sign) {
  double square = 0;
  for (int a = 0; a < 3; ++a) {
    const double p = *o[a], f = center[a] - p, q = a == 2 ? flip(p, sign) : p;
    const float coarse = float(q), rest = float(q - double(coarse));
    for (int k = 0; k < kTile; k += kLanes) store(tile.o[a] + k, splat(p));
    for (int k = 0; k < kTile; k += kFloats) {
      store((a == 2 ? tile.start : tile.of[a]) + k, splat(coarse));
      store(tile.low_part[a] + k, splat(rest));
    }
    square += f * f;
  }
  return splat(square);
}

/// The rays [k, k + kLanes) from where they cross a plane across the depth axis.
inline void set_far_origins(Tile& tile, int k, const double* const (&o)[3], float plane,
                            double sign) {
  const Doubles skipped = splat(double(plane)) - load(o[2] + k);
  for (int a = 0; a < 3; ++a) store(tile.o[a] + k, load(o[a] + k));
  for (int a = 0; a < 2; ++a) {
    const Doubles p = load(o[a] + k) + load(tile.shear[a] + k) * skipped;
    narrow(tile.of[a] + k, p);
    narrow(tile.low_part[a] + k, p - widen(tile.of[a] + k));
  }
  narrow(tile.start + k, splat(flip(double(plane), sign)));
  narrow(tile.low_part[2] + k, Doubles{});
  store(tile.skipped + k, skipped);
}

/// Whether all rays begin at the first one's origin.
inline bool at_one_point(const Tile& tile) {
  for (int k = 0; k < kTile; k += kLanes) {
    Longs other{};
    for (const double* o : tile.xyz_o) other |= Longs(load(o + k)) ^ Longs(splat(*o));
    if (any(Longs(other != Longs{}))) return false;
  }
  return true;
}

/// Where the rays [k, k + kLanes) end, as depths; nearer than `skipped`, where that is not 0.
inline void set_coherent_ends(Tile& tile, int k) {
  const Doubles depth = smaller(magnitude(load(tile.t_max + k) * load(tile.along + k)),
                                splat(double(kFar))),
                margin = depth * kDepthMargin;
  narrow(tile.lo + k, depth - margin);
  narrow(tile.hi + k, smaller(depth + margin, splat(double(kFar))));
}

/// Where the rays [k, k + kLanes) begin.
inline void set_coherent_begins(Tile& tile, int k) {
  const Doubles depth = smaller(magnitude(load(tile.t_min + k) * load(tile.along + k)),
                                splat(double(kFar))),
                margin = depth * kDepthMargin;
  narrow(tile.begin_lo + k, depth - margin);
  narrow(tile.begin_hi + k, smaller(depth + margin, splat(double(kFar))));
}

/// Depths of a coherent tile's rays that begin where their float rays do.
inline void set_near_depths(Tile& tile, const Span& span) {
  const bool endless = least_of(span.earliest) * least_of(span.shortest) >=
                       8 * tile.tree->radius;                  // behind everything: no need to know
  const bool at_once = !any(Longs(span.latest != Doubles{}));  // all rays begin at their origins
  for (int k = 0; k < kTile; k += kFloats) {
    if (at_once) {
      store(tile.begin_lo + k, Floats{});
      store(tile.begin_hi + k, Floats{});
    } else
      for (int h = 0; h < kFloats; h += kLanes) set_coherent_begins(tile, k + h);
    if (endless) {
      store(tile.lo + k, splat(kFar));
      store(tile.hi + k, splat(kFar));
    } else
      for (int h = 0; h < kFloats; h += kLanes) set_coherent_ends(tile, k + h);
  }
  for (int k = 0; k < kTile; k += kLanes) store(tile.skipped + k, Doubles{});
}

/// The same of rays from far away.
inline void set_far_depths(Tile& tile, double sign) {
  for (int k = 0; k < kTile; k += kLanes) {
    const Doubles along = load(tile.along + k), skipped = load(tile.skipped + k),
                  signs = splat(sign);
    depth_interval(load(tile.t_min + k), along, skipped, signs, tile.begin_lo + k,
                   tile.begin_hi + k);
    depth_interval(load(tile.t_max + k), along, skipped, signs, tile.lo + k, tile.hi + k);
  }
}

/// Rays that are not alive.
inline void leave_out_dead(Tile& tile, uint64_t alive) {
  for (uint64_t dead = ~alive; dead; dead &= dead - 1) {
    const int r = __builtin_ctzll(dead);
    tile.lo[r] = tile.hi[r] = -kFar;
    tile.begin_lo[r] = tile.begin_hi[r] = kFar;
  }
}

/// Origins of a coherent tile, columns in the rays' order; center likewise. False when some are
/// near and some far away.
inline bool set_coherent_origins(Tile& tile, const double* const (&o)[3], const double (&center)[3],
                                 double sign, Span& span) {
  const double radius = tile.tree->radius, limit = 16 * radius * radius;
  tile.common = at_one_point(tile);
  if (tile.common) span.add(set_common_origin(tile, o, center, sign));
  else
    for (int k = 0; k < kTile; k += kLanes)
      span.add(set_near_origins(tile, k, o, center, splat(sign)));
  constexpr double kClose = 0x1p-40;  // set_rays adds up squares in another order
  if (!any(~(span.farthest < splat(limit * (1 - kClose))))) {
    set_near_depths(tile, span);
    set_margin(tile, span.farthest, 0);
    return true;
  }
  if (any(~((span.nearest > splat(limit * (1 + kClose))) & (span.farthest < splat(kWide * kWide)))))
    return false;
  tile.common = false;
  const float plane = float(center[2] - flip(radius, sign));
  for (int k = 0; k < kTile; k += kLanes) set_far_origins(tile, k, o, plane, sign);
  set_far_depths(tile, sign);
  set_margin(tile, splat(9 * radius * radius),
             __builtin_sqrt(most_of(span.farthest)) * kFarRounding);
  return true;
}

/// set_tile for a coherent tile. False when it is not: then set_tile has to do it.
inline bool set_coherent_tile(Tile& tile) {
  if (tile.count < kLeastPacket || !(reach_of(*tile.tree) < kWide)) return false;
  const uint32_t kind = axis_class_of({*tile.xyz_d[0], *tile.xyz_d[1], *tile.xyz_d[2]});
  const Order& order = kOrders[kind];
  const double *d[3], *o[3], sign = double(order.sign);
  double center[3];
  for (int a = 0; a < 3; ++a) {
    d[a] = tile.xyz_d[order.axes[a]];
    o[a] = tile.xyz_o[order.axes[a]];
    center[a] = tile.tree->center[order.axes[a]];
  }
  Span span;
  for (int k = 0; k < kTile; k += kLanes)
    if (!set_coherent_directions(tile, k, d, order.axes[2], splat(sign), span)) return false;
  if (any(~((span.shortest > splat(0x1p-900)) & (span.longest < splat(0x1p900))))) return false;
  if (!set_coherent_origins(tile, o, center, sign, span)) return false;
  for (int k = 0; k < kTile; k += kFloats) {
    store(tile.axis_class + k, Ints{} + int32_t(kind));
    store(tile.pending + k, Ints{});
  }
  if (~span.alive) leave_out_dead(tile, span.alive);
  return true;
}

}  // namespace
}  // namespace glint
