// Anchored space: where the core's coordinates have all the bits that matter.
#pragma once
#include <cmath>

#include "math/vec.h"

namespace glint {

/// Anchored space: the camera is the origin, and a power of two brings the scene's radius to [1,
/// 2). Both steps keep all bits that matter (NUMERICS: far from the origin).
struct Anchor {
  Vec3d origin;
  double scale = 1;
  Vec3d point(Vec3d world) const { return scale * (world - origin); }
  Vec3d world(Vec3d p) const { return (1 / scale) * p + origin; }
  Affine matrix(const Affine& m) const {
    return {scale * m.x, scale * m.y, scale * m.z, point(m.t)};
  }
  /// Whether single precision is fine enough for an eye that stands there: not far out of the
  /// scene.
  bool near(Vec3d world_eye) const {
    return max_abs(point(world_eye)) <= 4;
  }  // the scene's radius is 1 to 2
  bool same_origin(const Anchor& b) const {
    return origin.x == b.origin.x && origin.y == b.origin.y && origin.z == b.origin.z;
  }
  bool operator==(const Anchor& b) const { return same_origin(b) && scale == b.scale; }
};

/// Low and high corner; low above high for nothing.
struct Extent {
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  void grow(Vec3d p) {
    low = min(low, p);
    high = max(high, p);
  }
  bool empty() const { return !(low.x <= high.x); }
  /// One of the 8.
  Vec3d corner(int k) const {
    return {k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z};
  }
};

}  // namespace glint
