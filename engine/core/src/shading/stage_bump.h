// How light is hidden where a material bends the normal (semantics/shadows.md): as by the bumps
// that the bent one is of. Letters: n bent normal, m the one that it was bent from, l direction to
// the light.
#pragma once
#include "shading/stage_terminator.h"
#include "simd/lanes.h"

namespace glint {
namespace {

/// What LitPoints' bump holds of a point, by m.n: of GGX alpha^2, at least 0; of Chiang's minus
/// |m.n|; 0 where matt lobes get no less than others.
inline Doubles bump_of(int kind, Doubles mn) {
  const Doubles mn2 = mn * mn;
  if (kind == GLINT_BUMP_CHIANG) return -larger(magnitude(mn), splat(0x1p-60));
  if (kind != GLINT_BUMP_GGX) return splat(0);
  return smaller(larger(0.125 * (1 / mn2 - 1), splat(0)), splat(1));
}

/// The normal n, so far towards g that the direction v is mirrored at it to above the surface
/// (Cycles' ensure_valid_specular_reflection).
inline Three lifted(const Three& n, const Three& g, const Three& v) {
  const Doubles vg = dot(v, g), ng = dot(n, g), t = smaller(0.9 * vg, splat(0.01)),
                mirrored = 2 * dot(n, v) * ng - vg;
  const Three across = unit(n - ng * g), x = choose(nonzero(across), across, n);
  const Doubles vx = dot(v, x), a = vx * vx + vg * vg, b = 2 * (a + vg * t),
                c = (t + vg) * (t + vg), d = root(larger(b * b - 4 * a * c, splat(0))),
                z2 = 0.25 * (b + choose(vx < 0, d, -d)) / a;
  const Three high = root(larger(1 - z2, splat(0))) * x + root(larger(z2, splat(0))) * g;
  return choose((mirrored < t) & (a > 0), high, n);
}

/// Of light along l: where it comes from behind m, and the share of it that matt lobes get, for
/// bumps and where the surface sees it lower.
struct BumpShadow {
  bool some = false;
  Mask hidden{};
  Doubles share = splat(1);
};

/// Whether lights look at more than one normal or angle of a point, or at edges of metals: stages
/// are there twice, so that others pay nothing.
inline bool is_bent(const LitPoints& s) {
  return s.unbent[0] || s.lobes.turns || s.lobes.stretches || s.lobes.edges || s.lowering;
}

/// What the point gives back of light over its normal n is times.
template <bool Bent>
inline Doubles lowered(const LitPoints& s, size_t k, const Three& n, const Three& l) {
  return Bent && s.lowering ? lowered(load(s.lowering + k), dot(n, l)) : splat(1);
}

/// The sides of m and n are those of the viewer and of the light: l is before n.
template <bool Bent>
inline BumpShadow bump_shadow(const LitPoints& s, size_t k, const Three& n, const Three& l) {
  if (!Bent || !(s.unbent[0] || s.lowering)) return {};
  const Doubles low = lowered<Bent>(s, k, n, l);
  if (!s.unbent[0]) return {true, Mask{}, low};
  const Three m = load3(s.unbent, k);
  const Mask bent = nonzero(m);
  if (!bits(bent)) return {s.lowering != nullptr, Mask{}, low};
  const Doubles ml = dot(m, l), bump = load(s.bump + k), cosine = smaller(magnitude(ml), splat(1)),
                // Smith's shadowing of GGX
      ggx = 2 * cosine / (cosine + root(cosine * cosine + bump * (1 - cosine * cosine))),
                g = smaller(cosine / (-bump * magnitude(dot(n, l))), splat(1)),
                chiang = g + g * g - g * g * g;
  const Doubles share = where(cosine > 0, choose(bump < 0, chiang, ggx));
  return {true, bent & (ml * dot(m, n) < 0), low * choose(bent, share, splat(1))};
}

}  // namespace
}  // namespace glint
