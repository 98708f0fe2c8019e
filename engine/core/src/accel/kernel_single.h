// Rays through a tree each on its own, nearest boxes first. Several are on their way at a time, in turns: a processor that waits for the
// box or the triangle of one of them has work with the others.
#pragma once
#include "kernel_leaves.h"

namespace glint {
namespace {

template <bool Any>
void visit_instances(Walk<Any>& w, uint64_t rays, ChildRef root);

/// One ray's numbers for boxes, in all lanes. Slabs are ordered by the direction's signs.
struct BoxRay {
  Floats near_o[3], far_o[3], near_inverse[3], far_inverse[3], first, last;
  uint32_t near_plane[3], far_plane[3];  // offsets in Node::planes
  void set(const Tile& tile, int r, const Order& order) {
    first = splat(tile.begin_lo[r]), last = splat(tile.hi[r]);
    // The triangle test rounds p - o as these slabs do: what else it rounds is half of the room, and nothing along the depth.
    const float room = 0.5f * tile.room;
    for (int k = 0; k < 2; ++k) {
      const float inverse = 1 / tile.slope[k][r];
      uint32_t back, outward_bits;
      __builtin_memcpy(&back, &inverse, sizeof back);
      __builtin_memcpy(&outward_bits, &room, sizeof room);
      back &= 0x80000000u, outward_bits |= back;
      float outward;
      __builtin_memcpy(&outward, &outward_bits, sizeof outward);
      near_o[k] = splat(tile.of[k][r] + outward), far_o[k] = splat(tile.of[k][r] - outward);
      set_inverse(k, inverse);
      const uint32_t turned = (order.low[k] ^ order.high[k]) & -(back >> 31);
      near_plane[k] = order.low[k] ^ turned, far_plane[k] = order.high[k] ^ turned;
    }
    near_o[2] = far_o[2] = splat(order.sign * tile.start[r]);
    set_inverse(2, order.sign);
    near_plane[2] = order.front, far_plane[2] = order.rear;
  }
  /// The far side is a little longer than computed (Ize 2013: two ulps; here eight).
  void set_inverse(int k, float inverse) { near_inverse[k] = splat(inverse), far_inverse[k] = splat(inverse * (1 + 0x1p-20f)); }
};

/// Which children the ray meets, and how deep. 0 * inf is NaN: `larger` and `smaller` then give up a bound or two, and at worst a box is
/// entered in vain.
struct BoxHits {
  Floats near[kWidth / kLanes];
  uint32_t mask = 0;
  __attribute__((always_inline)) BoxHits(const Node& n, const BoxRay& b) {
    for (int first = 0; first < kWidth; first += kLanes) {
      const float* planes = n.planes[0] + first;
      const Floats near_x = (load(planes + b.near_plane[0]) - b.near_o[0]) * b.near_inverse[0];
      const Floats near_y = (load(planes + b.near_plane[1]) - b.near_o[1]) * b.near_inverse[1];
      const Floats near_z = (load(planes + b.near_plane[2]) - b.near_o[2]) * b.near_inverse[2];
      const Floats far_x = (load(planes + b.far_plane[0]) - b.far_o[0]) * b.far_inverse[0];
      const Floats far_y = (load(planes + b.far_plane[1]) - b.far_o[1]) * b.far_inverse[1];
      const Floats far_z = (load(planes + b.far_plane[2]) - b.far_o[2]) * b.far_inverse[2];
      near[first / kLanes] = larger(larger(near_x, near_y), larger(near_z, b.first));
      mask |= bits(at_most(near[first / kLanes], smaller(smaller(smaller(far_x, far_y), far_z), b.last))) << first;
    }
  }
};

/// Decides or takes the triangles of `mask`, not culled, whose depths are between lo and hi. `sure`: hit without doubt.
template <bool Any>
__attribute__((noinline)) void take_triangles(Walk<Any>& w, int r, ChildRef ref, int first, uint32_t mask, const TriangleTest& t, Floats lo,
                                              Floats hi) {
  Tile& tile = w.tile;
  const uint32_t sure = bits(t.sure());
  alignas(64) float nearest[kLanes], farthest[kLanes];
  store(nearest, lo), store(farthest, hi);
  for (; mask; mask &= mask - 1) {
    const int lane = __builtin_ctz(mask), place = first + lane;
    const bool hit = sure >> lane & 1;
    if (hit && nearest[lane] > tile.hi[r]) continue;
    if (!visible(tile, leaf_first(ref) + uint32_t(place))) continue;
    if (hit && farthest[lane] < tile.lo[r] && nearest[lane] > tile.begin_hi[r]) {
      if (Any) return w.block(r);
      tile.lo[r] = nearest[lane], tile.hi[r] = farthest[lane], tile.pending[r] = ref, tile.place[r] = uint32_t(place);
      continue;
    }
    tile.answers->count_fallback(tile.slot[r]);
    if (!hit && !t.exactly(lane)) continue;
    w.decide(r, ref, place);
    if (Any && !alive(tile, r)) return;
  }
}

/// The triangles of a leaf against one ray.
template <bool Any>
inline void hit_triangles(Walk<Any>& w, int r, ChildRef ref, const Order& order) {
  const Tile& tile = w.tile;
  const int n = leaf_count(ref);
  const float* leaf = w.tree.floats + 9 * size_t(leaf_first(ref));
  const float *px = leaf + order.axes[0] * n, *py = leaf + order.axes[1] * n, *pz = leaf + order.axes[2] * n;
  const size_t corner = 3 * size_t(n);
  const Floats ox = splat(tile.of[0][r]), oy = splat(tile.of[1][r]), oz = splat(tile.start[r]), sign = splat(order.sign);
  const Floats rx = splat(tile.rest[0][r]), ry = splat(tile.rest[1][r]), rz = splat(tile.rest[2][r]);
  const Floats sx = splat(tile.slope[0][r]), sy = splat(tile.slope[1][r]);
  for (int first = 0; first < n; first += kLanes) {
    TriangleTest t;
    for (size_t j = 0; j < 3; ++j) {
      t.z[j] = load(pz + j * corner + first) * sign - oz - rz;
      t.x[j] = load(px + j * corner + first) - ox - rx - sx * t.z[j];
      t.y[j] = load(py + j * corner + first) - oy - ry - sy * t.z[j];
    }
    t.edges();
    const int rest = n - first < kLanes ? n - first : kLanes;
    uint32_t mask = ~t.conflict() & ((1u << rest) - 1);
    if (!mask) continue;
    Floats lo, hi;
    t.depth(t.extent(), tile.far_room, lo, hi);
    mask &= ~bits(t.sure() & (less(splat(tile.hi[r]), lo) | less(hi, splat(tile.begin_lo[r]))));
    if (mask) take_triangles(w, r, ref, first, mask, t, lo, hi);
  }
}

template <bool Any>
inline void hit_leaf(Walk<Any>& w, int r, ChildRef leaf, const Order& order) {
  if (w.tree.kind == kTriangleLeaf) hit_triangles(w, r, leaf, order);
  else hit_shapes(w, r, leaf);
}

struct Waiting {
  ChildRef child;
  float distance;
};

/// One ray on its way: `child` is where it goes next.
struct Walker {
  BoxRay box;
  const Order* order;
  int r;
  float end;
  ChildRef child;
  Walker* next;  // whose turn it is then
  Waiting* top;
  Waiting stack[kStack + 2];

