// SPECULAR lobes, and MIRROR ones that throw light on to what is matt: Blinn-Phong's power, Smith's
// masking of GGX, a Fresnel factor, stretched or not (semantics/lobes.md). Letters: l direction
// to the light, n shading normal, d ray, h half vector, k number of a group of points.
#pragma once
#include "shading/closure/distributions.h"
#include "shading/closure/lobe_row.h"
#include "shading/stage_terminator.h"

namespace glint {
namespace {

/// The terms of a group of points whose highlights are narrower than the light.
struct Narrow {
  Doubles least, total;  // their exponents are at least that; sum of their parts, 0 where there are
                         // none
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
  Doubles distribution() const { return number(MicrofacetRow::kDistribution); }
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
  /// How many of the drawn directions belong to it, of `total`: |k| over 2 pi times what half
  /// vectors are drawn by, integrated.
  Doubles part(const Narrow& narrow, bool shaped) const {
    return weight(narrow) /
           (exponent + (shaped ? choose(distribution() > 0, splat(2), splat(1)) : splat(1)));
  }
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

/// Whether rows of microfacets have a masking, a Fresnel factor and a distribution.
inline bool is_shaped(const LitPoints& s) {
  return s.lobes.layout->of[GLINT_SPECULAR].width >= MicrofacetRow::kShaped;
}

/// A normal, a ray and the half vector of it and a light.
struct Facing {
  Three n, d, h;
};

/// `visible_share` of a lobe. stretch: or null, where it is round.
inline Doubles visible_share(const Slope& at, const Facing& f, Doubles p, const Stretch* stretch) {
  const Three v = seen_from(f.n, -f.d);
  const Doubles nv = smaller(larger(dot(f.n, v), splat(0)), splat(1)),
                vh = larger(dot(v, f.h), splat(0)) / root(at.length2()),
                rest2 = stretch ? stretch->widths2(v) : 1 - nv * nv;
  return visible_share(nv, vh, rest2, p);
}

/// What half vectors weigh in a lobe: its own density of them over that of the normal, and how
/// densely they are drawn from it, over the same.
struct HalfVectors {
  Doubles weight, drawn;

