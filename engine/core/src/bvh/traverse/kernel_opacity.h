// Triangles that rays pass: what stops them, and what dims them.
#pragma once
#include "bvh/traverse/kernel_resolve.h"

namespace glint {
namespace {

/// Whether all triangles of a kind stop rays wherever they meet them.
template <bool Any>
inline bool stops(const Opacity& opacity, uint8_t kind) {
  return kind == Opacity::kSolid ? !(Any && opacity.onward)
                                 : kind == Opacity::kVaried && !(Any || opacity.onward);
}

/// Where the rays [k, k + kFloats) meet one triangle; those of some of them alone that ask.
template <bool Any>
struct Met {
  static constexpr int kFew = 2;  // rays that are sooner asked one by one
  alignas(64) double t[kFloats];
  alignas(64) float u[kFloats], v[kFloats];
  uint32_t known = 0;

  Met(const Walk<Any>& w, int k, uint32_t rays, ChildRef leaf, int place) {
    if (__builtin_popcount(rays) > kFew)
      known = exact_hits(w.tile, k, Triangles(w.tree, leaf), place, order_of(w.tile, k), t, u, v);
  }
};

/// `stopped` ray by ray.
template <bool Any>
__attribute__((noinline)) uint32_t stopped_each(const Walk<Any>& w, int k, uint32_t rays,
                                                ChildRef leaf, int place) {
  const Tile& tile = w.tile;
  Answers& answers = *tile.answers;
  const Opacity& opacity = *answers.opacity;
  uint8_t kind[kFloats];
  uint32_t stopped = rays, passing = 0, plain = 0;
  for (uint32_t some = rays; some; some &= some - 1) {
    const int lane = __builtin_ctz(some), r = k + lane;
    kind[lane] = opacity.of_instance[id_of(tile, r, leaf_first(leaf) + uint32_t(place)).instance];
    if (!alive(tile, r) || stops<Any>(opacity, kind[lane])) continue;
    passing |= 1u << lane;
    if (kind[lane] != Opacity::kMapped) plain |= 1u << lane;
  }
  const Met<Any> met(w, k, plain, leaf, place);
  for (; passing; passing &= passing - 1) {
    const int lane = __builtin_ctz(passing), r = k + lane, s = tile.slot[r];
    const PrimitiveId id = id_of(tile, r, leaf_first(leaf) + uint32_t(place));
    Hit hit{0, id.instance, id.primitive};
    if (met.known & plain & 1u << lane) {
      hit.t = met.t[lane];
      hit.u = met.u[lane];
      hit.v = met.v[lane];
    } else {
      Exact<double> e = w.seen(r, leaf, place);
      weigh(e, tile.close);
      hit = {e.depth / tile.along[r], id.instance, id.primitive, float(e.u), float(e.v)};
      if (kind[lane] == Opacity::kMapped)
        kind[lane] = opacity.at(opacity.maps, id.instance, id.primitive, e.u, e.v);
      if (stops<Any>(opacity, kind[lane])) continue;
    }
    stopped &= ~(1u << lane);
    if (Any && kind[lane] != Opacity::kClear && hit.t > answers.t_min[s] &&
        hit.t < answers.t_max[s])
      answers.dim(s, hit);
  }
  return stopped;
}

/// Those of some rays, k the first of them, that a triangle stops where they meet it. Any hit: a
/// ray that it dims is told, and goes on.
template <bool Any>
inline uint32_t stopped(const Walk<Any>& w, int k, uint32_t rays, ChildRef leaf, int place) {
  const Tile& tile = w.tile;
  const Opacity& opacity = *tile.answers->opacity;
  if (!tile.instances) {  // all rays meet the same one
    const uint32_t instance = tile.tree->ids[leaf_first(leaf) + uint32_t(place)].instance;
    if (stops<Any>(opacity, opacity.of_instance[instance])) return rays;
  }
  return stopped_each(w, k, rays, leaf, place);
}

}  // namespace
}  // namespace glint
