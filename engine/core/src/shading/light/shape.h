// What shapes of lights have in common (notes 4.15, 4.16, scene/light.h). Each is a struct of
// static functions: sample(light, x), as points x see the light's only sample, and towards(light,
// x, l), the one that the unit direction l from x would be; both tell one over the pdf of the
// light's points there. What they have of several is sample_of and sample_towards, below.
#pragma once
#include "shading/light/samples.h"
#include "shading/stage_math.h"

namespace glint {
namespace {

/// The sample as points see it: unit direction l, intensity color * factor, where the shadow
/// segment ends, one over the pdf (a steradian) of the light's points there, and where all this is
/// sound.
struct SeenSample {
  Three l, end;
  Doubles factor, inverse_pdf;
  Mask good;
};

/// The same of a dome, whose colour changes with the direction.
struct SeenCell : SeenSample {
  Three color;
};

/// 1 / (4 pi^2 d^2) in world units from the squared anchored distance.
inline Doubles inverse_square(const LightSample& s, Doubles d2) {
  return smaller(s.scale2 / ((4 * kCircle * kCircle) * d2), splat(1e100));
}

/// The share of a spot's intensity in the direction that is seen as l.
inline Doubles spot_share(const LightSample& s, const Three& l) {
  const Doubles z = -dot(l, splat3(s.axis));
  if (!(s.spot.width > 0)) return where(z > s.spot.cosine, splat(1));
  const Doubles t = smaller(larger((z - s.spot.cosine) / s.spot.width, splat(0)), splat(1));
  return t * t * (3 - 2 * t);
}

/// Of most shapes. kSoftened: the light is so spread out that gloss shows it as if it were matt.
/// kTwoSided: faces that turn away from the light do not see its inner side.
struct ShapeTraits {
  static constexpr bool kSoftened = false, kTwoSided = false;
  static Three color(const LightSample& s, const SeenSample&) { return splat3(s.color); }
  /// How many directions are drawn for each point of the light.
  static double draws(const LightSample&) { return 1; }
  /// Each of the light's samples has its part of the intensity.
  static void share(const LightSample& s, SeenSample& at) {
    if (s.count > 1) at.factor = at.factor / s.count;
    at.good &= at.factor != 0;
  }
};

/// Of point lights, which may be spots.
struct SpotTraits : ShapeTraits {
  static void share(const LightSample& s, SeenSample& at) {
    if (s.spot.on) at.factor = at.factor * spot_share(s, at.l);
    ShapeTraits::share(s, at);
  }
};

template <class Shape>
inline auto sample_of(const LightSample& s, const Three& x) {
  auto at = Shape::sample(s, x);
  Shape::share(s, at);
  return at;
}

template <class Shape>
inline auto sample_towards(const LightSample& s, const Three& x, const Three& l) {
  auto at = Shape::towards(s, x, l);
  Shape::share(s, at);
  return at;
}

}  // namespace
}  // namespace glint
