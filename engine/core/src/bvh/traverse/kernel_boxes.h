// Rays one by one against the boxes of nodes, and what each of them leaves for later.
#pragma once
#include "bvh/traverse/kernel_frustum.h"
#include "simd/broad.h"

namespace glint {
namespace {

/// A tile's rays as boxes are tested against them, by column: they meet a plane where `inverse`
/// times it and `near_at` or `far_at` come to. Slabs are ordered by the direction's signs. Where a
/// ray begins and ends is in the tile.
struct BoxRays {
  alignas(64) float near_at[3][kTile], far_at[3][kTile], inverse[3][kTile];
  uint32_t near_plane[3][kTile];  // offsets in Node::planes; of the far plane: ^ kWidth
  uint32_t ready = 0;             // groups whose numbers are there

  /// For these rays of a tile, and others of their groups.
  void prepare(const Tile& tile, uint64_t rays) {
    constexpr uint64_t kGroup = (uint64_t(1) << kFloats) - 1;
    for (int g = 0; g < kGroups; ++g)
      if (rays >> g * kFloats & kGroup && !(ready >> g & 1)) {
        set(tile, g * kFloats);
        ready |= 1u << g;
      }
  }
  /// Across, the origin, the slope, its inverse and what the slabs round are 12 u of what the
  /// margin has 20 u of. Rays along a slab get a slope of 2^-60, which leads out of none.
  void set(const Tile& tile, int k) {
    const Ints kind = load(tile.axis_class + k), back = kind & 4;
    for (int a = 0; a < 2; ++a) {
      const Floats slope = load(tile.slope[a] + k), o = load(tile.of[a] + k);
      const Ints sign = Ints(slope) & INT32_MIN;
      const Floats least = Floats(Ints(splat(0x1p-60f)) | sign),
                   steep = 1 / choose(less(magnitude(slope), splat(0x1p-60f)), least, slope);
      const Floats outward = Floats(Ints(splat(tile.margin)) | sign);
      store(near_at[a] + k, -(o + outward) * steep);
      store(far_at[a] + k, (outward - o) * steep);
      store(inverse[a] + k, steep);
      store(near_plane[a] + k, across(kind, a) * (2 * kWidth) + (Ints(sign < 0) & kWidth));
    }
    // Where a ray begins and ends is known to more digits than `start` has: planes ahead of it are
    // near enough, and far enough.
    const Floats start = load(tile.start + k), rest = load(tile.low_part[2] + k),
                 ulps = magnitude(start) * splat(0x1p-23f);
    const Floats sign = Floats(Ints(splat(1.0f)) | (back << 29));
    store(near_at[2] + k, -start - choose(less(Floats{}, rest), ulps, Floats{}));
    store(far_at[2] + k, choose(less(rest, Floats{}), ulps, Floats{}) - start);
    store(inverse[2] + k, sign);
    store(near_plane[2] + k, (kind & 3) * (2 * kWidth) + back * (kWidth / 4));
  }
};

constexpr float kFarther = 1 + 0x1p-20f;  // Ize 2013: two ulps; here eight

/// Which children a ray meets, and how deep.
struct BoxHits {
  Floats near[kWidth / kFloats];
  uint32_t mask = 0;
  __attribute__((always_inline)) BoxHits(const Node& n, const BoxRays& b, const Tile& tile, int r) {
    const uint32_t x = b.near_plane[0][r], y = b.near_plane[1][r], z = b.near_plane[2][r];
    for (int first = 0; first < kWidth; first += kFloats) {
      const float* planes = n.planes[0] + first;
      const auto meet = [&](uint32_t plane, const float (*at)[kTile], int axis) {
        return fused(load(planes + plane), splat(b.inverse[axis][r]), splat(at[axis][r]));
      };
      const Floats near_x = meet(x, b.near_at, 0), near_y = meet(y, b.near_at, 1),
                   near_z = meet(z, b.near_at, 2), far_x = meet(x ^ kWidth, b.far_at, 0),
                   far_y = meet(y ^ kWidth, b.far_at, 1),
                   far_z = meet(z ^ kWidth, b.far_at, 2) * splat(kFarther);
      near[first / kFloats] =
          larger(larger(near_x, near_y), larger(near_z, splat(tile.begin_lo[r])));
      mask |= bits(at_most(near[first / kFloats],
                           smaller(smaller(smaller(far_x, far_y), far_z), splat(tile.hi[r]))))
              << first;
    }
  }
  /// Of a turned node, whose boxes have the margin four times: three of it are what the ray's place
  /// and direction are off by along an axis, which is as long as `turn` has it.
  __attribute__((noinline)) BoxHits(const Node& n, const Tile& tile, int r) {
    const Order& order = order_of(tile, r);
    const auto turned = [&](float x, float y, float z) {
      return axis(n, order.axes[0]) * x + axis(n, order.axes[1]) * y +
             axis(n, order.axes[2]) * (order.sign * z);
    };
    const Four o = turned(tile.of[0][r], tile.of[1][r], tile.start[r]),
               d = turned(tile.slope[0][r], tile.slope[1][r], 1);
    const float outward = 4 * 32768 * tile.margin;
    Floats from = splat(tile.begin_lo[r]), to[kWidth / kFloats];
    for (int k = 0; k < kWidth / kFloats; ++k) {
      near[k] = from;
      to[k] = splat(tile.hi[r]);
    }
    for (int a = 0; a < 3; ++a) {
      const float slope = magnitude(d[a]) < 0x1p-60f ? (d[a] < 0 ? -0x1p-60f : 0x1p-60f) : d[a],
                  steep = 1 / slope, out = slope < 0 ? -outward : outward;
      const Floats inverse = splat(steep), near_at = splat(-(o[a] + out) * steep),
                   far_at = splat((out - o[a]) * steep);
      const float* const low = n.planes[2 * a + (slope < 0)];
      const float* const high = n.planes[2 * a + (slope >= 0)];
      for (int k = 0; k < kWidth / kFloats; ++k) {
        near[k] = larger(near[k], fused(load(low + k * kFloats), inverse, near_at));
        to[k] = smaller(to[k], fused(load(high + k * kFloats), inverse, far_at));
      }
    }
    for (int k = 0; k < kWidth / kFloats; ++k) mask |= bits(at_most(near[k], to[k])) << k * kFloats;
  }

