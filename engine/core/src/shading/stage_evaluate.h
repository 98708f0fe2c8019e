// Materials that vary over the surface or send rays on (notes 4.12-4.17). Letters: T weight to the
// pixel, k coefficient of a lobe.
#pragma once
#include "program/run.h"
#include "shading/closure/oren_nayar.h"
#include "shading/stage_ambient.h"
#include "shading/stage_bump.h"
#include "shading/stage_inputs.h"
#include "shading/stage_math.h"
#include "shading/stage_rows.h"

namespace glint {
namespace {

inline OnMesh on_mesh(const EvaluateStage& s, const Chosen& at) {
  OnMesh p;
  p.weights[1] = gather(s.weights[0], at);
  p.weights[2] = gather(s.weights[1], at);
  p.weights[0] = 1 - p.weights[1] - p.weights[2];
  find_primitives(
      s.tables, [&](size_t lane) { return s.instance[at.row[lane]]; },
      [&](size_t lane) { return s.primitive[at.row[lane]]; }, p);
  return p;
}

inline void add_part(double* const (&part)[3], const Chosen& at, const Three& c) {
  if (part[0]) scatter3(part, at, gather3(part, at) + c);
}

constexpr double kMostStretch = 128;

/// Which of the points are on strands, where bumps hide nothing.
inline Mask on_strands(const EvaluateStage& s, const Chosen& at) {
  return each_lane<Mask>([&](size_t lane) {
    const uint32_t group = s.tables.instances[s.instance[at.row[lane]]].group;
    const bool here = s.tables.geometries[s.tables.groups[group].geometry].kind == GLINT_STRANDS;
    return here ? int64_t(-1) : int64_t(0);
  });
}

/// Normals n as microfacets have them: lifted, where bumps do not leave them.
inline Three micro_normal(const EvaluateStage& s, const Chosen& at, const Three& n) {
  if (s.bump_shadowing < GLINT_BUMP_CHIANG) return n;
  return choose(on_strands(s, at), n, lifted(n, gather3(s.g, at), -gather3(s.d, at)));
}

/// The points' own normals as microfacets have them, found once for all lobes.
class MicroNormal {
 public:
  const Three& of(const EvaluateStage& s, const Chosen& at) {
    if (!known_) n_ = micro_normal(s, at, gather3(s.n, at));
    known_ = true;
    return n_;
  }

