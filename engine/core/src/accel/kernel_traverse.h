// Single rays through the trees, nearest boxes first.
#pragma once
#include "kernel_leaves.h"

namespace glint {
namespace {

/// The ray's numbers for boxes, one to a lane.
struct BoxRay {
  Floats near_o[3], far_o[3], inv[3], t_min, t_max;
  size_t near_plane[3], far_plane[3];  // offsets in Node::planes
  explicit BoxRay(const LocalRay& r) : t_min(splat(r.t_min)), t_max(splat(r.t_max)) {
    for (int k = 0; k < 3; ++k) {
      near_o[k] = splat(r.near_o[k]), far_o[k] = splat(r.far_o[k]), inv[k] = splat(r.inv[k]);
      near_plane[k] = r.near_plane[k] * kWidth, far_plane[k] = (r.near_plane[k] ^ 1) * kWidth;
    }
  }
};

/// Which children the ray meets, and where it enters them. Slabs ordered by the direction's signs; the far side is a little longer than
/// computed (Ize 2013: two ulps; here eight, which covers the rounding of the triangle test's shear too). 0 * inf is NaN, for a ray inside
/// a face of the box: `larger` and `smaller` then give up a bound or two, and at worst a box is entered in vain.
inline uint32_t hit_boxes(const Node& n, const BoxRay& b, float* distance) {
  const float* planes = n.planes[0];
  uint32_t mask = 0;
  for (size_t first = 0; first < kWidth; first += kLanes, planes += kLanes) {
    const Floats near_x = (load(planes + b.near_plane[0]) - b.near_o[0]) * b.inv[0];
    const Floats near_y = (load(planes + b.near_plane[1]) - b.near_o[1]) * b.inv[1];
    const Floats near_z = (load(planes + b.near_plane[2]) - b.near_o[2]) * b.inv[2];
    const Floats far_x = (load(planes + b.far_plane[0]) - b.far_o[0]) * b.inv[0];
    const Floats far_y = (load(planes + b.far_plane[1]) - b.far_o[1]) * b.inv[1];
    const Floats far_z = (load(planes + b.far_plane[2]) - b.far_o[2]) * b.inv[2];
    const Floats near = larger(larger(near_x, near_y), larger(near_z, b.t_min));
    const Floats far = smaller(smaller(smaller(far_x, far_y), far_z) * splat(1 + 0x1p-20f), b.t_max);
    store_lanes(distance + first, near);
    mask |= bits(near <= far) << first;
  }
  return mask;
}

struct Entry {
  ChildRef child;
  float distance;
};

/// Pushes all children but the nearest, the farthest first, and returns the nearest. mask has at least two bits.
inline ChildRef push_children(const Node& n, uint32_t mask, const float* distance, Entry*& top) {
  const int a = __builtin_ctz(mask), b = 31 - __builtin_clz(mask);
  if ((mask & (mask - 1)) == 1u << b) {
    const bool swap = distance[b] < distance[a];
    *top++ = swap ? Entry{n.child[a], distance[a]} : Entry{n.child[b], distance[b]};
    return n.child[swap ? b : a];
  }
  Entry* const base = top;
  for (; mask; mask &= mask - 1) {
    const int k = __builtin_ctz(mask);
    const Entry e{n.child[k], distance[k]};
    Entry* p = top++;
    for (; p > base && p[-1].distance < e.distance; --p) *p = p[-1];
    *p = e;
  }
  return (--top)->child;
}

/// Visits the leaves that the ray meets; leaf(ordinal, count) says whether the ray's bound changed.
template <bool Any, class Leaf>
inline void traverse(const TreeView& tree, LocalRay& r, const Query& q, Leaf leaf) {
  Entry stack[kStack];
  Entry* top = stack;
  BoxRay b(r);
  alignas(32) float distance[kWidth];
  *top++ = {tree.root, 0};
  while (top != stack) {
    const Entry entry = *--top;
    if (entry.distance > r.t_max) continue;
    ChildRef child = entry.child;
    bool missed = false;
    while (!(child & kLeaf)) {
      const Node& n = tree.nodes[child];
      const uint32_t mask = hit_boxes(n, b, distance);
      if ((missed = mask == 0)) break;
      child = mask & (mask - 1) ? push_children(n, mask, distance, top) : n.child[__builtin_ctz(mask)];
    }
    if (missed) continue;
    const bool changed = leaf(child & kOrdinal, int(child >> kCountShift & 7) + 1);
    if (Any && q.found) return;
    if (changed) b.t_max = splat(r.t_max);
  }
}

/// A tree whose leaves hold primitives.
template <bool Any>
inline void trace_primitives(const TreeView& tree, LocalRay& r, Query& q) {
  switch (tree.kind) {
    case kTriangleLeaf:
      return traverse<Any>(tree, r, q, [&](uint32_t ordinal, int n) { return hit_triangles<Any>(tree, ordinal, n, r, q); });
    case kSphereLeaf:
      return traverse<Any>(tree, r, q, [&](uint32_t ordinal, int n) { return hit_spheres<Any>(tree, ordinal, n, r, q); });
    default: return traverse<Any>(tree, r, q, [&](uint32_t ordinal, int n) { return hit_polygons<Any>(tree, ordinal, n, r, q); });
  }
}

inline D3 to_object(const InstanceRecord& i, D3 v) { return v.x * d3(i.linear) + v.y * d3(i.linear + 3) + v.z * d3(i.linear + 6); }

template <bool Any>
__attribute__((noinline)) void trace_instance(const WorldView& world, const InstanceRecord& i, const Ray& ray, Query& q) {
  const TreeView& tree = world.objects[i.tree];
  const D3 o = to_object(i, D3{ray.o.x, ray.o.y, ray.o.z} - d3(i.origin)), d = to_object(i, {ray.d.x, ray.d.y, ray.d.z});
  LocalRay r;
  r.instance = i.instance;
  if (enter(r, o, d, tree, q)) trace_primitives<Any>(tree, r, q);
}

template <bool Any>
inline bool hit_instances(const WorldView& world, uint32_t ordinal, int n, const Ray& ray, LocalRay& r, Query& q) {
  const double before = q.t;
  for (uint32_t k = ordinal; k < ordinal + uint32_t(n); ++k)
    if (world.instances[k].visibility & q.visibility) {
      trace_instance<Any>(world, world.instances[k], ray, q);
      if (Any && q.found) return true;
    }
  if (q.t == before) return false;
  shorten(r, q);
  return true;
}

template <bool Any>
inline void trace_tree(const WorldView& world, const TreeView& tree, const Ray& ray, Query& q) {
  LocalRay r;
  r.instance = Hit::kNone;
  if (!enter(r, {ray.o.x, ray.o.y, ray.o.z}, {ray.d.x, ray.d.y, ray.d.z}, tree, q)) return;
  if (tree.kind != kInstanceLeaf) return trace_primitives<Any>(tree, r, q);
  traverse<Any>(tree, r, q, [&](uint32_t ordinal, int n) { return hit_instances<Any>(world, ordinal, n, ray, r, q); });
}

template <bool Any>
inline void trace(const WorldView& world, const Ray& ray, Query& q) {
  for (size_t k = 0; k < world.tree_count; ++k) {
    trace_tree<Any>(world, world.trees[k], ray, q);
    if (Any && q.found) return;
  }
}

inline Ray ray_at(const Rays& r, size_t k) {
  return {{r.o[0][k], r.o[1][k], r.o[2][k]}, {r.d[0][k], r.d[1][k], r.d[2][k]}, r.t_min[k], r.t_max[k], r.visibility};
}

void closest(const WorldView& world, const Rays& rays, const Hits& hits) {
  for (size_t k = 0; k < rays.count; ++k) {
    const Ray ray = ray_at(rays, k);
    Query q{ray.t_min, ray.t_max, ray.visibility, world.visibility};
    trace<false>(world, ray, q);
    hits.t[k] = q.t, hits.instance[k] = q.instance, hits.primitive[k] = q.primitive, hits.u[k] = float(q.u), hits.v[k] = float(q.v);
  }
}

void occluded(const WorldView& world, const Rays& rays, uint8_t* blocked) {
  for (size_t k = 0; k < rays.count; ++k) {
    const Ray ray = ray_at(rays, k);
    Query q{ray.t_min, ray.t_max, ray.visibility, world.visibility};
    trace<true>(world, ray, q);
    blocked[k] = q.found;
  }
}

}  // namespace
}  // namespace glint
