// Vectors of floats, which traversal has beside those of doubles, and masks of both.
#pragma once
#include "simd/doubles.h"

namespace glint {
namespace {

#if defined(__AVX__)
constexpr int kFloats = 8;
#else
constexpr int kFloats = 4;
#endif
typedef float Floats __attribute__((vector_size(4 * kFloats)));
typedef decltype(Floats{} < Floats{}) Ints;

typedef float LooseFloats __attribute__((vector_size(4 * kFloats), aligned(4), may_alias));
typedef int32_t LooseInts __attribute__((vector_size(4 * kFloats), aligned(4), may_alias));
inline Floats load(const float* p) { return *reinterpret_cast<const LooseFloats*>(p); }
inline void store(float* p, Floats v) { *reinterpret_cast<LooseFloats*>(p) = v; }
inline Ints load(const uint32_t* p) { return *reinterpret_cast<const LooseInts*>(p); }
inline void store(uint32_t* p, Ints v) { *reinterpret_cast<LooseInts*>(p) = v; }
inline Floats splat(float a) { return a - Floats{}; }  // -0 stays -0

inline Floats choose(Ints m, Floats a, Floats b) {
#if defined(__AVX__)
  return Floats(_mm256_blendv_ps(__m256(b), __m256(a), __m256(m)));
#elif defined(__SSE4_1__)
  return Floats(_mm_blendv_ps(__m128(b), __m128(a), __m128(m)));
#else
  return Floats((Ints(a) & m) | (Ints(b) & ~m));
#endif
}
inline Ints choose(Ints m, Ints a, Ints b) { return Ints(choose(m, Floats(a), Floats(b))); }
inline Floats magnitude(Floats a) { return Floats(Ints(a) & 0x7fffffff); }
inline double magnitude(double a) { return __builtin_fabs(a); }
inline float magnitude(float a) { return __builtin_fabsf(a); }

/// The numbers at p + index, index unsigned.
inline Floats read_at(const float* p, Ints index) {
#if defined(__AVX2__)
  // The processor takes the index for signed: half of them lie before the middle.
  const auto middle =
      reinterpret_cast<const float*>(reinterpret_cast<uintptr_t>(p) + (uintptr_t(1) << 33));
  const Ints every = Ints{} - 1;
  return Floats(_mm256_mask_i32gather_ps(_mm256_setzero_ps(), middle, __m256i(index ^ INT32_MIN),
                                         __m256(every), 4));
#else
  Floats v;
  for (int k = 0; k < kFloats; ++k) v[k] = p[uint32_t(index[k])];
  return v;
#endif
}

#if defined(__AVX2__)
/// The numbers at row + place, places modulo kFloats.
inline Floats pick(const float* row, Ints place) {
  return Floats(_mm256_permutevar8x32_ps(__m256(load(row)), __m256i(place)));
}
/// The same modulo 2 kFloats.
inline Floats pick_of_two(const float* row, Ints place) {
#if defined(__AVX512F__)
  return Floats(
      _mm256_permutex2var_ps(__m256(load(row)), __m256i(place), __m256(load(row + kFloats))));
#else
  return choose(place << 28, pick(row + kFloats, place), pick(row, place));
#endif
}
#endif

/// The larger and the smaller number; where one is NaN, the second argument.
inline Floats larger(Floats a, Floats b) {
#if defined(__AVX__)
  return Floats(_mm256_max_ps(__m256(a), __m256(b)));
#elif defined(__SSE4_1__)
  return Floats(_mm_max_ps(__m128(a), __m128(b)));
#else
  return choose(a > b, a, b);
#endif
}
inline Floats smaller(Floats a, Floats b) {
#if defined(__AVX__)
  return Floats(_mm256_min_ps(__m256(a), __m256(b)));
#elif defined(__SSE4_1__)
  return Floats(_mm_min_ps(__m128(a), __m128(b)));
#else
  return choose(a < b, a, b);
#endif
}
inline double larger(double a, double b) { return a > b ? a : b; }
inline double smaller(double a, double b) { return a < b ? a : b; }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smaller(float a, float b) { return a < b ? a : b; }

/// A bit for every lane of a mask.
inline uint32_t bits(Ints mask) {
#if defined(__AVX__)
  return uint32_t(_mm256_movemask_ps(__m256(mask)));
#elif defined(__SSE4_1__)
  return uint32_t(_mm_movemask_ps(__m128(mask)));
#else
  uint32_t b = 0;
  for (int k = 0; k < kFloats; ++k) b |= uint32_t(mask[k] & 1) << k;
  return b;
#endif
}
/// Which lanes of floats, and of doubles, a comparison holds for; false where a number is NaN.
/// AVX-512 has registers for that, and GCC uses them only when it is told to.
#if defined(__AVX512F__)
struct FloatMask {
  __mmask8 lanes;
};
typedef FloatMask DoubleMask;
inline FloatMask operator&(FloatMask a, FloatMask b) { return {__mmask8(a.lanes & b.lanes)}; }
inline FloatMask operator|(FloatMask a, FloatMask b) { return {__mmask8(a.lanes | b.lanes)}; }
inline uint32_t bits(FloatMask m) { return m.lanes; }
inline Floats choose(FloatMask m, Floats a, Floats b) {
  return Floats(_mm256_mask_blend_ps(m.lanes, __m256(b), __m256(a)));
}
inline Ints choose(FloatMask m, Ints a, Ints b) {
  return Ints(_mm256_mask_blend_epi32(m.lanes, __m256i(b), __m256i(a)));
}
inline Doubles choose(DoubleMask m, Doubles a, Doubles b) {
  return Doubles(_mm512_mask_blend_pd(m.lanes, __m512d(b), __m512d(a)));
}
inline FloatMask less(Floats a, Floats b) {
  return {_mm256_cmp_ps_mask(__m256(a), __m256(b), _CMP_LT_OQ)};
}
inline FloatMask at_most(Floats a, Floats b) {
  return {_mm256_cmp_ps_mask(__m256(a), __m256(b), _CMP_LE_OQ)};
}
inline FloatMask equal(Ints a, Ints b) { return {_mm256_cmpeq_epi32_mask(__m256i(a), __m256i(b))}; }
inline FloatMask lanes(uint32_t some) { return {__mmask8(some)}; }
inline DoubleMask less(Doubles a, Doubles b) {
  return {_mm512_cmp_pd_mask(__m512d(a), __m512d(b), _CMP_LT_OQ)};
}
inline DoubleMask at_most(Doubles a, Doubles b) {
  return {_mm512_cmp_pd_mask(__m512d(a), __m512d(b), _CMP_LE_OQ)};
}
inline DoubleMask equal(Doubles a, Doubles b) {
  return {_mm512_cmp_pd_mask(__m512d(a), __m512d(b), _CMP_EQ_OQ)};
}
#else
typedef Ints FloatMask;
typedef Longs DoubleMask;
inline FloatMask less(Floats a, Floats b) { return a < b; }
inline FloatMask at_most(Floats a, Floats b) { return a <= b; }
inline FloatMask equal(Ints a, Ints b) { return a == b; }
inline FloatMask lanes(uint32_t some) {
  Ints each;
  for (int k = 0; k < kFloats; ++k) each[k] = 1 << k;
  return ((Ints{} + int32_t(some)) & each) != Ints{};
}
inline DoubleMask less(Doubles a, Doubles b) { return a < b; }
inline DoubleMask at_most(Doubles a, Doubles b) { return a <= b; }
inline DoubleMask equal(Doubles a, Doubles b) { return a == b; }
#endif

/// The lanes of `some`, one beside the other.
inline Doubles packed(Doubles v, uint32_t some) {
#if defined(__AVX512F__)
  return Doubles(_mm512_maskz_compress_pd(__mmask8(some), __m512d(v)));
#else
  Doubles p{};
  for (int k = 0; some; some &= some - 1) p[k++] = v[__builtin_ctz(some)];
  return p;
#endif
}

inline bool all_zero(Ints v) {
#if defined(__AVX__)
  return _mm256_testz_si256(__m256i(v), __m256i(v));
#elif defined(__SSE4_1__)
  return _mm_testz_si128(__m128i(v), __m128i(v));
#else
  return !bits(Ints(v != Ints{}));
#endif
}

/// The largest and the smallest lane.
inline float largest(Floats v) {
#if defined(__AVX__)
  __m128 a = _mm_max_ps(_mm256_castps256_ps128(__m256(v)), _mm256_extractf128_ps(__m256(v), 1));
  a = _mm_max_ps(a, _mm_movehl_ps(a, a));
  return _mm_cvtss_f32(_mm_max_ss(a, _mm_shuffle_ps(a, a, 1)));
#else
  return larger(larger(v[0], v[1]), larger(v[2], v[3]));
#endif
}
inline float smallest(Floats v) {
#if defined(__AVX__)
  __m128 a = _mm_min_ps(_mm256_castps256_ps128(__m256(v)), _mm256_extractf128_ps(__m256(v), 1));
  a = _mm_min_ps(a, _mm_movehl_ps(a, a));
  return _mm_cvtss_f32(_mm_min_ss(a, _mm_shuffle_ps(a, a, 1)));
#else
  return smaller(smaller(v[0], v[1]), smaller(v[2], v[3]));
#endif
}
/// Those of two vectors.
inline void largest_of_two(Floats v, Floats w, float& p, float& q) {
#if defined(__AVX__)
  const __m256 m = _mm256_max_ps(_mm256_unpacklo_ps(__m256(v), __m256(w)),
                                 _mm256_unpackhi_ps(__m256(v), __m256(w)));
  __m128 a = _mm_max_ps(_mm256_castps256_ps128(m), _mm256_extractf128_ps(m, 1));
  a = _mm_max_ps(a, _mm_movehl_ps(a, a));
  p = a[0];
  q = a[1];
#else
  p = largest(v);
  q = largest(w);
#endif
}
inline void smallest_of_two(Floats v, Floats w, float& p, float& q) {
#if defined(__AVX__)
  const __m256 m = _mm256_min_ps(_mm256_unpacklo_ps(__m256(v), __m256(w)),
                                 _mm256_unpackhi_ps(__m256(v), __m256(w)));
  __m128 a = _mm_min_ps(_mm256_castps256_ps128(m), _mm256_extractf128_ps(m, 1));
  a = _mm_min_ps(a, _mm_movehl_ps(a, a));
  p = a[0];
  q = a[1];
#else
  p = smallest(v);
  q = smallest(w);
#endif
}
/// The lanes of two vectors as the halves of integers.
inline void store_pairs(int64_t* p, Ints low, Ints high) {
  uint32_t* q = reinterpret_cast<uint32_t*>(p);
#if defined(__AVX__)
  store(q, __builtin_shufflevector(low, high, 0, 8, 1, 9, 2, 10, 3, 11));
  store(q + 8, __builtin_shufflevector(low, high, 4, 12, 5, 13, 6, 14, 7, 15));
#else
  store(q, __builtin_shufflevector(low, high, 0, 4, 1, 5));
  store(q + 4, __builtin_shufflevector(low, high, 2, 6, 3, 7));
#endif
}
inline uint32_t lowest_bit(uint32_t mask) { return uint32_t(__builtin_ctz(mask)); }
inline uint32_t highest_bit(uint32_t mask) { return 31 - uint32_t(__builtin_clz(mask)); }
inline float sum(Floats v) {
  float s = 0;
  for (int k = 0; k < kFloats; ++k) s += v[k];
  return s;
}

}  // namespace
}  // namespace glint
