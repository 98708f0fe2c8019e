// Gabor noise (Lagae and others 2009, Tavernier and others 2019, Tricard and others 2019), as
// Cycles.
#pragma once
#include "program/op_pattern.h"

namespace glint {
namespace {

constexpr int kGaborImpulses = 8;  // in each cell

/// A lane's sum of impulses, a complex number.
struct Phasor {
  Doubles real, imaginary;
};

/// What impulses of a point have in common. orientation: z 0 in two dimensions.
struct GaborWave {
  Doubles frequency, isotropy, angle, inclination;
  Three orientation;
};

/// One impulse: of which cell (z unused in two dimensions), and its number times 3.
struct GaborSeed {
  Three cell;
  double number;
};

template <int D>
inline Doubles gabor_hash(const GaborSeed& s, double k) {
  const Doubles w = splat(s.number + k);
  if constexpr (D == 2) return hash_numbers(s.cell.x, s.cell.y, w);
  return hash_numbers(s.cell.x, s.cell.y, s.cell.z, w);
}

/// A second random number of the same seed.
template <int D>
inline Doubles gabor_hash_turned(const GaborSeed& s, double k) {
  const Doubles w = splat(s.number + k);
  if constexpr (D == 2) return hash_numbers(w, s.cell.x, s.cell.y);
  return hash_numbers(s.cell.z, s.cell.x, w, s.cell.y);
}

template <int D>
inline Three gabor_center(const GaborSeed& s) {
  const Doubles x = gabor_hash<D>(s, 1), y = gabor_hash_turned<D>(s, 1);
  if constexpr (D == 2) return {x, y, splat(0)};
  return {x, y, hash_numbers(splat(s.number + 1), s.cell.z, s.cell.y, s.cell.x)};
}

/// In two dimensions the orientation turned by up to a quarter turn either way; in three its angles
/// grow by up to half a turn.
template <int D>
inline Three gabor_direction(const GaborSeed& s, const GaborWave& wave) {
  if constexpr (D == 2) {
    const Doubles angle = wave.angle + (gabor_hash<D>(s, 0) - 0.5) * kPi * wave.isotropy;
    return {cos(angle), sin(angle), splat(0)};
  }
  const Mask straight = wave.isotropy == 0;
  if (all(straight)) return wave.orientation;
  const Doubles inclination = wave.inclination + gabor_hash<D>(s, 0) * kPi * wave.isotropy,
                azimuth = wave.angle + gabor_hash_turned<D>(s, 0) * kPi * wave.isotropy,
                around = sin(inclination);
  return choose(straight, wave.orientation,
                {around * cos(azimuth), around * sin(azimuth), cos(inclination)});
}

/// local: the way from the cell to the point.
template <int D>
inline void add_impulse(const GaborSeed& s, const Three& local, const GaborWave& wave,
                        Phasor& sum) {
  const Three way = local - gabor_center<D>(s);
  const Doubles squared = dot(way, way);
  const Mask near = squared < 1;
  if (!any(near)) return;
  const Doubles envelope = exp(-kPi * squared) * (0.5 + 0.5 * cos(kPi * squared));
  const Doubles angle = 2 * kPi * dot(way, wave.frequency * gabor_direction<D>(s, wave));
  const Doubles weight = choose(gabor_hash<D>(s, 2) < 0.5, -envelope, envelope);
  sum.real = sum.real + where(near, weight * cos(angle));
  sum.imaginary = sum.imaginary + where(near, weight * sin(angle));
}

/// Sum over the cells around the point.
template <int D>
inline Phasor gabor_phasor(const Three& p, const GaborWave& wave) {
  const Three floor{down(p.x), down(p.y), D == 3 ? down(p.z) : splat(0)};
  const Three inside = p - floor;
  Phasor sum{splat(0), splat(0)};
  for (int z = D == 3 ? -1 : 0; z <= (D == 3 ? 1 : 0); ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const Three offset{splat(x), splat(y), splat(z)}, cell = floor + offset;
        for (int i = 0; i < kGaborImpulses; ++i)
          add_impulse<D>({cell, 3.0 * i}, inside - offset, wave, sum);
      }
  return sum;
}

/// most: six standard deviations.
template <int D>
inline void each_gabor(const Machine& m, const Operands& at, double most) {
  each_group(m, [&](size_t k) {
    const Doubles anisotropy = smaller(larger(at.number(3, k), splat(0)), splat(1));
    GaborWave wave{larger(at.number(2, k), splat(0.001)), 1 - anisotropy, at.number(4, k), splat(0),
                   unit(at.vector(5, k))};
    Three p = at.number(1, k) * at.vector(0, k);
    if constexpr (D == 2) {
      p.z = splat(0);
    } else {
      // Cycles takes arc cosines, which lose half of the digits near the axes.
      const Three& o = wave.orientation;
      wave.angle = atan2(o.y, o.x);
      wave.inclination = atan2(root(o.x * o.x + o.y * o.y), o.z);
    }
    const Phasor sum = gabor_phasor<D>(p, wave);
    at.put(0, k, sum.imaginary / most * 0.5 + 0.5);
    at.put(1, k, (atan2(sum.imaginary, sum.real) + kPi) / (2 * kPi));
    at.put(2, k, root(sum.real * sum.real + sum.imaginary * sum.imaginary) / most);
  });
}

namespace op {

inline void gabor_texture(const Machine& m, const Operands& at) {
  if (at.settings[0] == 2) return each_gabor<2>(m, at, 6.0);
  each_gabor<3>(m, at, 0x1.42e77b3041ec2p+2);
}

}  // namespace op
}  // namespace
}  // namespace glint