 private:
  typedef float Four __attribute__((vector_size(16)));
  static Four axis(const Node& n, int of) {
    typedef int16_t Short __attribute__((vector_size(8)));
    Short s;
    __builtin_memcpy(&s, n.turn[of], sizeof s);
    return __builtin_convertvector(s, Four);
  }
};

/// A child, and above it the bits of how far away it is: as integers, the nearer is the smaller,
/// and what is behind the start comes first.
using Waiting = int64_t;
constexpr Waiting kBottom = -1;          // below everything that waits
constexpr ChildRef kDone = 0xffffffffu;  // what is at the bottom

inline Waiting waiting(ChildRef child, float distance) {
  int32_t high;
  __builtin_memcpy(&high, &distance, sizeof high);
  return Waiting(high) << 32 | child;
}

/// What waits farther away than `end` is not worth going to. (-0 would be below the bottom.)
inline Waiting limit_of(float end) { return waiting(kDone, larger(end, 0.0f)); }

/// Rays that have left their packets, and which parts of the tree each has yet to visit. They go on
/// together, later.
struct SingleRays {
  uint64_t rays = 0;
  int count = 0;
  Waiting part[kLeftParts];
  int16_t before[kLeftParts], last[kTile];  // the same ray's part that came before; -1: none

  bool full() const { return count > kLeftParts - kFloats; }
  void add(int r, ChildRef child, float distance) {
    before[count] = rays >> r & 1 ? last[r] : int16_t(-1);
    rays |= uint64_t(1) << r;
    part[count] = waiting(child, distance);
    last[r] = int16_t(count++);
  }
  /// A ray's parts on a stack, the first one on top; where the stack ends then.
  Waiting* put(int r, Waiting* top) const {
    for (int k = last[r]; k >= 0; k = before[k]) *top++ = part[k];
    return top;
  }
};

/// Puts the children that are met where `top` is but for the nearest, which it returns. Nobody can
/// foresee how many: no branches where the instruction set can do without. Writes kWidth entries in
/// any case. Without a child that is met the result means nothing.
#if defined(__AVX512F__)
inline Waiting put_met(const Node& n, const BoxHits& met, Waiting* top) {
  const __m512i turns = _mm512_set_epi32(23, 7, 22, 6, 21, 5, 20, 4, 19, 3, 18, 2, 17, 1, 16, 0);
  const __m512i distance = _mm512_castps_si512(_mm512_castps256_ps512(__m256(met.near[0])));
  const __m512i child =
      _mm512_castsi256_si512(_mm256_load_si256(reinterpret_cast<const __m256i*>(n.child)));
  const __m512i all = _mm512_permutex2var_epi32(child, turns, distance);
  const __mmask8 mask = __mmask8(met.mask);
  const __m512i eight = _mm512_mask_mov_epi64(_mm512_set1_epi64(INT64_MAX), mask, all);
  const __m256i four = _mm256_min_epi64(_mm512_maskz_extracti64x4_epi64(0xf, eight, 0),
                                        _mm512_maskz_extracti64x4_epi64(0xf, eight, 1));
  const __m128i two =
      _mm_min_epi64(_mm256_castsi256_si128(four), _mm256_extracti128_si256(four, 1));
  const __m128i nearest = _mm_min_epi64(two, _mm_unpackhi_epi64(two, two));
  const __mmask8 others =
      _mm512_mask_cmpneq_epi64_mask(mask, all, _mm512_maskz_broadcastq_epi64(0xff, nearest));
  _mm512_storeu_si512(top, _mm512_maskz_compress_epi64(others, all));
  return _mm_cvtsi128_si64(nearest);
}
#else
inline Waiting put_met(const Node& n, const BoxHits& met, Waiting* top) {
  alignas(64) Waiting all[kWidth];
  for (int k = 0; k < kWidth / kFloats; ++k)
    store_pairs(all + k * kFloats, load(n.child + k * kFloats), Ints(met.near[k]));
  const uint32_t mask = met.mask, inner = mask & (mask - 1);
  if (!(inner & (inner - 1))) {
    const Waiting a = all[lowest_bit(mask | 1u << (kWidth - 1))],
                  b = all[highest_bit(mask | 1)];  // the same one when there is one
    *top = a < b ? b : a;
    return a < b ? a : b;
  }
  Waiting nearest = all[lowest_bit(mask)];
  for (uint32_t m = inner; m; m &= m - 1) {
    const Waiting a = all[lowest_bit(m)];
    *top++ = a < nearest ? nearest : a;
    nearest = a < nearest ? a : nearest;
  }
  return nearest;
}
#endif

}  // namespace
}  // namespace glint
