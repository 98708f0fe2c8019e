// TOON lobes: even within an angle, and nothing beyond its smooth edge (semantics/lobes.md).
#pragma once
#include "program/functions_trig.h"
#include "shading/closure/lobe_row.h"
#include "shading/stage_math.h"

namespace glint {
namespace {

/// How far a TOON lobe reaches: it is whole up to an angle, and ends where its edge or the horizon
/// does. size, smooth: shares of a right angle.
struct Toon {
  Doubles whole, edge, end;
  Toon(Doubles size, Doubles smooth)
      : whole(kRightHigh * smaller(larger(size, splat(1e-5)), splat(1))),
        edge(kRightHigh * smooth),
        end(smaller(whole + edge, splat(kRightHigh))) {}

  /// Twice 1 - cos of its end, which keeps the light of a uniform world.
  Doubles versine() const {
    const Doubles half = sin(0.5 * end);
    return 4 * half * half;
  }
  /// What it gives back of light at an angle of that cosine.
  Doubles eval(Doubles cosine) const {
    const Doubles angle = acos(smaller(larger(cosine, splat(0)), splat(1))),
                  beside = 1 - (angle - whole) / choose(edge > 0, edge, splat(1)),
                  share = choose(angle < whole, splat(1), where(edge > 0, beside));
    return where(angle < end, share / versine());
  }
  /// What of the light of a uniform world it gives back to all sides.
  Doubles albedo() const {
    const Doubles over = choose(edge > 0, edge, splat(1)), left = 1 - (end - whole) / over,
                  lost = left * cos(end) + (sin(end) - sin(whole)) / over;
    return choose(edge > 0, 2 * (1 - lost) / versine(), splat(1));
  }
};

/// That of a row at a group of points. kind: TOON_DIFFUSE or TOON_SPECULAR.
inline Toon toon(const LitPoints& s, size_t k, int kind, int number) {
  const LobeRow row(s, k, kind, number);
  return {row.number(ToonRow::kSize), row.number(ToonRow::kSmooth)};
}

/// What one gives back of light along l, round n or the mirrored ray; nothing where n is turned
/// away from that. cosine: n.l.
__attribute__((noinline)) Doubles eval_toon(const LitPoints& s, size_t k, int kind, int number,
                                            const Three& n, const Three& d, const Three& l,
                                            Doubles cosine) {
  if (kind == GLINT_TOON_SPECULAR) {
    const Doubles nv = -dot(n, d);
    cosine = where(nv > 0, 2 * nv * cosine + dot(d, l));
  }
  return toon(s, k, kind, number).eval(cosine);
}

}  // namespace
}  // namespace glint
