// Triangles against apex packets: rays whose lines all pass through one point, as camera rays,
// their reflections in a plane and rays to a lamp do, or are parallel, as rays to a sun. A ray is
// two numbers there, its place: the slopes of its line, or where parallel ones start. A triangle's
// edge functions are linear in them; so a few products tell that it lies beside a whole packet, or
// which rays hit it. Nothing is left out that the test of single rays would find.
#pragma once
#include <initializer_list>

#include "bvh/traverse/kernel_coherent.h"

namespace glint {
namespace {

inline uint32_t leaf_first(ChildRef leaf) { return leaf & kOrdinal; }
inline int leaf_count(ChildRef leaf) { return int(leaf >> kCountShift & 7) + 1; }

/// The triangles of one leaf: n floats for each coordinate.
struct Triangles {
  const float* p;
  int n;
  Triangles(const TreeView& tree, ChildRef leaf)
      : p(tree.floats + 9 * size_t(leaf_first(leaf))), n(leaf_count(leaf)) {}
  const float* at(int corner, int axis) const { return p + (3 * corner + axis) * n; }
};

/// A point in the rays' order and sense, as the sum of two floats.
struct Origin {
  float o[3], low_part[3];
};

/// Coordinates of the triangles [first, first + kFloats) of a leaf, corner by corner, in the rays'
/// order and sense, from `from`.
__attribute__((always_inline)) inline void corners_from(const Origin& from, const Triangles& leaf,
                                                        int first, const Order& order,
                                                        Floats (&p)[9]) {
  for (int j = 0; j < 3; ++j)
    for (int a = 0; a < 3; ++a) {
      const Floats v = load(leaf.at(j, order.axes[a]) + first);
      p[3 * j + a] =
          (a == 2 ? v * splat(order.sign) : v) - splat(from.o[a]) - splat(from.low_part[a]);
    }
}

/// Between which places packets lie: one in all lanes, or one to a lane.
struct Places {
  Floats low[2], high[2];
};

/// The rays of a coherent tile, where they are an apex packet. What a corner is away from them
/// across grows with their places times its weight: constant + linear times its depth. That is the
/// depth where places are slopes from an apex, and 1 where parallel rays start at them. Of apex
/// packets from far away places are where the rays are in the middle of the tree, and the weight is
/// 1 there: slopes would differ too little.
struct ApexPacket {
  bool exists = false;
  float constant, linear;
  Origin apex;  // from where depths are counted; of parallel rays: where the first one begins; far
                // away: of a ray in the middle
  float middle[2];  // slopes of the ray whose place is 0
  float reach;      // from the rays' beginnings to the apex, in depth
  float steep;      // no slope is more
  float off;        // what rays miss the apex by
  float margin;     // bound of what depths are off by, but for those of triangles
  alignas(64) float low[2][kGroups], high[2][kGroups];  // of groups
  alignas(64) float place[2][kTile],
      start[kTile];  // of rays; and depths of their beginnings from the apex
  Places all;

  Places groups(int g) const {
    return {{load(low[0] + g), load(low[1] + g)}, {load(high[0] + g), load(high[1] + g)}};
  }
  Places group(int g) const {
    return {{splat(low[0][g]), splat(low[1][g])}, {splat(high[0][g]), splat(high[1][g])}};
  }
};

/// Edge functions of triangles, k + x place + y place', turned so that they are positive inside. A
/// packet lies beside a triangle where one of them stays below -margin; a ray hits it where all are
/// above margin. Depths are counted from the apex: z that of the first corner, dz of the others
/// from there.
struct EdgeLines {
  Floats k[3], x[3], y[3], margin, z, dz[2], front, rear;

