// Rays that go on from lit points along directions of their lobes: reflections of other surfaces,
// and rays that look for bounced light (final gathering). Letters as in closure/lobes.h.
#pragma once
#include "shading/closure/lobes.h"
#include "shading/stage_bump.h"
#include "shading/stage_rows.h"

namespace glint {
namespace {

template <bool Bent>
size_t reflect_from(const OnwardStage& stage) {
  const LitPoints& s = *stage.points;
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(stage.lit + k);
    if (!any(lit)) continue;
    const Narrow all = narrow_terms<true>(s, k, splat(0));
    if (!any(lit & (all.total > 0))) continue;
    const Three n = load3(s.n, k);
    const LobePlace place(load(stage.disc[0] + k), load(stage.disc[1] + k));
    const Drawn drawn = sample_microfacets<true, Bent>(s, k, n, all, place);
    const Doubles cosine = dot(n, drawn.l);
    const Highlights seen = highlights<true, Bent>(s, k, n, drawn.l, cosine, &all);
    const Three share = (1 / (kCircle * seen.density)) * seen.light;
    const Mask front = Bent && s.lobes.turns ? ~Mask{} : cosine > 0;
    const Mask reached = lit & drawn.good & front & (seen.density > 0) &
                         (dot(drawn.l, load3(s.g, k)) > 0) & nonzero(share);
    const uint32_t lanes = bits(reached);
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(stage.rays.point, uint32_t(k));
    append(stage.rays.diffuse, share);
    append(stage.rays.t_max, drawn.narrowest);
    append(stage.rays.to, drawn.l);
    append(stage.rays.o, load3(s.x, k) + load(s.offset + k) * load3(s.g, k));
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

size_t reflect(const OnwardStage& stage) {
  return is_bent(*stage.points) ? reflect_from<true>(stage) : reflect_from<false>(stage);
}

/// What of T a point throws back as what is matt does, of light along l.
inline Three matt(const OnwardStage& stage, size_t k, const Three& n, const Three& l) {
  const LitPoints& s = *stage.points;
  const BumpShadow bump = bump_shadow<true>(s, k, n, l);
  const Doubles cosine = dot(n, l);
  Three T = where(stage.fibres_alone ? Mask{} : cosine > 0, load3(s.diffuse, k));
  if (s.lobes.other_count > 0) {
    Highlights seen{};
    add_other_lobes(s, k, n, l, cosine, seen);
    Three lobes = where(stage.fibres_alone ? Mask{} : cosine > 0, seen.matt);
    if (s.lobes.has_fibre) lobes = lobes + seen.fibre;
    T = T + (1 / larger(magnitude(cosine), splat(0x1p-20))) * lobes;
  }
  if (bump.some) T = bump.share * T;
  if (stage.gathers_gloss && !stage.fibres_alone)
    T = T + where(cosine > 0, lowered<true>(s, k, n, l) * even_gloss(s, k));
  return bump.some ? where(~bump.hidden, T) : T;
}

/// Where a ray goes on from a point: as densely as the cosine (Malley's method); from strands as
/// their lobes are.
struct Onward {
  Three l;
  // way: -1 to the back.  factor: the cosine's pdf over its own.  left: as of FibreSample
  Doubles way, factor, left;
};

inline Onward onward(const OnwardStage& s, size_t k, const Three& n) {
  Three t1, t2;
  frame(n, t1, t2);
  const Doubles x = load(s.disc[0] + k), y = load(s.disc[1] + k);
  Onward on{root(larger(1 - x * x - y * y, Doubles{})) * n + x * t1 + y * t2, splat(1), splat(1),
            splat(0)};
  if (!s.chooses) return on;
  const Doubles number = load(s.chooses + k);
  const Mask strand = number >= 0;
  if (!bits(strand)) return on;
  const FibreSample drawn = sample_fibre(s, k, n, number);
  const Doubles cosine = dot(n, drawn.l);
  on.l = choose(strand, drawn.l, on.l);
  on.way = choose(strand & (cosine < 0), splat(-1), on.way);
  on.factor =
      choose(strand, where(drawn.pdf > 0, magnitude(cosine) / (kCircle * drawn.pdf)), on.factor);
  on.left = choose(strand, drawn.left, on.left);
  return on;
}

size_t gather(const OnwardStage& stage) {
  const LitPoints& s = *stage.points;
  size_t found = 0;
  for (size_t k = 0; k < s.count; k += kLanes) {
    const Mask lit = load(stage.lit + k);
    if (!any(lit)) continue;
    const Three n = load3(s.n, k), g = load3(s.g, k);
    const Onward on = onward(stage, k, n);
    const Three T = on.factor * matt(stage, k, n, on.l);
    const uint32_t lanes = bits(lit & nonzero(T) & (on.way * dot(on.l, g) > 0));
    if (!lanes) continue;
    const Appender append{lanes, found};
    append.number(stage.rays.point, uint32_t(k));
    append(stage.rays.diffuse, T);
    append(stage.rays.to, on.l);
    Three o = load3(s.x, k) + on.way * load(s.offset + k) * g;
    if (stage.chooses) {
      o = o + way_through(s, k, on.l) * on.l;
      append(stage.rays.t_max, on.left);
    }
    append(stage.rays.o, o);
    found += size_t(__builtin_popcount(lanes));
  }
  return found;
}

}  // namespace
}  // namespace glint
