// What instances say of light that grazes them (semantics/shadows.md). Letters: x point, g n
// geometric and shading normal, l direction to the light.
#pragma once
#include "program/functions_trig.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// How much of the way to the lifted point shadow rays along l start at: all for light from behind
/// the face, nothing where it stands higher over the surface than what grazes it. LitPoints'
/// grazing: one over the cosine below which light does; 0 for never.
inline Doubles lift_share(Doubles grazing, Doubles nl, Doubles gl) {
  const Doubles over_n = grazing * nl, over_g = grazing * gl,
                share = choose(over_n < 1, 2 - (over_g + over_n), 1 - over_g);
  return where(grazing > 0, smaller(larger(share, splat(0)), splat(1)));
}

/// Where the shadow ray along l leaves the surface, where some faces are smooth.
__attribute__((noinline)) Three smooth_start(const LitPoints& s, size_t k, Three l) {
  const Three origin = load3(s.origin, k), x = load3(s.x, k);
  const Doubles grazing = s.grazing ? load(s.grazing + k) : splat(kGrazing);
  return x + lift_share(grazing, dot(load3(s.n, k), l), dot(load3(s.g, k), l)) * (origin - x);
}

/// Where the shadow ray along l leaves the surface.
__attribute__((always_inline)) inline Three start_towards(const LitPoints& s, size_t k,
                                                          const Three& l) {
  return s.origin[0] == s.x[0] ? load3(s.origin, k) : smooth_start(s, k, l);
}

/// What light is times that the surface sees lower: the cosine of so many times its angle over its
/// own; lowering: at least 1.
inline Doubles lowered(Doubles lowering, Doubles cosine) {
  const Doubles angle = lowering * acos(smaller(larger(cosine, splat(0)), splat(1)));
  const Doubles share = where(angle < kRightHigh, cos(angle) / cosine);
  return choose(lowering > 1, where(cosine > 0, share), splat(1));
}

/// Its mean over the light of an even sky.
inline Doubles mean_lowered(Doubles lowering) {
  const Doubles mean = 2 * (lowering * sin(kRightHigh / lowering) - 1) / (lowering * lowering - 1);
  return choose(lowering > 1, mean, splat(1));
}

/// Its mean over the light of an even sky that gloss shows, masking2 the square of its masking, to
/// who sees it at this cosine: of all of it between two cosines, whose squares have the mean and
/// about the spread of those of the lobe. lowering: above 1.
inline Doubles mean_lowered_gloss(Doubles lowering, Doubles cosine, Doubles masking2) {
  const Doubles least = splat(1e-3), square = cosine * cosine, masking = root(masking2);
  const Doubles wanted = square + (0.48 - square) * masking2 / (masking2 + 0.04),
                middle = smaller(larger(wanted, least), 1 - least),
                spread = smaller(0.7 * masking / (masking + 0.15), smaller(middle, 1 - middle)),
                half = larger(spread, least);
  const auto below = [&](Doubles end) {
    const Doubles t = smaller(acos(root(end)), kRightHigh / lowering);
    return cos(t) * cos(lowering * t) + lowering * sin(t) * sin(lowering * t);
  };
  return (below(middle - half) - below(middle + half)) / (half * (lowering * lowering - 1));
}

}  // namespace
}  // namespace glint
