// The Voronoi Texture in one to four dimensions, as Cycles (kernel/svm/voronoi.h).
#pragma once
#include "program/machine.h"
#include "program/op_noise.h"

namespace glint {
namespace {

constexpr double kFar = __builtin_inf();
constexpr double kLeastExponent =
    0x1p-5;  // of Minkowski's metric, on either side of 0; one over it the largest

/// 1 / x, 0 where x is 0.
inline Doubles inverse(Doubles x) { return where(x != 0, 1 / choose(x != 0, x, splat(1))); }

struct CellSettings {
  int metric;
  bool jenkins;      // else PCG
  bool by_distance;  // F1 compares distances, else what is under their root
  Doubles randomness, smoothness, exponent;
};

/// A round of PCG (Jarzynski and Olano 2020).
inline void pcg_turn(Numbers (&v)[2]) {
  v[0] = v[0] + v[1] * 1664525u;
  v[1] = v[1] + v[0] * 1664525u;
}
inline void pcg_turn(Numbers (&v)[3]) {
  v[0] = v[0] + v[1] * v[2];
  v[1] = v[1] + v[2] * v[0];
  v[2] = v[2] + v[0] * v[1];
}
inline void pcg_turn(Numbers (&v)[4]) {
  v[0] = v[0] + v[1] * v[3];
  v[1] = v[1] + v[2] * v[0];
  v[2] = v[2] + v[0] * v[1];
  v[3] = v[3] + v[1] * v[2];
}

/// Fractions of 2^31, in place of the words.
template <int N>
inline void pcg(Numbers (&v)[N], Doubles (&out)[N]) {
  for (Numbers& w : v) w = w * 1664525u + 1013904223u;
  pcg_turn(v);
  for (Numbers& w : v) w = w ^ Numbers(Whole(w) >> 16);
  pcg_turn(v);
  for (int k = 0; k < N; ++k) {
    const Singles rounded = __builtin_convertvector(Whole(v[k] & 0x7fffffffu), Singles);
    out[k] = __builtin_convertvector(rounded, Doubles) * 0x1p-31;
  }
}

/// Three hashes of the numbers, as Cycles has them of one to four.
template <int D>
inline Three jenkins_color(const NoisePoint<D>& cell) {
  const Doubles(&c)[D] = cell.at;
  if constexpr (D == 1) {
    return {hash_numbers(c[0]), hash_numbers(c[0], splat(1)), hash_numbers(c[0], splat(2))};
  } else if constexpr (D == 2) {
    const auto more = [&](double k) { return hash_numbers(c[0], c[1], splat(k)); };
    return {hash_numbers(c[0], c[1]), more(1), more(2)};
  } else if constexpr (D == 3) {
    const auto more = [&](double k) { return hash_numbers(c[0], c[1], c[2], splat(k)); };
    return {hash_numbers(c[0], c[1], c[2]), more(1), more(2)};
  } else {
    return {hash_numbers(c[0], c[1], c[2], c[3]), hash_numbers(c[2], c[0], c[3], c[1]),
            hash_numbers(c[3], c[2], c[1], c[0])};
  }
}

/// Where in their cells points were before Blender 5.0. One copy: it is long.
template <int D>
__attribute__((noinline)) NoisePoint<D> jenkins_cell(const NoisePoint<D>& cell) {
  if constexpr (D == 4) {
    const Doubles &x = cell.at[0], &y = cell.at[1], &z = cell.at[2], &w = cell.at[3];
    return {{hash_numbers(x, y, z, w), hash_numbers(w, x, y, z), hash_numbers(z, w, x, y),
             hash_numbers(y, z, w, x)}};
  } else {
    const Three found = jenkins_color<D>(cell);
    if constexpr (D == 2) return {{found.x, found.y}};
    else return {{found.x, found.y, found.z}};
  }
}

template <int D>
inline NoisePoint<D> hash_cell(const CellSettings& s, const NoisePoint<D>& cell) {
  NoisePoint<D> found;
  if constexpr (D == 1) {
    found.at[0] = hash_numbers(cell.at[0]);
  } else {
    if (s.jenkins) return jenkins_cell<D>(cell);
    Numbers words[D];
    for (int axis = 0; axis < D; ++axis) words[axis] = modulo_words(cell.at[axis]);
    pcg<D>(words, found.at);
  }
  return found;
}

template <int D>
inline Three cell_color(const CellSettings& s, const NoisePoint<D>& cell) {
  if constexpr (D == 1) {
    return jenkins_color<D>(cell);
  } else {
    if (s.jenkins) return jenkins_color<D>(cell);
    constexpr int N = D == 2 ? 3 : D;
    Numbers words[N] = {};
    Doubles found[N];
    for (int axis = 0; axis < D; ++axis) words[axis] = modulo_words(cell.at[axis]);
    pcg<N>(words, found);
    return {found[0], found[1], found[2]};
  }
}

template <int D>
inline NoisePoint<D> operator-(NoisePoint<D> p, const NoisePoint<D>& q) {
  for (int axis = 0; axis < D; ++axis) p.at[axis] = p.at[axis] - q.at[axis];
  return p;
}

template <int D>
inline Doubles dot(const NoisePoint<D>& p, const NoisePoint<D>& q) {
  Doubles sum = p.at[0] * q.at[0];
  for (int axis = 1; axis < D; ++axis) sum = sum + p.at[axis] * q.at[axis];
  return sum;
}

template <int D>
inline NoisePoint<D> choose(Mask m, NoisePoint<D> p, const NoisePoint<D>& q) {
  for (int axis = 0; axis < D; ++axis) p.at[axis] = choose(m, p.at[axis], q.at[axis]);
  return p;
}

template <int D>
inline NoisePoint<D> blended(const NoisePoint<D>& p, const NoisePoint<D>& q, Doubles t) {
  NoisePoint<D> found;
  for (int axis = 0; axis < D; ++axis) found.at[axis] = p.at[axis] + (q.at[axis] - p.at[axis]) * t;
  return found;
}

template <int D>
inline NoisePoint<D> cell_of(NoisePoint<D> p) {
  for (Doubles& x : p.at) x = down(x);
  return p;
}

enum CellMetric { kEuclidean, kManhattan, kChebychev, kMinkowski };

template <int D>
inline Doubles cell_distance(const CellSettings& s, const NoisePoint<D>& way) {
  if (D > 1 && s.metric == kEuclidean) return root(dot(way, way));
  Doubles total = splat(0);
  for (const Doubles& x : way.at) {
    const Doubles away = magnitude(x);
    if (D == 1 || s.metric == kManhattan) total = total + away;
    else if (s.metric == kChebychev) total = larger(total, away);
    else total = total + pow(away, s.exponent);
  }
  return D > 1 && s.metric == kMinkowski ? pow(total, 1 / s.exponent) : total;
}

/// body(offset, point) for the cells around, the first axis fastest.
template <int D, class Body>
inline void each_cell(const CellSettings& s, const NoisePoint<D>& cell, int reach, Body body) {
  const int width = 2 * reach + 1;
  int count = 1;
  for (int axis = 0; axis < D; ++axis) count *= width;
  for (int number = 0; number < count; ++number) {
    NoisePoint<D> offset;
    for (int axis = 0, rest = number; axis < D; ++axis, rest /= width)
      offset.at[axis] = splat(rest % width - reach);
    body(offset, offset + hash_cell<D>(s, cell + offset) * s.randomness);
  }
}

template <int D>
struct VoronoiOctave {
  Doubles distance;
  Three color;
  NoisePoint<D> position;
};

template <int D>
inline VoronoiOctave<D> nearest_cell(const NoisePoint<D>& p, const CellSettings& s, bool second) {
  const NoisePoint<D> cell = cell_of(p), local = p - cell;
  Doubles best[2] = {splat(kFar), splat(kFar)};
  NoisePoint<D> offsets[2] = {}, points[2] = {};
  const bool by_sum = D > 1 && s.metric == kMinkowski && !second && !s.by_distance;
  const Mask turned = (s.exponent < 0) & -int64_t(by_sum);
  each_cell<D>(s, cell, 1, [&](const NoisePoint<D>& offset, const NoisePoint<D>& point) {
    const Doubles away = cell_distance<D>(s, point - local), d = choose(turned, -away, away);
    const Mask first = d < best[0], then = d < best[1];
    best[1] = choose(first, best[0], choose(then, d, best[1]));
    offsets[1] = choose(first, offsets[0], choose(then, offset, offsets[1]));
    points[1] = choose(first, points[0], choose(then, point, points[1]));
    best[0] = choose(first, d, best[0]);
    offsets[0] = choose(first, offset, offsets[0]);
    points[0] = choose(first, point, points[0]);
  });
  return {magnitude(best[second]), cell_color<D>(s, cell + offsets[second]), points[second] + cell};
}

template <int D>
inline VoronoiOctave<D> smooth_cell(const NoisePoint<D>& p, const CellSettings& s) {
  const NoisePoint<D> cell = cell_of(p), local = p - cell;
  const Doubles width = choose(s.smoothness > 0, s.smoothness, splat(1));
  VoronoiOctave<D> sum{};
  bool first = true;
  each_cell<D>(s, cell, 2, [&](const NoisePoint<D>& offset, const NoisePoint<D>& point) {
    const Doubles d = cell_distance<D>(s, point - local);
    const Doubles step = 0.5 + 0.5 * (sum.distance - d) / width;
    const Doubles t = smaller(larger(step, splat(0)), splat(1));
    const Doubles h = first ? splat(1) : t * t * (3 - 2 * t);
    first = false;
    Doubles less = s.smoothness * h * (1 - h);
    sum.distance = sum.distance + (d - sum.distance) * h - less;
    less = less / (1 + 3 * s.smoothness);
    sum.color =
        sum.color + h * (cell_color<D>(s, cell + offset) - sum.color) - Three{less, less, less};
    sum.position = blended(sum.position, point, h);
    for (Doubles& x : sum.position.at) x = x - less;
  });
  sum.position = cell + sum.position;
  return sum;
}

template <int D>
inline Doubles edge_distance(const NoisePoint<D>& p, const CellSettings& s) {
  const NoisePoint<D> cell = cell_of(p), local = p - cell;
  if constexpr (D == 1) {
    const auto point = [&](double k) { return k + hash_numbers(cell.at[0] + k) * s.randomness; };
    const Doubles middle = point(0), x = local.at[0];
    return smaller(magnitude((middle + point(-1)) / 2 - x), magnitude((middle + point(1)) / 2 - x));
  } else {
    NoisePoint<D> nearest{};
    Doubles least = splat(kFar), found = splat(kFar);
    each_cell<D>(s, cell, 1, [&](const NoisePoint<D>&, const NoisePoint<D>& point) {
      const NoisePoint<D> way = point - local;
      const Doubles d = dot(way, way);
      nearest = choose(d < least, way, nearest);
      least = smaller(d, least);
    });
    each_cell<D>(s, cell, 1, [&](const NoisePoint<D>&, const NoisePoint<D>& point) {
      const NoisePoint<D> way = point - local, across = way - nearest;
      const Doubles size = dot(across, across);
      const Doubles edge =
          dot((nearest + way) * splat(0.5), across) / root(choose(size > 0, size, splat(1)));
      found = choose((size > 0.0001) & (edge < found), edge, found);
    });
    return found;
  }
}

/// Half the way from the nearest point to the point nearest to it.
template <int D>
inline Doubles cell_radius(const NoisePoint<D>& p, const CellSettings& s) {
  const NoisePoint<D> cell = cell_of(p), local = p - cell;
  NoisePoint<D> nearest{}, own{};
  Doubles least = splat(kFar);
  each_cell<D>(s, cell, 1, [&](const NoisePoint<D>& offset, const NoisePoint<D>& point) {
    const NoisePoint<D> way = point - local;
    const Doubles d = dot(way, way);
    nearest = choose(d < least, point, nearest);
    own = choose(d < least, offset, own);
    least = smaller(d, least);
  });
  least = splat(kFar);
  each_cell<D>(s, cell + own, 1, [&](const NoisePoint<D>& offset, const NoisePoint<D>& point) {
    if (!any(dot(offset, offset) != 0)) return;
    const NoisePoint<D> way = point + own - nearest;
    least = smaller(dot(way, way), least);
  });
  return root(least) / 2;
}

struct VoronoiFractal {
  Doubles detail, roughness, lacunarity;
  Mask single() const { return (detail == 0) | (roughness == 0); }
  bool ends(int octave) const { return octave > 0 && !any((detail > octave - 1) & ~single()); }
  Mask whole(int octave) const {
    return (splat(octave) <= detail) & (octave == 0 ? ~Mask{} : ~single());
  }
  /// Of octaves that are not whole.
  Doubles rest(int octave) const {
    const Mask partly = ~single() & (splat(octave) > detail) & (detail > octave - 1);
    return where(partly, detail - down(detail));
  }
};

template <int D>
inline void put_voronoi(const Operands& at, size_t k, const NoisePoint<D>& p, const CellSettings& s,
                        const VoronoiFractal& f, int feature, bool normalized, Doubles size) {
  Doubles amplitude = splat(1), most = splat(0), scale = splat(1);
  VoronoiOctave<D> sum{};
  for (int octave = 0; !f.ends(octave); ++octave) {
    const Mask whole = f.whole(octave);
    const Doubles share = choose(whole, splat(1), f.rest(octave));
    VoronoiOctave<D> now = nearest_cell<D>(p * scale, s, feature == 1);
    if (feature == 2 && any(s.smoothness != 0)) {
      const VoronoiOctave<D> smooth = smooth_cell<D>(p * scale, s);
      const Mask flat = s.smoothness == 0;
      now.distance = choose(flat, now.distance, smooth.distance);
      now.color = choose(flat, now.color, smooth.color);
      now.position = choose(flat, now.position, smooth.position);
    }
    most = most + share * amplitude;
    sum.distance = sum.distance + share * (now.distance * amplitude);
    sum.color = sum.color + share * (amplitude * now.color);
    const NoisePoint<D> there = now.position * inverse(scale);
    sum.position = blended(sum.position, blended(sum.position, there, amplitude), share);
    scale = choose(whole, scale * f.lacunarity, scale);
    amplitude = choose(whole, amplitude * f.roughness, amplitude);
  }
  if (normalized) {
    NoisePoint<D> reach;
    for (Doubles& x : reach.at) x = 0.5 + 0.5 * s.randomness;
    const Doubles farthest = cell_distance<D>(s, reach) * (feature == 1 ? 2.0 : 1.0);
    sum.distance = sum.distance * inverse(most * farthest);
    sum.color = inverse(most) * sum.color;
  }
  Doubles place[4] = {};
  for (int axis = 0; axis < D; ++axis)
    place[D == 1 ? 3 : axis] = sum.position.at[axis] * inverse(size);
  at.put(0, k, sum.distance);
  at.put(1, k, sum.color);
  at.put(2, k, Three{place[0], place[1], place[2]});
  at.put(3, k, place[3]);
}

template <int D>
inline Doubles fractal_edge(const NoisePoint<D>& p, const CellSettings& s, const VoronoiFractal& f,
                            bool normalized) {
  const Doubles reach = 0.5 + 0.5 * s.randomness;
  Doubles amplitude = splat(1), most = reach, scale = splat(1), distance = splat(8);
  for (int octave = 0; !f.ends(octave); ++octave) {
    const Mask whole = f.whole(octave);
    const Doubles share = f.rest(octave), over = inverse(scale);
    const Doubles near = edge_distance<D>(p * scale, s) * over;
    const auto lerp = [](Doubles a, Doubles b, Doubles t) { return a + (b - a) * t; };
    const Doubles most_now = lerp(most, reach * over, amplitude);
    const Doubles now = lerp(distance, smaller(distance, near), amplitude);
    most = choose(whole, most_now, lerp(most, most_now, share));
    distance = choose(whole, now, lerp(distance, smaller(distance, now), share));
    scale = choose(whole, scale * f.lacunarity, scale);
    amplitude = choose(whole, amplitude * f.roughness, amplitude);
  }
  return normalized ? distance * inverse(most) : distance;
}

template <int D>
inline void voronoi_at(const Operands& at, size_t k) {
  enum { kF1, kF2, kSmooth, kEdge, kRadius };
  const auto held = [](Doubles x, double most) {
    return smaller(larger(x, splat(0)), splat(most));
  };
  const int feature = at.settings[1];
  const bool normalized = at.settings[3] != 0;
  const Doubles scale = at.number(2, k), none = splat(0);
  const NoisePoint<D> p = noise_point<D>(at.vector(0, k), at.number(1, k)) * scale;
  const Doubles given = at.number(7, k),
                size = smaller(larger(magnitude(given), splat(kLeastExponent)),
                               splat(1 / kLeastExponent)),
                exponent = choose(given < 0, -size, size);
  const CellSettings s{at.settings[2],
                       at.settings[4] != 0,
                       at.settings[5] != 0,
                       held(at.number(8, k), 1),
                       held(at.number(6, k) / 2, 0.5),
                       exponent};
  const VoronoiFractal f{held(at.number(3, k), 15), held(at.number(4, k), 1), at.number(5, k)};
  at.put(4, k, feature == kRadius ? cell_radius<D>(p, s) : none);
  if (feature < kEdge) return put_voronoi<D>(at, k, p, s, f, feature, normalized, scale);
  at.put(0, k, feature == kEdge ? fractal_edge<D>(p, s, f, normalized) : none);
  at.put(1, k, Three{});
  at.put(2, k, Three{});
  at.put(3, k, none);
}

namespace op {

inline void voronoi_texture(const Machine& m, const Operands& at) {
  each_group_in(m, at, [&]<int D>(size_t k) { voronoi_at<D>(at, k); });
}

}  // namespace op
}  // namespace
}  // namespace glint
