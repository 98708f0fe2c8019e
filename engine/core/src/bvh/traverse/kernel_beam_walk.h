// A beam's way through a tree: which leaves it comes to, and what its rays meet there.
#pragma once
#include "bvh/traverse/kernel_beam_triangles.h"

namespace glint {
namespace {

/// A beam on its way through a tree of triangles.
template <bool Any>
struct BeamWalk {
  const TreeView& tree;
  Beam& beam;
  Answers& answers;
  int due = 0;  // rays that it may leave unhit yet, at kRaysOfLeaf a leaf

  Hit exact(const BeamRay& ray, Exact<double>&& e, ChildRef leaf, int place) const {
    weigh(e, beam.close);
    const PrimitiveId id = tree.ids[leaf_first(leaf) + uint32_t(place)];
    return {e.depth / ray.along, id.instance, id.primitive, float(e.u), float(e.v)};
  }
  /// What floats cannot tell of a ray and a triangle.
  __attribute__((noinline)) void decide(int r, ChildRef leaf, int place) {
    if (Any && beam.farthest[r] > kFar) return;
    answers.count_fallback(r);
    const BeamSource& s = beam.source;
    const BeamRay ray(s, r);
    Exact<double> e = ray.see(Triangles(tree, leaf), place);
    if (!e.hit()) return;
    const Hit found = exact(ray, static_cast<Exact<double>&&>(e), leaf, place);
    if (!(found.t > s.t_min[r] && found.t < s.t_max[r])) return;
    if (Any) {
      beam.farthest[r] = beam.nearest[r] = __builtin_inff();
      return;
    }
    if (const ChildRef best = beam.pending[r]; best != kNothing) {
      const int at = int(beam.leaf_at[r] & ~kDecided);
      if (!Answers::nearer(found, exact(ray, ray.see(Triangles(tree, best), at), best, at))) return;
    }
    const double inverse_depth = 1 / magnitude(found.t * s.d[2][r]);
    beam.pending[r] = leaf;
    beam.leaf_at[r] = uint32_t(place) | kDecided;
    beam.farthest[r] = float(inverse_depth * (1 - 0x1p-21));
    beam.nearest[r] = float(inverse_depth * (1 + 0x1p-21));
  }

