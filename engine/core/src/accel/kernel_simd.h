// Vectors of floats, as wide as the instruction set that this is compiled for. Everything in the kernel_*.h headers lives in an anonymous
// namespace and calls no library: a function with a name outside could be shared by the linker with code for a lesser machine.
#pragma once
#include <cstdint>
#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE4_1__)
#include <smmintrin.h>
#endif

namespace glint {
namespace {

#if defined(__AVX__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif
typedef float Floats __attribute__((vector_size(4 * kLanes)));
typedef int32_t Ints __attribute__((vector_size(4 * kLanes)));

typedef float Four __attribute__((vector_size(16)));
typedef int32_t FourInts __attribute__((vector_size(16)));
inline void store(float* p, Four v) { __builtin_memcpy(p, &v, sizeof v); }

// Unaligned. (GCC 12 sends a __builtin_memcpy through the stack.)
typedef float LooseFloats __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
inline Floats load(const float* p) { return *reinterpret_cast<const LooseFloats*>(p); }
inline void store_lanes(float* p, Floats v) { *reinterpret_cast<LooseFloats*>(p) = v; }
inline Floats splat(float a) { return a - Floats{}; }  // -0 stays -0

/// The larger and the smaller number; where one is NaN, the second argument.
#if defined(__AVX__)
inline Floats larger(Floats a, Floats b) { return Floats(_mm256_max_ps(__m256(a), __m256(b))); }
inline Floats smaller(Floats a, Floats b) { return Floats(_mm256_min_ps(__m256(a), __m256(b))); }
inline uint32_t bits(Ints mask) { return uint32_t(_mm256_movemask_ps(__m256(mask))); }
#elif defined(__SSE4_1__)
inline Floats larger(Floats a, Floats b) { return Floats(_mm_max_ps(__m128(a), __m128(b))); }
inline Floats smaller(Floats a, Floats b) { return Floats(_mm_min_ps(__m128(a), __m128(b))); }
inline uint32_t bits(Ints mask) { return uint32_t(_mm_movemask_ps(__m128(mask))); }
#else
inline Floats larger(Floats a, Floats b) {
  Ints m = a > b;
  return Floats((Ints(a) & m) | (Ints(b) & ~m));
}
inline Floats smaller(Floats a, Floats b) {
  Ints m = a < b;
  return Floats((Ints(a) & m) | (Ints(b) & ~m));
}
inline uint32_t bits(Ints mask) {
  uint32_t b = 0;
  for (int k = 0; k < kLanes; ++k) b |= uint32_t(mask[k] & 1) << k;
  return b;
}
#endif

}  // namespace
}  // namespace glint
