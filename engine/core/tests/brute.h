// The truth: every primitive against the ray in long double, with the room that float32 rounding of
// ray and vertices leaves.
#pragma once
#include <vector>

#include "bvh/accel.h"

namespace glint::test {

using Real = long double;
using V = Vec3<Real>;

/// One primitive on one ray. `inside`: how far the hit is inside the primitive (negative: outside),
/// in the unit of `room`, which is the bound of the rounding. A hit with inside > room is certain,
/// one with inside < -room impossible.
struct Truth {
  uint32_t instance, primitive;
  Real t, inside, room, t_room;
  Real u = 0, v = 0;
};

struct BruteScene {
  std::vector<GeometryView> geometries;
  std::vector<InstanceView> instances;
};

/// Everything that the ray may hit, t_min, t_max and visibility respected, in no order.
std::vector<Truth> brute(const BruteScene& scene, const Ray& ray);

/// Whether `hit` is right: a possible hit with the right t, u, v, and no certain one nearer; a miss
/// where no hit is certain.
bool agrees(const std::vector<Truth>& truth, const Hit& hit);
/// Whether blocked may be this.
bool agrees(const std::vector<Truth>& truth, bool blocked);

}  // namespace glint::test
