// Point lights and spots: points, spheres, and discs where their falloff is soft.
#pragma once
#include "shading/light/shape.h"

namespace glint {
namespace {

/// Those without a radius, or one sample.
struct Point : SpotTraits {
  static constexpr LightShape kShape = LightShape::kPoint;

  static SeenSample sample(const LightSample& s, const Three& x) {
    const Three to = splat3(s.center) - x;
    return {unit(to), splat3(s.center), s.physical ? inverse_square(s, dot(to, to)) : splat(1),
            Doubles{}, ~Mask{}};
  }
};

/// Directions in the cone that a sphere subtends.
struct Sphere : ShapeTraits {
  static constexpr LightShape kShape = LightShape::kSphere;

  static SeenSample sample(const LightSample& s, const Three& x) {
    const Cone cone(s, x);
    Three t1, t2;
    frame(cone.axis, t1, t2);
    const double u = s.round.x, v = s.round.y;
    const Doubles cosine = 1 - (u * u + v * v) * cone.versine;
    // over the disc's radius
    const Doubles sine = root(larger(cone.versine * (1 + cosine), splat(0)));
    return at(s, x, cone, unit(cosine * cone.axis + sine * (splat(u) * t1 + splat(v) * t2)));
  }

  static SeenSample towards(const LightSample& s, const Three& x, const Three& l) {
    const Cone cone(s, x);
    SeenSample seen = at(s, x, cone, l);
    const Three off = l - cone.axis;
    seen.good &= 0.5 * dot(off, off) <= cone.versine;
    return seen;
  }

 private:
  /// From inside it is all directions, whatever way a spot shines.
  struct Cone {
    Three to, axis;
    Doubles d2, versine;
    Mask outside;
    Cone(const LightSample& s, const Three& x) : to(splat3(s.center) - x), d2(dot(to, to)) {
      const double r2 = s.round.radius * s.round.radius;
      axis = choose(d2 > 0, unit(to), Three{Doubles{}, Doubles{}, splat(1)});
      outside = d2 > r2;
      const Doubles sine2 = choose(outside, r2 / d2, splat(1));
      versine = choose(outside, sine2 / (1 + root(1 - sine2)), splat(2));
    }
  };

  static SeenSample at(const LightSample& s, const Three& x, const Cone& cone, const Three& l) {
    const double r2 = s.round.radius * s.round.radius;
    const Doubles b = dot(cone.to, l), half = root(larger(r2 - (cone.d2 - b * b), splat(0)));
    const Three end = x + choose(cone.outside, b - half, b + half) * l;
    const Doubles factor = choose(cone.outside, inverse_square(s, cone.d2) * 2 / (2 - cone.versine),
                                  4 * inverse_square(s, splat(r2)));
    const Doubles uniform = s.physical ? factor : splat(1);
    return {l, end, s.spot.on ? choose(cone.outside, uniform * spot_share(s, l), uniform) : uniform,
            (2 * kCircle) * cone.versine, ~Mask{}};
  }
};

/// A disc that faces who sees it.
struct Disc : SpotTraits {
  static constexpr LightShape kShape = LightShape::kDisc;

  static SeenSample sample(const LightSample& s, const Three& x) {
    const Three axis = unit(splat3(s.center) - x);
    Three t1, t2;
    frame(axis, t1, t2);
    const Three end =
        splat3(s.center) + splat(s.round.radius) * (splat(s.round.x) * t1 + splat(s.round.y) * t2);
    return at(s, x, axis, end, unit(end - x));
  }

  static SeenSample towards(const LightSample& s, const Three& x, const Three& l) {
    const Way to = way(splat3(s.center) - x);
    const Doubles t = to.length / dot(l, to.d);
    const Three end = x + t * l, off = end - splat3(s.center);
    SeenSample seen = at(s, x, to.d, end, l);
    seen.good &= (t > 0) & (dot(off, off) <= s.round.radius * s.round.radius);
    return seen;
  }

 private:
  /// Its point `end`, which is seen in the direction l; axis: the unit direction of its middle.
  static SeenSample at(const LightSample& s, const Three& x, const Three& axis, const Three& end,
                       const Three& l) {
    const Three to = end - x;
    const Doubles z = larger(dot(l, axis), splat(0)), d2 = dot(to, to);
    return {l, end, s.physical ? z * inverse_square(s, d2) : splat(1),
            (kCircle * s.round.radius * s.round.radius) * z / d2, nonzero(axis)};
  }
};

}  // namespace
}  // namespace glint
