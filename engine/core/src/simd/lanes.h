// Vectors of doubles for shading, beyond doubles.h: masks, integers, vectors of three.
#pragma once
#include <cstddef>
#include <cstring>

#include "simd/doubles.h"

namespace glint {
namespace {

constexpr uint32_t kAllLanes = (1u << kLanes) - 1;

typedef uint64_t Words __attribute__((vector_size(8 * kLanes)));

/// The vector of of(0), of(1), … (GCC writes a vector lane by lane with a masked instruction each,
/// and this with few.)
template <class Vector = Doubles, class Of>
inline Vector each_lane(Of of) {
#if defined(__AVX512F__)
  return Vector{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
#elif defined(__AVX__)
  return Vector{of(0), of(1), of(2), of(3)};
#else
  return Vector{of(0), of(1)};
#endif
}

/// p[index] of each lane.
inline Doubles read_at(const double* p, Whole index) {
#if defined(__AVX512F__)
  return Doubles(_mm512_i32gather_pd(__m256i(index), p, 8));
#else
  return each_lane([&](size_t lane) { return p[size_t(index[lane])]; });
#endif
}
/// The same of words of four bytes.
inline Whole read_at(const int32_t* p, Whole index) {
#if defined(__AVX512F__)
  return Whole(_mm256_i32gather_epi32(p, __m256i(index), 4));
#elif defined(__AVX2__)
  return Whole(_mm_i32gather_epi32(p, __m128i(index), 4));
#else
  return each_lane<Whole>([&](size_t lane) {
    int32_t word;
    std::memcpy(&word, reinterpret_cast<const char*>(p) + 4 * size_t(index[lane]), 4);
    return word;
  });
#endif
}

inline Doubles where(Mask m, Doubles a) { return Doubles(Mask(a) & m); }  // else 0

#if defined(__AVX512F__)
/// a where the sign of the mask is set, else b: of the mask's other bits any may be set.
inline Doubles by_sign(Mask m, Doubles a, Doubles b) {
  return Doubles(_mm512_mask_blend_pd(_mm512_movepi64_mask(__m512i(m)), __m512d(b), __m512d(a)));
}
inline Doubles root(Doubles a) { return Doubles(_mm512_maskz_sqrt_pd(0xff, __m512d(a))); }
inline Doubles down(Doubles a) {
  return Doubles(_mm512_maskz_roundscale_pd(0xff, __m512d(a), _MM_FROUND_TO_NEG_INF));
}
#elif defined(__AVX__)
inline Doubles by_sign(Mask m, Doubles a, Doubles b) {
  return Doubles(_mm256_blendv_pd(__m256d(b), __m256d(a), __m256d(m)));
}
inline Doubles root(Doubles a) { return Doubles(_mm256_sqrt_pd(__m256d(a))); }
inline Doubles down(Doubles a) { return Doubles(_mm256_floor_pd(__m256d(a))); }
#elif defined(__SSE4_1__)
inline Doubles by_sign(Mask m, Doubles a, Doubles b) {
  return Doubles(_mm_blendv_pd(__m128d(b), __m128d(a), __m128d(m)));
}
inline Doubles root(Doubles a) { return Doubles(_mm_sqrt_pd(__m128d(a))); }
inline Doubles down(Doubles a) { return Doubles(_mm_floor_pd(__m128d(a))); }
#else
inline Doubles by_sign(Mask m, Doubles a, Doubles b) { return m < 0 ? a : b; }
inline Doubles root(Doubles a) {
  for (size_t k = 0; k < kLanes; ++k) a[k] = __builtin_sqrt(a[k]);
  return a;
}
inline Doubles down(Doubles a) {
  for (size_t k = 0; k < kLanes; ++k) a[k] = __builtin_floor(a[k]);
  return a;
}
#endif
inline Whole whole(Doubles a) {
  return __builtin_convertvector(a, Whole);
}  // below 2^31, towards 0
inline Doubles finite_or_zero(Doubles a) { return where(a - a == 0, a); }
inline bool all(Mask m) { return bits(m) == kAllLanes; }

inline Doubles with_sign(Doubles a, Doubles sign) {
  return Doubles((Mask(a) & INT64_MAX) | (Mask(sign) & INT64_MIN));
}

/// The first `count` lanes.
inline Mask first_lanes(size_t count) {
  Mask m = {};
  for (size_t k = 0; k < kLanes; ++k) m[k] = k < count ? -1 : 0;
  return m;
}

/// Lanes of the group that begins at k of a column of `count`.
inline Mask valid_lanes(size_t k, size_t count) {
  return count - k >= kLanes ? ~Mask{} : first_lanes(count - k);
}

/// Whether all lanes of a group hold the same number.
inline bool same(const uint32_t* number) {
  uint32_t different = 0;
  for (size_t lane = 1; lane < kLanes; ++lane) different |= number[lane] ^ number[0];
  return different == 0;
}

struct Three {
  Doubles x, y, z;
};
inline Three load3(const double* const (&p)[3], size_t k) {
  return {load(p[0] + k), load(p[1] + k), load(p[2] + k)};
}
inline void store3(double* const (&p)[3], size_t k, const Three& v) {
  store(p[0] + k, v.x);
  store(p[1] + k, v.y);
  store(p[2] + k, v.z);
}
inline Three splat3(const double* p) { return {splat(p[0]), splat(p[1]), splat(p[2])}; }
inline Three operator+(const Three& a, const Three& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Three operator-(const Three& a, const Three& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Three operator*(const Three& a, const Three& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Three operator*(Doubles s, const Three& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Three operator-(const Three& a) { return {-a.x, -a.y, -a.z}; }
inline Doubles dot(const Three& a, const Three& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Three cross(const Three& a, const Three& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Three choose(Mask m, const Three& a, const Three& b) {
  return {choose(m, a.x, b.x), choose(m, a.y, b.y), choose(m, a.z, b.z)};
}
inline Three where(Mask m, const Three& a) { return {where(m, a.x), where(m, a.y), where(m, a.z)}; }
inline Mask nonzero(const Three& a) { return (a.x != 0) | (a.y != 0) | (a.z != 0); }
inline Doubles max_abs(const Three& a) {
  return larger(magnitude(a.x), larger(magnitude(a.y), magnitude(a.z)));
}

/// The direction of any finite non-zero vector, however short or long; otherwise the zero vector.
/// The same as vec.h's.
__attribute__((always_inline)) inline Three unit(Three a) {
  const Doubles m = max_abs(a);
  const Mask common = (m > 1e-100) & (m < 1e100);
  if (!all(common)) {
    const Mask good = (m > 0) & (m <= 1e308) & (a.x == a.x) & (a.y == a.y) & (a.z == a.z);
    const Doubles s = choose(common | ~good, splat(1), m);
    a = where(good, {a.x / s, a.y / s, a.z / s});
  }
  const Doubles l = root(dot(a, a));
  return choose(l > 0, splat(1) / l, splat(0)) * a;
}

inline Doubles length(const Three& a) { return root(dot(a, a)); }

struct Way {
  Three d;
  Doubles length;
};

/// unit(a) and length(a).
__attribute__((always_inline)) inline Way way(const Three& a) {
  const Doubles m = max_abs(a);
  if (!all((m > 1e-100) & (m < 1e100))) return {unit(a), length(a)};
  const Doubles l = length(a);
  return {choose(l > 0, splat(1) / l, splat(0)) * a, l};
}

/// Two unit vectors that make a frame with n (vec.h).
inline void frame(const Three& n, Three& t1, Three& t2) {
  const Doubles s = with_sign(splat(1), n.z), a = -1 / (s + n.z), b = n.x * n.y * a;
  t1 = {1 + s * n.x * n.x * a, s * b, -s * n.x};
  t2 = {b, s + n.y * n.y * a, -n.y};
}

/// What surface.h calls rounding.
inline Doubles rounding(Doubles size) { return (8 * 0x1p-24) * size; }

/// What surface.h calls beyond.
inline Doubles beyond(Doubles t) { return t + 0x1p-39 * t; }

}  // namespace
}  // namespace glint
