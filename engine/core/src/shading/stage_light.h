// Light from one sample of one light (notes 4.13-4.16, light.h). Letters: x point, l direction to
// the light, d distance, z cosine at the light, g n geometric and shading normal, v to the viewer.
#pragma once
#include "shading/stage_bump.h"
#include "shading/stage_sample.h"

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
  /// Where it is one that reflects other surfaces: of GGX's masking and, perhaps, of metals.
  Mask reflects(const LightStage& s, size_t at, int number) const {
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + at;
    const Mask shaped = load(column + SpecularTerm::kMasking * s.stride) > 0;
    return s.metals_alone ? shaped & ~(load(column + SpecularTerm::kFresnel * s.stride) > 0)
                          : shaped;
  }
  Doubles weight(const Narrow& narrow) const {
    return where(exponent >= narrow.least, magnitude(k.x) + magnitude(k.y) + magnitude(k.z));
  }
  /// How many of the drawn directions belong to it, of `total`.
  Doubles part(const Narrow& narrow) const { return weight(narrow) / (exponent + 1); }
};

/// The terms that reflect, of any width; the others have an exponent below 0.
template <bool Reflecting>
inline Term term_of(const LightStage& s, size_t k, int number) {
  Term term(s, k, number);
  if constexpr (Reflecting) {
    const Mask good = term.reflects(s, k, number) & (term.exponent >= 0);
    term.k = where(good, term.k);
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

/// What a FIBRE lobe gives (SEMANTICS.md); cosine: n.l.
inline Doubles fibre(const LightStage& s, size_t k, int number, Doubles kind, const Three& l,
                     Doubles cosine) {
  const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
  const double* tangent = column + SpecularTerm::kTangent * s.stride;
  const Three t = unit({load(tangent), load(tangent + s.stride), load(tangent + 2 * s.stride)});
  const Doubles to_l = dot(t, l), to_v = -dot(t, load3(s.d, k)),
                across_l = root(larger(1 - to_l * to_l, splat(0))),
                across_v = root(larger(1 - to_v * to_v, splat(0)));
  const Doubles p = load(column + SpecularTerm::kMasking * s.stride);
  const Doubles along = to_l + to_v, across = across_l + across_v,
                widest = larger(larger(across_l, across_v), splat(0.125));
  const Mask behind = kind == SpecularTerm::kFibreTransmission;
  const Doubles both = across_l * across_v,
                turned = where(both > 0, (-dot(l, load3(s.d, k)) - to_l * to_v) / both),
                fanned = fan(turned, load(column + SpecularTerm::kFresnel * s.stride),
                             choose(behind, splat(-1), splat(1)));
  const Doubles power =
                    exponential(-0.5 * p * logarithm_of_one_and(along * along, across * across)),
                glossy =
                    fanned * root((p + 0.5) / (8 * kCircle)) * power * across_l / (widest * widest),
                given = choose(kind == SpecularTerm::kFibreDiffuse, (2 / kCircle) * across_l,
                               where(across > 0, glossy));
  return where((behind & (cosine < 0)) | (~behind & (cosine > 0)), given);
}

/// Sum of the terms, of matt ones (SHEEN, FIBRE_DIFFUSE) and other FIBRE ones apart, and how
/// densely (a steradian) directions are drawn where l is.
struct Highlights {
  Three light, sheen, fibre;
  Doubles density;
};

/// cosine: n.l.  narrow: or null. Lobes that differ in their Fresnel factor alone share their
/// power.
template <bool Reflecting = false>
__attribute__((always_inline)) inline Highlights highlights(const LightStage& s, size_t k,
                                                            const Three& n, const Three& l,
                                                            Doubles cosine, const Narrow* narrow) {
  const Three d = load3(s.d, k), h = l - d;
  const Slope at = slope(n, h);
  Gloss gloss(cosine, seen_cosine(n, d), root(larger(0.5 * (1 - dot(l, d)), splat(0))));
  Doubles exponent = splat(0), power = splat(1);
  Highlights sum{};
  for (int number = 0; number < s.max_specular; ++number) {
    Term term = term_of<Reflecting>(s, k, number);
    if (!any(nonzero(term.k))) continue;
    if (s.has_sheen && !Reflecting) {
      const Mask sheen = term.exponent == SpecularTerm::kSheen;
      if (bits(sheen)) {
        const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
        const Doubles share = gloss.sheen(load(column + SpecularTerm::kMasking * s.stride),
                                          load(column + SpecularTerm::kFresnel * s.stride),
                                          smaller(-dot(n, d), splat(1)));
        sum.sheen = sum.sheen + where(sheen, share * term.k);
      }
      Mask apart = sheen;
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
      factor = power * gloss.factor(load(column + SpecularTerm::kMasking * s.stride),
                                    load(column + SpecularTerm::kFresnel * s.stride));
    }
    sum.light = sum.light + factor * term.k;
    if (narrow) sum.density = sum.density + power * term.weight(*narrow);
  }
  const Doubles size = length(h);
  if (narrow)
    sum.density = where((narrow->total > 0) & (size > 0),
                        sum.density / ((4 * kCircle) * size * narrow->total));
  return sum;
}

/// About what gloss of dielectrics gives back of even light, as it does straight from above and
/// where it mirrors; ever less slanting the wider the lobe.
inline Three even_gloss(const LightStage& s, size_t k) {
  const Doubles seen = seen_cosine(load3(s.n, k), load3(s.d, k));
  Three sum{};
  for (int number = 0; number < s.max_specular; ++number) {
    const Term term(s, k, number);
    const double* column = s.specular + size_t(s.specular_columns * number) * s.stride + k;
    const Doubles masking2 = load(column + SpecularTerm::kMasking * s.stride),
                  fresnel = load(column + SpecularTerm::kFresnel * s.stride), p = term.exponent;
    const Mask good = (masking2 > 0) & (fresnel > 0) & (p >= 0);
    if (!any(good & nonzero(term.k))) continue;
    const Doubles cosine = root(seen * seen + 2 * (1 - seen * seen) / (p + 8)),
                  size = 8 / (p + 2 + 8 / (4 + p * p));
    Gloss gloss(cosine, cosine, cosine);
    sum = sum + where(good, size * cosine * gloss.factor(masking2, fresnel) * term.k);
  }
  return sum;
}

/// What of the bounced light from a place at the square of the distance rays do not look for (the
/// rest: Kollig and Keller 2004, Illumination in the presence of weak singularities).
inline Doubles far_share(const LightStage& s, Doubles d2) {
  const Doubles t = smaller(s.gather2 * d2, splat(1));
  return t * (2 - t);
}

/// How far along g a ray starts that leaves to the back of its face: beyond the face, but not where
/// Hanika's start is above it already. There the face is out of its way, and beyond the face it
/// would start within the body.
inline Doubles below(const LightStage& s, size_t k, const Three& origin, const Three& g,
                     Doubles offset) {
  if (s.origin[0] == s.points_x[0]) return -offset;  // no smooth faces
  return choose(dot(origin - load3(s.points_x, k), g) > 0x1p-25 * offset, splat(0), -offset);
}

/// The direction in which the half vector at the stage's point of the lobes mirrors the ray, and
/// where there is one.
struct Drawn {
  Three l;
  Mask good;
  Doubles exponent;  // of the lobe
};
template <bool Reflecting = false>
inline Drawn draw(const LightStage& s, size_t k, const Three& n, const Narrow& narrow) {
  const Doubles at = s.radius2 * narrow.total;
  Doubles before{}, rest{}, exponent{};
  for (int number = 0; number < s.max_specular; ++number) {
    const Term term = term_of<Reflecting>(s, k, number);
    const Doubles part = where(term.exponent >= 0, term.part(narrow));
    const Mask here = (part > 0) & (at >= before);
    rest = choose(here, (at - before) / part, rest);
    exponent = choose(here, term.exponent, exponent);
    before = before + part;
  }
  rest = smaller(rest, splat(1 - 0x1p-53));
  const Doubles cosine2 = exponential(-2 * logarithm_of_one_and(rest, 1 - rest) / (exponent + 1));
  Three t1, t2;
  frame(n, t1, t2);
  const Three h = root(cosine2) * n +
                  root(1 - cosine2) * (splat(s.azimuth[0]) * t1 + splat(s.azimuth[1]) * t2),
              d = load3(s.d, k);
  const Doubles c = dot(d, h);
  return {d - 2 * c * h, (narrow.total > 0) & (c < 0), exponent};
}

/// Where the shadow ray from `origin` to a mesh light's sample ends: before the surface, on the
/// side that it comes from. Hanika's start may be on another than the point.
inline Three before_mesh(const LightStage& s, size_t k, const Sample& sample, const Three& origin) {
  if (s.origin[0] == s.points_x[0]) return sample.end;  // no smooth faces
  const Three q = splat3(s.end), n = splat3(s.axis),
              end = q + choose(dot(origin - q, n) > 0, splat(s.size), splat(-s.size)) * n;
  const Mask moved = nonzero(origin - load3(s.points_x, k));
  return {choose(moved, end.x, sample.end.x), choose(moved, end.y, sample.end.y),
          choose(moved, end.z, sample.end.z)};
}

/// The open segment from the point to the sample; its far end stops short of what the sample lies
/// on.
template <int Shape>
inline void shadow_ray(const LightStage& s, size_t k, const Sample& sample,
                       const Appender& append) {
  const Three origin = load3(s.origin, k), g = load3(s.g, k);
  const Doubles offset = load(s.offset + k);
  constexpr bool endless = Shape == kDirection || Shape == kSky || Shape == kOpenSky;
  constexpr bool on_mesh = Shape == kMeshSource || Shape == kBouncedSource;
  const Three end = on_mesh ? before_mesh(s, k, sample, origin) : sample.end;
  const Three towards = endless ? sample.l : end - origin;
  // Off the surface along its normal, and back along the ray that found it: there it is free,
  // whatever stands on the surface.
  const Three o = origin + choose(dot(g, towards) < 0, below(s, k, origin, g, offset), offset) * g -
                  offset * load3(s.d, k);
  append(s.o, o);
  if (s.end_out[0]) append(s.end_out, end);
  if (endless) {
    append(s.to, sample.l);
    return append(s.t_max, splat(__builtin_inf()));
  }
  const Way to = way(end - o);
  append(s.to, to.d);
  append(s.t_max, to.length - rounding(larger(max_abs(end), max_abs(o))));
}

/// A row for each of the lanes `reached` that the sample adds something to; how many.
template <int Shape>
inline size_t append_lit(const LightStage& s, size_t k, const Sample& sample, Mask reached,
                         const Three& diffuse, const Three& specular, size_t found) {
  reached &= nonzero(diffuse) | nonzero(specular);
  const uint32_t lanes = bits(reached);
  if (!lanes) return 0;
  const Appender append{lanes, found};
  append.number(s.point, uint32_t(k));
  append(s.diffuse_out, s.specular_out[0] ? diffuse : diffuse + specular);
  if (s.specular_out[0]) append(s.specular_out, specular);
  if (s.casts_shadow) shadow_ray<Shape>(s, k, sample, append);
  return size_t(__builtin_popcount(lanes));
}

/// Where the inner side of a mesh light is seen from a face that turns away from it, as by the
/// outside of the same body.
template <int Shape>
inline Mask within(const LightStage& s, size_t k, const Sample& at) {
  if constexpr (Shape != kMeshSource) return Mask{};
  return (dot(at.l, splat3(s.axis)) >= 0) & (dot(at.l, load3(s.g, k)) <= 0);
}

template <int Shape>
inline Three color_of(const LightStage& s, const Sample& at) {
  if constexpr (Shape == kOpenSky) return at.color;
  if constexpr (Shape != kMeshSource) return splat3(s.color);
  const Mask front = dot(at.l, splat3(s.axis)) < 0;
  return {choose(front, splat(s.color[0]), splat(s.back[0])),
          choose(front, splat(s.color[1]), splat(s.back[1])),
          choose(front, splat(s.color[2]), splat(s.back[2]))};
}

/// Points of the light and drawn directions, weighed by how densely each of them falls there (the
/// balance heuristic): both get the same.
template <int Shape>
inline Doubles balanced(const LightStage& s, const Sample& at, const Highlights& seen) {
  // for each point
  constexpr bool sky = Shape == kSky || Shape == kOpenSky;
  const double draws = sky ? 1.0 / kSkyDraws : Shape == kMeshSource ? 1 / s.share : 1;
  return at.factor / (1 + draws * seen.density * at.spread);
}

/// What a sample gives to a group of points before shadows, where it reaches them.
struct Given {
  Sample at;
  Mask reached;
  Three diffuse, specular;
};

/// False where it reaches none of those that are lit.
template <int Shape>
__attribute__((always_inline)) inline bool give(const LightStage& s, size_t k, Given& given) {
  const Mask lit = load(s.lit + k);
  if (!any(lit)) return false;
  const Three n = load3(s.n, k), x = load3(s.points_x, k);
  const Sample at = given.at =
      Shape == kBouncedSource ? sample_bounced(s, x, n) : sample<Shape>(s, x);
  const Doubles middle = dot(n, at.l),
                cosine = Shape == kBouncedSource ? above_horizon(middle, at.spread) : middle;
  // Light from behind passes through fibres, but for what comes from matt surfaces.
  const bool through = s.has_fibre && Shape != kBouncedSource;
  const Mask front = cosine > 0, side = through ? front | (cosine < 0) : front,
             met = lit & at.good & side & ~within<Shape>(s, k, at);
  if (!any(met)) return false;
  const BumpShadow bump = bump_shadow(s, k, n, at.l);
  given.reached = met & ~bump.hidden;
  if (!any(given.reached)) return false;
  const Three color = color_of<Shape>(s, at), I = at.factor * color;
  given.diffuse = cosine * (I * load3(s.diffuse, k));
  given.specular = Three{};
  if (Shape == kBouncedSource && s.gloss[0]) given.specular = cosine * (I * load3(s.gloss, k));
  if (Shape == kBouncedSource && s.gather2 > 0) {
    const Three to = splat3(s.end) - x;
    const Doubles share = far_share(s, dot(to, to));
    given.diffuse = share * given.diffuse;
    given.specular = share * given.specular;
  }
  if (s.max_specular > 0 && (Shape != kBouncedSource || s.has_sheen)) {
    const Narrow narrow = s.draws ? narrow_terms(s, k, x) : Narrow{};
    const Highlights seen = highlights(s, k, n, at.l, middle, s.draws ? &narrow : nullptr);
    if (Shape != kBouncedSource)
      given.specular =
          s.draws ? balanced<Shape>(s, at, seen) * (color * seen.light) : I * seen.light;
    if (s.has_sheen) given.diffuse = given.diffuse + where(middle > 0, I * seen.sheen);
    if (through) {
      given.diffuse = where(front, given.diffuse);
      given.specular = where(front, given.specular) + I * seen.fibre;
    }
  }
  if (bump.some) given.diffuse = bump.share * given.diffuse;
  return true;
}

/// The same for directions drawn from the narrow lobes, where they reach the light.
template <int Shape>
__attribute__((always_inline)) inline bool give_drawn(const LightStage& s, size_t k, Given& given) {
  const Mask lit = load(s.lit + k);
  if (!any(lit)) return false;
  const Three n = load3(s.n, k), x = load3(s.points_x, k);
  const Narrow narrow = narrow_terms(s, k, x);
  if (!any(lit & (narrow.total > 0))) return false;
  const Drawn drawn = draw(s, k, n, narrow);
  Sample at = sample_at<Shape>(s, x, drawn.l);
  Three color = color_of<Shape>(s, at);
  if constexpr (Shape == kSky) {
    const SkyCell cell = sky_cell(*s.dome, at.l);
    color = cell.color;
    at.spread = cell.spread;
    at.factor = at.factor * cell.spread;
  }
  const Doubles cosine = dot(n, at.l);
  given.reached = lit & drawn.good & at.good & (cosine > 0) & ~bump_shadow(s, k, n, at.l).hidden;
  if (!any(given.reached)) return false;
  const Highlights seen = highlights(s, k, n, at.l, cosine, &narrow);
  given.at = at;
  given.diffuse = Three{};
  given.specular = balanced<Shape>(s, at, seen) * (color * seen.light);
  return true;
}

template <int Shape>
size_t light_from(const LightStage& s) {
  size_t found = 0;
  Given given;
  for (size_t k = s.first; k < s.count; k += kLanes)
    if (give<Shape>(s, k, given))
      found +=
          append_lit<Shape>(s, k, given.at, given.reached, given.diffuse, given.specular, found);
  return found;
}

/// What a sample gives to points where there is no surface; its ways begin there.
template <int Shape>
size_t scatter_from(const LightStage& s) {
  constexpr bool endless = Shape == kDirection || Shape == kSky;
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(s.lit + k);
    if (!any(lit)) continue;
    const Three x = load3(s.points_x, k);
    const Sample at = sample<Shape>(s, x);
    const Three given = at.factor * (color_of<Shape>(s, at) * load3(s.diffuse, k));
    const uint32_t lanes = bits(lit & at.good & nonzero(given));
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(s.point, uint32_t(k));
    append(s.diffuse_out, given);
    if (s.specular_out[0]) append(s.specular_out, Three{});
    append(s.o, x);
    append(s.end_out, at.end);
    const Way to = way(at.end - x);
    append(s.to, endless ? at.l : to.d);
    append(s.t_max, endless ? splat(__builtin_inf())
                            : to.length - rounding(larger(max_abs(at.end), max_abs(x))));
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

template <int Shape>
size_t gloss_from(const LightStage& s) {
  size_t found = 0;
  Given given;
  for (size_t k = s.first; k < s.count; k += kLanes)
    if (give_drawn<Shape>(s, k, given))
      found +=
          append_lit<Shape>(s, k, given.at, given.reached, given.diffuse, given.specular, found);
  return found;
}

/// The same for a mesh light: what the light is there, the rays have to find out. They begin at the
/// point itself, of whose directions the density is, not where its shadow rays do.
size_t gloss_towards_mesh(const LightStage& s) {
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(s.lit + k);
    if (!any(lit)) continue;
    const Three n = load3(s.n, k);
    const Narrow narrow = narrow_terms(s, k, load3(s.points_x, k));
    if (!any(lit & (narrow.total > 0))) continue;
    const Drawn drawn = draw(s, k, n, narrow);
    const Doubles cosine = dot(n, drawn.l);
    const Highlights seen = highlights(s, k, n, drawn.l, cosine, &narrow);
    const Mask reached = lit & drawn.good & (cosine > 0) & nonzero(seen.light) &
                         ~bump_shadow(s, k, n, drawn.l).hidden;
    const uint32_t lanes = bits(reached);
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(s.point, uint32_t(k));
    append(s.diffuse_out, seen.light);
    append(s.density_out, seen.density);
    const Three g = load3(s.g, k);
    const Doubles offset = load(s.offset + k);
    const Doubles beside = choose(dot(g, drawn.l) < 0, -offset, offset);
    append(s.o, load3(s.points_x, k) + beside * g - beside * load3(s.d, k));
    append(s.to, drawn.l);
    append(s.t_max, splat(__builtin_inf()));
    if (s.end_out[0]) append(s.end_out, drawn.l);  // until it is known
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

size_t reflect(const LightStage& s) {
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(s.lit + k);
    if (!any(lit)) continue;
    const Narrow all = reflecting_terms(s, k);
    if (!any(lit & (all.total > 0))) continue;
    const Three n = load3(s.n, k);
    const Drawn drawn = draw<true>(s, k, n, all);
    const Doubles cosine = dot(n, drawn.l);
    const Highlights seen = highlights<true>(s, k, n, drawn.l, cosine, &all);
    const Three share = (1 / (kCircle * seen.density)) * seen.light;
    const Mask reached = lit & drawn.good & (cosine > 0) & (seen.density > 0) &
                         (dot(drawn.l, load3(s.g, k)) > 0) & nonzero(share);
    const uint32_t lanes = bits(reached);
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(s.point, uint32_t(k));
    append(s.diffuse_out, share);
    append(s.t_max, drawn.exponent);
    append(s.to, drawn.l);
    append(s.o, load3(s.points_x, k) + load(s.offset + k) * load3(s.g, k));
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

/// What of T a point throws back as what is matt does, of light along l.
inline Three matt(const LightStage& s, size_t k, const Three& n, const Three& l) {
  const BumpShadow bump = bump_shadow(s, k, n, l);
  Three T = load3(s.diffuse, k);
  if (bump.some) T = bump.share * T;
  if (s.gathers_gloss) T = T + even_gloss(s, k);
  return bump.some ? where(~bump.hidden, T) : T;
}

size_t gather(const LightStage& s) {
  const double across = __builtin_sqrt(s.radius2);
  const Doubles upward = splat(__builtin_sqrt(s.radius2 < 1 ? 1 - s.radius2 : 0)),
                x = splat(across * s.azimuth[0]), y = splat(across * s.azimuth[1]);
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(s.lit + k);
    if (!any(lit)) continue;
    const Three n = load3(s.n, k), g = load3(s.g, k);
    Three t1, t2;
    frame(n, t1, t2);
    const Three l = upward * n + x * t1 + y * t2;  // as densely as their cosine (Malley's method)
    const Three T = matt(s, k, n, l);
    const uint32_t lanes = bits(lit & nonzero(T) & (dot(l, g) > 0));
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(s.point, uint32_t(k));
    append(s.diffuse_out, T);
    append(s.to, l);
    append(s.o, load3(s.points_x, k) + load(s.offset + k) * g);
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

void matten(const LightStage& s, double* const* diffuse) {
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask varnished = load(s.lit + k);
    if (!any(varnished)) continue;
    const Three T = load3(s.diffuse, k) + where(varnished, even_gloss(s, k));
    store(diffuse[0] + k, T.x);
    store(diffuse[1] + k, T.y);
    store(diffuse[2] + k, T.z);
  }
}

size_t light(const LightStage& s) {
  switch (s.shape) {
    case kMeshSource:
      return light_from<kMeshSource>(s);
    case kBouncedSource:
      return light_from<kBouncedSource>(s);
    case kDirection:
      return light_from<kDirection>(s);
    case kSky:
      return light_from<kSky>(s);
    case kOpenSky:
      return light_from<kOpenSky>(s);
    case kPointSource:
      return light_from<kPointSource>(s);
    case kSphereSource:
      return light_from<kSphereSource>(s);
    case kDiscSource:
      return light_from<kDiscSource>(s);
    case kRectangleSource:
      return light_from<kRectangleSource>(s);
    default:
      return light_from<kPlaneSource>(s);
  }
}

size_t scatter(const LightStage& s) {
  switch (s.shape) {
    case kMeshSource:
    case kBouncedSource:
      return scatter_from<kMeshSource>(s);
    case kDirection:
      return scatter_from<kDirection>(s);
    case kSky:
      return scatter_from<kSky>(s);
    case kPointSource:
      return scatter_from<kPointSource>(s);
    case kSphereSource:
      return scatter_from<kSphereSource>(s);
    case kDiscSource:
      return scatter_from<kDiscSource>(s);
    case kRectangleSource:
      return scatter_from<kRectangleSource>(s);
    default:
      return scatter_from<kPlaneSource>(s);
  }
}

size_t gloss(const LightStage& s) {
  switch (s.shape) {
    case kMeshSource:
      return gloss_towards_mesh(s);
    case kDirection:
      return gloss_from<kDirection>(s);
    case kSky:
      return gloss_from<kSky>(s);
    case kOpenSky:
      return gloss_from<kOpenSky>(s);
    case kSphereSource:
      return gloss_from<kSphereSource>(s);
    case kDiscSource:
      return gloss_from<kDiscSource>(s);
    case kRectangleSource:
      return gloss_from<kRectangleSource>(s);
    default:
      return gloss_from<kPlaneSource>(s);
  }
}

/// Zero is added where the ray is blocked, so that -0 turns to 0 alone and in packets.
void sum(const LightSum& s) {
  for (size_t k = 0; k < s.count;) {
    const uint32_t first = s.point[k];
    if (s.count - k >= kLanes && s.point[k + kLanes - 1] - first == kLanes - 1) {
      const Mask open = each_lane<Mask>(
          [&](size_t lane) { return s.blocked[k + lane] ? int64_t(0) : int64_t(-1); });
      for (size_t c = 0; c < 3; ++c)
        store(s.total[c] + first, load(s.total[c] + first) + where(open, load(s.given[c] + k)));
      k += kLanes;
    } else {
      for (size_t c = 0; c < 3; ++c)
        s.total[c][first] = s.total[c][first] + (s.blocked[k] ? 0 : s.given[c][k]);
      ++k;
    }
  }
}

void sum_parts(const LightParts& s) {
  const auto add = [](double* const(&columns)[3], const Chosen& at, const Three& c) {
    if (columns[0]) scatter3(columns, at, gather3(columns, at) + c);
  };
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Chosen at = chosen(s.point, k, s.count);
    const Three diffuse = load3(s.diffuse, k),
                specular = s.specular[0] ? load3(s.specular, k) : Three{},
                full = diffuse + specular;
    const Doubles open = each_lane([&](size_t lane) { return s.blocked[k + lane] ? 0.0 : 1.0; });
    const Three lit = full * (s.shadow[0] ? load3(s.shadow, k) : Three{open, open, open});
    add(s.sums.total, at, lit);
    add(s.sums.diffuse, at, diffuse);
    add(s.sums.specular, at, specular);
    add(s.sums.shadow, at, lit - full);
  }
}

}  // namespace
}  // namespace glint
