// SPECULAR lobes, and MIRROR ones that throw light on to what is matt: Blinn-Phong's power, Smith's
// masking of GGX, a Fresnel factor, stretched or not (semantics/lobes.md). Letters: l direction
// to the light, n shading normal, d ray, h half vector, k number of a group of points.
#pragma once
#include "shading/closure/lobe_row.h"
#include "shading/stage_math.h"
#include "shading/stage_terminator.h"

namespace glint {
namespace {

/// The terms of a group of points whose highlights are narrower than the light.
struct Narrow {
  Doubles least,
      total;  // their exponents are at least that; sum of |k| / (p + 1), 0 where there are none
};

/// One lobe of a group of points.
struct Microfacet : LobeRow {
  Three k;
  Doubles exponent;
  Microfacet(const LitPoints& s, size_t at, int row)
      : LobeRow(s, at, GLINT_SPECULAR, row),
        k(LobeRow::k()),
        exponent(number(MicrofacetRow::kExponent)) {}
  Doubles masking2() const { return number(MicrofacetRow::kMasking); }
  Doubles fresnel() const { return number(MicrofacetRow::kFresnel); }
  /// Its normal; n where it has none of its own.
  Three normal(const Three& n) const {
    const Three own = three(MicrofacetRow::kNormal);
    return choose(nonzero(own), own, n);
  }
  /// How much of it reflects other surfaces, as rays show them: of GGX's masking, all of a metal's.
  /// shown: as LobeColumns has it.
  Doubles reflects(double shown) const {
    return where(masking2() > 0, choose(fresnel() > 0, splat(shown), splat(1)));
  }
  Doubles weight(const Narrow& narrow) const {
    return where(exponent >= narrow.least, magnitude(k.x) + magnitude(k.y) + magnitude(k.z));
  }
  /// How many of the drawn directions belong to it, of `total`.
  Doubles part(const Narrow& narrow) const { return weight(narrow) / (exponent + 1); }
};

/// What of a lobe reflects, where that is asked for, of any width.
template <bool Reflecting>
inline Microfacet microfacet(const LitPoints& s, size_t k, int number) {
  Microfacet lobe(s, k, number);
  if constexpr (Reflecting) {
    const Doubles part = lobe.reflects(s.lobes.shown);
    lobe.k = where(part > 0, part * lobe.k);
  }
  return lobe;
}

/// How a lobe is stretched: slopes of half vectors along t are times its length, those across it
/// over that.
struct Stretch {
  Mask some;
  Three t, across;  // n x t
  Doubles size4;    // |t|^4
  Stretch(const Microfacet& lobe, const Three& n)
      : t(lobe.three(MicrofacetRow::kStretch)), across(cross(n, t)) {
    some = nonzero(t);
    const Doubles size2 = choose(some, dot(t, t), splat(1));
    size4 = size2 * size2;
  }
  /// Square of the parts along the surface, stretched as slopes are.
  Doubles slopes2(const Three& v) const {
    const Doubles a = dot(v, t), b = dot(v, across);
    return a * a + b * b / size4;
  }
  /// The same the other way, as alpha is.
  Doubles widths2(const Three& v) const {
    const Doubles a = dot(v, t), b = dot(v, across);
    return a * a / size4 + b * b;
  }
};

/// max(0, cos)^p of slopes that are stretched: of the density of half vectors over theirs (q = 4),
/// or over that of directions that are drawn from it (q = 3).
inline Doubles stretched_highlight(const Slope& at, Doubles stretched_log, Doubles p, double q) {
  return where(at.sharp, exponential(-0.5 * ((p + q) * stretched_log - q * at.log)));
}

/// Of lobes whose exponents are `least` or more.
template <bool Reflecting>
inline Narrow narrow_terms(const LitPoints& s, size_t k, Doubles least) {
  Narrow narrow = {least, Doubles{}};
  for (int number = 0; number < s.lobes.highlights; ++number)
    narrow.total = narrow.total + microfacet<Reflecting>(s, k, number).part(narrow);
  return narrow;
}

/// What highlights give back of light along l, and how densely (a steradian) directions are drawn
/// from them where l is.
struct Shine {
  Three light;
  Doubles density;
};

/// cosine: n.l.  narrow: or null, for no density. Lobes that differ in their Fresnel factor alone
/// share their power. Where some lobes have normals of their own each gives nothing behind its own.
template <bool Reflecting, bool Bent>
__attribute__((always_inline)) inline Shine eval_microfacets(const LitPoints& s, size_t k,
                                                             const Three& n, const Three& l,
                                                             Doubles cosine, const Narrow* narrow) {
  const bool turns = Bent && s.lobes.turns, stretches = Bent && s.lobes.stretches,
             shaped = s.lobes.layout->of[GLINT_SPECULAR].width >= MicrofacetRow::kShaped;
  const Three d = load3(s.d, k), h = l - d;
  const Doubles vh = root(larger(0.5 * (1 - dot(l, d)), splat(0)));
  Slope at = slope(n, h);
  Gloss gloss(cosine, seen_cosine(n, d), vh);
  Three axis = n;  // of `at` and `gloss`
  Doubles exponent = splat(0), power = splat(1);
  Shine sum{};
  for (int number = 0; number < s.lobes.highlights; ++number) {
    const Microfacet lobe = microfacet<Reflecting>(s, k, number);
    if (!any(nonzero(lobe.k))) continue;
    if (turns) {
      const Three own = lobe.normal(n);
      if (bits(nonzero(own - axis))) {
        axis = own;
        at = slope(axis, h);
        gloss = Gloss(dot(axis, l), seen_cosine(axis, d), vh);
        power = highlight(at, exponent);
      }
    }
    if (bits(lobe.exponent != exponent)) {
      exponent = lobe.exponent;
      power = highlight(at, exponent);
    }
    Doubles factor = power, density = power;
    if (shaped) factor = power * gloss.factor<Bent>(lobe.masking2(), lobe.fresnel());
    if (stretches) {
      const Stretch stretch(lobe, axis);
      if (bits(stretch.some)) {
        const Doubles c = dot(axis, h), log = logarithm_of_one_and(stretch.slopes2(h), c * c),
                      given = stretched_highlight(at, log, exponent, 4) *
                              gloss.stretched_factor(lobe.masking2(), lobe.fresnel(),
                                                     stretch.widths2(d), stretch.widths2(l));
        factor = choose(stretch.some, given, factor);
        density = choose(stretch.some, stretched_highlight(at, log, exponent, 3), density);
      }
    }
    if (turns) factor = where(dot(axis, l) > 0, factor);
    if (Bent && s.lowering) factor = lowered(load(s.lowering + k), dot(axis, l)) * factor;
    sum.light = sum.light + factor * lobe.k;
    if (narrow) sum.density = sum.density + density * lobe.weight(*narrow);
  }
  const Doubles size = length(h);
  if (narrow)
    sum.density = where((narrow->total > 0) & (size > 0),
                        sum.density / ((4 * kCircle) * size * narrow->total));
  return sum;
}

/// A point of the unit disc as DiscPlace has it: where in a lobe a direction is drawn.
struct LobePlace {
  Doubles across, along, radius2;
  explicit LobePlace(const DiscPlace& p)
      : across(splat(p.azimuth[0])), along(splat(p.azimuth[1])), radius2(splat(p.radius2)) {}
  LobePlace(Doubles x, Doubles y) : radius2(x * x + y * y) {
    const Doubles r = root(radius2);
    const Mask some = r > 0;
    across = choose(some, x / r, splat(1));
    along = choose(some, y / r, splat(0));
  }
};

/// The direction in which the half vector at a place of the lobes mirrors the ray, and where there
/// is one.
struct Drawn {
  Three l;
  Mask good;
  Doubles narrowest;  // exponent of all lobes that directions are drawn from
};
template <bool Reflecting, bool Bent>
inline Drawn sample_microfacets(const LitPoints& s, size_t k, const Three& n, const Narrow& narrow,
                                const LobePlace& place) {
  const Doubles at = place.radius2 * narrow.total;
  Doubles before{}, rest{}, exponent{}, narrowest{};
  Three axis = n, stretch{};
  for (int number = 0; number < s.lobes.highlights; ++number) {
    const Microfacet lobe = microfacet<Reflecting>(s, k, number);
    const Doubles part = lobe.part(narrow);
    const Mask here = (part > 0) & (at >= before);
    rest = choose(here, (at - before) / part, rest);
    exponent = choose(here, lobe.exponent, exponent);
    narrowest = larger(narrowest, where(part > 0, lobe.exponent));
    if (Bent && s.lobes.turns) axis = choose(here, lobe.normal(n), axis);
    if (Bent && s.lobes.stretches) stretch = choose(here, Stretch(lobe, n).t, stretch);
    before = before + part;
  }
  rest = smaller(rest, splat(1 - 0x1p-53));
  const Doubles cosine2 = exponential(-2 * logarithm_of_one_and(rest, 1 - rest) / (exponent + 1));
  Three t1, t2;
  frame(axis, t1, t2);
  Three h = root(cosine2) * axis + root(1 - cosine2) * (place.across * t1 + place.along * t2);
  if (Bent && s.lobes.stretches) {
    const Mask some = nonzero(stretch);
    const Doubles size2 = choose(some, dot(stretch, stretch), splat(1));
    const Three aside = place.across / size2 * stretch + place.along * cross(axis, stretch);
    h = choose(some, unit(root(cosine2) * axis + root(1 - cosine2) * aside), h);
  }
  const Three d = load3(s.d, k);
  const Doubles c = dot(d, h);
  return {d - 2 * c * h, (narrow.total > 0) & (c < 0), narrowest};
}

/// About what gloss gives back of even light, as it does straight from above and where it mirrors;
/// ever less slanting the wider the lobe. Less what rays show, and metals' where any do.
inline Three microfacet_albedo(const LitPoints& s, size_t k) {
  const Doubles seen = seen_cosine(load3(s.n, k), load3(s.d, k));
  const bool shaped = s.lobes.layout->of[GLINT_SPECULAR].width >= MicrofacetRow::kShaped;
  Three sum{};
  for (int number = 0; shaped && number < s.lobes.highlights; ++number) {
    const Microfacet lobe(s, k, number);
    const Doubles masking2 = lobe.masking2(), fresnel = lobe.fresnel(), p = lobe.exponent;
    const Mask good = masking2 > 0, dielectric = good & (fresnel > 0);
    if (!any((s.lobes.shows_nothing ? good : dielectric) & nonzero(lobe.k))) continue;
    if (s.lobes.shows_nothing) {
      sum = sum + where(good, of_even_light(seen, p, masking2, fresnel) * lobe.k);
      continue;
    }
    const Doubles rest = 1 - splat(s.lobes.shown);
    sum = sum + where(dielectric, rest * of_even_light<false>(seen, p, masking2, fresnel) * lobe.k);
  }
  return sum;
}

}  // namespace
}  // namespace glint
