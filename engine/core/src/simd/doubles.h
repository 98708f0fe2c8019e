// Vectors of doubles, as wide as the instruction set that this is compiled for: what traversal
// (floats.h) and shading (lanes.h) share. Everything lives in an anonymous namespace and calls no
// library: a function with a name outside could be shared by the linker with code for a lesser
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
constexpr int kLanes = 8;
#elif defined(__AVX__)
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif
typedef double Doubles __attribute__((vector_size(8 * kLanes)));
// What comparisons give: 64 bits a lane, 0 or -1, but of which of C's integers differs between
// compilers and systems.
typedef decltype(Doubles{} < Doubles{}) Longs;
typedef Longs Mask;
// As many numbers of four bytes.
typedef float Singles __attribute__((vector_size(4 * kLanes)));
typedef int32_t Whole __attribute__((vector_size(4 * kLanes)));
typedef uint32_t Numbers __attribute__((vector_size(4 * kLanes)));

// Unaligned. (GCC 12 sends a __builtin_memcpy through the stack.)
typedef double LooseDoubles __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
typedef int64_t LooseLongs __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
typedef float LooseSingles __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
typedef int32_t LooseWhole __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
inline Doubles load(const double* p) { return *reinterpret_cast<const LooseDoubles*>(p); }
inline void store(double* p, Doubles v) { *reinterpret_cast<LooseDoubles*>(p) = v; }
inline Mask load(const int64_t* p) { return *reinterpret_cast<const LooseLongs*>(p); }
inline void store(int64_t* p, Mask v) { *reinterpret_cast<LooseLongs*>(p) = v; }
inline Doubles widen(const float* p) {
  return __builtin_convertvector(*reinterpret_cast<const LooseSingles*>(p), Doubles);
}
inline void narrow(float* p, Doubles v) {
  *reinterpret_cast<LooseSingles*>(p) = __builtin_convertvector(v, Singles);
}
/// With their signs.
inline Longs widen(const uint32_t* p) {
  return __builtin_convertvector(*reinterpret_cast<const LooseWhole*>(p), Longs);
}
/// The lower halves of the lanes.
inline void store_low(uint32_t* p, Longs v) {
  *reinterpret_cast<LooseWhole*>(p) = __builtin_convertvector(v, Whole);
}
inline Doubles splat(double a) { return a - Doubles{}; }  // -0 stays -0

inline Doubles magnitude(Doubles a) { return Doubles(Longs(a) & INT64_MAX); }

/// The larger and the smaller number; where one is NaN, the second argument.
inline Doubles larger(Doubles a, Doubles b) { return a > b ? a : b; }
inline Doubles smaller(Doubles a, Doubles b) { return a < b ? a : b; }

inline Doubles choose(Mask m, Doubles a, Doubles b) { return m ? a : b; }

/// a with its sign changed where `sign` is negative.
inline Doubles flip(Doubles a, Doubles sign) {
  return Doubles(Longs(a) ^ (Longs(sign) & INT64_MIN));
}
inline double flip(double a, double sign) { return __builtin_signbit(sign) ? -a : a; }

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
  for (int k = 0; k < kLanes; ++k) b |= uint32_t(mask[k] & 1) << k;
  return b;
#endif
}
inline bool any(Longs mask) { return bits(mask) != 0; }

}  // namespace
}  // namespace glint
