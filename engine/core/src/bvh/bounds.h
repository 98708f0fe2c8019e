// Boxes for the builder, four floats at a time.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "math/vec.h"

namespace glint {

typedef float F4 __attribute__((vector_size(16)));
typedef int32_t I4 __attribute__((vector_size(16)));

#if defined(__SSE2__)
inline F4 lower(F4 a, F4 b) { return F4(_mm_min_ps(__m128(a), __m128(b))); }
inline F4 upper(F4 a, F4 b) { return F4(_mm_max_ps(__m128(a), __m128(b))); }
#else
inline F4 lower(F4 a, F4 b) {
  return F4{a[0] < b[0] ? a[0] : b[0], a[1] < b[1] ? a[1] : b[1], a[2] < b[2] ? a[2] : b[2], 0};
}
inline F4 upper(F4 a, F4 b) {
  return F4{a[0] > b[0] ? a[0] : b[0], a[1] > b[1] ? a[1] : b[1], a[2] > b[2] ? a[2] : b[2], 0};
}
#endif
/// Whether a lane of a mask is set.
#if defined(__SSE2__)
inline bool any(I4 mask) { return _mm_movemask_ps(__m128(mask)) != 0; }
#else
inline bool any(I4 mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
#endif
inline F4 splat(float a) { return F4{a, a, a, a}; }

/// Lane 3 means nothing. Starts empty.
struct Box {
  F4 lo = splat(std::numeric_limits<float>::infinity()),
     hi = splat(-std::numeric_limits<float>::infinity());
  void add(F4 p) {
    lo = lower(lo, p);
    hi = upper(hi, p);
  }
  void add(const Box& b) {
    lo = lower(lo, b.lo);
    hi = upper(hi, b.hi);
  }
};

/// A primitive on its way into a tree: its box and what it is. `source` numbers the arrays that it
/// comes from.
struct alignas(16) Ref {
  float lo[3];
  uint32_t primitive;
  float hi[3];
  uint32_t source;
};

inline F4 load(const float* p) {
  F4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline F4 low(const Ref& r) { return load(r.lo); }
inline F4 high(const Ref& r) { return load(r.hi); }

/// Without the number in lane 3: as a float it is denormal, and arithmetic on those is slow.
inline F4 xyz(F4 v) { return F4(I4(v) & I4{-1, -1, -1, 0}); }
/// Middle of the box.
inline F4 centroid(const Ref& r) { return splat(0.5f) * xyz(low(r)) + splat(0.5f) * xyz(high(r)); }
inline F4 extent(const Box& b) { return xyz(b.hi) - xyz(b.lo); }

/// The next float outside of a double.
inline float round_down(double a) {
  float f = float(a);
  return double(f) > a ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
inline float round_up(double a) { return -round_down(-a); }

/// Box in double, for what does not consist of float vertices.
struct BoxD {
  Vec3d lo{HUGE_VAL, HUGE_VAL, HUGE_VAL}, hi{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  void add(Vec3d p) {
    lo = min(lo, p);
    hi = max(hi, p);
  }
};

/// Adding 0 turns -0 into +0: of those two the smaller one would depend on the order of comparison.
inline Ref make_ref(const Box& b, uint32_t primitive, uint32_t source) {
  const F4 lo = b.lo + splat(0), hi = b.hi + splat(0);
  return {{lo[0], lo[1], lo[2]}, primitive, {hi[0], hi[1], hi[2]}, source};
}
inline Ref make_ref(const BoxD& b, uint32_t primitive, uint32_t source) {
  return make_ref(Box{F4{round_down(b.lo.x), round_down(b.lo.y), round_down(b.lo.z), 0},
                      F4{round_up(b.hi.x), round_up(b.hi.y), round_up(b.hi.z), 0}},
                  primitive, source);
}

}  // namespace glint