  /// Puts others in their place.
  void set(Mask here, Doubles other_weight, Doubles other_drawn) {
    weight = choose(here, other_weight, weight);
    drawn = choose(here, other_drawn, drawn);
  }
};

/// Of those that have a width, as slopes are. stretch: or null, where the lobe is round.
inline void set_slopes(Slope& at, const Facing& f, Doubles p, Doubles distribution,
                       const Stretch* stretch, HalfVectors& found) {
  const Mask is_ggx = distribution == MicrofacetRow::kGgx,
             is_beckmann = distribution == MicrofacetRow::kBeckmann,
             is_power = distribution == MicrofacetRow::kAshikhminShirley;
  const Doubles slopes2 = stretch ? stretch->slopes2(f.h) : at.sine2;
  if (any(is_ggx)) {
    const Doubles weight = ggx(at, slopes2, p);
    found.set(is_ggx, weight, visible_share(at, f, p, stretch) * weight);
  }
  if (any(is_beckmann)) {
    const Doubles weight = beckmann(at, slopes2, p);
    found.set(is_beckmann, weight, at.cosine / root(at.length2()) * weight);
  }
  if (any(is_power)) {
    const Doubles weight = ashikhmin_shirley(at, slopes2, p);
    found.set(is_power, weight, at.cosine / root(at.length2()) * weight);
  }
}

inline HalfVectors half_vectors(Slope& at, const Facing& f, const Microfacet& lobe, bool shaped) {
  const Doubles p = lobe.exponent, distribution = shaped ? lobe.distribution() : Doubles{};
  HalfVectors found{};
  if (any(distribution == 0)) found.weight = found.drawn = highlight(at, p);
  if (any(distribution > 0)) set_slopes(at, f, p, distribution, nullptr, found);
  return found;
}

/// The same of a lobe whose slopes are stretched.
inline HalfVectors stretched_half_vectors(Slope& at, const Facing& f, const Microfacet& lobe,
                                          const Stretch& stretch) {
  const Doubles p = lobe.exponent, distribution = lobe.distribution();
  HalfVectors found{};
  if (any(distribution == 0)) {
    const Doubles log = logarithm_of_one_and(stretch.slopes2(f.h), at.cosine * at.cosine);
    const auto power = [&](double q) {
      return where(at.sharp, exponential(-0.5 * ((p + q) * log - q * at.log())));
    };
    found = {power(4), power(3)};
  }
  if (any(distribution > 0)) set_slopes(at, f, p, distribution, &stretch, found);
  return found;
}

/// Of lobes whose exponents are `least` or more.
template <bool Reflecting>
inline Narrow narrow_terms(const LitPoints& s, size_t k, Doubles least) {
  const bool shaped = is_shaped(s);
  Narrow narrow = {least, Doubles{}};
  for (int number = 0; number < s.lobes.highlights; ++number)
    narrow.total = narrow.total + microfacet<Reflecting>(s, k, number).part(narrow, shaped);
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
             shaped = is_shaped(s);
  const Three d = load3(s.d, k), h = l - d;
  const Doubles vh = root(larger(0.5 * (1 - dot(l, d)), splat(0)));
  Slope at(n, h);
  Gloss gloss(cosine, seen_cosine(n, d), vh);
  Three axis = n;                                         // of `at` and `gloss`
  Doubles exponent = splat(-1), distribution = splat(0);  // of `found`
  HalfVectors found{};
  Shine sum{};
  for (int number = 0; number < s.lobes.highlights; ++number) {
    const Microfacet lobe = microfacet<Reflecting>(s, k, number);
    if (!any(nonzero(lobe.k))) continue;
    if (turns) {
      const Three own = lobe.normal(n);
      if (bits(nonzero(own - axis))) {
        axis = own;
        at = Slope(axis, h);
        gloss = Gloss(dot(axis, l), seen_cosine(axis, d), vh);
        exponent = splat(-1);
      }
    }
    const Doubles own = shaped ? lobe.distribution() : splat(0);
    if (bits((lobe.exponent != exponent) | (own != distribution))) {
      exponent = lobe.exponent;
      distribution = own;
      found = half_vectors(at, {axis, d, h}, lobe, shaped);
    }
    Doubles factor = found.weight, density = found.drawn;
    if (shaped) factor = factor * gloss.factor<Bent>(lobe.masking2(), lobe.fresnel(), own);
    if (stretches) {
      const Stretch stretch(lobe, axis);
      if (bits(stretch.some)) {
        const HalfVectors given = stretched_half_vectors(at, {axis, d, h}, lobe, stretch);
        factor =
            choose(stretch.some,
                   given.weight * gloss.stretched_factor(lobe.masking2(), lobe.fresnel(), own,
                                                         stretch.widths2(d), stretch.widths2(l)),
                   factor);
        density = choose(stretch.some, given.drawn, density);
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
  const bool shaped = is_shaped(s);
  const Doubles at = place.radius2 * narrow.total;
  Doubles before{}, rest{}, exponent{}, narrowest{}, distribution{};
  Three axis = n, stretch{};
  for (int number = 0; number < s.lobes.highlights; ++number) {
    const Microfacet lobe = microfacet<Reflecting>(s, k, number);
    const Doubles part = lobe.part(narrow, shaped);
    const Mask here = (part > 0) & (at >= before);
    rest = choose(here, (at - before) / part, rest);
    exponent = choose(here, lobe.exponent, exponent);
    if (shaped) distribution = choose(here, lobe.distribution(), distribution);
    narrowest = larger(narrowest, where(part > 0, lobe.exponent));
    if (Bent && s.lobes.turns) axis = choose(here, lobe.normal(n), axis);
    if (Bent && s.lobes.stretches) stretch = choose(here, Stretch(lobe, n).t, stretch);
    before = before + part;
  }
  rest = smaller(rest, splat(1 - 0x1p-53));
  const Three d = load3(s.d, k);
  Three t1, t2, h{};
  frame(axis, t1, t2);
  Doubles longer = splat(1);  // slopes along t1 are over that, those along t2 times
  if (Bent && s.lobes.stretches) {
    const Mask some = nonzero(stretch);
    longer = choose(some, length(stretch), longer);
    t1 = choose(some, 1 / longer * stretch, t1);
    t2 = choose(some, cross(axis, t1), t2);
  }
  const Mask is_ggx = distribution == MicrofacetRow::kGgx;
  if (!all(is_ggx)) {
    const Doubles cosine2 = drawn_cosine2(rest, exponent, distribution);
    const Three aside = place.across / longer * t1 + place.along * longer * t2;
    h = root(cosine2) * axis + root(1 - cosine2) * aside;
    if (Bent && s.lobes.stretches) h = choose(longer != 1, unit(h), h);
  }
  if (any(is_ggx)) {
    const Doubles width = root(1 / over_width2(exponent)), r = root(rest);
    h = choose(is_ggx,
               sample_visible_normal(axis, t1, t2, width / longer, width * longer,
                                     seen_from(axis, -d), r * place.across, r * place.along),
               h);
  }
  const Doubles c = dot(d, h);
  return {d - 2 * c * h, (narrow.total > 0) & (c < 0), narrowest};
}

/// About what gloss gives back of even light, as it does straight from above and where it mirrors;
/// ever less slanting the wider the lobe. Less what rays show, and metals' where any do.
inline Three microfacet_albedo(const LitPoints& s, size_t k) {
  const Doubles seen = seen_cosine(load3(s.n, k), load3(s.d, k));
  Three sum{};
  for (int number = 0; is_shaped(s) && number < s.lobes.highlights; ++number) {
    const Microfacet lobe(s, k, number);
    const Doubles masking2 = lobe.masking2(), fresnel = lobe.fresnel(), p = lobe.exponent,
                  of = lobe.distribution();
    const Mask good = masking2 > 0, dielectric = good & (fresnel > 0);
    if (!any((s.lobes.shows_nothing ? good : dielectric) & nonzero(lobe.k))) continue;
    if (s.lobes.shows_nothing) {
      sum = sum + where(good, of_even_light(seen, p, masking2, fresnel, of) * lobe.k);
      continue;
    }
    const Doubles rest = 1 - splat(s.lobes.shown);
    sum = sum +
          where(dielectric, rest * of_even_light<false>(seen, p, masking2, fresnel, of) * lobe.k);
  }
  return sum;
}

}  // namespace
}  // namespace glint
