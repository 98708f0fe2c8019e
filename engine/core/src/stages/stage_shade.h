// Constant lobes (notes 4.12-4.17). Letters: T weight to the pixel, k coefficient of a lobe.
#pragma once
#include "lanes.h"
#include "stages.h"

namespace glint {
namespace {

/// The materials of a group of points, a row a lane.
struct TermRows {
  const MaterialTerms* of[kLanes];
  const double* specular[kLanes];
  uint32_t others = 0;  // lanes
  bool same = true;
};

inline void look_up(const ShadeStage& s, size_t k, TermRows& rows) {
  if (s.count - k >= kLanes && same(s.material + k)) {
    rows.of[0] = s.terms + s.material[k], rows.specular[0] = s.specular_terms + 4 * size_t(s.max_specular) * s.material[k];
    rows.others = rows.of[0]->others ? kAllLanes : 0;
    return;
  }
  for (size_t lane = 0; lane < kLanes; ++lane) {
    const uint32_t material = s.material[k + lane < s.count ? k + lane : k];
    const MaterialTerms& terms = s.terms[material];
    rows.of[lane] = &terms, rows.specular[lane] = s.specular_terms + 4 * size_t(s.max_specular) * material;
    rows.same = rows.same && rows.of[lane] == rows.of[0];
    rows.others |= (terms.others != 0 && k + lane < s.count ? 1u : 0u) << lane;
  }
}

inline Three gather3(const TermRows& rows, const double (MaterialTerms::*member)[3]) {
  if (rows.same) return splat3(rows.of[0]->*member);
  const auto channel = [&](size_t c) { return each_lane([&](size_t lane) { return (rows.of[lane]->*member)[c]; }); };
  return {channel(0), channel(1), channel(2)};
}

inline Doubles gather(const TermRows& rows, size_t at) {
  if (rows.same) return splat(rows.specular[0][at]);
  return each_lane([&](size_t lane) { return rows.specular[lane][at]; });
}

inline void store_part(double* const (&part)[3], size_t k, const Three& T, const TermRows& rows, const double (MaterialTerms::*member)[3]) {
  if (part[0]) store3(part, k, T * gather3(rows, member));
}

inline void clear_part(double* const (&part)[3], size_t k) {
  if (part[0]) store3(part, k, Three{});
}

/// Columns of the specular terms; which lanes have any.
inline Mask store_specular(const ShadeStage& s, size_t k, const Three& T, const TermRows& rows) {
  Mask lit{};
  for (int term = 0; term < s.max_specular; ++term) {
    double* column = s.specular + 4 * size_t(term) * s.stride + k;
    const size_t at = 4 * size_t(term);
    const Three Tk = T * Three{gather(rows, at), gather(rows, at + 1), gather(rows, at + 2)};
    store(column, Tk.x), store(column + s.stride, Tk.y), store(column + 2 * s.stride, Tk.z);
    store(column + 3 * s.stride, gather(rows, at + 3));
    lit |= nonzero(Tk);
  }
  return lit;
}

size_t shade(const ShadeStage& s) {
  size_t others = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    TermRows rows;
    look_up(s, k, rows);
    const Three T = load3(s.T, k);
    store3(s.sums.total, k, T * gather3(rows, &MaterialTerms::glow));
    store_part(s.sums.ambient, k, T, rows, &MaterialTerms::ambient), store_part(s.sums.emission, k, T, rows, &MaterialTerms::emission);
    store_part(s.sums.environment, k, T, rows, &MaterialTerms::environment);
    clear_part(s.sums.diffuse, k), clear_part(s.sums.specular, k), clear_part(s.sums.shadow, k);
    if (rows.same && rows.of[0]->unlit) {
      store(s.lit + k, Mask{});
      continue;
    }
    const Three Tk = T * gather3(rows, &MaterialTerms::diffuse);
    store3(s.diffuse, k, Tk);
    Mask lit = nonzero(Tk);
    if (s.max_specular > 0) lit |= store_specular(s, k, T, rows);
    store(s.lit + k, lit & valid_lanes(k, s.count));
    for (uint32_t m = rows.others; m; m &= m - 1) s.others[others++] = uint32_t(k) + uint32_t(__builtin_ctz(m));
  }
  return others;
}

}  // namespace
}  // namespace glint
