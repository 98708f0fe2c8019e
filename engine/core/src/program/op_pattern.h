// Checker, gradient, wave, magic and brick textures.
#pragma once
#include "program/functions.h"
#include "program/machine.h"
#include "program/perlin.h"

namespace glint {
namespace {

/// Moves points a little, so that rounding does not decide about those at whole numbers.
inline Doubles off_whole_numbers(Doubles x) { return (x + 0.000001) * 0.999999; }

inline Mask is_odd(Doubles integer) { return fmod(integer, splat(2)) != 0; }

inline Doubles between_zero_and_one(Doubles x) { return smaller(larger(x, splat(0)), splat(1)); }

inline void put_grey(const Operands& at, size_t k, Doubles factor) {
  at.put(0, k, Three{factor, factor, factor});
  at.put(1, k, factor);
}

inline Doubles smooth_step(Doubles x) {
  const Doubles r = between_zero_and_one(x);
  return r * r * (3 - 2 * r);
}

/// From 1 in the centre to 0: a little less than 1, so that unit vectors give exactly 0.
inline Doubles within_sphere(const Three& p) { return larger(0.999999 - length(p), splat(0)); }

template <class Shape>
inline void each_gradient(const Machine& m, const Operands& at, Shape shape) {
  each_group(m, [&](size_t k) { put_grey(at, k, between_zero_and_one(shape(at.vector(0, k)))); });
}

constexpr double kPi = 0x1.921fb54442d18p+1;

enum GradientType { kLinear, kQuadratic, kEasing, kDiagonal, kRadial, kQuadraticSphere };

enum WaveType { kBands, kRings };
enum WaveDirection { kAlongX, kAlongY, kAlongZ, kAllAxes };
enum WaveProfile { kSine, kSaw };

/// The way along the waves, 2 pi each.
inline Doubles wave_phase(const Three& p, int32_t type, int32_t direction) {
  if (type == kBands) switch (direction) {
      case kAlongX: return p.x * 20;
      case kAlongY: return p.y * 20;
      case kAlongZ: return p.z * 20;
      default: return (p.x + p.y + p.z) * 10;
    }
  switch (direction) {
    case kAlongX: return root(p.y * p.y + p.z * p.z) * 20;
    case kAlongY: return root(p.x * p.x + p.z * p.z) * 20;
    case kAlongZ: return root(p.x * p.x + p.y * p.y) * 20;
    default: return length(p) * 20;
  }
}

inline Doubles wave_profile(Doubles phase, int32_t profile) {
  if (profile == kSine) return 0.5 + 0.5 * sin(phase - 0.5 * kPi);
  const Doubles turns = phase / (2 * kPi);
  return profile == kSaw ? turns - down(turns) : 2 * magnitude(turns - down(turns + 0.5));
}

/// Sines of one component by the others: component axis becomes
/// sign wave(x signs[0] + y signs[1] + z signs[2]).
struct MagicStep {
  int axis;
  bool sine;
  double sign, signs[3];
};
constexpr MagicStep kMagicSteps[] = {
    {1, false, -1, {1, -1, 1}},  {0, false, 1, {1, -1, -1}}, {2, true, 1, {-1, -1, -1}},
    {0, false, -1, {-1, 1, -1}}, {1, true, -1, {-1, 1, 1}},  {1, false, -1, {-1, 1, 1}},
    {0, false, 1, {1, 1, 1}},    {2, true, 1, {1, 1, -1}},   {0, false, -1, {-1, -1, 1}},
    {1, true, -1, {1, -1, 1}},
};
/// 2 pi rounded to float32, by which Cycles wraps: far out its phase differs from that by 2 pi.
constexpr double kMagicPeriod = 0x1.921fb6p+2;

inline Three magic_start(const Three& p) {
  const Doubles x = fmod(p.x, splat(kMagicPeriod)), y = fmod(p.y, splat(kMagicPeriod)),
                z = fmod(p.z, splat(kMagicPeriod));
  return {sin((x + y + z) * 5), cos((-x + y - z) * 5), -cos((-x - y + z) * 5)};
}

inline void magic_step(const MagicStep& step, Doubles distortion, Three& p) {
  const Doubles sum = step.signs[0] * p.x + step.signs[1] * p.y + step.signs[2] * p.z;
  const Doubles wave = step.sign * (step.sine ? sin(sum) : cos(sum)) * distortion;
  (step.axis == 0 ? p.x : step.axis == 1 ? p.y : p.z) = wave;
}

/// A number in [0, 1] of each brick.
inline Doubles brick_noise(Doubles row, Doubles brick) {
  Numbers n = (modulo_words(row) << 16) + (modulo_words(brick) & 0xffffu);
  n = (n + 1013u) & 0x7fffffffu;
  n = (n >> 13) ^ n;
  n = (n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
  const Singles single = __builtin_convertvector(Whole(n), Singles);
  return 0.5 * (__builtin_convertvector(single, Doubles) / 0x1p30);
}

struct Brick {
  Doubles tint, to_edge;
};

/// frequencies: of the rows that are shifted and of those that are squashed.
inline Brick brick_at(const Three& p, Doubles bias, Doubles width, Doubles height, Doubles offset,
                      Doubles squash, const int32_t* frequencies) {
  const Doubles row = finite_or_zero(down(p.y / height));
  Doubles shift = splat(0);
  if (frequencies[0] && frequencies[1]) {
    width = width * choose(fmod(row, splat(frequencies[1])) != 0, splat(1), squash);
    shift = choose(fmod(row, splat(frequencies[0])) != 0, splat(0), width * offset);
  }
  const Doubles brick = finite_or_zero(down((p.x + shift) / width));
  const Doubles x = p.x + shift - width * brick, y = p.y - height * row;
  return {between_zero_and_one(brick_noise(row, brick) + bias),
          smaller(smaller(x, y), smaller(width - x, height - y))};
}

/// Share of mortar by the way to the brick's nearest edge.
inline Doubles mortar_share(Doubles to_edge, Doubles size, Doubles smooth) {
  const Doubles soft = smooth_step((1 - to_edge / size) / smooth);
  return choose(to_edge >= size, splat(0), choose(smooth == 0, splat(1), soft));
}

namespace op {

inline void checker_texture(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Three p = at.number(3, k) * at.vector(0, k);
    const Mask x = is_odd(down(off_whole_numbers(p.x))), y = is_odd(down(off_whole_numbers(p.y))),
               z = is_odd(down(off_whole_numbers(p.z))), first = (x == y) == z;
    at.put(0, k, choose(first, at.vector(1, k), at.vector(2, k)));
    at.put(1, k, where(first, splat(1)));
  });
}

inline void gradient_texture(const Machine& m, const Operands& at) {
  switch (at.settings[0]) {
    case kLinear: return each_gradient(m, at, [](const Three& p) { return p.x; });
    case kQuadratic:
      return each_gradient(m, at, [](const Three& p) {
        const Doubles r = larger(p.x, splat(0));
        return r * r;
      });
    case kEasing: return each_gradient(m, at, [](const Three& p) { return smooth_step(p.x); });
    case kDiagonal: return each_gradient(m, at, [](const Three& p) { return (p.x + p.y) * 0.5; });
    case kRadial:
      return each_gradient(m, at, [](const Three& p) { return atan2(p.y, p.x) / (2 * kPi) + 0.5; });
    case kQuadraticSphere:
      return each_gradient(m, at, [](const Three& p) {
        const Doubles r = within_sphere(p);
        return r * r;
      });
    default: return each_gradient(m, at, within_sphere);
  }
}

inline void wave_texture(const Machine& m, const Operands& at) {
  const int32_t type = at.settings[0], direction = at.settings[1], profile = at.settings[2];
  each_group(m, [&](size_t k) {
    const Three q = at.number(1, k) * at.vector(0, k);
    const Three p{off_whole_numbers(q.x), off_whole_numbers(q.y), off_whole_numbers(q.z)};
    Doubles phase = wave_phase(p, type, direction) + at.number(6, k);
    const Doubles distortion = at.number(2, k);
    if (any(distortion != 0)) {
      // Between -1 and 0 it is one octave and the fraction of the next, as in Cycles.
      const Doubles given = at.number(3, k),
                    octaves = choose((given < 0) & (given > -1), given + 1, given),
                    detail = smaller(larger(octaves, splat(0)), splat(15));
      const Doubles noise = fbm<3>(NoisePoint<3>{{p.x, p.y, p.z}} * at.number(4, k), detail,
                                   at.number(5, k), splat(2), true);
      phase = choose(distortion != 0, phase + distortion * (2 * noise - 1), phase);
    }
    put_grey(at, k, wave_profile(phase, profile));
  });
}

inline void magic_texture(const Machine& m, const Operands& at) {
  const int32_t depth = at.settings[0];
  each_group(m, [&](size_t k) {
    const Doubles distortion = at.number(2, k);
    Three p = magic_start(at.number(1, k) * at.vector(0, k));
    if (depth > 0) p = distortion * p;
    for (int32_t i = 0; i < depth; ++i) magic_step(kMagicSteps[i], distortion, p);
    const Doubles twice = choose(distortion != 0, 2 * distortion, splat(1));
    const Three color{0.5 - p.x / twice, 0.5 - p.y / twice, 0.5 - p.z / twice};
    at.put(0, k, color);
    at.put(1, k, (color.x + color.y + color.z) / 3);
  });
}

inline void brick_texture(const Machine& m, const Operands& at) {
  each_group(m, [&](size_t k) {
    const Brick brick =
        brick_at(at.number(4, k) * at.vector(0, k), at.number(7, k), at.number(8, k),
                 at.number(9, k), at.number(10, k), at.number(11, k), at.settings);
    const Doubles factor = mortar_share(brick.to_edge, at.number(5, k), at.number(6, k));
    // Full mortar hides the brick whatever its tint: only one product counts then.
    const Three first = at.vector(1, k);
    const Three mixed = (1 - brick.tint) * first + brick.tint * at.vector(2, k);
    const Three color = choose(factor != 1, mixed, first);
    at.put(0, k, (1 - factor) * color + factor * at.vector(3, k));
    at.put(1, k, factor);
  });
}

}  // namespace op
}  // namespace
}  // namespace glint
