// Rays as a beam: whether they begin or end at one point, their places, and slices of them.
#pragma once
#include "bvh/traverse/kernel_beam_triangles.h"

namespace glint {
namespace {

/// What is known of a beam's rays: |along|, t_max, t_min.
struct BeamSpan {
  double shortest, longest, earliest, latest;
};

/// Whether the rays from `first` on are of one axis class or nearly so, and alive.
inline bool set_source(Beam& beam, const Rays& rays, size_t first, BeamSpan& span) {
  const Order& order =
      kOrders[axis_class_of({rays.d[0][first], rays.d[1][first], rays.d[2][first]})];
  BeamSource& s = beam.source;
  beam.order = s.order = &order;
  s.mixed = false;
  s.t_min = rays.t_min + first;
  s.t_max = rays.t_max + first;
  for (int a = 0; a < 3; ++a) {
    s.xyz_d[a] = rays.d[a] + first;
    s.xyz_o[a] = rays.o[a] + first;
    s.d[a] = rays.d[order.axes[a]] + first;
    s.o[a] = rays.o[order.axes[a]] + first;
  }
  const Doubles sign = splat(double(order.sign)), zero{};
  Doubles shortest = splat(kInf), longest{}, earliest = splat(kInf), latest{};
  for (int k = 0; k < kBeam; k += kLanes) {
    constexpr uint32_t kAll = (1u << kLanes) - 1;
    const Doubles ahead = flip(load(s.d[2] + k), sign), t_min = load(s.t_min + k),
                  t_max = load(s.t_max + k);
    if (bits(at_most(zero, t_min) & less(t_min, t_max)) != kAll) return false;
    if (bits(s.of_order(k)) != kAll) {
      const Doubles most = ahead + ahead;
      if (bits(at_most(magnitude(load(s.d[0] + k)), most) &
               at_most(magnitude(load(s.d[1] + k)), most)) != kAll)
        return false;
      s.mixed = true;
    }
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
  BeamSpan span;
  if (!set_room(beam, tree, square) || !set_source(beam, rays, first, span)) return false;
  const BeamSource& s = beam.source;
  for (int k = 0; k < kBeam; k += kLanes) {
    Longs other{};
    for (const double* p : s.o) other |= Longs(load(p + k)) ^ Longs(splat(*p));
    if (any(Longs(other != Longs{}))) return false;
  }
  beam.apex = origin_at({*s.o[0], *s.o[1], *s.o[2]}, *beam.order);
  beam.off = beam.past = 0;
  beam.begin = float((1 - 0x1p-19) / (span.latest * span.longest));
  const bool endless = span.earliest * span.shortest >= 8 * tree.radius;
  for (int k = 0; k < kBeam; k += kLanes) {
    const Doubles end = endless ? Doubles{} : 1 / magnitude(load(s.t_max + k) * load(s.d[2] + k));
    narrow(beam.farthest + k, end * (1 - 0x1p-21));
    narrow(beam.nearest + k, end * (1 + 0x1p-21));
  }
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
  if (!set_source(beam, rays, first, span) || !set_meeting(beam, apex)) return false;
  const BeamSource& s = beam.source;
  const Order& order = kOrders[uint32_t(s.order - kOrders) ^ 4];
  beam.order = &order;
  const Doubles sign = splat(double(order.sign));
  Doubles off{}, square{}, nearest = splat(kInf), farthest{}, end{}, past = splat(kInf);
  for (int k = 0; k < kBeam; k += kLanes) {
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
               miss = most_of(off) + tiny, behind = tiny - smaller(least_of(past), 0.0);
  if (!set_room(beam, tree, most_of(square)) || !(reach < 16 * size) || !(miss < 0x1p-20 * reach) ||
      !(least_of(nearest) > 0x1p-16 * size) || !(behind < 0x1p-18 * reach))
    return false;
  beam.off = float(miss);
  beam.past = float(behind);
  beam.room += 2 * beam.off + 8 * beam.past;
  beam.begin = float((1 - 0x1p-19) / (most_of(end) + tiny));
  beam.apex = origin_at(apex, order);
  return true;
}

/// False when the rays' slices do not share out their places.
inline bool set_places(Beam& beam) {
  const BeamSource& s = beam.source;
  const Broad sign = spread(beam.order->sign);
  float low[2] = {kFar, kFar}, high[2] = {-kFar, -kFar};
  for (int a = 0; a < 2; ++a)
    beam.middle[a] = float(0.5 * double(beam.order->sign) *
                           (s.d[a][0] / s.d[2][0] + s.d[a][kBeam - 1] / s.d[2][kBeam - 1]));
  for (int g = 0; g < kSlices; ++g) {
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
  float area = 0;
  const float room[2] = {beam.width[0] / 16, beam.width[1] / 16};
  for (int g = 0; g < kSlices; ++g)
    area += (beam.half[0][g] + room[0]) * (beam.half[1][g] + room[1]);
  const float whole = beam.width[0] * beam.width[1];
  return 4 * area >= whole && area <= 4 * whole;
}

}  // namespace
}  // namespace glint
