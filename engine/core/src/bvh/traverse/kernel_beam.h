// Beams: many rays that begin at one point, as a camera's do, and go on as one packet, whose
// triangles are then tested against one register of rays after the other. A ray is two numbers, its
// place: its slopes, from those of the beam's middle. Everything in single precision is a bound: a
// triangle is hit for sure, missed for sure, nearer or farther for sure, or else `decide` asks the
// rules that hold for single rays. So products may be fused with sums here, and registers be as
// wide as they are.
#pragma once
#include "bvh/traverse/kernel_beam_setup.h"
#include "bvh/traverse/kernel_beam_walk.h"

namespace glint {
namespace {

/// One hit that weigh() has not answered, or not in the ray's own order.
__attribute__((noinline)) inline void finish_at_edge(const Beam& beam, const TreeView& tree,
                                                     const Answers& answers, int r) {
  const BeamRay ray(beam.source, r);
  Exact<double> e = ray.see(Triangles(tree, beam.pending[r]), int(beam.leaf_at[r] & ~kDecided));
  weigh(e, beam.close);
  answers.t[r] = e.depth / ray.along;
  answers.u[r] = float(e.u);
  answers.v[r] = float(e.v);
}

/// The hits of the rays [k, k + kFloats), in double; corners(h, from): of the triangles of kLanes
/// of them, from the origin. Returns those that weigh() has answered.
template <class Corners>
__attribute__((always_inline)) inline uint32_t finish_hits(const Beam& beam, const Answers& answers,
                                                           int k, Corners corners) {
  const BeamSource& s = beam.source;
  alignas(64) float u[kFloats], v[kFloats];
  const uint32_t decided = bits(Ints(load(beam.leaf_at + k)));
  uint32_t close = ~decided;
  for (int h = 0; h < kFloats; h += kLanes) {
    Doubles from[3][3];
    corners(h, from);
    const Doubles along = load(s.d[2] + k + h), inverse = 1 / along;
    Exact<Doubles> e;
    e.see(from, {load(s.d[0] + k + h) * inverse, load(s.d[1] + k + h) * inverse});
    e.weigh();
    const Longs hit = widen(beam.pending + k + h) != Longs{};
    store(answers.t + k + h, choose(hit, e.depth / along, splat(kInf)));
    narrow(u + h, e.u);
    narrow(v + h, e.v);
    if (!decided) continue;
    const Doubles margin = splat(beam.close);
    close |= bits(at_most(magnitude(e.off_x), margin) & at_most(magnitude(e.off_y), margin)) << h;
  }
  const FloatMask none = equal(load(beam.pending + k), Ints{});
  store(answers.u + k, choose(none, Floats{}, load(u)));
  store(answers.v + k, choose(none, Floats{}, load(v)));
  return close & s.own(k, kFloats);
}

/// All answers to the rays [k, k + kFloats).
inline void finish_beam(const Beam& beam, const TreeView& tree, const Answers& answers, int k) {
  constexpr uint32_t kAll = (1u << kFloats) - 1;
  const BeamSource& s = beam.source;
  const int (&axes)[3] = beam.order->axes;
  const Ints pending = load(beam.pending + k);
  const FloatMask none = equal(pending, Ints{});
  const uint32_t hits = ~bits(none) & kAll;
  if (!hits) {
    for (int h = 0; h < kFloats; h += kLanes) store(answers.t + k + h, splat(kInf));
    store(answers.instance + k, Ints{} - 1);
    store(answers.primitive + k, Ints{});
    store(answers.u + k, Floats{});
    store(answers.v + k, Floats{});
    return;
  }
  uint32_t close;
  const ChildRef ref = beam.pending[k];
  const uint32_t at = beam.leaf_at[k], place = at & ~kDecided;
  if (bits(equal(pending, Ints{} + int32_t(ref)) &
           equal(load(beam.leaf_at + k), Ints{} + int32_t(at))) == kAll) {  // all hit one
    const Triangles leaf(tree, ref);
    double from[3][3];
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a) from[j][a] = double(leaf.at(j, axes[a])[place]) - *s.o[a];
    const PrimitiveId id = tree.ids[leaf_first(ref) + place];
    store(answers.instance + k, Ints{} + int32_t(id.instance));
    store(answers.primitive + k, Ints{} + int32_t(id.primitive));
    close = finish_hits(beam, answers, k, [&](int, Doubles(&p)[3][3]) {
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < 3; ++a) p[j][a] = splat(from[j][a]);
    });
  } else {
    const Picked triangles(tree, beam.pending + k, beam.leaf_at + k, hits, axes);
    alignas(64) float corner[9][kFloats];
    for (int c = 0; c < 9; ++c) store(corner[c], triangles.corner[c]);
    store(answers.instance + k, choose(none, Ints{} - 1, triangles.instance));
    store(answers.primitive + k, choose(none, Ints{}, triangles.primitive));
    close = finish_hits(beam, answers, k, [&](int h, Doubles(&p)[3][3]) {
      for (int j = 0; j < 3; ++j)
        for (int a = 0; a < 3; ++a) p[j][a] = widen(corner[3 * j + a] + h) - splat(*s.o[a]);
    });
  }
  for (uint32_t edges = hits & ~close; edges; edges &= edges - 1)
    finish_at_edge(beam, tree, answers, k + __builtin_ctz(edges));
}

enum class Beamed { kTraced, kUnfit, kParted };  // what became of a beam

/// The closest hits of the rays from `first` on, into `answers`; Any: what blocks them. False, and
/// nothing is there, when they are no beam, see too much or may pass something.
template <bool Any>
__attribute__((noinline)) Beamed trace_beam(const TreeView& tree, const Rays& rays, size_t first,
                                            Answers& answers, int leaves = leaves_allowed(Any)) {
  Beam beam;
  if (!set_from_apex(beam, tree, rays, first) && !(Any && set_to_apex(beam, tree, rays, first)))
    return Beamed::kUnfit;
  BeamWalk<Any> walk{tree, beam, answers};
  walk.set_end();
  if (!walk.walk(leaves, [&](ChildRef at) { return walk.leaf(at); })) return Beamed::kParted;
  if constexpr (Any) {
    const uint8_t stop = answers.stop();
    uint8_t* const blocked = answers.blocked;
    for (int k = 0; k < kBeam; ++k) blocked[k] = beam.farthest[k] > kFar ? stop : 0;
  } else
    for (int k = 0; k < kBeam; k += kFloats) finish_beam(beam, tree, answers, k);
  return Beamed::kTraced;
}

}  // namespace
}  // namespace glint