  /// False when rays may pass something there.
  bool leaf(ChildRef ref) {
    if (answers.opacity && !opaque(ref)) return false;
    const Triangles triangles(tree, ref);
    uint32_t changed = 0;
    for (int first = 0; first < triangles.n; first += kFloats) {
      const BeamTriangles seen = see_triangles<Any>(beam, triangles, first);
      const int rest = triangles.n - first < kFloats ? triangles.n - first : kFloats;
      uint32_t mask = seen.near & ((1u << rest) - 1);
      if (!mask) continue;
      const BeamTable table(seen);
      for (; mask; mask &= mask - 1) {
        const int lane = __builtin_ctz(mask);
        const bool edge_on = seen.edge_on >> lane & 1;
        if (answers.masks && !shown(ref, first + lane)) continue;
        uint32_t slices = edge_on ? uint32_t((uint64_t(1) << kSlices) - 1) : met(table, lane);
        for (; slices; slices &= slices - 1) {
          const int g = __builtin_ctz(slices);
          if (edge_on ? slice_edge_on(g, table, lane, ref, first + lane)
                      : slice(g, table, lane, ref, first + lane))
            changed |= 1u << g;
        }
      }
    }
    if (changed) shorten(changed);
    return true;
  }
  /// Whether all triangles of a leaf stop rays.
  bool opaque(ChildRef ref) const {
    const Opacity& opacity = *answers.opacity;
    const PrimitiveId* ids = tree.ids + leaf_first(ref);
    for (int k = 0; k < leaf_count(ref); ++k)
      if (!stops<Any>(opacity, opacity.of_instance[ids[k].instance])) return false;
    return true;
  }
  bool shown(ChildRef ref, int place) const {
    return (answers.masks[tree.ids[leaf_first(ref) + uint32_t(place)].instance] &
            answers.visibility) != 0;
  }
  /// Slices that a triangle is not surely beside or behind.
  __attribute__((always_inline)) uint32_t met(const BeamTable& t, int lane) const {
    const Broad behind = spread(-t.at(9, lane)), px = spread(t.at(11, lane)),
                py = spread(t.at(12, lane)), p = spread(t.at(10, lane) + t.at(13, lane));
    const auto side = [&](int e, int a) { return beam.side[a][1] + int(t.sides[e][a][lane]); };
    uint32_t mask = 0;
    for (int g = 0; g < kSlices; g += kBroad) {
      const auto most = [&](int e, Broad x, Broad y, Broad k) {
        return fused(x, load_broad(side(e, 0) + g), fused(y, load_broad(side(e, 1) + g), k));
      };
      BroadMask out = less(most(3, px, py, p), load_broad(beam.end + g));
      for (int e = 0; e < 3; ++e)
        out = out | less(most(e, spread(t.at(3 * e + 1, lane)), spread(t.at(3 * e + 2, lane)),
                              spread(t.at(3 * e, lane))),
                         behind);
      mask |= (~bits(out) & ((1u << kBroad) - 1)) << g;
    }
    return mask & uint32_t((uint64_t(1) << kSlices) - 1);
  }
  __attribute__((always_inline)) Broad edge(int e, const BeamTable& t, int lane, Broad x,
                                            Broad y) const {
    return fused(spread(t.at(3 * e + 1, lane)), x,
                 fused(spread(t.at(3 * e + 2, lane)), y, spread(t.at(3 * e, lane))));
  }
  /// One triangle against the rays of a slice. Whether a hit was found.
  __attribute__((always_inline)) bool slice(int g, const BeamTable& t, int lane, ChildRef ref,
                                            int place) {
    const int k = g * kBroad;
    const Broad x = load_broad(beam.place[0] + k), y = load_broad(beam.place[1] + k),
                farthest = load_broad(beam.farthest + k), nearest = load_broad(beam.nearest + k);
    const Broad least =
        smaller(edge(0, t, lane, x, y), smaller(edge(1, t, lane, x, y), edge(2, t, lane, x, y)));
    const float margin = t.at(9, lane), off = t.at(13, lane);
    const Broad at =
        fused(spread(t.at(11, lane)), x, fused(spread(t.at(12, lane)), y, spread(t.at(10, lane))));
    const Broad low = at - spread(off), high = at + spread(off);
    const BroadMask inside = less(spread(margin), least),
                    nearer = inside & less(nearest, low) & less(high, spread(beam.begin)),
                    away = less(least, spread(-margin)) | less(high, farthest);
    const uint32_t sure = bits(nearer);
    due += __builtin_popcount(sure);
    if (sure && Any) {
      store_broad(beam.farthest + k, choose(nearer, spread(__builtin_inff()), farthest));
      store_broad(beam.nearest + k, choose(nearer, spread(__builtin_inff()), nearest));
    } else if (sure) {
      store_broad(beam.farthest + k, choose(nearer, low, farthest));
      store_broad(beam.nearest + k, choose(nearer, high, nearest));
      put(beam.pending + k, nearer, ref);
      put(beam.leaf_at + k, nearer, uint32_t(place));
    }
    uint32_t doubt = ~(sure | bits(away)) & ((1u << kBroad) - 1);
    if (Any && __builtin_expect((doubt & bits(inside)) != 0, 0))
      doubt &= ~left_behind(k, doubt & bits(inside), ref, place);
    if (__builtin_expect(doubt != 0, 0)) {
      if (__builtin_expect(!Any && answers.opacity, 0)) doubt &= ~not_begun(k, doubt, ref, place);
      decide_all(k, doubt, ref, place);
    }
    return (sure | doubt) != 0;
  }
  /// Those of some rays from k on that meet a triangle before they begin, if at all: they go on
  /// behind a surface that they pass.
  __attribute__((noinline)) uint32_t not_begun(int k, uint32_t rays, ChildRef ref,
                                               int place) const {
    const BeamSource& s = beam.source;
    const Triangles leaf(tree, ref);
    Doubles p[3][3];
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a) p[j][a] = splat(double(leaf.at(j, s.order->axes[a])[place]));
    uint32_t found = 0;
    for (int h = 0; h < kBroad; h += kLanes) {
      if (!(rays >> h & ((1u << kLanes) - 1))) continue;
      const int r = k + h;
      const Doubles along = load(s.d[2] + r), inverse = 1 / along, margin = splat(beam.close);
      Exact<Doubles> e;
      e.see(p, {load(s.o[0] + r), load(s.o[1] + r), load(s.o[2] + r)},
            {load(s.d[0] + r) * inverse, load(s.d[1] + r) * inverse});
      e.weigh();
      found |= bits(at_most(magnitude(e.off_x), margin) & at_most(magnitude(e.off_y), margin) &
                    at_most(e.depth / along, load(s.t_min + r)))
               << h;
    }
    return found & rays & s.own(k, kBroad);
  }
  /// Those of some rays from k on, all surely inside a triangle, that surely begin beyond it: on
  /// the surface that they leave.
  __attribute__((noinline)) uint32_t left_behind(int k, uint32_t rays, ChildRef ref,
                                                 int place) const {
    const BeamSource& s = beam.source;
    const Plane plane(Triangles(tree, ref), place, *s.order);
    uint32_t left = 0;
    for (int h = 0; h < kBroad; h += kLanes) {
      if (!(rays >> h & ((1u << kLanes) - 1))) continue;
      const int r = k + h;
      const Doubles inverse = 1 / load(s.d[2] + r);
      left |= well_behind({load(s.o[0] + r), load(s.o[1] + r), load(s.o[2] + r)},
                          {load(s.d[0] + r) * inverse, load(s.d[1] + r) * inverse}, beam.close,
                          plane, double(s.order->sign))
              << h;
    }
    return left & rays;
  }
  /// One that may face either way.
  __attribute__((noinline)) bool slice_edge_on(int g, const BeamTable& t, int lane, ChildRef ref,
                                               int place) {
    const int k = g * kBroad;
    const Broad x = load_broad(beam.place[0] + k), y = load_broad(beam.place[1] + k);
    const Broad a = edge(0, t, lane, x, y), b = edge(1, t, lane, x, y), c = edge(2, t, lane, x, y);
    const float margin = t.at(9, lane);
    const BroadMask missed = less(smaller(a, smaller(b, c)), spread(-margin)) &
                             less(spread(margin), larger(a, larger(b, c)));
    const uint32_t doubt = ~bits(missed) & ((1u << kBroad) - 1);
    decide_all(k, doubt, ref, place);
    return doubt != 0;
  }
  void decide_all(int k, uint32_t rays, ChildRef ref, int place) {
    for (; rays; rays &= rays - 1) decide(k + __builtin_ctz(rays), ref, place);
  }
  void shorten(uint32_t slices) {
    for (; slices; slices &= slices - 1) {
      const int g = __builtin_ctz(slices);
      beam.end[g] = smallest(load_broad(beam.farthest + g * kBroad));
    }
    set_end();
  }
  void set_end() {
    Broad least = load_broad(beam.end);
    for (int g = kBroad; g < kSlices; g += kBroad) least = smaller(load_broad(beam.end + g), least);
    set_end(smallest(least));
  }
  void set_end(float least) {
    beam.last_end = least;
    beam.last_depth = beam.apex.o[2] + beam.apex.low_part[2] + (1 + 0x1p-20f) / least + beam.room;
  }