  void start(const Tile& tile, int ray, ChildRef root) {
    r = ray, order = &order_of(tile, ray), child = root, end = tile.hi[ray];
    box.set(tile, ray, *order);
    stack[0] = {kLeaf, -kFar}, top = stack + 1;
  }
  bool at_node() const { return !(child & kLeaf); }
  bool done() const { return top == stack; }
  /// After a hit.
  void shorten(const Tile& tile) { end = tile.hi[r], box.last = splat(end); }
  void pop() {
    do --top;
    while (top->distance > end);
    child = top->child;
  }
  /// To the nearest child of a node that the ray meets, or what was left for later.
  void descend(const Node& n) {
    const BoxHits met(n, box);
    alignas(64) float distance[kWidth];
    for (int k = 0; k < kWidth / kLanes; ++k) store(distance + k * kLanes, met.near[k]);
    const uint32_t inner = met.mask & (met.mask - 1);
    if (inner & (inner - 1)) push_many(n, met.mask, distance);
    else push_two(n, met.mask, distance);
    pop();
  }
  /// No, one or two children, the nearer on top. Nobody can foresee how many, nor which: hence no branches.
  void push_two(const Node& n, uint32_t mask, const float* distance) {
    const uint32_t one = lowest_bit(mask | 1u << (kWidth - 1)), two = highest_bit(mask | 1);  // the same one when there is one
    const float a = distance[one], b = distance[two];
    const uint32_t swap = (one ^ two) & -uint32_t(a < b);
    top[0] = {n.child[one ^ swap], larger(a, b)}, top[1] = {n.child[two ^ swap], smaller(a, b)};
    top += __builtin_popcount(mask);
  }
  static uint32_t lowest_bit(uint32_t mask) { return uint32_t(__builtin_ctz(mask)); }
  static uint32_t highest_bit(uint32_t mask) { return 31 - uint32_t(__builtin_clz(mask)); }
  /// The nearest on top, the others hardly sorted.
  void push_many(const Node& n, uint32_t mask, const float* distance) {
    uint32_t nearest = lowest_bit(mask);
    while (mask &= mask - 1) {
      const uint32_t k = lowest_bit(mask), swap = (nearest ^ k) & -uint32_t(distance[k] < distance[nearest]);
      nearest ^= swap;
      *top++ = {n.child[k ^ swap], distance[k ^ swap]};
    }
    *top++ = {n.child[nearest], distance[nearest]};
  }
};

constexpr int kWalkers = 8;

/// Asks for the memory that a ray needs when it is its turn again. No branch: where it goes cannot be foreseen.
inline void fetch(const TreeView& tree, ChildRef child) {
  const uintptr_t node = reinterpret_cast<uintptr_t>(tree.nodes) + child * sizeof(Node);
  const uintptr_t leaf = reinterpret_cast<uintptr_t>(tree.floats) + leaf_first(child) * 9 * sizeof(float);
  const uintptr_t at_leaf = uintptr_t(intptr_t(int32_t(child) >> 31));  // all bits or none
  const char* p = reinterpret_cast<const char*>((node & ~at_leaf) | (leaf & at_leaf));
  for (size_t k = 0; k < sizeof(Node); k += 64) __builtin_prefetch(p + k);
}

/// One step of a walker; false when its ray is through.
template <bool Any>
inline bool step(Walk<Any>& w, Walker& a) {
  if (a.at_node()) return a.descend(w.tree.nodes[a.child]), true;
  if (a.done()) return false;
  hit_leaf(w, a.r, a.child, *a.order);
  a.shorten(w.tile);
  if (Any && !alive(w.tile, a.r)) return false;
  a.pop();
  return true;
}

/// Rays of a tile through the part of its tree below `root`. Bundles do not learn of it: Walk::trim.
template <bool Any>
__attribute__((noinline)) void walk_rays(Walk<Any>& w, uint64_t rays, ChildRef root) {
  if (w.tree.kind == kInstanceLeaf) return visit_instances(w, rays, root);
  const bool slow = w.tree.large && __builtin_popcountll(rays) > 2;  // memory, and others have the time until it answers
  Walker walkers[kWalkers], *last = walkers;
  for (int k = 0; rays && k < kWalkers; ++k, rays &= rays - 1) {
    last->next = &walkers[k], last = &walkers[k];
    last->start(w.tile, __builtin_ctzll(rays), root);
  }
  last->next = walkers;
  for (Walker *before = last, *a = walkers;; before = a, a = a->next) {
    if (step(w, *a)) {
      if (slow) fetch(w.tree, a->child);
    } else if (rays) {
      a->start(w.tile, __builtin_ctzll(rays), root), rays &= rays - 1;
    } else {
      if (a == before) return;
      before->next = a->next, a = before;
    }
  }
}

}  // namespace
}  // namespace glint
