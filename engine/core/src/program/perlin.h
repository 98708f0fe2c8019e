// Perlin's gradient noise in one to four dimensions and its octaves, as Cycles
// (kernel/svm/noise.h).
#pragma once
#include "program/functions.h"
#include "program/hashing.h"

namespace glint {
namespace {

template <int D>
struct NoisePoint {
  Doubles at[D];
};

template <int D>
inline NoisePoint<D> operator*(NoisePoint<D> p, Doubles s) {
  for (Doubles& x : p.at) x = x * s;
  return p;
}

/// To about [-1, 1], found by the developers of OSL; by dimensions.
constexpr double kSignedScale[] = {0, 0.25, 0.6616, 0.982, 0.8344};
constexpr double kNoisePeriod = 100000;

/// -v where the bit of the word is set.
inline Doubles signed_by(Mask word, int bit, Doubles v) {
  return Doubles(Mask(v) ^ (((word >> bit) & 1) << 63));
}

/// The dot product of the gradient that the word picks with the way to the point.
template <int D>
inline Doubles gradient_dot(Mask word, const NoisePoint<D>& way) {
  const Doubles(&p)[D] = way.at;
  if constexpr (D == 1) {
    const Doubles steepness = Doubles((word & 7) | Mask(splat(0x1p52))) - 0x1p52;
    return signed_by(word, 3, 1 + steepness) * p[0];
  } else if constexpr (D == 2) {
    const Mask first = (word & 7) < 4;
    return signed_by(word, 0, choose(first, p[0], p[1])) +
           signed_by(word, 1, 2 * choose(first, p[1], p[0]));
  } else if constexpr (D == 3) {
    const Mask h = word & 15;
    const Doubles third = choose((h == 12) | (h == 14), p[0], p[2]);
    return signed_by(word, 0, choose(h < 8, p[0], p[1])) +
           signed_by(word, 1, choose(h < 4, p[1], third));
  } else {
    const Mask h = word & 31;
    return signed_by(word, 0, choose(h < 24, p[0], p[1])) +
           signed_by(word, 1, choose(h < 16, p[1], p[2])) +
           signed_by(word, 2, choose(h < 8, p[2], p[3]));
  }
}

/// Not scaled.
template <int D>
inline Doubles perlin(const NoisePoint<D>& p) {
  Numbers cell[2][D];
  Doubles way[2][D], weight[2][D];
  for (int axis = 0; axis < D; ++axis) {
    const Doubles low = down(p.at[axis]), local = p.at[axis] - low;
    for (int far = 0; far < 2; ++far) {
      cell[far][axis] = modulo_words(low + far);
      way[far][axis] = local - far;
    }
    weight[1][axis] = local * local * local * (local * (local * 6 - 15) + 10);
    weight[0][axis] = 1 - weight[1][axis];
  }
  Doubles total = splat(0);
  for (int corner = 0; corner < 1 << D; ++corner) {
    Numbers words[D];
    NoisePoint<D> to_point;
    Doubles share = splat(1);
    for (int axis = 0; axis < D; ++axis) {
      const int far = corner >> (D - 1 - axis) & 1;
      words[axis] = cell[far][axis];
      to_point.at[axis] = way[far][axis];
      share = share * weight[far][axis];
    }
    const Mask word = __builtin_convertvector(hash_words(words), Mask);
    total = total + share * gradient_dot<D>(word, to_point);
  }
  return total;
}

/// In about [-1, 1], repeated every 100000 units. From a million units on it is read half a unit
/// aside, as Cycles does.
template <int D>
inline Doubles signed_noise(NoisePoint<D> p) {
  for (Doubles& x : p.at) x = fmod(x, splat(kNoisePeriod)) + where(magnitude(x) >= 1e6, splat(0.5));
  return kSignedScale[D] * perlin<D>(p);
}

/// Share of an octave: 1 for whole ones, then the detail's fraction, then 0.
inline Doubles octave_share(Doubles detail, int octave) {
  return smaller(larger(detail - octave + 1, splat(0)), splat(1));
}

/// Sum of octaves, of detail + 1 of them; normalised it is divided by the sum of amplitudes and
/// brought to [0, 1].
template <int D>
inline Doubles fbm(NoisePoint<D> p, Doubles detail, Doubles roughness, Doubles lacunarity,
                   bool normalized) {
  Doubles total = splat(0), most = splat(0), value = splat(0), amplitude = splat(1);
  for (int octave = 0;; ++octave) {
    const Doubles share = octave_share(detail, octave);
    const Mask heard = share > 0;
    if (!any(heard)) break;
    total = total + signed_noise<D>(p) * amplitude;
    most = most + amplitude;
    const Doubles now = normalized ? total / most : total;
    value = choose(heard, value + share * (now - value), value);
    amplitude = amplitude * roughness;
    p = p * lacunarity;
  }
  return normalized ? 0.5 * value + 0.5 : value;
}

}  // namespace
}  // namespace glint
