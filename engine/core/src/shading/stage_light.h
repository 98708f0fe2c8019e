// Light from one sample of one light (notes 4.13-4.16, light.h). Letters: x point, l direction to
// the light, d distance, z cosine at the light, g n geometric and shading normal, v to the viewer.
#pragma once
#include "shading/closure/lobes.h"
#include "shading/stage_bump.h"
#include "shading/stage_sample.h"

namespace glint {
namespace {

/// How far along g a ray starts that leaves to the back of its face: beyond the face, but not where
/// the lifted start is above it already. There the face is out of its way, and beyond the face it
/// would start within the body.
__attribute__((always_inline)) inline Doubles below(const LightStage& s, size_t k,
                                                    const Three& origin, const Three& g,
                                                    Doubles offset) {
  if (s.origin[0] == s.points_x[0]) return -offset;  // no smooth faces
  return choose(dot(origin - load3(s.points_x, k), g) > 0x1p-25 * offset, splat(0), -offset);
}

/// Where the shadow ray from `origin` to a mesh light's sample ends: before the surface, on the
/// side that it comes from. A lifted start may be on another than the point.
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
__attribute__((always_inline)) inline void shadow_ray(const LightStage& s, size_t k,
                                                      const Sample& sample,
                                                      const Appender& append) {
  const Three origin = start_towards(s, k, sample.l), g = load3(s.g, k);
  const Doubles offset = load(s.offset + k);
  constexpr bool endless = Shape == kDirection || Shape == kSky || Shape == kOpenSky;
  constexpr bool on_mesh = Shape == kMeshSource;
  const Three end = on_mesh ? before_mesh(s, k, sample, origin) : sample.end;
  const Three towards = endless ? sample.l : end - origin;
  // Off the surface along its normal, and back along the ray that found it: there it is free,
  // whatever stands on the surface. Beyond the face it would only get back to this.
  const Doubles beside = choose(dot(g, towards) < 0, below(s, k, origin, g, offset), offset);
  Three o = origin + beside * g - choose(beside < 0, splat(0), offset) * load3(s.d, k);
  if (s.has_fibre) {
    // Behind a fibre that it passes: neighbours of its segment are no fibres of their own.
    const Doubles through = way_through(s, k, sample.l);
    o = o + (endless ? through : smaller(through, 0.5 * length(towards))) * sample.l;
  }
  append(s.o, o);
  if (s.start_out[0]) append(s.start_out, origin);
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
__attribute__((always_inline)) inline size_t append_lit(const LightStage& s, size_t k,
                                                        const Sample& sample, Mask reached,
                                                        const Three& diffuse, const Three& specular,
                                                        size_t found) {
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

template <int Shape, class AnySample>
inline Three color_of(const LightStage& s, const AnySample& at) {
  if constexpr (Shape == kOpenSky) return at.color;
  if constexpr (Shape != kMeshSource) return splat3(s.color);
  const Mask front = dot(at.l, splat3(s.axis)) < 0;
  return {choose(front, splat(s.color[0]), splat(s.back[0])),
          choose(front, splat(s.color[1]), splat(s.back[1])),
          choose(front, splat(s.color[2]), splat(s.back[2]))};
}

/// How many directions are drawn for each point of the light.
template <int Shape>
inline double draws_of(const LightStage& s) {
  constexpr bool sky = Shape == kSky || Shape == kOpenSky;
  return sky ? 1.0 / kSkyDraws : Shape == kMeshSource ? 1 / s.share : 1;
}

/// Points of the light and drawn directions, weighed by how densely each of them falls there (the
/// balance heuristic): both get the same. Evenly: by the squares of that (the power heuristic).
template <int Shape, bool Drawn = false>
inline Doubles balanced(const LightStage& s, const Sample& at, const Highlights& seen) {
  const double draws = draws_of<Shape>(s);
  if (!s.evenly) return at.factor / (1 + draws * seen.density * at.spread);
  const Doubles times = seen.density * at.spread;
  return Drawn ? at.factor / draws / (times + 1 / times) : at.factor / (1 + times * times);
}

/// Intensity for what is matt: where that draws directions too both are weighed as `balanced` has
/// it, and the light is seen from as near as it is.
template <int Shape>
inline Doubles matt_factor(const LightStage& s, size_t k, const Three& x, const Sample& at,
                           Doubles cosine) {
  if constexpr (Shape != kMeshSource) return at.factor;
  if (!s.draws_matt) return at.factor;
  const Three to = splat3(s.end) - x;
  const Doubles d2 = larger(dot(to, to), splat(kNearest * s.near2)),
                nearer = larger(d2, splat(s.near2)) / d2,
                times = draws_of<Shape>(s) / kCircle * cosine * nearer * at.spread,
                weighed = nearer * at.factor / (1 + times * times);
  return choose(dot(load3(s.g, k), at.l) > 0, weighed, at.factor);
}

/// Of light that is spread out: gloss shows it as if it were matt, where reflected rays do not.
template <int Shape>
constexpr bool kSoftened = Shape == kMediumSource;

/// to(sample, reached, diffuse, specular): what a sample gives to a group of points before shadows,
/// unless it reaches none of those that are lit.
template <int Shape, bool Bent, class To>
__attribute__((always_inline)) inline void give(const LightStage& s, size_t k, To to) {
  const Mask lit = load(s.lit + k);
  if (!any(lit)) return;
  const Three n = load3(s.n, k), x = load3(s.points_x, k);
  const auto at = sample<Shape>(s, x);
  const Doubles cosine = dot(n, at.l);
  // Light from behind passes through fibres.
  const bool through = s.has_fibre;
  // Nor do the sides of the point's normal bind lobes with normals of their own.
  const bool turned = Bent && s.turns_lobes && !kSoftened<Shape>;
  const Mask front = cosine > 0,
             side = turned    ? ~Mask{}
                    : through ? front | (cosine < 0)
                              : front,
             met = lit & at.good & side & ~within<Shape>(s, k, at);
  if (!any(met)) return;
  const BumpShadow bump = bump_shadow<Bent>(s, k, n, at.l);
  const Mask reached = met & ~bump.hidden;
  if (!any(reached)) return;
  const Three color = color_of<Shape>(s, at), I = at.factor * color,
              to_matt = matt_factor<Shape>(s, k, x, at, cosine) * color;
  Three diffuse = cosine * (to_matt * load3(s.diffuse, k)), specular{};
  if (kSoftened<Shape> && s.gloss[0])
    specular = lowered<Bent>(s, k, n, at.l) * cosine * (I * load3(s.gloss, k));
  if ((s.highlights > 0 && !(kSoftened<Shape> || s.matt_alone)) || s.other_count > 0) {
    const Narrow narrow = s.draws ? narrow_terms(s, k, x) : Narrow{};
    const Highlights seen =
        highlights<false, Bent>(s, k, n, at.l, cosine, s.draws ? &narrow : nullptr);
    if (!kSoftened<Shape> && !s.matt_alone)
      specular = s.draws ? balanced<Shape>(s, at, seen) * (color * seen.light) : I * seen.light;
    if (s.other_count > 0 && !s.gloss_alone) diffuse = diffuse + where(front, to_matt * seen.matt);
    if (through | turned) diffuse = where(front, diffuse);
    if (through) {
      specular = turned ? specular : where(front, specular);
      if (!s.matt_alone) specular = specular + I * seen.fibre;
    }
  }
  if (bump.some) diffuse = bump.share * diffuse;
  to(at, reached, diffuse, specular);
}

/// The same for directions drawn from the narrow lobes, where they reach the light.
template <int Shape, bool Bent, class To>
__attribute__((always_inline)) inline void give_drawn(const LightStage& s, size_t k, To to) {
  const Mask lit = load(s.lit + k);
  if (!any(lit)) return;
  const Three n = load3(s.n, k), x = load3(s.points_x, k);
  const Narrow narrow = narrow_terms(s, k, x);
  if (!any(lit & (narrow.total > 0))) return;
  const Drawn drawn = sample_microfacets<false, Bent>(s, k, n, narrow);
  auto at = sample_at<Shape>(s, x, drawn.l);
  Three color = color_of<Shape>(s, at);
  if constexpr (Shape == kSky) {
    const SkyCell cell = sky_cell(*s.dome, at.l);
    color = cell.color;
    at.spread = cell.spread;
    at.factor = at.factor * cell.spread;
  }
  const Doubles cosine = dot(n, at.l);
  const Mask front = Bent && s.turns_lobes ? ~Mask{} : cosine > 0;
  const Mask reached =
      lit & drawn.good & at.good & front & ~bump_shadow<Bent>(s, k, n, at.l).hidden;
  if (!any(reached)) return;
  const Highlights seen = highlights<false, Bent>(s, k, n, at.l, cosine, &narrow);
  to(at, reached, Three{}, balanced<Shape, true>(s, at, seen) * (color * seen.light));
}

template <int Shape, bool Bent, bool Drawn, class To>
__attribute__((always_inline)) inline void give_either(const LightStage& s, size_t k, To to) {
  if constexpr (Drawn) give_drawn<Shape, Bent>(s, k, to);
  else give<Shape, Bent>(s, k, to);
}

template <int Shape, bool Bent, bool Drawn = false>
size_t light_from(const LightStage& s) {
  size_t found = 0;
  for (size_t k = s.first; k < s.count; k += kLanes)
    give_either<Shape, Bent, Drawn>(
        s, k, [&](const Sample& at, Mask reached, const Three& diffuse, const Three& specular) {
          found += append_lit<Shape>(s, k, at, reached, diffuse, specular, found);
        });
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
    const auto at = sample<Shape>(s, x);
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

/// Drawn directions towards a mesh light: what the light is there, the rays have to find out. They
/// begin at the point itself, of whose directions the density is, not where its shadow rays do.
template <bool Bent>
size_t gloss_towards_mesh(const LightStage& s) {
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(s.lit + k);
    if (!any(lit)) continue;
    const Three n = load3(s.n, k);
    const Narrow narrow = narrow_terms(s, k, load3(s.points_x, k));
    if (!any(lit & (narrow.total > 0))) continue;
    const Drawn drawn = sample_microfacets<false, Bent>(s, k, n, narrow);
    const Doubles cosine = dot(n, drawn.l);
    const Highlights seen = highlights<false, Bent>(s, k, n, drawn.l, cosine, &narrow);
    const Mask front = Bent && s.turns_lobes ? ~Mask{} : cosine > 0;
    const Mask reached = lit & drawn.good & front & nonzero(seen.light) &
                         ~bump_shadow<Bent>(s, k, n, drawn.l).hidden;
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

/// of<Shape>() for the one of the shapes that it is.
template <int... Shapes, class Of>
size_t with_shape(int shape, Of of) {
  size_t found = 0;
  static_cast<void>(((shape == Shapes && (found = of.template operator()<Shapes>(), true)) || ...));
  return found;
}

size_t light(const LightStage& s) {
  return with_shape<kDirection, kPointSource, kSphereSource, kDiscSource, kPlaneSource,
                    kRectangleSource, kSky, kOpenSky, kMeshSource, kMediumSource>(
      s.shape, [&]<int Shape>() {
        return is_bent(s) ? light_from<Shape, true>(s) : light_from<Shape, false>(s);
      });
}

size_t scatter(const LightStage& s) {
  return with_shape<kDirection, kPointSource, kSphereSource, kDiscSource, kPlaneSource,
                    kRectangleSource, kSky, kMeshSource, kMediumSource>(
      s.shape, [&]<int Shape>() { return scatter_from<Shape>(s); });
}

size_t gloss(const LightStage& s) {
  if (s.shape == kMeshSource)
    return is_bent(s) ? gloss_towards_mesh<true>(s) : gloss_towards_mesh<false>(s);
  return with_shape<kDirection, kSphereSource, kDiscSource, kPlaneSource, kRectangleSource, kSky,
                    kOpenSky>(s.shape, [&]<int Shape>() {
    return is_bent(s) ? light_from<Shape, true, true>(s) : light_from<Shape, false, true>(s);
  });
}

}  // namespace
}  // namespace glint
