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

/// The angle between two vectors, neither of which need be unit: log(1 + tan^2), and whether it is
/// below a right angle.
struct Slope {
  Doubles log;
  Mask sharp;
};
inline Slope slope(const Three& n, const Three& h) {
  const Doubles c = dot(n, h);
  const Three s = cross(n, h);
  return {logarithm_of_one_and(dot(s, s), c * c), c > 0};
}

/// max(0, cos)^p with 0^0 = 1 (Blinn-Phong, notes 4.13).
inline Doubles highlight(const Slope& at, Doubles p) {
  return choose(p == 0, splat(1), where(at.sharp, exponential(-0.5 * p * at.log)));
}

/// (1 - cosine)^p for a cosine of 0 to 1 and p > 0.
inline Doubles grazing_power(Doubles cosine, Doubles p) {
  return exponential(-p * logarithm_of_one_and(cosine, 1 - cosine));
}

/// n.v of the normal that a ray along d sees, 0 where it is turned away from the ray.
inline Doubles seen_cosine(const Three& n, const Three& d) {
  return smaller(larger(-dot(n, d), splat(0)), splat(1));
}

/// Unpolarised reflectance of a smooth dielectric, 1 at total reflection (Fresnel 1823).
inline Doubles fresnel_reflectance(Doubles cosine, Doubles relative_ior) {
  const Doubles sine2 = (1 - cosine * cosine) / (relative_ior * relative_ior),
                beyond = root(1 - sine2);
  const Doubles s = (cosine - relative_ior * beyond) / (cosine + relative_ior * beyond);
  const Doubles p = (relative_ior * cosine - beyond) / (relative_ior * cosine + beyond);
  return choose(sine2 < 1, 0.5 * (s * s + p * p), splat(1));
}

/// What a highlight is times beside its power (semantics/lobes.md): cosines n.l, n.v and v.h, one
/// light and one direction of view a lane.
class Gloss {
 public:
  Gloss(Doubles nl, Doubles nv, Doubles vh) : nl_(nl), nv_(nv), vh_(vh) {}

  /// masking2: alpha squared, 0 for none. fresnel: as MicrofacetRow has it.  Edged: some lobe of
  /// the scene may have the weight of edges.
  template <bool Edged = false>
  Doubles factor(Doubles masking2, Doubles fresnel) {
    if (bits(masking2 != masking2_)) {
      const Doubles rest = 1 - masking2, down = nl_ * root(masking2 + rest * nv_ * nv_) +
                                                nv_ * root(masking2 + rest * nl_ * nl_);
      masking2_ = masking2;
      masking_ = choose(masking2 > 0, 2 * nl_ / down, splat(1));
    }
    return with_fresnel<Edged>(masking_, fresnel);
  }

  /// The same of a lobe that is stretched: of the directions v and l what the squares of their
  /// parts along the surface are times alpha^2.
  Doubles stretched_factor(Doubles masking2, Doubles fresnel, Doubles v, Doubles l) {
    const Doubles down =
        nl_ * root(nv_ * nv_ + masking2 * v) + nv_ * root(nl_ * nl_ + masking2 * l);
    return with_fresnel<true>(choose(masking2 > 0, 2 * nl_ / down, splat(1)), fresnel);
  }

 private:
  /// The lobes that stand for one of GGX share their reflectance.
  template <bool Edged>
  Doubles with_fresnel(Doubles result, Doubles fresnel) {
    if (bits(fresnel != fresnel_)) {
      fresnel_ = fresnel;
      reflectance_ = choose(fresnel < 0, schlick_weight(), splat(1));
      const Mask edge = fresnel == MicrofacetRow::kEdge;
      if (Edged && bits(edge)) reflectance_ = choose(edge, edge_weight(), reflectance_);
      const Mask dielectric = fresnel > 0;
      if (any(dielectric)) {
        const Doubles ior = choose(dielectric, fresnel, splat(1));
        reflectance_ = choose(dielectric, fresnel_reflectance(vh_, ior), reflectance_);
      }
    }
    return result * reflectance_;
  }
  Doubles schlick_weight() const {
    const Doubles rest = 1 - vh_, square = rest * rest;
    return square * square * rest;
  }
  /// What metals lack some 8 degrees off the surface, where it is 1 (Kutz, Hasan, Edmondson 2021).
  Doubles edge_weight() const { return 823543.0 / 46656 * vh_ * (1 - vh_) * schlick_weight(); }

  Doubles nl_, nv_, vh_, masking2_ = splat(0), masking_ = splat(1);
  Doubles fresnel_ = splat(0), reflectance_ = splat(1);
};

/// About what a highlight of GGX's masking gives back of even light, seen at this cosine: as it
/// does straight from above and where it mirrors, ever less slanting the wider the lobe.
template <bool Edged = true>
inline Doubles of_even_light(Doubles seen, Doubles p, Doubles masking2, Doubles fresnel) {
  const Doubles cosine = root(seen * seen + 2 * (1 - seen * seen) / (p + 8)),
                size = 8 / (p + 2 + 8 / (4 + p * p));
  return size * cosine * Gloss(cosine, cosine, cosine).factor<Edged>(masking2, fresnel);
}

void cosine_powers(const double* tangent2, const double* p, double* out, size_t count) {
  for (size_t k = 0; k < count; ++k) {
    const Doubles power = cosine_power(splat(tangent2[k]), splat(p[k]));
    out[k] = power[0];
  }
}

}  // namespace
}  // namespace glint
