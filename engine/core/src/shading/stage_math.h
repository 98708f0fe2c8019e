// What highlights are made of, without branches.
#pragma once
#include "program/functions_exp.h"
#include "shading/scene_shapes.h"

namespace glint {
namespace {

constexpr double kCircle = 3.14159265358979323846;

/// cos^p of the angle whose squared tangent is given, for a cosine > 0: exp(-p/2 log(1 + tan^2)),
/// accurate at any p >= 0.
inline Doubles cosine_power(Doubles tangent2, Doubles p) {
  return exponential(-0.5 * p * logarithm_of_one_and(tangent2, splat(1)));
}

/// (1 - cosine)^p for a cosine of 0 to 1 and p > 0.
inline Doubles grazing_power(Doubles cosine, Doubles p) {
  return exponential(-p * logarithm_of_one_and(cosine, 1 - cosine));
}

/// n.v of the normal that a ray along d sees, 0 where it is turned away from the ray.
inline Doubles seen_cosine(const Three& n, const Three& d) {
  return smaller(larger(-dot(n, d), splat(0)), splat(1));
}

/// (1 - c)^5, what a metal's reflectance gains at a cosine c (Schlick 1994).
inline Doubles schlick_weight(Doubles cosine) {
  const Doubles rest = 1 - cosine, square = rest * rest;
  return square * square * rest;
}

/// Unpolarised reflectance of a smooth dielectric, 1 at total reflection (Fresnel 1823).
inline Doubles fresnel_reflectance(Doubles cosine, Doubles relative_ior) {
  const Doubles sine2 = (1 - cosine * cosine) / (relative_ior * relative_ior),
                beyond = root(1 - sine2);
  const Doubles s = (cosine - relative_ior * beyond) / (cosine + relative_ior * beyond);
  const Doubles p = (relative_ior * cosine - beyond) / (relative_ior * cosine + beyond);
  return choose(sine2 < 1, 0.5 * (s * s + p * p), splat(1));
}

void cosine_powers(const double* tangent2, const double* p, double* out, size_t count) {
  for (size_t k = 0; k < count; ++k) {
    const Doubles power = cosine_power(splat(tangent2[k]), splat(p[k]));
    out[k] = power[0];
  }
}

}  // namespace
}  // namespace glint
