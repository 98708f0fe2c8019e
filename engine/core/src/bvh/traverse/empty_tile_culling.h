// Whether anything stands in a part of space, as far as the boxes of a tree tell.
#pragma once
#include "math/vec.h"

namespace glint {

struct TreeView;

/// Where the rays between four are, two neighbours each the edges of a side: all begin at one
/// point, or all are parallel.
class TileFrustum {
 public:
  /// Corners in turn round the frustum; directions unit.
  TileFrustum(const Vec3d (&origins)[4], const Vec3d (&directions)[4]);

  /// Whether a box lies beside the frustum by more than `margin` and what rounding turns the
  /// frustum's sides by within `reach`. Where nothing is known, it does not.
  bool misses(const Vec3d& low, const Vec3d& high, double margin, double reach) const;
  /// The largest distance of an origin from there.
  double reach(const Vec3d& point) const;

 private:
  Vec3d origins_[4];
  Vec3d n_[4];      // unit and inward; 0 where it is not known
  double turn_[4];  // sines of the angles by which they may be off
};

/// Whether certainly no ray of the frustum hits anything of a tree: all its boxes lie beside the
/// frustum, by more than rays are rounded by. False where it takes long to say.
bool surely_empty(const TreeView& tree, const TileFrustum& frustum);

}  // namespace glint
