// Directions sampled from the FIBRE lobes of points. Letters as in stage_highlights.h.
#pragma once
#include "shading/stage_highlights.h"

namespace glint {
namespace {

/// Directions sampled from one FIBRE lobe that is not matt: along the strand the tangent of half
/// the angle to the mirrored cone is Student's of two degrees of freedom, round it that of half the
/// angle to the viewer, or to behind, Cauchy's. Both have closed inverses, and tails above any
/// power of a cosine, so that no weight is without bound (docs/decisions/0068-strands-by-paths.md).
struct FibreSampler {
  Three t, v;
  Doubles tilt, way, along2, round2;  // way: -1 for behind.  squares of both widths

  FibreSampler(const LightStage& s, size_t k, int number, Doubles kind)
      : t(unit(fibre_tangent(s, k, number))),
        v(-load3(s.d, k)),
        way(choose(kind == SpecularTerm::kFibreTransmission, splat(-1), splat(1))) {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
    tilt = load(column + SpecularTerm::kTilt * s.stride);
    along2 = 1 / (load(column + SpecularTerm::kMasking * s.stride) + 1);
    const Doubles q = load(column + SpecularTerm::kFresnel * s.stride);
    round2 = 1 / (2 * choose(q > 0, q, splat(1)) + 1);
  }

  /// Unit, at the point (x, y) of the unit disc; 0 where it leads beyond the strand's end.
  Three sample(Doubles x, Doubles y) const {
    const Doubles to_v = dot(t, v), across_v = root(larger(1 - to_v * to_v, splat(0))),
                  u = smaller(larger(x * x + y * y, splat(0x1p-40)), splat(1 - 0x1p-40)),
                  tan = root(along2 / (2 * u * (1 - u))) * (2 * u - 1),
                  size = 1 / ((1 + tan * tan) * (1 + tilt * tilt)),
                  sine = size * (2 * tan * (1 - tilt * tilt) - 2 * tilt * (1 - tan * tan)),
                  cosine = size * ((1 - tan * tan) * (1 - tilt * tilt) + 4 * tan * tilt),
                  to_l = sine * across_v - cosine * to_v,
                  across_l = cosine * across_v + sine * to_v,
                  aside = choose(magnitude(y) > 0x1p-40, y, splat(0x1p-40)),
                  turn = root(round2) * (root(u) + x) / aside;
    Three e1, e2;
    frame(t, e1, e2);
    const Mask seen = across_v > 0x1p-20;
    e1 = choose(seen, (1 / choose(seen, across_v, splat(1))) * (v - to_v * t), e1);
    e2 = cross(t, e1);
    const Doubles part = way * across_l / (1 + turn * turn);
    return where(across_l > 0, to_l * t + part * ((1 - turn * turn) * e1 + 2 * turn * e2));
  }

  /// A steradian.
  Doubles pdf(const Three& l) const {
    const FibreAngles at(t, tilt, v, l);
    const Doubles a2 = at.along * at.along, c2 = at.across * at.across, far = 2 * along2 * c2 + a2,
                  c = way * smaller(larger(at.turned, splat(-1)), splat(1)),
                  round = root(round2) / (kCircle * (round2 * (1 + c) + (1 - c)));
    return where((at.across > 0) & (at.across_l > 0),
                 round * along2 * at.across * (c2 + a2) / (2 * far * root(far) * at.across_l));
  }
};

/// Where a ray goes on from strands.
struct FibreSample {
  Three l;
  Doubles pdf, left;  // a steradian, of all lobes; what is left of the number that chose one
};

inline Doubles size_of(const Three& k) { return magnitude(k.x) + magnitude(k.y) + magnitude(k.z); }

/// The lobe's weight as a round one; 0 of what is even.
inline Doubles fibre_weight(const Term& term) {
  return where(term.exponent < SpecularTerm::kFibreDiffuse, size_of(term.k));
}

/// One lobe's, chosen by how much each gives back; what is even gives evenly over the front's half
/// of the sphere. number: of [0, 1), that chooses.
inline FibreSample sample_fibre(const LightStage& s, size_t k, const Three& n, Doubles number) {
  Doubles even = size_of(load3(s.diffuse, k)), round = splat(0);
  Mask others{};
  for (int i = 0; i < s.max_specular; ++i) {
    const Term term(s, k, i);
    round = round + fibre_weight(term);
    even = even + where(term.exponent == SpecularTerm::kFibreDiffuse, size_of(term.k));
    others |= nonzero(term.k) & (term.exponent < 0) & (term.exponent > SpecularTerm::kFibreDiffuse);
  }
  even = s.fibres_alone ? splat(0) : even + where(others, round);
  even = choose(even + round > 0, even, splat(1));
  const Doubles total = even + round;
  const Doubles x = load(s.disc[0] + k), y = load(s.disc[1] + k),
                rest = larger(1 - x * x - y * y, Doubles{}), at = number * total;
  Three t1, t2;
  frame(n, t1, t2);
  FibreSample drawn{rest * n + root(1 + rest) * (x * t1 + y * t2), splat(0),
                    where(even > 0, at / even)};
  Doubles before = even;
  for (int i = 0; i < s.max_specular; ++i) {
    const Term term(s, k, i);
    const Doubles weight = fibre_weight(term);
    const Mask here = (at >= before) & (weight > 0);
    if (bits(here)) {
      drawn.l = choose(here, FibreSampler(s, k, i, term.exponent).sample(x, y), drawn.l);
      drawn.left = choose(here, smaller((at - before) / weight, splat(1 - 0x1p-53)), drawn.left);
    }
    before = before + weight;
  }
  drawn.pdf = where(dot(n, drawn.l) > 0, even * splat(1 / (2 * kCircle)));
  for (int i = 0; i < s.max_specular; ++i) {
    const Term term(s, k, i);
    const Doubles weight = fibre_weight(term);
    if (bits(weight > 0))
      drawn.pdf =
          drawn.pdf + where(weight > 0, weight * FibreSampler(s, k, i, term.exponent).pdf(drawn.l));
  }
  drawn.pdf = drawn.pdf / total;
  return drawn;
}

}  // namespace
}  // namespace glint
