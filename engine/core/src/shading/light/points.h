// Points on meshes that glow, and in media that do.
#pragma once
#include "shading/light/shape.h"

namespace glint {
namespace {

struct MeshPoint : ShapeTraits {
  static constexpr LightShape kShape = LightShape::kMesh;
  static constexpr bool kTwoSided = true;

  /// The point is common to all, and seen from no nearer than the disc that it stands for.
  static SeenSample sample(const LightSample& s, const Three& x) {
    const Three q = splat3(s.center), n = splat3(s.axis), to = q - x, l = unit(to);
    const Doubles z = -dot(l, n), d2 = larger(dot(to, to), splat(s.mesh.near2)),
                  inverse_pdf = s.inverse_pdf * magnitude(z) / d2;
    return {l, before(s, z > 0), s.factor * inverse_pdf, inverse_pdf, ~Mask{}};
  }

  static Three color(const LightSample& s, const SeenSample& at) {
    const Mask front = dot(at.l, splat3(s.axis)) < 0;
    return {choose(front, splat(s.color[0]), splat(s.back[0])),
            choose(front, splat(s.color[1]), splat(s.back[1])),
            choose(front, splat(s.color[2]), splat(s.back[2]))};
  }

  static double draws(const LightSample& s) { return 1 / s.count; }

  /// Before the surface, on the side that the ray comes from: a lifted origin may be on another
  /// than the point.
  static Three end(const LightSample& s, const SeenSample& at, const Three& origin, Mask lifted) {
    const Three end = before(s, dot(origin - splat3(s.center), splat3(s.axis)) > 0);
    return choose(lifted, end, at.end);
  }

 private:
  static Three before(const LightSample& s, Mask front) {
    return splat3(s.center) +
           choose(front, splat(s.mesh.reach), splat(-s.mesh.reach)) * splat3(s.axis);
  }
};

/// It shines alike to all sides.
struct MediumPoint : ShapeTraits {
  static constexpr LightShape kShape = LightShape::kMedium;
  static constexpr bool kSoftened = true;

  /// Within the ball that it stands for, what comes from there is finite and in the mean over a
  /// uniform medium what comes from all of it.
  static SeenSample sample(const LightSample& s, const Three& x) {
    const Three to = splat3(s.center) - x;
    const double near2 = s.medium.near2;
    const Doubles d2 = dot(to, to), within = (6 - 5 * (d2 / near2)) / near2,
                  inverse_pdf = s.inverse_pdf * choose(d2 < near2, within, 1 / d2);
    return {unit(to), splat3(s.center), s.factor * inverse_pdf, inverse_pdf, d2 > 0};
  }
};

}  // namespace
}  // namespace glint
