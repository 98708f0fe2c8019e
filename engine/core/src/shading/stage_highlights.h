// The SPECULAR, SHEEN, TOON, OREN_NAYAR and FIBRE lobes of points: what they give back of light
// from a direction, and directions drawn from them. Letters: l direction to the light, n shading
// normal, d ray, k number of a group of points.
#pragma once
#include "shading/stage_math.h"
#include "shading/stage_oren_nayar.h"
#include "shading/stage_terminator.h"
#include "shading/stage_toon.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// The terms of a group of points whose highlights are narrower than the light.
struct Narrow {
  Doubles least,
      total;  // their exponents are at least that; sum of |k| / (p + 1), 0 where there are none
};

struct Term {
  Three k;
  Doubles exponent;
  Term(const LightStage& s, size_t at, int number) {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + at;
    k = {load(column), load(column + s.stride), load(column + 2 * s.stride)};
    exponent = load(column + SpecularTerm::kExponent * s.stride);
  }
  /// Its normal, where that is not n.
  static Three normal(const LightStage& s, size_t at, int number, const Three& n) {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + at;
    const double* own = column + SpecularTerm::kNormal * s.stride;
    const Three m = {load(own), load(own + s.stride), load(own + 2 * s.stride)};
    const Mask turned = nonzero(m) & (load(column + SpecularTerm::kExponent * s.stride) >= 0);
    return choose(turned, m, n);
  }
  /// How much of it reflects other surfaces, as rays show them: of GGX's masking, all of a metal's.
  Doubles reflects(const LightStage& s, size_t at, int number) const {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + at;
    const Doubles masking2 = load(column + SpecularTerm::kMasking * s.stride);
    const Mask dielectric = load(column + SpecularTerm::kFresnel * s.stride) > 0;
    return where(masking2 > 0, choose(dielectric, splat(s.shown), splat(1)));
  }
  Doubles weight(const Narrow& narrow) const {
    return where(exponent >= narrow.least, magnitude(k.x) + magnitude(k.y) + magnitude(k.z));
  }
  /// How many of the drawn directions belong to it, of `total`.
  Doubles part(const Narrow& narrow) const { return weight(narrow) / (exponent + 1); }
};

