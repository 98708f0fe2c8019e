// Functions of numbers that nodes compute, as Cycles defines them: divisions by zero are 0, as are
// roots, logarithms and powers without a real value.
#pragma once
#include "program/functions.h"

namespace glint {
namespace {

/// Of two numbers the lesser; where one is NaN the other.
inline Doubles least(Doubles a, Doubles b) { return choose(b != b, a, smaller(a, b)); }
/// Of two numbers the greater; where one is NaN the other.
inline Doubles most(Doubles a, Doubles b) { return choose(b != b, a, larger(a, b)); }
inline Doubles held_between(Doubles x, Doubles low, Doubles high) {
  return least(most(x, low), high);
}

inline Doubles one_where(Mask m) { return where(m, splat(1)); }
inline Doubles fraction(Doubles a) { return a - down(a); }
inline Doubles sign(Doubles a) { return where(a != 0, choose(a < 0, splat(-1), splat(1))); }

/// a / b, 0 where b is 0.
inline Doubles safe_divide(Doubles a, Doubles b) { return where(b != 0, a / b); }

/// fmod, 0 where b is 0.
inline Doubles safe_modulo(Doubles a, Doubles b) { return where(b != 0, fmod(a, b)); }

inline Doubles floored_modulo(Doubles a, Doubles b) {
  return where(b != 0, a - down(safe_divide(a, b)) * b);
}

/// a to the power b, 0 where a < 0 and b is no whole number that an int of C holds.
inline Doubles safe_power(Doubles a, Doubles b) {
  const Mask whole_b = (down(b) == b) & (b >= -0x1p31) & (b < 0x1p31);
  return where((a >= 0) | (a != a) | whole_b, pow(a, b));
}

/// The logarithm of a to the base b, 0 where either is not positive or b is 1.
inline Doubles safe_logarithm(Doubles a, Doubles b) {
  return where(~((a <= 0) | (b <= 0)), safe_divide(log(a), log(b)));
}

inline Doubles snapped(Doubles a, Doubles b) { return down(safe_divide(a, b)) * b; }

/// a moved by whole multiples of high - low into [low, high); low where they are equal.
inline Doubles wrapped(Doubles a, Doubles high, Doubles low) {
  const Doubles size = high - low;
  return choose(size != 0, a - size * down(safe_divide(a - low, size)), low);
}

/// A triangle wave from 0 at a = 0 to b at a = b; 0 where b is 0.
inline Doubles ping_pong(Doubles a, Doubles b) {
  const Doubles phase = fraction(safe_divide(a - b, b * 2));
  return where(b != 0, magnitude(phase * b * 2 - b));
}

/// min(a, b), rounded off by a cubic where |a - b| < c.
inline Doubles smooth_minimum(Doubles a, Doubles b, Doubles c) {
  const Doubles h = safe_divide(most(c - magnitude(a - b), splat(0)), c);
  return choose(c != 0, least(a, b) - h * h * h * c / 6, least(a, b));
}

/// Whether a and b differ by no more than c, or than float's epsilon.
inline Mask alike(Doubles a, Doubles b, Doubles c) {
  return (a == b) | (magnitude(a - b) <= most(c, splat(0x1p-23)));
}

}  // namespace
}  // namespace glint
