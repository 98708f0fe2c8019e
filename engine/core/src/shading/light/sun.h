// Suns: directions in a cone.
#pragma once
#include "shading/light/shape.h"

namespace glint {
namespace {

struct Sun : ShapeTraits {
  static constexpr LightShape kShape = LightShape::kSun;

  static SeenSample sample(const LightSample& s, const Three&) {
    return {splat3(s.sun.l), splat3(s.sun.l), splat(s.factor), splat(s.inverse_pdf), ~Mask{}};
  }
  static SeenSample towards(const LightSample& s, const Three&, const Three& l) {
    const Three off = l + splat3(s.axis);  // of length^2 2 (1 - cos)
    return {l, l, splat(s.factor), splat(s.inverse_pdf), 0.5 * dot(off, off) <= s.sun.versine};
  }
};

}  // namespace
}  // namespace glint
