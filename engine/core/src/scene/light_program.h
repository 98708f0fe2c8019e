// Lights whose node trees say how bright they are: a program over points of their shapes.
#pragma once
#include <vector>

#include "math/vec.h"
#include "program/program.h"
#include "shading/stages.h"

namespace glint {

struct Scene;
struct Light;

class LightProgram {
 public:
  LightProgram(const Scene& scene, const Stages& stages) : scene_(scene), stages_(stages) {}

  /// Point i of the block: `end` on the light, as `from` sees it in the unit direction d, in
  /// anchored space. An endless light has no `end`.
  void put(const Light& light, size_t i, Vec3d from, Vec3d d, Vec3d end);
  /// Over the first `count` points. kind: of the rays that see the light.
  void run(const Light& light, RayKind kind, size_t count);
  /// What the light's colour is times at point i; 0 where that is not finite.
  Vec3d share(const Light& light, size_t i) const;

 private:
  const Scene& scene_;
  const Stages& stages_;
  ProgramPoints points_{};
  std::vector<double> slots_;
};

}  // namespace glint
