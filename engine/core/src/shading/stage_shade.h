// Constant lobes (notes 4.12-4.17). Letters: T weight to the pixel, k coefficient of a lobe.
#pragma once
#include "shading/stage_ambient.h"
#include "shading/stages.h"

namespace glint {
namespace {

/// The materials of a group of points, a row a lane.
struct TermRows {
  const MaterialTerms* of[kLanes];
  const double *specular[kLanes], *view[kLanes];
  uint32_t others = 0;  // lanes
  bool same = true;
};

inline void set_row(const ShadeStage& s, uint32_t material, size_t lane, TermRows& rows) {
  rows.of[lane] = s.terms + material;
  rows.specular[lane] = s.specular_terms + s.specular_columns * material;
  rows.view[lane] = s.view_terms + ViewTerm::kColumns * size_t(s.max_view) * material;
}

__attribute__((always_inline)) inline void look_up(const ShadeStage& s, size_t k, TermRows& rows) {
  if (s.count - k >= kLanes && same(s.material + k)) {
    set_row(s, s.material[k], 0, rows);
    rows.others = rows.of[0]->others ? kAllLanes : 0;
    return;
  }
  for (size_t lane = 0; lane < kLanes; ++lane) {
    const uint32_t material = s.material[k + lane < s.count ? k + lane : k];
    set_row(s, material, lane, rows);
    rows.same = rows.same && rows.of[lane] == rows.of[0];
    rows.others |= (rows.of[lane]->others != 0 && k + lane < s.count ? 1u : 0u) << lane;
  }
}

inline Three gather3(const TermRows& rows, const double (MaterialTerms::*member)[3]) {
  if (rows.same) return splat3(rows.of[0]->*member);
  const auto channel = [&](size_t c) {
    return each_lane([&](size_t lane) { return (rows.of[lane]->*member)[c]; });
  };
  return {channel(0), channel(1), channel(2)};
}

inline Doubles gather(const TermRows& rows, const double* const (&of)[kLanes], size_t at) {
  if (rows.same) return splat(of[0][at]);
  return each_lane([&](size_t lane) { return of[lane][at]; });
}

inline Three gather3(const TermRows& rows, const double* const (&of)[kLanes], size_t at) {
  return {gather(rows, of, at), gather(rows, of, at + 1), gather(rows, of, at + 2)};
}

/// What depends on the view: the ambient light that it brings, and what of T k it adds to the
/// diffuse lobes.
struct Seen {
  Three ambient, diffuse;
};

__attribute__((always_inline)) inline Seen seen(const ShadeStage& s, size_t k, const Three& T,
                                                const TermRows& rows) {
  const Doubles cosine = seen_cosine(load3(s.n, k), load3(s.d, k));
  Seen sum{};
  for (size_t term = 0; term < size_t(s.max_view); ++term) {
    const size_t at = ViewTerm::kColumns * term;
    const Three share =
        grazing_power(cosine,
                      larger(gather(rows, rows.view, at + ViewTerm::kExponent), splat(1e-6))) *
        T;
    sum.ambient = sum.ambient + share * gather3(rows, rows.view, at + ViewTerm::kAmbient);
    sum.diffuse = sum.diffuse + share * gather3(rows, rows.view, at + ViewTerm::kDiffuse);
  }
  return sum;
}

/// Whether a material of the group has lobes that depend on the view.
__attribute__((always_inline)) inline bool any_view(const TermRows& rows) {
  bool found = false;
  for (size_t lane = 0, lanes = rows.same ? 1 : kLanes; lane < lanes; ++lane)
    found = found || rows.of[lane]->view_count > 0;
  return found;
}

inline void store_part(double* const (&part)[3], size_t k, const Three& T, const TermRows& rows,
                       const double (MaterialTerms::*member)[3]) {
  if (part[0]) store3(part, k, T * gather3(rows, member));
}

inline void clear_part(double* const (&part)[3], size_t k) {
  if (part[0]) store3(part, k, Three{});
}

/// Rows of lobes; which lanes have any.
inline Mask store_specular(const ShadeStage& s, size_t k, const Three& T, const TermRows& rows) {
  Mask lit{};
  for (size_t row = 0; row < s.row_count; ++row) {
    const size_t at = s.rows[row].first;
    double* column = s.specular + at * s.stride + k;
    const Three Tk = T * gather3(rows, rows.specular, at);
    store(column, Tk.x);
    store(column + s.stride, Tk.y);
    store(column + 2 * s.stride, Tk.z);
    for (size_t c = 3; c < s.rows[row].width; ++c)
      store(column + c * s.stride, gather(rows, rows.specular, at + c));
    lit |= nonzero(Tk);
  }
  return lit;
}

/// Takes away what ambient light does not bring to surfaces that see light lower.
__attribute__((noinline)) void take_lowered(const ShadeStage& s) {
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Doubles lowering = load(s.lowering + k);
    if (!bits(lowering > 1)) continue;
    TermRows rows;
    look_up(s, k, rows);
    const Three T = load3(s.T, k);
    Three given = T * gather3(rows, &MaterialTerms::ambient);
    if (s.max_view > 0 && any_view(rows)) given = given + seen(s, k, T, rows).ambient;
    TakenAmbient taken(lowering, seen_cosine(load3(s.n, k), load3(s.d, k)), s.ambient);
    const LobeRows& shining = s.lobes->of[GLINT_SPECULAR];
    for (int term = 0; shining.width >= MicrofacetRow::kShaped && term < s.highlights; ++term) {
      const size_t at = size_t(shining.first + shining.width * term);
      taken.add(T * gather3(rows, rows.specular, at),
                gather(rows, rows.specular, at + MicrofacetRow::kExponent),
                gather(rows, rows.specular, at + MicrofacetRow::kMasking),
                gather(rows, rows.specular, at + MicrofacetRow::kFresnel),
                gather(rows, rows.specular, at + MicrofacetRow::kDistribution));
    }
    const Three less = taken.of(given);
    store3(s.sums.total, k, load3(s.sums.total, k) - less);
    if (s.sums.ambient[0]) store3(s.sums.ambient, k, load3(s.sums.ambient, k) - less);
  }
}

size_t shade(const ShadeStage& s) {
  size_t others = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    TermRows rows;
    look_up(s, k, rows);
    const Three T = load3(s.T, k);
    store3(s.sums.total, k, T * gather3(rows, &MaterialTerms::glow));
    store_part(s.sums.ambient, k, T, rows, &MaterialTerms::ambient);
    store_part(s.sums.emission, k, T, rows, &MaterialTerms::emission);
    store_part(s.sums.environment, k, T, rows, &MaterialTerms::environment);
    clear_part(s.sums.diffuse, k);
    clear_part(s.sums.specular, k);
    clear_part(s.sums.shadow, k);
    if (rows.same && rows.of[0]->unlit) {
      store(s.lit + k, Mask{});
      continue;
    }
    Three Tk = T * gather3(rows, &MaterialTerms::diffuse);
    if (s.max_view > 0 && any_view(rows)) {
      const Seen more = seen(s, k, T, rows);
      store3(s.sums.total, k, load3(s.sums.total, k) + more.ambient);
      if (s.sums.ambient[0]) store3(s.sums.ambient, k, load3(s.sums.ambient, k) + more.ambient);
      Tk = Tk + more.diffuse;
    }
    store3(s.diffuse, k, Tk);
    Mask lit = nonzero(Tk);
    if (s.row_count > 0) lit |= store_specular(s, k, T, rows);
    store(s.lit + k, lit & valid_lanes(k, s.count));
    for (uint32_t m = rows.others; m; m &= m - 1)
      s.others[others++] = uint32_t(k) + uint32_t(__builtin_ctz(m));
  }
  if (s.lowering) take_lowered(s);
  return others;
}

}  // namespace
}  // namespace glint
