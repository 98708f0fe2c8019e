// Vectors of doubles, as wide as the instruction set that this is compiled for: what traversal
// (ray_lanes.h) and shading (lanes.h) share. Everything lives in an anonymous namespace and calls
// no library: a function with a name outside could be shared by the linker with code for a lesser
// machine. A lane never depends on another lane, so that widths give the same bits.
#pragma once
#include <cstdint>
#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE4_1__)
#include <smmintrin.h>
#endif

namespace glint {
namespace {

#if defined(__AVX512F__)
constexpr int kDoubles = 8;  // lanes
#elif defined(__AVX__)
constexpr int kDoubles = 4;
#else
constexpr int kDoubles = 2;
#endif
typedef double Doubles __attribute__((vector_size(8 * kDoubles)));
// What comparisons give: 64 bits a lane, 0 or -1, but of which of C's integers differs between
// compilers and systems.
typedef decltype(Doubles{} < Doubles{}) Longs;

// Unaligned. (GCC 12 sends a __builtin_memcpy through the stack.)
typedef double LooseDoubles __attribute__((vector_size(8 * kDoubles), aligned(8), may_alias));
inline Doubles load(const double* p) { return *reinterpret_cast<const LooseDoubles*>(p); }
inline void store(double* p, Doubles v) { *reinterpret_cast<LooseDoubles*>(p) = v; }
inline Doubles splat(double a) { return a - Doubles{}; }  // -0 stays -0

inline Doubles magnitude(Doubles a) { return Doubles(Longs(a) & INT64_MAX); }

/// The larger and the smaller number; where one is NaN, the second argument.
inline Doubles larger(Doubles a, Doubles b) { return a > b ? a : b; }
inline Doubles smaller(Doubles a, Doubles b) { return a < b ? a : b; }

/// A bit for every lane of a mask.
inline uint32_t bits(Longs mask) {
#if defined(__AVX512F__)
  return uint32_t(_mm512_movepi64_mask(__m512i(mask)));
#elif defined(__AVX__)
  return uint32_t(_mm256_movemask_pd(__m256d(mask)));
#elif defined(__SSE4_1__)
  return uint32_t(_mm_movemask_pd(__m128d(mask)));
#else
  uint32_t b = 0;
  for (int k = 0; k < kDoubles; ++k) b |= uint32_t(mask[k] & 1) << k;
  return b;
#endif
}
inline bool any(Longs mask) { return bits(mask) != 0; }

}  // namespace
}  // namespace glint
