// White noise and the Noise Texture's fractals, as Cycles (kernel/svm/noisetex.h).
#pragma once
#include "program/machine.h"
#include "program/perlin.h"

namespace glint {
namespace {

/// W alone, XY, XYZ or XYZW.
template <int D>
inline NoisePoint<D> noise_point(const Three& v, Doubles w) {
  if constexpr (D == 1) return {{w}};
  if constexpr (D == 2) return {{v.x, v.y}};
  if constexpr (D == 3) return {{v.x, v.y, v.z}};
  if constexpr (D == 4) return {{v.x, v.y, v.z, w}};
}

/// The offset in [100, 200], a float32 as in Cycles, that stands for a seed.
template <int D>
inline NoisePoint<D> seed_offset(int seed) {
  NoisePoint<D> offset;
  for (int axis = 0; axis < D; ++axis) {
    const Doubles hash =
        D == 1 ? hash_numbers(splat(seed)) : hash_numbers(splat(seed), splat(axis));
    const Singles rounded = __builtin_convertvector(100 + hash * 100, Singles);
    offset.at[axis] = __builtin_convertvector(rounded, Doubles);
  }
  return offset;
}

template <int D>
inline NoisePoint<D> operator+(NoisePoint<D> p, const NoisePoint<D>& q) {
  for (int axis = 0; axis < D; ++axis) p.at[axis] = p.at[axis] + q.at[axis];
  return p;
}

struct Fractal {
  int type;
  bool normalized;
  Doubles detail, roughness, lacunarity, offset, gain;
};

/// The product of octaves 1 + noise * roughness^i.
template <int D>
inline Doubles multifractal(NoisePoint<D> p, const Fractal& f) {
  Doubles value = splat(1), power = splat(1);
  for (int octave = 0;; ++octave) {
    const Doubles share = octave_share(f.detail, octave);
    if (!any(share > 0)) return value;
    value = value * (share * power * signed_noise<D>(p) + 1);
    power = power * f.roughness;
    p = p * f.lacunarity;
  }
}

/// Octaves weighted by the height so far: valleys are smooth.
template <int D>
inline Doubles hetero_terrain(NoisePoint<D> p, const Fractal& f) {
  Doubles value = f.offset + signed_noise<D>(p), power = f.roughness;
  for (int octave = 1;; ++octave) {
    const Doubles share = octave_share(f.detail, octave);
    if (!any(share > 0)) return value;
    p = p * f.lacunarity;
    value = value + share * (signed_noise<D>(p) + f.offset) * power * value;
    power = power * f.roughness;
  }
}

/// Octaves weighted by the signal before; a point whose weight falls to 0.001 is done.
template <int D>
inline Doubles hybrid_multifractal(NoisePoint<D> p, const Fractal& f) {
  Doubles value = splat(0), power = splat(1), weight = splat(1);
  for (int octave = 0;; ++octave) {
    const Doubles share = octave_share(f.detail, octave);
    const Mask going = weight > 0.001;
    if (!any((share > 0) & going)) return value;
    weight = smaller(weight, splat(1));
    const Doubles signal = (signed_noise<D>(p) + f.offset) * power;
    value = choose(going, value + share * weight * signal, value);
    weight = where(going, weight * f.gain * signal);
    power = power * f.roughness;
    p = p * f.lacunarity;
  }
}

/// Octaves (offset - |noise|)^2, weighted by the one before; whole octaves only, as Cycles.
template <int D>
inline Doubles ridged_multifractal(NoisePoint<D> p, const Fractal& f) {
  const auto ridge = [&] {
    const Doubles r = f.offset - magnitude(signed_noise<D>(p));
    return r * r;
  };
  Doubles power = f.roughness, signal = ridge(), value = signal;
  for (int octave = 1;; ++octave) {
    const Mask heard = f.detail >= double(octave);
    if (!any(heard)) return value;
    p = p * f.lacunarity;
    const Doubles weight = smaller(larger(signal * f.gain, splat(0)), splat(1));
    signal = ridge() * weight;
    value = value + where(heard, signal * power);
    power = power * f.roughness;
  }
}

template <int D>
inline Doubles fractal(const NoisePoint<D>& p, const Fractal& f) {
  enum { kMultifractal, kFbm, kHybrid, kRidged, kHetero };
  switch (f.type) {
    case kMultifractal: return multifractal<D>(p, f);
    case kHybrid: return hybrid_multifractal<D>(p, f);
    case kRidged: return ridged_multifractal<D>(p, f);
    case kHetero: return hetero_terrain<D>(p, f);
    default: return fbm<D>(p, f.detail, f.roughness, f.lacunarity, f.normalized);
  }
}

template <int D>
inline void noise_at(const Operands& at, size_t k, const Fractal& f) {
  NoisePoint<D> p = noise_point<D>(at.vector(0, k), at.number(1, k)) * at.number(2, k);
  const Doubles distortion = at.number(8, k);
  if (any(distortion != 0)) {
    NoisePoint<D> move;
    for (int axis = 0; axis < D; ++axis)
      move.at[axis] = signed_noise<D>(p + seed_offset<D>(axis)) * distortion;
    p = p + move;
  }
  const Doubles first = fractal<D>(p, f);
  at.put(0, k, first);
  if (!at.wants(1)) return;
  at.put(
      1, k,
      Three{first, fractal<D>(p + seed_offset<D>(D), f), fractal<D>(p + seed_offset<D>(D + 1), f)});
}

template <int D>
inline void white_noise_at(const Operands& at, size_t k) {
  const Three v = at.vector(0, k);
  const Doubles x = v.x, y = v.y, z = v.z, w = at.number(1, k), one = splat(1), two = splat(2);
  Three color;
  if constexpr (D == 1) color = {hash_numbers(w), hash_numbers(w, one), hash_numbers(w, two)};
  if constexpr (D == 2)
    color = {hash_numbers(x, y), hash_numbers(x, y, one), hash_numbers(x, y, two)};
  if constexpr (D == 3)
    color = {hash_numbers(x, y, z), hash_numbers(x, y, z, one), hash_numbers(x, y, z, two)};
  if constexpr (D == 4)
    color = {hash_numbers(x, y, z, w), hash_numbers(z, x, w, y), hash_numbers(w, z, y, x)};
  at.put(0, k, color.x);
  at.put(1, k, color);
}

/// Hands each group to `each` in as many dimensions as setting 0 says.
template <class Each>
inline void each_group_in(const Machine& m, const Operands& at, const Each& each) {
  each_group(m, [&](size_t k) {
    switch (at.settings[0]) {
      case 1: return each.template operator()<1>(k);
      case 2: return each.template operator()<2>(k);
      case 4: return each.template operator()<4>(k);
      default: return each.template operator()<3>(k);
    }
  });
}

namespace op {

inline void white_noise(const Machine& m, const Operands& at) {
  each_group_in(m, at, [&]<int D>(size_t k) { white_noise_at<D>(at, k); });
}

inline void noise_texture(const Machine& m, const Operands& at) {
  each_group_in(m, at, [&]<int D>(size_t k) {
    const Fractal f{at.settings[1],
                    at.settings[2] != 0,
                    smaller(larger(at.number(3, k), splat(0)), splat(15)),
                    larger(at.number(4, k), splat(0)),
                    at.number(5, k),
                    at.number(6, k),
                    at.number(7, k)};
    noise_at<D>(at, k, f);
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
