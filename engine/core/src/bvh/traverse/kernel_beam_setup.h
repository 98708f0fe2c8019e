// Rays as a beam: whether they begin or end at one point, their places, and slices of them.
#pragma once
#include "bvh/traverse/kernel_beam_triangles.h"

namespace glint {
namespace {

/// What is known of a beam's rays: |along|, t_max, t_min.
struct BeamSpan {
  double shortest, longest, earliest, latest;
};

/// Where the rays from `first` on are, in the order of the first one.
inline void set_source(Beam& beam, const Rays& rays, size_t first) {
  const Order& order =
      kOrders[axis_class_of({rays.d[0][first], rays.d[1][first], rays.d[2][first]})];
  BeamSource& s = beam.source;
  beam.order = s.order = &order;
  s.t_min = rays.t_min + first;
  s.t_max = rays.t_max + first;
  s.more = !rays.ends && rays.count - first >= 2 * kBeam;
  for (int a = 0; a < 3; ++a) {
    s.xyz_d[a] = rays.d[a] + first;
    s.xyz_o[a] = rays.o[a] + first;
    s.d[a] = rays.d[order.axes[a]] + first;
    s.o[a] = rays.o[order.axes[a]] + first;
  }
}

/// Whether all rays are alive; between which ray parameters they are.
inline bool set_ends(const Beam& beam, const Rays& rays, BeamSpan& span) {
  if (rays.ends) {
    span.earliest = rays.ends->earliest;
    span.latest = rays.ends->latest;
    return true;
  }
  const BeamSource& s = beam.source;
  const Doubles zero{};
  Doubles earliest = splat(kInf), latest{};
  DoubleMask good = less(zero, earliest);
  for (int k = 0; k < kBeam; k += kLanes) {
    const Doubles t_min = load(s.t_min + k), t_max = load(s.t_max + k);
    good = good & at_most(zero, t_min) & less(t_min, t_max);
    earliest = smaller(t_max, earliest);
    latest = larger(t_min, latest);
  }
  span.earliest = least_of(earliest);
  span.latest = most_of(latest);
  return bits(good) == (1u << kLanes) - 1;
}

/// The rays' places. False where they are not of one axis class or nearly so, or where their slices
/// do not share the places out.
inline bool set_places(Beam& beam, BeamSpan& span) {
  BeamSource& s = beam.source;
  const double sign = double(beam.order->sign);
  const Broad forward = spread(s.order->sign), sense = forward * spread(beam.order->sign);
  Broad shortest = spread(kFar), longest{};
  BroadMask good = at_most(longest, shortest), straight = good;
  for (int a = 0; a < 2; ++a)
    beam.middle[a] =
        float(0.5 * sign * (s.d[a][0] / s.d[2][0] + s.d[a][kBeam - 1] / s.d[2][kBeam - 1]));
  auto& side = beam.side;
  for (int g = 0; g < kSlices; ++g) {
    const int k = g * kBroad;
    const Broad ahead = narrow_broad(s.d[2] + k) * forward, inverse = sense / ahead;
    shortest = smaller(ahead, shortest);
    longest = larger(ahead, longest);
    Broad place[2];
    for (int a = 0; a < 2; ++a) {
      const Broad slope = narrow_broad(s.d[a] + k) * inverse, steep = magnitude(slope);
      place[a] = slope - spread(beam.middle[a]);
      good = good & at_most(steep, spread(2 - 0x1p-20f));
      straight = straight & at_most(steep, spread(1 - 0x1p-20f));
      store_broad(beam.place[a] + k, place[a]);
    }
    smallest_of_two(place[0], place[1], side[0][0][g], side[1][0][g]);
    largest_of_two(place[0], place[1], side[0][1][g], side[1][1][g]);
  }
  constexpr uint32_t kAll = uint32_t((uint64_t(1) << kBroad) - 1);
  span.shortest = double(smallest(shortest));
  span.longest = double(largest(longest));
  if (bits(good) != kAll || !(span.shortest > 0x1p-60 && span.longest < 0x1p60)) return false;
  s.mixed = bits(straight) != kAll;
  beam.slope = 0;
  for (int a = 0; a < 2; ++a) {
    Broad low = load_broad(side[a][0]), high = load_broad(side[a][1]);
    for (int g = kBroad; g < kSlices; g += kBroad) {
      low = smaller(load_broad(side[a][0] + g), low);
      high = larger(load_broad(side[a][1] + g), high);
    }
    beam.width[a] = larger(-smallest(low), largest(high));
    beam.slope = larger(beam.slope, magnitude(beam.middle[a]) + beam.width[a]);
  }
  float area = 0;
  const float room[2] = {beam.width[0] / 8, beam.width[1] / 8};
  for (int g = 0; g < kSlices; ++g)
    area += (side[0][1][g] - side[0][0][g] + room[0]) * (side[1][1][g] - side[1][0][g] + room[1]);
  area /= 4;
  const float whole = beam.width[0] * beam.width[1];
  return 4 * area >= whole && area <= 4 * whole;
}

/// Bounds of 1 / depth where rays end, whose depths are in `farthest` unless they have no end; and
/// those of slices.
inline void set_farthest(Beam& beam, bool endless) {
  for (int g = 0; g < kSlices; ++g) {
    float *farthest = beam.farthest + g * kBroad, *nearest = beam.nearest + g * kBroad;
    const Broad end = endless ? Broad{} : 1 / load_broad(farthest),
                low = end * spread(1 - 0x1p-21f);
    store_broad(farthest, low);
    store_broad(nearest, end * spread(1 + 0x1p-21f));
    store_broad(reinterpret_cast<float*>(beam.pending + g * kBroad), Broad{});
    beam.end[g] = endless ? 0 : smallest(low);
  }
}

/// Whether all rays begin no more than four radii from the tree's ball: there the rays of all
/// tests begin at their origins. `square`: of the largest distance from its centre.
inline bool set_room(Beam& beam, const TreeView& tree, double square) {
  const double size = reach_of(tree), center = size - 4 * tree.radius;
  if (!(square < 16 * tree.radius * tree.radius * (1 - 0x1p-40)) || !(size < 0x1p30)) return false;
  beam.room = float(2 * kBoxMargin * (center + __builtin_sqrt(square)));
  beam.close = 0x1p-21 * center;
  return true;
}

/// Rays that begin at one point.
inline bool set_from_apex(Beam& beam, const TreeView& tree, const Rays& rays, size_t first) {
  double square = 0;
  for (int a = 0; a < 3; ++a) {
    const double o = rays.o[a][first], f = tree.center[a] - o;
    if (!(o == rays.o[a][first + kBeam - 1])) return false;
    square += f * f;
  }
  if (!set_room(beam, tree, square)) return false;
  set_source(beam, rays, first);
  const BeamSource& s = beam.source;
  Longs other{};
  for (int k = 0; !rays.ends && k < kBeam; k += kLanes)
    for (const double* p : s.o) other |= Longs(load(p + k)) ^ Longs(splat(*p));
  if (any(Longs(other != Longs{}))) return false;
  BeamSpan span;
  if (!set_ends(beam, rays, span) || !set_places(beam, span)) return false;
  beam.apex = origin_at({*s.o[0], *s.o[1], *s.o[2]}, *beam.order);
  beam.off = beam.past = 0;
  beam.begin = float((1 - 0x1p-19) / (span.latest * span.longest));
  const bool endless = span.earliest * span.shortest >= 8 * tree.radius;
  for (int k = 0; !endless && k < kBeam; k += kLanes)
    narrow(beam.farthest + k, magnitude(load(s.t_max + k) * load(s.d[2] + k)));
  set_farthest(beam, endless);
  return true;
}

/// Where a beam's first and last ray end if that is one point but for rounding, or else where their
/// lines are nearest to each other, in the rays' order. (Of lines alone rounding tells badly how
/// far away that is.)
inline bool set_meeting(const Beam& beam, double (&apex)[3]) {
  const BeamSource& s = beam.source;
  constexpr int kFinal = kBeam - 1;
  double first[2], across = 0, square = 0, apart = 0;
  for (int a = 0; a < 3; ++a) {
    const double end = *s.o[a] + *s.t_max * *s.d[a],
                 other = s.o[a][kFinal] + s.t_max[kFinal] * s.d[a][kFinal];
    apex[a] = end;
    apart = larger(magnitude(end - other), apart);
  }
  if (apart < 0x1p-22 * *s.t_max * magnitude(*s.d[2])) return true;
  for (int a = 0; a < 2; ++a) {
    first[a] = s.d[a][0] / s.d[2][0];
    const double turn = s.d[a][kFinal] / s.d[2][kFinal] - first[a];
    across += turn * (s.o[a][kFinal] - *s.o[a] - first[a] * (s.o[2][kFinal] - *s.o[2]));
    square += turn * turn;
  }
  apex[2] = s.o[2][kFinal] - across / square;
  for (int a = 0; a < 2; ++a) apex[a] = *s.o[a] + first[a] * (apex[2] - *s.o[2]);
  return square > 0;
}

/// Rays that end at one point, a little before it, or behind it by rounding. `farthest` and
/// `nearest` are those of where they begin: what lies behind that, as seen from the apex, is no
/// hit.
inline bool set_to_apex(Beam& beam, const TreeView& tree, const Rays& rays, size_t first) {
  const auto end_of = [&](int a, size_t k) { return rays.o[a][k] + rays.t_max[k] * rays.d[a][k]; };
  for (int a = 0; a < 3; ++a)  // where they do not, this tells mostly
    if (!(magnitude(end_of(a, first) - end_of(a, first + kBeam - 1)) < 0x1p-16 * tree.radius))
      return false;
  BeamSpan span;
  double apex[3];
  set_source(beam, rays, first);
  const BeamSource& s = beam.source;
  const Order& order = kOrders[uint32_t(s.order - kOrders) ^ 4];
  beam.order = &order;
  if (!set_places(beam, span) || !set_meeting(beam, apex)) return false;
  const double turn = double(order.sign);
  const Doubles sign = splat(turn), zero{};
  Doubles off{}, apart{}, square{}, nearest = splat(kInf), farthest{}, end{}, past = splat(kInf);
  DoubleMask good = less(zero, nearest);
  for (int k = 0; k < kBeam; k += kLanes) {
    const Doubles t_min = load(s.t_min + k), t_max = load(s.t_max + k);
    Doubles o[3], missed[3], distance{};  // missed: from the apex to where the ray ends
    for (int a = 0; a < 3; ++a) {
      o[a] = load(s.o[a] + k);
      missed[a] = o[a] + t_max * load(s.d[a] + k) - splat(apex[a]);
      const Doubles f = splat(tree.center[order.axes[a]]) - o[a];
      distance += f * f;
    }
    for (int a = 0; a < 2; ++a) {
      const Doubles slope = sign * (widen(beam.place[a] + k) + splat(double(beam.middle[a])));
      off = larger(magnitude(missed[a] - slope * missed[2]), off);
    }
    const Doubles length = magnitude(load(s.d[2] + k)), from = flip(o[2] - splat(apex[2]), sign),
                  start = from - t_min * length, rest = flip(missed[2], sign);
    good = good & at_most(zero, t_min) & less(t_min, t_max) & less(zero, start);
    apart = larger(magnitude(rest), apart);
    square = larger(distance, square);
    nearest = smaller(start, nearest);
    farthest = larger(from, farthest);
    end = larger(rest, end);
    past = smaller(rest, past);
    narrow(beam.farthest + k, start);
  }
  if (bits(good) != (1u << kLanes) - 1) return false;
  const double size = reach_of(tree), tiny = 0x1p-40 * size, reach = most_of(farthest),
               miss = most_of(off) + tiny + 0x1p-20 * most_of(apart),
               behind = tiny - smaller(least_of(past), 0.0);
  if (!set_room(beam, tree, most_of(square)) || !(reach < 16 * size) || !(miss < 0x1p-20 * reach) ||
      !(least_of(nearest) > 0x1p-16 * size) || !(behind < 0x1p-18 * reach))
    return false;
  set_farthest(beam, false);
  beam.off = float(miss);
  beam.past = float(behind);
  beam.room += 2 * beam.off + 8 * beam.past;
  beam.begin = float((1 - 0x1p-19) / (most_of(end) + tiny));
  beam.apex = origin_at(apex, order);
  return true;
}

}  // namespace
}  // namespace glint
