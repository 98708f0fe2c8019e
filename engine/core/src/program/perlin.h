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

/// A bit of each lane's word, and what is chosen or turned where it is set.
#if defined(__AVX512F__)
typedef __mmask8 WordBit;
inline WordBit bit_of(Mask word, int bit) {
  return _mm512_test_epi64_mask(__m512i(word), _mm512_set1_epi64(int64_t(1) << bit));
}
inline Doubles by_bit(WordBit m, Doubles a, Doubles b) {
  return Doubles(_mm512_mask_blend_pd(m, __m512d(b), __m512d(a)));
}
inline Doubles signed_by(WordBit m, Doubles v) {
  const __m512i whole = __m512i(Mask(v));
  return Doubles(Mask(_mm512_mask_xor_epi64(whole, m, whole, _mm512_set1_epi64(INT64_MIN))));
}
#else
typedef Mask WordBit;  // the sign; what else is set does not matter
inline WordBit bit_of(Mask word, int bit) { return word << (63 - bit); }
inline Doubles by_bit(WordBit m, Doubles a, Doubles b) { return by_sign(m, a, b); }
inline Doubles signed_by(WordBit m, Doubles v) { return Doubles(Mask(v) ^ (m & INT64_MIN)); }
#endif

/// The dot product of the gradient that bits from `first` on of the word pick with the way to the
/// point.
template <int D>
inline Doubles gradient_dot(Mask word, int first, const NoisePoint<D>& way) {
  const Doubles(&p)[D] = way.at;
  const auto bit = [&](int k) { return bit_of(word, first + k); };
  if constexpr (D == 1) {
    const Mask steps = Mask(Words(word) >> first) & 7;
    return signed_by(bit(3), Doubles(steps | Mask(splat(0x1p52))) - (0x1p52 - 1)) * p[0];
  } else if constexpr (D == 2) {
    const WordBit swapped = bit(2);
    return signed_by(bit(0), by_bit(swapped, p[1], p[0])) +
           signed_by(bit(1), 2 * by_bit(swapped, p[0], p[1]));
  } else if constexpr (D == 3) {
    const WordBit low = bit(0), upper = bit(3), middle = bit(2);
    const Doubles third = by_bit(WordBit(upper & middle & ~low), p[0], p[2]);
    return signed_by(low, by_bit(upper, p[1], p[0])) +
           signed_by(bit(1), by_bit(WordBit(upper | middle), third, p[1]));
  } else {
    const WordBit upper = bit(4), middle = bit(3);
    return signed_by(bit(0), by_bit(WordBit(upper & middle), p[1], p[0])) +
           signed_by(bit(1), by_bit(upper, p[2], p[1])) +
           signed_by(bit(2), by_bit(WordBit(upper | middle), p[3], p[2]));
  }
}

/// An integer below 2^31, of which the lower and the upper half of a lane hold the 32 bits.
inline Words in_both_halves(Doubles integer) {
  const Words word = Words(integer + 0x1.8p52);
  return (word << 32) | (word & 0xffffffffu);
}

/// Not scaled; for magnitudes below 2^31. The corners on both sides of the last axis share a lane
/// of 64 bits while their 32-bit hashes are worked out.
template <int D>
inline Doubles perlin(const NoisePoint<D>& p) {
  PairedNumbers cell[2][D];
  Doubles way[2][D], weight[D];
  for (int axis = 0; axis < D; ++axis) {
    const Doubles low = down(p.at[axis]), local = p.at[axis] - low;
    for (int far = 0; far < 2; ++far) {
      cell[far][axis] = PairedNumbers(in_both_halves(low + far));
      way[far][axis] = local - far;
    }
    weight[axis] = local * local * local * (local * (local * 6 - 15) + 10);
  }
  const Words here = Words(cell[0][D - 1]), next = Words(cell[1][D - 1]);
  const auto last = PairedNumbers((here & 0xffffffffu) | (next & ~uint64_t(0xffffffffu)));
  Doubles height[1 << (D - 1)];
  for (int edge = 0; edge < 1 << (D - 1); ++edge) {
    PairedNumbers words[D];
    NoisePoint<D> to_point;
    for (int axis = 0; axis < D - 1; ++axis) {
      const int far = edge >> (D - 2 - axis) & 1;
      words[axis] = cell[far][axis];
      to_point.at[axis] = way[far][axis];
    }
    words[D - 1] = last;
    const Mask hashes = Mask(hash_words(words));
    to_point.at[D - 1] = way[0][D - 1];
    const Doubles near = gradient_dot<D>(hashes, 0, to_point);
    to_point.at[D - 1] = way[1][D - 1];
    height[edge] = near + weight[D - 1] * (gradient_dot<D>(hashes, 32, to_point) - near);
  }
  for (int axis = D - 2; axis >= 0; --axis)
    for (int k = 0; k < 1 << axis; ++k)
      height[k] = height[2 * k] + weight[axis] * (height[2 * k + 1] - height[2 * k]);
  return height[0];
}

/// In about [-1, 1], repeated every 100000 units. From a million units on it is read half a unit
/// aside, as Cycles does.
template <int D>
inline Doubles signed_noise(NoisePoint<D> p) {
  for (Doubles& x : p.at)
    if (!all(magnitude(x) < kNoisePeriod))
      x = fmod(x, splat(kNoisePeriod)) + where(magnitude(x) >= 1e6, splat(0.5));
  return kSignedScale[D] * perlin<D>(p);
}

/// Share of an octave: 1 for whole ones, then the detail's fraction, then 0.
inline Doubles octave_share(Doubles detail, int octave) {
  return smaller(larger(detail - octave + 1, splat(0)), splat(1));
}

/// Sum of octaves, of detail + 1 of them; normalised it is divided by the sum of amplitudes, 0
/// where these cancel out, and brought to [0, 1].
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
    const Doubles now = normalized ? choose(most != 0, total / most, splat(0)) : total;
    value = choose(heard, value + share * (now - value), value);
    amplitude = amplitude * roughness;
    p = p * lacunarity;
  }
  return normalized ? 0.5 * value + 0.5 : value;
}

}  // namespace
}  // namespace glint
