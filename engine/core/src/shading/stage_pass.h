// Rays that leave surfaces: refracted, mirrored, straight on (notes 4.12-4.17). A lobe at a time,
// so that rays of one kind are neighbours. Letters: d direction, n shading normal, g geometric
// normal, T weight to the pixel, k coefficient of a lobe.
#pragma once
#include "shading/closure/distributions.h"
#include "shading/closure/table.h"
#include "shading/stage_bump.h"
#include "shading/stage_rows.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// Rays that arrive at a group of points.
struct Arriving {
  Three d, n, g;
  Mask outside;
  Arriving(const PassStage& s, const Chosen& at)
      : d(gather3(s.d, at)),
        n(gather3(s.n, at)),
        g(gather3(s.g, at)),
        outside(gather(s.outside, at)) {}
  /// As the lobe of that number among those that send rays on sees them: mirrored, they leave the
  /// surface.
  void turn(const PassStage& s, const Chosen& at, size_t number) {
    if (s.passing_columns == PassingTerm::kTurned) {
      const size_t first = size_t(s.passing_columns) * number + PassingTerm::kNormal;
      const Three own = gather3(s.passing + first * s.stride, s.stride, at);
      n = choose(nonzero(own), own, n);
    }
    if (any(nonzero(n - g))) n = lifted(n, g, -d);
  }
  Doubles relative(Doubles ior) const { return choose(outside, ior, 1 / ior); }
};

/// 1 where the lobe has none.
inline Doubles fresnel(const Arriving& ray, const LobeShape& lobe, Doubles ior) {
  if (!lobe.fresnel) return splat(1);
  const Doubles cosine = magnitude(dot(ray.d, ray.n));
  if (lobe.fresnel & GLINT_SCHLICK) return schlick_weight(cosine);
  return fresnel_reflectance(cosine, lobe.fresnel & GLINT_BOTH_SIDES ? ior : ray.relative(ior));
}

/// The unit direction refracted at the normal that the ray comes from; zero at total reflection.
inline Three refract(const Arriving& ray, Doubles relative_ior) {
  const Doubles cosine = -dot(ray.d, ray.n),
                sine2 = (1 - cosine * cosine) / (relative_ior * relative_ior);
  const Three bent =
      unit((1 / relative_ior) * ray.d + (cosine / relative_ior - root(1 - sine2)) * ray.n);
  return where(sine2 < 1, bent);
}

/// A number of the stage's places for each of the rays.
template <class Of>
inline Doubles place(const PassStage& s, const Chosen& at, Of of) {
  const Mask tag = gather(s.tags, at);
  return each_lane([&](size_t lane) {
    return of(s.places[(size_t(tag[lane]) >> RayTag::kDepth & 255) % s.levels]);
  });
}

inline Three reflect(const Arriving& ray) { return unit(ray.d - (2 * dot(ray.d, ray.n)) * ray.n); }

/// The half vectors that lie at the stage's place of a rough lobe, on the side that the rays come
/// from: of GGX as they are seen, else those of V-shaped grooves that are (Heitz, d'Eon
/// 2014).
inline Three facet_normal(const PassStage& s, const Chosen& at, const Arriving& ray,
                          Doubles exponent, int distribution) {
  const Three n = ray.n;
  const Doubles rest =
      smaller(place(s, at, [](const DiscPlace& p) { return p.radius2; }), splat(1 - 0x1p-53));
  Three t1, t2;
  frame(n, t1, t2);
  const Doubles across = place(s, at, [](const DiscPlace& p) { return p.azimuth[0]; }),
                along = place(s, at, [](const DiscPlace& p) { return p.azimuth[1]; });
  if (distribution == GLINT_GGX) {
    const Doubles width = root(1 / over_width2(exponent)), r = root(rest);
    return sample_visible_normal(n, t1, t2, width, width, seen_from(n, -ray.d), r * across,
                                 r * along);
  }
  const Doubles cosine2 = drawn_cosine2(rest, exponent, splat(distribution));
  const Three up = root(cosine2) * n, aside = root(1 - cosine2) * (across * t1 + along * t2);
  const Three h = up + aside;
  return choose(dot(ray.d, h) < 0, h, up - aside);
}

