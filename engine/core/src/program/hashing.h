// Jenkins' lookup3 hashes over lanes, as Cycles uses them for textures (util/hash.h).
#pragma once
#include "simd/lanes.h"

namespace glint {
namespace {

/// Two words of 32 bits in each lane.
typedef uint32_t PairedNumbers __attribute__((vector_size(8 * kLanes)));

/// a, b, c of lookup3. Vector: of words of 32 bits.
template <class Vector>
struct HashState {
  Vector a, b, c;

  static Vector rotated(Vector word, int by) { return (word << by) | (word >> (32 - by)); }

  void mix() {
    for (const int by : {4, 6, 8, 16, 19, 4}) {
      a = (a - c) ^ rotated(c, by);
      c = c + b;
      const Vector last = a;
      a = b;
      b = c;
      c = last;
    }
  }
  Vector finish() {
    for (const int by : {14, 11, 25, 16, 4, 14, 24}) {
      c = (c ^ b) - rotated(b, by);
      const Vector first = a;
      a = b;
      b = c;
      c = first;
    }
    return b;
  }
};

template <class Vector, int N>
inline Vector hash_words(const Vector (&word)[N]) {
  static_assert(N >= 1 && N <= 4);
  const Vector start = Vector{} + (0xdeadbeefu + 13 + 4 * N);
  HashState<Vector> s{start, start, start};
  s.a = s.a + word[0];
  if constexpr (N > 1) s.b = s.b + word[1];
  if constexpr (N > 2) s.c = s.c + word[2];
  if constexpr (N > 3) {
    s.mix();
    s.a = s.a + word[3];
  }
  return s.finish();
}

/// An integer modulo 2^32; 0 where it is not finite.
inline Numbers modulo_words(Doubles integer) {
  const Doubles rest = integer - 0x1p32 * down(integer / 0x1p32);
  return __builtin_convertvector(Mask(finite_or_zero(rest) + 0x1p52), Numbers);
}

/// The bits of a number as float32.
inline Numbers single_bits(Doubles a) { return Numbers(__builtin_convertvector(a, Singles)); }

/// In [0, 1]: the word rounded to float32, over 2^32.
inline Doubles hash_fraction(Numbers word) {
  const Mask bits = __builtin_convertvector(word, Mask) | Mask(splat(0x1p52));
  const Singles rounded = __builtin_convertvector(Doubles(bits) - 0x1p52, Singles);
  return __builtin_convertvector(rounded, Doubles) * 0x1p-32;
}

/// A hash in [0, 1] of one to four numbers, by their bits as float32.
template <class... Number>
inline Doubles hash_numbers(Number... number) {
  return hash_fraction(hash_words({single_bits(number)...}));
}

}  // namespace
}  // namespace glint
