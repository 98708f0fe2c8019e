// Vectors of as many floats as a register holds: twice kFloats with AVX-512, else kFloats. For
// bounds only, which need no common bits: products may be fused with sums.
#pragma once
#include "simd/floats.h"

namespace glint {
namespace {

/// a b + c, rounded once where the instruction set can.
inline Floats fused(Floats a, Floats b, Floats c) {
#if defined(__FMA__)
  return Floats(_mm256_fmadd_ps(__m256(a), __m256(b), __m256(c)));
#else
  return a * b + c;
#endif
}

#if defined(__AVX512F__)
constexpr int kBroad = 16;
typedef float Broad __attribute__((vector_size(4 * kBroad)));
typedef int32_t BroadInts __attribute__((vector_size(4 * kBroad)));
struct BroadMask {
  __mmask16 lanes;
};
// Aligned.
inline Broad load_broad(const float* p) { return Broad(_mm512_load_ps(p)); }
inline void store_broad(float* p, Broad v) { _mm512_store_ps(p, __m512(v)); }
inline Broad spread(float a) { return Broad(_mm512_set1_ps(a)); }
inline Broad fused(Broad a, Broad b, Broad c) {
  return Broad(_mm512_fmadd_ps(__m512(a), __m512(b), __m512(c)));
}
inline Broad magnitude(Broad a) { return Broad(BroadInts(a) & 0x7fffffff); }
inline Broad larger(Broad a, Broad b) {
  return Broad(_mm512_maskz_max_ps(0xffff, __m512(a), __m512(b)));
}
inline Broad smaller(Broad a, Broad b) {
  return Broad(_mm512_maskz_min_ps(0xffff, __m512(a), __m512(b)));
}
inline BroadMask less(Broad a, Broad b) {
  return {_mm512_cmp_ps_mask(__m512(a), __m512(b), _CMP_LT_OQ)};
}
inline BroadMask at_most(Broad a, Broad b) {
  return {_mm512_cmp_ps_mask(__m512(a), __m512(b), _CMP_LE_OQ)};
}
inline BroadMask operator&(BroadMask a, BroadMask b) { return {__mmask16(a.lanes & b.lanes)}; }
inline BroadMask operator|(BroadMask a, BroadMask b) { return {__mmask16(a.lanes | b.lanes)}; }
inline uint32_t bits(BroadMask m) { return m.lanes; }
inline Broad choose(BroadMask m, Broad a, Broad b) {
  return Broad(_mm512_mask_blend_ps(m.lanes, __m512(b), __m512(a)));
}
inline BroadMask broad_lanes(uint32_t some) { return {__mmask16(some)}; }
/// `a` in the lanes of m.
inline void put(uint32_t* p, BroadMask m, uint32_t a) {
  _mm512_mask_store_epi32(p, m.lanes, _mm512_set1_epi32(int(a)));
}
inline float largest(Broad v) {
  const Floats low = __builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7),
               high = __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15);
  return largest(larger(low, high));
}
inline float smallest(Broad v) {
  const Floats low = __builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7),
               high = __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15);
  return smallest(smaller(low, high));
}
inline void largest_of_two(Broad v, Broad w, float& p, float& q) {
  const auto fold = [](Broad a) {
    return larger(Floats(__builtin_shufflevector(a, a, 0, 1, 2, 3, 4, 5, 6, 7)),
                  Floats(__builtin_shufflevector(a, a, 8, 9, 10, 11, 12, 13, 14, 15)));
  };
  largest_of_two(fold(v), fold(w), p, q);
}
inline void smallest_of_two(Broad v, Broad w, float& p, float& q) {
  const auto fold = [](Broad a) {
    return smaller(Floats(__builtin_shufflevector(a, a, 0, 1, 2, 3, 4, 5, 6, 7)),
                   Floats(__builtin_shufflevector(a, a, 8, 9, 10, 11, 12, 13, 14, 15)));
  };
  smallest_of_two(fold(v), fold(w), p, q);
}
inline Broad narrow_broad(const double* p) {
  const Singles low = __builtin_convertvector(load(p), Singles),
                high = __builtin_convertvector(load(p + kLanes), Singles);
  return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}
#else
constexpr int kBroad = kFloats;
typedef Floats Broad;
typedef FloatMask BroadMask;
inline Broad load_broad(const float* p) { return load(p); }
inline void store_broad(float* p, Broad v) { store(p, v); }
inline Broad spread(float a) { return splat(a); }
inline BroadMask broad_lanes(uint32_t some) { return lanes(some); }
inline void put(uint32_t* p, BroadMask m, uint32_t a) {
  store(p, choose(m, Ints{} + int32_t(a), load(p)));
}
inline Broad narrow_broad(const double* p) {
  const Singles low = __builtin_convertvector(load(p), Singles),
                high = __builtin_convertvector(load(p + kLanes), Singles);
#if defined(__AVX__)
  return __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
#else
  return __builtin_shufflevector(low, high, 0, 1, 2, 3);
#endif
}
#endif

}  // namespace
}  // namespace glint
