// OREN_NAYAR lobes: what rough matt surfaces give back besides Lambert's share
// (semantics/lobes.md).
#pragma once
#include "program/functions_trig.h"
#include "shading/stage_math.h"

namespace glint {
namespace {

/// What light that a facet throws back at once is times, over Lambert's, for l from before: more
/// where it comes from the viewer's side (Fujii). cosine: n.l.
__attribute__((noinline)) Doubles oren_nayar(Three n, Three d, Three l, Doubles cosine) {
  const Doubles nl = larger(cosine, splat(0)), nv = larger(-dot(n, d), splat(0)),
                s = -dot(l, d) - nl * nv, most = larger(nl, nv);
  return nl * choose(s > 0, s / choose(most > 0, most, splat(1)), s);
}

/// What of light, or of even light to a view, at an angle of that cosine is not given back at once.
__attribute__((noinline)) Doubles lost_once(Doubles cosine) {
  const Doubles c = smaller(larger(cosine, splat(0)), splat(1)), s = root(1 - c * c),
                given =
                    s * (acos(c) - 2.0 / 3 - s * c) + (2.0 / 3) * s * c * (1 + s + s * s) / (1 + s);
  return kNeverLost - given / kCircle;
}

}  // namespace
}  // namespace glint
