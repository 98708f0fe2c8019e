// Where what a pixel shows was in the frame before, and will be in the one after
// (semantics/passes.md).
#pragma once
#include "scene/scene.h"
#include "scene/surface.h"

namespace glint {

class MotionVectors {
 public:
  /// neighbours: two, or null where nobody asks.
  MotionVectors(const Scene& scene, const GlintNeighbour* neighbours)
      : scene_(scene), neighbours_(neighbours) {}

  /// In pixels: before less here, then here less after; x, y each, 0 where a point is not before
  /// the camera.
  void at(const Surface& s, double (&motion)[4]) const;

 private:
  const Scene& scene_;
  const GlintNeighbour* neighbours_;
};

}  // namespace glint
