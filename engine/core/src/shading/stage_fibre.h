// Directions drawn from the FIBRE lobes of points. Letters as in stage_highlights.h.
#pragma once
#include "shading/stage_highlights.h"

namespace glint {
namespace {

/// How directions are drawn from one FIBRE lobe: along the strand the tangent of half the angle to
/// the mirrored cone is Student's of two degrees of freedom, round it that of half the angle to
/// the viewer, or to behind, Cauchy's. Both have closed forms, and tails above any power of a
/// cosine.
struct FibreSampling {
  Three t, v;
  Doubles to_v, across_v, tilt, way, along2, round2;  // squares of both widths

  FibreSampling(const LightStage& s, size_t k, int number, Doubles kind)
      : v(-load3(s.d, k)),
        way(choose(kind == SpecularTerm::kFibreTransmission, splat(-1), splat(1))) {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
    const double* tangent = column + SpecularTerm::kTangent * s.stride;
    t = unit({load(tangent), load(tangent + s.stride), load(tangent + 2 * s.stride)});
    to_v = dot(t, v);
    across_v = root(larger(1 - to_v * to_v, splat(0)));
    tilt = load(column + SpecularTerm::kTilt * s.stride);
    along2 = 1 / (load(column + SpecularTerm::kMasking * s.stride) + 1);
    const Doubles q = load(column + SpecularTerm::kFresnel * s.stride);
    round2 = 1 / (2 * choose(q > 0, q, splat(1)) + 1);
  }

  /// At the point (x, y) of the unit disc; 0 where it leads beyond the strand's end.
  Three draw(Doubles x, Doubles y) const {
    const Doubles u = smaller(larger(x * x + y * y, splat(0x1p-40)), splat(1 - 0x1p-40)),
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
  Doubles density(const Three& l) const {
    const Doubles to_l = dot(t, l), across_l = root(larger(1 - to_l * to_l, splat(0))),
                  along = (to_l + to_v) + tilt * (across_l + across_v),
                  across = (across_l + across_v) - tilt * (to_l + to_v), a2 = along * along,
                  c2 = across * across, far = 2 * along2 * c2 + a2, both = across_l * across_v,
                  turned = where(both > 0, (dot(l, v) - to_l * to_v) / both),
                  c = way * smaller(larger(turned, splat(-1)), splat(1)),
                  round = root(round2) / (kCircle * (round2 * (1 + c) + (1 - c)));
    return where((across > 0) & (across_l > 0),
                 round * along2 * across * (c2 + a2) / (2 * far * root(far) * across_l));
  }
};

/// Where a ray goes on from strands: from one lobe, chosen by how much they give back; what is even
/// draws evenly over the front's half of the sphere.
struct FibreDrawn {
  Three l;
  Doubles density, left;  // a steradian, of all lobes; what is left of the number that chose
};

inline Doubles size_of(const Three& k) { return magnitude(k.x) + magnitude(k.y) + magnitude(k.z); }

/// The lobe's weight as a round one; 0 of what is even.
inline Doubles fibre_weight(const Term& term) {
  return where(term.exponent < SpecularTerm::kFibreDiffuse, size_of(term.k));
}

inline FibreDrawn draw_fibre(const LightStage& s, size_t k, const Three& n, Doubles number) {
  Doubles even = size_of(load3(s.diffuse, k)), round = splat(0);
  Mask others{};
  for (int i = 0; i < s.max_specular; ++i) {
    const Term term(s, k, i);
    round = round + fibre_weight(term);
    even = even + where(term.exponent == SpecularTerm::kFibreDiffuse, size_of(term.k));
    others |= nonzero(term.k) & (term.exponent < 0) & (term.exponent > SpecularTerm::kFibreDiffuse);
  }
  even = even + where(others, round);
  even = choose(even + round > 0, even, splat(1));
  const Doubles total = even + round;
  const Doubles x = load(s.disc[0] + k), y = load(s.disc[1] + k),
                rest = larger(1 - x * x - y * y, Doubles{}), at = number * total;
  Three t1, t2;
  frame(n, t1, t2);
  FibreDrawn drawn{rest * n + root(1 + rest) * (x * t1 + y * t2), splat(0),
                   where(even > 0, at / even)};
  Doubles before = even;
  for (int i = 0; i < s.max_specular; ++i) {
    const Term term(s, k, i);
    const Doubles weight = fibre_weight(term);
    const Mask here = (at >= before) & (weight > 0);
    if (bits(here)) {
      drawn.l = choose(here, FibreSampling(s, k, i, term.exponent).draw(x, y), drawn.l);
      drawn.left = choose(here, smaller((at - before) / weight, splat(1 - 0x1p-53)), drawn.left);
    }
    before = before + weight;
  }
  drawn.density = where(dot(n, drawn.l) > 0, even * splat(1 / (2 * kCircle)));
  for (int i = 0; i < s.max_specular; ++i) {
    const Term term(s, k, i);
    const Doubles weight = fibre_weight(term);
    if (bits(weight > 0))
      drawn.density =
          drawn.density +
          where(weight > 0, weight * FibreSampling(s, k, i, term.exponent).density(drawn.l));
  }
  drawn.density = drawn.density / total;
  return drawn;
}

}  // namespace
}  // namespace glint
