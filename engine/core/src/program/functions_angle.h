// Angles modulo a right angle, for the functions of functions_trig.h.
#pragma once
#include "program/functions_exact.h"

namespace glint {
namespace {

/// pi / 2 = kRightHigh + kRightLow.
constexpr double kRightHigh = 0x1.921fb54442d18p+0, kRightLow = 0x1.1a62633145c07p-54;

/// An angle less `turns` right angles, of which the lowest two bits count: at most pi / 4 in size.
struct Turned {
  Pair rest;
  Mask turns;
};

/// Of one lane: the rest in right angles.
struct TurnedLane {
  double high, low;
  int64_t turns;
};

/// |x| modulo a right angle for 2^20 <= |x| finite (Payne and Hanek 1983): the 53 bits of x times
/// the 192 bits of 2 / pi that matter, as integers. What is cut off is below 2^-137 right angles,
/// and no double is nearer to a multiple than 2^-62.
__attribute__((noinline)) inline TurnedLane turned_far(double x) {
  static constexpr uint64_t two_over_pi[] = {
      0x0000000000000000, 0xa2f9836e4e441529, 0xfc2757d1f534ddc0, 0xdb6295993c439041,
      0xfe5163abdebbc561, 0xb7246e3a424dd2e0, 0x06492eea09d1921c, 0xfe1deb1cb129a73e,
      0xe88235f52ebb4484, 0xe99c7026b45f7e41, 0x3991d639835339f4, 0x9c845f8bbdf9283b,
      0x1ff897ffde05980f, 0xef2f118b5a0a6d1f, 0x6d367ecf27cb09b7, 0x4f463f669e5fea2d,
      0x7527bac7ebe5f17b, 0x3d0739f78a5292ea, 0x6bfb5fb11f8d5d08, 0x56033046fc7b6bab};
  __extension__ typedef unsigned __int128 Wide;
  const uint64_t bits = __builtin_bit_cast(uint64_t, x);
  const uint64_t m = (bits & 0x000fffffffffffff) | 0x0010000000000000;
  const unsigned exponent = unsigned(bits >> 52 & 0x7ff);  // |x| = m 2^(exponent - 1075)

  // Bits of 2 / pi whose product with x is a multiple of four right angles are left out.
  const unsigned first = exponent - 1075 + 62, word = first / 64, shift = first % 64;
  const auto window = [&](unsigned k) {
    const uint64_t* w = two_over_pi + word + k;
    return shift ? w[0] << shift | w[1] >> (64 - shift) : w[0];
  };
  const Wide low = Wide(m) * window(2), middle = Wide(m) * window(1) + uint64_t(low >> 64);
  const uint64_t high = m * window(0) + uint64_t(middle >> 64);

  // The two bits above the point, and the fraction behind it as a signed number of 128 bits.
  const Wide product = Wide(high) << 64 | uint64_t(middle);
  Wide fraction = product << 2 | uint64_t(low) >> 62;
  int64_t turns = int64_t(high >> 62);
  const bool over = fraction >> 127;
  if (over) {
    fraction = -fraction;
    ++turns;
  }

  // Its first 53 bits, and the 53 that follow.
  const int zeros = __builtin_clzll(uint64_t(fraction >> 64) | 1);
  fraction <<= zeros;
  const double unit = __builtin_bit_cast(double, uint64_t(1023 - 53 - zeros) << 52);
  const double sign = over != (x < 0) ? -1 : 1;
  return {sign * double(int64_t(fraction >> 75)) * unit,
          sign * double(int64_t(fraction >> 22 & 0x001fffffffffffff)) * (unit * 0x1p-53),
          x < 0 ? -turns : turns};
}

__attribute__((noinline)) inline void turn_far_lanes(Doubles x, Mask far, Turned& at) {
  Pair fraction = {splat(0), splat(0)};
  for (size_t k = 0; k < kLanes; ++k) {
    if (!far[k]) continue;
    const TurnedLane lane = turned_far(x[k]);
    fraction.high[k] = lane.high;
    fraction.low[k] = lane.low;
    at.turns[k] = lane.turns;
  }
  const Pair p = exact_product(fraction.high, splat(kRightHigh));
  const Doubles low = p.low + (fraction.high * kRightLow + fraction.low * kRightHigh);
  const Pair rest = ordered_sum(p.high, low);
  at.rest = {choose(far, rest.high, at.rest.high), choose(far, rest.low, at.rest.low)};
}

/// x modulo a right angle: below 2^20 by pi / 2 in three parts of 33 bits and a last one, the
/// products with which are exact (Cody and Waite 1980), beyond that lane by lane. NaN for
/// infinities.
inline Turned turned(Doubles x) {
  const Doubles shifted = x * 0x1.45f306dc9c883p-1 + kShift, n = shifted - kShift;
  const Pair a = exact_sum(x - n * 0x1.921fb54400000p+0, n * -0x1.0b4611a600000p-34);
  const Pair b = exact_sum(a.high, n * -0x1.3198a2e000000p-69);
  Turned at{ordered_sum(b.high, (a.low + b.low) - n * 0x1.b839a252049c1p-104), Mask(shifted)};
  const Mask far = (magnitude(x) >= 0x1p20) & (magnitude(x) < kInfinite);
  if (any(far)) turn_far_lanes(x, far, at);
  return at;
}

}  // namespace
}  // namespace glint