 private:
  bool known_ = false;
  Three n_;
};

/// What the lobes come to without light, and what lights need of them.
struct Lobes {
  Three glow, diffuse, translucent;
  Three ambient = {};  // of glow, where some surfaces see light lower
  Mask lit = {}, passes = {};
  int rows[kLobeKinds] = {};  // of the layout, that have something
  int passing_count = 0;
  MicroNormal micro;
};

/// The next row of a kind.
inline double* next_row(const EvaluateStage& s, int kind, Lobes& sum) {
  return s.specular + size_t(s.layout->row(kind, sum.rows[kind]++)) * s.stride;
}

/// A number of a lobe: its own, or what the program gives from 0 to that.
inline Doubles lobe_number(const OnMesh& p, double own, int32_t number) {
  return number == 0 ? splat(own) : clamped(finite_or_zero(slot(p, number)), 0, own);
}

/// As MicrofacetRow has it.
inline Doubles specular_fresnel(const OnMesh& p, const LobeShape& lobe) {
  const double own = MicrofacetRow::fresnel(lobe.fresnel, lobe.ior);
  return own > 0 ? lobe_ior(p, lobe) : splat(own);
}

/// A row of a highlight. kind: SPECULAR, or MIRROR for one of theirs.  normal, stretch: 0 for none.
inline void set_microfacet(const EvaluateStage& s, const Chosen& at, int kind, const Three& Tk,
                           Doubles exponent, Doubles masking2, Doubles fresnel, int distribution,
                           const Three& normal, const Three& stretch, Lobes& sum) {
  const int width = s.layout->of[kind].width;
  double* const row = next_row(s, kind, sum);
  scatter3(row, s.stride, at, Tk);
  scatter(row + MicrofacetRow::kExponent * s.stride, at, exponent);
  if (width >= MicrofacetRow::kShaped) {
    scatter(row + MicrofacetRow::kMasking * s.stride, at, masking2);
    scatter(row + MicrofacetRow::kFresnel * s.stride, at, fresnel);
    scatter(row + MicrofacetRow::kDistribution * s.stride, at, splat(distribution));
  }
  if (width >= MicrofacetRow::kTurned)
    scatter3(row + MicrofacetRow::kNormal * s.stride, s.stride, at, normal);
  if (width == MicrofacetRow::kStretched)
    scatter3(row + MicrofacetRow::kStretch * s.stride, s.stride, at, stretch);
  sum.lit |= nonzero(Tk);
}

/// A FIBRE lobe. Where there is no fibre it is what stands for it on other surfaces
/// (semantics/lobes.md).
inline void set_fibre(const EvaluateStage& s, const Chosen& at, const OnMesh& p, const Three& Tk,
                      const Three& k, const LobeShape& lobe, Lobes& sum) {
  double* const row = next_row(s, lobe.kind, sum);
  const Three t = lobe.fibre_slot > 0 ? finite_or_zero(slots3(p, lobe.fibre_slot)) : Three{};
  const Mask here = nonzero(t);
  const Three given = where(here, Tk);
  scatter3(row, s.stride, at, given);
  // as long as the fibre is thick, as a scene's lengths are here
  scatter3(row + FibreRow::kTangent * s.stride, s.stride, at, splat(s.tables.view->scale) * t);
  sum.lit |= nonzero(given);
  if (lobe.kind == GLINT_FIBRE_DIFFUSE) return void(sum.diffuse = sum.diffuse + where(~here, k));
  const Doubles exponent = lobe_number(p, lobe.exponent, lobe.exponent_slot),
                fan = lobe_number(p, lobe.fan, lobe.fan_slot);
  scatter(row + FibreRow::kExponent * s.stride, at, exponent);
  scatter(row + FibreRow::kFan * s.stride, at, choose(fan > 0, 1 / fan, splat(0)));
  scatter(row + FibreRow::kTilt * s.stride, at, splat(lobe.tilt));
  if (lobe.kind == GLINT_FIBRE_SPECULAR)
    set_microfacet(s, at, GLINT_SPECULAR, where(~here, (exponent + 2) / 8 * Tk), exponent, splat(0),
                   splat(0), GLINT_BLINN_PHONG, Three{}, Three{}, sum);
}

/// A normal of the program, unit; `other` where it gives none. slot: 0 for that.
inline Three given_normal(const OnMesh& p, int32_t slot, const Three& other) {
  if (slot == 0) return other;
  const Three n = unit(finite_or_zero(slots3(p, slot)));
  return choose(nonzero(n), n, other);
}

/// Whether a lobe that shines has microfacets, which bumps hide.
inline bool is_micro(const EvaluateStage& s, const LobeShape& lobe) {
  return s.bump_shadowing != GLINT_BUMP_NONE && (lobe.kind != GLINT_SPECULAR || lobe.masking > 0);
}

/// The normal of a lobe that shines, 0 where it is the point's. k: 0 where the lobe does not face
/// the viewer, as microfacets have to.
inline Three lobe_normal(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                         const LobeShape& lobe, Lobes& sum, Three& k) {
  const bool micro = is_micro(s, lobe);
  const Three point = gather3(s.n, at), v = -gather3(s.d, at);
  Three n = given_normal(p, lobe.normal_slot, point);
  if (micro) {
    n = lobe.normal_slot == 0 ? sum.micro.of(s, at) : micro_normal(s, at, n);
    k = where(dot(n, v) > 0, k);
  }
  return where(nonzero(n - point), n);
}

/// What a lobe is stretched along, across its normal; 0 where it is not.
inline Three lobe_stretch(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                          const LobeShape& lobe, const Three& own) {
  if (lobe.stretch_slot == 0) return Three{};
  const Three n = choose(nonzero(own), own, gather3(s.n, at)),
              t = finite_or_zero(slots3(p, lobe.stretch_slot));
  const Doubles size = smaller(larger(length(t), splat(1 / kMostStretch)), splat(kMostStretch));
  return size * unit(cross(unit(cross(n, t)), n));
}

/// A SHEEN or TOON lobe: its two numbers follow k.
inline void set_two_numbers(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                            const Three& Tk, const LobeShape& lobe, Lobes& sum) {
  static_assert(SheenRow::kWidth == ToonRow::kSize && SheenRow::kLean == ToonRow::kSmooth);
  double* const row = next_row(s, lobe.kind, sum);
  scatter3(row, s.stride, at, Tk);
  sum.lit |= nonzero(Tk);
  scatter(row + SheenRow::kWidth * s.stride, at, lobe_number(p, lobe.width, lobe.width_slot));
  scatter(row + SheenRow::kLean * s.stride, at, lobe_number(p, lobe.lean, lobe.lean_slot));
}

inline void set_specular(const EvaluateStage& s, const Chosen& at, const OnMesh& p, Three Tk,
                         const LobeShape& lobe, Lobes& sum) {
  Three normal{};
  if (lobe.fresnel & GLINT_OUTSIDE) Tk = where(gather(s.outside, at), Tk);
  if (lobe.normal_slot != 0 || is_micro(s, lobe)) normal = lobe_normal(s, at, p, lobe, sum, Tk);
  Doubles masking = lobe_number(p, lobe.masking, lobe.masking_slot), exponent;
  if (lobe.distribution != GLINT_BLINN_PHONG) {
    // of a power as wide; the density of half vectors over that of the normal is over 4 alpha^2
    masking = larger(masking, splat(kLeastWidth));
    exponent = 2 / (masking * masking) - 2;
    Tk = 0.125 * (exponent + 2) * Tk;
  } else {
    exponent = lobe_number(p, lobe.exponent, lobe.exponent_slot);
  }
  set_microfacet(s, at, GLINT_SPECULAR, Tk, exponent, masking * masking, specular_fresnel(p, lobe),
                 lobe.distribution, normal, lobe_stretch(s, at, p, lobe, normal), sum);
}

/// A MIRROR lobe as the highlight of `thrown` that throws its light on to what is matt: of GGX as
/// wide as that, by Walter, Marschner, Li, Torrance 2007 (Microfacet models for refraction).
__attribute__((noinline)) void set_thrown(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                                          const LobeShape& lobe, Three Tk, Lobes& sum) {
  Three normal{};
  if (lobe.normal_slot != 0 || is_micro(s, lobe)) normal = lobe_normal(s, at, p, lobe, sum, Tk);
  set_microfacet(s, at, GLINT_MIRROR, splat((s.thrown + 2) / 8) * Tk, splat(s.thrown),
                 splat(2 / (s.thrown + 2)), specular_fresnel(p, lobe), GLINT_BLINN_PHONG, normal,
                 Three{}, sum);
}

inline void set_passing(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                        const LobeShape& lobe, Three k, Lobes& sum) {
  double* column = s.passing + size_t(s.passing_columns) * size_t(sum.passing_count++) * s.stride;
  if (lobe.kind == GLINT_MIRROR || lobe.kind == GLINT_REFRACTION) {
    Three normal{};
    if (lobe.normal_slot != 0 || is_micro(s, lobe)) normal = lobe_normal(s, at, p, lobe, sum, k);
    if (s.passing_columns == PassingTerm::kTurned)
      scatter3(column + PassingTerm::kNormal * s.stride, s.stride, at, normal);
    if (s.lowering && lobe.kind == GLINT_MIRROR) {
      const Three n = choose(nonzero(normal), normal, gather3(s.n, at));
      k = lowered(gather(s.lowering, at), -dot(n, gather3(s.d, at))) * k;
    }
  }
  scatter3(column, s.stride, at, k);
  if (s.passing_columns >= PassingTerm::kShaped) {
    scatter(column + PassingTerm::kExponent * s.stride, at,
            lobe_number(p, lobe.exponent, lobe.exponent_slot));
    scatter(column + PassingTerm::kIor * s.stride, at, lobe_ior(p, lobe));
  }
  sum.passes |= nonzero(k);
}

/// 1, or what AMBIENT and DIFFUSE lobes that depend on the view are times.
inline Doubles seen_share(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                          const LobeShape& lobe, MicroNormal& micro) {
  if (!(lobe.exponent > 0)) return splat(1);
  const Doubles exponent = lobe_number(p, lobe.exponent, lobe.exponent_slot);
  const Three& n = micro.of(s, at);
  return grazing_power(seen_cosine(n, gather3(s.d, at)), larger(exponent, splat(1e-6)));
}

/// Adds an OREN_NAYAR lobe to the row of its kind.
__attribute__((noinline)) void add_rough(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                                         const LobeShape& lobe, Three T, Three k, Lobes& sum) {
  const bool again = lobe.kind == GLINT_OREN_NAYAR_MULTIPLE;
  const Doubles lost = lost_once(seen_cosine(gather3(s.n, at), gather3(s.d, at)));
  k = seen_share(s, at, p, lobe, sum.micro) * k;
  if (again) k = lost * k;
  const bool first = sum.rows[lobe.kind] == 0;
  sum.rows[lobe.kind] = 0;
  double* const row = next_row(s, lobe.kind, sum);
  const Three Tk = first ? T * k : gather3(row, s.stride, at) + T * k;
  scatter3(row, s.stride, at, Tk);
  sum.lit |= nonzero(Tk);
}

inline void add_lobe(const EvaluateStage& s, const Chosen& at, const OnMesh& p,
                     const LobeShape& lobe, const Three& T, Three k, Lobes& sum) {
  switch (lobe.kind) {
    case GLINT_SPECULAR: return set_specular(s, at, p, T * k, lobe, sum);
    case GLINT_SHEEN:
    case GLINT_TOON_DIFFUSE:
    case GLINT_TOON_SPECULAR: return set_two_numbers(s, at, p, T * k, lobe, sum);
    case GLINT_OREN_NAYAR:
    case GLINT_OREN_NAYAR_MULTIPLE: return add_rough(s, at, p, lobe, T, k, sum);
    case GLINT_FIBRE_DIFFUSE:
    case GLINT_FIBRE_SPECULAR:
    case GLINT_FIBRE_TRANSMISSION: return set_fibre(s, at, p, T * k, k, lobe, sum);
    default: break;
  }
  const bool ambient = lobe.kind == GLINT_AMBIENT;
  if (ambient || lobe.kind == GLINT_DIFFUSE) k = seen_share(s, at, p, lobe, sum.micro) * k;
  if (lobe.kind == GLINT_DIFFUSE) return void(sum.diffuse = sum.diffuse + k);
  if (lobe.kind == GLINT_TRANSLUCENT) return void(sum.translucent = sum.translucent + k);
  if (lobe.kind == GLINT_MIRROR && s.thrown > 0) set_thrown(s, at, p, lobe, T * k, sum);
  if (!ambient && lobe.kind != GLINT_EMISSION) return set_passing(s, at, p, lobe, k, sum);
  if (!ambient && s.dark) return;
  const Three c = ambient ? T * k * splat3(s.ambient) : T * k;
  sum.glow = sum.glow + c;
  if (ambient && s.lowering) sum.ambient = sum.ambient + c;
  add_part(ambient ? s.sums.ambient : s.sums.emission, at, c);
}

/// The points of a block as its program reads them, from row number `first` on.
inline void set_points(const EvaluateStage& s, size_t first, size_t count, ProgramPoints& points) {
  for (size_t k = 0; k < count; k += kLanes) {
    const Chosen at = chosen(s.rows, first + k, first + count);
    for (size_t lane = 0; lane < kLanes; ++lane) {
      points.instance[k + lane] = s.instance[at.row[lane]];
      points.primitive[k + lane] = s.primitive[at.row[lane]];
    }
    const Doubles b = gather(s.weights[0], at), c = gather(s.weights[1], at);
    store(points.weights[0] + k, 1 - b - c);
    store(points.weights[1] + k, b);
    store(points.weights[2] + k, c);
    put3(points.x, k, gather3(s.x, at));
    put3(points.g, k, gather3(s.g, at));
    put3(points.n, k, gather3(s.n, at));
    put3(points.d, k, gather3(s.d, at));
    store(points.outside + k, gather(s.outside, at));
    if (s.program->asks_rays) {
      store(points.offset + k, gather(s.offset, at));
      for (size_t lane = 0; lane < kLanes; ++lane) points.row[k + lane] = at.row[lane];
    }
    if (!s.program->reads_ray) continue;
    store(points.length + k,
          length(gather3(s.x, at) - gather3(s.start, at)) / s.tables.view->scale);
    store(points.tags + k, gather(s.tags, at));
  }
}

/// Shading normals of the program, and what they were bent from.
inline void bend_normals(const EvaluateStage& s, size_t first, size_t count) {
  for (size_t k = 0; k < count; k += kLanes) {
    const Chosen at = chosen(s.rows, first + k, first + count);
    OnMesh p{};
    p.slots = s.slots + k;
    const Three mesh = gather3(s.n, at), n = given_normal(p, s.normal, mesh);
    if (s.bump_shadowing != GLINT_BUMP_NONE) {
      const Three m = given_normal(p, s.base_normal, mesh);
      scatter3(s.unbent, at, where(nonzero(n - m) & ~on_strands(s, at), m));
      scatter(s.bump, at, bump_of(s.bump_shadowing, dot(m, n)));
    }
    scatter3(s.n, at, n);
  }
}

inline void run_block(const EvaluateStage& s, size_t first, size_t count) {
  ProgramPoints points;
  set_points(s, first, count, points);
  run_program({s.tables, s.program, &points, s.kind, count, s.slots, s.queries});
  if (s.normal > 0) bend_normals(s, first, count);
}

/// The normal of TRANSLUCENT lobes, and what LitPoints' bump holds of it.
inline void lift_normal(const EvaluateStage& s, const Chosen& at) {
  const Three n = micro_normal(s, at, gather3(s.n, at)), m = gather3(s.unbent, at);
  scatter3(s.lifted, at, n);
  scatter(s.lifted_bump, at, where(nonzero(m), bump_of(s.bump_shadowing, dot(m, n))));
}

/// What of the light of DIFFUSE lobes of the group of rows from `begin` on comes out elsewhere, and
/// how far away: by how much of it is of which. slots: as OnMesh has them.
__attribute__((noinline)) void set_below(const EvaluateStage& s, size_t begin,
                                         const double* slots) {
  const Chosen at = chosen(s.rows, begin, s.count);
  OnMesh p = on_mesh(s, at);
  p.slots = slots;
  Three below{}, size{}, spread{}, first{};  // spread: of what is more than the first
  bool is_first = true;
  MicroNormal micro;
  Reads reads;
  for (uint32_t i = 0; i < s.lobe_count; ++i) {
    const LobeShape& lobe = s.lobes[i];
    const double* const own = lobe.radius;
    const bool varies = lobe.radius_slot > 0;
    if (lobe.kind != GLINT_DIFFUSE || !(varies || own[0] > 0 || own[1] > 0 || own[2] > 0)) continue;
    const Three radius = varies ? finite_or_zero(slots3(p, lobe.radius_slot)) : splat3(own);
    const Three k = seen_share(s, at, p, lobe, micro) * coefficient(s.tables, p, lobe, reads),
                weight{magnitude(k.x), magnitude(k.y), magnitude(k.z)},
                least{larger(radius.x, Doubles{}), larger(radius.y, Doubles{}),
                      larger(radius.z, Doubles{})};
    if (is_first) first = least;
    is_first = false;
    below = below + k;
    size = size + weight;
    spread = spread + weight * (least - first);
  }
  const auto mean = [](Doubles sum, Doubles of) {
    return where(of > 0, sum / choose(of > 0, of, splat(1)));
  };
  const Three T{gather(s.T[0], at), gather(s.T[1], at), gather(s.T[2], at)};
  scatter3(s.below, at, T * below);
  scatter3(s.radius, at,
           first + Three{mean(spread.x, size.x), mean(spread.y, size.y), mean(spread.z, size.z)});
}

/// Takes away what ambient light does not bring to surfaces that see light lower.
__attribute__((noinline)) void take_lowered(const EvaluateStage& s, const Chosen& at, Lobes& sum) {
  TakenAmbient taken(gather(s.lowering, at), seen_cosine(gather3(s.n, at), gather3(s.d, at)),
                     s.ambient);
  const bool shaped = s.layout->of[GLINT_SPECULAR].width >= MicrofacetRow::kShaped;
  for (int number = 0; shaped && number < sum.rows[GLINT_SPECULAR]; ++number) {
    const double* const row = s.specular + size_t(s.layout->row(GLINT_SPECULAR, number)) * s.stride;
    const auto column = [&](int of) { return gather(row + of * s.stride, at); };
    taken.add({column(0), column(1), column(2)}, column(MicrofacetRow::kExponent),
              column(MicrofacetRow::kMasking), column(MicrofacetRow::kFresnel),
              column(MicrofacetRow::kDistribution));
  }
  const Three less = taken.of(sum.ambient);
  sum.glow = sum.glow - less;
  add_part(s.sums.ambient, at, -less);
}

/// Which lanes send rays on. slots: as OnMesh has them.
inline uint32_t vary_group(const EvaluateStage& s, const Chosen& at, const double* slots) {
  OnMesh p = on_mesh(s, at);
  p.slots = slots;
  const Three T = gather3(s.T, at);
  Lobes sum{gather3(s.sums.total, at), {}, {}};
  Three k{};
  Reads reads;
  for (uint32_t i = 0; i < s.lobe_count; ++i) {
    if (!s.lobes[i].like_last) k = coefficient(s.tables, p, s.lobes[i], reads);
    add_lobe(s, at, p, s.lobes[i], T, k, sum);
  }
  if (s.lowering) take_lowered(s, at, sum);
  scatter3(s.sums.total, at, sum.glow);
  const Three Tk = T * sum.diffuse;
  scatter3(s.diffuse, at, Tk);
  if (s.translucent[0]) scatter3(s.translucent, at, T * sum.translucent);
  if (s.translucent[0] && s.lifted[0]) lift_normal(s, at);
  sum.lit |= nonzero(Tk);
  for (size_t lane = 0; lane < at.count; ++lane) s.lit[at.row[lane]] = sum.lit[lane];
  return bits(sum.passes) & lanes_of(at);
}

size_t vary(const EvaluateStage& s) {
  size_t passing = 0;
  for (size_t i = 0; i < s.count; i += kLanes) {
    const Chosen at = chosen(s.rows, i, s.count);
    if (s.program && i % kBlock == 0) run_block(s, i, s.count - i < kBlock ? s.count - i : kBlock);
    const double* slots = s.program ? s.slots + i % kBlock : nullptr;
    for (uint32_t m = vary_group(s, at, slots); m; m &= m - 1)
      s.passing_rows[passing++] = at.row[__builtin_ctz(m)];
    if (s.below[0]) set_below(s, i, slots);
  }
  return passing;
}

}  // namespace
}  // namespace glint