/// How a lobe is stretched: slopes of half vectors along t are times its length, those across it
/// over that.
struct Stretch {
  Mask some;
  Three t, across;  // n x t
  Doubles size4;    // |t|^4
  Stretch(const LightStage& s, size_t at, int number, const Three& n) {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + at;
    const double* own = column + SpecularTerm::kStretch * s.stride;
    t = {load(own), load(own + s.stride), load(own + 2 * s.stride)};
    some = nonzero(t) & (load(column + SpecularTerm::kExponent * s.stride) >= 0);
    across = cross(n, t);
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

/// The terms that reflect, of any width; the others have an exponent below 0.
template <bool Reflecting>
inline Term term_of(const LightStage& s, size_t k, int number) {
  Term term(s, k, number);
  if constexpr (Reflecting) {
    const Doubles part = term.reflects(s, k, number);
    const Mask good = (part > 0) & (term.exponent >= 0);
    term.k = where(good, part * term.k);
    term.exponent = choose(good, term.exponent, splat(-1));
  }
  return term;
}

inline Narrow reflecting_terms(const LightStage& s, size_t k) {
  Narrow all = {splat(0), Doubles{}};
  for (int number = 0; number < s.max_specular; ++number) {
    const Term term = term_of<true>(s, k, number);
    all.total = all.total + where(term.exponent >= 0, term.part(all));
  }
  return all;
}

inline Narrow narrow_terms(const LightStage& s, size_t k, const Three& x) {
  const Three to = splat3(s.center) - x;
  Narrow narrow = {s.least_near * dot(to, to) + s.least, Doubles{}};
  for (int number = 0; number < s.max_specular; ++number)
    narrow.total = narrow.total + Term(s, k, number).part(narrow);
  return narrow;
}

/// What is times a FIBRE lobe that fans light out less than all round: u^(q - 1), u half of one
/// plus the cosine from the viewer's side, or from the other.
inline Doubles fan(Doubles turned, Doubles q, Doubles behind) {
  const Doubles u = 0.5 * (1 + behind * smaller(larger(turned, splat(-1)), splat(1)));
  const Doubles power = exponential((1 - q) * logarithm_of_one_and(1 - u, u));
  return choose(q > 0, root(kCircle * (2 * q + 0.5) / 8) * where(u > 0, power), splat(1));
}

/// How l and v lie to a FIBRE lobe's tangent t, which leans by the tangent `tilt`.
struct FibreAngles {
  Doubles to_l, to_v, across_l, across_v;  // sines and cosines off the plane across t
  Doubles along, across;  // half of both angles together, leant, has the tangent along / across
  Doubles turned;         // cosine of the angle round t from v to l
  FibreAngles(const Three& t, Doubles tilt, const Three& v, const Three& l)
      : to_l(dot(t, l)),
        to_v(dot(t, v)),
        across_l(root(larger(1 - to_l * to_l, splat(0)))),
        across_v(root(larger(1 - to_v * to_v, splat(0)))),
        along((to_l + to_v) + tilt * (across_l + across_v)),
        across((across_l + across_v) - tilt * (to_l + to_v)) {
    const Doubles both = across_l * across_v;
    turned = where(both > 0, (dot(l, v) - to_l * to_v) / both);
  }
};

/// The tangent of a FIBRE lobe, as long as the fibre is thick.
inline Three fibre_tangent(const LightStage& s, size_t k, int number) {
  const int column = s.specular_columns * number + SpecularTerm::kTangent;
  const double* t = s.specular + size_t(column) * s.stride + k;
  return {load(t), load(t + s.stride), load(t + 2 * s.stride)};
}

/// The modified Bessel function of order 0, I0(x) of x >= 0, times e^-x and times the exponential
/// of `off` (Abramowitz and Stegun 9.8.1, 9.8.2: within 2e-7).
inline Doubles scaled_bessel(Doubles x, Doubles off) {
  const Mask small = x < 3.75;
  const Doubles t = choose(small, x, splat(0)) * (1 / 3.75), t2 = t * t,
                s = 3.75 / choose(small, splat(3.75), x);
  const Doubles
      near =
          1 + t2 * (3.5156229 +
                    t2 * (3.0899424 +
                          t2 * (1.2067492 + t2 * (0.2659732 + t2 * (0.0360768 + t2 * 0.0045813))))),
      far = 0.39894228 +
            s * (0.01328592 +
                 s * (0.00225319 +
                      s * (-0.00157565 +
                           s * (0.00916281 +
                                s * (-0.02057706 +
                                     s * (0.02635537 + s * (-0.01647633 + s * 0.00392377)))))));
  return exponential(choose(small, off - x, off)) *
         choose(small, near, far / root(choose(small, splat(1), x)));
}

/// How light is spread along a fibre (d'Eon and others 2011, as Chiang and others 2016 have it),
/// for a variance of 4 / p: its integral over all l, times the cosine off the plane across t, is 1.
inline Doubles spread_along(const FibreAngles& at, Doubles tilt, Doubles p) {
  const Doubles size = 1 / (1 + tilt * tilt), turned = size * (1 - tilt * tilt),
                by = size * (2 * tilt), v = 0.25 * p, to_v = at.to_v * turned + at.across_v * by,
                both = at.across_l * magnitude(at.across_v * turned - at.to_v * by);
  const Doubles whole = v / (1 - exponential(-2 * larger(v, splat(0x1p-12)))),
                wide = 0.5 + v * (0.5 + v * (1.0 / 6));
  return choose(v < 0x1p-12, wide, whole) *
         scaled_bessel(v * both, v * smaller(both - at.to_l * to_v - 1, splat(0)));
}

/// What a FIBRE lobe gives (SEMANTICS.md); cosine: n.l.
inline Doubles fibre(const LightStage& s, size_t k, int number, Doubles kind, const Three& l,
                     Doubles cosine) {
  const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
  const Doubles tilt = load(column + SpecularTerm::kTilt * s.stride),
                p = load(column + SpecularTerm::kMasking * s.stride),
                q = load(column + SpecularTerm::kFresnel * s.stride);
  const FibreAngles at(unit(fibre_tangent(s, k, number)), tilt, -load3(s.d, k), l);
  const Mask behind = kind == SpecularTerm::kFibreTransmission;
  const Doubles fanned = fan(at.turned, q, choose(behind, splat(-1), splat(1))),
                given = choose(kind == SpecularTerm::kFibreDiffuse, (2 / kCircle) * at.across_l,
                               fanned * spread_along(at, tilt, p));
  return where((behind & (cosine < 0)) | (~behind & (cosine > 0)), given);
}

/// How far light from l goes through the fibres of a group of points that let it through: chords of
/// cylinders; 0 where it comes from before, or nothing does.
inline Doubles way_through(const LightStage& s, size_t k, const Three& l) {
  const Doubles behind = larger(-dot(load3(s.n, k), l), splat(0));
  Doubles way = splat(0);
  for (int number = 0; number < s.max_specular; ++number) {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
    const Mask here =
        load(column + SpecularTerm::kExponent * s.stride) == SpecularTerm::kFibreTransmission;
    if (!bits(here)) continue;
    const Three t = fibre_tangent(s, k, number);
    const Doubles thick = length(t), along = dot(unit(t), l),
                  chord = thick * behind / larger(1 - along * along, splat(1.0 / 64));
    way = choose(here & (chord < 0x1p60), larger(way, chord), way);
  }
  return way;
}

/// Sum of the terms, of matt ones (SHEEN, TOON_DIFFUSE, OREN_NAYAR, FIBRE_DIFFUSE) and other FIBRE
/// ones apart, and how densely (a steradian) directions are drawn where l is.
struct Highlights {
  Three light, sheen, fibre;
  Doubles density;
};

/// What a TOON lobe gives (SEMANTICS.md); shines: round the mirrored ray, not round n.
inline Doubles toon(const LightStage& s, size_t k, int number, Mask shines, const Three& n,
                    const Three& l, Doubles cosine) {
  const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
  const Three d = load3(s.d, k);
  const Doubles nv = -dot(n, d), mirrored = where(nv > 0, 2 * nv * cosine + dot(d, l));
  const Toon lobe(load(column + SpecularTerm::kMasking * s.stride),
                  load(column + SpecularTerm::kFresnel * s.stride));
  return lobe.at(choose(shines, mirrored, cosine));
}

/// cosine: n.l.  narrow: or null. Lobes that differ in their Fresnel factor alone share their
/// power. Where some lobes have normals of their own each gives nothing behind its own.
template <bool Reflecting, bool Bent>
__attribute__((always_inline)) inline Highlights all_highlights(const LightStage& s, size_t k,
                                                                const Three& n, const Three& l,
                                                                Doubles cosine,
                                                                const Narrow* narrow) {
  const bool turns = Bent && s.turns_lobes, stretches = Bent && s.stretches_lobes;
  const Three d = load3(s.d, k), h = l - d;
  const Doubles vh = root(larger(0.5 * (1 - dot(l, d)), splat(0)));
  Slope at = slope(n, h);
  Gloss gloss(cosine, seen_cosine(n, d), vh);
  Three axis = n;  // of `at` and `gloss`
  Doubles exponent = splat(0), power = splat(1);
  Highlights sum{};
  for (int number = 0; number < s.max_specular; ++number) {
    Term term = term_of<Reflecting>(s, k, number);
    if (!any(nonzero(term.k))) continue;
    if (turns) {
      const Three own = Term::normal(s, k, number, n);
      if (bits(nonzero(own - axis))) {
        axis = own;
        at = slope(axis, h);
        gloss = Gloss(dot(axis, l), seen_cosine(axis, d), vh);
        power = highlight(at, exponent);
      }
    }
    if (s.has_sheen && !Reflecting) {
      const Mask sheen = term.exponent == SpecularTerm::kSheen;
      if (bits(sheen)) {
        const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
        const Doubles share = gloss.sheen(load(column + SpecularTerm::kMasking * s.stride),
                                          load(column + SpecularTerm::kFresnel * s.stride),
                                          smaller(-dot(n, d), splat(1)));
        sum.sheen = sum.sheen + where(sheen, share * term.k);
      }
      const Mask turned = term.exponent == SpecularTerm::kOrenNayar,
                 again = term.exponent == SpecularTerm::kOrenNayarMultiple;
      Mask apart = sheen | turned | again;
      if (bits(turned)) sum.sheen = sum.sheen + where(turned, oren_nayar(n, d, l, cosine) * term.k);
      if (bits(again)) sum.sheen = sum.sheen + where(again, cosine * lost_once(cosine) * term.k);
      const Mask matt_toon = term.exponent == SpecularTerm::kToonDiffuse,
                 shines = term.exponent == SpecularTerm::kToonSpecular;
      if (bits(matt_toon | shines)) {
        Doubles share = toon(s, k, number, shines, n, l, cosine);
        sum.sheen = sum.sheen + where(matt_toon, share * term.k);
        if (Bent && s.lowering) share = lowered(load(s.lowering + k), cosine) * share;
        sum.light = sum.light + where(shines, share * term.k);
        apart |= matt_toon | shines;
      }
      if (s.has_fibre) {
        const Mask strand = term.exponent <= SpecularTerm::kFibreDiffuse,
                   matt = term.exponent == SpecularTerm::kFibreDiffuse;
        if (bits(strand)) {
          const Three given = fibre(s, k, number, term.exponent, l, cosine) * term.k;
          sum.sheen = sum.sheen + where(matt, given);
          sum.fibre = sum.fibre + where(strand & ~matt, given);
        }
        apart |= strand;
      }
      term.k = where(s.matt_alone ? Mask{} : ~apart, term.k);
      if (!any(nonzero(term.k))) continue;
    }
    if (bits(term.exponent != exponent)) {
      exponent = term.exponent;
      power = highlight(at, exponent);
    }
    Doubles factor = power;
    if (s.specular_columns >= SpecularTerm::kShaped) {
      const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
      factor = power * gloss.factor<Bent>(load(column + SpecularTerm::kMasking * s.stride),
                                          load(column + SpecularTerm::kFresnel * s.stride));
    }
    Doubles density = power;
    if (stretches) {
      const Stretch stretch(s, k, number, axis);
      if (bits(stretch.some)) {
        const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
        const Doubles c = dot(axis, h), log = logarithm_of_one_and(stretch.slopes2(h), c * c),
                      given =
                          stretched_highlight(at, log, exponent, 4) *
                          gloss.stretched_factor(load(column + SpecularTerm::kMasking * s.stride),
                                                 load(column + SpecularTerm::kFresnel * s.stride),
                                                 stretch.widths2(d), stretch.widths2(l));
        factor = choose(stretch.some, given, factor);
        density = choose(stretch.some, stretched_highlight(at, log, exponent, 3), density);
      }
    }
    if (turns) factor = where(dot(axis, l) > 0, factor);
    if (Bent && s.lowering) factor = lowered(load(s.lowering + k), dot(axis, l)) * factor;
    sum.light = sum.light + factor * term.k;
    if (narrow) sum.density = sum.density + density * term.weight(*narrow);
  }
  const Doubles size = length(h);
  if (narrow)
    sum.density = where((narrow->total > 0) & (size > 0),
                        sum.density / ((4 * kCircle) * size * narrow->total));
  return sum;
}

/// The same once for all that looks at more than one normal.
template <bool Reflecting>
__attribute__((noinline)) Highlights highlights_of_bent(const LightStage& s, size_t k, Three n,
                                                        Three l, Doubles cosine,
                                                        const Narrow* narrow) {
  return all_highlights<Reflecting, true>(s, k, n, l, cosine, narrow);
}

template <bool Reflecting, bool Bent>
__attribute__((always_inline)) inline Highlights highlights(const LightStage& s, size_t k,
                                                            const Three& n, const Three& l,
                                                            Doubles cosine, const Narrow* narrow) {
  if constexpr (Bent) return highlights_of_bent<Reflecting>(s, k, n, l, cosine, narrow);
  else return all_highlights<Reflecting, false>(s, k, n, l, cosine, narrow);
}

/// About what gloss gives back of even light, as it does straight from above and where it mirrors;
/// ever less slanting the wider the lobe. Less what rays show, and metals' where any do.
/// TOON_SPECULAR lobes all that they do.
inline Three even_gloss(const LightStage& s, size_t k) {
  const Doubles seen = seen_cosine(load3(s.n, k), load3(s.d, k));
  Three sum{};
  for (int number = 0; number < s.max_specular; ++number) {
    const Term term(s, k, number);
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
    const Doubles masking2 = load(column + SpecularTerm::kMasking * s.stride),
                  fresnel = load(column + SpecularTerm::kFresnel * s.stride), p = term.exponent;
    const Mask toon = p == SpecularTerm::kToonSpecular;
    if (bits(toon)) sum = sum + where(toon, Toon(masking2, fresnel).albedo() * term.k);
    const Mask good = (masking2 > 0) & (p >= 0), dielectric = good & (fresnel > 0);
    if (!any((s.shows_nothing ? good : dielectric) & nonzero(term.k))) continue;
    if (s.shows_nothing) {
      sum = sum + where(good, of_even_light(seen, p, masking2, fresnel) * term.k);
      continue;
    }
    const Doubles rest = 1 - splat(s.shown);
    sum = sum + where(dielectric, rest * of_even_light<false>(seen, p, masking2, fresnel) * term.k);
  }
  return sum;
}

/// The direction in which the half vector at the stage's point of the lobes, of what is reflected
/// at each point's own, mirrors the ray, and where there is one.
struct Drawn {
  Three l;
  Mask good;
  Doubles narrowest;  // exponent of all lobes that directions are drawn from
};
template <bool Reflecting, bool Bent>
inline Drawn draw(const LightStage& s, size_t k, const Three& n, const Narrow& narrow) {
  Doubles radius2 = splat(s.radius2), across = splat(s.azimuth[0]), along = splat(s.azimuth[1]);
  if constexpr (Reflecting) {  // as disc_place has it
    const Doubles x = load(s.disc[0] + k), y = load(s.disc[1] + k);
    radius2 = x * x + y * y;
    const Doubles r = root(radius2);
    const Mask some = r > 0;
    across = choose(some, x / r, splat(1));
    along = choose(some, y / r, splat(0));
  }
  const Doubles at = radius2 * narrow.total;
  Doubles before{}, rest{}, exponent{}, narrowest{};
  Three axis = n, stretch{};
  for (int number = 0; number < s.max_specular; ++number) {
    const Term term = term_of<Reflecting>(s, k, number);
    const Doubles part = where(term.exponent >= 0, term.part(narrow));
    const Mask here = (part > 0) & (at >= before);
    rest = choose(here, (at - before) / part, rest);
    exponent = choose(here, term.exponent, exponent);
    narrowest = larger(narrowest, where(part > 0, term.exponent));
    if (Bent && s.turns_lobes) axis = choose(here, Term::normal(s, k, number, n), axis);
    if (Bent && s.stretches_lobes) stretch = choose(here, Stretch(s, k, number, n).t, stretch);
    before = before + part;
  }
  rest = smaller(rest, splat(1 - 0x1p-53));
  const Doubles cosine2 = exponential(-2 * logarithm_of_one_and(rest, 1 - rest) / (exponent + 1));
  Three t1, t2;
  frame(axis, t1, t2);
  Three h = root(cosine2) * axis + root(1 - cosine2) * (across * t1 + along * t2);
  if (Bent && s.stretches_lobes) {
    const Mask some = nonzero(stretch);
    const Doubles size2 = choose(some, dot(stretch, stretch), splat(1));
    const Three aside = across / size2 * stretch + along * cross(axis, stretch);
    h = choose(some, unit(root(cosine2) * axis + root(1 - cosine2) * aside), h);
  }
  const Three d = load3(s.d, k);
  const Doubles c = dot(d, h);
  return {d - 2 * c * h, (narrow.total > 0) & (c < 0), narrowest};
}

}  // namespace
}  // namespace glint
