// Light from one sample of one light (notes 4.13-4.16, light.h). Letters: x point, l direction to
// the light, d distance, z cosine at the light, g n geometric and shading normal, v to the viewer.
#pragma once
#include "shading/closure/lobes.h"
#include "shading/light/shapes.h"
#include "shading/stage_bump.h"

namespace glint {
namespace {

/// How far along g a ray starts that leaves to the back of its face: beyond the face, but not where
/// the lifted start is above it already. There the face is out of its way, and beyond the face it
/// would start within the body.
__attribute__((always_inline)) inline Doubles below(const LitPoints& s, size_t k,
                                                    const Three& origin, const Three& g,
                                                    Doubles offset) {
  if (s.origin[0] == s.x[0]) return -offset;  // no smooth faces
  return choose(dot(origin - load3(s.x, k), g) > 0x1p-25 * offset, splat(0), -offset);
}

/// Where the segment ends of a shadow ray that leaves the surface at `origin`.
template <class Shape>
inline decltype(auto) end_of(const LitPoints& s, size_t k, const LightSample& light,
                             const SeenSample& at, const Three& origin) {
  if constexpr (!Shape::kTwoSided) return (at.end);      // as it is: copies of vectors are slow
  else if (s.origin[0] == s.x[0]) return Three(at.end);  // no smooth faces
  else return Shape::end(light, at, origin, nonzero(origin - load3(s.x, k)));
}

/// The open segment from the point to the sample; its far end stops short of what the sample lies
/// on.
template <class Shape>
__attribute__((always_inline)) inline void shadow_ray(const LitPoints& s, const LightSample& light,
                                                      const ShadowRays& rays, size_t k,
                                                      const SeenSample& at,
                                                      const Appender& append) {
  const Three origin = start_towards(s, k, at.l), g = load3(s.g, k);
  const Doubles offset = load(s.offset + k);
  constexpr bool endless = is_endless(Shape::kShape);
  const Three& end = end_of<Shape>(s, k, light, at, origin);
  const Three towards = endless ? at.l : end - origin;
  // Off the surface along its normal, and back along the ray that found it: there it is free,
  // whatever stands on the surface. Beyond the face it would only get back to this.
  const Doubles beside = choose(dot(g, towards) < 0, below(s, k, origin, g, offset), offset);
  Three o = origin + beside * g - choose(beside < 0, splat(0), offset) * load3(s.d, k);
  if (s.lobes.has_fibre) {
    // Behind a fibre that it passes: neighbours of its segment are no fibres of their own.
    const Doubles through = way_through(s, k, at.l);
    o = o + (endless ? through : smaller(through, 0.5 * length(towards))) * at.l;
  }
  append(rays.o, o);
  if (rays.start[0]) append(rays.start, origin);
  if (rays.end[0]) append(rays.end, end);
  if (endless) {
    append(rays.to, at.l);
    return append(rays.t_max, splat(__builtin_inf()));
  }
  const Way to = way(end - o);
  append(rays.to, to.d);
  append(rays.t_max, to.length - rounding(larger(max_abs(end), max_abs(o))));
}

/// Points of the light and drawn directions, weighed by the balance heuristic, or the power
/// heuristic as if there were one of each.
template <class Shape, bool Drawn = false>
inline Doubles weighed(const LampSample& lamp, const SeenSample& at, const Highlights& seen) {
  const double draws = Shape::draws(lamp.light);
  if (!lamp.policy.power_heuristic) return at.factor / (1 + draws * seen.density * at.inverse_pdf);
  const Doubles times = seen.density * at.inverse_pdf;
  return Drawn ? at.factor / draws / (times + 1 / times) : at.factor / (1 + times * times);
}

/// Intensity for what is matt: where that draws directions too, both are weighed by the power
/// heuristic, and the light is seen from as near as it is.
template <class Shape>
inline Doubles diffuse_factor(const LitPoints& s, const LampSample& lamp, size_t k, const Three& x,
                              const SeenSample& at, Doubles cosine) {
  if constexpr (!Shape::kTwoSided) return at.factor;
  if (!lamp.policy.draws_diffuse) return at.factor;
  const LightSample& light = lamp.light;
  const double near2 = light.mesh.near2;
  const Three to = splat3(light.center) - x;
  const Doubles d2 = larger(dot(to, to), splat(kNearest * near2)),
                nearer = larger(d2, splat(near2)) / d2,
                times = Shape::draws(light) / kCircle * cosine * nearer * at.inverse_pdf,
                factor = nearer * at.factor / (1 + times * times);
  return choose(dot(load3(s.g, k), at.l) > 0, factor, at.factor);
}

/// Where the inner side of a light is seen from a face that turns away from it, as by the outside
/// of the same body.
template <class Shape>
inline Mask is_within(const LitPoints& s, const LightSample& light, size_t k,
                      const SeenSample& at) {
  if constexpr (!Shape::kTwoSided) return Mask{};
  return (dot(at.l, splat3(light.axis)) >= 0) & (dot(at.l, load3(s.g, k)) <= 0);
}

inline Narrow narrow_terms(const LitPoints& s, const LightSample& light, size_t k, const Three& x) {
  const Three to = splat3(light.center) - x;
  return narrow_terms<false>(s, k, light.draws.least_near * dot(to, to) + light.draws.least);
}

/// to(at, reached, diffuse, specular): the contribution of a sample to a group of points before
/// shadows, unless it reaches none of those that are lit.
template <class Shape, bool Bent, class To>
__attribute__((always_inline)) inline void contribute_sample(const LitPoints& s,
                                                             const LampSample& lamp, size_t k,
                                                             To to) {
  const Mask lit = load(lamp.lit + k);
  if (!any(lit)) return;
  const LightSample& light = lamp.light;
  const LightPolicy& policy = lamp.policy;
  const Three n = load3(s.n, k), x = load3(s.x, k);
  const auto at = sample_of<Shape>(light, x);
  const Doubles cosine = dot(n, at.l);
  // Light from behind passes through fibres.
  const bool through = s.lobes.has_fibre;
  // Nor do the sides of the point's normal bind lobes with normals of their own.
  const bool turned = Bent && s.lobes.turns && !Shape::kSoftened;
  const Mask front = cosine > 0,
             side = turned    ? ~Mask{}
                    : through ? front | (cosine < 0)
                              : front,
             facing = lit & at.good & side & ~is_within<Shape>(s, light, k, at);
  if (!any(facing)) return;
  const BumpShadow bump = bump_shadow<Bent>(s, k, n, at.l);
  const Mask reached = facing & ~bump.hidden;
  if (!any(reached)) return;
  const Three color = Shape::color(light, at), I = at.factor * color,
              to_diffuse = diffuse_factor<Shape>(s, lamp, k, x, at, cosine) * color;
  Three diffuse{}, specular{};
  if (policy.on_diffuse) diffuse = cosine * (to_diffuse * load3(s.diffuse, k));
  if (Shape::kSoftened && s.gloss[0] && policy.on_glossy)
    specular = lowered<Bent>(s, k, n, at.l) * cosine * (I * load3(s.gloss, k));
  const bool glossy = policy.on_glossy && !Shape::kSoftened;
  if ((s.lobes.highlights > 0 && glossy) || s.lobes.other_count > 0) {
    const bool draws = policy.draws && light.draws.on;
    const Narrow narrow = draws ? narrow_terms(s, light, k, x) : Narrow{};
    const Highlights seen =
        highlights<false, Bent>(s, k, n, at.l, cosine, draws ? &narrow : nullptr, glossy);
    if (glossy)
      specular = draws ? weighed<Shape>(lamp, at, seen) * (color * seen.light) : I * seen.light;
    if (s.lobes.other_count > 0 && policy.on_diffuse)
      diffuse = diffuse + where(front, to_diffuse * seen.matt);
    if (through | turned) diffuse = where(front, diffuse);
    if (through) {
      specular = turned ? specular : where(front, specular);
      if (policy.on_glossy) specular = specular + I * seen.fibre;
    }
  }
  if (bump.some) diffuse = bump.share * diffuse;
  to(at, reached, diffuse, specular);
}

/// The same for directions drawn from the narrow lobes, where they reach the light.
template <class Shape, bool Bent, class To>
__attribute__((always_inline)) inline void contribute_drawn(const LitPoints& s,
                                                            const LampSample& lamp, size_t k,
                                                            To to) {
  const Mask lit = load(lamp.lit + k);
  if (!any(lit)) return;
  const LightSample& light = lamp.light;
  const Three n = load3(s.n, k), x = load3(s.x, k);
  const Narrow narrow = narrow_terms(s, light, k, x);
  if (!any(lit & (narrow.total > 0))) return;
  const Drawn drawn =
      sample_microfacets<false, Bent>(s, k, n, narrow, LobePlace(light.draws.place));
  const auto at = sample_towards<Shape>(light, x, drawn.l);
  const Doubles cosine = dot(n, at.l);
  const Mask front = Bent && s.lobes.turns ? ~Mask{} : cosine > 0;
  const Mask reached =
      lit & drawn.good & at.good & front & ~bump_shadow<Bent>(s, k, n, at.l).hidden;
  if (!any(reached)) return;
  const Highlights seen = highlights<false, Bent>(s, k, n, at.l, cosine, &narrow);
  to(at, reached, Three{},
     weighed<Shape, true>(lamp, at, seen) * (Shape::color(light, at) * seen.light));
}

template <class Shape, bool Bent, bool IsDrawn, class To>
__attribute__((always_inline)) inline void contribute(const LitPoints& s, const LampSample& lamp,
                                                      size_t k, To to) {
  if constexpr (IsDrawn) contribute_drawn<Shape, Bent>(s, lamp, k, to);
  else contribute_sample<Shape, Bent>(s, lamp, k, to);
}

/// A row for each of the lanes `reached` that the sample adds something to; how many.
template <class Shape>
__attribute__((always_inline)) inline size_t append_lit(const LitPoints& s, const LampSample& lamp,
                                                        const ShadowRays& rays, size_t k,
                                                        const SeenSample& at, Mask reached,
                                                        const Three& diffuse, const Three& specular,
                                                        size_t found) {
  reached &= nonzero(diffuse) | nonzero(specular);
  const uint32_t lanes = bits(reached);
  if (!lanes) return 0;
  const Appender append{lanes, found};
  append.number(rays.point, uint32_t(k));
  append(rays.diffuse, rays.specular[0] ? diffuse : diffuse + specular);
  if (rays.specular[0]) append(rays.specular, specular);
  if (lamp.policy.casts_shadow) shadow_ray<Shape>(s, lamp.light, rays, k, at, append);
  return size_t(__builtin_popcount(lanes));
}

template <class Shape, bool Bent, bool IsDrawn>
size_t light_from(const LitPoints& s, const LampSample& lamp, const ShadowRays& rays) {
  size_t found = 0;
  for (size_t k = s.first; k < s.count; k += kLanes)
    contribute<Shape, Bent, IsDrawn>(
        s, lamp, k,
        [&](const SeenSample& at, Mask reached, const Three& diffuse, const Three& specular) {
          found += append_lit<Shape>(s, lamp, rays, k, at, reached, diffuse, specular, found);
        });
  return found;
}

/// The contribution of a sample to points where there is no surface; its rays begin there.
template <class Shape>
size_t scatter_from(const LitPoints& s, const LampSample& lamp, const ShadowRays& rays) {
  constexpr bool endless = is_endless(Shape::kShape);
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(lamp.lit + k);
    if (!any(lit)) continue;
    const Three x = load3(s.x, k);
    const auto at = sample_of<Shape>(lamp.light, x);
    const Three diffuse = at.factor * (Shape::color(lamp.light, at) * load3(s.diffuse, k));
    const uint32_t lanes = bits(lit & at.good & nonzero(diffuse));
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(rays.point, uint32_t(k));
    append(rays.diffuse, diffuse);
    if (rays.specular[0]) append(rays.specular, Three{});
    append(rays.o, x);
    append(rays.end, at.end);
    const Way to = way(at.end - x);
    append(rays.to, endless ? at.l : to.d);
    append(rays.t_max, endless ? splat(__builtin_inf())
                               : to.length - rounding(larger(max_abs(at.end), max_abs(x))));
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

/// Drawn directions towards a mesh light: what the light is there, the rays have to find out. They
/// begin at the point itself, of whose directions the pdf is, not where its shadow rays do.
template <bool Bent>
size_t gloss_towards_mesh(const LitPoints& s, const LampSample& lamp, const ShadowRays& rays) {
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(lamp.lit + k);
    if (!any(lit)) continue;
    const Three n = load3(s.n, k);
    const Narrow narrow = narrow_terms(s, lamp.light, k, load3(s.x, k));
    if (!any(lit & (narrow.total > 0))) continue;
    const Drawn drawn =
        sample_microfacets<false, Bent>(s, k, n, narrow, LobePlace(lamp.light.draws.place));
    const Doubles cosine = dot(n, drawn.l);
    const Highlights seen = highlights<false, Bent>(s, k, n, drawn.l, cosine, &narrow);
    const Mask front = Bent && s.lobes.turns ? ~Mask{} : cosine > 0;
    const Mask reached = lit & drawn.good & front & nonzero(seen.light) &
                         ~bump_shadow<Bent>(s, k, n, drawn.l).hidden;
    const uint32_t lanes = bits(reached);
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(rays.point, uint32_t(k));
    append(rays.diffuse, seen.light);
    append(rays.pdf, seen.density);
    const Three g = load3(s.g, k);
    const Doubles offset = load(s.offset + k);
    const Doubles beside = choose(dot(g, drawn.l) < 0, -offset, offset);
    append(rays.o, load3(s.x, k) + beside * g - beside * load3(s.d, k));
    append(rays.to, drawn.l);
    append(rays.t_max, splat(__builtin_inf()));
    if (rays.end[0]) append(rays.end, drawn.l);  // until it is known
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

size_t light(const LitPoints& s, const LampSample& lamp, const ShadowRays& rays) {
  size_t found = 0;
  with_shape(kShapes, lamp.light.shape, [&]<class Shape>() {
    found = is_bent(s) ? light_from<Shape, true, false>(s, lamp, rays)
                       : light_from<Shape, false, false>(s, lamp, rays);
  });
  return found;
}

size_t scatter(const LitPoints& s, const LampSample& lamp, const ShadowRays& rays) {
  size_t found = 0;
  with_shape(kScattered, lamp.light.shape,
             [&]<class Shape>() { found = scatter_from<Shape>(s, lamp, rays); });
  return found;
}

size_t gloss(const LitPoints& s, const LampSample& lamp, const ShadowRays& rays) {
  if (lamp.light.shape == LightShape::kMesh)
    return is_bent(s) ? gloss_towards_mesh<true>(s, lamp, rays)
                      : gloss_towards_mesh<false>(s, lamp, rays);
  size_t found = 0;
  with_shape(kDrawn, lamp.light.shape, [&]<class Shape>() {
    found = is_bent(s) ? light_from<Shape, true, true>(s, lamp, rays)
                       : light_from<Shape, false, true>(s, lamp, rays);
  });
  return found;
}

}  // namespace
}  // namespace glint