/// What rays of a rough lobe weigh that leave on `side` (1 or -1) of n along l, by the half vectors
/// h that `facet_normal` draws: less for what other facets hide (Smith; Walter and others 2007).
inline Doubles facets_shown(const Arriving& ray, const Three& h, const Three& l, double side,
                            Doubles exponent, int distribution) {
  if (distribution == GLINT_BLINN_PHONG) return splat(1);
  const Three v = seen_from(ray.n, -ray.d);
  const Doubles nv = smaller(larger(dot(ray.n, v), splat(0)), splat(1)),
                nl = smaller(larger(side * dot(ray.n, l), splat(0)), splat(1)),
                width2 = 1 / over_width2(exponent);
  const Doubles shown = Gloss(nl, nv, splat(1)).factor(width2, Doubles{}, splat(distribution));
  if (distribution == GLINT_GGX) return 0.5 * (nv + root(nv * nv + width2 * (1 - nv * nv))) * shown;
  const Doubles nh = dot(ray.n, h), vh = dot(v, h);
  const Mask twice = 2 * nv * nh < vh;  // the groove's other facet stands for this one too
  return where(nh > 0, shown * vh / (nh * choose(twice, splat(2), splat(1))));
}

inline Three weight(const PassStage& s, const Chosen& at) { return gather3(s.T, at); }

/// The coefficient of the lobe of that number among those that send rays on.
inline Three coefficient(const PassStage& s, const Chosen& at, size_t number) {
  return gather3(s.passing + size_t(s.passing_columns) * number * s.stride, s.stride, at);
}

/// A column of PassingTerm of that lobe, or its own number where the scene has none of a program.
inline Doubles number_of(const PassStage& s, const Chosen& at, size_t number, int column,
                         double own) {
  if (s.passing_columns == PassingTerm::kPlain) return splat(own);
  const size_t first = size_t(s.passing_columns) * number + size_t(column);
  return gather(s.passing + first * s.stride, at);
}

inline Doubles largest(const Three& a) {
  const Doubles x = magnitude(a.x), y = magnitude(a.y), z = magnitude(a.z),
                xy = choose(x < y, y, x);
  return choose(xy < z, z, xy);
}

/// Columns of some rays that are new in a queue.
struct NewRays {
  Appender append;
  NewRays(const RayEnd& to, uint32_t lanes) : append{lanes, *to.size} {
    *to.size += size_t(__builtin_popcount(lanes));
  }
  __attribute__((always_inline)) void operator()(const auto& columns, const auto& v) const {
    append(columns, v);
  }
  size_t count() const { return size_t(__builtin_popcount(append.lanes)); }
};

/// The tags' bits of refractions, after one more.
inline Mask refracted_once_more(Mask tag) {
  const Mask count = tag & RayTag::kAllRefractions;
  const Mask more = count < RayTag::kAllRefractions;  // -1 where there is room
  return (count - (more << RayTag::kRefractions)) | int64_t(1) << RayTag::kRefracted;
}

inline bool has(const PassStage& s, int kind) {
  bool has = false;
  for (uint32_t i = 0; i < s.lobe_count; ++i) has = has || s.lobes[i].kind == kind;
  return has;
}

/// Of rays that weigh little after some bounces, a part goes on for all (Russian roulette: Arvo,
/// Kirk 1990): of one path each surface has a number of its own, by how the path came there. What
/// it mirrors and what goes through count from opposite ends, so that of two halves just one goes
/// on. glass: before it. T: their weights; share: the chance of their way (Paths).
inline Mask goes_on(const PassStage& s, Mask depth, Mask glass, bool refracted, Three& T,
                    Doubles& share) {
  if (!(s.least > 0)) return ~Mask{};
  constexpr double kByDepth = 0.7548776662466927, kByGlass = 0.5698402909980532;
  const Doubles number = each_lane([&](size_t lane) {
    const double at =
        s.choice + kByDepth * double(depth[lane]) +
        kByGlass * double((glass[lane] & RayTag::kAllRefractions) >> RayTag::kRefractions);
    return at - __builtin_floor(at);
  });
  const Mask splits = depth <= int64_t(s.splits);
  const Doubles part = choose(splits, splat(1), smaller((1 / s.least) * largest(T), splat(1)));
  T = choose(part < 1, (1 / part) * T, T);
  share = share / part;  // fewer rays bring as much, and are held as much less
  return refracted ? number < part : number >= 1 - part;
}

inline bool passes(const LobeShape& lobe) { return kClosures[lobe.kind].passes; }

