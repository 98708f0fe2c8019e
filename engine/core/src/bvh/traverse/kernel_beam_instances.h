// Beams into instances that are large beside them: the beam's way through the tree over instances
// leads to a few, and all its rays go into the tree of each as a beam in its space.
#pragma once
#include "bvh/traverse/kernel_beam.h"
#include "bvh/traverse/kernel_instances.h"

namespace glint {
namespace {

constexpr int kFewInstances = 4;    // a beam that comes to more is parted
constexpr int kPlacedLeaves = 100;  // as leaves_allowed: much is lost with the other instances

/// Where a beam's rays are in the world.
struct WorldRays {
  const double *xyz_o[3], *xyz_d[3];
  WorldRays(const Rays& rays, size_t first) {
    for (int a = 0; a < 3; ++a) {
      xyz_o[a] = rays.o[a] + first;
      xyz_d[a] = rays.d[a] + first;
    }
  }
};

/// Whether an instance is so large that a beam, from its first ray to its last, covers at most half
/// of its width.
inline bool is_wide(const InstanceRecord& instance, const TreeView& tree, const WorldRays& rays) {
  const OpenRay<double> a(instance, rays, 0), b(instance, rays, kBeam - 1);
  double ahead = 0, length = 0, apart = 0;
  for (int k = 0; k < 3; ++k) {
    ahead += (tree.center[k] - a.o[k]) * a.d[k];
    length += a.d[k] * a.d[k];
    apart += (b.d[k] - a.d[k]) * (b.d[k] - a.d[k]);
  }
  return apart * ahead * ahead < tree.ball * tree.ball * length * length;
}

/// A beam's rays in an instance's space, and what they find there.
struct PlacedBeam {
  alignas(64) double columns[6][kBeam], t_max[kBeam], t[kBeam];
  uint32_t instance[kBeam], primitive[kBeam];
  alignas(64) float u[kBeam], v[kBeam];

  Rays rays(const Rays& world, size_t first, const InstanceRecord& placed) {
    const WorldRays from(world, first);
    for (int k = 0; k < kBeam; k += kLanes) {
      const OpenRay<Doubles> ray(placed, from, k);
      for (int a = 0; a < 3; ++a) {
        store(columns[a] + k, ray.o[a]);
        store(columns[3 + a] + k, ray.d[a]);
      }
    }
    return {{columns[0], columns[1], columns[2]},
            {columns[3], columns[4], columns[5]},
            world.t_min + first,
            world.t_max + first,
            kBeam,
            world.visibility};
  }
};

/// The instances that a beam comes to, nearest first; false when they are too many, or not meshes
/// that stop all rays.
__attribute__((noinline)) inline bool find_instances(const TopLevelView& world,
                                                     const TreeView& tree, const Rays& rays,
                                                     size_t first, Answers& answers,
                                                     uint32_t (&found)[kFewInstances], int& count,
                                                     Beamed& beamed) {
  Beam beam;
  beamed = Beamed::kUnfit;
  if (!set_from_apex(beam, tree, rays, first)) return false;
  BeamWalk<false> walk{tree, beam, answers};
  walk.set_end();
  beamed = Beamed::kParted;
  return walk.walk(kFewInstances, [&](ChildRef leaf) {
    for (uint32_t k = leaf_first(leaf), end = k + uint32_t(leaf_count(leaf)); k < end; ++k) {
      const InstanceRecord& i = world.instances[k];
      if (!(i.visibility & answers.visibility)) continue;
      if (count == kFewInstances || world.objects[i.tree].kind != kTriangleLeaf ||
          (answers.opacity &&
           !stops<false>(*answers.opacity, answers.opacity->of_instance[i.instance])) ||
          !is_wide(i, world.objects[i.tree], WorldRays(rays, first)))
        return false;
      found[count++] = k;
    }
    return true;
  });
}

/// What a beam's rays meet in the instances of a tree, nearer than what `answers` has. Where it
/// fails, that may be some of it.
__attribute__((noinline)) inline Beamed trace_placed_beam(const TopLevelView& world,
                                                          const TreeView& tree, const Rays& rays,
                                                          size_t first, Answers& answers) {
  uint32_t found[kFewInstances];
  int count = 0;
  Beamed beamed;
  if (!find_instances(world, tree, rays, first, answers, found, count, beamed)) return beamed;
  PlacedBeam placed;
  Answers inner = answers;
  inner.t = placed.t;
  inner.instance = placed.instance;
  inner.primitive = placed.primitive;
  inner.u = placed.u;
  inner.v = placed.v;
  inner.masks = nullptr;
  inner.opacity = nullptr;
  inner.layers = {};
  for (int n = 0; n < count; ++n) {
    const InstanceRecord& instance = world.instances[found[n]];
    Rays own = placed.rays(rays, first, instance);
    for (int k = 0; k < kBeam; k += kLanes)  // with room for hits at the same distance
      store(placed.t_max + k, smaller(load(own.t_max + k), load(answers.t + k) * (1 + 0x1p-36)));
    own.t_max = placed.t_max;
    beamed = trace_beam<false>(world.objects[instance.tree], own, 0, inner, kPlacedLeaves);
    if (beamed != Beamed::kTraced) return beamed;
    for (int k = 0; k < kBeam; ++k)
      if (placed.instance[k] != Hit::kNone)
        answers.accept<false>(k, placed.t[k], double(placed.u[k]), double(placed.v[k]),
                              {instance.instance, placed.primitive[k]});
  }
  return Beamed::kTraced;
}

}  // namespace
}  // namespace glint