  /// For the memory of a node or a leaf, to have it when it is its turn.
  void ask(ChildRef child) const {
    const char* p = child & kLeaf
                        ? reinterpret_cast<const char*>(tree.floats + 9 * size_t(leaf_first(child)))
                        : reinterpret_cast<const char*>(tree.nodes + child);
    for (size_t k = 0; k < sizeof(Node); k += 64) __builtin_prefetch(p + k);
  }
  /// Asks for the memory of the next beam's rays from r on, and of this one's answers, a line of
  /// each: a few at every step of the walk, since a processor waits when it is asked for many.
  void fetch_ahead(int r) const {
    const BeamSource& s = beam.source;
    for (int a = 0; a < 3; ++a) {
      __builtin_prefetch(s.xyz_o[a] + kBeam + r);
      __builtin_prefetch(s.xyz_d[a] + kBeam + r);
    }
    __builtin_prefetch(s.t_min + kBeam + r);
    __builtin_prefetch(s.t_max + kBeam + r);
    if (Any) return;
    __builtin_prefetch(answers.t + r, 1);
    if (r % (2 * kOfLine)) return;
    __builtin_prefetch(answers.instance + r, 1);
    __builtin_prefetch(answers.primitive + r, 1);
    __builtin_prefetch(answers.u + r, 1);
    __builtin_prefetch(answers.v + r, 1);
  }
  /// False when it came to more leaves than `leaves` and its hits allow, or at_leaf(leaf) says so.
  template <class AtLeaf>
  __attribute__((always_inline)) bool walk(int leaves, AtLeaf at_leaf) {
    const Order& order = *beam.order;
    Floats m[kLines], c[kLines];
    FloatMask falls[kLines];
    for (int l = 0; l < kLines; ++l) {
      const int a = l / 2;
      const float turn = beam.width[a] + 0x1p-22f, apart = l % 2 ? beam.room : -beam.room;
      const float slope = l % 2 ? beam.middle[a] + turn : beam.middle[a] - turn;
      m[l] = splat(slope);
      c[l] = splat(beam.apex.o[a] - slope * beam.apex.o[2] + apart);
      falls[l] = less(m[l], Floats{});
    }
    const Floats first = splat(beam.apex.o[2] - beam.room);
    ChildRef waiting[kStack];
    float distance[kStack];
    alignas(64) float front[kWidth];
    int top = 0;
    ChildRef at = tree.root;
    due = leaves * kRaysOfLeaf;
    for (int step = 0;; ++step) {
      if (beam.source.more && step < kBeam / kOfLine) fetch_ahead(step * kOfLine);
      if (at & kLeaf) {
        if ((due -= kRaysOfLeaf) < 0 || !at_leaf(at)) return false;
      } else {
        const Node& n = tree.nodes[at];
        uint32_t mask = 0;
        for (int h = 0; h < kWidth; h += kFloats) {
          const Boxes b = boxes_of(n.planes[0] + h, order);
          const Floats near = larger(b.front, first), far = smaller(b.rear, splat(beam.last_depth));
          const auto line = [&](int l, bool low) {
            return fused(m[l], low ? choose(falls[l], far, near) : choose(falls[l], near, far),
                         c[l]);
          };
          const FloatMask misses = less(far, near) | less(b.high_x, line(kLowX, true)) |
                                   less(line(kHighX, false), b.low_x) |
                                   less(b.high_y, line(kLowY, true)) |
                                   less(line(kHighY, false), b.low_y);
          store(front + h, near);
          mask |= (~bits(misses) & ((1u << kFloats) - 1)) << h;
        }
        const int base = top;
        for (; mask; mask &= mask - 1) {
          const int child = __builtin_ctz(mask);
          int p = top++;
          for (; p > base && distance[p - 1] < front[child]; --p) {
            waiting[p] = waiting[p - 1];
            distance[p] = distance[p - 1];
          }
          waiting[p] = n.child[child];
          ask(n.child[child]);
          distance[p] = front[child];
        }
      }
      do {
        if (top == 0) return true;
        --top;
      } while (!(distance[top] <= beam.last_depth));
      at = waiting[top];
    }
  }
};

}  // namespace
}  // namespace glint