/// Which part of what the points give back is k, by largest channels.
__attribute__((noinline)) Doubles share_of(const PassStage& s, const Chosen& at, const Three& k) {
  const Arriving ray(s, at);
  const Doubles T = largest(weight(s, at)), diffuse = largest(gather3(s.diffuse, at)),
                own = largest(k);
  Doubles all = where(T > 0, diffuse / choose(T > 0, T, splat(1)));
  Three straight{};
  size_t number = 0;
  for (uint32_t i = 0; i < s.lobe_count; ++i) {
    const LobeShape& lobe = s.lobes[i];
    if (!passes(lobe)) continue;
    const size_t mine = number++;
    const Three given = coefficient(s, at, mine);
    if (lobe.kind == GLINT_TRANSPARENT) straight = straight + given;
    if (lobe.kind != GLINT_MIRROR && lobe.kind != GLINT_REFRACTION) continue;
    const bool rough = lobe.kind == GLINT_REFRACTION && lobe.exponent > 0;
    Doubles part = largest(given);
    if (lobe.fresnel && !rough) {
      const Doubles mirrored =
          fresnel(ray, lobe, number_of(s, at, mine, PassingTerm::kIor, lobe.ior));
      part = part * (lobe.kind == GLINT_MIRROR ? mirrored : 1 - mirrored);
    }
    all = all + part;
  }
  all = all + largest(straight);
  return where(own > 0, own / choose(own > all, own, all));
}

/// Rays that leave along d one bounce deeper, unless they weigh nothing or next to it. clear:
/// shadow rays see the surroundings there too. How many.
__attribute__((always_inline)) inline size_t bounce(const PassStage& s, const Chosen& at,
                                                    const Arriving& ray, Mask wanted,
                                                    const Three& d, const Three& k,
                                                    bool refracted = false, bool clear = false) {
  Three T = weight(s, at) * k;
  const Mask tag = gather(s.tags, at), depth = (tag >> RayTag::kDepth & 255) + 1;
  const Mask glass = refracted ? refracted_once_more(tag) : tag & RayTag::kAllRefractions;
  const Mask first = (depth == 1) & int64_t(refracted) << RayTag::kTransmitted;
  // what goes to the wrong side of the face is lost, as in Cycles
  wanted &= refracted ? dot(ray.g, d) < 0 : dot(ray.g, d) > 0;
  wanted &= nonzero(T) & (depth <= int64_t(s.max_bounces)) & ~(largest(T) < s.cutoff);
  Doubles share = gather(s.share, at);
  wanted &= goes_on(s, depth, tag, refracted, T, share);
  const uint32_t lanes = bits(wanted) & lanes_of(at);
  if (!lanes) return 0;
  const RayEnd& to = s.bounced;
  const NewRays add(to, lanes);
  if (s.shares) share = share * share_of(s, at, k);
  const Three x = gather3(s.x, at);
  const Doubles offset = gather(s.offset, at);
  add(to.o, x + choose(dot(ray.g, d) < 0, -offset, offset) * ray.g);
  add(to.d, d);
  add(to.T, T);
  add(to.start, x);
  add(to.t_min, splat(0));
  add(to.t_max, splat(__builtin_inf()));
  add(to.from, splat(0));
  add(to.share, share);
  const Mask kept = tag & RayTag::kPast & ~(int64_t(!clear) << RayTag::kSkyless);
  add(to.tags, kept | first | depth << RayTag::kDepth | glass);
  return add.count();
}

/// Rays through glass, and those that its facets mirror inside.
inline void refract_rows(const PassStage& s, const LobeShape& lobe, size_t number,
                         PassedRays& count) {
  const bool clear = has(s, GLINT_TRANSPARENT);
  for (size_t i = 0; i < s.count; i += kLanes) {
    const Chosen at = chosen(s.rows, i, s.count);
    Arriving ray(s, at);
    ray.turn(s, at, number);
    const Three k = coefficient(s, at, number);
    const bool rough = lobe.exponent > 0;
    const Doubles ior = number_of(s, at, number, PassingTerm::kIor, lobe.ior),
                  index = ray.relative(ior);
    const Doubles exponent = number_of(s, at, number, PassingTerm::kExponent, lobe.exponent);
    Arriving facet = ray;
    if (rough)
      facet.n = choose(exponent > 0, facet_normal(s, at, ray, exponent, lobe.distribution), ray.n);
    const Three d = refract(facet, index);
    const Doubles back = lobe.fresnel ? fresnel(facet, lobe, ior) : splat(0);
    const auto shown = [&](const Three& l, double side) {
      const Doubles of_facets = facets_shown(ray, facet.n, l, side, exponent, lobe.distribution);
      return choose(exponent > 0, of_facets, splat(1));
    };
    Three through = lobe.fresnel ? (1 - back) * k : k;
    if (rough) through = shown(d, -1) * through;
    count.refraction += bounce(s, at, ray, nonzero(d), d, through, true, clear);
    if (!rough || !lobe.fresnel) continue;
    // what facets mirror inside goes on as well; from outside highlights do that
    const Three l = reflect(facet);
    const Mask inside = (exponent > 0) & ~ray.outside & (dot(l, ray.n) > 0);
    if (bits(inside)) count.mirror += bounce(s, at, ray, inside, l, shown(l, 1) * back * k);
  }
}

