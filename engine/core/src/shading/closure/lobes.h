// All that lights need of the lobes of points but what is even: what they give back of light from a
// direction. Letters: l direction to the light, n shading normal, d ray, k number of a group of
// points.
#pragma once
#include "shading/closure/fibre.h"
#include "shading/closure/microfacet.h"
#include "shading/closure/oren_nayar.h"
#include "shading/closure/sheen.h"
#include "shading/closure/toon.h"

namespace glint {
namespace {

/// Sum of the lobes, of matt ones (SHEEN, TOON_DIFFUSE, OREN_NAYAR, FIBRE_DIFFUSE) and other FIBRE
/// ones apart, and how densely (a steradian) directions are drawn where l is.
struct Highlights {
  Three light, matt, fibre;
  Doubles density;
};

/// Adds k times eval(number) of the lobes of a kind.
template <class Eval>
inline void add_lobes(const LitPoints& s, size_t k, int kind, Three& sum, Eval eval) {
  for (int number = 0; number < s.lobes.layout->of[kind].count; ++number) {
    const Three Tk = LobeRow(s, k, kind, number).k();
    const Mask some = nonzero(Tk);
    if (bits(some)) sum = sum + where(some, eval(number) * Tk);
  }
}

/// Adds all lobes but highlights of microfacets. cosine: n.l. What each gives back is a function
/// that is called: else compilers work it out before they know whether anybody has the lobe.
__attribute__((noinline)) void add_other_lobes(const LitPoints& s, size_t k, Three n, Three l,
                                               Doubles cosine, Highlights& sum) {
  const Three d = load3(s.d, k);
  const auto add = [&](int kind, Three& to, auto eval) { add_lobes(s, k, kind, to, eval); };
  add(GLINT_SHEEN, sum.matt, [&](int i) { return eval_sheen(s, k, i, n, d, l, cosine); });
  add(GLINT_TOON_DIFFUSE, sum.matt,
      [&](int i) { return eval_toon(s, k, GLINT_TOON_DIFFUSE, i, n, d, l, cosine); });
  add(GLINT_TOON_SPECULAR, sum.light, [&](int i) {
    const Doubles share = eval_toon(s, k, GLINT_TOON_SPECULAR, i, n, d, l, cosine);
    return s.lowering ? lowered(load(s.lowering + k), cosine) * share : share;
  });
  add(GLINT_OREN_NAYAR, sum.matt, [&](int) { return oren_nayar(n, d, l, cosine); });
  add(GLINT_OREN_NAYAR_MULTIPLE, sum.matt, [&](int) { return cosine * lost_once(cosine); });
  if (!s.lobes.has_fibre) return;
  add(GLINT_FIBRE_DIFFUSE, sum.matt, [&](int i) { return eval_matt_fibre(s, k, i, l, cosine); });
  for (const int kind : {GLINT_FIBRE_SPECULAR, GLINT_FIBRE_TRANSMISSION})
    add(kind, sum.fibre, [&](int i) { return eval_fibre(s, k, kind, i, l, cosine); });
}

/// Whether some point of a group has one of those.
inline bool any_other_lobe(const LitPoints& s, size_t k) {
  Mask some{};
  for (size_t row = 0; row < s.lobes.other_count; ++row) {
    const double* at = s.lobes.columns + s.lobes.others[row].first * s.lobes.stride + k;
    some |= nonzero({load(at), load(at + s.lobes.stride), load(at + 2 * s.lobes.stride)});
  }
  return bits(some);
}

/// cosine: n.l.  narrow: or null, for no pdf.  glossy: microfacets are asked for.
template <bool Reflecting, bool Bent>
__attribute__((always_inline)) inline Highlights all_highlights(const LitPoints& s, size_t k,
                                                                const Three& n, const Three& l,
                                                                Doubles cosine,
                                                                const Narrow* narrow, bool glossy) {
  Highlights sum{};
  if (glossy) {
    const Shine shine = eval_microfacets<Reflecting, Bent>(s, k, n, l, cosine, narrow);
    sum.light = shine.light;
    sum.density = shine.density;
  }
  if (!Reflecting && any_other_lobe(s, k)) add_other_lobes(s, k, n, l, cosine, sum);
  return sum;
}

/// The same once for all that looks at more than one normal.
template <bool Reflecting>
__attribute__((noinline)) Highlights highlights_of_bent(const LitPoints& s, size_t k, Three n,
                                                        Three l, Doubles cosine,
                                                        const Narrow* narrow, bool glossy) {
  return all_highlights<Reflecting, true>(s, k, n, l, cosine, narrow, glossy);
}

template <bool Reflecting, bool Bent>
__attribute__((always_inline)) inline Highlights highlights(const LitPoints& s, size_t k,
                                                            const Three& n, const Three& l,
                                                            Doubles cosine, const Narrow* narrow,
                                                            bool glossy = true) {
  if constexpr (Bent) return highlights_of_bent<Reflecting>(s, k, n, l, cosine, narrow, glossy);
  else return all_highlights<Reflecting, false>(s, k, n, l, cosine, narrow, glossy);
}

/// About what gloss gives back of even light, but for what rays show; of TOON_SPECULAR lobes all
/// that they do.
inline Three even_gloss(const LitPoints& s, size_t k) {
  Three sum = microfacet_albedo(s, k);
  add_lobes(s, k, GLINT_TOON_SPECULAR, sum,
            [&](int i) { return toon(s, k, GLINT_TOON_SPECULAR, i).albedo(); });
  return sum;
}

}  // namespace
}  // namespace glint