  __attribute__((always_inline)) FloatMask beside(const Places& s) const {
    Floats least = splat(kFar);
    for (int e = 0; e < 3; ++e)
      least = smaller(k[e] + larger(x[e] * s.low[0], x[e] * s.high[0]) +
                          larger(y[e] * s.low[1], y[e] * s.high[1]),
                      least);
    return less(least, -margin);
  }
};

/// The edges of the triangles [first, first + kFloats) of a leaf. With m no less than any corner is
/// away across, z than it is along, and s than any slope, the rays' edge functions and these are
/// each off by less than 2^-20 m (1.25 s z + m): 4 m times the rounding of a corner, 2^-24 (5 s z +
/// 3 m), and that of the products; these also by 4 m times what rays miss the apex by. Where one
/// stays 2^-18 m (s z + m) and 8 m times that miss below 0, and their sum above, the rays see
/// different signs.
__attribute__((noinline)) inline EdgeLines edge_lines(const ApexPacket& apex_packet,
                                                      const Triangles& leaf, int first,
                                                      const Order& order) {
  Floats p[9], most{}, deepest{};
  corners_from(apex_packet.apex, leaf, first, order, p);
  for (int j = 0; j < 3; ++j) {
    const Floats z = p[3 * j + 2];
    for (int a = 0; a < 2; ++a) {
      p[3 * j + a] -= splat(apex_packet.middle[a]) * z;
      most = larger(magnitude(p[3 * j + a]), most);
    }
    deepest = larger(magnitude(z), deepest);
  }
  const Floats z0 = p[2], z1 = p[5], z2 = p[8];
  const Places& all = apex_packet.all;
  const Floats width = larger(larger(all.high[0], -all.low[0]), larger(all.high[1], -all.low[1]));
  most += width * (splat(apex_packet.constant) + deepest * splat(magnitude(apex_packet.linear)));
  const Floats constant = splat(apex_packet.constant), linear = splat(apex_packet.linear);
  EdgeLines l;
  for (int e = 0; e < 3; ++e) {
    const Floats *a = p + 3 * ((e + 1) % 3), *b = p + 3 * ((e + 2) % 3);
    l.k[e] = b[0] * a[1] - b[1] * a[0];
    const Floats wa = constant + linear * a[2], wb = constant + linear * b[2];
    l.x[e] = b[1] * wa - wb * a[1];
    l.y[e] = wb * a[0] - b[0] * wa;
  }
  const Floats k = l.k[0] + l.k[1] + l.k[2], x = l.x[0] + l.x[1] + l.x[2],
               y = l.y[0] + l.y[1] + l.y[2];
  const Ints side = Ints(k) & INT32_MIN;
  const Floats swing = larger(magnitude(x * all.low[0]), magnitude(x * all.high[0])) +
                       larger(magnitude(y * all.low[1]), magnitude(y * all.high[1]));
  const Floats far = splat(apex_packet.steep) * (deepest + splat(apex_packet.reach)) +
                     splat(apex_packet.off * 0x1p21f);
  const Floats margin = splat(kEdgeMargin) * most * (far + most) + splat(kUnderflow);
  l.margin = choose(less(margin, magnitude(k) - swing), margin,
                    splat(__builtin_inff()));  // edge-on: no side is known
  for (int e = 0; e < 3; ++e) {
    l.k[e] = Floats(Ints(l.k[e]) ^ side);
    l.x[e] = Floats(Ints(l.x[e]) ^ side);
    l.y[e] = Floats(Ints(l.y[e]) ^ side);
  }
  l.z = z0;
  l.dz[0] = z1 - z0;
  l.dz[1] = z2 - z0;
  l.front = smaller(z0, smaller(z1, z2));
  l.rear = larger(z0, larger(z1, z2));
  return l;
}

/// The edges of several triangles in memory, to be had one by one.
struct EdgeTable {
  alignas(64) float lines[15][kFloats];
  explicit EdgeTable(const EdgeLines& l) {
    for (int e = 0; e < 3; ++e) {
      store(lines[3 * e], l.k[e]);
      store(lines[3 * e + 1], l.x[e]);
      store(lines[3 * e + 2], l.y[e]);
    }
    store(lines[9], l.margin);
    store(lines[10], l.z);
    store(lines[11], l.dz[0]);
    store(lines[12], l.dz[1]);
    store(lines[13], l.front);
    store(lines[14], l.rear);
  }
  EdgeLines at(int lane) const {
    EdgeLines l;
    for (int e = 0; e < 3; ++e) {
      const float (*line)[kFloats] = lines + 3 * e;
      l.k[e] = splat(line[0][lane]);
      l.x[e] = splat(line[1][lane]);
      l.y[e] = splat(line[2][lane]);
    }
    l.margin = splat(lines[9][lane]);
    l.z = splat(lines[10][lane]);
    l.dz[0] = splat(lines[11][lane]);
    l.dz[1] = splat(lines[12][lane]);
    l.front = splat(lines[13][lane]);
    l.rear = splat(lines[14][lane]);
    return l;
  }
};

/// Where the lines of a coherent tile's first and last ray are nearest to each other, in the rays'
/// order. Returns how far from there the others pass at most.
inline double meeting_point(const Tile& tile, double (&apex)[3]) {
  const int final = tile.count - 1;
  double across = 0, square = 0;
  for (int a = 0; a < 2; ++a) {
    const double first = tile.shear[a][0], turn = tile.shear[a][final] - first;
    across += turn * (tile.o[a][final] - tile.o[a][0] - first * (tile.o[2][final] - tile.o[2][0]));
    square += turn * turn;
  }
  if (!(square > 0)) return kInf;
  apex[2] = tile.o[2][final] - across / square;
  Doubles off{};
  for (int a = 0; a < 2; ++a) {
    apex[a] = tile.o[a][0] + tile.shear[a][0] * (apex[2] - tile.o[2][0]);
    for (int k = 0; k < kTile; k += kLanes) {
      const Doubles at =
          load(tile.o[a] + k) + load(tile.shear[a] + k) * (splat(apex[2]) - load(tile.o[2] + k));
      off = larger(magnitude(at - splat(apex[a])), off);
    }
  }
  return most_of(off);
}

/// How far the rays begin from the packet's apex, in depth. Returns the most.
inline float set_starts(const Tile& tile, ApexPacket& apex_packet) {
  Floats most{};
  for (int k = 0; k < kTile; k += kFloats) {
    const Floats from = (load(tile.start + k) - splat(apex_packet.apex.o[2])) +
                        (load(tile.low_part[2] + k) - splat(apex_packet.apex.low_part[2]));
    store(apex_packet.start + k, from);
    most = larger(magnitude(from), most);
  }
  return largest(most);
}

/// Whether all rays have the first one's slopes.
inline bool parallel(const Tile& tile) {
  Ints other{};
  for (int k = 0; k < kTile; k += kFloats)
    for (const auto& slope : tile.slope) other |= load(slope + k) != splat(*slope);
  return all_zero(other);
}

/// A coherent tile's rays that meet far away. `meeting`: where, in their order; `off`: what they
/// miss it by. The ray in the middle is one half way between the first and the last. A ray is off
/// its place by what it misses the apex by, less where that is far, and by rounding.
inline void set_far_apex(const Tile& tile, const double (&meeting)[3], double off,
                         ApexPacket& apex_packet) {
  const int final = tile.count - 1;
  const Order& order = order_of(tile, 0);
  const double sign = double(order.sign), radius = tile.tree->radius;
  const float plane = float(sign * tile.tree->center[order.axes[2]]);
  const double depth = sign * double(plane), distance = double(plane) - sign * meeting[2];
  for (int a = 0; a < 2; ++a) {
    const double first = tile.o[a][0] + tile.shear[a][0] * (depth - tile.o[2][0]);
    const double last = tile.o[a][final] + tile.shear[a][final] * (depth - tile.o[2][final]),
                 middle = 0.5 * first + 0.5 * last;
    apex_packet.apex.o[a] = float(middle);
    apex_packet.apex.low_part[a] = float(middle - double(apex_packet.apex.o[a]));
    apex_packet.middle[a] = float((middle - meeting[a]) / distance);
  }
  apex_packet.apex.o[2] = plane;
  apex_packet.apex.low_part[2] = 0;
  apex_packet.constant = 1;
  apex_packet.linear = float(1 / distance);
  apex_packet.off =
      float(off * (2 * radius / magnitude(distance)) + 0x1p-21 * radius) + 16 * tile.far_margin;
}

/// The apex of a coherent tile. False when its rays are no apex packet.
inline bool set_apex(const Tile& tile, ApexPacket& apex_packet) {
  Origin& apex = apex_packet.apex;
  apex_packet.off = apex_packet.reach = apex_packet.constant = 0;
  apex_packet.linear = 1;
  for (int a = 0; a < 2; ++a)
    apex_packet.middle[a] = 0.5f * tile.slope[a][0] + 0.5f * tile.slope[a][tile.count - 1];
  apex = {{tile.of[0][0], tile.of[1][0], tile.start[0]},
          {tile.low_part[0][0], tile.low_part[1][0], tile.low_part[2][0]}};
  if (tile.common) {
    for (int k = 0; k < kTile; k += kFloats) store(apex_packet.start + k, Floats{});
    return true;
  }
  if (parallel(tile)) {
    apex_packet.constant = 1;
    apex_packet.linear = 0;
    apex_packet.reach = set_starts(tile, apex_packet);
    apex_packet.off = 16 * tile.far_margin;
    return true;
  }
  const double radius = tile.tree->radius;
  double meeting[3], off = meeting_point(tile, meeting);
  if (!(off < 1e20)) return false;
  const Order& order = order_of(tile, 0);
  if (magnitude(meeting[2] - tile.tree->center[order.axes[2]]) > 4 * radius) {
    set_far_apex(tile, meeting, off, apex_packet);
    apex_packet.reach = set_starts(tile, apex_packet);
    return apex_packet.off < 0x1p-18f * float(radius);
  }
  meeting[2] *= double(order.sign);
  for (int a = 0; a < 3; ++a) {
    apex.o[a] = float(meeting[a]);
    apex.low_part[a] = float(meeting[a] - double(apex.o[a]));
  }
  apex_packet.reach = set_starts(tile, apex_packet);
  apex_packet.off = float(off) + 16 * tile.far_margin;
  return apex_packet.off < 0x1p-18f * apex_packet.reach;
}

/// Places of the rays [k, k + kFloats) along axis a.
inline Floats places(const Tile& tile, const ApexPacket& apex_packet, int a, int k) {
  const Floats slope = load(tile.slope[a] + k);
  if (apex_packet.constant == 0) return slope - splat(apex_packet.middle[a]);
  const Floats across = (load(tile.of[a] + k) - splat(apex_packet.apex.o[a])) +
                        (load(tile.low_part[a] + k) - splat(apex_packet.apex.low_part[a]));
  return across - slope * load(apex_packet.start + k);
}

inline void set_apex_packet(const Tile& tile, ApexPacket& apex_packet) {
  apex_packet.exists = set_apex(tile, apex_packet);
  if (!apex_packet.exists) return;
  apex_packet.margin = 0x1p-20f * apex_packet.reach + kFarTie * tile.far_margin;
  for (int a = 0; a < 2; ++a) {
    for (int k = 0; k < kTile; k += kFloats)
      store(apex_packet.place[a] + k, places(tile, apex_packet, a, k));
    Floats low = splat(kFar), high = splat(-kFar);
    for (int g = 0; g < kGroups; g += kFloats) {
      const Floats least = fold_rows<Smaller>(apex_packet.place[a] + g * kFloats),
                   most = fold_rows<Larger>(apex_packet.place[a] + g * kFloats);
      store(apex_packet.low[a] + g, least);
      store(apex_packet.high[a] + g, most);
      low = smaller(least, low);
      high = larger(most, high);
    }
    const float least = smallest(low), most = largest(high),
                turn = larger(-least, most) * magnitude(apex_packet.linear);
    apex_packet.all.low[a] = splat(least);
    apex_packet.all.high[a] = splat(most);
    apex_packet.steep = larger(magnitude(apex_packet.middle[a]) + turn, a ? apex_packet.steep : 0);
  }
}

}  // namespace
}  // namespace glint