/// body(lobe, number) for those of the lobes of a kind: their numbers among those that send rays
/// on.
template <class Body>
inline void each_lobe(const PassStage& s, int kind, Body body) {
  size_t number = 0;
  for (uint32_t i = 0; i < s.lobe_count; ++i) {
    if (s.lobes[i].kind == kind) body(s.lobes[i], number);
    number += passes(s.lobes[i]);
  }
}

/// Of the lobes that share a normal.
inline size_t mirror_rows(const PassStage& s, int32_t normal_slot) {
  size_t count = 0;
  for (size_t i = 0; i < s.count; i += kLanes) {
    const Chosen at = chosen(s.rows, i, s.count);
    Arriving ray(s, at);
    Three k{};
    each_lobe(s, GLINT_MIRROR, [&](const LobeShape& lobe, size_t number) {
      if (lobe.normal_slot != normal_slot) return;
      ray.turn(s, at, number);
      const Doubles ior = number_of(s, at, number, PassingTerm::kIor, lobe.ior);
      k = k + fresnel(ray, lobe, ior) * coefficient(s, at, number);
    });
    if (any(nonzero(k))) count += bounce(s, at, ray, nonzero(k), reflect(ray), k);
  }
  return count;
}

/// The same rays from behind the surfaces. How many.
inline size_t go_on(const PassStage& s, const Chosen& at, const Three& k) {
  const Three T = weight(s, at) * k;
  const Mask tag = gather(s.tags, at), opaque = (k.x + k.y + k.z) / 3 < 0.5;
  const Mask wants = tag & ~opaque & RayTag::kWants;
  const Mask wanted = nonzero(k) & ((tag >> RayTag::kStraight & 255) < int64_t(s.max_straight)) &
                      (nonzero(T) | ((wants & (int64_t(1) << RayTag::kWantsData)) != 0));
  const uint32_t lanes = bits(wanted) & lanes_of(at);
  if (!lanes) return 0;
  const RayEnd& to = s.straight;
  const NewRays add(to, lanes);
  const auto keep = [&](const auto& columns, const auto& from) {
    if constexpr (std::is_array_v<std::remove_reference_t<decltype(from)>>)
      add(columns, gather3(from, at));
    else add(columns, gather(from, at));
  };
#define RAY_COLUMN(name, width, first, kept) \
  if constexpr (kept) keep(to.name, s.name);
#include "shading/path_state.inc"
  const Doubles t = gather(s.t, at);
  add(to.T, T);
  add(to.t_min, beyond(t));
  add(to.from, t);
  const Mask kept =
      tag & (bit_range(RayTag::kSlot, RayTag::kStraightLast) | RayTag::kPast | RayTag::kGlass);
  const Mask dimmed = (k.x != 1) | (k.y != 1) | (k.z != 1);
  add(to.tags, (kept + (dimmed & int64_t(1) << RayTag::kStraight)) | wants);
  return add.count();
}

inline size_t straight_rows(const PassStage& s) {
  size_t count = 0;
  for (size_t i = 0; i < s.count; i += kLanes) {
    const Chosen at = chosen(s.rows, i, s.count);
    Three k{};
    each_lobe(s, GLINT_TRANSPARENT,
              [&](const LobeShape&, size_t number) { k = k + coefficient(s, at, number); });
    count += go_on(s, at, k);
  }
  return count;
}

/// Whether no lobe before that one mirrors at the same normal.
inline bool is_first_mirror(const PassStage& s, uint32_t i) {
  bool first = s.lobes[i].kind == GLINT_MIRROR;
  for (uint32_t j = 0; j < i; ++j)
    first = first &&
            !(s.lobes[j].kind == GLINT_MIRROR && s.lobes[j].normal_slot == s.lobes[i].normal_slot);
  return first;
}

PassedRays pass(const PassStage& s) {
  PassedRays count{};
  each_lobe(s, GLINT_REFRACTION,
            [&](const LobeShape& lobe, size_t number) { refract_rows(s, lobe, number, count); });
  for (uint32_t i = 0; i < s.lobe_count; ++i)
    if (is_first_mirror(s, i)) count.mirror += mirror_rows(s, s.lobes[i].normal_slot);
  if (has(s, GLINT_TRANSPARENT)) count.transparent = straight_rows(s);
  return count;
}

}  // namespace
}  // namespace glint
